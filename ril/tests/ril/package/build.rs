//! `package/build` for another kind of computer than the one that builds, with a toolchain of scripts: what it asks of
//! cargo, and what it says when something is missing. That real packages fly is checked by `package/check`.

use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use ril_tests::watchdog::Watchdog;

use super::repository;

/// A copy of `package` between links to the rest of the repository, and a toolchain that notes its calls.
struct Workshop {
    folder: tempfile::TempDir,
    _watchdog: Watchdog,
}

/// Notes the call. What it builds for this machine speaks, what it builds for another one does not run.
const CARGO: &str = r#"
echo "cargo $* [${CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER:-}]" >> calls
case "$*" in
'deb --version' | tree*) exit 0 ;;
deb*) test -e package/out/target/aarch64-unknown-linux-gnu/release/ril || exit 9; echo > "$PWD/package/out/new/$3.deb"; exit 0 ;;
*--target*) to=target/aarch64-unknown-linux-gnu; program='of another machine' ;;
*) to=target; program='#!/bin/sh
case "$*" in *--to*) for it; do :; done; mkdir -p "$it"; echo page > "$it/ril.1" ;; *) echo "$*" ;; esac' ;;
esac
case "$*" in *'--profile release'*) to=$to/release ;; *) to=$to/debug ;; esac
mkdir -p $to
for file in ril ril-relay; do echo "$program" > $to/$file; chmod 755 $to/$file; done
echo library > $to/libhero_ril.so
"#;

const RUSTC: &str = r#"
case "$*" in
-vV) echo 'host: x86_64-unknown-linux-gnu' ;;
*target-libdir*) echo "$PWD/std" ;;
*sysroot*) echo "$PWD/std" ;;
esac
"#;

/// Makes a wheel in the folder that it is told.
const MATURIN: &str = r#"[ "$1" != --version ] || exit 0
while [ $# -gt 1 ]; do shift; done
echo > "$1/hero_ril.whl""#;

/// Links nothing, but says that it did.
const GCC: &str = "cat > /dev/null";

const STRIP: &str = r#"echo "strip $3" >> calls; cp "$3" "$2""#;

impl Workshop {
    fn new() -> Workshop {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        for entry in fs::read_dir(repository("")).unwrap() {
            let name = entry.unwrap().file_name();
            if !["bindings", "package", "target"]
                .iter()
                .any(|own| name == *own)
            {
                symlink(repository("").join(&name), at.join(&name)).unwrap();
            }
        }
        fs::create_dir_all(at.join("package")).unwrap();
        // The wheel's licences are written beside its sources.
        fs::create_dir_all(at.join("bindings/python")).unwrap();
        symlink(repository("bindings/c"), at.join("bindings/c")).unwrap();
        for name in ["build", "configuration", "docs", "licences"] {
            let from = repository("package").join(name);
            fs::copy(from, at.join("package").join(name)).unwrap();
        }
        fs::create_dir(at.join("bin")).unwrap();
        let workshop = Workshop {
            folder,
            _watchdog: Watchdog::start(),
        };
        workshop.has("cargo", CARGO);
        workshop.has("rustc", RUSTC);
        workshop.has("aarch64-linux-gnu-gcc", GCC);
        workshop.has("aarch64-linux-gnu-strip", STRIP);
        workshop.has("maturin", MATURIN);
        // Checksums are those of a real package: `a_package_has_the_checksums_of_its_files`.
        symlink("/bin/true", workshop.path().join("package/checksums")).unwrap();
        let notices = workshop.path().join("std/share/doc/rust");
        fs::create_dir_all(&notices).unwrap();
        fs::write(notices.join("COPYRIGHT-library.html"), "notices").unwrap();
        workshop
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Makes a tool of this script.
    fn has(&self, tool: &str, script: &str) {
        let path = self.path().join("bin").join(tool);
        fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn build(&self, options: &[&str]) -> Output {
        let mut path = OsString::from(self.path().join("bin"));
        path.push(":/usr/bin:/bin");
        Command::new("package/build")
            .args(options)
            .current_dir(self.path())
            .env("PATH", path)
            .env_remove("CARGO_TARGET_DIR")
            .stdin(Stdio::null())
            .output()
            .unwrap()
    }

    /// What was asked of cargo and strip, in its order.
    fn calls(&self) -> Vec<String> {
        let text = fs::read_to_string(self.path().join("calls")).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn packages_for_arm64_are_built_and_described_without_running_what_was_built() {
    let workshop = Workshop::new();
    let output = workshop.build(&["--arch", "arm64", "--relay", "--wheel"]);
    assert!(output.status.success(), "{}", complaint(&output));

    let calls = workshop.calls();
    let of_target = |call: &&String| call.contains("--target aarch64-unknown-linux-gnu");
    for wanted in [
        "cargo build -p ril --features tls --profile release",
        "cargo rustc -p hero-ril",
        "cargo build -p relay",
        "cargo tree --locked -p ril --features tls",
        "cargo deb -p ril ",
        "cargo deb -p relay ",
    ] {
        let found = calls.iter().filter(of_target);
        let count = found.filter(|call| call.starts_with(wanted)).count();
        assert_eq!(count, 1, "{wanted}: {calls:#?}");
    }
    let linked = calls.iter().filter(|call| call.starts_with("cargo build"));
    assert!(
        { linked }.all(|call| call.ends_with("[aarch64-linux-gnu-gcc]")),
        "{calls:#?}"
    );
    for stripped in ["ril", "libhero_ril.so", "ril-relay"] {
        let file = format!("/target/aarch64-unknown-linux-gnu/release/{stripped}");
        let is_it = |call: &String| call.starts_with("strip ") && call.ends_with(&file);
        assert!(calls.iter().any(is_it), "{stripped}: {calls:#?}");
    }
    let completion = fs::read_to_string(workshop.path().join("package/out/completions/ril"));
    assert_eq!(completion.unwrap(), "completions bash\n");
    // The library is where pkg-config and CMake look for it.
    for (file, place) in [
        ("hero_ril.pc", "libdir=${prefix}/lib/ril\n"),
        ("hero_ril-config.cmake", "/lib/ril/libhero_ril.so\"\n"),
        ("hero_ril-config-version.cmake", "set(PACKAGE_VERSION \"0."),
    ] {
        let text = fs::read_to_string(workshop.path().join("package/out").join(file)).unwrap();
        assert!(
            text.contains(place) && !text.contains('@'),
            "{file}: {text}"
        );
    }
    // What is kept lies in one folder.
    for kept in ["ril.deb", "relay.deb", "hero_ril.whl"] {
        let kept = workshop.path().join("target/artefacts").join(kept);
        assert!(kept.is_file(), "{}", kept.display());
    }
}

#[test]
fn whatever_is_missing_is_named_with_how_to_get_it_before_anything_is_built() {
    let workshop = Workshop::new();
    workshop.has("cargo", r#"echo "cargo $*" >> calls; exit 101"#);
    workshop.has("aarch64-linux-gnu-gcc", "exit 1");
    fs::remove_dir_all(workshop.path().join("std")).unwrap();
    let output = workshop.build(&["--arch", "arm64"]);

    let text = complaint(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for way in [
        ": cargo install cargo-deb\n",
        ": rustup target add aarch64-unknown-linux-gnu\n",
        ": sudo apt install gcc-aarch64-linux-gnu libc6-dev-arm64-cross\n",
    ] {
        assert!(text.contains(way), "{way}: {text}");
    }
    assert_eq!(workshop.calls(), ["cargo deb --version"]);
}

#[test]
fn only_what_there_is_can_be_asked_for() {
    let workshop = Workshop::new();
    for options in [&["--arch", "mips"][..], &["--arch"], &["--nonsense"]] {
        let output = workshop.build(options);
        let text = complaint(&output);
        assert_eq!(output.status.code(), Some(2), "{options:?}: {text}");
        assert!(text.contains("--arch amd64|arm64"), "{options:?}: {text}");
    }
    assert_eq!(workshop.calls(), [""; 0]);
}

#[test]
fn this_machine_s_packages_share_what_was_built_for_its_tests() {
    let workshop = Workshop::new();
    workshop.has("strip", STRIP);
    // It takes no compiler but this machine's.
    workshop.has("aarch64-linux-gnu-gcc", "exit 1");
    workshop.has("cargo", &CARGO.replace("/aarch64-unknown-linux-gnu", ""));
    for options in [&["--debug"][..], &["--debug", "--arch", "amd64"]] {
        let output = workshop.build(options);
        assert!(output.status.success(), "{}", complaint(&output));
    }
    let calls = workshop.calls();
    assert!(
        !calls.iter().any(|call| call.contains("--target")),
        "{calls:#?}"
    );
}

#[test]
fn the_installed_pages_have_their_pictures_and_no_link_that_leads_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let written = Command::new(repository("package/docs"))
        .arg(folder.path())
        .status();
    assert!(written.unwrap().success());
    let mut links = 0;
    for entry in fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        let Ok(page) = fs::read_to_string(&path) else {
            continue;
        };
        for link in page.split("](").skip(1) {
            let target = link.split([')', '#']).next().unwrap_or_default();
            if target.is_empty() || target.contains("://") || target.contains(char::is_whitespace) {
                continue;
            }
            links += 1;
            let found = folder.path().join(target).exists();
            assert!(found, "{}: {target}", path.display());
        }
    }
    assert!(links > 100, "{links}");
}

#[test]
fn a_package_has_the_checksums_of_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let tree = folder.path().join("tree");
    fs::create_dir_all(tree.join("DEBIAN")).unwrap();
    fs::create_dir_all(tree.join("etc")).unwrap();
    let control =
        "Package: ril\nVersion: 1\nArchitecture: all\nMaintainer: A <a@b.c>\nDescription: x\n";
    fs::write(tree.join("DEBIAN/control"), control).unwrap();
    fs::write(tree.join("etc/a file"), "one").unwrap();
    let run = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(folder.path());
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", complaint(&output));
    };
    run("dpkg-deb", &["-b", "tree", "ril.deb"]);
    run(
        repository("package/checksums").to_str().unwrap(),
        &["ril.deb"],
    );
    run("dpkg-deb", &["-R", "ril.deb", "unpacked"]);
    let unpacked = folder.path().join("unpacked");
    let sums = fs::read_to_string(unpacked.join("DEBIAN/md5sums")).unwrap();
    assert_eq!(sums.lines().count(), 1, "{sums}");
    run(
        "sh",
        &["-c", "cd unpacked && md5sum --check DEBIAN/md5sums"],
    );
}
