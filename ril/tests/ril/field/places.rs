//! A root that may only be read, as on a card that shall not wear out: all that is written lies on a RAM disk, and what
//! would be written elsewhere is named, with how to put it there.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use ril_tests::Sandbox;
use ril_tests::process::Signal;

use super::{check, files, own_mounts};
use crate::common::{end, end_all};

/// Makes every mount read-only but those that the kernel makes, `/dev/shm` and the terminals among them, and becomes
/// the program.
const READ_ONLY: &str = r#"
while read -r _ _ _ _ point options _; do
    case $point in /proc* | /sys* | /dev*) continue ;; esac
    kept=$(echo "$options" | tr , '\n' | grep -v '^r[wo]$' | tr '\n' ,)
    mount -o "remount,bind,$kept,ro" "$point" 2> /dev/null
done < /proc/self/mountinfo
exec "$@"
"#;

/// A folder on the RAM disk, gone at the end.
struct RamDisk(tempfile::TempDir);

impl RamDisk {
    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.0.path().join(name), text).unwrap();
        fs::set_permissions(self.0.path().join(name), fs::Permissions::from_mode(0o600)).unwrap();
        self.path(name)
    }
}

#[test]
fn on_a_read_only_root_a_robot_flies_records_and_keeps_all_on_a_ram_disk() {
    let Some([unshare, flags]) = own_mounts("a read-only root") else {
        return;
    };
    let ram = RamDisk(tempfile::tempdir_in("/dev/shm").unwrap());
    // The view's folder of this user: root of a user namespace has the number of the one outside.
    let runtime = format!("XDG_RUNTIME_DIR={}", ram.0.path().display());
    let words = [unshare, flags, "sh", "-c", READ_ONLY, "sh", "env", &runtime];
    let ril = env!("CARGO_BIN_EXE_ril");
    let limit = std::time::Duration::from_secs(300);
    let rig = Sandbox::new(words.into_iter().chain([ril]), "a read-only root", limit);
    let mut probe = rig.spawn({
        let mut command = std::process::Command::new(unshare);
        command
            .args([flags, "sh", "-c", READ_ONLY, "sh", "touch"])
            .arg(rig.path("written"));
        command
    });
    let probe = probe.wait_exit();
    if probe.code() == Some(0) {
        return ril_tests::languages::skip(
            "a read-only root",
            "mounts cannot be made read-only here",
        );
    }
    // What has no place says so, and where another is named.
    let refuses = |args: &str, code: i32, texts: &[&str]| {
        let finished = rig.run(args, code);
        for text in texts {
            finished.err_says(text);
        }
    };
    let key = ram.write("mavlink.key", "correct horse battery staple\n");
    let unplaced = ram.write(
        "unplaced.toml",
        &format!("port = 0\nstations = []\nkey = \"{key}\"\nstate = \"state\"\n"),
    );
    let tokens = ram.write(
        "tokens.toml",
        "token_key = \"view.key\"\n[tokens]\nphone = \"watch\"\n",
    );
    refuses("run sim --link dsp-1", 2, &["dsp-1", "with --link"]);
    refuses(
        &format!("run mavlink --config {unplaced}"),
        78,
        &["state/robot-1.timestamp", "by `state` of mavlink.toml"],
    );
    refuses(
        &format!("run view --config {tokens}"),
        8,
        &["view.key", "by `token_key` of view.toml"],
    );

    let port = ram.path("dsp-1");
    let sim = rig.start_ready(&format!("run sim --link {port} --seed 1 --speed 5"));
    let rules = ram.write("bridge.toml", ril_tests::sandbox::FOR_SLOW_MACHINES);
    let bridge = rig.start_ready(&format!("run bridge --port {port} --config {rules}"));
    let log = |folder: &str| {
        format!("[[log]]\ndirectory = \"{folder}\"\nmin_free_mib = 0\ngroups = [\"geographic\"]\n")
    };
    let elsewhere = ram.write("elsewhere.toml", &log("log"));
    let mut status = rig.start_ready(&format!("run status --config {elsewhere}"));
    status.wait_for_text("name another folder by `directory` of status.toml");
    rig.run("echo hero --count 5", 0);
    refuses("record", 2, &["log", "with --output"]);
    end(status, Signal::TERM);

    let placed = ram.write("status.toml", &log(&ram.path("log")));
    let status = rig.start_ready(&format!("run status --config {placed}"));
    let mut recorder = rig.start(&format!("record --min-free 0 --output {}", ram.path("log")));
    recorder.wait_for_text("recording file=");
    let placed = ram.write(
        "mavlink.toml",
        &format!(
            "port = 0\nstations = []\nkey = \"{key}\"\nstate = \"{}\"\n",
            ram.path("state")
        ),
    );
    let gateway = rig.start_ready(&format!("run mavlink --config {placed}"));
    for request in [
        "start",
        "takeoff 10m",
        "wait --for hovering --timeout 60s",
        "land",
        "stop",
    ] {
        rig.run(request, 0);
    }
    end_all([gateway, recorder, status, bridge, sim]);
    let kept = ram.0.path();
    assert!(kept.join("state/robot-1.timestamp").exists());
    assert_eq!(files(&kept.join("log"), "tsv").len(), 1);
    let record = files(&kept.join("log"), "mcap").remove(0);
    assert_eq!(check(&rig, &record)["complete"], true);
    refuses(
        &format!("log report {} --output flight.html", record.display()),
        2,
        &["flight.html cannot be written", "with --output"],
    );
    rig.run(
        &format!(
            "log report {} --output {}",
            record.display(),
            ram.path("flight.html")
        ),
        0,
    );
    // Nothing was written beside it.
    assert_eq!(fs::read_dir(rig.folder()).unwrap().count(), 0);
}
