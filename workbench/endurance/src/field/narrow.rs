//! Narrow links: how soon orders end, how much telemetry comes and how old it is. The radio is [`Air`] on loopback, and needs no root.

use std::path::Path;
use std::sync::mpsc::{self, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason};
use ipc_types::payload::{HeroTelemetry, ModuleControl, RelayLink, RelayStations};
use ipc_types::{Client, Ipc, MonotonicNs, RobotId, Wake, fresh_request_id};
use ril_tests::Sandbox;
use ril_tests::air::{Air, Weather};
use ril_tests::relayed::{
    STATION, await_link, free_endpoint, start_robot_relay, start_station_relay,
};

use super::site::certificates;
use crate::outcome::{Outcome, Times};

/// The links that are measured: kbit/s, and one way.
pub const LINKS: [(u32, Duration); 3] = [
    (64, Duration::from_millis(100)),
    (256, Duration::from_millis(50)),
    (1000, Duration::from_millis(100)),
];

/// The protocols of a link.
pub const PROTOCOLS: [&str; 2] = ["tcp", "quic"];

/// From one order to the next.
const PERIOD: Duration = Duration::from_millis(500);

/// How long telemetry is waited for before its thread looks whether it is to end.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Samples of telemetry that are read at least.
const LEAST: usize = 10;

/// An order that has no final report by then hangs, and so does telemetry that does not come.
const LONGEST: Duration = Duration::from_secs(90);

/// What is measured over one link.
#[derive(Clone, Copy, Debug)]
pub struct Narrow<'a> {
    /// The program `ril`; the relay's lies beside it.
    pub ril: &'a Path,
    /// Protocol between the relays.
    pub protocol: &'a str,
    /// Rate of the link, kbit/s.
    pub kbit_per_s: u32,
    /// One way.
    pub delay: Duration,
    /// One of so many packets is lost.
    pub lost_of: Option<usize>,
    /// How many orders.
    pub orders: u32,
    /// A measurement that takes longer hangs.
    pub limit: Duration,
}

/// Starts a robot and a station, sends orders, and reads telemetry meanwhile.
pub fn run(narrow: &Narrow<'_>, goes_on: &dyn Fn() -> bool) -> Outcome {
    let machine = || Sandbox::new([narrow.ril], "narrow", narrow.limit);
    let (robot, station) = (machine(), machine());
    let tcp = free_endpoint();
    let endpoint = match narrow.protocol {
        "quic" | "tls" => {
            robot.run(&format!("relay certify pki robot-1=127.0.0.1 {STATION}"), 0);
            let folder = robot.path("pki");
            robot.write("relay.toml", &certificates(&folder, "robot-1"));
            station.write("relay.toml", &certificates(&folder, STATION));
            tcp.replace("tcp", narrow.protocol)
        }
        _ => tcp,
    };
    let processes = robot.start_robot(1, 1);
    let robot_relay = start_robot_relay(&robot, &endpoint);
    let air = Air::to(
        &endpoint,
        Weather {
            lost_of: narrow.lost_of,
            repetition: 4 * narrow.delay,
            ..Weather::narrow(narrow.kbit_per_s, narrow.delay)
        },
    );
    let began = MonotonicNs::now();
    let station_relay = start_station_relay(&station, &air.endpoint);
    await_link(&station, 1);
    let up_after = MonotonicNs::now().since(began);
    let ipc = station.domain.join("operator");
    let mut client = ipc.client().expect("a client");
    let telemetry = Telemetry::watch(&station);
    let (mut round_trips, mut open, mut refused) = (Times::default(), 0, 0);
    for _ in 0..narrow.orders {
        if !goes_on() {
            break;
        }
        match order(&mut client) {
            Some((_, true)) => refused += 1,
            Some((took, false)) => round_trips.push(took),
            None => open += 1,
        }
        client.wait(PERIOD).expect("a wait");
    }
    let Seen {
        ages,
        repeated,
        rate_hz,
    } = telemetry.end(LEAST);
    let stations = station
        .subscribe::<RelayStations>(1)
        .until("stations", |_| true);
    let link = station.subscribe::<RelayLink>(1).next_sample();
    drop((client, ipc));
    station_relay.end();
    robot_relay.end();
    processes.end();

    let mut outcome = Outcome::default();
    let (kbit, round_trip) = (narrow.kbit_per_s, 2 * narrow.delay);
    outcome.cell(
        "link",
        format!("{kbit} kbit/s, {} ms", round_trip.as_millis()),
    );
    outcome.cell("over", narrow.protocol);
    outcome.cell("order: p50, p90, s", quantiles(&round_trips));
    outcome.cell("telemetry, Hz", format!("{rate_hz:.1}"));
    outcome.cell("its age: p50, p90, s", quantiles(&ages));
    let pace = match stations.samples_bytes_per_s {
        0 => "all".to_owned(),
        rate => format!("{:.1}", f64::from(rate) / 1000.0),
    };
    outcome.cell("samples, kB/s", pace);
    outcome.cell("up after, s", format!("{:.1}", up_after.as_secs_f64()));
    outcome.cell("outages", link.outages);
    outcome.cell("orders refused meanwhile", refused);
    outcome.cell("left out", link.samples_left_out);
    outcome.require(open == 0, format!("{open} orders without a final report"));
    outcome.require(
        repeated == 0,
        format!("{repeated} samples are not newer than the one before"),
    );
    outcome
}

/// The median, and what nine of ten do not exceed, s.
fn quantiles(times: &Times) -> String {
    let [median, most] = [0.5, 0.9].map(|share| times.quantile(share).as_secs_f64());
    format!("{median:.2}, {most:.2}")
}

/// Sends an order that changes nothing, and waits for its final report. Says how long that took, and whether the link was down.
fn order(client: &mut Client<ModuleControl>) -> Option<(Duration, bool)> {
    let id = fresh_request_id();
    let sent = MonotonicNs::now();
    let order = ModuleControl::new(id, ControlCommand::Stop);
    client.send(&order).expect("the relay is there");
    let give_up = sent + LONGEST;
    loop {
        let mut end = None;
        client.drain(|report| {
            if report.request_id == id && report.is_final() {
                end = Some(report.reason() == Some(Reason::RelayLinkDown));
            }
        });
        let now = MonotonicNs::now();
        if end.is_some() || now >= give_up {
            return end.map(|is_down| (now.since(sent), is_down));
        }
        client.wait(give_up.since(now)).expect("a wait");
    }
}

/// Telemetry at the station, read on a thread of its own.
struct Telemetry {
    end: Sender<usize>,
    thread: JoinHandle<Seen>,
}

/// What came of it.
#[derive(Default)]
struct Seen {
    /// From the DSP's byte to the station.
    ages: Times,
    /// Samples that came after a newer one.
    repeated: usize,
    rate_hz: f64,
}

impl Telemetry {
    fn watch(station: &Sandbox) -> Telemetry {
        let (end, is_over) = mpsc::channel();
        let domain = station.domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "observer").expect("a place");
            let mut port = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
            // What was there before it began says nothing of now.
            let mut last = port
                .latest()
                .ok()
                .flatten()
                .map_or(0, |sample| sample.source_sequence);
            let mut seen = Seen::default();
            let mut silent = Duration::ZERO;
            let begin = MonotonicNs::now();
            let mut least = None;
            while least.is_none_or(|least| seen.ages.count() < least) {
                let wake = port.wait(LOOK_PERIOD).expect("a wait");
                silent = if wake == Wake::TimedOut {
                    silent + LOOK_PERIOD
                } else {
                    Duration::ZERO
                };
                assert!(silent < LONGEST, "no telemetry comes");
                least = is_over.try_recv().ok().or(least);
                let now = MonotonicNs::now();
                // What cannot be received now can be by the next call, says the subscriber.
                let _ = port.drain(|sample| {
                    seen.repeated += usize::from(sample.source_sequence <= last);
                    last = sample.source_sequence;
                    seen.ages.push(now.since(MonotonicNs(sample.received_ns)));
                });
            }
            let took = MonotonicNs::now().since(begin);
            seen.rate_hz = seen.ages.count() as f64 / took.as_secs_f64();
            seen
        });
        Telemetry { end, thread }
    }

    /// Ends when so many samples have come.
    fn end(self, least: usize) -> Seen {
        self.end.send(least).expect("telemetry can be read");
        self.thread.join().expect("telemetry can be read")
    }
}
