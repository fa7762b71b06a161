//! The built-in defaults, in a network of their own, which only root makes: `.ci/as-user` runs this test as root, too.

use std::fs;
use std::process::Command;

use ril_tests::TestDomain;
use ril_tests::languages::skip;
use ril_tests::process::Process;

use crate::rig::RELAY;

/// Local addresses of the sockets in `/proc/<process>/net/<table>`, as the kernel writes them.
fn addresses(process: &Process, table: &str) -> Vec<String> {
    let text = fs::read_to_string(format!("/proc/{}/net/{table}", process.id()));
    let text = text.expect("the kernel's table");
    let lines = text.lines().skip(1);
    let address = |line: &str| line.split_whitespace().nth(1).map(str::to_owned);
    lines.filter_map(address).collect()
}

/// Groups that interfaces have joined, but the one that each interface is in.
fn groups(process: &Process) -> Vec<String> {
    let text = fs::read_to_string(format!("/proc/{}/net/igmp", process.id()));
    let text = text.expect("the kernel's table");
    let groups = text.lines().filter(|line| line.starts_with('\t'));
    let group = |line: &str| line.split_whitespace().next().map(str::to_owned);
    groups
        .filter_map(group)
        .filter(|group| group != "010000E0")
        .collect()
}

fn can_have_networks() -> bool {
    let tried = Command::new("unshare").args(["--net", "true"]).output();
    let can = tried.is_ok_and(|output| output.status.success());
    if !can {
        skip("a network of its own", "`unshare --net` makes none here");
    }
    can
}

#[test]
fn by_default_a_relay_is_reached_from_its_own_machine_alone_and_by_no_multicast() {
    if !can_have_networks() {
        return;
    }
    for (side, listens) in [("robot", true), ("router", true), ("station", false)] {
        let domain = TestDomain::new();
        let mut command = Command::new("unshare");
        let script = format!("ip link set lo up && exec {RELAY} {side}");
        command.args(["--net", "sh", "-c", &script]);
        command.env_remove("RIL_CONFIG").env_remove("RIL_LOG");
        command.env_remove("RIL_ROBOT").current_dir("/");
        let mut process = Process::spawn(&domain, command);
        process.wait_for_text("the network is open");
        // 127.0.0.1:7447, least significant byte first.
        let listening = "0100007F:1D17".to_owned();
        let tcp = addresses(&process, "tcp");
        assert!(
            tcp.iter().all(|address| address.starts_with("0100007F:")),
            "{side}: {tcp:?}"
        );
        assert_eq!(tcp.contains(&listening), listens, "{side}: {tcp:?}");
        for table in ["tcp6", "udp", "udp6", "raw"] {
            assert_eq!(
                addresses(&process, table),
                <[String; 0]>::default(),
                "{side}: {table}"
            );
        }
        assert_eq!(groups(&process), <[String; 0]>::default(), "{side}");
        process.end();
    }
}
