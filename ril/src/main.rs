//! The binary `ril`: all of it is in the library, see [`ril::main`].

fn main() -> std::process::ExitCode {
    ril::main(std::env::args_os())
}
