//! A whole mission, typed at the station.

use std::collections::HashSet;
use std::sync::mpsc::{self, Sender, TryRecvError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::code::RelayLinkState;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{Schema, Topic};
use ril_tests::process::Signal;

use crate::bridge_log::BridgeLog;
use crate::machine::{Machine, says};
use crate::rig::Rig;

/// How long a collector waits before it looks whether it is to end.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Collects the samples of a topic on a thread of its own.
struct Collector<T> {
    end: Sender<()>,
    thread: JoinHandle<Vec<T>>,
}

impl<T: Topic + Copy + Send + 'static> Collector<T> {
    fn start(machine: &Machine) -> Collector<T> {
        let (end, is_over) = mpsc::channel();
        let domain = machine.domain.clone();
        let thread = thread::spawn(move || {
            let ipc = ipc_types::Ipc::join(&domain, ipc_types::RobotId::DEFAULT, "test").unwrap();
            let mut port = ipc.subscriber::<T>().unwrap();
            let mut samples = Vec::new();
            while is_over.try_recv() == Err(TryRecvError::Empty) {
                port.wait(LOOK_PERIOD).unwrap();
                let _ = port.drain(|sample| samples.push(*sample));
            }
            samples
        });
        Collector { end, thread }
    }

    fn end(self) -> Vec<T> {
        drop(self.end);
        self.thread.join().expect("the collector failed")
    }
}

/// What the sample says, without what each publisher and each clock writes differently.
fn contents<T: Topic + Copy>(sample: &T) -> Vec<u8> {
    let mut sample = *sample;
    sample.stamp(0, 0);
    let mut bytes = sample.bytes().to_vec();
    for offset in Schema::of::<T>().moments() {
        bytes[offset..offset + 8].fill(0);
    }
    bytes
}

/// Asserts that each sample at the station is one of the robot's, in their order.
#[track_caller]
fn assert_same<T: Topic + Copy>(at_robot: &[T], at_station: &[T]) {
    let robots: HashSet<Vec<u8>> = at_robot.iter().map(contents).collect();
    let strangers = at_station
        .iter()
        .filter(|sample| !robots.contains(&contents(*sample)));
    let (strangers, all) = (strangers.count(), at_station.len());
    assert_eq!(
        strangers,
        0,
        "{}: of {all} samples at the station so many are none of the robot's",
        T::KEY
    );
    assert!(
        all * 2 > at_robot.len(),
        "{}: {all} of {}",
        T::KEY,
        at_robot.len()
    );
}

#[test]
fn a_mission_typed_at_the_station_flies_and_the_station_shows_what_the_robot_does() {
    let Some(mut rig) = Rig::start("mission", "") else {
        return;
    };
    // The robot's collectors begin first and end last: what the station shows must be among theirs.
    let robot = (
        Collector::<DspTelemetry>::start(&rig.robot),
        Collector::<HeroTelemetry>::start(&rig.robot),
        Collector::<ModuleState>::start(&rig.robot),
    );
    rig.robot.subscribe::<DspTelemetry>(1).next();
    rig.robot.subscribe::<HeroTelemetry>(1).next();
    rig.station.run("status", 0);
    let station = (
        Collector::<DspTelemetry>::start(&rig.station),
        Collector::<HeroTelemetry>::start(&rig.station),
        Collector::<ModuleState>::start(&rig.station),
    );

    let [latitude, longitude, altitude] = rig.take_off();
    let point = |north_deg: f64, east_deg: f64, up_m: f64| {
        let (latitude, longitude) = (latitude + north_deg, longitude + east_deg);
        format!("{latitude},{longitude},{}", altitude + up_m)
    };
    let square = [
        point(0.00007, 0.0, 1.0),
        point(0.00007, 0.00009, 2.0),
        point(0.0, 0.00009, 1.0),
        point(0.0, 0.0, 0.0),
    ];
    let flown = rig.station.run(&format!("goto {}", square.join(" ")), 0);
    assert!(says(&flown.stdout, "goto: done"), "{flown:#?}");
    rig.station.run("land", 0);
    rig.station.run("stop", 0);
    // A verb that the robot refuses has the same exit code as on the robot.
    rig.station.run("takeoff --altitude 5", 5);
    rig.station.run("relay status", 0);
    // On a machine that is busy some samples find no room on their way, which is a warning.
    let checked = rig.station.start("doctor").wait_exit();
    assert!(
        says(&checked.stderr, "0 errors") || checked.code() == Some(0),
        "{checked:#?}"
    );
    rig.robot.run("relay status", 0);

    let (dsp, hero, state) = (station.0.end(), station.1.end(), station.2.end());
    assert_same(&robot.0.end(), &dsp);
    assert_same(&robot.1.end(), &hero);
    assert_same(&robot.2.end(), &state);
    let [bridge, sim] = rig.end();
    let log = BridgeLog::of([&bridge]);
    let begun = ["start", "takeoff", "goto", "land", "stop"].map(|command| log.begun(command));
    assert_eq!(begun, [1, 2, 4, 1, 1], "{:#?}", log.lines);
    assert_eq!(log.executed_twice(), Vec::<u64>::new());
    // Taken, not reached: the bridge's box is larger than the DSP's, so a landing that follows at once is allowed to empty the
    // path buffer just before the DSP reaches the last waypoint.
    assert!(says(&sim.stderr, "waypoints_taken=4"), "{:#?}", sim.stderr);
}

#[test]
fn a_program_that_comes_late_gets_the_latest_sample_at_once() {
    let Some(mut rig) = Rig::start("late", "") else {
        return;
    };
    let mut early = rig.station.subscribe::<HeroTelemetry>(1);
    early.next();
    // Nothing comes from the robot any more, so that what a late joiner gets has been there.
    let relay = rig.robot_relay.as_ref().expect("it runs");
    relay.signal(Signal::STOP);
    let mut links = rig.station.subscribe::<RelayLink>(1);
    links.until("the link is down", |link| {
        link.state == RelayLinkState::Down.code()
    });
    let newest = early.until("a sample", |_| true);
    let mut late = rig.station.subscribe::<HeroTelemetry>(1);
    let late = late.until("the latest sample", |_| true);
    assert_eq!(contents(&late), contents(&newest));
    assert_eq!(
        late.received_ns, newest.received_ns,
        "its age is not hidden"
    );
    relay.signal(Signal::CONT);
    rig.station.await_link(1);
    rig.end();
}
