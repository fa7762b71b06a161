//! Links the run-time library of RealtimeSanitizer that comes with the toolchain, whole: it stands in the place of the
//! C library's functions.

use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let rustc = env::var_os("RUSTC").expect("cargo names the compiler");
    let output = Command::new(rustc)
        .args(["--print", "target-libdir"])
        .output()
        .expect("the compiler runs");
    let folder = PathBuf::from(String::from_utf8_lossy(&output.stdout).trim());
    let files = fs::read_dir(&folder).expect("the folder of the toolchain's libraries");
    let library = files
        .flatten()
        .map(|file| file.path())
        .find(|path| path.to_string_lossy().ends_with("_rt.rtsan.a"))
        .unwrap_or_else(|| {
            panic!(
                "no run-time library of RealtimeSanitizer in {}",
                folder.display()
            )
        });
    for arg in [
        "-Wl,--whole-archive",
        &library.to_string_lossy(),
        "-Wl,--no-whole-archive",
    ] {
        println!("cargo::rustc-link-arg-bins={arg}");
    }
}
