//! What `ril status` shows, as a value made of samples and the time: as text for people, as JSON for programs.
//!
//! It reads no clock and no port. What never happened is nothing, and what is too old is marked stale. What a pilot asks first is in
//! `flight`, what the bridge says in `bridge`, the text in `text`.

mod bridge;
mod flight;
mod samples;
#[cfg(test)]
mod tests;
mod text;

use ipc_types::code::ModuleId;
use ipc_types::module::State;
use ipc_types::{MonotonicNs, RobotId};
use runtime::exit::ExitCode;
use serde::Serialize;

use super::relay_report::LinkReport;
use super::sample_age::{Sample, named};
use bridge::{DspErrors, Link, Module, Movement, Refused, Safety};
use flight::Flight;
pub use samples::Samples;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.State.v3";

/// Everything that `ril status` shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateReport {
    schema: &'static str,
    robot: u32,
    flight: Flight,
    processes: Processes,
    /// The bridge as a module, and all that it says; nothing when no state of it was received.
    module: Option<Module>,
    movement: Option<Movement>,
    link: Option<Link>,
    refused: Option<Refused>,
    dsp_errors: Option<DspErrors>,
    safety: Option<Safety>,
    /// Raw telemetry; nothing when none was received.
    dsp: Option<Sample>,
    /// Telemetry in SI units; nothing when none was received.
    hero: Option<Sample>,
    /// The state of the module status; nothing when none was received.
    status: Option<StatusState>,
    /// Whether all of this is a recorded flight that is played.
    replayed: bool,
    /// Whether all of this comes from another machine.
    relayed: bool,
    /// The link to that machine; nothing when the robot is on this one, and when the relay said nothing.
    relay: Option<LinkReport>,
}

/// Which processes live.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Processes {
    bridge: bool,
    status: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct StatusState {
    id: String,
    status: String,
    doing: String,
    blocked: bool,
    error: String,
    sample: Sample,
}

impl StateReport {
    /// What the newest samples say at `now`.
    pub fn new(robot: RobotId, samples: &Samples<'_>, now: MonotonicNs) -> StateReport {
        let state = samples.state;
        let sample = |sequence, at| Sample::new(sequence, at, now);
        StateReport {
            schema: SCHEMA,
            robot: robot.get(),
            flight: Flight::new(samples, now),
            processes: Processes {
                bridge: samples.has_bridge,
                status: samples.has_status,
            },
            module: state.map(|state| Module::new(state, now)),
            movement: state
                .map(|state| &state.movement)
                .filter(|movement| movement.kind != 0)
                .map(Movement::new),
            link: state.map(|state| Link::new(&state.link, now)),
            refused: state.map(|state| Refused::new(&state.refused)),
            dsp_errors: state.map(|state| DspErrors::new(&state.dsp_errors)),
            safety: state.map(|state| Safety::new(&state.safety)),
            dsp: samples.dsp.map(|dsp| sample(dsp.sequence, dsp.received())),
            hero: samples
                .hero
                .map(|hero| sample(hero.sequence, MonotonicNs(hero.published_ns))),
            status: samples.status.map(|status| StatusState::new(status, now)),
            replayed: state.is_some_and(|state| state.is_replayed()),
            relayed: false,
            relay: None,
        }
    }

    /// The same of a robot on another machine, to which `link` leads; nothing when the relay said nothing of it.
    #[must_use]
    pub fn relayed(self, link: Option<LinkReport>) -> StateReport {
        StateReport {
            relayed: true,
            relay: link,
            ..self
        }
    }

    /// How the command ends.
    ///
    /// * 3: no bridge runs;
    /// * 4: the bridge says nothing, or its state or the newest telemetry is old;
    /// * 6: the relay's link to the robot, or the robot's link to the DSP, is not up.
    pub fn exit_code(&self) -> ExitCode {
        self.trouble().map_or(ExitCode::Ok, |(code, _)| code)
    }

    /// Why the command ends with another code than 0, and what to do; nothing when all is well.
    pub fn trouble(&self) -> Option<(ExitCode, String)> {
        let robot = self.robot;
        if !self.processes.bridge {
            let text =
                format!("no bridge of robot {robot} runs: start `ril bridge --robot {robot}`");
            return Some((ExitCode::ServiceAbsent, text));
        }
        if self.relay.as_ref().is_some_and(|relay| !relay.is_up()) {
            let text = format!(
                "the relay's link to robot {robot} is not up: `ril relay status --robot {robot}` says more"
            );
            return Some((ExitCode::LinkDown, text));
        }
        let is_fresh = |sample: Option<Sample>| sample.is_some_and(|sample| !sample.is_stale());
        if !is_fresh(self.module.as_ref().map(|module| module.sample)) {
            let text = format!(
                "the bridge of robot {robot} runs and says nothing: is it stopped, or is the machine overloaded?"
            );
            return Some((ExitCode::Timeout, text));
        }
        let link = self.link.as_ref()?;
        if !link.is_up() {
            let text = format!(
                "the link to the DSP of robot {robot} is {}: `ril doctor --robot {robot}` finds out why",
                link.state
            );
            return Some((ExitCode::LinkDown, text));
        }
        if link.telemetry_published > 0 && self.flight.is_stale() {
            let text = format!(
                "telemetry of robot {robot} is old, although the link to the DSP is up: does the DSP send its status?"
            );
            return Some((ExitCode::Timeout, text));
        }
        None
    }
}

impl StatusState {
    fn new(state: &State, now: MonotonicNs) -> StatusState {
        StatusState {
            id: named(ModuleId::from_code(state.module_id), state.module_id),
            status: named(state.status(), state.status),
            doing: state.doing().unwrap_or("unreadable").to_owned(),
            blocked: state.is_blocked(),
            error: state.error().to_string(),
            sample: Sample::new(state.sequence, MonotonicNs(state.published_ns), now),
        }
    }
}
