//! The whole command line.

use operator::options::{Height, Target, Targets};
use runtime::exit::ExitCode;

use super::*;
use crate::verbs::order::FenceCommand;
use crate::verbs::param::{ParamCommand, PortKey};
use crate::verbs::relay::RelayCommand;

fn parse(arguments: &[&str]) -> Result<Command, clap::Error> {
    let arguments = std::iter::once(&"ril").chain(arguments);
    Cli::read(arguments.map(OsString::from)).map(|cli| cli.command)
}

#[test]
fn the_command_line_is_sound() {
    Cli::command().debug_assert();
}

#[test]
fn the_help_documents_every_exit_code() {
    let help = Cli::command().render_help().to_string();
    for code in ExitCode::ALL {
        let line = format!("\n{:>4}  ", code.code());
        assert!(help.contains(&line), "{code:?} is missing in\n{help}");
    }
}

#[test]
fn negative_coordinates_and_options_after_them_are_both_understood() {
    let command = parse(&[
        "goto",
        "-37.1,-6.0,20",
        "37,-.5,-3",
        "-.5,0,1e1",
        "--no-wait",
        "--robot",
        "7",
        "--deadline",
        "50ms",
    ]);
    let Ok(Command::Goto(goto)) = command else {
        panic!("{command:?}");
    };
    let position = |latitude_deg, longitude_deg, altitude_m| Target {
        latitude_deg,
        longitude_deg,
        altitude: Height::Telemetry(altitude_m),
    };
    let expected = [
        position(-37.1, -6.0, 20.0),
        position(37.0, -0.5, -3.0),
        position(-0.5, 0.0, 10.0),
    ];
    assert_eq!(goto.targets().unwrap(), Targets::At(expected.into()));
    assert!(goto.request.no_wait);
    assert_eq!(goto.request.ask.common.robot().get(), 7);
    assert_eq!(goto.request.ask.deadline, Some(50));
}

#[test]
fn altitudes_have_units_and_stand_as_words_of_their_own() {
    let goto = |arguments: &[&str]| match parse(&[&["goto"], arguments].concat()) {
        Ok(Command::Goto(goto)) => goto.targets().unwrap(),
        other => panic!("{other:?}"),
    };
    let target = |altitude| Target {
        latitude_deg: 37.41,
        longitude_deg: -6.01,
        altitude,
    };
    for (arguments, altitude) in [
        (&["37.41", "-6.01", "20m"][..], Height::Telemetry(20.0)),
        (&["37.41", "-6.01", "-5m"], Height::Telemetry(-5.0)),
        (&["37.41", "-6.01", "-5"], Height::Telemetry(-5.0)),
        (
            &["37.41", "-6.01", "+20m", "--preempt"],
            Height::AboveTakeOff(20.0),
        ),
        (&["37.41,-6.01,+20m"], Height::AboveTakeOff(20.0)),
        (&["37.41,-6.01,100ft"], Height::Telemetry(30.48)),
    ] {
        let expected = Targets::At(vec![target(altitude)]);
        assert_eq!(goto(arguments), expected, "{arguments:?}");
    }
    for arguments in [
        &["takeoff", "20m"][..],
        &["takeoff", "+20m"],
        &["takeoff", "20"],
        &["takeoff", "--altitude", "20m"],
        &["takeoff", "--altitude=20"],
    ] {
        match parse(arguments) {
            Ok(Command::Takeoff(args)) => assert_eq!(args.height_m(), 20.0, "{arguments:?}"),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_robot_is_named_before_the_verb_or_behind_it_or_not_at_all() {
    // The environment of the tests may name a robot as well.
    let of_environment = std::env::var("RIL_ROBOT").ok();
    let of_environment = of_environment.and_then(|robot| robot.parse().ok());
    for (arguments, expected) in [
        (&["hold"][..], of_environment),
        (&["hold", "--robot", "1"], Some(1)),
        (&["--robot=2", "hold"], Some(2)),
    ] {
        let Ok(Command::Hold(args)) = parse(arguments) else {
            panic!("{arguments:?}");
        };
        let common = args.request.ask.common;
        assert_eq!(common.robot.map(u32::from), expected, "{arguments:?}");
        assert_eq!(common.robot().get(), expected.unwrap_or(1));
    }
}

#[test]
fn everything_of_the_relay_but_status_goes_to_its_own_program() {
    let relay = |arguments: &[&str]| match parse(arguments) {
        Ok(Command::Relay(args)) => args,
        other => panic!("{other:?}"),
    };
    for arguments in [
        &[][..],
        &["--help"],
        &["-h"],
        &["--config", "relay.toml", "status"],
        &["--robot", "7", "-v"],
        &["help"],
        &["statu"],
        &["--", "status"],
    ] {
        let args = relay(&[&["relay"], arguments].concat());
        assert!(args.command.is_none(), "{args:?}");
        let expected: Vec<&str> = arguments
            .iter()
            .copied()
            .filter(|text| *text != "--")
            .collect();
        assert_eq!(args.args, expected);
    }
    let args = relay(&["relay", "status", "--robot", "7", "--json"]);
    let Some(RelayCommand::Status(status)) = args.command else {
        panic!("{args:?}");
    };
    assert!(status.samples.json && status.samples.common.robot().get() == 7);
    let error = parse(&["relay", "status", "--count", "3"]).unwrap_err();
    assert_eq!(error.exit_code(), 2);
}

#[test]
fn parameters_are_named_or_numbered_and_take_negative_values() {
    let set = |arguments: &[&str]| match parse(arguments) {
        Ok(Command::Param(ParamArgs {
            command: ParamCommand::Set(args),
        })) => (args.port, args.value),
        other => panic!("{other:?}"),
    };
    assert_eq!(
        set(&["param", "set", "trim_tail_us", "-40"]),
        (PortKey::Name("trim_tail_us".to_owned()), -40.0)
    );
    assert_eq!(
        set(&["param", "set", "20000", "5.5"]),
        (PortKey::Number(20_000), 5.5)
    );
}

#[test]
fn a_usage_error_says_why() {
    #[rustfmt::skip]
    let cases: [(&[&str], &str); 35] = [
        (&["goto", "37", "-6"], "2 numbers, each waypoint needs three"),
        (&["goto", "37,-6,20", "-37"], "4 numbers"),
        (&["takeoff", "20m", "--altitude", "20"], "cannot be used with"),
        (&["plan", "check"], "<FILE>"),
        (&["plan", "fly", "a.plan", "--home", "37"], "home is LAT,LON or LAT,LON,ALT"),
        (&["goto"], "LAT,LON,ALT"),
        (&["goto", "37,-6"], "2 numbers"),
        (&["goto", "37,-6,20,1"], "4 numbers"),
        (&["goto", "north,-6,20"], "the latitude `north` is not a number"),
        (&["goto", "-90.1,-6,20"], "the latitude -90.1 is out of range: it must be from -90 to 90"),
        (&["goto", "37,180.1,20"], "the longitude 180.1 is out of range"),
        (&["goto", "37,6,nan"], "the altitude `nan` is not finite"),
        (&["goto", "37,-inf,20"], "the longitude `-inf` is not finite"),
        (&["goto", "-nan,6,20"], "unexpected argument"),
        (&["goto", "37,6,20", "-37,6"], "5 numbers"),
        (&["goto", "37,6,20", "--file", "path"], "cannot be used with"),
        (&["takeoff"], "<ALTITUDE>"),
        (&["takeoff", "--altitude", "5", "--preempt"], "--preempt"),
        (&["param"], "Usage: ril param"),
        (&["param", "set", "yaw_gain"], "<VALUE>"),
        (&["param", "set", "yaw_gain", "nan"], "the value `nan` is not finite"),
        (&["param", "get", "70000"], "from 0 to 65535"),
        (&["fence", "relaod"], "reload"),
        (&["takeoff", "--altitude", "-5"], "greater than 0"),
        (&["takeoff", "--altitude", "high"], "the altitude `high` is not a number"),
        (&["start", "--timeout", "0"], "`0` has no unit"),
        (&["start", "--deadline=25h"], "it must be from 0s to 24h"),
        (&["echo", "../etc"], "a topic is called such as"),
        (&["echo", "dsp", "--count", "0"], "count"),
        (&["hz"], "<TOPIC>"),
        (&["delay", ""], "a topic is called such as"),
        (&["hz", "hero", "--count", "1"], "1 is not in 2.."),
        (&["bw", "hero", "--duration", "0"], "`0` has no unit"),
        (&["bw", "hero", "--json"], "not provided:\n  <--count <N>|--duration <DURATION>>"),
        (&["strat"], "some similar subcommands exist:"),
    ];
    for (arguments, expected) in cases {
        let error = parse(arguments).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{arguments:?}: {error}");
        assert!(
            error.to_string().contains(expected),
            "{arguments:?}: {error}"
        );
    }
}

#[test]
fn what_stands_before_the_verb_is_written_behind_it() {
    #[rustfmt::skip]
    let cases = [
        ("ril status --robot 2", "ril status --robot 2"),
        ("ril --robot 2 status", "ril status --robot 2"),
        ("ril --robot=2 --json -vv param list", "ril param list --robot=2 --json -vv"),
        ("ril --json goto 37,-6,20 -- -1,2,3", "ril goto 37,-6,20 --json -- -1,2,3"),
        ("ril --timeout 5s --config x.toml echo dsp -q", "ril echo dsp -q --timeout 5s --config x.toml"),
        // Verbs of verbs.
        ("ril param list --robot=2", "ril param list --robot=2"),
        ("ril --robot 2 param list", "ril param list --robot 2"),
        ("ril -q --timeout=5s fence reload", "ril fence reload -q --timeout=5s"),
        ("ril --json topic echo dsp --count 1", "ril topic echo dsp --count 1 --json"),
        // Without a verb, and what is none of these.
        ("ril --robot 2", "ril --robot 2"),
        ("ril --robot", "ril --robot"),
        ("ril", "ril"),
        ("ril --help status", "ril --help status"),
        ("ril --json --help", "ril --help --json"),
        ("ril --nonsense status", "ril --nonsense status"),
        ("ril -vx status", "ril -vx status"),
        ("ril - status", "ril - status"),
    ];
    for (before, after) in cases {
        let args = before.split(' ').map(OsString::from).collect();
        let moved = behind_the_verb(args, &Cli::command());
        assert_eq!(moved.join(OsStr::new(" ")), after, "{before}");
    }
}

#[test]
fn a_verb_of_a_verb_takes_its_options_on_either_side() {
    for words in [
        "param list --robot=2 --json",
        "--robot=2 --json param list",
        "--json param list --robot 2",
        "fence reload --robot 2 --json",
        "--robot 2 fence reload --json",
        "--robot 2 --json fence reload",
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let ask = match parse(&words) {
            Ok(Command::Param(ParamArgs {
                command: ParamCommand::List(args),
            })) => args.ask,
            Ok(Command::Fence(FenceArgs {
                command: FenceCommand::Reload(args),
            })) => args.ask,
            other => panic!("{words:?}: {other:?}"),
        };
        assert_eq!(ask.common.robot().get(), 2, "{words:?}");
        assert!(ask.json, "{words:?}");
    }
}

#[test]
fn only_waypoints_are_protected() {
    for text in ["-37,6,2", "-.5,1,2", "-5m", "-16.5ft"] {
        let protected = protect_coordinates([OsString::from(text)]);
        assert_eq!(protected, [format!(" {text}").as_str()], "{text}");
    }
    for text in ["-v", "--robot", "-1", "37,-6,2", "-x,1,2", "", "-"] {
        let protected = protect_coordinates([OsString::from(text)]);
        assert_eq!(protected, [text], "{text}");
    }
}
