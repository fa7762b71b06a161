//! Links RealtimeSanitizer's run-time library, which the toolchain has beside its standard library.

use std::path::Path;
use std::process::Command;

fn main() {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let target = std::env::var("TARGET").unwrap_or_default();
    let libraries = Command::new(rustc).args(["--print", "target-libdir", "--target", &target]).output().expect("rustc");
    let folder = String::from_utf8(libraries.stdout).expect("a path");
    let files = std::fs::read_dir(Path::new(folder.trim())).expect("the toolchain's libraries");
    let library = files.flatten().map(|file| file.path()).find(|path| path.to_string_lossy().ends_with("_rt.rtsan.a"));
    let library = library.expect("a toolchain with RealtimeSanitizer: Linux on x86_64 or aarch64, Rust 1.88 or newer");
    for argument in ["-Wl,--whole-archive", &library.to_string_lossy(), "-Wl,--no-whole-archive", "-Wl,--export-dynamic", "-lm", "-lrt", "-ldl", "-lpthread"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    println!("cargo::rerun-if-changed=build.rs");
}
