//! The DSP's parameters: list, read and write.
//!
//! Most tests run against a stand-in for the bridge. Those whose name begins with `the_real_bridge` run the real
//! processes.

use crate::common::{Flight, end, json, sandbox, says};
use crate::watch::screen::on_terminal;
use dsp_protocol::port;
use ipc_types::code::{LinkState, ParameterOperation, Reason};
use ipc_types::payload::ParameterRequest;
use ril_tests::process::Signal;
use ril_tests::{Answer, Received, StandInBridge, StandInPort};

fn parameter(received: Received) -> ParameterRequest {
    match received {
        Received::Parameter(request) => request,
        other => panic!("a parameter was expected: {other:?}"),
    }
}

fn next(bridge: &StandInBridge) -> ParameterRequest {
    parameter(bridge.next_request())
}

#[test]
fn parameters_are_listed_with_who_may_write_them() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let finished = rig.run("param list", 0);
    let row = |name: &str| {
        let mut rows = finished.stdout.iter();
        let row = rows.find(|row| row.contains(name));
        let row = row.unwrap_or_else(|| panic!("{name}: {finished:#?}"));
        row.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(row("NAME"), "NUMBER NAME VALUE UNIT KIND RANGE WRITABLE");
    assert_eq!(
        row("cruise_speed_mps"),
        "20000 cruise_speed_mps 5 m/s f32 0.1 to 20 yes"
    );
    assert_eq!(
        row("trim_tail_us"),
        "10203 trim_tail_us 0 µs i16 -500 to 500 on the ground"
    );
    assert_eq!(row("take_off "), "10121 take_off 0 - u16 1 to 1 no");
    assert_eq!(
        finished.stdout.len(),
        1 + port::PORTS_16.len() + port::PORTS_32.len()
    );

    let lines = rig.run("param list --json", 0).stdout;
    assert_eq!(lines.len(), finished.stdout.len() - 1);
    let of = |name: &str| {
        let mut reports = lines.iter().map(|line| json(line));
        reports
            .find(|report| report["port"]["name"] == name)
            .unwrap_or_else(|| panic!("{name}: {lines:#?}"))
    };
    let gain = of("position_gain");
    assert_eq!(gain["schema"], "hero.RequestReport.v3");
    assert_eq!(gain["request"], "param list");
    let expected = serde_json::json!({
        "number": 20_010, "name": "position_gain", "kind": "f32", "min": 0.05, "max": 5.0,
        "writable": true, "writable_in_flight": false,
    });
    assert_eq!(gain["port"], expected);
    assert_eq!(gain["value"], 0.8);
    let without = rig.run("param list --no-values --json", 0).stdout;
    assert!(json(&without[0]).get("value").is_none(), "{without:#?}");
    drop(bridge);
}

#[test]
fn a_parameter_is_read_and_written_by_name_and_by_number() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    assert_eq!(rig.run("param get yaw_gain", 0).stdout, ["yaw_gain = 1.5"]);
    assert_eq!(next(&bridge).port, u32::from(port::YAW_GAIN));
    for (name, value, number, previous) in [
        ("yaw_gain", "0.7", port::YAW_GAIN, "1.5"),
        ("20013", "0.8", port::YAW_GAIN, "0.7"),
        ("trim_tail_us", "-40", port::TRIM_TAIL_US, "0"),
    ] {
        let finished = rig.run(&format!("param set {name} {value} --deadline 70ms"), 0);
        // No other request comes before them, and both are of the moment of the command line.
        let read = next(&bridge);
        assert_eq!(read.operation(), Some(ParameterOperation::Read));
        let request = next(&bridge);
        assert_eq!(request.operation(), Some(ParameterOperation::Write));
        let within_ns = request.begin_by_ns - request.issued_ns;
        assert_eq!((request.port, within_ns), (number.into(), 70_000_000));
        assert_eq!(
            (read.issued_ns, read.begin_by_ns),
            (request.issued_ns, request.begin_by_ns)
        );
        let written = bridge.port(number).unwrap();
        assert_eq!(
            finished.stdout,
            [format!("{} = {value} (was {previous})", written.name)],
            "{name}"
        );
        assert_eq!(written.value as f32, value.parse::<f32>().unwrap());
    }
    let report = json(&rig.run("param get trim_tail_us --json", 0).stdout[0]);
    assert_eq!(
        (&report["value"], &report["port"]["name"]),
        (&(-40.0).into(), &"trim_tail_us".into())
    );
}

#[test]
fn a_parameter_that_cannot_be_set_is_refused_with_the_reason() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.set_port(StandInPort {
        refuses_with: Some(30),
        ..bridge.port(port::YAW_GAIN).unwrap()
    });
    bridge.publish(&ipc_types::payload::DspTelemetry {
        flying: 1,
        ..Default::default()
    });
    bridge.set_port(StandInPort {
        writable_in_flight: true,
        ..bridge.port(port::YAW_GAIN).unwrap()
    });
    #[rustfmt::skip]
    let cases = [
        ("set yaw_gian 1", 2, "no parameter has the name `yaw_gian`; did you mean `yaw_gain`?"),
        ("get zzz", 2, "`ril param list` shows all names"),
        ("get 9999", 5, "refused (no-such-port): the port does not exist"),
        ("set take_off 1", 5, "refused (no-such-port)"),
        ("set cruise_speed_mps 21", 5, "refused (out-of-range): cruise_speed_mps takes 0.1 to 20"),
        ("set status_period_ms 20.5", 5, "status_period_ms takes whole numbers from 1 to 10000"),
        ("set trim_tail_us 4", 5, "refused (not-in-flight): the port may not be written while the helicopter flies"),
        ("set yaw_gain 1", 5, "refused (refused-by-dsp: dsp-error-30 (invalid command)): the DSP did not take the value"),
    ];
    for (args, code, expected) in cases {
        rig.run(&format!("param {args}"), code).err_says(expected);
    }
    bridge.answer_next(Answer::refuse(Reason::LinkDown));
    rig.run("param get 20013", 6);
    bridge.answer_next(Answer::Hang);
    rig.run("param get 20013 --timeout 100ms", 4);
}

#[test]
fn the_real_bridge_serves_the_dsp_s_parameters() {
    let rig = sandbox();
    let sim = rig.sim(1, "--speed 10");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let listed = on_terminal(&rig, "param list", 0);
    assert!(says(&listed, "cruise_speed_mps"), "{listed:#?}");
    for (args, expected) in [
        ("set cruise_speed_mps 7.5", "cruise_speed_mps = 7.5 (was 5)"),
        ("get cruise_speed_mps", "cruise_speed_mps = 7.5"),
        ("set trim_tail_us -40", "trim_tail_us = -40 (was 0)"),
        ("get 10203", "trim_tail_us = -40"),
    ] {
        assert_eq!(rig.run(&format!("param {args}"), 0).stdout, [expected]);
    }
    let set = rig.run("param set cruise_speed_mps 5 --json", 0).stdout;
    let last = json(set.last().unwrap());
    assert_eq!(
        (&last["value"], &last["previous_value"]),
        (&5.0.into(), &7.5.into())
    );
    for (args, reason) in [
        ("set cruise_speed_mps 21", "out-of-range"),
        ("set 10121 1", "no-such-port"),
        ("get 9999", "no-such-port"),
    ] {
        rig.run(&format!("param {args}"), 5)
            .err_says(format!("refused ({reason})"));
    }
    // Without a link there are no values.
    end(sim, Signal::INT);
    rig.watch(1).until("the port is gone", |state| {
        state.link.state() == Some(LinkState::Gone)
    });
    let finished = rig.run("param list", 6);
    assert_eq!(finished.stdout.len(), listed.len(), "{finished:#?}");
    finished.err_says("the values could not be read");
    let finished = rig.run("param list --no-values --json", 0);
    assert_eq!(finished.stdout.len(), listed.len() - 1);
    end(bridge, Signal::INT);
    rig.run("param list", 3);

    let flight = Flight::begin(&rig);
    rig.run("param set trim_tail_us 10", 5)
        .err_says("not-in-flight");
    rig.run("param set cruise_speed_mps 6", 0);
    flight.end();
}
