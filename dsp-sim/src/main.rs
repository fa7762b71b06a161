//! The simulator as a process of its own; `ril run sim` is the same.

fn main() -> std::process::ExitCode {
    runtime::exit::main_of(dsp_sim::cli::run)
}
