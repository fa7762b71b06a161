//! Measures one hop through shared memory: from a publisher to consumers in Rust, C and Python, side by side in one
//! run.
//!
//! ```text
//! cargo run --release -p hero-ril --example hop -- [PYTHON]
//! ```
//!
//! PYTHON is an interpreter that has the package `hero_ril`; without it Python is left out, and C without a compiler
//! `cc`. A hop begins before the publisher fills in the sample and ends when the consumer has the sample as a value of
//! its own.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use ipc_types::payload::HeroTelemetry;
use ipc_types::{Domain, Ipc, MonotonicNs, RobotId};

/// Samples of one round, and how many of them come before those that count.
const SAMPLES: usize = 3_000;
const WARM_UP: usize = 300;

/// Each language has so many rounds, in turn, so that a busy moment of the machine does not hit one alone.
const ROUNDS: usize = 5;

const PERIOD: Duration = Duration::from_millis(1);

/// The variable that makes this program its own consumer.
const ROLE: &str = "HOP_ROLE";

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    if std::env::var_os(ROLE).is_some() {
        return consume();
    }
    let domain = Domain::isolated();
    let mut results: Vec<(&str, Vec<f64>)> = Vec::new();
    for _ in 0..ROUNDS {
        for (language, command) in consumers()? {
            let hop_us = measure(&domain, command)?;
            match results.iter_mut().find(|(name, _)| *name == language) {
                Some((_, hops)) => hops.push(hop_us),
                None => results.push((language, vec![hop_us])),
            }
        }
    }
    let of_rust = median(&mut results[0].1);
    for (language, hops) in &mut results {
        let hop_us = median(hops);
        println!(
            "{language:8} {hop_us:6.2} us median, {:.2} x the hop in Rust",
            hop_us / of_rust
        );
    }
    Ok(())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A command for each language that this machine has; the first is Rust.
fn consumers() -> Result<Vec<(&'static str, Command)>, Failure> {
    let this = std::env::current_exe()?;
    let mut rust = Command::new(&this);
    rust.env(ROLE, "consumer");
    let mut consumers = vec![("Rust", rust)];
    // target/release/examples/hop
    let built = this
        .parent()
        .and_then(Path::parent)
        .ok_or("no target folder")?;
    build_library(built)?;
    if let Some(program) = compile(built) {
        consumers.push(("C", Command::new(program)));
    }
    if let Some(python) = std::env::args_os().nth(1) {
        let mut command = Command::new(python);
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../python/examples/hop.py"));
        consumers.push(("Python", command));
    }
    for (_, command) in &mut consumers {
        command.arg(SAMPLES.to_string()).arg(WARM_UP.to_string());
    }
    Ok(consumers)
}

/// Builds the library as `install.sh` does: that of `cargo run` is not optimized across crates.
fn build_library(built: &Path) -> Result<(), Failure> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["rustc", "--quiet", "--release", "-p", "hero-ril", "--lib"])
        .args(["--crate-type", "cdylib", "--target-dir"])
        .arg(built.parent().ok_or("no target folder")?)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()?;
    match status.success() {
        true => Ok(()),
        false => Err("the library was not built".into()),
    }
}

/// Compiles the consumer in C once, against the library beside this program.
fn compile(built: &Path) -> Option<std::path::PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = built.join("examples/hop-c");
    let status = Command::new("cc")
        .args(["-std=c11", "-O2", "-o"])
        .arg(&program)
        .arg("-I")
        .arg(here.join("include"))
        .arg("-I")
        .arg(here.join("../../ipc-types/layouts"))
        .arg(here.join("examples/hop.c"))
        .arg("-L")
        .arg(built)
        .arg("-lhero_ril")
        .arg(format!("-Wl,-rpath,{}", built.display()))
        .status();
    status.ok()?.success().then_some(program)
}

/// Publishes for one consumer until it has ended, and returns the median that it has printed, us.
fn measure(domain: &Domain, mut command: Command) -> Result<f64, Failure> {
    let ipc = Ipc::join(domain, RobotId::DEFAULT, "hop")?;
    let mut publisher = ipc.publisher::<HeroTelemetry>()?;
    let mut consumer = command
        .envs(domain.environment())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut next = MonotonicNs::now();
    while consumer.try_wait()?.is_none() {
        publisher.service();
        publisher.publish(|sample| sample.received_ns = MonotonicNs::now().0)?;
        next = next + PERIOD;
        thread::sleep(next.since(MonotonicNs::now()));
    }
    let output = consumer.stdout.take().ok_or("no output")?;
    let line = BufReader::new(output).lines().next().ok_or("no result")??;
    Ok(line.parse()?)
}

/// The consumer in Rust.
fn consume() -> Result<(), Failure> {
    let ipc = Ipc::join(&Domain::from_environment()?, RobotId::DEFAULT, "consumer")?;
    let mut telemetry = ipc.subscriber::<HeroTelemetry>()?;
    let mut hops = Vec::with_capacity(SAMPLES + 256);
    while hops.len() < SAMPLES {
        telemetry.wait(Duration::from_secs(1))?;
        telemetry.drain(|sample| {
            let sample = std::hint::black_box(*sample);
            hops.push((MonotonicNs::now().0 - sample.received_ns) as f64 / 1000.0);
        })?;
    }
    println!("{}", median(&mut hops[WARM_UP..SAMPLES]));
    Ok(())
}
