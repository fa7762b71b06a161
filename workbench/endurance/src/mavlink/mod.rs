//! What stations cost `ril run mavlink`, how old telemetry is where they get it, how soon commands are answered, how long missions take, and
//! what a flood of hostile datagrams does to all of that.

mod hostile;
pub mod mission;
pub mod station;

use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;
use ipc_types::payload::HeroTelemetry;
use mavlink_gateway::message::{ATTITUDE, EXTENDED_SYS_STATE, GLOBAL_POSITION_INT, HEARTBEAT};
use mavlink_gateway::number::command;
use ril_tests::Process;
use ril_tests::sandbox::{Holdings, TopicWatch};

use crate::outcome::{Outcome, Times};
use crate::plan::Plan;
use crate::site::{Site, count_lines};
use crate::usage::usage_of;
use hostile::Hostile;
use station::{Received, Station};

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

/// What the line loses in each direction.
const LOSS: f64 = 0.2;

/// How long the helicopter flies before each hold of a flood.
const HOLD_PERIOD: Duration = Duration::from_secs(5);

/// The gateway, and the two stations that it knows.
struct Ground {
    gateway: Process,
    stations: Vec<Station>,
    /// Holds that were commanded and answered before the flood.
    holds: usize,
}

/// Each measurement, one after the other, of the same gateway: `show` gets its rows.
///
/// # Panics
///
/// When a process does not come up, a station is not heard, or a transfer does not end.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool, show: &mut dyn FnMut(Outcome)) {
    let mut chain = site.start_chain_at(1);
    let mut ground = Ground::start(site, plan);
    for case in [
        Case::new("none", 0),
        Case::new("1", 1),
        Case::new("2", 2),
        Case {
            is_each_sample: true,
            ..Case::new("2, one with ATTITUDE of each sample", 2)
        },
    ] {
        if goes_on() {
            show(watch(site, plan, &mut ground, &case));
        }
    }
    for loss in [0.0, LOSS] {
        if goes_on() {
            show(send_mission(plan, &mut ground, loss));
        }
    }
    take_off(&mut ground);
    if goes_on() {
        show(command_in_flight(plan, &mut ground));
    }
    if goes_on() {
        show(fly_in_a_flood(site, plan, &mut ground, &mut chain[1]));
    }
    ground.gateway.end();
    site.end(chain, false);
}

impl Ground {
    fn start(site: &Site, plan: &Plan) -> Ground {
        let stations = vec![Station::new(), Station::new()];
        // A machine that stalls must not make the helicopter one that is not heard.
        let patience = match plan.is_short {
            true => "lost_s = 60.0\nanswer_s = 60.0\n",
            false => "",
        };
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

/// Who is there.
struct Case {
    name: &'static str,
    stations: usize,
    /// Whether the first one wants ATTITUDE as often as it can have it.
    is_each_sample: bool,
}

impl Case {
    fn new(name: &'static str, stations: usize) -> Case {
        Case {
            name,
            stations,
            is_each_sample: false,
        }
    }
}

/// What a station got in some time.
#[derive(Default)]
struct Heard {
    /// The samples of ATTITUDE, by `time_boot_ms`, and when each was here.
    samples: Vec<(u32, MonotonicNs)>,
    datagrams: u64,
    bytes: u64,
}

/// Listens for so long.
fn listen(station: &mut Station, duration: Duration) -> Heard {
    let (begun, before) = (Instant::now(), station.received);
    let mut heard = Heard::default();
    while begun.elapsed() < duration {
        if let Some(message) = station
            .next_message()
            .filter(|message| message.is(ATTITUDE.id))
        {
            heard.samples.push((message.i32(0) as u32, message.at));
        }
    }
    heard.datagrams = station.received.0 - before.0;
    heard.bytes = station.received.1 - before.1;
    heard
}

/// What a consumer of status got beside them.
#[derive(Default)]
struct Published {
    /// Of each sample: `time_boot_ms` of its messages, and when status published it.
    samples: Vec<(u32, MonotonicNs)>,
    /// From there to the consumer.
    ages: Times,
}

impl Published {
    fn listen(telemetry: &mut TopicWatch<HeroTelemetry>, duration: Duration) -> Published {
        let (begun, mut published) = (Instant::now(), Published::default());
        while begun.elapsed() < duration {
            telemetry.port.wait(duration).expect("a wait");
            let now = MonotonicNs::now();
            // What cannot be received now can be by the next call, says the subscriber.
            let _ = telemetry.port.drain(|sample| {
                let at = MonotonicNs(sample.published_ns);
                let time_boot_ms = (sample.received_ns / 1_000_000) as u32;
                published.samples.push((time_boot_ms, at));
                published.ages.push(now.since(at));
            });
        }
        published
    }

    /// From the moment at which status published a sample to that at which its datagram was read.
    fn ages(&self, heard: &Heard) -> Times {
        let age = |(time_boot_ms, at): &(u32, MonotonicNs)| {
            let same = |published: &&(u32, MonotonicNs)| published.0 == *time_boot_ms;
            let published = self.samples.iter().rev().find(same)?;
            Some(at.since(published.1))
        };
        Times(heard.samples.iter().filter_map(age).collect())
    }
}

/// What stations cost, and what they get.
fn watch(site: &Site, plan: &Plan, ground: &mut Ground, case: &Case) -> Outcome {
    let stations = &mut ground.stations[..case.stations];
    stations.iter_mut().for_each(Station::connect);
    if case.is_each_sample {
        let wish = [ATTITUDE.id as f32, EACH_SAMPLE_US, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(stations[0].command(command::SET_MESSAGE_INTERVAL, wish), 0);
    }
    let mut telemetry = site.subscribe::<HeroTelemetry>(1);
    let _ = telemetry.next_sample();
    let duration = plan.duration(60);
    let (before, begun) = (usage_of(&ground.gateway), Instant::now());
    let (heard, published) = thread::scope(|scope| {
        let listeners: Vec<_> = stations
            .iter_mut()
            .map(|station| scope.spawn(move || listen(station, duration)))
            .collect();
        let published = Published::listen(&mut telemetry, duration);
        let join = |listener: thread::ScopedJoinHandle<'_, Heard>| listener.join();
        let heard: Result<Vec<Heard>, _> = listeners.into_iter().map(join).collect();
        (heard.expect("stations that end"), published)
    });
    let seconds = begun.elapsed().as_secs_f64();
    let cpu = usage_of(&ground.gateway).since(&before).all_percent;

    let mut outcome = Outcome::default();
    outcome.cell("stations", case.name);
    outcome.cell("processor", format!("{cpu:.2} %"));
    outcome.cell("memory", memory(&ground.gateway));
    let first = heard.first();
    let of_first = |amount: Option<f64>| match amount {
        Some(amount) => format!("{:.1}", amount / seconds),
        None => "–".to_owned(),
    };
    outcome.cell(
        "datagrams a second to each",
        of_first(first.map(|one| one.datagrams as f64)),
    );
    outcome.cell(
        "kB a second",
        of_first(first.map(|one| one.bytes as f64 / 1e3)),
    );
    let ages = first.map_or_else(Times::default, |one| published.ages(one));
    outcome.cell("ATTITUDE, published by status to read here", micros(&ages));
    outcome.cell("the same at a consumer of status", micros(&published.ages));
    let is_silent = heard.iter().any(|one| one.samples.is_empty());
    outcome.require(!is_silent, "a station got no ATTITUDE");
    outcome
}

/// Sends the longest mission and reads it again, over a line with this loss.
fn send_mission(plan: &Plan, ground: &mut Ground, loss: f64) -> Outcome {
    let count = match plan.is_short {
        true => 200,
        false => MOST_ITEMS,
    };
    let items = mission::mission(count, 15.0);
    let pilot = ground.pilot();
    pilot.connect();
    pilot.lose(loss, plan.seed);
    let begun = Instant::now();
    let result = mission::upload(pilot, &items);
    let (sent, begun) = (begun.elapsed(), Instant::now());
    let read = mission::download(pilot);
    let took = begun.elapsed();
    pilot.lose(0.0, 0);
    let mut outcome = Outcome::default();
    outcome.cell("items", count);
    outcome.cell("lost in each direction", format!("{:.0} %", loss * 100.0));
    outcome.cell(
        "sent and in force after",
        format!("{:.2} s", sent.as_secs_f64()),
    );
    outcome.cell("read after", format!("{:.2} s", took.as_secs_f64()));
    outcome.require(result == 0, format!("the mission was refused: {result}"));
    let is_whole = read == mission::contents(&items);
    outcome.require(is_whole, "what was read is another mission");
    outcome
}

/// Takes off.
fn take_off(ground: &mut Ground) {
    let pilot = ground.pilot();
    pilot.connect();
    let result = pilot.command(TAKE_OFF, [NAN, 0.0, 0.0, NAN, NAN, NAN, NAN]);
    assert_eq!(result, 0);
    pilot.until_text("take-off done");
    let is_in_air = |message: &Received| message.is(EXTENDED_SYS_STATE.id) && message.u8(1) == 2;
    pilot.until("in the air", is_in_air);
}

/// Flies to a place 5 km to the north, 15 m above home, which it takes minutes to reach; each number is another place.
fn fly_away(pilot: &mut Station, number: i32) {
    let here = pilot.until("a position", |message| message.is(GLOBAL_POSITION_INT.id));
    let message = station::reposition(6, here.i32(4) + 450_000 + number, here.i32(8), 15.0);
    let (result, _) = pilot.send_until_answered(&message, command::REPOSITION, |_| {});
    assert_eq!(result, 0);
    pilot.until_mode(OFFBOARD);
}

/// Commands to fly away and to hold by turns, at random moments: each is another one, and the bridge gets each.
fn command_in_flight(plan: &Plan, ground: &mut Ground) -> Outcome {
    let pilot = ground.pilot();
    let mut chance = Random::new(plan.seed, 1);
    let (mut paths, mut holds) = (Times::default(), Times::default());
    let here = pilot.until("a position", |message| message.is(GLOBAL_POSITION_INT.id));
    for number in 0..plan.count.unwrap_or(200) as i32 {
        // The gateway knows 16 commands of a station at a time, each for 2.5 s.
        listen(pilot, Duration::from_secs_f64(0.1 + 0.1 * chance.uniform()));
        let begun = Instant::now();
        let result = pilot.reposition(6, here.i32(4) + 450_000 + number, here.i32(8), 15.0);
        paths.push(begun.elapsed());
        assert_eq!(result, 0);
        listen(pilot, Duration::from_secs_f64(0.1 + 0.1 * chance.uniform()));
        let begun = Instant::now();
        let result = pilot.command(command::PAUSE_CONTINUE, [0.0; 7]);
        holds.push(begun.elapsed());
        assert_eq!(result, 0);
    }
    ground.holds = holds.count();
    let mut outcome = Outcome::default();
    outcome.cell("commands", paths.count() + holds.count());
    outcome.cell("DO_REPOSITION to its answer", &paths);
    outcome.cell("hold to its answer", &holds);
    outcome
}

/// One station flies and holds again and again, while others send what the gateway is to withstand.
fn fly_in_a_flood(site: &Site, plan: &Plan, ground: &mut Ground, bridge: &mut Process) -> Outcome {
    let per_second = match plan.is_short {
        true => 1_000,
        false => 10_000,
    };
    let duration = plan.duration(60);
    let log_before = ground.gateway.lines().len();
    let (port, drops_before) = {
        let port = ground.pilot().vehicle().port();
        (port, dropped(&ground.gateway, port))
    };
    let mut telemetry = site.subscribe::<HeroTelemetry>(1);
    let _ = telemetry.next_sample();
    let hostile = Hostile::start(ground.pilot().vehicle(), per_second, plan.seed);
    let (before, begun) = (usage_of(&ground.gateway), Instant::now());
    let mut held = Vec::new();
    let mut most = Holdings::of(ground.gateway.id());
    let mut heard = Heard::default();
    let published = thread::scope(|scope| {
        let consumer = scope.spawn(|| Published::listen(&mut telemetry, duration));
        while begun.elapsed() < duration {
            fly_away(ground.pilot(), held.len() as i32);
            let left = duration.saturating_sub(begun.elapsed());
            let more = listen(ground.pilot(), left.min(HOLD_PERIOD));
            heard.samples.extend(more.samples);
            heard.datagrams += more.datagrams;
            held.push(hold(ground.pilot()));
            most = most.most(Holdings::of(ground.gateway.id()));
        }
        consumer.join().expect("a consumer that ends")
    });
    let seconds = begun.elapsed().as_secs_f64();
    let cpu = usage_of(&ground.gateway).since(&before).all_percent;
    let sent = hostile.end();
    let drops = dropped(&ground.gateway, port) - drops_before;
    let copies: usize = held.iter().map(|one| one.copies).sum();
    // The bridge logs in order: when it has logged the landing, all holds are in its log.
    site.ask("land --preempt --no-wait");
    bridge.wait_for_text("command=\"land\"");
    let requests = count_lines(bridge, "command=\"hold\"") - ground.holds;
    let done = Times(held.iter().map(|one| one.done_after).collect());

    let mut outcome = Outcome::default();
    outcome.cell(
        "hostile datagrams a second",
        format!("{:.0}", sent as f64 / seconds),
    );
    outcome.cell("dropped by the kernel", drops);
    outcome.cell("processor", format!("{cpu:.1} %"));
    let memory_mb = most.memory_kib as f64 / 1024.0;
    outcome.cell("most memory", format!("{memory_mb:.1} MB"));
    outcome.cell("holds", held.len());
    outcome.cell("sent", copies);
    outcome.cell("requests of the bridge", requests);
    outcome.cell("commanded to mode Hold", &done);
    outcome.cell(
        "ATTITUDE at the station, published to read",
        micros(&published.ages(&heard)),
    );
    outcome.cell("log lines", ground.gateway.lines().len() - log_before);
    // A copy that comes when the first one is answered already is a hold, too.
    let are_right = (held.len()..=copies).contains(&requests);
    outcome.require(are_right, "the bridge got another number of holds");
    outcome.require(!heard.samples.is_empty(), "no telemetry came");
    if !plan.is_short {
        let worst = done.quantile(1.0);
        outcome.require(worst <= Duration::from_secs(1), "a hold took more than 1 s");
        outcome.require(memory_mb < 20.0, "the gateway has more than 20 MB");
    }
    outcome
}

/// How a hold went.
struct Held {
    /// From the first copy to the mode that shows it.
    done_after: Duration,
    copies: usize,
}

/// Holds.
///
/// # Panics
///
/// When it is refused, or not done.
fn hold(pilot: &mut Station) -> Held {
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
    Held { done_after, copies }
}

/// Times that may be shorter than 0.1 ms.
fn micros(times: &Times) -> String {
    if times.count() == 0 {
        return "–".to_owned();
    }
    let ms = |share| times.quantile(share).as_secs_f64() * 1e3;
    let (median, most, worst) = (ms(0.5), ms(0.99), ms(1.0));
    let count = times.count();
    format!("median {median:.2} ms, 99 % within {most:.2} ms, worst {worst:.2} ms of {count}")
}

fn memory(process: &Process) -> String {
    let kib = Holdings::of(process.id()).memory_kib;
    format!("{:.1} MB", kib as f64 / 1024.0)
}

/// Datagrams for the process's socket at `port` that the kernel had no room for.
fn dropped(process: &Process, port: u16) -> u64 {
    let table = fs::read_to_string(format!("/proc/{}/net/udp", process.id()));
    let local = format!(":{port:04X} ");
    let table = table.expect("it runs");
    let line = table.lines().find(|line| {
        let address = line.split_whitespace().nth(1);
        address.is_some_and(|address| format!("{address} ").ends_with(&local))
    });
    let drops = line.and_then(|line| line.split_whitespace().next_back());
    drops
        .and_then(|drops| drops.parse().ok())
        .expect("a socket")
}
