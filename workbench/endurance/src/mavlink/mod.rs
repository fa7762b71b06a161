//! What stations cost `ril run mavlink`, how old telemetry is where they get it, how soon commands are answered, how
//! long missions take, and what a flood of hostile datagrams does to all of that.

pub mod mission;
pub mod station;

use std::fs;
use std::net::{SocketAddr, UdpSocket};
use std::thread::{self, ScopedJoinHandle};
use std::time::{Duration, Instant};

use fastrand::Rng;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{MonotonicNs, RobotId};
use mavlink_gateway::message::{
    ALL, ATTITUDE, COMMAND_LONG, EXTENDED_SYS_STATE, GLOBAL_POSITION_INT, HEARTBEAT,
};
use mavlink_gateway::number::command;
use mavlink_gateway::wire::MessageWriter;
use ril_tests::Process;

use crate::hostile::Hostile;
use crate::listener::{Heard, Listener};
use crate::site::{Site, count_lines, memory_mb, usage_of};
use measure::{Outcome, Times};
use station::{Received, Station, heartbeat};

const NAN: f32 = f32::NAN;

/// Of commands, which the crate has where plans are read.
const TAKE_OFF: u16 = 22;

/// Mode Hold, as the heartbeat has it.
const HOLD: u32 = 0x0304_0000;

/// The mode in which a path is flown that is no mission.
const OFFBOARD: u32 = 0x0006_0000;

/// Shortest period that a station can choose, µs: each sample of a robot that sends 50 a second.
const EACH_SAMPLE_US: f32 = 20_000.0;

/// Items of the longest mission.
const MOST_ITEMS: u16 = 2_048;

/// How long the helicopter flies before each hold of a flood.
const HOLD_PERIOD: Duration = Duration::from_secs(5);

/// The gateway, and the two stations that it knows.
struct Ground {
    gateway: Process,
    stations: Vec<Station>,
    /// Holds that were commanded and answered before the flood.
    holds: usize,
}

/// Each measurement, one after the other, of the same gateway.
pub fn run(site: &Site) {
    let mut chain = site.start_chain(1);
    let mut ground = Ground::start(site);
    // Which stations are there, and whether the first one asks for ATTITUDE at the highest rate.
    for (name, stations, is_each_sample) in [
        ("none", 0, false),
        ("1", 1, false),
        ("2", 2, false),
        ("2, one with ATTITUDE of each sample", 2, true),
    ] {
        if site.goes_on() {
            watch(site, &mut ground, name, stations, is_each_sample);
        }
    }
    // What the line loses in each direction.
    for loss in [0.0, 0.2] {
        if site.goes_on() {
            send_mission(site, ground.pilot(), loss);
        }
    }
    take_off(ground.pilot());
    if site.goes_on() {
        command_in_flight(site, &mut ground);
    }
    if site.goes_on() {
        fly_in_a_flood(site, &mut ground, &mut chain[1]);
    }
    ground.gateway.end();
    site.end(chain, false);
}

impl Ground {
    fn start(site: &Site) -> Ground {
        let stations = vec![Station::new(), Station::new()];
        // A machine that stalls must not make the helicopter one that is not heard.
        let patience = site.plan.either("lost_s = 60.0\nanswer_s = 60.0\n", "");
        let [first, second] = [stations[0].port(), stations[1].port()];
        let config = format!(
            "port = 0\nstations = ['127.0.0.1:{first}', '127.0.0.1:{second}']\nstate = 'state'\n{patience}\
             [commands]\nsystems = [255]\n"
        );
        site.write("mavlink.toml", &config);
        Ground {
            gateway: site.start_ready("run mavlink"),
            stations,
            holds: 0,
        }
    }

    fn pilot(&mut self) -> &mut Station {
        &mut self.stations[0]
    }
}

/// What a station got in some time.
#[derive(Default)]
struct Got {
    /// The samples of ATTITUDE, by `time_boot_ms`, and when each was here.
    samples: Vec<(u32, MonotonicNs)>,
    datagrams: u64,
    bytes: u64,
}

/// Listens for so long.
fn listen(station: &mut Station, duration: Duration) -> Got {
    let (begun, before) = (Instant::now(), station.received);
    let mut got = Got::default();
    while begun.elapsed() < duration {
        let message = station.next_message();
        if let Some(message) = message.filter(|message| message.is(ATTITUDE.id)) {
            got.samples.push((message.i32(0) as u32, message.at));
        }
    }
    got.datagrams = station.received.0 - before.0;
    got.bytes = station.received.1 - before.1;
    got
}

/// Of each sample: `time_boot_ms` of its messages, and when status published it.
type Published = (u32, MonotonicNs);

/// A consumer of status beside the stations.
fn consumer(site: &Site) -> Listener<Published> {
    let published = |sample: &HeroTelemetry| {
        let time_boot_ms = (sample.received_ns / 1_000_000) as u32;
        (time_boot_ms, MonotonicNs(sample.published_ns))
    };
    let consumer = Listener::start(&site.domain, RobotId::DEFAULT, published);
    consumer.next();
    consumer
}

/// From the moment at which status published a sample to that at which its datagram was read.
fn ages(published: &[Heard<Published>], got: &Got) -> Times {
    let age = |(time_boot_ms, at): &(u32, MonotonicNs)| {
        let mut newest_first = published.iter().rev();
        let same = newest_first.find(|heard| heard.kept.0 == *time_boot_ms)?;
        Some(at.since(same.kept.1))
    };
    got.samples.iter().filter_map(age).collect()
}

/// What stations cost, and what they get.
fn watch(site: &Site, ground: &mut Ground, name: &str, count: usize, is_each_sample: bool) {
    let stations = &mut ground.stations[..count];
    stations.iter_mut().for_each(Station::connect);
    if is_each_sample {
        let wish = [ATTITUDE.id as f32, EACH_SAMPLE_US, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(stations[0].command(command::SET_MESSAGE_INTERVAL, wish), 0);
    }
    let consumer = consumer(site);
    let duration = site.plan.duration(60);
    let (before, begun) = (usage_of(&ground.gateway), Instant::now());
    let (got, published) = thread::scope(|scope| {
        let listeners: Vec<_> = stations
            .iter_mut()
            .map(|station| scope.spawn(move || listen(station, duration)))
            .collect();
        let published = consumer.until(MonotonicNs::now() + duration);
        let got: Result<Vec<Got>, _> = listeners.into_iter().map(ScopedJoinHandle::join).collect();
        (got.expect("stations that end"), published)
    });
    let seconds = begun.elapsed().as_secs_f64();
    let cpu = usage_of(&ground.gateway).since(&before).all_percent;
    consumer.end();

    let mut outcome = Outcome::default();
    outcome.cell("stations", name);
    outcome.cell("processor", format!("{cpu:.2} %"));
    outcome.cell("memory", format!("{:.1} MB", memory_mb(&ground.gateway)));
    let first = got.first();
    let rate = |amount: fn(&Got) -> f64| match first {
        Some(first) => format!("{:.1}", amount(first) / seconds),
        None => "–".to_owned(),
    };
    outcome.cell(
        "datagrams a second to each",
        rate(|got| got.datagrams as f64),
    );
    outcome.cell("kB a second", rate(|got| got.bytes as f64 / 1e3));
    let of_first = first.map_or_else(Times::default, |got| ages(&published, got));
    outcome.cell(
        "ATTITUDE, published by status to read here",
        format!("{of_first:.2}"),
    );
    let beside = published.iter().map(|heard| heard.at.since(heard.kept.1));
    let beside = beside.collect::<Times>();
    outcome.cell("the same at a consumer of status", format!("{beside:.2}"));
    let is_silent = got.iter().any(|one| one.samples.is_empty());
    outcome.require(!is_silent, "a station got no ATTITUDE");
    site.show(outcome);
}

/// Sends the longest mission and reads it again, over a line with this loss.
fn send_mission(site: &Site, pilot: &mut Station, loss: f64) {
    let count = site.plan.either(200, MOST_ITEMS);
    let items = mission::mission(count, 15.0);
    pilot.connect();
    pilot.lose(loss, site.plan.seed);
    let begun = Instant::now();
    let result = mission::upload(pilot, &items);
    let (sent, begun) = (begun.elapsed(), Instant::now());
    let read = mission::download(pilot);
    let took = begun.elapsed();
    pilot.lose(0.0, 0);
    let mut outcome = Outcome::default();
    outcome.cell("items", count);
    outcome.cell("lost in each direction", format!("{:.0} %", loss * 100.0));
    let seconds = |time: Duration| format!("{:.2} s", time.as_secs_f64());
    outcome.cell("sent and in force after", seconds(sent));
    outcome.cell("read after", seconds(took));
    outcome.require(result == 0, format!("the mission was refused: {result}"));
    let is_whole = read == mission::contents(&items);
    outcome.require(is_whole, "what was read is another mission");
    site.show(outcome);
}

fn take_off(pilot: &mut Station) {
    pilot.connect();
    let result = pilot.command(TAKE_OFF, [NAN, 0.0, 0.0, NAN, NAN, NAN, NAN]);
    assert_eq!(result, 0);
    pilot.until_text("take-off done");
    let is_in_air = |message: &Received| message.is(EXTENDED_SYS_STATE.id) && message.u8(1) == 2;
    pilot.until("in the air", is_in_air);
}

/// The command to fly 5 km to the north, 15 m above home, which takes minutes; each number is another place, by more
/// than the GPS is noisy.
fn away(pilot: &mut Station, number: usize) -> MessageWriter {
    let here = pilot.until("a position", |message| message.is(GLOBAL_POSITION_INT.id));
    let north = here.i32(4) + 450_000 + 500 * number as i32;
    station::reposition(6, north, here.i32(8), 15.0)
}

/// Commands to fly away and to hold by turns, at random moments: each is another one, and the bridge gets each.
fn command_in_flight(site: &Site, ground: &mut Ground) {
    let pilot = ground.pilot();
    let mut chance = site.chance(1);
    let hold = station::long(command::PAUSE_CONTINUE, [0.0; 7]);
    let (mut paths, mut holds) = (Times::default(), Times::default());
    for number in 0..site.plan.count(200) as usize {
        let away = away(pilot, number);
        for (message, number, times) in [
            (&away, command::REPOSITION, &mut paths),
            (&hold, command::PAUSE_CONTINUE, &mut holds),
        ] {
            // The gateway knows 16 commands of a station at a time, each for 2.5 s.
            listen(pilot, Duration::from_secs_f64(0.1 + 0.1 * chance.f64()));
            let begun = Instant::now();
            pilot.send(message);
            let answer = pilot.answer(number);
            times.push(begun.elapsed());
            assert_eq!(answer.u8(2), 0);
        }
    }
    let mut outcome = Outcome::default();
    outcome.cell("commands", paths.count() + holds.count());
    outcome.cell("DO_REPOSITION to its answer", &paths);
    outcome.cell("hold to its answer", &holds);
    ground.holds = holds.count();
    site.show(outcome);
}

/// One station flies and holds again and again, while others send what the gateway is to withstand.
fn fly_in_a_flood(site: &Site, ground: &mut Ground, bridge: &mut Process) {
    let per_second = site.plan.either(1_000, 10_000);
    let duration = site.plan.duration(60);
    let log_before = ground.gateway.lines().len();
    let vehicle = ground.pilot().vehicle();
    let drops_before = dropped(&ground.gateway, vehicle.port());
    let consumer = consumer(site);
    let hostile = Hostile::start(site, per_second, ROW, || {
        let sockets = (0..SOCKETS).map(|_| UdpSocket::bind("127.0.0.1:0").expect("a free port"));
        let sockets: Vec<UdpSocket> = sockets.collect();
        move |chance: &mut Rng| row(&sockets, vehicle, chance)
    });
    let (before, begun) = (usage_of(&ground.gateway), Instant::now());
    let (mut done, mut copies, mut most_memory_mb) = (Times::default(), 0, 0.0_f64);
    let mut got = Got::default();
    while begun.elapsed() < duration {
        let pilot = ground.pilot();
        let away = away(pilot, done.count());
        let (result, _) = pilot.send_until_answered(&away, command::REPOSITION, |_| {});
        assert_eq!(result, 0);
        pilot.until_mode(OFFBOARD);
        let left = duration.saturating_sub(begun.elapsed());
        got.samples
            .extend(listen(pilot, left.min(HOLD_PERIOD)).samples);
        let (done_after, sent) = hold(pilot);
        done.push(done_after);
        copies += sent;
        most_memory_mb = most_memory_mb.max(memory_mb(&ground.gateway));
    }
    let seconds = begun.elapsed().as_secs_f64();
    let (published, _) = consumer.end();
    let cpu = usage_of(&ground.gateway).since(&before).all_percent;
    let sent = hostile.end();
    let drops = dropped(&ground.gateway, vehicle.port()) - drops_before;
    // The bridge logs in order: when it has logged the landing, all holds are in its log.
    site.ask("land --preempt --no-wait");
    bridge.wait_for_text("command=\"land\"");
    let requests = count_lines(bridge, "command=\"hold\"") - ground.holds;
    let holds = done.count();

    let mut outcome = Outcome::default();
    let sent_per_s = format!("{:.0}", sent as f64 / seconds);
    outcome.cell("hostile datagrams a second", sent_per_s);
    outcome.cell("dropped by the kernel", drops);
    outcome.cell("processor", format!("{cpu:.1} %"));
    outcome.cell("most memory", format!("{most_memory_mb:.1} MB"));
    outcome.cell("holds", holds);
    outcome.cell("sent", copies);
    outcome.cell("requests of the bridge", requests);
    outcome.cell("commanded to mode Hold", &done);
    let ages = ages(&published, &got);
    outcome.cell(
        "ATTITUDE at the station, published to read",
        format!("{ages:.2}"),
    );
    outcome.cell("log lines", ground.gateway.lines().len() - log_before);
    // A copy that comes when the first one is answered already is a hold, too.
    let are_right = (holds..=copies).contains(&requests);
    outcome.require(are_right, "the bridge got another number of holds");
    outcome.require(!got.samples.is_empty(), "no telemetry came");
    let is_short = site.plan.is_short;
    let is_soon = is_short || done.worst() <= Duration::from_secs(1);
    outcome.require(is_soon, "a hold took more than 1 s");
    let is_small = is_short || most_memory_mb < 20.0;
    outcome.require(is_small, "the gateway has more than 20 MB");
    site.show(outcome);
}

/// Holds, which must be done. Says how long it took from the first copy to the mode that shows it, and how many copies
/// were sent.
fn hold(pilot: &mut Station) -> (Duration, usize) {
    let (begun, mut shown) = (Instant::now(), None);
    let message = station::long(command::PAUSE_CONTINUE, [0.0; 7]);
    let look = |message: &Received| {
        if message.is(HEARTBEAT.id) && message.i32(0) as u32 == HOLD {
            shown.get_or_insert(begun.elapsed());
        }
    };
    let (result, copies) = pilot.send_until_answered(&message, command::PAUSE_CONTINUE, look);
    assert_eq!(result, 0);
    let done_after = shown.unwrap_or_else(|| {
        pilot.until_mode(HOLD);
        begun.elapsed()
    });
    (done_after, copies)
}

/// Datagrams for the process's socket at `port` that the kernel had no room for.
fn dropped(process: &Process, port: u16) -> u64 {
    let table = fs::read_to_string(format!("/proc/{}/net/udp", process.id())).expect("it runs");
    let local = format!(":{port:04X}");
    let mut lines = table
        .lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>());
    let line = lines.find(|words| {
        words
            .get(1)
            .is_some_and(|address| address.ends_with(&local))
    });
    let drops = line.and_then(|words| words.last()?.parse().ok());
    drops.expect("a socket")
}

/// Sockets of each hostile thread.
const SOCKETS: usize = 16;

/// Datagrams that one hostile thread sends in a row: all rows at once fit into the gateway's socket, because what the
/// kernel drops tries nothing.
const ROW: u32 = 20;

/// The system of those that are not permitted.
const STRANGER: u8 = 77;

/// Sends from many ports what no station sends, and commands of stations that are not permitted.
fn row(sockets: &[UdpSocket], gateway: SocketAddr, chance: &mut Rng) -> u64 {
    let mut send = |_| {
        let socket = chance.choice(sockets).expect("there are some");
        u64::from(socket.send_to(&datagram(chance), gateway).is_ok())
    };
    (0..ROW).map(&mut send).sum()
}

/// A sixth each: any bytes, any message cut short, any with a wrong checksum, any with any content, and a stranger's
/// heartbeats and commands.
fn datagram(chance: &mut Rng) -> Vec<u8> {
    let kind = chance.u8(..6);
    if kind == 0 {
        let length = chance.usize(..280);
        return (0..length).map(|_| chance.u8(..)).collect();
    }
    let message = match kind {
        4 => heartbeat(),
        5 => order(chance),
        _ => any_message(chance),
    };
    let mut bytes = message.frame(0, STRANGER, chance.u8(1..=200));
    match kind {
        1 => bytes.truncate(chance.usize(1..bytes.len())),
        2 => *bytes.last_mut().expect("a frame") ^= 1,
        _ => {}
    }
    bytes
}

fn any_message(chance: &mut Rng) -> MessageWriter {
    let kind = *chance.choice(ALL).expect("there are some");
    let fields = chance.usize(..60);
    (0..fields).fold(MessageWriter::new(kind), |message, _| {
        message.u8(chance.u8(..))
    })
}

/// Arms, takes off, holds, lands, returns, starts the mission, or changes the speed.
fn order(chance: &mut Rng) -> MessageWriter {
    let command = chance
        .choice([400, 22, 193, 21, 20, 300, 178])
        .expect("there are some");
    let message = MessageWriter::new(COMMAND_LONG)
        .f32(chance.f32())
        .f32s(0.0, 6);
    message.u16(command).u8(1).u8(1).u8(0)
}
