//! Keys: the last part of a service's name, and the name of the folder in which the service lies.

use crate::payload::layout::{is_equal, is_snake};
use crate::random;
use crate::robot::RobotId;

/// Longest key of a service, bytes.
pub const MAX_KEY_LEN: usize = 64;

/// Last parts of names that the event services of every service have.
const EVENT_PARTS: [&str; 3] = ["subscribers", "requests", "responses"];

/// Whether `key` can be the last part of a service's name: parts in lower snake case, divided by `/`, at most
/// [`MAX_KEY_LEN`] bytes.
///
/// A module's own keys begin with the module's name, as `battery_watch/cell_voltages` does, so that no two modules have
/// the same one. The last part is none of those that the event services have.
pub const fn is_key(key: &str) -> bool {
    let key = key.as_bytes();
    if key.is_empty() || key.len() > MAX_KEY_LEN {
        return false;
    }
    let mut from = 0;
    let mut index = 0;
    while index <= key.len() {
        if index == key.len() || key[index] == b'/' {
            if !is_snake(key, from, index) {
                return false;
            }
            if index < key.len() {
                from = index + 1;
            }
        }
        index += 1;
    }
    let mut part = 0;
    while part < EVENT_PARTS.len() {
        if ends_with(key, from, EVENT_PARTS[part].as_bytes()) {
            return false;
        }
        part += 1;
    }
    true
}

/// Whether `text[from..]` is `end`.
const fn ends_with(text: &[u8], from: usize, end: &[u8]) -> bool {
    if text.len() - from != end.len() {
        return false;
    }
    let mut index = 0;
    while index < end.len() {
        if text[from + index] != end[index] {
            return false;
        }
        index += 1;
    }
    true
}

/// The name of the service with this key, such as `hero/1/dsp_telemetry`.
pub fn service_name(robot: RobotId, key: &str) -> String {
    format!("hero/{robot}/{key}")
}

/// The module whose key this is: the part before the first `/`; empty when there is none.
pub const fn module_of(key: &'static str) -> &'static str {
    let bytes = key.as_bytes();
    let mut len = 0;
    while len < bytes.len() {
        if bytes[len] == b'/' {
            return key.split_at(len).0;
        }
        len += 1;
    }
    ""
}

/// Names of the RIL's own modules, which no other module can have: consumers take what the process `relay` provides for
/// what comes from another machine, and know bridge and status by theirs.
pub const OWN_NAMES: [&str; 4] = ["bridge", "status", "relay", "mavlink"];

/// Whether this is the name of one of the RIL's own modules.
pub const fn is_own_name(name: &str) -> bool {
    let mut index = 0;
    while index < OWN_NAMES.len() {
        if is_equal(name, OWN_NAMES[index]) {
            return true;
        }
        index += 1;
    }
    false
}

/// Stops the compiler when a module outside the RIL cannot have the service `key`: for [`topic!`](crate::topic) and
/// [`request!`](crate::request).
#[doc(hidden)]
pub const fn check_outside(key: &'static str) {
    assert!(
        !is_own_name(module_of(key)),
        "`bridge`, `status` and `relay` are the names of the RIL's own modules: choose another one"
    );
}

/// Longest name of a service's folder, bytes: the longest key of the robot's own.
const MAX_FOLDER_LEN: usize = 14;

/// The name of a service's folder: the key, or if that is longer or has parts its first letters and a hash of it.
/// Sockets lie below, whose names are limited.
pub(crate) fn folder_name(key: &str) -> String {
    const HASH_LEN: usize = 6;
    if key.len() <= MAX_FOLDER_LEN && !key.contains('/') {
        return key.to_owned();
    }
    let begin: String = key
        .chars()
        .take_while(|letter| *letter != '/')
        .take(MAX_FOLDER_LEN - HASH_LEN - 1)
        .collect();
    let hash = random::letters(random::hash(key.as_bytes()), HASH_LEN);
    format!("{begin}-{hash}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_names_that_file_and_service_can_have() {
        let longest = "a".repeat(MAX_KEY_LEN);
        for key in [
            "dsp_telemetry",
            "battery_watch/cell_voltages",
            "a/b/c2",
            "requests/a",
            &longest,
        ] {
            assert!(is_key(key), "{key}");
        }
        let too_long = "a".repeat(MAX_KEY_LEN + 1);
        for key in [
            "",
            "/",
            "a/",
            "/a",
            "a//b",
            "A",
            "a.b",
            "a-b",
            "a__b",
            "a_",
            "2a",
            "a/requests",
            "responses",
            &too_long,
        ] {
            assert!(!is_key(key), "{key}");
        }
        assert_eq!(module_of("battery_watch/cell_voltages"), "battery_watch");
        assert_eq!(module_of("dsp_telemetry"), "");
    }

    #[test]
    fn the_names_of_the_ril_s_own_modules_are_taken() {
        for name in ["bridge", "status", "relay"] {
            assert!(is_own_name(name), "{name}");
        }
        for name in ["", "relay_", "rela", "relays", "Relay", "battery_watch"] {
            assert!(!is_own_name(name), "{name}");
        }
    }
}
