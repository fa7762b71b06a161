//! Packages of others for tests alone, from PyPI and npm, in folders of their own within the target folder, where they stay for the next
//! time. Why they cannot be had is said in words, and then a test is to be skipped visibly.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::languages::{run, target_folder};

fn folder() -> PathBuf {
    target_folder().join("tmp")
}

/// An interpreter of Python with these packages, of which `imports` tells whether they are there. `name` is for the folder.
///
/// # Errors
///
/// Why there is none.
pub fn python(name: &str, packages: &[&str], imports: &str) -> Result<PathBuf, String> {
    let folder = folder().join(format!("{name}-venv"));
    let python = folder.join("bin/python");
    let has_packages = || run(Command::new(&python).args(["-B", "-c", imports]));
    if has_packages().is_err() {
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        let mut pip = Command::new(&python);
        pip.args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--retries=1",
        ]);
        run(pip.args(packages))?;
        has_packages()?;
    }
    Ok(python)
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
        let write = |name: &str, text| std::fs::write(folder.join(name), text);
        let made = std::fs::create_dir_all(&folder)
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
