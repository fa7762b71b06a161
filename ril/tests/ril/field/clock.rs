//! A computer without a battery for its clock: it begins in 1970 at each boot, and gets the time in flight, or never.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use ril_tests::languages::skip;
use ril_tests::preload::SetClock;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};
use runtime::wall_clock::WallClock;

use super::{check, files, kinds};
use crate::common::{end, end_all, json};
use crate::doctor::troubles;

/// Moments after a boot, and when somebody set the clock at last, s since 1970.
const BOOT: u64 = 30;
const SET: u64 = 4_000_000_000;

const STATUS: &str = "[[log]]\ndirectory = \"log\"\nfile_name = \"sortable\"\nutc = true\nmin_free_mib = 0\n\
                      groups = [\"geographic\"]\n";

/// A clock that the test sets, and a robot's computer that has it; `None` if this machine cannot play that.
fn computer(name: &str) -> Option<(SetClock, Sandbox)> {
    match SetClock::new() {
        Ok(clock) => {
            clock.set(BOOT);
            let rig = clock.sandbox(Path::new(env!("CARGO_BIN_EXE_ril")), name);
            Some((clock, rig))
        }
        Err(reason) => {
            skip(name, &reason);
            None
        }
    }
}

fn record(rig: &Sandbox, options: &str) -> Process {
    let mut recorder = rig.start(&format!("record --min-free 0 {options}"));
    recorder.wait_for_text("recording file=");
    recorder
}

/// What is in the folder of logs and records, by name.
fn contents(rig: &Sandbox) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(rig.path("log")).unwrap();
    let entries = entries.map(|entry| entry.unwrap());
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

#[test]
fn two_boots_of_1970_keep_every_file_and_a_clock_that_is_set_in_flight_costs_nothing() {
    let Some((clock, rig)) = computer("two boots of 1970") else {
        return;
    };
    rig.write("status.toml", STATUS);
    let sim = rig.sim(1, "--speed 4");
    for _ in 0..2 {
        // As after a boot: the same second again.
        clock.set(BOOT);
        let before = match rig.path("log").exists() {
            true => contents(&rig),
            false => BTreeMap::new(),
        };
        let bridge = rig.bridge(1);
        let status = rig.status(1);
        let recorder = record(&rig, "");
        rig.run("echo hero --count 20", 0);
        end_all([recorder, status, bridge]);
        let after = contents(&rig);
        assert!(
            before
                .iter()
                .all(|(name, bytes)| after.get(name) == Some(bytes))
        );
        // A log and a record, and with the first boot a layout for viewers.
        assert_eq!(
            after.len(),
            before.len() + if before.is_empty() { 3 } else { 2 }
        );
        assert!(
            after
                .keys()
                .filter(|name| !name.ends_with("json"))
                .all(|name| name.starts_with("hero1_1970-01-01T00-0")),
            "{:?}",
            after.keys()
        );
    }

    clock.set(BOOT);
    let bridge = rig.bridge(1);
    let status = rig.status(1);
    let mut recorder = record(&rig, "--split 3s");
    rig.watch(1).until_ready();
    assert!(troubles(&rig, "--port dsp-1", 8).contains(&"clock".to_owned()));
    let text = rig.run("doctor --port dsp-1", 8);
    text.out_says("the clock was never set: 1970-01-01T00:0");
    text.out_says("sudo date --set");
    rig.run("start", 0);
    rig.run("takeoff 10m", 0);
    let (latitude, longitude) = (37.4111, -6.001);
    let mut path = rig.start(&format!("goto {latitude},{longitude},+3m"));
    path.wait_for_text("goto:");
    clock.set(SET);
    path.exits(0);
    rig.run("wait --for hovering --timeout 60s", 0);
    rig.run("land", 0);
    assert!(!troubles(&rig, "--port dsp-1", 0).contains(&"clock".to_owned()));
    // The next file has the right time; the one before says that the clock was set.
    recorder.wait_for_text("hero1_2096-10-02T");
    end(recorder, Signal::TERM);
    end(status, Signal::TERM);
    end(bridge, Signal::TERM);
    end(sim, Signal::TERM);

    let records = files(&rig.path("log"), "mcap");
    let flown = records.iter().map(|record| check(&rig, record));
    let flown: Vec<_> = flown.collect();
    for checked in &flown {
        assert_eq!(
            (&checked["complete"], &checked["unexplained"]),
            (&true.into(), &0.into()),
            "{checked}"
        );
    }
    let noted = flown
        .iter()
        .filter(|checked| kinds(checked).contains(&"clock"));
    assert_eq!(noted.count(), 1);
    // The log's rows are in the order of time, of its own clock.
    let log = files(&rig.path("log"), "tsv")
        .into_iter()
        .map(|log| fs::read_to_string(log).unwrap());
    let log = log.max_by_key(String::len).unwrap();
    let times: Vec<_> = log
        .lines()
        .skip(1)
        .map(|row| row.split('\t').nth(3).unwrap())
        .collect();
    assert!(
        times.is_sorted() && times.iter().all(|time| time.starts_with("1970-01-01T00:0")),
        "{:?}",
        times.last()
    );
    let listed = rig.run("log list --dir log --json", 0);
    let listed = listed
        .stdout
        .iter()
        .map(|line| json(line)["file"].as_str().unwrap().to_owned());
    assert_eq!(listed.count(), records.len() + 3);
    let page = rig.path("page.html");
    rig.run(
        &format!("log report {} --output page.html", records[2].display()),
        0,
    );
    assert!(page.exists());
}

#[test]
fn timestamps_of_signatures_rise_over_a_boot_without_a_clock() {
    let Some((clock, rig)) = computer("timestamps of a boot without a clock") else {
        return;
    };
    let key = rig.write("mavlink.key", "correct horse battery staple\n");
    let private = std::os::unix::fs::PermissionsExt::from_mode(0o600);
    fs::set_permissions(key, private).unwrap();
    rig.write(
        "mavlink.toml",
        "port = 0\nstations = []\nkey = \"mavlink.key\"\nstate = \"state\"\n",
    );
    let mut kept = Vec::new();
    // Never set at first, then set, then without a clock again, twice.
    for unix_s in [BOOT, WallClock::look().unix_s, BOOT, BOOT] {
        clock.set(unix_s);
        rig.start_ready("run mavlink --config mavlink.toml").end();
        let text = fs::read_to_string(rig.path("state/robot-1.timestamp")).unwrap();
        kept.push(text.trim_end().parse::<u64>().unwrap());
    }
    assert!(kept.is_sorted_by(|one, next| one < next), "{kept:?}");
}
