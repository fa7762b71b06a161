//! What works at a station: a whole mission, two robots through a router, and topics of any schema.

use std::collections::HashSet;
use std::sync::mpsc::{self, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::code::{ModuleStatus, RelayLinkState};
use ipc_types::dynamic::{self, schema_of};
use ipc_types::outline::OutlineReader;
use ipc_types::payload::{BridgeOutline, DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::schema::MAX_TEXT_LEN;
use ipc_types::{DynamicPublisher, DynamicSubscriber, RobotId, Schema, Topic, Wake};
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::relayed::{
    BridgeLog, SPEED, await_link, free_endpoint, machine, start_station_relay,
};
use ril_tests::{Process, Rig, Sandbox};

use super::{rig, ril};

/// How long a collector waits before it looks whether it is to end.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Samples of telemetry, and of the bridge's state, that the station has in the end: a machine that is busy drops any
/// share of them on their way, and the robot goes on to publish until there are so many.
const TELEMETRY: usize = 100;
const STATES: usize = 5;

/// Collects the samples of a topic on a thread of its own.
struct Collector<T> {
    end: Sender<usize>,
    thread: JoinHandle<Vec<T>>,
}

impl<T: Topic + Copy + Send + 'static> Collector<T> {
    fn start(machine: &Sandbox) -> Collector<T> {
        let (end, is_over) = mpsc::channel();
        let domain = machine.domain.clone();
        let thread = thread::spawn(move || {
            let ipc = ipc_types::Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
            let mut port = ipc.subscriber::<T>().unwrap();
            let mut samples = Vec::new();
            let least = loop {
                port.wait(LOOK_PERIOD).unwrap();
                let _ = port.drain(|sample| samples.push(*sample));
                if let Ok(least) = is_over.try_recv() {
                    break least;
                }
            };
            while samples.len() < least {
                assert_ne!(port.wait(WAIT_LIMIT).unwrap(), Wake::TimedOut, "none comes");
                let _ = port.drain(|sample| samples.push(*sample));
            }
            samples
        });
        Collector { end, thread }
    }

    /// Ends when there are so many samples.
    fn end(self, least: usize) -> Vec<T> {
        self.end.send(least).expect("the collector failed");
        self.thread.join().expect("the collector failed")
    }
}

/// What the sample without what each publisher and each clock writes differently.
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
    // The first one was at the station already, and may be older than all that were collected at the robot: a link
    // begins slowly.
    let at_station = &at_station[1..];
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
}

#[test]
fn a_mission_typed_at_the_station_flies_and_the_station_shows_what_the_robot_does() {
    let Some(mut rig) = rig("mission", "") else {
        return;
    };
    // The robot's collectors begin first and end last: what the station shows must be among theirs.
    let robot = (
        Collector::<DspTelemetry>::start(&rig.robot),
        Collector::<HeroTelemetry>::start(&rig.robot),
        Collector::<ModuleState>::start(&rig.robot),
    );
    rig.robot.subscribe::<DspTelemetry>(1).next_sample();
    rig.robot.subscribe::<HeroTelemetry>(1).next_sample();
    rig.station.run("status", 0);
    let station = (
        Collector::<DspTelemetry>::start(&rig.station),
        Collector::<HeroTelemetry>::start(&rig.station),
        Collector::<ModuleState>::start(&rig.station),
    );

    let place = rig.take_off();
    let square = Rig::square(place, 0.0);
    rig.station
        .run(&format!("goto {square}"), 0)
        .out_says("goto: done");
    rig.station.run("land", 0);
    rig.station.run("stop", 0);
    // A verb that the robot refuses has the same exit code as on the robot.
    rig.station.run("takeoff --altitude 5", 5);
    rig.station.run("relay status", 0);
    // On a machine that is busy some samples find no room on their way, which is a warning.
    let doctor = rig.station.finish("doctor");
    let checked = &doctor.stdout;
    let has_error = checked.iter().any(|line| line.starts_with("FAIL"));
    assert!(!checked.is_empty() && !has_error, "{doctor:#?}");
    assert!(matches!(doctor.code(), Some(0 | 8)), "{doctor:#?}");
    rig.robot.run("relay status", 0);
    // What the bridge holds came before this subscriber, and comes again.
    let mut reader = OutlineReader::new();
    let mut pieces = rig.station.subscribe::<BridgeOutline>(1);
    while reader.outline().is_none() {
        let piece = pieces.port.recv_timeout(WAIT_LIMIT).expect("a topic");
        reader.take(&piece.expect("all pieces of what the bridge holds"));
    }
    let number = reader.outline().map(|outline| outline.number);
    let mut states = rig.station.subscribe::<ModuleState>(1);
    states.until("the same number", |state| Some(state.outline) == number);

    let dsp = station.0.end(TELEMETRY);
    let hero = station.1.end(TELEMETRY);
    let state = station.2.end(STATES);
    assert_same(&robot.0.end(0), &dsp);
    assert_same(&robot.1.end(0), &hero);
    assert_same(&robot.2.end(0), &state);
    let [bridge, sim] = rig.end();
    let log = BridgeLog::of([&bridge]);
    let begun = ["start", "takeoff", "goto", "land", "stop"].map(|command| log.begun(command));
    assert_eq!(begun, [1, 2, 4, 1, 1], "{:#?}", log.lines);
    assert_eq!(log.executed_twice(), Vec::<u64>::new());
    // Taken, not reached: the bridge's box is larger than the DSP's, so a landing that follows at once is allowed to
    // empty the path buffer just before the DSP reaches the last waypoint.
    sim.err_says("waypoints_taken=4");
}

#[test]
fn a_program_that_comes_late_gets_the_latest_sample_at_once() {
    let Some(mut rig) = rig("late", "") else {
        return;
    };
    let mut early = rig.station.subscribe::<HeroTelemetry>(1);
    early.next_sample();
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
    await_link(&rig.station, 1);
    rig.end();
}

/// What is started.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Router,
    Robots,
    Station,
}

/// Starts a star in this order, and flies both robots one after the other.
fn fly_a_star(order: [Part; 3]) {
    let Some(ril) = ril() else {
        return;
    };
    let endpoint = free_endpoint();
    let through = "[network]\nthrough = \"router\"\n[robot]\nlisten = []\n";
    let machines = [1_u32, 2].map(|number| {
        let machine = machine(&ril, "star");
        machine.write("relay.toml", through);
        let processes = machine.start_robot(number, SPEED);
        (machine, number, processes)
    });
    let station = machine(&ril, "star");
    station.write(
        "relay.toml",
        &format!("{through}[station]\nrobots = [{{ number = 1 }}, {{ number = 2 }}]\n"),
    );
    let mut relays: Vec<Process> = Vec::new();
    for part in order {
        match part {
            Part::Router => {
                relays.push(station.start_ready(&format!("relay router --listen {endpoint}")));
            }
            Part::Robots => {
                for (machine, number, _) in &machines {
                    // It is ready when it has reached the router.
                    relays.push(machine.start(&format!(
                        "relay robot --robot {number} --connect {endpoint} --may-command gcs"
                    )));
                }
            }
            Part::Station => relays.push(
                // And so is this one.
                station.start(&format!("relay station --name gcs --connect {endpoint}")),
            ),
        }
    }
    await_link(&station, 1);
    await_link(&station, 2);
    // Only the robot that is meant starts.
    station.run("start --robot 2", 0);
    let is_running = |state: &ModuleState| state.status == ModuleStatus::Running.code();
    station
        .subscribe::<ModuleState>(2)
        .until("robot 2 runs", is_running);
    assert!(!is_running(
        &station.subscribe::<ModuleState>(1).next_sample()
    ));
    for number in [2, 1] {
        station.run(
            &format!("start --robot {number}"),
            if number == 2 { 5 } else { 0 },
        );
        station.run(&format!("takeoff --robot {number} --altitude 5"), 0);
        station.run(&format!("land --robot {number}"), 0);
    }
    relays.into_iter().rev().for_each(|relay| {
        relay.end();
    });
    for (_machine, _, processes) in machines {
        processes.end();
    }
}

#[test]
fn a_star_works_when_the_router_comes_first() {
    fly_a_star([Part::Router, Part::Robots, Part::Station]);
}

#[test]
fn a_star_works_when_the_router_comes_last() {
    fly_a_star([Part::Station, Part::Robots, Part::Router]);
}

const KEY: &str = "stranger/all";

/// How long a sample is waited for until the next one is published.
const REPEAT_PERIOD: Duration = Duration::from_millis(200);

/// A schema of the greatest length: many fields, and a comment that fills it up. Its samples have some 9 KB.
fn longest_schema() -> String {
    let mut text = "# Layout: stranger.All.v1\n\nuint64 sequence\nuint64 epoch_ns\n".to_owned();
    for number in 0..9000 {
        text += &format!("uint8 field_{number}\n");
    }
    text += "# ";
    text += &"x".repeat(MAX_TEXT_LEN - text.len() - 1);
    text + "\n"
}

#[test]
fn a_stranger_s_topic_with_the_longest_schema_is_relayed() {
    let Some(ril) = ril() else {
        return;
    };
    let text = longest_schema();
    assert_eq!(text.len(), MAX_TEXT_LEN);
    let robot = machine(&ril, "the longest schema");
    let station = machine(&ril, "the longest schema");
    let ipc = robot.domain.join("stranger");
    let mut publisher = DynamicPublisher::open(&ipc, KEY, &text).expect("a topic");
    let endpoint = free_endpoint();
    let robot_relay = robot.start_ready(&format!("relay robot --listen {endpoint}"));
    let station_relay = start_station_relay(&station, &endpoint);
    let here = station.domain.join_as(RobotId::DEFAULT, "test");
    // The link is shown as up when all services of the robot are here.
    station
        .subscribe::<RelayLink>(1)
        .until("the link is up", |link| {
            link.state == RelayLinkState::Up.code()
        });
    let schema = schema_of(&here, KEY).expect("it is provided here");
    assert_eq!(schema, *publisher.schema());
    let facts = dynamic::topics(&here);
    assert!(
        facts.iter().any(|facts| facts.text == text),
        "to the letter"
    );
    let mut subscriber = DynamicSubscriber::open(&here, KEY, &schema).expect("a subscriber");
    let last = schema.size() - 1;
    // The test's watchdog ends it when none arrives.
    for value in (1..=u8::MAX).cycle() {
        publisher
            .publish(|sample| sample[last] = value)
            .expect("a sample");
        subscriber.wait(REPEAT_PERIOD).expect("a wait");
        let mut received = None;
        let drained = subscriber.drain(|sample| received = Some(sample[last]));
        drained.expect("samples");
        if received == Some(value) {
            break;
        }
    }
    station_relay.end();
    robot_relay.end();
}
