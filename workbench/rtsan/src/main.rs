//! Flies a simulated helicopter while LLVM's RealtimeSanitizer watches the loops of bridge and status: each call of libc that may wait, and
//! each allocation, is a finding with its stack, unless `suppressions.txt` says why it does not wait. `ril/tests/ril/waits` has the same
//! by system calls, without stacks, for every process.
//!
//! Without arguments the program starts itself as simulator, bridge and status. A loop is watched from SIGUSR1 to SIGUSR2, which the kernel
//! gives to a process' first thread: the one with the loop.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use ipc_types::payload::{BridgeJournal, HeroTelemetry, ModuleControl, MovementData, StatusJournal};
use ipc_types::code::ControlCommand;
use ipc_types::{Request, Subscriber};
use ril_tests::process::{Process, Signal, WAIT_LIMIT};
use ril_tests::sandbox::{FOR_SLOW_MACHINES, Sandbox};
use runtime::exit;

unsafe extern "C" {
    fn __rtsan_realtime_enter();
    fn __rtsan_realtime_exit();
}

/// Samples of robot telemetry in which the loops are watched.
const SAMPLES: u64 = 1_000;

#[derive(Parser)]
enum Cli {
    /// A process of the RIL.
    #[command(subcommand)]
    Run(Role),
}

#[derive(clap::Subcommand)]
enum Role {
    Sim(dsp_sim::cli::SimArgs),
    Bridge(bridge::cli::Args),
    Status(status::cli::Args),
}

fn main() -> ExitCode {
    if std::env::args_os().len() == 1 {
        return match fly() {
            0 => ExitCode::SUCCESS,
            _ => ExitCode::from(8),
        };
    }
    watch_between_signals();
    let Cli::Run(role) = Cli::parse();
    exit::main_with(|| match role {
        Role::Sim(args) => dsp_sim::cli::run(args),
        Role::Bridge(args) => bridge::cli::run(args),
        Role::Status(args) => status::cli::run(args),
    })
}

fn watch_between_signals() {
    // SAFETY: both only count in memory of the thread that is interrupted.
    let registered = unsafe {
        let enter = signal_hook::low_level::register(Signal::USR1.as_raw(), || __rtsan_realtime_enter());
        let exit = signal_hook::low_level::register(Signal::USR2.as_raw(), || __rtsan_realtime_exit());
        enter.and(exit)
    };
    registered.expect("a handler of a signal");
}

/// Flies, prints each finding, and says how many there are.
fn fly() -> u64 {
    let sandbox = Sandbox::of(std::env::current_exe().expect("this program"));
    sandbox.write("bridge.toml", FOR_SLOW_MACHINES);
    let sim = sandbox.sim(1, "--speed 4");
    let start = |args: &str| {
        let mut command = sandbox.command(args.split_whitespace());
        let list = concat!(env!("CARGO_MANIFEST_DIR"), "/suppressions.txt");
        let options = format!("halt_on_error=false:print_stats_on_exit=true:suppressions={list}");
        command.env("RTSAN_OPTIONS", options);
        let mut process = Process::spawn(&sandbox.domain, command);
        process.wait_for_text("ready");
        process
    };
    let (bridge, status) = (start("run bridge --port dsp-1"), start("run status"));
    sandbox.watch(1).until_ready();
    let ipc = sandbox.domain.join("consumer");
    order(&ipc, ModuleControl::new(1, ControlCommand::Start));
    order(&ipc, MovementData::take_off(2, 5.0));
    let mut telemetry: Subscriber<HeroTelemetry> = ipc.subscriber().expect("a subscriber");
    let mut journals = (
        ipc.subscriber::<BridgeJournal>().expect("a subscriber"),
        ipc.subscriber::<StatusJournal>().expect("a subscriber"),
    );
    let mut fly_on = |samples: u64| {
        let until = telemetry.losses().received + samples;
        while telemetry.losses().received < until {
            telemetry.wait(WAIT_LIMIT).expect("a wait");
            telemetry.drain(|_| {}).expect("samples");
            journals.0.drain(|_| {}).expect("pieces");
            journals.1.drain(|_| {}).expect("pieces");
        }
    };
    // Until all buffers have their size. Nobody comes or goes while the loops are watched.
    fly_on(SAMPLES / 4);
    let all = [("bridge", bridge), ("status", status)];
    all.iter().for_each(|(_, process)| process.signal(Signal::USR1));
    fly_on(SAMPLES);
    all.iter().for_each(|(_, process)| process.signal(Signal::USR2));
    fly_on(1);
    order(&ipc, MovementData::land(3));
    let mut findings = 0;
    for (name, process) in all.into_iter().rev() {
        let ended = process.end();
        let count = |what: &str| {
            let line = ended.stderr.iter().find_map(|line| line.trim().strip_prefix(what));
            let number = line.and_then(|line| line.trim_start_matches(':').trim().parse::<u64>().ok());
            number.unwrap_or_default()
        };
        let stacks = count("Unique error count");
        if stacks > 0 {
            ended.stderr.iter().for_each(|line| println!("{line}"));
        }
        println!(
            "{name}: {stacks} stacks that are not on the list, {} calls that are",
            count("Suppression count")
        );
        findings += stacks;
    }
    sim.end();
    findings
}

/// Gives an order, and waits until it is done.
fn order<R: Request>(ipc: &ipc_types::Ipc, order: R) {
    let mut client = ipc.client::<R>().expect("a client");
    let mut request = client.request(&order).expect("a bridge");
    let done = request.result_timeout(Duration::from_secs(60)).expect("a wait");
    println!("{done:?}");
}
