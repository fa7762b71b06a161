//! Narrow links: how soon orders end, how much telemetry comes and how old it is. Links that become longer in flight:
//! how long that costs telemetry. The radio is [`Air`] on loopback, and needs no root.

use std::time::Duration;

use ipc_types::code::Reason;
use ipc_types::payload::{HeroTelemetry, RelayLink, RelayStations};
use ipc_types::{MonotonicNs, RobotId};
use ril_tests::air::{Air, Weather};
use ril_tests::relayed::{await_link, free_endpoint, start_robot_relay, start_station_relay};

use super::{Operator, secure};
use crate::listener::{Heard, Listener};
use crate::site::Site;
use measure::{Outcome, Times};

/// The links that are measured: kbit/s, and one way.
pub const LINKS: [(u32, Duration); 3] = [
    (64, Duration::from_millis(100)),
    (256, Duration::from_millis(50)),
    (1000, Duration::from_millis(100)),
];

/// From one order to the next.
const PERIOD: Duration = Duration::from_millis(500);

/// Samples of telemetry that are read at least.
const LEAST: usize = 10;

/// By how much a round trip becomes longer for good, and one way before.
pub const LONGER: [(Duration, Duration); 2] = [
    (Duration::from_millis(400), Duration::from_millis(10)),
    (Duration::from_millis(500), Duration::from_millis(50)),
];

/// A second in which this share of the telemetry came misses none: the next one may have begun.
const ALL: f64 = 0.9;

/// Telemetry that is not all there for so many seconds is missed for good.
const GIVE_UP_AFTER_S: u64 = 300;

/// Measures each link and each protocol that is planned.
pub fn run(site: &Site) {
    let links = match site.plan.kbit_per_s {
        Some(kbit_per_s) => vec![(kbit_per_s, site.plan.one_way(200))],
        None => LINKS.to_vec(),
    };
    for link in links {
        for protocol in site.plan.protocols(&["tcp", "quic"]) {
            if site.goes_on() {
                measure(site, protocol, link);
            }
        }
    }
}

/// Measures what a way costs that becomes longer, and shorter again, with each protocol that is planned.
pub fn roam(site: &Site) {
    let rises = &LONGER[..site.plan.either(1, LONGER.len())];
    for rise in rises {
        for protocol in site.plan.protocols(&["tcp", "quic"]) {
            if site.goes_on() {
                measure_rise(site, protocol, *rise);
            }
        }
    }
}

/// Starts a robot and a station, waits until all telemetry comes, lets each round trip become longer, and reads on.
fn measure_rise(site: &Site, protocol: &str, (rise, delay): (Duration, Duration)) {
    let (robot, station) = (site.machine([]), site.machine([]));
    let endpoint = free_endpoint().replace("tcp", protocol);
    secure(protocol, "127.0.0.1", &robot, &station);
    let processes = robot.start_robot(1, 1);
    let robot_relay = start_robot_relay(&robot, &endpoint);
    let air = Air::to(&endpoint, Weather::far(delay));
    let station_relay = start_station_relay(&station, &air.endpoint);
    await_link(&station, 1);
    let sent = Listener::start(&robot.domain, RobotId::DEFAULT, |_: &HeroTelemetry| ());
    let received = HeroTelemetry::received;
    let heard = Listener::start(&station.domain, RobotId::DEFAULT, received);
    // How many seconds pass until it is all there, and stays so for `seconds`.
    let missed = |seconds| {
        let began = MonotonicNs::now();
        let mut good = 0;
        for second in 1..=GIVE_UP_AFTER_S {
            let end = began + Duration::from_secs(second);
            // A machine that stalls publishes less, too.
            let (heard, sent) = (heard.until(end).len() as f64, sent.until(end).len() as f64);
            good = if heard > 0.0 && heard >= ALL * sent {
                good + 1
            } else {
                0
            };
            if good == seconds {
                return Some(second - seconds);
            }
        }
        None
    };
    let at_first = missed(2);
    air.lengthen(rise / 2);
    // A relay that takes the way for a queue sends less after a second.
    let longer = missed(site.plan.either(5, 20));
    let newest = heard.next();
    let age = newest.at.since(newest.kept);
    air.lengthen(Duration::ZERO);
    // The tests have no time for it.
    let shorter = (!site.plan.is_short).then(|| missed(20));
    let link = station.subscribe::<RelayLink>(1).next_sample();
    heard.end();
    sent.end();
    station_relay.end();
    robot_relay.end();
    processes.end();

    let mut outcome = Outcome::default();
    let before_ms = 2 * delay.as_millis();
    let after_ms = before_ms + rise.as_millis();
    outcome.cell("round trip, ms", format!("{before_ms} to {after_ms}"));
    outcome.cell("over", protocol);
    let mut times = vec![
        ("telemetry missed at first, s", at_first),
        ("after the rise, s", longer),
    ];
    times.extend(shorter.map(|missed| ("after the fall, s", missed)));
    for (heading, missed) in times {
        let text = missed.map_or("all".to_owned(), |missed| missed.to_string());
        outcome.cell(heading, text);
        let why = format!("{heading}: all of {GIVE_UP_AFTER_S}");
        outcome.require(missed.is_some(), why);
    }
    outcome.cell(
        "its age after the rise, s",
        format!("{:.2}", age.as_secs_f64()),
    );
    outcome.require(age >= rise / 4, "no way has become longer");
    outcome.cell("outages", link.outages);
    site.show(outcome);
}

/// Starts a robot and a station, sends orders, and reads telemetry meanwhile.
fn measure(site: &Site, protocol: &str, (kbit_per_s, delay): (u32, Duration)) {
    let (robot, station) = (site.machine([]), site.machine([]));
    let endpoint = free_endpoint().replace("tcp", protocol);
    secure(protocol, "127.0.0.1", &robot, &station);
    let processes = robot.start_robot(1, 1);
    let robot_relay = start_robot_relay(&robot, &endpoint);
    let loss = site.plan.loss.filter(|loss| *loss > 0);
    let weather = Weather {
        lost_of: loss.map(|loss| 100 / usize::from(loss)),
        repetition: 4 * delay,
        ..Weather::narrow(kbit_per_s, delay)
    };
    let air = Air::to(&endpoint, weather);
    let began = MonotonicNs::now();
    let station_relay = start_station_relay(&station, &air.endpoint);
    await_link(&station, 1);
    let up_after = MonotonicNs::now().since(began);
    let mut operator = Operator::join(&station.domain, RobotId::DEFAULT);
    let received = |sample: &HeroTelemetry| (sample.source_sequence, sample.received());
    let telemetry = Listener::start(&station.domain, RobotId::DEFAULT, received);
    let begin = MonotonicNs::now();
    let (mut round_trips, mut open, mut refused) = (Times::default(), 0, 0);
    let mut heard = Vec::new();
    for _ in 0..site.plan.count(40) {
        if !site.goes_on() {
            break;
        }
        let order = operator.order().expect("the relay is there");
        match order.end.map(|report| report.reason()) {
            Some(Some(Reason::RelayLinkDown)) => refused += 1,
            Some(_) => round_trips.push(order.took),
            None => open += 1,
        }
        heard.extend(telemetry.until(MonotonicNs::now() + PERIOD));
    }
    while heard.len() < LEAST {
        heard.push(telemetry.next());
    }
    let rate_hz = heard.len() as f64 / MonotonicNs::now().since(begin).as_secs_f64();
    let mut stations = station.subscribe::<RelayStations>(1);
    let stations = stations.until("stations", |_| true);
    let link = station.subscribe::<RelayLink>(1).next_sample();
    drop(operator);
    telemetry.end();
    station_relay.end();
    robot_relay.end();
    processes.end();

    let mut outcome = Outcome::default();
    let round_trip_ms = 2 * delay.as_millis();
    outcome.cell("link", format!("{kbit_per_s} kbit/s, {round_trip_ms} ms"));
    outcome.cell("over", protocol);
    outcome.cell("order: p50, p90, s", round_trips.quantiles_s(&[0.5, 0.9]));
    outcome.cell("telemetry, Hz", format!("{rate_hz:.1}"));
    let age = |heard: &Heard<(u64, MonotonicNs)>| heard.at.since(heard.kept.1);
    let ages: Times = heard.iter().map(age).collect();
    outcome.cell("its age: p50, p90, s", ages.quantiles_s(&[0.5, 0.9]));
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
    let is_repeated = |pair: &&[Heard<(u64, MonotonicNs)>]| pair[1].kept.0 <= pair[0].kept.0;
    let repeated = heard.windows(2).filter(is_repeated).count();
    outcome.require(
        repeated == 0,
        format!("{repeated} samples are not newer than the one before"),
    );
    site.show(outcome);
}
