//! The simulator as a process of its own; `ril run sim` is the same.

use clap::Parser;

fn main() -> std::process::ExitCode {
    let args = dsp_sim::cli::SimArgs::parse();
    runtime::exit::main_with(|| dsp_sim::cli::run(args))
}
