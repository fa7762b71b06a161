//! Configurations that are read, and such that are refused.

use std::fs;

use serde::Deserialize;

use super::error::MAX_FILE_BYTES;
use super::proof::{assert_annotated, assert_refused};
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
fn every_mistake_is_reported_with_line_and_reason() {
    assert_refused::<Example>(
        r#"
        serail = 1 #! did you mean `serial`?
        ---

        [serial]

        buad_rate = 1 #! did you mean `baud_rate`?
        ---
        [[log]]
        [[log]]
        directroy = 'a' #! did you mean `directory`?
        ---
        [serial]
        zzz = 1 #! unknown field `zzz`, expected one of
        ---
        [[log]]
        groups = [
        'imu-attitude',
        'barometre', #! did you mean `barometer`?
        ]
        ---
        [serial]
        device = 7 #! invalid type: integer `7`, expected a string
        ---
        [serial]
        baud_rate = 'fast' #! expected u32
        ---
        [serial]
        baud_rate = -1 #! expected u32
        ---
        serial = 3 #! expected struct Serial
        ---
        [log] #! expected a sequence
        directory = 'a'
        ---
        [serial]
        baud_rate = 49 #! 49 is out of range: it must be from 50 to 4000000
        ---
        [serial]

        trim = 501 #! 501 is out of range: it must be from -500 to 500
        ---
        [serial]
        gain = nan #! NaN is out of range: it must be from 0.05 to 5.0
        ---
        [serial]
        gain = inf #! inf is out of range
        ---
        [serial]
        any = inf #! inf is out of range
        ---
        [serial]
        any = nan #! NaN is out of range
        ---
        [serial]
        below_one = 1.0 #! 1 is out of range: it must be from 0.0 to below 1.0
        ---
        [serial]
        baud_rate = #!
        ---
        [serial]
        device = 'a'
        device = 'b' #! duplicate key
        ---
        [serial #!
        "#,
    );
}

/// As [`Example`], without bounds, so that zeros are its defaults.
#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
struct Annotated {
    serial: AnnotatedSerial,
    log: Vec<Log>,
}

#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
struct AnnotatedSerial {
    baud_rate: u32,
    trim: i16,
    device: String,
}

/// A file for it, where `serial` has the rest of that table.
fn annotated(serial: &str) -> String {
    format!(
        "# The link.\n[serial] # to the DSP\nbaud_rate = 0\n{serial}\
         \n# Logs, such as\n#[[log]]\n#directory = \"log\"\n#groups = [\"barometer\"]\n"
    )
}

#[test]
fn an_annotated_file_names_every_setting_with_its_default() {
    let right = "trim = 0\n# device = \"/dev/ttyS0\" # any\n";
    assert_annotated::<Annotated>(&annotated(right), &[]);
    for (wrong, reason) in [
        ("trim = 0\n", "does not name `serial.device`"),
        ("trim = 1\n#device = \"\"\n", "left == right"),
    ] {
        let text = annotated(wrong);
        let refused = std::panic::catch_unwind(|| assert_annotated::<Annotated>(&text, &[]));
        let panic = refused.unwrap_err();
        let said = panic.downcast_ref::<String>().unwrap();
        assert!(said.contains(reason), "{said}");
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
