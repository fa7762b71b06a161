//! The operator: carries out a script of steps, each when the one before it has had its final report.

use std::time::Duration;

use dsp_sim::helicopter::Phase;
use dsp_sim::helicopter::pilot::PilotSwitch;
use dsp_sim::helicopter::vector::Vector;
use ipc_types::code::{ControlCommand, LinkState, Stage};
use ipc_types::payload::{MovementData, ParameterRequest};

use crate::missions::witness::Outcome;
use crate::missions::world::World;

/// What an operator does.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    Start,
    TakeOff(f64),
    /// Points of the flat world around the home: east, north, up in metres.
    Path(Vec<Vector>),
    /// A path (east, north, up in metres), sent one waypoint after the other with a pause between.
    SlowPath(Vec<Vector>, Duration),
    Land,
    Stop,
    /// Hovers on the spot and stays started.
    Hold,
    /// Writes a virtual port.
    Write(u16, f32),
    /// Does nothing for some time.
    Wait(Duration),
}

pub fn point(east_m: f64, north_m: f64, up_m: f64) -> Vector {
    Vector::new(east_m, north_m, up_m)
}

/// A path of three legs that ends above its beginning.
pub fn triangle() -> Vec<Vector> {
    vec![
        point(0.0, 20.0, 10.0),
        point(20.0, 20.0, 15.0),
        point(0.0, 0.0, 10.0),
    ]
}

/// Runs until the bridge has a link and knows where the helicopter is.
pub fn await_link(world: &mut World) {
    world.run_until("a link", |world| {
        world.bridge().link() == LinkState::Up && world.witness.samples > 0
    });
    // A sample of this link.
    let samples = world.witness.samples;
    world.run_until("telemetry", |world| world.witness.samples > samples);
}

/// Carries out `step` and returns its final report. Waiting always goes well.
pub fn carry_out(world: &mut World, step: &Step) -> Outcome {
    match step {
        Step::Start => {
            let id = world.control(ControlCommand::Start);
            follow(world, id)
        }
        Step::Stop => {
            let id = world.control(ControlCommand::Stop);
            follow(world, id)
        }
        Step::TakeOff(height_m) => {
            let id = world.movement(MovementData::take_off(0, *height_m));
            follow(world, id)
        }
        Step::Land => {
            let id = world.movement(MovementData::land(0));
            follow(world, id)
        }
        Step::Hold => {
            let id = world.movement(MovementData::hold(0));
            follow(world, id)
        }
        Step::Write(port, value) => {
            let id = world.parameter(ParameterRequest::write(0, *port, (*value).into()));
            follow(world, id)
        }
        Step::Wait(time) => {
            world.run_for(*time);
            Outcome::DONE
        }
        Step::Path(path) => fly_path(world, path, Duration::ZERO),
        Step::SlowPath(path, pause) => fly_path(world, path, *pause),
    }
}

/// Carries out all steps, each of which must be done well.
pub fn fly(world: &mut World, steps: &[Step]) {
    await_link(world);
    for step in steps {
        let outcome = carry_out(world, step);
        assert!(outcome.is_done(), "{step:?} ended with {outcome:?}");
    }
}

/// Carries out the steps up to the first that is not done well; then brings the helicopter home. Returns that step's
/// final report, if there was one.
pub fn fly_through_trouble(world: &mut World, steps: &[Step]) -> Option<Outcome> {
    let failure = steps.iter().find_map(|step| {
        await_link(world);
        let outcome = carry_out(world, step);
        (!outcome.is_done()).then_some(outcome)
    });
    if failure.is_some() {
        bring_home(world);
    }
    failure
}

/// What an operator does after something went wrong, as docs/operations.md says it: waits for the link, stops once,
/// whatever becomes of the stop, starts the module again, and lands. While the trouble goes on, this may fail and is
/// tried again; on a line that is calm it must do.
pub fn bring_home(world: &mut World) {
    /// One a second, for longer than any trouble lasts.
    const ATTEMPTS: usize = 120;
    for _ in 0..ATTEMPTS {
        let is_calm = world.is_calm();
        match recover(world) {
            Ok(()) => return,
            Err(failure) => assert!(
                !is_calm,
                "the documented recovery failed at {:?} with {failure}: {:?}, {:?}",
                world.now(),
                world.simulator.helicopter().phase(),
                world.witness.state
            ),
        }
        world.run_for(Duration::from_secs(1));
    }
    panic!(
        "the helicopter could not be brought home: {:?}, {:?}",
        world.now(),
        world.witness.state
    );
}

/// The recovery itself; an error says which step was not done.
fn recover(world: &mut World) -> Result<(), String> {
    let must = |outcome: Outcome, what: &str| {
        let text = format!("{what}: {outcome:?}");
        outcome.is_done().then_some(()).ok_or(text)
    };
    await_link(world);
    // "pilot-has-control: wait until it is on auto".
    world.run_until("the pilot's switch on auto", |world| {
        world.simulator.helicopter().switch() == PilotSwitch::Auto
    });
    // "unable-to-abort: wait for its end".
    world.run_until("no take-off or landing", |world| {
        !world.witness.state.is_unable_to_abort()
    });
    // Its final report may be aborted or unknown: the bridge goes on emptying the DSP's buffer by itself.
    carry_out(world, &Step::Stop);
    await_link(world);
    must(carry_out(world, &Step::Start), "start")?;
    // What the DSP began for a bridge that is gone, or that does not watch it any more, goes on: a take-off, a landing.
    world.run_until("it hovers or stands", |world| {
        let phase = world.simulator.helicopter().phase();
        matches!(phase, Phase::OnGround | Phase::Hovering) && !world.simulator.is_taking_off()
    });
    if world.simulator.helicopter().is_flying() {
        must(carry_out(world, &Step::Land), "landing")?;
    }
    Ok(())
}

pub fn follow(world: &mut World, id: u64) -> Outcome {
    world.run_until("a final report", |world| {
        world.witness.outcome(id).is_some()
    });
    world.witness.outcome(id).expect("it was awaited")
}

fn fly_path(world: &mut World, path: &[Vector], pause: Duration) -> Outcome {
    let path_id = 1000 + world.now().as_nanos() as u64;
    let mut ids = Vec::new();
    for index in 0..path.len() {
        let sent = world.probe.waypoints;
        ids.push(world.waypoint(path_id, path, index));
        if index + 1 < path.len() && !pause.is_zero() {
            world.run_for(pause);
            assert_eq!(
                world.probe.waypoints, sent,
                "sent before the path was closed"
            );
        }
    }
    // A waypoint that was refused or given up says how its path ended; else the last one does. All others are done as
    // soon as the next one is accepted.
    let (closing, others) = ids.split_last().expect("a path has waypoints");
    let outcome = follow(world, *closing);
    let broken = others.iter().find_map(|id| {
        let outcome = world.witness.outcome(*id).expect("its path is closed");
        (!outcome.is_done()).then_some(outcome)
    });
    if let Some(broken) = broken {
        assert_ne!(outcome.stage, Stage::Done, "a path with a hole was flown");
        return broken;
    }
    if outcome.is_done() {
        let report = world
            .witness
            .words(*closing)
            .last()
            .expect("a final report");
        assert_eq!(report.waypoints_total as usize, path.len());
        assert_eq!(report.waypoints_sent as usize, path.len());
        // In noise, and between status messages that come seldom, a waypoint can be reached unseen.
        if world.sees_everything() {
            assert_eq!(report.waypoints_reached as usize, path.len());
        }
    }
    outcome
}
