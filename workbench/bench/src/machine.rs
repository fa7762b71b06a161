//! What the figures depend on: processor, kernel, date. Nothing that tells whose machine it is.

use std::fs;

/// One line about the machine.
pub fn describe() -> String {
    let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = field(&cpus, "model name").unwrap_or("unknown processor");
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let virtual_machine = if cpus.contains(" hypervisor") {
        ", virtual"
    } else {
        ""
    };
    let kernel = release.split(['-', '+']).next().unwrap_or_default().trim();
    format!("{model}, {cores} cores{virtual_machine}, Linux {kernel}")
}

/// The value of the first line `key : value`.
pub fn field<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.lines().find_map(|line| {
        let (found, value) = line.split_once(':')?;
        (found.trim() == key).then(|| value.trim())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_is_found_by_its_whole_name() {
        let text = "model\t\t: 1\nmodel name\t: Processor 9: fast\n";
        assert_eq!(field(text, "model name"), Some("Processor 9: fast"));
        assert_eq!(field(text, "model"), Some("1"));
        assert_eq!(field(text, "cores"), None);
    }
}
