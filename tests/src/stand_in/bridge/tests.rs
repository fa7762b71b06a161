//! The stand-in answers as the test says, and else as a bridge does.

use ipc_types::Client;
use ipc_types::payload::WaypointPosition;

use super::*;
use crate::TestDomain;
use crate::process::WAIT_LIMIT;

/// Sends a take-off and follows its reports to the final one.
fn take_off(client: &mut Client<MovementData>, id: u64) -> Vec<(Stage, Reason)> {
    client
        .send(&MovementData::take_off(id, 10.0))
        .expect("sent");
    follow(client)
}

fn follow(client: &mut Client<MovementData>) -> Vec<(Stage, Reason)> {
    let mut words = Vec::new();
    while client.outstanding() > 0 {
        client.wait(WAIT_LIMIT).expect("a wait");
        client.drain(|report| {
            words.push((
                report.stage().expect("a stage"),
                report.reason().expect("a reason"),
            ));
        });
    }
    words
}

#[test]
fn requests_are_answered_as_told_and_then_as_usual() {
    use Stage::{Aborted, Accepted, Done, Progress, Refused};
    let domain = TestDomain::new();
    let bridge = StandInBridge::start(&domain);
    let ipc = domain.join("operator");
    let mut client = ipc.client::<MovementData>().expect("a client");
    let none = Reason::None;
    #[rustfmt::skip]
    let cases = [
        (Answer::refuse(Reason::NotStarted), vec![(Refused, Reason::NotStarted)]),
        (Answer::abort(Reason::DspRebooted), vec![(Accepted, none), (Aborted, Reason::DspRebooted)]),
        (progress(2), vec![(Accepted, none), (Progress, none), (Progress, none), (Progress, none), (Done, none)]),
    ];
    for (answer, words) in cases {
        bridge.answer_next(answer);
        assert_eq!(take_off(&mut client, 7), words);
        let Received::Movement(request) = bridge.next_request() else {
            panic!("no movement");
        };
        let expected = MovementData {
            issued_ns: request.issued_ns,
            ..MovementData::take_off(7, 10.0)
        };
        assert_eq!(request, expected);
    }
    assert_eq!(take_off(&mut client, 8), [(Accepted, none), (Done, none)]);
}

#[test]
fn a_request_that_hangs_can_be_answered_later() {
    let domain = TestDomain::new();
    let bridge = StandInBridge::start(&domain);
    let ipc = domain.join("operator");
    let mut client = ipc.client::<MovementData>().expect("a client");
    bridge.answer_next(Answer::Hang);
    client.send(&MovementData::land(5)).expect("sent");
    bridge.next_request();
    assert_eq!(client.drain(|report| panic!("unasked: {report:?}")), 0);
    let done = RequestReport::new(Stage::Done, Reason::None);
    assert_eq!(bridge.report(5, &done), Ok(()));
    assert_eq!(follow(&mut client), [(Stage::Done, Reason::None)]);
    assert_eq!(bridge.report(5, &done), Err(ReportError::NotOpen));
}

fn reports(client: &mut Client<MovementData>, count: usize) -> Vec<(u64, Stage, Reason)> {
    let mut seen = Vec::new();
    while seen.len() < count {
        client.wait(WAIT_LIMIT).expect("a wait");
        client.drain(|report| {
            seen.push((
                report.request_id,
                report.stage().expect("a stage"),
                report.reason().expect("a reason"),
            ));
        });
    }
    seen
}

const HERE: WaypointPosition = WaypointPosition {
    latitude_deg: 37.0,
    longitude_deg: -6.0,
    altitude_m: 20.0,
};

#[test]
fn a_waypoint_is_done_when_the_next_one_is_accepted_and_broken_when_it_is_refused() {
    use Stage::{Aborted, Accepted, Done, Refused};
    let domain = TestDomain::new();
    let bridge = StandInBridge::start(&domain);
    let ipc = domain.join("operator");
    let mut client = ipc.client::<MovementData>().expect("a client");
    let waypoint = |id, path, first, last| MovementData::waypoint(id, path, HERE, first, last);
    let none = Reason::None;
    client.send(&waypoint(1, 7, true, false)).expect("sent");
    assert_eq!(reports(&mut client, 1), [(1, Accepted, none)]);
    client.send(&waypoint(2, 7, false, true)).expect("sent");
    let mut seen = reports(&mut client, 3);
    seen.sort_by_key(|(id, ..)| *id);
    assert_eq!(
        seen,
        [(1, Done, none), (2, Accepted, none), (2, Done, none)]
    );

    client.send(&waypoint(3, 8, true, false)).expect("sent");
    assert_eq!(reports(&mut client, 1), [(3, Accepted, none)]);
    bridge.answer_next(Answer::refuse(Reason::TooFar));
    client.send(&waypoint(4, 8, false, true)).expect("sent");
    let mut seen = reports(&mut client, 2);
    seen.sort_by_key(|(id, ..)| *id);
    assert_eq!(
        seen,
        [
            (3, Aborted, Reason::PathBroken),
            (4, Refused, Reason::TooFar)
        ]
    );
}

#[test]
fn a_path_under_way_is_replaced_only_by_what_may_pre_empt_it() {
    use Stage::{Aborted, Accepted, Done, Refused};
    let domain = TestDomain::new();
    let bridge = StandInBridge::start(&domain);
    let ipc = domain.join("operator");
    let mut client = ipc.client::<MovementData>().expect("a client");
    let none = Reason::None;
    for (id, next) in [
        (10, MovementData::hold(11)),
        (20, MovementData::land(21).preempting()),
    ] {
        bridge.answer_next(Answer::under_way());
        let path = MovementData::waypoint(id, id, HERE, true, true);
        client.send(&path).expect("sent");
        assert_eq!(reports(&mut client, 1), [(id, Accepted, none)]);
        client.send(&MovementData::land(5)).expect("sent");
        assert_eq!(reports(&mut client, 1), [(5, Refused, Reason::Busy)]);
        client.send(&next).expect("sent");
        let mut seen = reports(&mut client, 3);
        seen.sort_by_key(|(id, ..)| *id);
        assert_eq!(
            seen,
            [
                (id, Aborted, Reason::Replaced),
                (id + 1, Accepted, none),
                (id + 1, Done, none)
            ]
        );
    }
    // At rest nothing is in the way.
    assert_eq!(take_off(&mut client, 30), [(Accepted, none), (Done, none)]);
}

#[test]
fn parameters_are_those_of_the_table() {
    let domain = TestDomain::new();
    let bridge = StandInBridge::start(&domain);
    let ipc = domain.join("operator");
    let mut client = ipc.client::<ParameterRequest>().expect("a client");
    let mut ask = |request: ParameterRequest| {
        client.send(&request).expect("sent");
        let mut last = RequestReport::default();
        while client.outstanding() > 0 {
            client.wait(WAIT_LIMIT).expect("a wait");
            client.drain(|report| last = *report);
        }
        assert_eq!(bridge.next_request(), Received::Parameter(request));
        last
    };
    let number = dsp_protocol::port::CRUISE_SPEED_MPS;
    assert_eq!(ask(ParameterRequest::read(1, number)).value(), Some(5.0));
    let trim = dsp_protocol::port::TRIM_TAIL_US;
    let done = ask(ParameterRequest::write(2, trim, -3.0));
    assert_eq!(done.value(), Some(-3.0));
    bridge.publish(&DspTelemetry {
        flying: 1,
        ..DspTelemetry::default()
    });
    let refused = ask(ParameterRequest::write(3, trim, 4.0));
    assert_eq!(refused.reason(), Some(Reason::NotInFlight));
    assert_eq!(bridge.port(trim).map(|port| port.value), Some(-3.0));
}
