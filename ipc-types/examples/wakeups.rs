//! Looks for lost wake-ups: a publisher, and a consumer for each way to sleep, all in processes of their own that are
//! stopped and let go on at random.
//!
//! ```text
//! cargo run --release -p ipc-types --example wakeups -- [SECONDS [RATE_HZ [SEED]]]
//! ```
//!
//! A lost wake-up shows as a sleep that only its bound ended although there were samples. iceoryx2's own `WaitSet` is
//! beside ours with a bound of a second: what it loses, it loses until then.

use std::io::{BufRead, BufReader};
use std::os::fd::AsFd;
use std::process::{Child, Command, ExitCode, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use ipc_types::payload::DspTelemetry;
use ipc_types::{Descriptor, Domain, Ipc, RobotId, ServiceId, Subscriber, Waiter};
use rustix::process::{Pid, Signal, kill_process};

/// The ways to sleep, and how often data was there that had woken no thread.
const WAYS: [&str; 3] = ["doorbell", "descriptors", "waitset"];

/// The variable that makes this program one of its own children.
const ROLE: &str = "WAKEUPS_ROLE";

/// Marks the last sample.
const LAST: u32 = u32::MAX;

/// Longest sleep of a consumer.
const PATIENCE: Duration = Duration::from_secs(1);

type Failure = Box<dyn std::error::Error>;

/// What the command line says.
#[derive(Clone, Copy)]
struct Plan {
    seconds: f64,
    rate_hz: f64,
    seed: u64,
}

/// What a consumer has seen.
#[derive(Default)]
struct Seen {
    samples: u64,
    /// Wake-ups that were lost.
    missed: u64,
    is_over: bool,
}

impl Seen {
    fn take(&mut self, sample: &DspTelemetry) {
        self.samples += 1;
        self.is_over |= sample.sonar_adc == LAST;
    }
}

fn main() -> ExitCode {
    let result = match (std::env::var(ROLE), plan()) {
        (Ok(role), Some(plan)) => play(&role, plan),
        (Err(_), Some(plan)) => conduct(plan),
        (_, None) => Err("usage: wakeups [SECONDS [RATE_HZ [SEED]]]".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn plan() -> Option<Plan> {
    let mut given = std::env::args().skip(1);
    let mut next = |default: f64| match given.next() {
        Some(text) => text.parse::<f64>().ok().filter(|number| *number > 0.0),
        None => Some(default),
    };
    Some(Plan {
        seconds: next(10.0)?,
        rate_hz: next(5000.0)?,
        seed: next(1.0)? as u64,
    })
}

/// Starts all threads, disturbs them, and prints what became of it.
fn conduct(plan: Plan) -> Result<(), Failure> {
    let domain = Domain::isolated();
    let mut consumers = Vec::new();
    for way in WAYS {
        consumers.push(start(&domain, way)?);
    }
    let mut publisher = start(&domain, "publisher")?;
    let mut random = plan.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let end = Instant::now() + Duration::from_secs_f64(plan.seconds);
    let mut stops = 0_u64;
    while Instant::now() < end {
        // xorshift: all that is asked of it is that it can be repeated.
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        let victims = consumers.iter().chain([&publisher]);
        let victim = victims
            .map(Pid::from_child)
            .nth(random as usize % (WAYS.len() + 1));
        let victim = victim.ok_or("no thread to stop")?;
        kill_process(victim, Signal::STOP)?;
        // Shorter than the subscribers' buffers last, so that nothing else is lost.
        thread::sleep(Duration::from_micros(random >> 32 & 0x3fff));
        kill_process(victim, Signal::CONT)?;
        stops += 1;
    }
    println!("{stops} stops in {} s, seed {}", plan.seconds, plan.seed);
    println!("| way to sleep | samples | lost wake-ups |\n|---|--:|--:|");
    let mut survived = true;
    // Its end of input tells the publisher to publish the last sample, and then to stay until all have it.
    drop(publisher.stdin.take());
    for (way, consumer) in WAYS.iter().zip(&mut consumers) {
        let stdout = consumer.stdout.take().ok_or("no output")?;
        let line = BufReader::new(stdout).lines().next().ok_or("no result")??;
        let (samples, missed) = line.split_once(' ').ok_or("no result")?;
        println!("| {way} | {samples} | {missed} |");
        survived &= *way != "doorbell" || missed == "0";
    }
    for child in consumers.iter_mut().chain([&mut publisher]) {
        let _ = child.kill();
        child.wait()?;
    }
    domain.remove_if_dead()?;
    match survived {
        true => Ok(()),
        false => Err("the doorbell lost a wake-up".into()),
    }
}

fn start(domain: &Domain, role: &str) -> Result<Child, Failure> {
    Ok(Command::new(std::env::current_exe()?)
        .args(std::env::args().skip(1))
        .envs(domain.environment())
        .env(ROLE, role)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?)
}

fn play(role: &str, plan: Plan) -> Result<(), Failure> {
    let domain = Domain::from_environment()?;
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, role)?;
    let mut seen = Seen::default();
    match role {
        "publisher" => return publish(&ipc, plan),
        "doorbell" => sleep_on_doorbell(ipc.subscriber()?, &mut seen)?,
        "descriptors" => sleep_on_descriptors(ipc.subscriber()?, &mut seen)?,
        _ => sleep_in_waitset(&domain, ipc.subscriber()?, &mut seen)?,
    }
    println!("{} {}", seen.samples, seen.missed);
    Ok(())
}

fn publish(ipc: &Ipc, plan: Plan) -> Result<(), Failure> {
    let mut publisher = ipc.publisher::<DspTelemetry>()?;
    let (ending, end) = std::sync::mpsc::channel::<()>();
    thread::spawn(move || {
        std::io::stdin().lines().for_each(drop);
        drop(ending);
    });
    let period = Duration::from_secs_f64(1.0 / plan.rate_hz);
    // The pause is the pace, and ends with the input.
    while end.recv_timeout(period) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
        publisher.publish(|_| {})?;
    }
    loop {
        publisher.publish(|sample| sample.sonar_adc = LAST)?;
        thread::sleep(PATIENCE);
    }
}

fn sleep_on_doorbell(
    mut subscriber: Subscriber<DspTelemetry>,
    seen: &mut Seen,
) -> Result<(), Failure> {
    while !seen.is_over {
        subscriber.wait(PATIENCE)?;
        subscriber.drain(|sample| seen.take(sample))?;
    }
    seen.missed = subscriber.missed_wakeups();
    Ok(())
}

fn sleep_on_descriptors(
    mut subscriber: Subscriber<DspTelemetry>,
    seen: &mut Seen,
) -> Result<(), Failure> {
    let waiter = Waiter::new();
    let (other, _writer) = std::io::pipe()?;
    while !seen.is_over {
        let mut other = Descriptor::new(other.as_fd());
        waiter.wait(
            &mut [((), &mut subscriber), ((), &mut other)],
            Some(PATIENCE),
        )?;
        subscriber.drain(|sample| seen.take(sample))?;
    }
    seen.missed = waiter.missed();
    Ok(())
}

/// As iceoryx2's documentation has it.
fn sleep_in_waitset(
    domain: &Domain,
    mut subscriber: Subscriber<DspTelemetry>,
    seen: &mut Seen,
) -> Result<(), Failure> {
    // Enter the publisher's generation, as docs/ipc.md says.
    subscriber.wait(PATIENCE)?;
    let service = domain.root().join("1/dsp_telemetry");
    let current = std::fs::read_to_string(service.join("current"))?;
    let mut words = current.split_whitespace();
    let (name, prefix) = words.next().zip(words.next()).ok_or("no generation")?;
    let root = service.join(name);
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix.as_bytes())?;
    let root = root.to_str().ok_or("a root of text")?;
    config.global.set_root_path(&Path::new(root.as_bytes())?);
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()?;
    let name = ServiceId::DspTelemetry.name(RobotId::DEFAULT);
    let events = node
        .service_builder(&name.as_str().try_into()?)
        .event()
        .open()?;
    let listener = events.listener_builder().create()?;
    let waitset = WaitSetBuilder::new()
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()?;
    let _guard = waitset.attach_notification(&listener)?;
    while !seen.is_over {
        let mut is_woken = false;
        let asleep = Instant::now();
        waitset.wait_and_process_once_with_timeout(
            |_| {
                is_woken = true;
                CallbackProgression::Continue
            },
            PATIENCE,
        )?;
        if is_woken {
            listener.try_wait(|_| {})?;
        }
        let found = subscriber.drain(|sample| seen.take(sample))?;
        // A stop and its end interrupt it as a signal does; that is no loss.
        let is_over = asleep.elapsed() >= PATIENCE;
        seen.missed += u64::from(is_over && !is_woken && found > 0);
    }
    Ok(())
}
