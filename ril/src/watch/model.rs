//! [`Robot`]: all that the screen knows of one robot. It is fed with samples and told the time; it keeps the newest, the track,
//! the alarms and what happened, and says when the screen changes although nothing comes.

#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::code::{LinkState, MovementKind, PilotSwitch, SafetyAction};
use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{MonotonicNs, RobotId};

use super::alarms::{Alarms, Change, Finding, Kind};
use super::freshness::{Feed, Freshness, OVERDUE_AFTER};
use super::history::History;
use super::journal::{Journal, Weight};
use super::track::Track;
use crate::messages::details;
use crate::pilot::{self, PilotView, Place};

/// Telemetry older than this says nothing of the present: the DSP sends it several times a second.
pub const TELEMETRY_STALE_AFTER: Duration = Duration::from_secs(1);

/// The bridge publishes its state at least once a second, and a machine has some jitter.
const STATE_STALE_AFTER: Duration = Duration::from_millis(1500);

/// Status and relay publish once a second: three of them.
const MODULE_STALE_AFTER: Duration = Duration::from_secs(3);

/// Status and relay publish once a second, so this is late.
const MODULE_OVERDUE_AFTER: Duration = Duration::from_millis(1500);

/// How long a DSP error is shown as an alarm. The journal keeps it.
const DSP_ERROR_SHOWN: Duration = Duration::from_secs(10);

/// Most reached waypoints that are kept for the map: the longest path.
const MAX_REACHED: usize = 1024;

/// The processes that a robot may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// `ril run bridge`
    Bridge,
    /// `ril run status`
    Status,
    /// `ril relay station`
    Relay,
}

impl Process {
    /// All of them.
    pub const ALL: [Process; 3] = [Process::Bridge, Process::Status, Process::Relay];
}

/// The place of take-off: where the robot was last seen on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home {
    /// Where.
    pub place: Place,
    /// Altitude there, m, with the zero of telemetry.
    pub altitude_m: f64,
}

/// A DSP error that was counted.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DspError {
    code: u32,
    is_fatal: bool,
    at: MonotonicNs,
}

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct Robot {
    id: RobotId,
    state: Option<ModuleState>,
    hero: Option<HeroTelemetry>,
    dsp: Option<DspTelemetry>,
    status: Option<State>,
    relay: Option<RelayLink>,
    is_relayed: bool,
    bridge_feed: Feed,
    telemetry_feed: Feed,
    status_feed: Feed,
    relay_feed: Feed,
    pilot: PilotView,
    home: Option<Home>,
    track: Track,
    altitude: History,
    speed: History,
    reached: Vec<Place>,
    lost: u64,
    dsp_error: Option<DspError>,
    alarms: Alarms,
    journal: Journal,
    bells: u32,
}

impl Robot {
    /// A robot of which nothing is known.
    pub fn new(id: RobotId) -> Robot {
        Robot {
            id,
            state: None,
            hero: None,
            dsp: None,
            status: None,
            relay: None,
            is_relayed: false,
            bridge_feed: Feed::new(STATE_STALE_AFTER, OVERDUE_AFTER),
            telemetry_feed: Feed::without_looks(TELEMETRY_STALE_AFTER),
            status_feed: Feed::new(MODULE_STALE_AFTER, MODULE_OVERDUE_AFTER),
            relay_feed: Feed::new(MODULE_STALE_AFTER, MODULE_OVERDUE_AFTER),
            pilot: PilotView::default(),
            home: None,
            track: Track::default(),
            altitude: History::default(),
            speed: History::default(),
            reached: Vec::new(),
            lost: 0,
            dsp_error: None,
            alarms: Alarms::default(),
            journal: Journal::default(),
            bells: 0,
        }
    }

    /// The bridge's state came.
    pub fn state(&mut self, state: &ModuleState, now: MonotonicNs) {
        self.bridge_feed.sample(state.published(), now);
        match self.state.take() {
            Some(before) => self.compare(&before, state, now),
            None => self.note_activity(None, state, now),
        }
        self.state = Some(*state);
    }

    /// Telemetry in SI units came.
    pub fn hero(&mut self, hero: &HeroTelemetry, now: MonotonicNs) {
        self.hero = Some(*hero);
        self.telemetry(now);
    }

    /// Raw telemetry came. It counts where no telemetry in SI units comes.
    pub fn dsp(&mut self, dsp: &DspTelemetry, now: MonotonicNs) {
        self.dsp = Some(*dsp);
        // Status makes the same of it within a millisecond.
        if !self.status_feed.at(now).is_fresh() || self.hero.is_none() {
            self.telemetry(now);
        }
    }

    /// The state of the process status came.
    pub fn status(&mut self, status: &State, now: MonotonicNs) {
        self.status_feed
            .sample(MonotonicNs(status.published_ns), now);
        self.status = Some(*status);
    }

    /// The state of the relay's link came.
    pub fn relay(&mut self, relay: &RelayLink, now: MonotonicNs) {
        self.relay_feed.sample(relay.published(), now);
        self.relay = Some(*relay);
    }

    /// Whether `process` lives.
    pub fn provider(&mut self, process: Process, lives: bool, now: MonotonicNs) {
        self.feed_mut(process).provider(lives, now);
    }

    /// Whether the robot's topics come from another machine.
    pub fn relayed(&mut self, is_relayed: bool) {
        self.is_relayed = is_relayed;
    }

    /// How many samples of telemetry were lost so far.
    pub fn losses(&mut self, lost: u64) {
        self.lost = lost;
    }

    /// Adds a line about an order that this screen has sent.
    pub fn order(&mut self, at: MonotonicNs, weight: Weight, text: impl Into<String>) {
        self.journal.add(at, weight, text);
    }

    /// Judges what is wrong at `now`. To be called after samples, and when [`Robot::next`] says so.
    pub fn judge(&mut self, now: MonotonicNs) {
        let findings = self.findings(now);
        for change in self.alarms.update(findings, now) {
            match change {
                Change::Began(alarm) => {
                    self.bells += u32::from(alarm.weight == Weight::Alarm);
                    self.journal.add(now, alarm.weight, alarm.text);
                }
                Change::Ended(alarm) => {
                    let is_known = self.bridge_feed.at(now).is_fresh();
                    let what = if is_known {
                        "over"
                    } else {
                        "not known any more"
                    };
                    let text = format!("{what}: {}", alarm.text);
                    self.journal.add(now, Weight::Note, text);
                }
            }
        }
    }

    /// The processes that are to be looked for now.
    pub fn looks_due(&self, now: MonotonicNs) -> impl Iterator<Item = Process> + use<> {
        let due = Process::ALL.map(|process| self.feed(process).look_due(now));
        let processes = Process::ALL.into_iter().zip(due);
        processes.filter_map(|(process, is_due)| is_due.then_some(process))
    }

    /// When the screen changes although nothing comes.
    pub fn next(&self, now: MonotonicNs) -> Option<MonotonicNs> {
        let feeds = [
            &self.bridge_feed,
            &self.telemetry_feed,
            &self.status_feed,
            &self.relay_feed,
        ];
        let error = self.dsp_error.map(|error| error.at + DSP_ERROR_SHOWN);
        feeds
            .into_iter()
            .filter_map(|feed| feed.next(now))
            .chain(error.filter(|end| *end > now))
            .chain(self.alarms.next())
            .min()
    }

    /// How often the bell is to ring for what began since the last call.
    pub fn take_bells(&mut self) -> u32 {
        std::mem::take(&mut self.bells)
    }

    fn feed(&self, process: Process) -> &Feed {
        match process {
            Process::Bridge => &self.bridge_feed,
            Process::Status => &self.status_feed,
            Process::Relay => &self.relay_feed,
        }
    }

    fn feed_mut(&mut self, process: Process) -> &mut Feed {
        match process {
            Process::Bridge => &mut self.bridge_feed,
            Process::Status => &mut self.status_feed,
            Process::Relay => &mut self.relay_feed,
        }
    }

    fn telemetry(&mut self, now: MonotonicNs) {
        let before = self.pilot;
        let view = PilotView::of(self.hero.as_ref(), self.dsp.as_ref());
        let Some(received) = view.received else {
            return;
        };
        self.pilot = view;
        self.telemetry_feed.sample(received, now);
        self.altitude.push(view.altitude_m, now);
        self.speed.push(view.ground_speed_mps, now);
        if let Some(place) = view.place {
            self.track.push(place);
            if let (Some(altitude_m), Some(false)) = (view.altitude_m, view.flying) {
                self.home = Some(Home { place, altitude_m });
            }
        }
        if before.flying.is_some() && before.flying != view.flying {
            let text = match view.flying {
                Some(true) => "in the air",
                _ => "on the ground",
            };
            self.journal.add(now, Weight::Note, text);
        }
    }

    /// Notes what changed from one state of the bridge to the next.
    fn compare(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
        let is_same_bridge = before.epoch_ns == state.epoch_ns;
        if !is_same_bridge {
            self.journal
                .add(now, Weight::Note, "the bridge was started again");
        }
        self.note_movement(before, state, now);
        self.note_activity(Some(before), state, now);
        if before.link.state() != state.link.state() && state.link.state() == Some(LinkState::Up) {
            self.journal.add(now, Weight::Note, "link to the DSP up");
        }
        if is_same_bridge
            && before.link.dsp_boots != 0
            && before.link.dsp_boots < state.link.dsp_boots
        {
            self.journal.add(now, Weight::Warning, "the DSP rebooted");
        }
        let switch = state.safety.pilot_switch();
        if before.safety.pilot_switch() != switch
            && let Some(switch @ (PilotSwitch::Manual | PilotSwitch::Auto)) = switch
        {
            let text = format!("pilot's switch on {switch}");
            self.journal.add(now, Weight::Note, text);
        }
        if is_same_bridge && before.safety.interventions < state.safety.interventions {
            let text = "a safety rule refused or ended a movement";
            self.journal.add(now, Weight::Warning, text);
        }
        let errors = &state.dsp_errors;
        if is_same_bridge && before.dsp_errors.total < errors.total {
            self.dsp_error = Some(DspError {
                code: errors.last_code,
                is_fatal: before.dsp_errors.escalated < errors.escalated,
                at: now,
            });
        }
    }

    fn note_activity(
        &mut self,
        before: Option<&ModuleState>,
        state: &ModuleState,
        now: MonotonicNs,
    ) {
        let flying = self.pilot.flying;
        let of = |state: &ModuleState| {
            let functionality = state.functionality()?;
            Some(pilot::activity(functionality, flying))
        };
        if before.and_then(of) != of(state)
            && let Some(activity) = of(state)
        {
            self.journal.add(now, Weight::Note, activity);
        }
    }

    fn note_movement(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
        let (was, movement) = (&before.movement, &state.movement);
        if was.request_id != movement.request_id || was.path_id != movement.path_id {
            self.reached.clear();
            let order = match movement.kind() {
                Some(MovementKind::GoToWaypoint) => {
                    format!("order: path of {} waypoints", movement.waypoints_total)
                }
                Some(kind) => format!("order: {kind}"),
                None => return,
            };
            self.journal.add(now, Weight::Order, order);
        } else if was.waypoints_reached < movement.waypoints_reached {
            let (reached, total) = (movement.waypoints_reached, movement.waypoints_total);
            let text = format!("waypoint {reached} of {total} reached");
            self.journal.add(now, Weight::Note, text);
            if let Some(place) = self.pilot.place
                && self.reached.len() < MAX_REACHED
            {
                self.reached.push(place);
            }
        }
    }

    /// All that is wrong. What follows from another finding is left out: one cause is one alarm.
    fn findings(&self, now: MonotonicNs) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut add = |kind, weight, text: String| findings.push(Finding { kind, weight, text });
        if let Some((kind, text)) = self.cut(now) {
            add(kind, Weight::Alarm, text);
        } else {
            let age = self.telemetry_feed.at(now).age();
            if let Some(age) = age {
                let text = format!("telemetry is {age}");
                add(Kind::Telemetry, Weight::Alarm, text);
            }
            if let Some(state) = &self.state {
                self.judge_state(state, now, &mut add);
            }
        }
        let has_no_fix = self.pilot.gps.is_some_and(|gps| !gps.is_there());
        if has_no_fix && self.pilot.flying == Some(true) {
            add(
                Kind::NoFix,
                Weight::Alarm,
                "no GPS fix in flight".to_owned(),
            );
        }
        if matches!(self.status_feed.at(now), Freshness::Gone(_)) {
            let text = "`ril run status` has ended: telemetry is the bridge's own, and no logs are written";
            add(Kind::StatusGone, Weight::Warning, text.to_owned());
        }
        findings
    }

    /// Where the way from the DSP to here is cut, nearest to here first.
    fn cut(&self, now: MonotonicNs) -> Option<(Kind, String)> {
        if self.is_relayed {
            let relay = self.relay.as_ref();
            let feed = self.relay_feed.at(now);
            if !feed.is_fresh() || !relay.is_some_and(RelayLink::is_up) {
                let state = relay.and_then(RelayLink::state);
                let state = state.map_or("unknown", |state| state.name());
                let text = match feed.age() {
                    Some(age) => format!("relay's link {state}, {age}"),
                    None => format!("relay's link {state}"),
                };
                return Some((Kind::RelayLink, text));
            }
        }
        match self.bridge_feed.at(now) {
            Freshness::Gone(_) => {
                let text = format!("the bridge is gone: start `ril bridge --robot {}`", self.id);
                return Some((Kind::BridgeGone, text));
            }
            Freshness::Stale(_) => {
                let text = "the bridge says nothing: is it stopped, or is the machine overloaded?";
                return Some((Kind::BridgeSilent, text.to_owned()));
            }
            Freshness::Absent | Freshness::Waiting | Freshness::Fresh => {}
        }
        let link = self.state.as_ref()?.link;
        match link.state() {
            Some(LinkState::Up) => None,
            Some(state) => Some((Kind::DspLink, format!("link to the DSP {state}"))),
            None => Some((
                Kind::DspLink,
                format!("link to the DSP unknown-{}", link.state),
            )),
        }
    }

    fn judge_state(
        &self,
        state: &ModuleState,
        now: MonotonicNs,
        add: &mut impl FnMut(Kind, Weight, String),
    ) {
        let safety = &state.safety;
        if safety.rule != 0 {
            let rule = safety.rule();
            let name =
                rule.map_or_else(|| format!("rule {}", safety.rule), |rule| rule.to_string());
            let by = rule.and_then(|rule| details::amount(rule, safety.amount));
            let by = by.map_or_else(String::new, |by| format!(" {by}"));
            let action = safety.action().map_or("unknown action", SafetyAction::name);
            let weight = match safety.action() {
                Some(SafetyAction::Warn) => Weight::Warning,
                _ => Weight::Alarm,
            };
            let text = format!("{name}{by}: {action}");
            add(Kind::Safety(safety.rule), weight, text);
        }
        if let Some(error) = self.dsp_error
            && now.since(error.at) < DSP_ERROR_SHOWN
        {
            let weight = if error.is_fatal {
                Weight::Alarm
            } else {
                Weight::Warning
            };
            add(
                Kind::DspError(error.code),
                weight,
                details::dsp_error(error.code),
            );
        }
        if state.is_blocked() && state.imi_error != 0 {
            let text = format!(
                "movements are blocked until `ril start`: {}",
                state.imi_error()
            );
            add(Kind::Blocked(state.imi_error), Weight::Warning, text);
        }
    }
}

/// What the screen shows.
impl Robot {
    /// The robot.
    pub fn id(&self) -> RobotId {
        self.id
    }

    /// The bridge's newest state.
    pub fn last_state(&self) -> Option<&ModuleState> {
        self.state.as_ref()
    }

    /// The newest state of the process status.
    pub fn last_status(&self) -> Option<&State> {
        self.status.as_ref()
    }

    /// The newest state of the relay's link; nothing when the robot is on this machine.
    pub fn last_relay(&self) -> Option<&RelayLink> {
        self.relay.as_ref().filter(|_| self.is_relayed)
    }

    /// Whether the robot's topics come from another machine.
    pub fn is_relayed(&self) -> bool {
        self.is_relayed
    }

    /// What the newest telemetry says.
    pub fn pilot(&self) -> &PilotView {
        &self.pilot
    }

    /// How `process` is.
    pub fn process(&self, process: Process, now: MonotonicNs) -> Freshness {
        self.feed(process).at(now)
    }

    /// How telemetry is.
    pub fn telemetry_freshness(&self, now: MonotonicNs) -> Freshness {
        self.telemetry_feed.at(now)
    }

    /// Where the robot was last seen on the ground.
    pub fn home(&self) -> Option<Home> {
        self.home
    }

    /// Height over the place of take-off, m.
    pub fn height_m(&self) -> Option<f64> {
        Some(self.pilot.altitude_m? - self.home?.altitude_m)
    }

    /// Where the robot was.
    pub fn track(&self) -> &[Place] {
        self.track.points()
    }

    /// Where it was when it reached the waypoints of the path under way, or of the last.
    pub fn reached(&self) -> &[Place] {
        &self.reached
    }

    /// Altitude over time.
    pub fn altitude(&self) -> &History {
        &self.altitude
    }

    /// Speed over ground over time.
    pub fn speed(&self) -> &History {
        &self.speed
    }

    /// Samples of telemetry that were lost between processes.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// What is wrong now.
    pub fn alarms(&self) -> &Alarms {
        &self.alarms
    }

    /// What happened.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}
