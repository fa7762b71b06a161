//! [`Robot`]: all that the screen knows of one robot. It is given samples and the time; it keeps the newest, the track,
//! the alarms and what happened, and says when the screen changes although nothing comes. What is wrong is in `findings`.

mod findings;
#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{MonotonicNs, RobotId};

use super::alarms::{Alarms, Change};
use super::freshness::{Feed, Freshness, OVERDUE_AFTER};
use super::history::{History, Journal};
use crate::robot::changes::Weight;
use crate::robot::geo::Place;
use crate::robot::geo::Track;
use crate::robot::pilot::PilotView;
use crate::robot::{changes, pilot};

/// Telemetry older than this says nothing of the present: the DSP sends it several times a second.
pub const TELEMETRY_STALE_AFTER: Duration = Duration::from_secs(1);

/// Every module publishes its state at least once a second: three of them.
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
    /// Telemetry altitude there, m.
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
            bridge_feed: Feed::new(MODULE_STALE_AFTER, OVERDUE_AFTER),
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
                    let weight = alarm.weight();
                    self.bells += u32::from(weight == Weight::Alarm);
                    self.journal.add(now, weight, alarm.finding.text);
                }
                Change::Ended(alarm) => {
                    let is_known = self.bridge_feed.at(now).is_fresh();
                    let what = if is_known {
                        "over"
                    } else {
                        "not known any more"
                    };
                    let text = format!("{what}: {}", alarm.finding.text);
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
}

impl Robot {
    /// Notes what changed from one state of the bridge to the next.
    pub(super) fn compare(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
        for (weight, text) in changes::of_states(before, state) {
            self.journal.add(now, weight, text);
        }
        self.follow_movement(before, state);
        self.note_activity(Some(before), state, now);
        let is_same_bridge = before.epoch_ns == state.epoch_ns;
        let errors = &state.dsp_errors;
        if is_same_bridge && before.dsp_errors.total < errors.total {
            self.dsp_error = Some(DspError {
                code: errors.last_code,
                is_fatal: before.dsp_errors.escalated < errors.escalated,
                at: now,
            });
        }
    }

    pub(super) fn note_activity(
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

    /// Keeps the places of the waypoints that were reached.
    fn follow_movement(&mut self, before: &ModuleState, state: &ModuleState) {
        if changes::is_another_movement(before, state) {
            self.reached.clear();
        } else if before.movement.waypoints_reached < state.movement.waypoints_reached
            && let Some(place) = self.pilot.place
            && self.reached.len() < MAX_REACHED
        {
            self.reached.push(place);
        }
    }
}

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

    /// The newest state of the relay's link; `None` if the robot is on this machine.
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
