//! [`WatchedRobot`]: all that the screen knows of one robot. It is given samples and the time; it keeps the newest, the
//! track, the alarms and what happened, and says when the screen changes although nothing comes; and what is wrong with
//! the robot, and where the way from its DSP to here is cut.

#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::code::LinkState;
use ipc_types::module::State;
use ipc_types::outline::Outline;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink, RelayStations};
use ipc_types::{Module, MonotonicNs, RobotId, StatusModule, Topic};
use runtime::finding::{Finding, Severity};

use crate::render::messages::details;
use crate::robot::changes::{self, Alarms, Change, Weight};
use crate::robot::chart::Chart;
use crate::robot::controller::Senders;
use crate::robot::freshness::{
    Feed, Freshness, MODULE_OVERDUE_AFTER, MODULE_STALE_AFTER, OVERDUE_AFTER, named,
};
use crate::robot::geo::{Place, Track, distance_m};
use crate::robot::history::{EventLog, Past};
use crate::robot::pilot::{self, PilotView};
use crate::robot::relay_link::STATIONS_STALE_AFTER;

/// Telemetry older than this says nothing of the present: the DSP sends it several times a second.
pub const TELEMETRY_STALE_AFTER: Duration = Duration::from_secs(1);

/// How long a DSP error is shown as an alarm. The journal keeps it.
const DSP_ERROR_SHOWN: Duration = Duration::from_secs(10);

/// The alarm that nothing of a robot on another machine comes.
const RELAY_LINK: &str = "relay-link";

/// A longer pause between two places is no flight that was seen.
const TRACK_GAP: Duration = Duration::from_millis(1500);

/// What is quicker than this is no flight, but another fix, m/s.
const TRACK_MAX_MPS: f64 = 100.0;

/// A jump by less than this is the noise of a GPS, m.
const TRACK_JUMP_M: f64 = 5.0;

/// Within so long no helicopter lands and takes off again: after a longer pause of the telemetry it is not known when
/// the flight began.
const UNSEEN_LANDING: Duration = Duration::from_secs(10);

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

    /// Key of the topic that the process publishes at least once a second, so that silence is a reason to look for the
    /// process.
    pub const fn key(self) -> &'static str {
        match self {
            Process::Bridge => ModuleState::KEY,
            Process::Status => StatusModule::STATE_KEY,
            Process::Relay => RelayLink::KEY,
        }
    }
}

/// Where the robot stands, and in the air where it took off: as its bridge says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home {
    /// Where.
    pub place: Place,
    /// Telemetry altitude there, m.
    pub altitude_m: f64,
}

/// What a bridge holds.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutline {
    /// Fence and path in the bridge's words.
    pub outline: Outline,
    /// Fence and path as they are drawn.
    pub chart: Chart,
}

/// A DSP error that was counted.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DspError {
    code: u32,
    is_fatal: bool,
    at: MonotonicNs,
}

/// All that a screen or a page knows of a robot.
#[derive(Clone, Debug)]
pub struct WatchedRobot {
    /// Which robot.
    pub id: RobotId,
    /// The bridge's newest state.
    pub state: Option<ModuleState>,
    hero: Option<HeroTelemetry>,
    dsp: Option<DspTelemetry>,
    /// The newest state of the process status.
    pub status: Option<State>,
    relay: Option<RelayLink>,
    /// The stations that the robot is relayed to.
    stations: Option<RelayStations>,
    /// Whether the robot's topics come from another machine.
    pub is_relayed: bool,
    /// The session of this process.
    pub own_session: Option<u32>,
    /// How old the newest sample of each process is.
    feeds: [Feed; Process::ALL.len()],
    telemetry_feed: Feed,
    /// What the live bridge holds; `None` if it has not said it.
    pub held: Option<HeldOutline>,
    /// When the bridge was first seen to have another movement than before; `None` if it was not.
    pub last_movement: Option<MonotonicNs>,
    /// The state of the link, and when it was first seen.
    link_seen: Option<(u32, MonotonicNs)>,
    /// What the newest telemetry says.
    pub pilot: PilotView,
    /// Where it stands, or took off.
    pub home: Option<Home>,
    /// Where it was when that was last known, and when.
    pub last_place: Option<(Place, MonotonicNs)>,
    /// Since when it is in the air; `None` if it is not, or its take-off was not seen.
    pub airborne: Option<MonotonicNs>,
    /// Where it was.
    pub track: Track,
    /// Its last minutes.
    pub past: Past,
    /// Where it was when it reached the waypoints of the path under way, or of the last.
    pub reached: Vec<Place>,
    /// Samples of telemetry that were lost between processes.
    pub lost: u64,
    dsp_error: Option<DspError>,
    /// What is wrong now.
    pub alarms: Alarms,
    /// What happened.
    pub journal: EventLog,
    bells: u32,
}

impl WatchedRobot {
    /// A robot of which nothing is known.
    pub fn new(id: RobotId) -> WatchedRobot {
        WatchedRobot {
            id,
            state: None,
            hero: None,
            dsp: None,
            status: None,
            relay: None,
            stations: None,
            is_relayed: false,
            own_session: None,
            feeds: Process::ALL.map(|process| {
                let overdue_after = match process {
                    Process::Bridge => OVERDUE_AFTER,
                    Process::Status | Process::Relay => MODULE_OVERDUE_AFTER,
                };
                Feed::new(MODULE_STALE_AFTER, overdue_after)
            }),
            telemetry_feed: Feed::without_looks(TELEMETRY_STALE_AFTER),
            held: None,
            last_movement: None,
            link_seen: None,
            pilot: PilotView::default(),
            home: None,
            last_place: None,
            airborne: None,
            track: Track::default(),
            past: Past::default(),
            reached: Vec::new(),
            lost: 0,
            dsp_error: None,
            alarms: Alarms::default(),
            journal: EventLog::default(),
            bells: 0,
        }
    }

    /// The bridge's state came.
    pub fn state(&mut self, state: &ModuleState, now: MonotonicNs) {
        self.heard(Process::Bridge, state.published(), now);
        if self
            .link_seen
            .is_none_or(|(link, _)| link != state.link.state)
        {
            self.link_seen = Some((state.link.state, now));
        }
        match self.state.take() {
            Some(before) => {
                if before.movement.request_id != state.movement.request_id {
                    self.last_movement = Some(state.published());
                }
                self.compare(&before, state, now);
            }
            None => self.note_activity(None, state, now),
        }
        self.home = state.home().and_then(|home| {
            Some(Home {
                place: Place::new(home.latitude_deg, home.longitude_deg)?,
                altitude_m: home.altitude_m,
            })
        });
        self.state = Some(*state);
    }

    /// The live bridge said what it holds.
    pub fn held(&mut self, outline: &Outline) {
        self.held = Some(HeldOutline {
            outline: outline.clone(),
            chart: Chart::from(outline),
        });
    }

    /// Who commands; `None` if no sender does.
    pub fn commander(&self) -> Option<String> {
        let holder = self.state.as_ref()?.holder()?;
        let senders = Senders {
            own_session: self.own_session.filter(|_| !self.is_relayed),
            stations: self.stations.as_ref(),
        };
        Some(senders.name(&holder))
    }

    /// Whether this process commands, or another one of its session.
    pub fn is_commanded_from_here(&self) -> bool {
        let holder = self.state.as_ref().and_then(ModuleState::holder);
        let own = self.own_session.filter(|_| !self.is_relayed);
        own.is_some()
            && holder.is_some_and(|holder| holder.origin == 0 && Some(holder.session) == own)
    }

    /// Whether the bridge holds another outline than the last one that came.
    pub fn is_held_outdated(&self) -> bool {
        let number = self.state.as_ref().map(|state| state.outline);
        let held = self.held.as_ref().map(|held| held.outline.number);
        number.is_some() && held.is_some() && number != held
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
        if !self.process(Process::Status, now).is_fresh() || self.hero.is_none() {
            self.telemetry(now);
        }
    }

    /// The state of the process status came.
    pub fn status(&mut self, status: &State, now: MonotonicNs) {
        let published = MonotonicNs(status.published_ns);
        self.heard(Process::Status, published, now);
        self.status = Some(*status);
    }

    /// The state of the relay's link came.
    pub fn relay(&mut self, relay: &RelayLink, now: MonotonicNs) {
        self.heard(Process::Relay, relay.published(), now);
        self.relay = Some(*relay);
    }

    /// The stations that the robot is relayed to came.
    pub fn stations(&mut self, stations: &RelayStations) {
        self.stations = Some(*stations);
    }

    /// Whether `process` lives.
    pub fn provider(&mut self, process: Process, lives: bool, now: MonotonicNs) {
        self.feeds[process as usize].provider(lives, now);
    }

    /// Judges what is wrong at `now`, and keeps how it is. To be called after samples, and when [`WatchedRobot::next`]
    /// says so.
    pub fn judge(&mut self, now: MonotonicNs) {
        self.keep(now);
        let findings = self.findings(now);
        for change in self.alarms.update(findings, now) {
            match change {
                Change::Began(alarm) => {
                    let weight = alarm.weight();
                    self.bells += u32::from(weight == Weight::Alarm);
                    self.journal.add(now, weight, alarm.finding.text);
                }
                Change::Ended(alarm) => {
                    let is_known = self.process(Process::Bridge, now).is_fresh();
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

    /// Keeps how it is at `now` for plots. What is not of the present is a gap.
    fn keep(&mut self, now: MonotonicNs) {
        let is_fresh = self.telemetry_freshness(now).is_fresh();
        self.past.push(is_fresh.then_some(&self.pilot), now);
        let state = self.state.as_ref();
        let state = state.filter(|_| self.process(Process::Bridge, now).is_fresh());
        let functionality = state.and_then(ModuleState::functionality);
        let flying = self.pilot.flying;
        self.past
            .phase(functionality.map(|one| pilot::activity(one, flying)), now);
    }

    /// The processes that are to be looked for now.
    pub fn looks_due(&self, now: MonotonicNs) -> impl Iterator<Item = Process> + use<> {
        let due = self.feeds.map(|feed| feed.look_due(now));
        let processes = Process::ALL.into_iter().zip(due);
        processes.filter_map(|(process, is_due)| is_due.then_some(process))
    }

    /// When the screen changes although nothing comes.
    pub fn next(&self, now: MonotonicNs) -> Option<MonotonicNs> {
        let error = self.dsp_error.map(|error| error.at + DSP_ERROR_SHOWN);
        let feeds = self.feeds.iter().chain([&self.telemetry_feed]);
        feeds
            .filter_map(|feed| feed.next(now))
            .chain(error.filter(|end| *end > now))
            .chain(self.alarms.next())
            .min()
    }

    /// How often the bell is to ring for what began since the last call.
    pub fn take_bells(&mut self) -> u32 {
        std::mem::take(&mut self.bells)
    }

    fn heard(&mut self, process: Process, published: MonotonicNs, now: MonotonicNs) {
        self.feeds[process as usize].sample(published, now);
    }

    fn telemetry(&mut self, now: MonotonicNs) {
        let before = self.pilot;
        let view = PilotView::of(self.hero.as_ref(), self.dsp.as_ref());
        let Some(received) = view.received else {
            return;
        };
        self.pilot = view;
        self.telemetry_feed.sample(received, now);
        if let Some(place) = view.place {
            if let Some(last) = self.last_place
                && !is_flown(last, (place, received))
            {
                self.track.cut();
            }
            self.track.push(place);
            self.last_place = Some((place, received));
        }
        let paused = before.received.map(|last| received.since(last));
        if before.flying == Some(false) && view.flying == Some(true) {
            self.airborne = Some(received);
        } else if view.flying == Some(false) || paused.is_some_and(|pause| pause > UNSEEN_LANDING) {
            self.airborne = None;
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

/// Whether a flight that was seen leads from one place to the next.
fn is_flown(from: (Place, MonotonicNs), to: (Place, MonotonicNs)) -> bool {
    let (took, far_m) = (to.1.since(from.1), distance_m(from.0, to.0));
    took <= TRACK_GAP && (far_m <= TRACK_JUMP_M || far_m <= TRACK_MAX_MPS * took.as_secs_f64())
}

impl WatchedRobot {
    /// Notes what changed from one state of the bridge to the next.
    fn compare(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
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

impl WatchedRobot {
    /// The newest state of the relay's link; `None` if the robot is on this machine.
    pub fn last_relay(&self) -> Option<&RelayLink> {
        self.relay.as_ref().filter(|_| self.is_relayed)
    }

    /// The stations that the robot is relayed to; `None` if no relay says so now.
    pub fn known_stations(&self, now: MonotonicNs) -> Option<&RelayStations> {
        let stations = self.stations.as_ref();
        stations.filter(|stations| now.since(stations.published()) < STATIONS_STALE_AFTER)
    }

    /// How `process` is.
    pub fn process(&self, process: Process, now: MonotonicNs) -> Freshness {
        self.feeds[process as usize].at(now)
    }

    /// What the helicopter does, in words. Old words stay: who shows them shows their age beside them.
    pub fn doing(&self, now: MonotonicNs) -> String {
        match (self.process(Process::Bridge, now), &self.state) {
            (Freshness::Absent, None) => "no bridge runs".to_owned(),
            (_, None) => "waiting for the bridge's state".to_owned(),
            (_, Some(state)) => pilot::phase(state, self.pilot.flying),
        }
    }

    /// For how long the link has been as it is, and whether that is known; else it has been so at least as long.
    pub fn link_age(&self, now: MonotonicNs) -> Option<(Duration, bool)> {
        let since = MonotonicNs(self.state.as_ref()?.link.state_since_ns);
        let is_known = since.0 > 0 && since <= now;
        let (_, seen) = self.link_seen?;
        let since = if is_known { since } else { seen };
        Some((now.since(since), is_known))
    }

    /// How telemetry is.
    pub fn telemetry_freshness(&self, now: MonotonicNs) -> Freshness {
        self.telemetry_feed.at(now)
    }

    /// Where it was when that was last known, and how long ago, while it is not known now.
    pub fn lost_place(&self, now: MonotonicNs) -> Option<(Place, Duration)> {
        let (place, at) = self.last_place.filter(|_| self.pilot.place.is_none())?;
        Some((place, now.since(at)))
    }

    /// Height over home, m.
    pub fn height_m(&self) -> Option<f64> {
        Some(self.pilot.altitude_m? - self.home?.altitude_m)
    }
}

impl WatchedRobot {
    /// All that is wrong, what matters most first. What follows from another finding is left out: one cause is one
    /// alarm.
    fn findings(&self, now: MonotonicNs) -> Vec<Finding> {
        let mut findings = Vec::new();
        let cut = self.cut(now);
        let is_robot_heard = cut.as_ref().is_none_or(|cut| cut.id != RELAY_LINK);
        if let Some(cut) = cut {
            findings.push(cut);
        } else {
            if let Some(age) = self.telemetry_feed.at(now).age() {
                findings.push(alarm("telemetry", format!("telemetry is {age}")));
            }
            if let Some(state) = &self.state {
                findings.extend(self.judge_state(state, now));
            }
        }
        let has_no_fix = self.pilot.gps.is_some_and(|gps| !gps.is_there());
        if has_no_fix && self.pilot.flying == Some(true) {
            findings.push(alarm("no-fix", "no GPS fix in flight"));
        }
        match self.process(Process::Status, now) {
            Freshness::Gone(_) => {
                let text = "`ril run status` has ended: telemetry is the bridge's own, and no logs are written";
                findings.push(warning("status-gone", text));
            }
            // Worse than its end: its consumers wait, nothing starts it again, and the logs have a gap.
            Freshness::Stale(_) if is_robot_heard => {
                let text = "`ril run status` says nothing: is it stopped, or is the machine overloaded? Telemetry is the bridge's own, and \
                     no logs are written";
                findings.push(alarm("status-silent", text));
            }
            _ => {}
        }
        findings
    }

    /// Where the way from the DSP to here is cut, nearest to here first.
    fn cut(&self, now: MonotonicNs) -> Option<Finding> {
        if self.is_relayed {
            let relay = self.relay.as_ref();
            let feed = self.process(Process::Relay, now);
            if !feed.is_fresh() || !relay.is_some_and(RelayLink::is_up) {
                let state = relay.and_then(RelayLink::state);
                let state = state.map_or("unknown", |state| state.name());
                let text = match feed.age() {
                    Some(age) => format!("relay's link {state}, {age}"),
                    None => format!("relay's link {state}"),
                };
                return Some(alarm(RELAY_LINK, text));
            }
        }
        match self.process(Process::Bridge, now) {
            Freshness::Gone(_) => {
                let text = format!("the bridge is gone: start `ril bridge --robot {}`", self.id);
                return Some(alarm("bridge-gone", text));
            }
            Freshness::Stale(_) => {
                let text = "the bridge says nothing: is it stopped, or is the machine overloaded?";
                return Some(alarm("bridge-silent", text));
            }
            Freshness::Absent | Freshness::Waiting | Freshness::Fresh => {}
        }
        let link = self.state.as_ref()?.link;
        if link.state() == Some(LinkState::Up) {
            return None;
        }
        let name = named(link.state(), link.state);
        Some(alarm("dsp-link", format!("link to the DSP {name}")))
    }

    fn judge_state(&self, state: &ModuleState, now: MonotonicNs) -> Vec<Finding> {
        let mut findings = Vec::new();
        let safety = &state.safety;
        if let Some(broken) = details::broken_rule(safety) {
            findings.push(Finding::new(broken.severity, "safety", broken.words).about(safety.rule));
        }
        if let Some(error) = self.dsp_error
            && now.since(error.at) < DSP_ERROR_SHOWN
        {
            let severity = match error.is_fatal {
                true => Severity::Error,
                false => Severity::Warning,
            };
            let finding = Finding::new(severity, "dsp-error", details::dsp_error(error.code));
            findings.push(finding.about(error.code));
        }
        if state.is_blocked() && state.imi_error != 0 {
            let error = state.imi_error();
            let text = format!("movements are blocked until `ril start`: {error}");
            findings.push(warning("blocked", text).about(state.imi_error));
        }
        findings
    }
}

fn alarm(id: &'static str, text: impl Into<String>) -> Finding {
    Finding::new(Severity::Error, id, text)
}

fn warning(id: &'static str, text: impl Into<String>) -> Finding {
    Finding::new(Severity::Warning, id, text)
}
