//! The configuration file: the annotated example is the default, and every mistake is named with its line.

use bridge::BridgeConfig;
use dsp_protocol::Command;
use runtime::config::proof::{assert_annotated, assert_refused};

const EXAMPLE: &str = include_str!("../bridge.toml");

fn parse(text: &str) -> Result<BridgeConfig, String> {
    runtime::config::parse(text, "bridge.toml").map_err(|error| error.to_string())
}

#[test]
fn the_example_is_the_default() {
    assert_annotated::<BridgeConfig>(EXAMPLE, &["parameters"]);
    assert_eq!(parse(EXAMPLE).unwrap().serial.baud_rate, 115_200);
}

#[test]
fn a_changed_example_is_not_the_default() {
    let changed = EXAMPLE.replace("baud_rate = 115200", "baud_rate = 57600");
    assert_eq!(parse(&changed).unwrap().serial.baud_rate, 57_600);
}

#[test]
fn mistakes_are_named_with_file_line_and_reason() {
    assert_refused::<BridgeConfig>(
        r#"
        [serial]
        baud = 9600 #! baud_rate
        ---
        [serail] #! serial
        port = "x"
        ---
        [serial]
        baud_rate = 1 #! 50 to 4000000
        ---
        [serial]
        baud_rate = "fast" #! string
        ---
        [status]

        groups = ["time", "gps"] #! gps_velocity
        ---
        [status]
        coherence = "later" #! immediate
        ---
        [arrival]
        altitude_m = nan #! out of range
        ---
        [arrival]
        latitude_deg = 0.0 #! out of range
        ---
        [movement]
        time_limit_s = -1.0 #! out of range
        ---
        [parameters]
        cruise_speed = 5.0 #! cruise_speed_mps
        ---
        [parameters]
        # fast
        cruise_speed_mps = 500.0 #! 0.1 to 20
        ---
        [parameters]
        trim_roll_us = 501 #! -500 to 500
        ---
        [parameters]
        take_off = 1 #! unknown parameter
        ---
        [errors]
        hero_dsp_fatal = [70000] #! u16
        ---
        [link]
        profile = "fast" #! classic or extended
        ---
        [link #! ]
        "#,
    );
}

#[test]
fn parameters_become_writes_in_the_order_of_the_ports() {
    let config = parse("[parameters]\nclimb_speed_mps = 3\ntrim_roll_us = -500\n").unwrap();
    let writes: Vec<Command> = config.parameters.writes().collect();
    assert_eq!(
        writes,
        [
            Command::Write16 {
                port: 10_201,
                value: 0xFE0C
            },
            Command::Write32 {
                port: 20_001,
                value: 3.0
            },
        ]
    );
}

#[test]
fn what_the_line_cannot_carry_is_refused_with_the_arithmetic_and_what_to_do() {
    let check = |text: &str| parse(text).unwrap().check_line();
    // 128 bytes each 20 ms and 3 bytes each 100 ms: 6400 + 30 bytes a second.
    assert_eq!(check(""), Ok(()));
    assert_eq!(check("[serial]\nbaud_rate = 64300"), Ok(()));
    let fault = check("[serial]\nbaud_rate = 64290").unwrap_err();
    for part in [
        "64290 baud carry 6429 bytes a second",
        "asked for 6430",
        "128 bytes each 20 ms",
        "fewer groups in `status.groups`",
        "`status_period_ms` = 21 or more",
    ] {
        assert!(fault.reason().contains(part), "{fault}");
    }
    let with = |baud_rate: u32, rest: &str| {
        check(&format!("[serial]\nbaud_rate = {baud_rate}\n{rest}")).is_ok()
    };
    assert!(!with(1200, ""));
    assert!(with(1200, "[parameters]\nstatus_period_ms = 1423\n"));
    assert!(!with(1200, "[parameters]\nstatus_period_ms = 1422\n"));
    assert!(with(
        19_200,
        "[status]\ngroups = [\"time\", \"geographic\"]\n"
    ));
    // The extended profile has six bytes more for each frame.
    let extended = "[link]\nprofile = \"extended\"\n";
    assert!(with(67_900, extended) && !with(67_800, extended));
}

#[test]
fn values_that_contradict_each_other_are_refused() {
    for (text, hint) in [
        (
            "[movement]\nmin_altitude_m = 50.0\nmax_altitude_m = 20.0",
            "no waypoint could be flown to",
        ),
        (
            "[link]\npc_timeout_ms = 500",
            "too short for ack_timeout_ms = 200: 0, or at least 900",
        ),
        (
            "[safety]\nbattery_v = { warn = 20.0, land = 22.0 }",
            "must fall in the order",
        ),
        ("[safety]\nfuel_percent = { refuse = 120 }", "out of range"),
        (
            "[safety]\nfuel_percent = { refuse = 100.1 }",
            "out of range",
        ),
        ("[trajectory]\nkind = \"straight\"", "pass_through"),
    ] {
        let error = parse(text).unwrap_err();
        assert!(error.starts_with("bridge.toml:"), "{error}");
        assert!(error.contains(hint), "{text:?}: {error}");
    }
    assert!(parse("[link]\npc_timeout_ms = 0").is_ok());
    assert!(parse("[safety]\nfuel_percent = { warn = 100, refuse = 20, land = 20 }").is_ok());
}
