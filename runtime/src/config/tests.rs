//! Configurations that are read, and such that are refused.

use std::fs;

use serde::Deserialize;

use super::error::MAX_FILE_BYTES;
use super::*;
use crate::ranged;

ranged! {
    fn baud_rate(u32) in 50..=4_000_000;
    fn gain(f64) in 0.05..=5.0;
    fn any(f64) in ..;
    fn below_one(f32) in 0.0..1.0;
    fn trim(i16) in -500..=500;
}

#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
struct Example {
    serial: Serial,
    log: Vec<Log>,
}

#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
struct Serial {
    #[serde(deserialize_with = "baud_rate")]
    baud_rate: u32,
    #[serde(deserialize_with = "gain")]
    gain: f64,
    #[serde(deserialize_with = "any")]
    any: f64,
    #[serde(deserialize_with = "below_one")]
    below_one: f32,
    #[serde(deserialize_with = "trim")]
    trim: i16,
    device: String,
}

#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
struct Log {
    directory: String,
    groups: Vec<Group>,
}

#[derive(Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Group {
    ImuAttitude,
    Barometer,
}

#[test]
fn a_right_file_is_read_and_its_gaps_are_the_defaults() {
    let text = "[serial]\nbaud_rate = 50\ngain = 5\nbelow_one = 0.5\ntrim = -500\n[[log]]\ngroups = [\"imu-attitude\"]\n";
    let example: Example = parse(text, "x.toml").unwrap();
    assert_eq!(example.serial.baud_rate, 50);
    assert_eq!(example.serial.gain, 5.0);
    assert_eq!(example.serial.trim, -500);
    assert_eq!(example.serial.device, "");
    assert_eq!(example.log[0].groups, [Group::ImuAttitude]);
}

#[test]
fn every_mistake_is_told_with_line_and_reason() {
    #[rustfmt::skip]
    let cases = [
        // Unknown keys: at the top, in a table, in the second table of an array.
        ("serail = 1", 1, "did you mean `serial`?"),
        ("\n[serial]\n\nbuad_rate = 1", 4, "did you mean `baud_rate`?"),
        ("[[log]]\n[[log]]\ndirectroy = 'a'", 3, "did you mean `directory`?"),
        ("[serial]\nzzz = 1", 2, "unknown field `zzz`, expected one of"),
        ("[[log]]\ngroups = [\n'imu-attitude',\n'barometre',\n]", 4, "did you mean `barometer`?"),
        // Wrong types.
        ("[serial]\ndevice = 7", 2, "invalid type: integer `7`, expected a string"),
        ("[serial]\nbaud_rate = 'fast'", 2, "expected u32"),
        ("[serial]\nbaud_rate = -1", 2, "expected u32"),
        ("serial = 3", 1, "expected struct Serial"),
        ("[log]\ndirectory = 'a'", 1, "expected a sequence"),
        // Out of range.
        ("[serial]\nbaud_rate = 49", 2, "49 is out of range: it must be from 50 to 4000000"),
        ("[serial]\n\ntrim = 501", 3, "501 is out of range: it must be from -500 to 500"),
        ("[serial]\ngain = nan", 2, "NaN is out of range: it must be from 0.05 to 5.0"),
        ("[serial]\ngain = inf", 2, "inf is out of range"),
        ("[serial]\nany = inf", 2, "inf is out of range"),
        ("[serial]\nany = nan", 2, "NaN is out of range"),
        ("[serial]\nbelow_one = 1.0", 2, "1 is out of range: it must be from 0.0 to below 1.0"),
        // Not TOML.
        ("[serial]\nbaud_rate = ", 2, "x.toml:2: "),
        ("[serial]\ndevice = 'a'\ndevice = 'b'", 3, "duplicate key"),
        ("[serial", 1, "x.toml:1: "),
    ];
    for (text, line, reason) in cases {
        let error = parse::<Example>(text, "x.toml").unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("x.toml:{line}: ")),
            "{text:?}: {error}"
        );
        assert!(error.contains(reason), "{text:?}: {error}");
        assert_eq!(error.lines().count(), 1, "{error:?}");
    }
}

#[test]
fn the_error_repeats_the_line_but_not_without_end() {
    let text = format!("[serial]\ndevice = 7 # {}", "x".repeat(1000));
    let error = parse::<Example>(&text, "x.toml").unwrap_err().to_string();
    assert!(error.contains("in `device = 7 # xxx"), "{error}");
    assert!(error.len() < 200, "{error}");
}

#[test]
fn the_default_file_may_be_absent_and_the_named_one_may_not() {
    let folder = tempfile::tempdir().unwrap();
    let absent = folder.path().join("absent.toml");
    let present = folder.path().join("present.toml");
    fs::write(&present, "[serial]\nbaud_rate = 100\n").unwrap();

    let loaded = load::<Example>(None, &absent).unwrap();
    assert_eq!((loaded.value, loaded.file), (Example::default(), None));
    for (explicit, default_file) in [(Some(&*present), &absent), (None, &present)] {
        let loaded = load::<Example>(explicit, default_file).unwrap();
        assert_eq!(loaded.value.serial.baud_rate, 100);
        assert_eq!(loaded.file.as_deref(), Some(&*present));
    }
    let error = load::<Example>(Some(&absent), &present).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("absent.toml: cannot be read; name a file")
    );
    let error = load::<Example>(Some(folder.path()), &present).unwrap_err();
    assert!(matches!(
        error,
        ConfigError::NotAFile {
            what: "a folder",
            ..
        }
    ));
}

#[test]
fn a_fault_has_file_and_line_unless_the_file_does_not_say_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("x.toml");
    fs::write(&file, "\n[serial]\ndevice = 'a'\n").unwrap();
    let loaded = load::<Example>(Some(&file), &file).unwrap();
    let fault = Fault::at(&["serial", "device"], "is not there; name another");
    let error = loaded.refuse(&fault.clone().of("a")).to_string();
    let expected = "x.toml:3: is not there; name another, in `device = 'a'`";
    assert!(error.ends_with(expected), "{error}");
    let error = loaded.refuse(&fault.of("b")).to_string();
    assert_eq!(error, "is not there; name another");
}

#[test]
fn nothing_but_a_file_is_opened() {
    use rustix::fs::{CWD, Mode, mkfifoat};
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    mkfifoat(CWD, &pipe, Mode::RUSR | Mode::WUSR).unwrap();
    let socket = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&pipe, &link).unwrap();
    for (path, expected) in [
        (&*pipe, "is a pipe, not"),
        (&link, "is a pipe, not"),
        (&socket, "is a socket, not"),
        (Path::new("/dev/null"), "is a device, not"),
    ] {
        // In the place of a default file it is no less wrong.
        for explicit in [Some(path), None] {
            let error = load::<Example>(explicit, path).unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}

#[test]
fn a_file_that_is_no_text_or_too_long_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("x.toml");
    fs::write(&file, b"\n\ndevice = \xFF").unwrap();
    let error = load::<Example>(Some(&file), &file).unwrap_err().to_string();
    assert!(error.contains("x.toml:3: is not UTF-8"), "{error}");

    let longest = " ".repeat(MAX_FILE_BYTES as usize);
    fs::write(&file, &longest).unwrap();
    assert!(load::<Example>(Some(&file), &file).is_ok());
    fs::write(&file, longest + " ").unwrap();
    let error = load::<Example>(Some(&file), &file).unwrap_err();
    assert!(matches!(error, ConfigError::TooLong { .. }));
}
