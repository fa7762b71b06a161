//! The status process by itself; see the library.

fn main() -> std::process::ExitCode {
    runtime::exit::main_of(status::cli::run)
}
