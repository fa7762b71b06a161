//! Item for item, what pymavlink's own loader reads, and what QGroundControl documents of its plans.
//!
//! pymavlink comes from PyPI into an environment that is thrown away. Without network the comparison is skipped, and
//! says so; `RIL_TEST_PYMAVLINK_PYTHON` names an interpreter that has it.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use plans::Plan;
use plans::mavlink::MissionItem;

use super::files::{path, plan};

/// A version that is known to work; 2.4.49 and later keep its loader.
const PACKAGE: &str = "pymavlink>=2.4.40,<3";

/// Runs a program to its end and gives its output, or says why that did not work.
fn run(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{name}: {error}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(format!(
            "{name}: {}",
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

/// An interpreter with pymavlink.
fn python(folder: &Path) -> Result<PathBuf, String> {
    if let Some(python) = std::env::var_os("RIL_TEST_PYMAVLINK_PYTHON") {
        return Ok(python.into());
    }
    let python = folder.join("bin/python");
    run(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    run(Command::new(&python).args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-cache-dir",
        // Its loader needs none of the others.
        "--no-deps",
        "--retries",
        "1",
        PACKAGE,
    ]))?;
    Ok(python)
}

/// Index, frame, command, seven parameters, autocontinue; no number is `null`.
type Row = Vec<Option<f64>>;

fn row(index: usize, item: &MissionItem) -> Row {
    let whole = [index as f64, f64::from(item.frame), f64::from(item.command)];
    let end = f64::from(u8::from(item.auto_continue));
    let all = whole.into_iter().chain(item.params).chain([end]);
    all.map(|number| Some(number).filter(|number| !number.is_nan()))
        .collect()
}

fn rows(plan: &Plan, first: usize) -> Vec<Row> {
    let items = plan.items.iter().filter_map(|item| item.mavlink);
    items
        .enumerate()
        .map(|(index, item)| row(first + index, &item))
        .collect()
}

fn rows_of_python(python: &Path, file: &Path) -> Vec<Row> {
    let mut command = Command::new(python);
    command
        .arg("-B")
        .arg(path("read_mission.py"))
        .arg(file)
        .env("MAVLINK20", "1");
    let output = run(&mut command).expect("a file that the script reads");
    output
        .lines()
        .map(|line| serde_json::from_str(line).expect("a list of numbers"))
        .collect()
}

#[test]
fn reads_the_same_items() {
    let folder = tempfile::tempdir().expect("a folder");
    let python = match python(folder.path()) {
        Ok(python) => python,
        Err(why) => {
            let _ = writeln!(
                std::io::stderr(),
                "SKIPPED: the comparison with pymavlink: {why}"
            );
            return;
        }
    };
    // pymavlink's list begins with the home, which is no item here.
    let home = plan("mission.waypoints").planned_home.expect("a home");
    let list = rows_of_python(&python, &path("mission.waypoints"));
    assert_eq!(
        list[0][7..10],
        [
            Some(home.position.latitude_deg),
            Some(home.position.longitude_deg),
            home.above_sea_m
        ]
    );
    assert_eq!(rows(&plan("mission.waypoints"), 1), list[1..]);

    assert_eq!(
        rows(&plan("mission.plan"), 0),
        rows_of_python(&python, &path("mission.plan"))
    );

    // What this crate writes says the same to others.
    let text = plans::write::to_qgc_plan(&plan("mission.waypoints")).expect("a plan");
    let written = folder.path().join("written.plan");
    std::fs::write(&written, text).expect("a file");
    assert_eq!(
        rows(&plan("mission.waypoints"), 0),
        rows_of_python(&python, &written)
    );
}
