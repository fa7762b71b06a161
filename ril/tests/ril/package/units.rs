//! Units, configuration and the list of files of the package, compared with the program: what can be checked without
//! installing it.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process;

use ril::cli::{Cli, Command};
use runtime::exit::ExitCode;

use super::{has, repository};
use crate::common::sandbox;

const UNITS: [&str; 7] = [
    "ril-bridge@.service",
    "ril-status@.service",
    "ril-record@.service",
    "ril-relay@.service",
    "ril-view@.service",
    "ril-mavlink@.service",
    "ril@.target",
];

/// The most that `systemd-analyze security` may count, in tenths.
const MAX_EXPOSURE_TENTHS: &str = "20";

/// The settings of a unit for robot 7; those that stand there several times have several values.
fn unit(name: &str) -> BTreeMap<String, Vec<String>> {
    let text = fs::read_to_string(repository("package/systemd").join(name)).unwrap();
    let mut settings = BTreeMap::<String, Vec<String>>::new();
    for line in text.lines().filter(|line| !line.starts_with(['#', '['])) {
        if let Some((key, value)) = line.split_once('=') {
            let value = value.replace("%i", "7");
            settings.entry(key.to_owned()).or_default().push(value);
        }
    }
    settings
}

fn only<'a>(settings: &'a BTreeMap<String, Vec<String>>, key: &str) -> &'a str {
    match settings.get(key).map(Vec::as_slice) {
        Some([value]) => value,
        other => panic!("{key} stands there once: {other:?}"),
    }
}

/// Where the packages put their files, each with its source below the repository.
fn assets() -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for package in ["ril", "gateways/relay"] {
        let text = fs::read_to_string(repository(package).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = text.parse().unwrap();
        for asset in manifest["package"]["metadata"]["deb"]["assets"]
            .as_array()
            .unwrap()
        {
            let (from, to) = (asset[0].as_str().unwrap(), asset[1].as_str().unwrap());
            let name = from.rsplit('/').next().unwrap();
            let to = match to.ends_with('/') {
                true => format!("/{to}{name}"),
                false => format!("/{to}"),
            };
            assert_eq!(
                all.insert(to.clone(), from.trim_start_matches("../").to_owned()),
                None,
                "{to} comes twice"
            );
        }
    }
    all
}

#[test]
fn each_unit_starts_a_process_that_there_is_with_a_file_that_is_installed() {
    let assets = assets();
    for (name, verb) in [
        ("ril-bridge@.service", "Bridge"),
        ("ril-status@.service", "Status"),
        ("ril-view@.service", "RunViewArgs"),
        ("ril-mavlink@.service", "MavlinkArgs"),
    ] {
        let unit = unit(name);
        let line: Vec<&str> = only(&unit, "ExecStart").split(' ').collect();
        assert!(
            assets.contains_key(line[0]),
            "{name}: no package has {}",
            line[0]
        );
        let command = match Cli::read(line.iter().map(OsString::from)) {
            Ok(cli) => cli.command,
            Err(error) => panic!("{name}: {error}"),
        };
        assert!(format!("{command:?}").contains(verb), "{name}: {command:?}");
        let config = line.iter().position(|word| *word == "--config").unwrap() + 1;
        let config = line[config].replace("robot-7", "robot-1");
        assert!(
            assets.contains_key(&config),
            "{name}: no package has {config}"
        );
    }
    let record = unit("ril-record@.service");
    let line: Vec<&str> = only(&record, "ExecStart").split(' ').collect();
    match Cli::read(line.iter().map(OsString::from)) {
        Ok(Cli {
            command: Command::Record(args),
            ..
        }) => {
            assert_eq!((args.common.robot().get(), args.flights), (7, true));
            // That is where the unit lets it write.
            assert_eq!(args.output.to_str(), Some("/var/log/hero"));
            assert_eq!(only(&record, "LogsDirectory"), "hero");
            for (file, name) in [(args.bridge, "bridge"), (args.status, "status")] {
                let expected = format!("/etc/hero/robot-7/{name}.toml");
                assert_eq!(file.as_deref().and_then(Path::to_str), Some(&*expected));
            }
        }
        other => panic!("{other:?}"),
    }
    let relay = unit("ril-relay@.service");
    let line = only(&relay, "ExecStart");
    assert_eq!(
        line,
        "/usr/bin/ril-relay robot --robot 7 --config /etc/hero/robot-7/relay.toml"
    );
    for path in ["/usr/bin/ril-relay", "/etc/hero/robot-1/relay.toml"] {
        assert!(assets.contains_key(path), "no package has {path}");
    }
}

#[test]
fn a_service_is_watched_and_restarted_unless_that_cannot_help() {
    for name in UNITS.iter().filter(|name| name.ends_with(".service")) {
        let unit = unit(name);
        for (key, value) in [
            ("Type", "notify"),
            ("Restart", "on-failure"),
            ("StartLimitIntervalSec", "0"),
            ("PartOf", "ril@7.target"),
            ("User", "hero"),
            // It would remove the shared memory of all robots.
            ("RemoveIPC", "no"),
        ] {
            assert_eq!(only(&unit, key), value, "{name}: {key}");
        }
        let hopeless =
            [ExitCode::Usage, ExitCode::Configuration].map(|code| code.code().to_string());
        assert_eq!(
            only(&unit, "RestartPreventExitStatus"),
            hopeless.join(" "),
            "{name}"
        );
        // Processes report at least every 0.5 s.
        assert_eq!(only(&unit, "WatchdogSec"), "5s", "{name}");
    }
    let flown = "ril-bridge@7.service ril-status@7.service";
    let target = unit("ril@.target");
    assert_eq!(only(&target, "Wants"), flown);
    // What these need to start is theirs alone: a bridge that crashes in the air waits for nothing.
    for name in [
        "ril-bridge@.service",
        "ril-status@.service",
        "ril-record@.service",
    ] {
        let unit = unit(name);
        for key in ["Before", "After", "Requires", "BindsTo"] {
            assert_eq!(unit.get(key), None, "{name}: {key}");
        }
    }
}

#[test]
fn the_services_are_hardly_exposed() {
    let offline = process::Command::new("systemd-analyze")
        .args(["security", "--offline=true", "--help"])
        .output();
    if !has(
        "systemd-analyze",
        "the hardening of the units is not measured",
    ) || offline.is_ok_and(|output| !output.status.success())
    {
        super::skipped("the hardening of the units is not measured");
        return;
    }
    let rig = sandbox();
    for name in UNITS.iter().filter(|name| name.ends_with(".service")) {
        let instance = rig.folder().join(name.replace('@', "@1"));
        fs::copy(repository("package/systemd").join(name), &instance).unwrap();
        let output = process::Command::new("systemd-analyze")
            .args(["security", "--no-pager", "--offline=true"])
            .arg(format!("--threshold={MAX_EXPOSURE_TENTHS}"))
            .arg(&instance)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{name}: {said}");
    }
}

#[test]
fn the_configuration_of_the_package_is_taken_by_the_processes() {
    let rig = sandbox();
    let made = process::Command::new("sh")
        .arg(repository("package/configuration"))
        .arg(rig.folder().join("etc"))
        .output()
        .unwrap();
    assert!(made.status.success(), "{made:?}");
    for process in ["bridge", "status", "view", "mavlink"] {
        rig.run(
            &format!("run {process} --check-config --config etc/{process}.toml"),
            0,
        );
    }
    let read = |name: &str| -> toml::Table {
        let text = fs::read_to_string(rig.folder().join("etc").join(name)).unwrap();
        text.parse().unwrap()
    };
    assert_eq!(
        read("bridge.toml")["serial"]["port"].as_str(),
        Some("/dev/hero-dsp")
    );
    let logs = read("status.toml")["log"].as_array().unwrap().clone();
    assert_eq!(logs.len(), 1);
    assert_eq!(logs[0]["directory"].as_str(), Some("/var/log/hero"));
    assert_eq!(logs[0]["file_name"].as_str(), Some("sortable"));
    // That is where the unit lets it write, and who may read it.
    assert_eq!(only(&unit("ril-status@.service"), "LogsDirectory"), "hero");
    let folders = fs::read_to_string(repository("package/etc/tmpfiles.conf")).unwrap();
    assert!(
        folders.contains("\nd /var/log/hero 0750 hero hero -\n"),
        "{folders}"
    );
    assert!(read("relay.toml").contains_key("commands"));
    let key = read("view.toml")["token_key"].as_str().unwrap().to_owned();
    let folder = only(&unit("ril-view@.service"), "ReadWritePaths").to_owned();
    assert_eq!(format!("-{key}"), format!("{folder}/view.key"));
    let secret = "\nd /var/lib/hero/view 0700 hero hero -\n";
    assert!(folders.contains(secret), "{folders}");
    let state = read("mavlink.toml")["state"].as_str().unwrap().to_owned();
    let folder = only(&unit("ril-mavlink@.service"), "ReadWritePaths").to_owned();
    assert_eq!(format!("-{state}"), folder);
    let own = format!("\nd {state} 0700 hero hero -\n");
    assert!(folders.contains(&own), "{folders}");
}

/// What keeps the service from writing the fence of a station is what the manual tells the operator to permit, and a
/// purge removes that.
#[test]
fn the_manual_permits_the_service_to_write_the_fence_where_its_bridge_reads_it() {
    let unit = unit("ril-mavlink@.service");
    let words: Vec<&str> = only(&unit, "ExecStart").split(' ').collect();
    let config = words.iter().position(|word| *word == "--config").unwrap() + 1;
    let folder = Path::new(words[config]).parent().unwrap();
    let folder = folder.to_str().unwrap().replace("robot-7", "robot-1");
    assert_eq!(only(&unit, "ProtectSystem"), "strict");
    assert!(!only(&unit, "ReadWritePaths").contains("/etc"));
    let read = |path: &str| fs::read_to_string(repository(path)).unwrap();
    let example = read("gateways/mavlink/mavlink.toml");
    assert!(example.contains(&format!("#bridge = \"{folder}/bridge.toml\"")));
    let manual = read("docs/install.md");
    let drop_in = "/etc/systemd/system/ril-mavlink@1.service.d";
    for said in [
        format!("bridge = \"{folder}/bridge.toml\""),
        format!("ReadWritePaths={folder}\\n"),
        format!("chmod g+w {folder}\n"),
        format!("{drop_in}/"),
    ] {
        assert!(manual.contains(&said), "{said}");
    }
    let removed = drop_in.replace("@1", "@*");
    assert!(read("package/debian/postrm").contains(&removed));
}

#[test]
fn the_udev_rule_makes_the_port_of_the_configuration() {
    let rule = fs::read_to_string(repository("package/udev/65-hero-dsp.rules")).unwrap();
    let rules: Vec<&str> = rule
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
        .collect();
    let timer = "SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\"";
    assert!(rules.contains(&timer), "{rules:?}");
    assert!(
        rules
            .iter()
            .all(|line| line.starts_with("SUBSYSTEM==\"tty\"") || *line == timer),
        "{rules:?}"
    );
    assert!(
        rules
            .iter()
            .any(|line| line.ends_with("SYMLINK+=\"hero-dsp\"")),
        "{rules:?}"
    );
}

#[test]
fn the_packages_list_files_that_there_are_and_scripts_that_a_shell_reads() {
    for (to, from) in assets() {
        // These two are built.
        if from.starts_with("target/release/") || from.starts_with("package/out/") {
            continue;
        }
        let (folder, last) = from.rsplit_once('/').unwrap();
        let folder = repository(folder);
        let suffix = last.trim_start_matches('*');
        let found = fs::read_dir(&folder).unwrap().any(|entry| {
            let name = entry.unwrap().file_name();
            let name = name.to_str().unwrap();
            name == last || last.starts_with('*') && name.ends_with(suffix)
        });
        assert!(found, "{to}: there is no {from}");
    }
    for script in [
        "build",
        "check",
        "configuration",
        "licences",
        "debian/postinst",
        "debian/prerm",
        "debian/postrm",
        "relay/postinst",
        "relay/prerm",
        "relay/postrm",
    ] {
        let path = repository("package").join(script);
        let read = process::Command::new("sh")
            .arg("-n")
            .arg(&path)
            .output()
            .unwrap();
        assert!(read.status.success(), "{script}: {read:?}");
    }
}
