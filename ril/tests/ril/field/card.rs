//! A card that is full, and is not any more: the robot flies on, each process goes on, and what is lost is counted.

use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;

use ipc_types::payload::DspTelemetry;
use ril_tests::Sandbox;
use ril_tests::process::Signal;
use ril_tests::sandbox::FOR_SLOW_MACHINES;

use super::{check, files, kinds, own_mounts};
use crate::common::{end, end_all};

/// The card: a file system of some MiB below the folder of the test, in which all processes run.
struct Card {
    folder: PathBuf,
}

impl Card {
    /// Takes all room that there is.
    fn fill(&self) {
        let mut options = File::options();
        let filler = self.folder.join("filler");
        let mut file = options.create(true).append(true).open(filler).unwrap();
        let refused = loop {
            if let Err(error) = file.write_all(&[1; 4096]) {
                break error;
            }
        };
        assert_eq!(refused.kind(), std::io::ErrorKind::StorageFull);
    }

    fn free(&self) {
        fs::remove_file(self.folder.join("filler")).unwrap();
    }
}

/// Runs `body` in a mount namespace with a card of this size at the returned folder: this test program again, with
/// nothing but the test `name`.
fn with_card(name: &str, size: &str, body: impl FnOnce(&Card)) {
    const INSIDE: &str = "RIL_TEST_CARD";
    if let Some(folder) = std::env::var_os(INSIDE) {
        return body(&Card {
            folder: folder.into(),
        });
    }
    let Some([unshare, flags]) = own_mounts(name) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let script = "mount -t tmpfs -o \"size=$1\" tmpfs \"$2\" && shift 2 && exec \"$@\"";
    let mut command = Command::new(unshare);
    command
        .args([flags, "sh", "-c", script, "sh", size])
        .arg(folder.path());
    command.arg(std::env::current_exe().unwrap());
    command.args([&format!("field::card::{name}"), "--exact", "--nocapture"]);
    let status = command.env(INSIDE, folder.path()).status().unwrap();
    assert!(status.success(), "{status:?}");
}

#[test]
fn a_full_card_costs_no_telemetry_and_no_order_and_all_goes_on_when_there_is_room() {
    let name = "a_full_card_costs_no_telemetry_and_no_order_and_all_goes_on_when_there_is_room";
    with_card(name, "24m", |card| {
        let rig = Sandbox::new(
            [env!("CARGO_BIN_EXE_ril")],
            name,
            std::time::Duration::from_secs(300),
        );
        let on_card = |name: &str| card.folder.join(name).display().to_string();
        let key = rig.write("mavlink.key", "correct horse battery staple\n");
        fs::set_permissions(key, fs::Permissions::from_mode(0o600)).unwrap();
        rig.write(
            "mavlink.toml",
            &format!(
                "port = 0\nstations = []\nkey = \"mavlink.key\"\nstate = \"{}\"\n",
                on_card("state")
            ),
        );
        rig.write(
            "status.toml",
            &format!("[[log]]\ndirectory = \"{}\"\nmin_free_mib = 0\ngroups = [\"geographic\", \"attitude\"]\n", on_card("log")),
        );
        let rules = card.folder.join("bridge.toml");
        fs::write(&rules, FOR_SLOW_MACHINES).unwrap();
        fs::write(rig.path("fenced.plan"), FENCED).unwrap();

        let sim = rig.sim(1, "--speed 5");
        let mut bridge = rig.start_ready(&format!(
            "run bridge --port dsp-1 --config {}",
            rules.display()
        ));
        bridge.wait_for_text("to=\"up\"");
        let mut status = rig.status(1);
        let mut recorder = rig.start(&format!("record --min-free 0 --output {}", on_card("log")));
        recorder.wait_for_text("recording file=");
        let gateway = rig.start_ready("run mavlink --config mavlink.toml");
        let mut telemetry = rig.subscribe::<DspTelemetry>(1);
        let first = telemetry.next_sample().sequence;
        rig.run("start", 0);
        // The record has something: one that has nothing is removed when the card is full.
        let length = |record: &PathBuf| fs::metadata(record).map_or(0, |file| file.len());
        let records = || files(&card.folder.join("log"), "mcap");
        while !records().iter().any(|record| length(record) > 100_000) {
            telemetry.next_sample();
        }

        card.fill();
        status.wait_for_text("the log cannot be written");
        recorder.wait_for_text("the recording cannot be written");
        // What these have given back with their files.
        card.fill();
        // The gateway that flies goes on; another one starts, and says what it cannot keep.
        gateway.end();
        let mut gateway = rig.start("run mavlink --config mavlink.toml");
        gateway.wait_for_text("the timestamp of signatures was not kept");
        gateway.wait_for_text("ready");
        // The fence is as before.
        rig.run(
            &format!("plan fly fenced.plan --fence --bridge {}", rules.display()),
            2,
        )
        .err_says("the fence is as before");
        assert_eq!(fs::read_to_string(&rules).unwrap(), FOR_SLOW_MACHINES);
        for request in ["takeoff 10m", "wait --for hovering --timeout 60s", "land"] {
            rig.run(request, 0);
        }

        card.free();
        status.wait_for_text("the log is written again");
        recorder.wait_for_text("the recording is written again");
        rig.run(
            &format!("plan fly fenced.plan --fence --bridge {}", rules.display()),
            0,
        );
        assert!(
            fs::read_to_string(&rules)
                .unwrap()
                .contains("plan: inclusion 1")
        );
        let last = telemetry.next_sample().sequence;
        assert!(last > first);
        end(gateway, Signal::TERM);
        let recorded = end(recorder, Signal::TERM);
        let logged = end(status, Signal::TERM);
        end_all([bridge, sim]);

        // Nothing was lost that the queues held: the card was full for less than 20 s on most machines, and else it is
        // counted.
        let summary = logged.stderr.iter().rfind(|line| line.contains("rows in"));
        assert!(summary.is_some(), "{logged:#?}");
        let records = records();
        assert!(records.len() >= 2, "{recorded:#?}");
        let checked: Vec<_> = records.iter().map(|record| check(&rig, record)).collect();
        assert!(
            checked.iter().all(|one| one["unexplained"] == 0),
            "{checked:#?}"
        );
        assert!(
            checked.iter().any(|one| kinds(one).contains(&"disk")),
            "{checked:#?}"
        );
    });
}

/// A take-off and a landing on the spot, in a fence.
const FENCED: &str = r#"{"fileType":"Plan","version":1,"mission":{"version":2,"plannedHomePosition":[37.411,-6.001,10],"items":[
{"type":"SimpleItem","command":22,"frame":3,"autoContinue":true,"params":[0,0,0,null,0,0,5]},
{"type":"SimpleItem","command":21,"frame":3,"autoContinue":true,"params":[0,0,0,null,0,0,0]}]},
"geoFence":{"version":2,"circles":[],"polygons":[
{"inclusion":true,"version":1,"polygon":[[37.41,-6.003],[37.41,-5.999],[37.412,-5.999],[37.412,-6.003]]}]}}"#;
