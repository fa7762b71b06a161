//! The module as a process of its own; `battery-watch --help` lists its options.

fn main() -> std::process::ExitCode {
    module_kit::main::<battery_watch::BatteryWatch>()
}
