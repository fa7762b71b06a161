//! Packages of others for tests alone, from PyPI and npm, in folders of their own within the target folder, where they
//! stay for the next time. Why they cannot be had is said in words, and then a test is to be skipped visibly.

use std::env;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::languages::{run, target_folder};

fn folder() -> PathBuf {
    target_folder().join("tmp")
}

/// An interpreter of Python with what `requirements` names, such as `pymavlink==2.4.50 future`, and nothing else. A
/// user who may not write in the target folder gets one in the folder for temporary files.
///
/// Making one takes ten seconds of a processor, so tests share it; a second one waits until it is made.
///
/// # Errors
///
/// Why there is none.
pub fn python(requirements: &str) -> Result<PathBuf, String> {
    let name = requirements.replace(|letter: char| !letter.is_ascii_alphanumeric(), "-");
    let made = |folder: &Path| {
        let environment = folder.join(format!("{name}-venv"));
        let is_complete = environment.join("complete").is_file();
        let python = environment.join("bin/python");
        // Its interpreter may lie where this user may not enter.
        (is_complete && run(Command::new(&python).arg("--version")).is_ok()).then_some(python)
    };
    let shared = folder();
    if let Some(python) = made(&shared) {
        return Ok(python);
    }
    let lock_in = |folder: &Path| File::create(folder.join(format!("{name}.lock")));
    let (folder, lock) = match fs::create_dir_all(&shared).and_then(|()| lock_in(&shared)) {
        Ok(lock) => (shared, lock),
        Err(_) => {
            let own = env::temp_dir();
            let lock = lock_in(&own).map_err(|error| format!("{}: {error}", own.display()))?;
            (own, lock)
        }
    };
    lock.lock().map_err(|error| error.to_string())?;
    if let Some(python) = made(&folder) {
        return Ok(python);
    }
    let environment = folder.join(format!("{name}-venv"));
    let requirements: Vec<&str> = requirements.split_whitespace().collect();
    make_environment(&environment, &requirements)?;
    let complete = File::create(environment.join("complete"));
    complete.map_err(|error| error.to_string())?;
    Ok(environment.join("bin/python"))
}

/// Makes a virtual environment with these packages, or adds them to one.
fn make_environment(folder: &Path, packages: &[&str]) -> Result<(), String> {
    run(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    let mut pip = Command::new(folder.join("bin/python"));
    pip.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--retries=1",
    ]);
    run(pip.args(packages))
}

/// A folder with `node_modules` in which these packages are, each written as `name@version`. `name` is for the folder.
///
/// # Errors
///
/// Why there is none.
pub fn node(name: &str, packages: &[&str]) -> Result<PathBuf, String> {
    run(Command::new("node").arg("--version"))?;
    let folder = folder().join(format!("{name}-node"));
    let has_packages = |folder: &Path| {
        let mut names = packages
            .iter()
            .filter_map(|package| package.rsplit_once('@'));
        names.all(|(name, _)| {
            folder
                .join("node_modules")
                .join(name)
                .join("package.json")
                .is_file()
        })
    };
    if !has_packages(&folder) {
        let write = |name: &str, text| fs::write(folder.join(name), text);
        let made = fs::create_dir_all(&folder)
            .and_then(|()| write("package.json", "{\"private\": true}\n"));
        made.map_err(|error| format!("{}: {error}", folder.display()))?;
        let mut npm = Command::new("npm");
        npm.args([
            "install",
            "--no-audit",
            "--no-fund",
            "--ignore-scripts",
            "--fetch-retries=0",
        ]);
        run(npm.args(packages).current_dir(&folder))?;
    }
    match has_packages(&folder) {
        true => Ok(folder),
        false => Err("npm did not install its packages".to_owned()),
    }
}
