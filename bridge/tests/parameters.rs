//! The DSP's virtual ports at run time (requirement C8).

use crate::rig::{Rig, aborted, refused};
use bridge::outputs::Notice;
use bridge::{BridgeConfig, Input};
use dsp_protocol::port::{self, PORTS_16, PORTS_32};
use dsp_protocol::{Command, DspErrorCode};
use ipc_types::code::{LinkState, PortKind, Reason, Stage};
use ipc_types::payload::{ParameterRequest, PortInfo};

#[test]
fn a_port_is_read_and_written_and_the_dsp_s_value_reported() {
    let mut rig = Rig::started();
    let write = rig.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 7.5));
    assert_eq!(rig.stages(write), [Stage::Accepted, Stage::Done]);
    assert_eq!(rig.last_report(write).value(), Some(7.5));
    let read = rig.parameter(ParameterRequest::read(0, port::CRUISE_SPEED_MPS));
    let report = rig.last_report(read);
    assert_eq!(report.value(), Some(7.5));
    assert_eq!(report.port.name(), Some("cruise_speed_mps"));
    let trim = rig.parameter(ParameterRequest::write(0, port::TRIM_ROLL_US, -20.0));
    assert_eq!(rig.last_report(trim).value(), Some(-20.0));
    let read_only = rig.parameter(ParameterRequest::read(0, port::TAKE_OFF));
    assert_eq!(rig.last(read_only).0, Stage::Done, "any port can be read");
}

#[test]
fn all_ports_are_listed_with_kind_range_and_access() {
    let mut rig = Rig::started();
    let count = (PORTS_16.len() + PORTS_32.len()) as u32;
    let infos: Vec<PortInfo> = (0..count)
        .map(|index| {
            let request = rig.parameter(ParameterRequest::list(0, index));
            assert_eq!(rig.last(request).0, Stage::Done);
            rig.last_report(request).port
        })
        .collect();
    assert!(infos.iter().all(|info| info.count == count));
    let by_number = |number: u16| {
        let mut infos = infos.iter();
        infos.find(|info| info.number == u32::from(number)).unwrap()
    };
    let trim = by_number(port::TRIM_TAIL_US);
    assert_eq!(trim.kind(), Some(PortKind::I16));
    assert_eq!((trim.min, trim.max), (-500.0, 500.0));
    assert_eq!(trim.access, PortInfo::WRITABLE);
    let speed = by_number(port::CRUISE_SPEED_MPS);
    assert_eq!(speed.kind(), Some(PortKind::F32));
    assert_eq!(
        speed.access,
        PortInfo::WRITABLE | PortInfo::WRITABLE_IN_FLIGHT
    );
    assert_eq!(by_number(port::LAND).access, 0);
    let beyond = rig.parameter(ParameterRequest::list(0, count));
    assert_eq!(rig.last(beyond), refused(Reason::NoSuchPort));
}

#[test]
fn what_is_refused_and_why() {
    let write = ParameterRequest::write;
    #[rustfmt::skip]
    let table = [
        (write(0, 9, 1.0), Reason::NoSuchPort),
        (ParameterRequest { port: 70_000, ..write(0, 0, 1.0) }, Reason::NoSuchPort),
        (write(0, port::TAKE_OFF, 1.0), Reason::NoSuchPort),
        (write(0, port::STATUS_MASK, 1.0), Reason::NoSuchPort),
        (write(0, port::CRUISE_SPEED_MPS, 50.0), Reason::OutOfRange),
        (write(0, port::CRUISE_SPEED_MPS, f64::NAN), Reason::NotFinite),
        (write(0, port::STATUS_PERIOD_MS, 20.5), Reason::OutOfRange),
        (write(0, port::STATUS_PERIOD_MS, 1e300), Reason::OutOfRange),
        (write(0, port::TRIM_ROLL_US, -501.0), Reason::OutOfRange),
        (ParameterRequest { operation: 9, ..write(0, port::CRUISE_SPEED_MPS, 1.0) }, Reason::InvalidRequest),
    ];
    let mut rig = Rig::started();
    let sent = rig.dsp.commands.len();
    for (request, reason) in table {
        let request = rig.parameter(request);
        assert_eq!(rig.last(request), refused(reason));
        let port = rig.last_report(request).port;
        assert_eq!(port.kind().is_some(), reason == Reason::OutOfRange);
    }
    assert_eq!(rig.dsp.commands.len(), sent, "nothing goes to the DSP");

    let mut rig = Rig::flying();
    let gain = rig.parameter(write(0, port::YAW_GAIN, 1.0));
    assert_eq!(rig.last(gain), refused(Reason::NotInFlight));
    let speed = rig.parameter(write(0, port::CRUISE_SPEED_MPS, 3.0));
    assert_eq!(rig.last(speed).0, Stage::Done);
    rig.apply(Input::PortClosed);
    let speed = rig.parameter(write(0, port::CRUISE_SPEED_MPS, 3.0));
    assert_eq!(rig.last(speed), refused(Reason::LinkDown));
}

#[test]
fn a_value_that_the_dsp_refuses_is_reported_with_its_own() {
    let mut rig = Rig::started();
    rig.dsp.ports_32.insert(port::CRUISE_SPEED_MPS, 5.0);
    rig.dsp.refuses = Some(port::CRUISE_SPEED_MPS);
    let write = rig.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 7.5));
    assert_eq!(rig.last(write), aborted(Reason::RefusedByDsp));
    let report = rig.last_report(write);
    let invalid = u32::from(DspErrorCode::INVALID_COMMAND.0);
    assert_eq!(
        (report.value(), report.dsp_error()),
        (Some(5.0), Some(invalid))
    );
}

#[test]
fn what_was_written_is_written_again_after_a_reboot_of_the_dsp() {
    let mut rig = Rig::started();
    for value in [6.0, 7.5] {
        rig.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, value));
    }
    rig.run(3000);
    rig.dsp.reboot();
    rig.run(6000);
    assert_eq!(rig.link(), LinkState::Up);
    assert_eq!(rig.bridge.state().link.dsp_boots, 1);
    assert_eq!(rig.dsp.ports_32[&port::CRUISE_SPEED_MPS], 7.5);
}

#[test]
fn a_parameter_of_the_configuration_that_the_dsp_refuses_is_told_by_name() {
    let text = "[parameters]\ncruise_speed_mps = 8.0\ntrim_roll_us = -3\n";
    let config: BridgeConfig = runtime::config::parse(text, "test.toml").unwrap();
    for refuses in [None, Some(port::CRUISE_SPEED_MPS), Some(port::TRIM_ROLL_US)] {
        let mut rig = Rig::closed(&config);
        rig.dsp.refuses = refuses;
        rig.open();
        assert_eq!(rig.link(), LinkState::Up);
        let notices = rig.out.notices.iter();
        let notices: Vec<_> = notices
            .filter_map(|notice| match notice {
                Notice::ParameterRefused { written, .. } => Some(match *written {
                    Command::Write16 { port, .. } | Command::Write32 { port, .. } => port,
                    _ => 0,
                }),
                _ => None,
            })
            .collect();
        assert_eq!(notices, Vec::from_iter(refuses));
    }
}

#[test]
fn requests_wait_for_one_another_and_the_bound_is_stated() {
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    let read = || ParameterRequest::read(0, port::CRUISE_SPEED_MPS);
    let open: Vec<u64> = (0..bridge::flight::parameters::MAX_OPEN)
        .map(|_| rig.parameter(read()))
        .collect();
    let one_more = rig.parameter(read());
    assert_eq!(rig.last(one_more), refused(Reason::TooManyRequests));
    rig.dsp.acknowledges = true;
    rig.run(500);
    for request in open {
        assert_eq!(rig.last(request).0, Stage::Done);
    }
}

#[test]
fn a_write_that_is_not_acknowledged_has_an_unknown_outcome() {
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    let write = rig.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 7.5));
    let read = rig.parameter(ParameterRequest::read(0, port::CRUISE_SPEED_MPS));
    rig.run(1500);
    assert_eq!(rig.last(write).0, Stage::Unknown);
    assert_eq!(rig.last(read).0, Stage::Aborted);
}

/// What requests are told that get no answer: the first is with the DSP, the others wait behind it.
#[test]
fn a_request_without_an_answer_ends_as_far_as_it_may_have_come() {
    type End = fn(&mut Rig);
    let moment: End = |rig| rig.run(100);
    let closed: End = |rig| rig.apply(Input::PortClosed);
    let ending: End = |rig| rig.apply(Input::Close);
    let write = || ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 7.5);
    let read = || ParameterRequest::read(0, port::CRUISE_SPEED_MPS);
    for (end, reason) in [
        (moment, Reason::TooLate),
        (closed, Reason::CommunicationFatalError),
        (ending, Reason::BridgeEnding),
    ] {
        for (requests, stages) in [
            (
                [write(), read(), write()],
                [Stage::Unknown, Stage::Aborted, Stage::Aborted],
            ),
            ([read(), write(), read()], [Stage::Aborted; 3]),
        ] {
            let mut rig = Rig::started();
            rig.dsp.acknowledges = false;
            let begin_by_ns = rig.now.0 + 50_000_000;
            let ids = requests.map(|request| {
                rig.parameter(ParameterRequest {
                    begin_by_ns,
                    ..request
                })
            });
            let asked = rig.dsp.asked().len();
            end(&mut rig);
            for (id, stage) in ids.into_iter().zip(stages) {
                let report = rig.last_report(id);
                assert_eq!(
                    (report.stage(), report.reason()),
                    (Some(stage), Some(reason))
                );
                assert_eq!(report.value().is_some(), reason == Reason::TooLate);
            }
            rig.dsp.acknowledges = true;
            rig.run(1_000);
            let later = &rig.dsp.asked()[asked..];
            let writes = |it: &&Command| matches!(it, Command::Write32 { .. });
            assert_eq!(later.iter().find(writes), None, "nothing goes out later");
        }
    }
}

/// The first waits for the DSP, the second for the first. A bridge that stood still finds the answer and the moment at
/// once.
#[test]
fn a_write_whose_moment_passes_while_it_waits_for_another_request_is_never_sent() {
    for stood_still in [false, true] {
        let mut rig = Rig::started();
        rig.dsp.acknowledges = false;
        rig.parameter(ParameterRequest::read(0, port::CRUISE_SPEED_MPS));
        let write = rig.parameter(ParameterRequest {
            begin_by_ns: rig.now.0 + 50_000_000,
            ..ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 7.5)
        });
        if stood_still {
            rig.now = rig.now + std::time::Duration::from_millis(100);
        } else {
            rig.run(60);
            assert_eq!(rig.last(write), aborted(Reason::TooLate));
        }
        rig.answer_last();
        rig.dsp.acknowledges = true;
        rig.run(1_000);
        assert_eq!(rig.last(write), aborted(Reason::TooLate));
        let writes = |it: &&Command| {
            **it == Command::Write32 {
                port: port::CRUISE_SPEED_MPS,
                value: 7.5,
            }
        };
        assert_eq!(rig.dsp.asked().iter().find(writes), None);
    }
}

#[test]
fn a_write_whose_moment_passes_between_it_and_the_reading_back_is_unknown() {
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    let write = rig.parameter(ParameterRequest {
        begin_by_ns: rig.now.0 + 50_000_000,
        ..ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 7.5)
    });
    rig.answer_last();
    rig.run(100);
    assert_eq!(rig.last(write).0, Stage::Unknown);
}
