//! What `ril status` shows, as a value made of samples and the time: as text for people, as JSON for programs.
//!
//! It reads no clock and no port. What never happened is `None`, and what is too old is marked stale. The JSON has the
//! fields of the topic `module_state` as its schema says them, with ages for times and names for codes; the text is in
//! `text`.

#[cfg(test)]
mod tests;
pub(super) mod text;

use dsp_protocol::DspErrorCode;
use ipc_types::code::{Functionality, LinkState, ModuleId};
use ipc_types::module::State;
use ipc_types::payload::{
    DspErrorCounters, DspTelemetry, HeroTelemetry, LinkHealth, ModuleState, MovementEnd,
    MovementState, RefusedCounters, RelayStations, SafetyState,
};
use ipc_types::{MonotonicNs, RobotId, TelemetryGroup};
use operator::render::fields::{JsonLine, Selection, Tree};
use operator::render::messages::details;
use operator::robot::controller::Senders;
use operator::robot::freshness::{
    MODULE_STALE_AFTER, STALE_AFTER, SampleAge, age_ms, is_stale, named,
};
use operator::robot::pilot::{self, PilotView};
use operator::robot::relay_link::{LinkReport, UNREADABLE};
use runtime::exit::ExitCode;
use serde::ser::{Serialize, Serializer};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.State.v4";

/// What there is of a robot: the newest sample of each topic, and which processes live.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples {
    /// The bridge's state.
    pub state: Option<ModuleState>,
    /// Raw telemetry.
    pub dsp: Option<DspTelemetry>,
    /// Telemetry in SI units.
    pub hero: Option<HeroTelemetry>,
    /// The state of the process status.
    pub status: Option<State>,
    /// The stations of the robot's relay.
    pub stations: Option<RelayStations>,
    /// The session of this process.
    pub own_session: Option<u32>,
    /// Whether a process provides the bridge's state.
    pub has_bridge: bool,
    /// Whether a process provides the state of status.
    pub has_status: bool,
}

impl Samples {
    /// Whether nothing came of the robot.
    pub fn is_empty(&self) -> bool {
        self.state.is_none() && self.dsp.is_none() && self.hero.is_none() && self.status.is_none()
    }

    /// Whether status lives and has not said for a while how it is.
    pub fn is_status_silent(&self, now: MonotonicNs) -> bool {
        let is_old = |state: State| is_module_old(&state, now);
        self.has_status && self.status.is_none_or(is_old)
    }
}

/// Whether a module's state is too old to say how it is.
pub fn is_module_old(state: &State, now: MonotonicNs) -> bool {
    is_stale(MonotonicNs(state.published_ns), now, MODULE_STALE_AFTER)
}

/// Everything that `ril status` shows.
#[derive(Clone, Debug)]
pub struct StateReport {
    robot: RobotId,
    samples: Samples,
    view: PilotView,
    now: MonotonicNs,
    is_relayed: bool,
    relay: Option<LinkReport>,
}

impl StateReport {
    /// What the newest samples say at `now`.
    pub fn new(robot: RobotId, samples: Samples, now: MonotonicNs) -> StateReport {
        StateReport {
            robot,
            samples,
            view: PilotView::of(samples.hero.as_ref(), samples.dsp.as_ref()),
            now,
            is_relayed: false,
            relay: None,
        }
    }

    /// Makes it the report of a robot on another machine, to which `link` leads; `None` if the relay said nothing of
    /// it.
    #[must_use]
    pub fn relayed(self, link: Option<LinkReport>) -> StateReport {
        StateReport {
            is_relayed: true,
            relay: link,
            ..self
        }
    }

    /// Why the command ends with another code than 0, and what to do; `None` if all is well.
    ///
    /// * 3: no bridge runs;
    /// * 4: the bridge or status says nothing, or the bridge's state or the newest telemetry is old;
    /// * 6: the relay's link to the robot, or the robot's link to the DSP, is not up.
    pub fn trouble(&self) -> Option<(ExitCode, String)> {
        let robot = self.robot;
        if !self.samples.has_bridge {
            let text =
                format!("no bridge of robot {robot} runs: start `ril bridge --robot {robot}`");
            return Some((ExitCode::ServiceAbsent, text));
        }
        if let Some((text, next_step)) = self.relay.as_ref().and_then(LinkReport::trouble) {
            return Some((ExitCode::LinkDown, format!("{text}; {next_step}")));
        }
        let state = self.samples.state.as_ref();
        let Some(state) = state.filter(|state| !self.is_old(state.published())) else {
            let text = format!(
                "the bridge of robot {robot} runs and says nothing: is it stopped, or is the machine overloaded?"
            );
            return Some((ExitCode::Timeout, text));
        };
        let link = &state.link;
        if link.state() != Some(LinkState::Up) {
            let text = format!(
                "the link to the DSP of robot {robot} is {}: `ril doctor --robot {robot}` finds out why",
                named(link.state(), link.state)
            );
            return Some((ExitCode::LinkDown, text));
        }
        if self.samples.is_status_silent(self.now) {
            let text = format!(
                "status of robot {robot} runs and says nothing: is it stopped, or is the machine overloaded? Telemetry is the bridge's own, \
                 and no logs are written"
            );
            return Some((ExitCode::Timeout, text));
        }
        if link.telemetry_published > 0 && self.is_telemetry_old() != Some(false) {
            let text = format!(
                "telemetry of robot {robot} is old, although the link to the DSP is up: does the DSP send its status?"
            );
            return Some((ExitCode::Timeout, text));
        }
        None
    }

    fn is_old(&self, time: MonotonicNs) -> bool {
        is_stale(time, self.now, STALE_AFTER)
    }

    /// Whether the telemetry is too old to say how things are now; `None` without any.
    fn is_telemetry_old(&self) -> Option<bool> {
        self.view.received.map(|received| self.is_old(received))
    }

    /// ms from the reading of the telemetry by the bridge; `None` without any, and for a time in the future.
    fn telemetry_age_ms(&self) -> Option<u64> {
        age_ms(self.view.received?, self.now)
    }

    /// What the helicopter does, in words; `None` without a state of the bridge.
    fn phase(&self) -> Option<String> {
        let state = self.samples.state.as_ref()?;
        Some(pilot::phase(state, self.view.flying))
    }

    /// The senders' names.
    fn senders(&self) -> Senders<'_> {
        Senders {
            own_session: self.samples.own_session.filter(|_| !self.is_relayed),
            stations: self.samples.stations.as_ref(),
        }
    }

    fn sample(&self, sequence: u64, time_ns: u64) -> SampleAge {
        SampleAge::new(sequence, MonotonicNs(time_ns), self.now)
    }

    fn status_sample(&self, state: &State) -> SampleAge {
        let published = MonotonicNs(state.published_ns);
        SampleAge::with_limit(state.sequence, published, self.now, MODULE_STALE_AFTER)
    }

    fn dsp(&self) -> Option<SampleAge> {
        let dsp = self.samples.dsp.as_ref()?;
        Some(self.sample(dsp.sequence, dsp.received_ns))
    }

    fn hero(&self) -> Option<SampleAge> {
        let hero = self.samples.hero.as_ref()?;
        Some(self.sample(hero.sequence, hero.published_ns))
    }
}

impl Serialize for StateReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let samples = &self.samples;
        let processes = Tree::nested([
            ("bridge", samples.has_bridge.into()),
            ("status", samples.has_status.into()),
        ]);
        let mut fields = vec![
            ("robot", self.robot.get().into()),
            ("flight", self.flight()),
            ("processes", processes),
        ];
        fields.extend(self.bridge());
        fields.extend([
            ("dsp", self.dsp().map_or(Tree::NULL, SampleAge::tree)),
            ("hero", self.hero().map_or(Tree::NULL, SampleAge::tree)),
            ("status", self.status()),
            (
                "replayed",
                samples
                    .state
                    .is_some_and(|state| state.is_replayed())
                    .into(),
            ),
            ("relayed", self.is_relayed.into()),
            (
                "relay",
                self.relay.as_ref().map_or(Tree::NULL, LinkReport::tree),
            ),
        ]);
        let tree = &Tree::nested(fields);
        let schema = SCHEMA;
        JsonLine { schema, tree }.serialize(serializer)
    }
}

/// The parts of the JSON object.
impl StateReport {
    fn flight(&self) -> Tree {
        let view = &self.view;
        Tree::nested([
            ("flying", view.flying.into()),
            ("phase", self.phase().into()),
            (
                "latitude_deg",
                view.place.map(|place| place.latitude_deg).into(),
            ),
            (
                "longitude_deg",
                view.place.map(|place| place.longitude_deg).into(),
            ),
            ("altitude_m", view.altitude_m.into()),
            ("climb_mps", view.climb_mps.into()),
            ("ground_speed_mps", view.ground_speed_mps.into()),
            ("course_deg", view.course_deg.into()),
            ("heading_deg", view.heading_deg.into()),
            ("battery_v", view.battery_v.into()),
            ("fuel_percent", view.fuel_percent.into()),
            (
                "pilot_switch",
                view.switch.map(|switch| switch.name()).into(),
            ),
            ("gps_quality", view.gps.map(|gps| gps.0).into()),
            ("gps_fix", view.gps.map(|gps| gps.name()).into()),
            ("age_ms", self.telemetry_age_ms().into()),
            ("stale", self.is_telemetry_old().into()),
        ])
    }

    /// The bridge as a module, and what its state says by the names of its schema; `null` without a state.
    fn bridge(&self) -> [(&'static str, Tree); 8] {
        let parts = self.samples.state.as_ref().map(|state| {
            let mut fields = Tree::of(state, &Selection::default());
            let mut take = |name| fields.take(name);
            [
                self.module(state),
                movement(take("movement"), &state.movement),
                self.last_end(take("last_end"), &state.last_end),
                link(take("link"), &state.link, self.now),
                refused(take("refused"), &state.refused),
                dsp_errors(take("dsp_errors"), &state.dsp_errors),
                safety(take("safety"), &state.safety),
                self.senders().tree(&state.control, self.now),
            ]
        });
        let [
            module,
            movement,
            last_end,
            link,
            refused,
            dsp_errors,
            safety,
            control,
        ] = parts.unwrap_or([const { Tree::NULL }; 8]);
        [
            ("module", module),
            ("movement", movement),
            ("last_end", last_end),
            ("link", link),
            ("refused", refused),
            ("dsp_errors", dsp_errors),
            ("safety", safety),
            ("control", control),
        ]
    }

    fn module(&self, state: &ModuleState) -> Tree {
        let functionality = Functionality::from_code(state.functionality);
        Tree::nested([
            (
                "id",
                named(ModuleId::from_code(state.module_id), state.module_id).into(),
            ),
            ("status", named(state.status(), state.status).into()),
            (
                "functionality",
                named(functionality, state.functionality).into(),
            ),
            ("blocked", state.is_blocked().into()),
            ("unable_to_abort", state.is_unable_to_abort().into()),
            ("error", state.imi_error().to_string().into()),
            (
                "sample",
                self.sample(state.sequence, state.published_ns).tree(),
            ),
        ])
    }

    /// How the movement that ended last did so; `null` before the first end.
    fn last_end(&self, fields: Tree, end: &MovementEnd) -> Tree {
        match end.ended() {
            None => Tree::NULL,
            Some(_) => fields
                .with_ages(|time_ns| age_ms(MonotonicNs(time_ns), self.now))
                .with("kind", named(end.kind(), end.kind))
                .with("stage", named(end.stage(), end.stage))
                .with("reason", named(end.reason(), end.reason)),
        }
    }

    /// The state of the module status; `null` if none was received.
    fn status(&self) -> Tree {
        let Some(state) = &self.samples.status else {
            return Tree::NULL;
        };
        Tree::nested([
            (
                "id",
                named(ModuleId::from_code(state.module_id), state.module_id).into(),
            ),
            ("status", named(state.status(), state.status).into()),
            ("doing", state.doing().unwrap_or(UNREADABLE).into()),
            ("blocked", state.is_blocked().into()),
            ("error", state.error().to_string().into()),
            ("sample", self.status_sample(state).tree()),
        ])
    }
}

/// Whether the DSP stops by itself when the bridge is gone; `None` before the DSP has answered the start-up sequence.
fn pc_timeout_supported(link: &LinkHealth) -> Option<bool> {
    let is_supported = link.pc_timeout_supported == 1;
    let is_asked = matches!(link.state(), Some(LinkState::Up | LinkState::Silent));
    (is_asked || is_supported).then_some(is_supported)
}

/// The movement; `null` before the first.
fn movement(fields: Tree, movement: &MovementState) -> Tree {
    match movement.kind {
        0 => Tree::NULL,
        kind => fields
            .with("kind", named(movement.kind(), kind))
            .without("distance_valid"),
    }
}

fn link(fields: Tree, link: &LinkHealth, now: MonotonicNs) -> Tree {
    fields
        .with_ages(|time_ns| age_ms(MonotonicNs(time_ns), now))
        .with("state", named(link.state(), link.state))
        .with("delivery_verified", link.delivery_verified == 1)
        .with("dsp_path", named(link.dsp_path(), link.dsp_path))
        .with("pc_timeout_supported", pc_timeout_supported(link))
}

/// Names of the groups that were withdrawn as implausible.
fn implausible(refused: &RefusedCounters) -> Vec<&'static str> {
    // The mask has sixteen bits; others would be of a later layout.
    let mask = (refused.implausible_mask & u32::from(u16::MAX)) as u16;
    TelemetryGroup::in_mask(mask)
        .map(TelemetryGroup::name)
        .collect()
}

fn refused(fields: Tree, refused: &RefusedCounters) -> Tree {
    fields
        .without("implausible_mask")
        .with("implausible", implausible(refused))
}

/// The documented DSP errors that came, with their counts.
fn known_dsp_errors(errors: &DspErrorCounters) -> impl Iterator<Item = (DspErrorCode, u32)> {
    let counts = DspErrorCode::KNOWN.into_iter().zip(errors.known);
    counts.filter(|(_, count)| *count > 0)
}

fn dsp_errors(fields: Tree, errors: &DspErrorCounters) -> Tree {
    let by_code = known_dsp_errors(errors).map(|(code, count)| {
        Tree::nested([
            ("code", code.0.into()),
            ("text", code.text().into()),
            ("count", count.into()),
        ])
    });
    fields
        .without("known")
        .with("last", errors.last().map(details::dsp_error))
        .with("last_code", errors.last())
        .with("by_code", Tree::List(by_code.collect()))
}

fn safety(fields: Tree, safety: &SafetyState) -> Tree {
    let rule = safety.rule();
    let unit = rule.and_then(details::unit);
    let violation = match safety.rule {
        0 => Tree::NULL,
        number => Tree::nested([
            ("rule", named(rule, number).into()),
            ("amount", unit.map(|_| safety.amount).into()),
            ("unit", unit.into()),
            ("action", named(safety.action(), safety.action).into()),
        ]),
    };
    let switch = named(safety.pilot_switch(), safety.pilot_switch);
    ["amount", "rule", "action", "reserved"]
        .into_iter()
        .fold(fields, Tree::without)
        .with("violation", violation)
        .with("pilot_switch", switch)
}
