//! What changes from one state of the bridge to the next, in words: for the screen of `ril watch` and the log in a flight record.

use ipc_types::code::{LinkState, MovementKind, PilotSwitch};
use ipc_types::payload::{ControlSender, ModuleState};
use runtime::finding::Severity;

use crate::robot::controller::Senders;

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// Something went on as it should.
    Note,
    /// An order, or what became of it.
    Order,
    /// Something to look at.
    Warning,
    /// Something to act on.
    Alarm,
}

impl Weight {
    /// What stands before a line, so that it does not need colour.
    pub fn mark(self) -> &'static str {
        match self {
            Weight::Note => " ",
            Weight::Order => ">",
            Weight::Warning => "!",
            Weight::Alarm => "!!",
        }
    }
}

impl From<Severity> for Weight {
    fn from(severity: Severity) -> Weight {
        match severity {
            Severity::Note => Weight::Note,
            Severity::Warning => Weight::Warning,
            Severity::Error => Weight::Alarm,
        }
    }
}

/// What changed, each in a line.
pub fn of_states(before: &ModuleState, state: &ModuleState) -> Vec<(Weight, String)> {
    let mut lines = Vec::new();
    let mut add = |weight, text: String| lines.push((weight, text));
    let is_same_bridge = before.epoch_ns == state.epoch_ns;
    if !is_same_bridge {
        add(Weight::Note, "the bridge was started again".to_owned());
    }
    if let Some((weight, text)) = of_movement(before, state) {
        add(weight, text);
    }
    if before.link.state() != state.link.state() && state.link.state() == Some(LinkState::Up) {
        add(Weight::Note, "link to the DSP up".to_owned());
    }
    if is_same_bridge && before.link.dsp_boots != 0 && before.link.dsp_boots < state.link.dsp_boots
    {
        add(Weight::Warning, "the DSP rebooted".to_owned());
    }
    of_control(before, state, &mut add);
    let switch = state.safety.pilot_switch();
    if before.safety.pilot_switch() != switch
        && let Some(switch @ (PilotSwitch::Manual | PilotSwitch::Auto)) = switch
    {
        add(Weight::Note, format!("pilot's switch on {switch}"));
    }
    if is_same_bridge && before.safety.interventions < state.safety.interventions {
        let text = "a safety rule refused or ended a movement";
        add(Weight::Warning, text.to_owned());
    }
    lines
}

/// What is new about who commands, where that is exclusive.
fn of_control(before: &ModuleState, state: &ModuleState, add: &mut impl FnMut(Weight, String)) {
    if state.control.exclusive == 0 {
        return;
    }
    let who = |sender: ControlSender| [sender.origin, sender.session];
    let names = Senders::default();
    let holder = state.holder();
    if before.holder().map(who) != holder.map(who) {
        add(
            Weight::Note,
            match holder {
                Some(holder) => format!("{} has control", names.name(&holder)),
                None => "control is free".to_owned(),
            },
        );
    }
    if let Some(asker) = state.asker()
        && before.asker().map(who) != Some(who(asker))
    {
        let text = format!("{} asks for control", names.name(&asker));
        add(Weight::Warning, text);
    }
}

/// Whether another movement is under way than before.
pub fn is_another_movement(before: &ModuleState, state: &ModuleState) -> bool {
    let (was, movement) = (&before.movement, &state.movement);
    was.request_id != movement.request_id || was.path_id != movement.path_id
}

/// What is new about the movement.
fn of_movement(before: &ModuleState, state: &ModuleState) -> Option<(Weight, String)> {
    let (was, movement) = (&before.movement, &state.movement);
    if is_another_movement(before, state) {
        let order = match movement.kind()? {
            MovementKind::GoToWaypoint => {
                format!("order: path of {} waypoints", movement.waypoints_total)
            }
            kind => format!("order: {kind}"),
        };
        return Some((Weight::Order, order));
    }
    (was.waypoints_reached < movement.waypoints_reached).then(|| {
        let (reached, total) = (movement.waypoints_reached, movement.waypoints_total);
        (
            Weight::Note,
            format!("waypoint {reached} of {total} reached"),
        )
    })
}
