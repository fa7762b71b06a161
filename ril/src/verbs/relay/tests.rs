//! What is shown of links and stations that are well, that are not, and of which nothing is known; and which program is
//! started.

use ipc_types::RobotId;
use ipc_types::code::{Reason, RelayLinkState};
use ipc_types::payload::{MAX_STATIONS, RelayStation, ascii_bytes};
use operator::robot::relay_link::LinkReport;
use serde_json::{Value, json};

use super::*;

const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

fn ago(ms: u64) -> u64 {
    NOW.0 - ms * 1_000_000
}

fn up() -> RelayLink {
    RelayLink {
        sequence: 9,
        published_ns: ago(120),
        since_ns: ago(12_300),
        last_heard_ns: ago(15),
        clock_offset_ns: -3_600_000_001_000,
        clock_uncertainty_s: 0.0008,
        round_trip_s: 0.0123,
        open_timeout_s: 8.0,
        samples_received: 990,
        samples_lost_on_air: 10,
        samples_lost_in_relay: 2,
        samples_left_out: 300,
        bytes_received: 4096,
        bytes_sent: 512,
        orders_sent: 12,
        orders_repeated: 3,
        orders_unknown: 1,
        state: RelayLinkState::Up.code(),
        robot: 7,
        clock_drift_ppb: 12_345,
        clock_valid: 1,
        clock_resets: 1,
        outages: 2,
        orders_open: 4,
        link: ascii_bytes("tcp/10.0.0.2:7447"),
        station: ascii_bytes("ground-1"),
        ..RelayLink::default()
    }
}

fn stations() -> RelayStations {
    let mut stations = RelayStations {
        sequence: 5,
        published_ns: ago(200),
        count: 3,
        samples_bytes_per_s: 5940,
        ..RelayStations::default()
    };
    stations.stations[0] = RelayStation {
        name: ascii_bytes("ground-1"),
        last_heard_ns: ago(120),
        since_ns: ago(3000),
        last_order_ns: ago(450),
        orders_executed: 12,
        orders_refused: 1,
        samples_sent: 4711,
        may_command: 1,
        is_up: 1,
        orders_open: 2,
        ..RelayStation::default()
    };
    stations.stations[1].name = ascii_bytes("watcher");
    stations.stations[1].refusal = Reason::RelayNotPermitted.code();
    stations.stations[2] = RelayStation {
        name: ascii_bytes("ninth"),
        last_heard_ns: ago(50),
        since_ns: ago(1000),
        may_command: 1,
        is_up: 1,
        refusal: Reason::RelayTooManyStations.code(),
        ..RelayStation::default()
    };
    stations
}

fn of_link(link: &RelayLink) -> RelayReport {
    RelayReport::new(RobotId::DEFAULT, Some(link), None, NOW)
}

#[test]
fn a_link_that_is_up_is_shown_with_clock_losses_and_orders() {
    let report = of_link(&up());
    assert_eq!(report.trouble(), None);
    let expected = "\
robot       1
link        up for 12.3s over tcp/10.0.0.2:7447, last message 15 ms ago; 2 outages
            robot 7 on its own machine; this station is ground-1
clock       the robot's is 3600.000001 s behind, true within 0.800 ms; round trip 12.3 ms, drift 12.345 ppm, 1 reset
samples     990 received, 10 lost on the air (1.00 %), 2 lost in the robot's relay, 300 left out on purpose
bytes       4096 received, 512 sent
orders      12 sent, 3 messages repeated, 4 open, 1 of unknown outcome
relay       sample 9, 120 ms old
";
    assert_eq!(report.to_string(), expected);
    let short =
        "relayed over tcp/10.0.0.2:7447, link up, round trip 12.3 ms, 1.00 % lost on the air";
    assert_eq!(LinkReport::new(&up(), NOW).in_short(), short);
}

#[test]
fn a_link_over_which_no_requests_go_says_why() {
    let link = RelayLink {
        refusal: Reason::RelayTooManyStations.code(),
        ..up()
    };
    let report = of_link(&link);
    let expected =
        "this station is ground-1, and its requests are refused (relay-too-many-stations)\n";
    assert!(report.to_string().contains(expected), "{report}");
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["link"]["refusal"], "relay-too-many-stations");
}

#[test]
fn a_link_of_which_nothing_is_known_says_so() {
    let link = RelayLink {
        published_ns: NOW.0,
        state: RelayLinkState::Connecting.code(),
        ..RelayLink::default()
    };
    let report = of_link(&link);
    assert!(report.trouble().is_some());
    let (trouble, next_step) = report.trouble().unwrap();
    assert!(trouble.contains("not up: connecting for"), "{trouble}");
    assert!(next_step.contains("`open_timeout_ms`"), "{next_step}");
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["trouble"], trouble);
    assert_eq!(json["next_step"], next_step);
    let text = report.to_string();
    for expected in [
        "link        connecting since an unknown time over , last message never; 0 outages\n",
        "clock       not compared with the robot's yet\n",
        "samples     0 received, 0 lost on the air, 0 lost in the robot's relay, 0 left out",
    ] {
        assert!(
            text.contains(expected),
            "{expected:?} is missing in\n{text}"
        );
    }
    let short = LinkReport::new(&link, NOW).in_short();
    assert!(
        short.ends_with("round trip unknown, no samples yet"),
        "{short}"
    );
}

#[test]
fn a_robot_that_answers_and_is_not_described_yet_is_waited_for() {
    let link = RelayLink {
        state: RelayLinkState::Connecting.code(),
        ..up()
    };
    let (trouble, next_step) = of_link(&link).trouble().unwrap();
    assert!(trouble.contains("the robot answers"), "{trouble}");
    assert!(next_step.starts_with("wait"), "{next_step}");
}

#[test]
fn a_relay_that_hangs_has_no_link_that_is_up() {
    let link = RelayLink {
        published_ns: ago(3001),
        ..up()
    };
    let report = of_link(&link);
    assert!(report.trouble().is_some());
    assert!(report.trouble().unwrap().0.contains("does not report"));
    assert!(report.to_string().ends_with("3001 ms old, STALE\n"));
    assert!(LinkReport::new(&link, NOW).in_short().ends_with(", STALE"));
    let stations = RelayStations {
        published_ns: ago(3001),
        ..stations()
    };
    let report = RelayReport::new(RobotId::DEFAULT, None, Some(&stations), NOW);
    assert!(report.trouble().is_some());
}

#[test]
fn stations_are_shown_with_what_they_may_and_did() {
    let report = RelayReport::new(RobotId::DEFAULT, None, Some(&stations()), NOW);
    assert_eq!(report.trouble(), None);
    let expected = "\
robot       1
station     ground-1: up for 3s, may command, last message 120 ms ago, last order 450 ms ago
            4711 samples sent; 12 orders executed, 1 refused, 2 open
station     watcher: down, may not command, last message never, last order never
            0 samples sent; 0 orders executed, 0 refused, 0 open
station     ninth: up for 1s, may command and is refused (relay-too-many-stations), last message 50 ms ago, last order never
            0 samples sent; 0 orders executed, 0 refused, 0 open
pace        at most 5.9 kB of samples a second go out, the newest of each topic
relay       sample 5, 200 ms old
";
    assert_eq!(report.to_string(), expected);
    let none = RelayStations {
        published_ns: NOW.0,
        ..RelayStations::default()
    };
    let report = RelayReport::new(RobotId::DEFAULT, None, Some(&none), NOW);
    assert!(report.trouble().is_some());
    assert_eq!(report.trouble().unwrap().0, "no station is up");
    assert!(report.to_string().contains("station     none\n"));
}

#[test]
fn a_station_shows_which_station_commands_and_its_link_alone_decides() {
    let link = RelayLink {
        state: RelayLinkState::Down.code(),
        ..up()
    };
    let of = |link: &RelayLink, stations: &RelayStations| {
        RelayReport::new(RobotId::DEFAULT, Some(link), Some(stations), NOW)
    };
    let report = of(&link, &stations());
    assert!(report.trouble().is_some());
    let text = report.to_string();
    assert!(
        text.contains("commands    ground-1, last order 450 ms ago\npace        at most 5.9 kB"),
        "{text}"
    );
    let nobody = of(&up(), &RelayStations::default());
    assert_eq!(nobody.trouble(), None);
    let text = nobody.to_string();
    let expected = "commands    no station has yet\npace        all samples go out\n";
    assert!(text.ends_with(expected), "{text}");
}

#[test]
fn programs_get_numbers_and_nothing_for_what_is_not_known() {
    let json_of = |report: RelayReport| serde_json::to_value(report).unwrap();
    let report = json_of(of_link(&up()));
    for (pointer, expected) in [
        ("/schema", json!("ril.Relay.v3")),
        ("/robot", 1.into()),
        ("/up", true.into()),
        ("/trouble", Value::Null),
        ("/next_step", Value::Null),
        ("/link/open_timeout_s", 8.0.into()),
        ("/link/state", "up".into()),
        ("/link/over", "tcp/10.0.0.2:7447".into()),
        ("/link/station", "ground-1".into()),
        ("/link/robot_there", 7.into()),
        ("/link/refusal", Value::Null),
        ("/link/last_heard_age_ms", 15.into()),
        ("/link/clock/offset_ns", (-3_600_000_001_000_i64).into()),
        ("/link/clock/uncertainty_s", 0.0008.into()),
        ("/link/clock/drift_ppb", 12_345.into()),
        ("/link/samples/lost_on_air_percent", 1.0.into()),
        ("/link/samples/lost_in_relay", 2.into()),
        ("/link/samples/left_out", 300.into()),
        ("/link/orders/unknown", 1.into()),
        ("/stations", Value::Null),
    ] {
        assert_eq!(report.pointer(pointer), Some(&expected), "{pointer}");
    }
    let unknown = RelayLink {
        published_ns: u64::MAX,
        state: 77,
        clock_uncertainty_s: f64::NAN,
        link: [0xff; 64],
        ..up()
    };
    let report = json_of(of_link(&unknown));
    for (pointer, expected) in [
        ("/up", json!(false)),
        ("/link/state", "unknown-77".into()),
        ("/link/over", Value::Null),
        ("/link/clock/uncertainty_s", Value::Null),
        ("/link/sample/age_ms", Value::Null),
    ] {
        assert_eq!(report.pointer(pointer), Some(&expected), "{pointer}");
    }
    let mut many = stations();
    many.count = u32::MAX;
    let report = json_of(RelayReport::new(RobotId::DEFAULT, None, Some(&many), NOW));
    let shown = report["stations"]["stations"].as_array().unwrap();
    assert_eq!(shown.len(), MAX_STATIONS);
    assert_eq!(shown[0]["may_command"], true);
    assert_eq!(shown[0]["last_order_age_ms"], 450);
    assert_eq!(shown[1]["last_order_age_ms"], Value::Null);
    assert_eq!(shown[0]["refusal"], Value::Null);
    assert_eq!(shown[2]["refusal"], "relay-too-many-stations");
    assert_eq!(report["stations"]["samples_bytes_per_s"], 5940);
    assert_eq!(report["link"], Value::Null);
    let all = RelayStations::default();
    let report = json_of(RelayReport::new(RobotId::DEFAULT, None, Some(&all), NOW));
    assert_eq!(report["stations"]["samples_bytes_per_s"], Value::Null);
}

#[test]
fn whether_a_station_is_up_is_not_known_over_a_link_that_is_down_or_by_what_is_old() {
    let down = RelayLink {
        state: RelayLinkState::Down.code(),
        ..up()
    };
    let old = RelayStations {
        published_ns: ago(3001),
        ..stations()
    };
    for (link, stations, expected) in [
        (None, stations(), json!(true)),
        (Some(up()), stations(), json!(true)),
        (Some(down), stations(), Value::Null),
        (None, old, Value::Null),
    ] {
        let report = RelayReport::new(RobotId::DEFAULT, link.as_ref(), Some(&stations), NOW);
        let text = report.to_string();
        let json = serde_json::to_value(report).unwrap();
        assert_eq!(json["stations"]["stations"][0]["up"], expected, "{json}");
        let is_shown = text.contains("ground-1: up");
        assert_eq!(
            is_shown,
            link.is_none() && expected == json!(true),
            "{text}"
        );
    }
}

#[test]
fn two_robots_of_one_number_are_a_trouble_though_the_link_is_up() {
    let link = RelayLink {
        refusal: Reason::RelayTwoRobots.code(),
        ..up()
    };
    let (trouble, next_step) = of_link(&link).trouble().unwrap();
    assert!(
        trouble.contains("two robots answer under number 7"),
        "{trouble}"
    );
    assert!(next_step.contains("log"), "{next_step}");
}

#[test]
fn a_text_of_another_process_does_not_command_the_terminal() {
    let mut link = up();
    link.link[0] = 0x1b;
    link.station[0] = b'\n';
    let text = of_link(&link).to_string();
    assert!(text.contains("over unreadable,") && text.contains("station is unreadable\n"));
    assert!(!text.contains('\x1b'));
}

#[test]
fn without_a_program_beside_it_is_looked_for_in_path() {
    let nowhere = Path::new("/nowhere/ril");
    assert_eq!(program_beside(Some(nowhere)), Path::new(PROGRAM));
    assert_eq!(program_beside(None), Path::new(PROGRAM));
}

#[test]
fn a_missing_program_is_named_with_how_it_is_built() {
    let missing = not_started(Path::new(PROGRAM), &io::ErrorKind::NotFound.into());
    assert!(
        missing.contains("`cargo install --path gateways/relay`"),
        "{missing}"
    );
    let forbidden = not_started(
        Path::new("/opt/ril-relay"),
        &io::ErrorKind::PermissionDenied.into(),
    );
    assert!(
        forbidden.starts_with("/opt/ril-relay cannot be started: "),
        "{forbidden}"
    );
}
