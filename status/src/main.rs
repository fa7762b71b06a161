//! The status process by itself; see the library.

use clap::Parser;
use runtime::exit;

fn main() -> std::process::ExitCode {
    let args = status::cli::Args::parse();
    exit::main_with(|| status::cli::run(args))
}
