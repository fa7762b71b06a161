//! What changes from one state of the bridge to the next, in words: for the screen of `ril watch` and the log in a
//! flight record.
//!
//! [`Alarms`]: what is wrong now. Each alarm is reported once when it begins and once when it is over; one that comes
//! and goes is reported once as well.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{LinkState, MovementKind, PilotSwitch};
use ipc_types::payload::{ControlSender, ModuleState};
use ros_messages::Level;
use runtime::finding::{Finding, Severity};
use serde::{Deserialize, Serialize};

use crate::robot::controller::Senders;
use crate::robot::pilot;

/// How much an event matters, to a page, on a terminal and in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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

/// The level of ROS 2 that a weight has.
impl From<Weight> for Level {
    fn from(weight: Weight) -> Level {
        match weight {
            Weight::Note | Weight::Order => Level::Info,
            Weight::Warning => Level::Warn,
            Weight::Alarm => Level::Error,
        }
    }
}

/// What changed, each in a line.
pub fn of_states(before: &ModuleState, state: &ModuleState) -> Vec<(Weight, String)> {
    let mut lines = Vec::new();
    let mut add = |weight, text: String| lines.push((weight, text));
    if state.last_end.is_another_than(&before.last_end)
        && let Some(text) = pilot::ended_early(state)
    {
        add(Weight::Warning, text);
    }
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

/// An alarm that is over for less than this and comes back is the same one: it is not reported again. Several seconds,
/// so that a link which loses every other message does not fill the journal.
pub const SAME_WITHIN: Duration = Duration::from_secs(5);

/// Most alarms at a time: there are fewer kinds, but for DSP errors, of which there are 65,536. Further ones are not
/// shown.
const MAX_ALARMS: usize = 32;

/// An alarm that lasts, or was over a short while ago.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// What is wrong, with the present amount. Name and number make it this alarm; the amount changes while it lasts.
    pub finding: Finding,
    /// When it began.
    pub since: MonotonicNs,
    /// Since when it is over; `None` if it lasts.
    ended: Option<MonotonicNs>,
    /// Its place among the findings: what matters more is found first.
    rank: usize,
}

impl Alarm {
    /// How much it matters.
    pub fn weight(&self) -> Weight {
        match self.finding.severity {
            Severity::Note => Weight::Note,
            Severity::Warning => Weight::Warning,
            Severity::Error => Weight::Alarm,
        }
    }

    fn is_about(&self, finding: &Finding) -> bool {
        (self.finding.id, &self.finding.items) == (finding.id, &finding.items)
    }
}

/// What is to be reported.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// An alarm has begun.
    Began(Alarm),
    /// An alarm is over.
    Ended(Alarm),
}

/// What is wrong now: each alarm is reported once when it begins and once when it is over.
#[derive(Clone, Debug, Default)]
pub struct Alarms {
    alarms: Vec<Alarm>,
}

impl Alarms {
    /// Takes all that is wrong at `now`, and gives what is to be reported.
    pub fn update(&mut self, findings: Vec<Finding>, now: MonotonicNs) -> Vec<Change> {
        let mut changes = Vec::new();
        for alarm in &mut self.alarms {
            let lasts = findings.iter().any(|finding| alarm.is_about(finding));
            match (lasts, alarm.ended) {
                (true, _) => alarm.ended = None,
                (false, None) => alarm.ended = Some(now),
                (false, Some(_)) => {}
            }
        }
        self.alarms.retain(|alarm| {
            let is_over = alarm
                .ended
                .is_some_and(|ended| now.since(ended) >= SAME_WITHIN);
            if is_over {
                changes.push(Change::Ended(alarm.clone()));
            }
            !is_over
        });
        for (rank, finding) in findings.into_iter().enumerate() {
            let is_full = self.alarms.len() >= MAX_ALARMS;
            let mut alarms = self.alarms.iter_mut();
            match alarms.find(|alarm| alarm.is_about(&finding)) {
                Some(alarm) => (alarm.finding, alarm.rank) = (finding, rank),
                None if !is_full => {
                    let alarm = Alarm {
                        finding,
                        since: now,
                        ended: None,
                        rank,
                    };
                    changes.push(Change::Began(alarm.clone()));
                    self.alarms.push(alarm);
                }
                None => {}
            }
        }
        self.alarms.sort_by_key(|alarm| {
            (
                std::cmp::Reverse(alarm.finding.severity),
                alarm.ended.is_some(),
                alarm.rank,
            )
        });
        changes
    }

    /// The alarms that last, the worst first.
    pub fn lasting(&self) -> impl Iterator<Item = &Alarm> {
        self.alarms.iter().filter(|alarm| alarm.ended.is_none())
    }

    /// When an alarm is over for good if nothing changes.
    pub fn next(&self) -> Option<MonotonicNs> {
        let ends = self.alarms.iter().filter_map(|alarm| alarm.ended);
        ends.map(|ended| ended + SAME_WITHIN).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use runtime::finding::Severity;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn finding(id: &'static str, text: &str) -> Finding {
        Finding::new(Severity::Error, id, text)
    }

    fn link() -> Vec<Finding> {
        vec![finding("dsp-link", "silent")]
    }

    #[test]
    fn an_alarm_is_reported_when_it_begins_and_when_it_is_over() {
        let mut alarms = Alarms::default();
        let changes = alarms.update(link(), at(0));
        assert!(matches!(&changes[..], [Change::Began(alarm)] if alarm.since == at(0)));
        assert!(alarms.update(link(), at(100)).is_empty());
        assert!(alarms.update(vec![], at(200)).is_empty());
        assert_eq!(alarms.lasting().count(), 0, "it is not shown any more");
        assert_eq!(alarms.next(), Some(at(5200)));
        let changes = alarms.update(vec![], at(5200));
        assert!(matches!(&changes[..], [Change::Ended(alarm)] if alarm.finding.id == "dsp-link"));
        assert_eq!(alarms.next(), None);
    }

    #[test]
    fn an_alarm_that_comes_and_goes_is_reported_once() {
        let mut alarms = Alarms::default();
        let mut reported = 0;
        for second in 0..60 {
            let findings = if second % 2 == 0 { link() } else { vec![] };
            reported += alarms.update(findings, at(second * 1000)).len();
        }
        assert_eq!(reported, 1);
    }

    #[test]
    fn an_amount_that_changes_is_shown_and_is_no_other_alarm() {
        let mut alarms = Alarms::default();
        let battery = |text| vec![finding("safety", text).about(6)];
        alarms.update(battery("by 0.3 V"), at(0));
        assert!(alarms.update(battery("by 0.4 V"), at(1)).is_empty());
        assert_eq!(alarms.lasting().next().unwrap().finding.text, "by 0.4 V");
    }

    #[test]
    fn the_worst_comes_first_and_a_flood_is_bounded() {
        let mut alarms = Alarms::default();
        let flood = (0..1000).map(|code| finding("dsp-error", "").about(code));
        let status_gone = Finding::new(Severity::Warning, "status-gone", "");
        let flood: Vec<Finding> = [status_gone, finding("bridge-gone", "")]
            .into_iter()
            .chain(flood)
            .collect();
        assert_eq!(alarms.update(flood, at(0)).len(), MAX_ALARMS);
        let ids: Vec<&str> = alarms.lasting().map(|alarm| alarm.finding.id).collect();
        assert_eq!(
            (ids[0], ids[MAX_ALARMS - 1]),
            ("bridge-gone", "status-gone")
        );
    }
}
