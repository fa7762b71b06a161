//! `ril log`.

use ril_tests::Sandbox;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use ril_tests::process::Signal;
use rustix::fs::{CWD, Mode, mkfifoat};

use super::station::station;
use crate::common::{json, sandbox, says};
use crate::watch::screen::on_terminal;

const HEADER: &str = "flying\tsequence\treceived_ns\tutc\taltitude_m\n";

fn row(sequence: u64) -> String {
    let (second, ns) = (sequence % 60, sequence * 1_000_000_000);
    format!("0\t{sequence}\t{ns}\t2026-11-22T10:00:{second:02}.000000Z\t{sequence}.5\n")
}

/// Writes a log into the folder `log`.
fn write(rig: &Sandbox, name: &str, text: &[u8]) -> PathBuf {
    let folder = rig.folder().join("log");
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path
}

fn append(path: &Path, text: &str) {
    let mut file: File = OpenOptions::new().append(true).open(path).unwrap();
    file.write_all(text.as_bytes()).unwrap();
}

#[test]
fn a_real_flight_is_listed_summed_up_and_converted() {
    let rig = sandbox();
    let station = station(&rig, 10);
    rig.run("start", 0);
    rig.run("takeoff --altitude 10", 0);
    rig.run("goto 37.4111,-6.001,20 --timeout 600s", 0);
    rig.run("land", 0);
    station.end();
    let list = on_terminal(&rig, "log list", 0);
    assert_eq!(list.len(), 2, "{list:#?}");
    assert!(list[0].starts_with("START (UTC)"), "{list:#?}");
    let listed = json(&rig.run("log list --json", 0).stdout[0]);
    assert_eq!(
        (&listed["schema"], &listed["robot"]),
        (&"ril.LogFile.v1".into(), &1.into())
    );
    assert!(
        list[1].ends_with(listed["file"].as_str().unwrap()),
        "{list:#?}"
    );
    assert!(listed["duration_s"].as_f64().unwrap() > 1.0, "{listed:#}");
    assert!(rig.run("log list --robot 2", 0).stdout.is_empty());

    let summary = json(&rig.run("log summary --json", 0).stdout[0]);
    assert_eq!(summary["schema"], "ril.LogSummary.v1");
    assert_eq!(
        (&summary["take_offs"], &summary["damaged_lines"]),
        (&1.into(), &0.into())
    );
    assert_eq!(summary["utc_source"], "column");
    // A machine that stalls may cost status samples; they are counted.
    assert!(summary["lost_samples"].is_u64(), "{summary:#}");
    let between = |name: &str, least: f64, most: f64| {
        let value = summary[name].as_f64().unwrap();
        assert!((least..=most).contains(&value), "{name}: {summary:#}");
    };
    // 0.0001° to the north are 11 m.
    between("distance_m", 8.0, 20.0);
    between("max_height_m", 9.0, 12.0);
    assert!(summary["battery_v"]["first"].as_f64() > summary["battery_v"]["min"].as_f64());
    let text = on_terminal(&rig, "log summary", 0);
    assert!(says(&text, "m above take-off"), "{text:#?}");

    let csv = rig.run("log csv", 0).stdout;
    assert_eq!(csv.len() as u64, 1 + summary["rows"].as_u64().unwrap());
    assert!(csv[0].starts_with("utc,flying,sequence,received_ns,dsp_time_ms,latitude_deg,"));
    assert_eq!(csv[1].split(',').next(), summary["start_utc"].as_str());
    let csv = rig
        .run("log csv --field altitude_m --field battery_mv", 0)
        .stdout;
    assert_eq!(csv[0], "utc,altitude_m,battery_mv");
    let tail = on_terminal(&rig, "log tail -n 3", 0);
    assert_eq!(tail.len(), 3);
    assert!(tail[2].contains("  flying=0  altitude_m="), "{tail:#?}");
    let tail = rig.run("log tail -n 2 --json", 0).stdout;
    assert_eq!(json(&tail[1])["schema"], "ril.LogRow.v1");

    // The flight as a page: named after the log, in the working directory.
    let said = on_terminal(&rig, "log report", 0);
    let name = Path::new(listed["file"].as_str().unwrap())
        .file_stem()
        .unwrap();
    let page = rig.folder().join(name).with_extension("html");
    assert!(
        said[0].contains(page.file_name().unwrap().to_str().unwrap()),
        "{said:#?}"
    );
    let html = fs::read_to_string(&page).unwrap();
    for expected in [
        "<!doctype html>",
        "Flight of robot 1",
        "took off",
        "landed",
        "in the air",
        "\"track\":[[",
    ] {
        assert!(html.contains(expected), "{expected}");
    }
}

#[test]
fn without_a_file_the_last_flight_is_meant_and_not_what_came_after_the_landing() {
    let rig = sandbox();
    let flown: String = (1..=3)
        .map(|number| row(number).replacen('0', "1", 1))
        .collect();
    write(
        &rig,
        "hero(1)_01_11_26-10_00_00.tsv",
        format!("{HEADER}{flown}").as_bytes(),
    );
    write(
        &rig,
        "hero(1)_01_11_26-11_00_00.tsv",
        format!("{HEADER}{}", row(9)).as_bytes(),
    );
    let summary = json(&rig.run("log summary --json", 0).stdout[0]);
    assert_eq!(
        (&summary["rows"], &summary["take_offs"]),
        (&3.into(), &1.into())
    );
    let report = json(&rig.run("log report --json", 0).stdout[0]);
    assert_eq!(report["samples"], 3);
    // What goes on is the newest.
    let tail = json(&rig.run("log tail --json", 0).stdout[0]);
    assert_eq!(tail["sequence"], 9);
}

#[test]
fn a_report_says_what_was_written_and_never_takes_the_place_of_the_log() {
    let rig = sandbox();
    let text: String = (1..=20).map(row).collect();
    let log = write(
        &rig,
        "hero(1)_22_11_26-10_00_00.tsv",
        (HEADER.to_owned() + &text).as_bytes(),
    );
    rig.write(
        "plan.waypoints",
        "QGC WPL 110\n1\t0\t3\t16\t0\t0\t0\t0\t37.4113\t-6.001\t18\t1\n",
    );
    let finished = rig.run(
        "log report --json --output page.html --plan plan.waypoints",
        0,
    );
    let object = json(&finished.stdout[0]);
    assert_eq!(
        (&object["schema"], &object["samples"], &object["alarms"]),
        (&"ril.LogReport.v1".into(), &20.into(), &0.into())
    );
    assert_eq!(object["output"], "page.html");
    // Again: the page is replaced, and nothing else is left.
    rig.run("log report --output page.html", 0);
    let before = fs::read(&log).unwrap();
    let own = format!(
        "log report --output {}",
        log.strip_prefix(rig.folder()).unwrap().display()
    );
    rig.run(&own, 2).err_says("that is the log itself");
    assert_eq!(fs::read(&log).unwrap(), before);
    for (command, expected) in [
        ("log report --output absent/page.html", "cannot be written"),
        ("log report --output log", "it is no regular file"),
        ("log report --plan absent.plan", "absent.plan"),
    ] {
        rig.run(command, 2).err_says(expected);
    }
    let names = fs::read_dir(rig.folder())
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    assert!(
        !names
            .into_iter()
            .any(|name| name.to_string_lossy().starts_with(".ril-report"))
    );
}

#[test]
fn a_log_is_followed_into_the_files_that_come_after_it() {
    let rig = sandbox();
    let text: String = (1..=20).map(row).collect();
    let first = write(
        &rig,
        "hero(1)_22_11_26-10_00_00_imu.tsv",
        (HEADER.to_owned() + &text).as_bytes(),
    );
    let mut tail = rig.start("log tail -f -n 2 --field sequence");
    let line = tail.wait_for_text("sequence=");
    assert_eq!(line.text, "2026-11-22T10:00:19.000000Z  sequence=19");
    tail.wait_for_text("sequence=20");
    append(&first, &row(21));
    tail.wait_for_text("sequence=21");
    // A row that comes in two pieces is printed once, and whole.
    let piece = row(22);
    append(&first, &piece[..7]);
    append(&first, &piece[7..]);
    tail.wait_for_text("sequence=22");
    // Another log, another robot, and the next file of this one.
    write(
        &rig,
        "hero(1)_22_11_26-10_00_30.tsv",
        (HEADER.to_owned() + &row(100)).as_bytes(),
    );
    write(
        &rig,
        "hero(2)_22_11_26-10_00_30_imu.tsv",
        (HEADER.to_owned() + &row(200)).as_bytes(),
    );
    let second = write(&rig, "hero(1)_22_11_26-10_00_30_imu.tsv", b"");
    append(&second, HEADER);
    append(&second, &row(23));
    tail.wait_for_text("sequence=23");
    append(&second, &row(24));
    tail.wait_for_text("sequence=24");
    tail.signal(Signal::INT);
    let finished = tail.exits(0);
    assert_eq!(finished.stdout.len(), 6, "{finished:#?}");
}

#[test]
fn damaged_and_cut_files_give_what_can_be_read_and_say_so() {
    let rig = sandbox();
    let text = HEADER.to_owned() + &row(1) + "nonsense\n" + &row(2) + "0\t3\t3000";
    let name = "hero(1)_22_11_26-10_00_00.tsv";
    write(&rig, name, text.as_bytes());
    let finished = rig.run("log summary", 8);
    for expected in [
        "duration    1.0s, 2 rows",
        "damage      1 line without a row; first line 3: 1 cells",
        "unfinished  8 bytes",
    ] {
        finished.out_says(expected);
    }
    finished.err_says("1 damaged line and ends with 8 bytes");
    let finished = rig.run("log csv", 8);
    assert_eq!(finished.stdout.len(), 3, "{finished:#?}");
    assert!(
        says(
            &finished.stderr,
            "line 3: 1 cells where the log has 5 columns"
        ),
        "{finished:#?}"
    );
    rig.run("log report --output damaged.html", 8)
        .err_says("1 damaged line and ends with 8 bytes");
    let page = fs::read_to_string(rig.folder().join("damaged.html")).unwrap();
    assert!(page.contains("the recording is damaged: line 3"), "{page}");
    let finished = rig.run("log tail", 0);
    assert_eq!(finished.stdout.len(), 2, "{finished:#?}");
    let listed = json(&rig.run("log list --json", 0).stdout[0]);
    assert_eq!(listed["duration_s"], 1.0);
    // Text that a terminal would obey does not get there.
    write(
        &rig,
        name,
        (HEADER.to_owned() + "0\t1\t\u{1b}[2J\t\t\n").as_bytes(),
    );
    let finished = rig.run("log summary", 8);
    assert!(
        !finished
            .stdout
            .iter()
            .chain(&finished.stderr)
            .any(|line| line.contains('\u{1b}')),
        "{finished:#?}"
    );
}

#[test]
fn what_is_no_log_is_refused_with_the_reason() {
    let rig = sandbox();
    rig.write("notes.txt", "milk, bread\n");
    rig.write("empty.tsv", "");
    rig.write("header.tsv", HEADER);
    mkfifoat(CWD, rig.folder().join("pipe"), Mode::RUSR | Mode::WUSR).unwrap();
    for verb in ["summary", "csv", "tail", "report"] {
        for (file, expected) in [
            (
                "notes.txt",
                "it is no log of the RIL: its first line begins with milk, bread",
            ),
            ("empty.tsv", "it has no first line"),
            ("pipe", "it is no regular file"),
            (".", "it is no regular file"),
            ("absent.tsv", "`ril log list`"),
        ] {
            let finished = rig.run(&format!("log {verb} {file}"), 2);
            let said = finished.stderr.join("\n");
            assert!(said.contains(expected), "{verb} {file}: {finished:#?}");
            assert!(finished.stdout.is_empty(), "{verb} {file}: {finished:#?}");
        }
    }
    rig.run("log summary header.tsv", 0).out_says("0 rows");
    rig.run("log csv header.tsv --field altitud_m", 2)
        .err_says("did you mean `altitude_m`?");
    rig.run("log summary", 2)
        .err_says("no log of robot 1 in log");
    let finished = rig.run("log list", 0);
    assert!(
        finished.stdout.is_empty() && says(&finished.stderr, "no log in log"),
        "{finished:#?}"
    );
    rig.domain.assert_empty();
}

#[test]
fn times_of_a_log_without_the_column_count_from_its_name() {
    let rig = sandbox();
    let text = "flying\tsequence\treceived_ns\n0\t1\t5000000000\n0\t2\t5250000000\n";
    write(&rig, "hero(1)_22_11_26-10_00_00.tsv", text.as_bytes());
    let finished = rig.run("log csv", 0);
    assert_eq!(
        finished.stdout,
        [
            "utc,flying,sequence,received_ns",
            "2026-11-22T10:00:00.000000Z,0,1,5000000000",
            "2026-11-22T10:00:00.250000Z,0,2,5250000000",
        ]
    );
    finished.err_says("the log has no column `utc`");
    let other = rig.write("renamed.tsv", text);
    let finished = rig.run(&format!("log csv {}", other.display()), 0);
    assert_eq!(finished.stdout[1], ",0,1,5000000000");
    finished.err_says("times in UTC are not known");
}
