//! Lines, endings, objects and exit codes of reports.

use ipc_types::code::SafetyRule;
use ipc_types::payload::PortInfo;

use super::object::ReportObject;
use super::*;

#[test]
fn every_final_report_has_its_exit_code() {
    for stage in Stage::ALL {
        for reason in Reason::ALL {
            let expected = match stage {
                Stage::Done => 0,
                Stage::Refused => match reason {
                    Reason::LinkDown | Reason::LinkLost | Reason::RelayLinkDown => 6,
                    _ => 5,
                },
                Stage::Aborted => match reason {
                    Reason::LinkDown | Reason::LinkLost | Reason::RelayLinkDown => 6,
                    Reason::TooLate
                    | Reason::MovementTimeout
                    | Reason::CommunicationFatalError
                    | Reason::DeliveryFailed => 4,
                    _ => 5,
                },
                Stage::Unknown | Stage::Accepted | Stage::Progress => 7,
            };
            assert_eq!(
                exit_code(stage, reason).code(),
                expected,
                "{stage} {reason}"
            );
            let report = RequestReport::new(stage, reason);
            let report = FinalReport::of(&report);
            assert_eq!(report.is_some(), stage.is_final());
            if let Some(report) = report {
                assert_eq!(report.exit_code().code(), expected);
            }
        }
    }
}

#[test]
fn an_unknown_reason_changes_nothing_but_itself() {
    let report = RequestReport {
        reason: 999,
        ..RequestReport::new(Stage::Refused, Reason::None)
    };
    assert_eq!(
        FinalReport::of(&report).unwrap().exit_code(),
        ExitCode::Refused
    );
    assert_eq!(
        line(Verb::Land, 0, 1, &report).unwrap(),
        "land: refused (999)"
    );
    let report = RequestReport {
        stage: 99,
        ..report
    };
    assert_eq!(FinalReport::of(&report), None);
    assert_eq!(line(Verb::Land, 0, 1, &report).unwrap(), "land: stage 99");
    let json = serde_json::to_value(ReportObject::new(Verb::Land, &report)).unwrap();
    assert_eq!((&json["stage"], &json["reason"]), (&99.into(), &999.into()));
}

#[test]
fn each_reason_is_explained_in_its_own_words() {
    for (index, reason) in Reason::ALL.iter().enumerate() {
        let text = explain(*reason);
        assert!(!text.is_empty() && !text.ends_with('.'), "{reason}");
        for other in &Reason::ALL[..index] {
            assert_ne!(text, explain(*other), "{reason} and {other}");
        }
    }
}

#[test]
fn an_ending_says_what_why_and_what_to_do() {
    let report = |stage, reason| RequestReport::new(stage, reason);
    for (verb, report, expected) in [
        (
            Verb::TakeOff,
            report(Stage::Refused, Reason::NotStarted),
            "takeoff was refused (not-started): the module takes no movement, because it was not started, was stopped, or ended with an \
             error that `ril status` shows: `ril start`",
        ),
        (
            Verb::GoTo,
            report(Stage::Aborted, Reason::Stopped),
            "goto was begun and ended early (stopped): the module was stopped",
        ),
        (
            Verb::Land,
            report(Stage::Unknown, Reason::BridgeGone),
            "land has an unknown outcome (bridge-gone): the bridge vanished: start it again and look at `ril status`",
        ),
        (
            Verb::Land,
            report(Stage::Refused, Reason::RelayLinkDown),
            "land was refused (relay-link-down): the link to the robot was down, so nothing was sent: `ril relay status` shows \
             the link, then send it again",
        ),
    ] {
        assert_eq!(end(verb, report), expected);
    }
}

fn end(verb: Verb, report: RequestReport) -> String {
    ending(verb, &FinalReport::of(&report).unwrap())
}

#[test]
fn an_ending_names_rule_place_amount_and_dsp_error() {
    let breach = RequestReport {
        rule: SafetyRule::FenceCeiling.code(),
        waypoint: 3,
        value: 4.2,
        value_valid: 1,
        ..RequestReport::new(Stage::Refused, Reason::FenceBreach)
    };
    assert_eq!(
        line(Verb::GoTo, 0, 1, &breach).unwrap(),
        "goto: refused (fence-breach: fence-ceiling, leg 3, by 4.2 m)"
    );
    let text = end(Verb::GoTo, breach);
    let expected =
        "goto was refused (fence-breach: fence-ceiling, leg 3, by 4.2 m): the geofence forbids it";
    assert!(text.starts_with(expected), "{text}");

    let refused = RequestReport {
        waypoint: 2,
        dsp_error_code: 30,
        dsp_error_valid: 1,
        ..RequestReport::new(Stage::Aborted, Reason::RefusedByDsp)
    };
    let text = end(Verb::GoTo, refused);
    let expected = "goto was begun and ended early (refused-by-dsp: waypoint 2, dsp-error-30 (invalid command)): ";
    assert!(text.starts_with(expected), "{text}");
    let json = serde_json::to_value(ReportObject::new(Verb::GoTo, &refused)).unwrap();
    let numbers = (&json["waypoint"], &json["dsp_error_code"]);
    assert_eq!(numbers, (&2.into(), &30.into()));
}

#[test]
fn a_take_off_says_how_high_it_is() {
    let done = |value| RequestReport {
        value,
        value_valid: 1,
        ..RequestReport::new(Stage::Done, Reason::None)
    };
    for (value, expected) in [
        (9.84, "takeoff: done, 9.8 m above take-off"),
        (f64::NAN, "takeoff: done"),
    ] {
        assert_eq!(line(Verb::TakeOff, 0, 1, &done(value)).unwrap(), expected);
    }
}

#[test]
fn a_port_s_reports_say_its_value_or_its_limits() {
    let port = PortInfo {
        min: 0.1,
        max: 20.0,
        number: 20_000,
        kind: PortKind::F32.code(),
        name: PortInfo::name_bytes("cruise_speed_mps"),
        ..PortInfo::default()
    };
    let report = |stage, reason| RequestReport {
        port,
        value: 5.5,
        value_valid: 1,
        ..RequestReport::new(stage, reason)
    };
    let done = report(Stage::Done, Reason::None);
    for verb in [Verb::GetParameter, Verb::SetParameter] {
        assert_eq!(line(verb, 0, 1, &done).unwrap(), "cruise_speed_mps = 5.5");
        let accepted = report(Stage::Accepted, Reason::None);
        assert_eq!(line(verb, 0, 1, &accepted), None);
    }
    assert_eq!(
        end(
            Verb::SetParameter,
            report(Stage::Refused, Reason::OutOfRange)
        ),
        "param set was refused (out-of-range): cruise_speed_mps takes 0.1 to 20"
    );
    assert!(
        end(
            Verb::SetParameter,
            RequestReport::new(Stage::Refused, Reason::OutOfRange)
        )
        .contains("`ril param list`")
    );
    // Of a port nothing is carried out but a write, and that one is asked for again by its value.
    for verb in [Verb::ListParameters, Verb::GetParameter, Verb::SetParameter] {
        let report = RequestReport::new(Stage::Unknown, Reason::NotRemembered);
        let text = end(verb, report);
        assert!(!text.contains("may have carried it out"), "{text}");
        let is_write = text.contains("whether the port was written is not known");
        assert_eq!(is_write, verb == Verb::SetParameter, "{text}");
        assert_ne!(is_write, text.contains("nothing was changed"), "{text}");
    }
}

#[test]
fn a_take_off_that_is_too_high_names_the_limit_of_the_dsp() {
    let refused = RequestReport::new(Stage::Refused, Reason::OutOfRange);
    assert_eq!(
        end(Verb::TakeOff, refused),
        "takeoff was refused (out-of-range): the DSP takes 0.5 to 200 m above take-off (port 20121)"
    );
    let of_path = end(Verb::GoTo, refused);
    assert!(of_path.contains("`[movement]`"), "{of_path}");
}

#[test]
fn a_waypoint_that_is_too_far_says_how_far_and_what_may_be_wrong() {
    for (distance_m, expected) in [
        (
            4_810_400.0,
            "goto was refused (too-far: waypoint 1, 4810 km away (limit 10.0 km)): no flight leads there: \
             are latitude and longitude swapped? Is it for another site?",
        ),
        (
            12_000.0,
            "goto was refused (too-far: waypoint 1, 12.0 km away (limit 10.0 km)): the waypoint is farther away than \
             `[movement] max_distance_m` of bridge.toml allows: fly there in two paths",
        ),
    ] {
        let mut refused = RequestReport {
            value: distance_m,
            value_valid: 1,
            waypoint: 1,
            ..RequestReport::new(Stage::Refused, Reason::TooFar)
        };
        refused.port.max = 10_000.0;
        assert_eq!(end(Verb::GoTo, refused), expected);
    }
}

/// Whatever was refused or ended, and by whichever rule: the next step is one that this order can take.
#[test]
fn the_next_step_follows_the_order_and_the_rule() {
    use Verb as V;
    let path = [V::GoTo, V::ReturnToHome];
    let on_the_spot = [V::Land, V::Hold];
    for verb in Verb::ALL {
        for stage in [Stage::Refused, Stage::Aborted] {
            for reason in Reason::ALL {
                for rule in [0].into_iter().chain(SafetyRule::ALL.map(SafetyRule::code)) {
                    let report = RequestReport {
                        rule,
                        ..RequestReport::new(stage, reason)
                    };
                    let text = end(verb, report);
                    let says = |words: &str| text.contains(words);
                    let is_everyones =
                        matches!(reason, Reason::NotInControl | Reason::ClockDiffers);
                    let is_below = rule == SafetyRule::BelowTakeOff.code();
                    assert!(
                        !says("--preempt") || path.contains(&verb) || verb == V::Land,
                        "{text}"
                    );
                    assert!(!says("`ril takeoff`") || path.contains(&verb), "{text}");
                    assert!(
                        !says("`ril start`") || !on_the_spot.contains(&verb),
                        "{text}"
                    );
                    assert!(
                        !says("`ril land`") || verb != V::Land || is_everyones,
                        "{text}"
                    );
                    assert!(
                        !says("[fence]") || !is_below || stage == Stage::Aborted,
                        "{text}"
                    );
                    let is_breach = reason == Reason::FenceBreach && stage == Stage::Refused;
                    let is_of_movement = !verb.is_about_a_port();
                    let is_asked = is_below && is_breach && is_of_movement;
                    assert_eq!(says("above take-off meant"), is_asked, "{text}");
                }
            }
        }
    }
    let refused = |verb, reason| end(verb, RequestReport::new(Stage::Refused, reason));
    assert_eq!(
        refused(V::Land, Reason::NotFlying),
        "land was refused (not-flying): the helicopter is on the ground"
    );
    assert_eq!(
        refused(V::Land, Reason::NotStarted),
        "land was refused (not-started): the helicopter is on the ground"
    );
    assert!(refused(V::GoTo, Reason::NotFlying).ends_with("`ril takeoff` comes first"));
    assert!(refused(V::TakeOff, Reason::SupplyLow).ends_with("charge or refuel"));
}

#[test]
fn people_read_what_goes_on() {
    let counted = |stage| RequestReport {
        waypoints_total: 3,
        waypoints_sent: 2,
        waypoints_reached: 1,
        ..RequestReport::new(stage, Reason::None)
    };
    let refused = RequestReport::new(Stage::Refused, Reason::TooFar);
    #[rustfmt::skip]
    let cases = [
        (Verb::Start, 0, counted(Stage::Done), Some("start: done")),
        (Verb::TakeOff, 0, counted(Stage::Accepted), Some("takeoff: accepted")),
        (Verb::TakeOff, 0, counted(Stage::Progress), Some("takeoff: begun on the DSP")),
        (Verb::GoTo, 0, counted(Stage::Accepted), None),
        (
            Verb::Land,
            0,
            RequestReport::new(Stage::Accepted, Reason::LinkDown),
            Some("land: accepted, and carried out as soon as the DSP is heard"),
        ),
        (Verb::GoTo, 0, counted(Stage::Done), None),
        (Verb::GoTo, 2, counted(Stage::Accepted), Some("goto: 3 waypoints accepted, the path is complete")),
        (Verb::GoTo, 2, counted(Stage::Progress), Some("goto: progress, 2 of 3 waypoints sent, 1 reached")),
        (Verb::GoTo, 2, counted(Stage::Done), Some("goto: done, 2 of 3 waypoints sent, 1 reached")),
        (Verb::GoTo, 1, refused, Some("goto: refused (too-far)")),
    ];
    for (verb, index, report, expected) in cases {
        let total = if verb == Verb::GoTo { 3 } else { 1 };
        assert_eq!(line(verb, index, total, &report).as_deref(), expected);
    }
}

#[test]
fn programs_read_names_in_one_object() {
    let report = RequestReport {
        request_id: 5,
        path_id: 6,
        reported_ns: 7,
        imi_error: 2,
        ..RequestReport::new(Stage::Refused, Reason::UnableToAbort)
    };
    let json = serde_json::to_string(&ReportObject::new(Verb::Stop, &report)).unwrap();
    assert_eq!(
        json,
        r#"{"schema":"hero.RequestReport.v3","request":"stop","request_id":5,"path_id":6,"reported_ns":7,"stage":"refused","reason":"unable-to-abort","imi_error":"impossible-to-stop-module","waypoints_total":0,"waypoints_sent":0,"waypoints_reached":0}"#
    );
}

#[test]
fn an_operator_who_leaves_reads_what_goes_on() {
    for verb in Verb::ALL {
        let can_be_stopped = matches!(verb, Verb::GoTo | Verb::ReturnToHome);
        assert_eq!(
            verb.goes_on().contains("`ril hold`"),
            can_be_stopped,
            "{}",
            verb.name()
        );
    }
}
