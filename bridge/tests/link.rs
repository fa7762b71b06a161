//! The core's side of the link: start-up, liveness, reboots, errors, telemetry.

use std::time::Duration;

use crate::rig::{Rig, north};
use bridge::link::coherence::Rule;
use bridge::link::line::Line;
use bridge::link::outgoing::CAPACITY;
use bridge::{BridgeConfig, Input};
use dsp_protocol::downlink::Attitude;
use dsp_protocol::{Command, Downlink, FlowControl, Profile, Sequence, Status, Uplink, port};
use ipc_types::code::{
    ControlCommand, DspPathState, Functionality, ImiError, LinkState, ModuleStatus, Reason, Stage,
};
use ipc_types::payload::ParameterRequest;

const MASK: Command = Command::Write16 {
    port: port::STATUS_MASK,
    value: 0xFFFF,
};
const PROBE: Command = Command::Read16 {
    port: port::STATUS_MASK,
};
const START_UP: [Command; 7] = [
    MASK,
    Command::Write16 {
        port: port::PC_TIMEOUT_MS,
        value: 2000,
    },
    Command::Read16 {
        port: port::PC_TIMEOUT_MS,
    },
    Command::ActivateStatus,
    Command::ClearErrors,
    Command::InvalidatePath,
    Command::Following { on: true },
];

fn config(text: &str) -> BridgeConfig {
    runtime::config::parse(text, "test.toml").unwrap()
}

#[test]
fn start_up_is_mask_activate_clear_invalidate_follow_and_the_parameters() {
    let config = config("[parameters]\ncruise_speed_mps = 8.0\ntrim_tail_us = -3\n");
    let rig = Rig::up(&config);
    let mut expected = START_UP.to_vec();
    // Each parameter is read back: the DSP may refuse it.
    expected.extend([
        Command::Write16 {
            port: 10_203,
            value: 0xFFFD,
        },
        Command::Read16 { port: 10_203 },
        Command::Write32 {
            port: port::CRUISE_SPEED_MPS,
            value: 8.0,
        },
        Command::Read32 {
            port: port::CRUISE_SPEED_MPS,
        },
    ]);
    assert_eq!(rig.dsp.commands, expected);
    let rig = Rig::up(&self::config("[link]\npc_timeout_ms = 0\n"));
    assert_eq!(rig.dsp.commands, [&START_UP[..1], &START_UP[3..]].concat());
}

/// Whatever waits has a deadline; the next state is far.
#[test]
fn a_command_that_waits_for_its_acknowledgement_has_a_deadline() {
    let mut rig = Rig::started();
    let states = rig.out.states.len();
    while rig.out.states.len() == states {
        rig.run(10);
    }
    rig.dsp.acknowledges = false;
    rig.parameter(ParameterRequest::read(0, port::CRUISE_SPEED_MPS));
    let ack_timeout = BridgeConfig::default().link.ack_timeout();
    assert_eq!(rig.bridge.deadline(), rig.now + ack_timeout);
    rig.dsp.acknowledges = true;
    rig.answer_last();
    rig.dsp.acknowledges = true;
    rig.dsp.obeys = false;
    rig.take_off();
    let look = Duration::from_millis(250);
    assert_eq!(rig.bridge.deadline(), rig.now + look);
}

#[test]
fn each_start_up_command_waits_for_the_ack_of_the_one_before() {
    let mut rig = Rig::closed(&BridgeConfig::default());
    rig.dsp.acknowledges = false;
    rig.apply(Input::PortOpened(Default::default()));
    rig.exchange();
    for (index, command) in START_UP.iter().enumerate() {
        assert_eq!(rig.dsp.commands, START_UP[..=index]);
        assert_eq!(rig.link(), LinkState::Connecting);
        rig.say(match command {
            Command::Read16 { .. } => Downlink::Ack16 {
                command: 0,
                value: 2000,
            },
            _ => Downlink::Ack {
                command: command.code(),
            },
        });
        rig.exchange();
    }
    assert_eq!(rig.link(), LinkState::Up);
}

#[test]
fn a_dsp_that_does_not_answer_is_tried_for_ever_and_blamed_for_nothing() {
    let mut rig = Rig::closed(&BridgeConfig::default());
    rig.dsp.silent = true;
    rig.open();
    rig.run(60_000);
    assert_eq!(rig.link(), LinkState::Connecting);
    assert_eq!(rig.module(), ModuleStatus::WaitingDataToStart);
    // The first start-up sends its first command three times.
    let mut retries = rig.dsp.commands[3..].chunks_exact(2);
    assert!(retries.all(|two| two == [Command::InvalidatePath, MASK]));
    let tries = rig.dsp.commands.len();
    assert!(
        (64..=72).contains(&tries),
        "one each 0.9 s, after some quicker ones: {tries}"
    );
    rig.dsp.silent = false;
    rig.run(2000);
    assert_eq!(rig.link(), LinkState::Up);
}

#[test]
fn silence_is_noticed_probed_and_survived() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(5)]);
    rig.run(300);
    rig.dsp.commands.clear();
    rig.dsp.silent = true;
    rig.run(1350);
    assert_eq!(rig.link(), LinkState::Silent);
    let asked = rig.dsp.asked();
    assert!(!asked.is_empty() && asked.iter().all(|command| *command == PROBE));
    rig.dsp.silent = false;
    rig.run(300);
    assert_eq!(rig.link(), LinkState::Up);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    rig.dsp.at(north(5));
    rig.run(40);
    assert_eq!(rig.last(path[0]).0, Stage::Done);
    // Something else has come: the probe may stay without an answer.
    rig.dsp.silent = true;
    rig.run(1350);
    assert_eq!(rig.link(), LinkState::Silent);
    (rig.dsp.silent, rig.dsp.acknowledges) = (false, false);
    rig.run(500);
    assert_eq!(rig.link(), LinkState::Up);
    assert!(!rig.dsp.asked().contains(&Command::ActivateStatus));
}

#[test]
fn a_dsp_that_stays_silent_is_lost_and_the_movement_has_an_outcome() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(5), north(9)]);
    rig.run(300);
    rig.dsp.silent = true;
    rig.run(2000);
    assert_eq!(rig.link(), LinkState::Connecting);
    let unknown = (
        Stage::Unknown,
        Reason::CommunicationFatalError,
        ImiError::CommunicationFatalError,
    );
    assert_eq!(rig.last(path[1]), unknown);
    assert_eq!(rig.module(), ModuleStatus::Aborted);
    rig.dsp.silent = false;
    rig.dsp.commands.clear();
    rig.run(2000);
    assert_eq!(rig.link(), LinkState::Up);
    assert!(
        rig.dsp.commands.ends_with(&START_UP),
        "{:?}",
        rig.dsp.commands
    );
}

/// The start-up would keep its time-out for the PC from passing.
#[test]
fn a_dsp_that_hears_and_is_not_heard_flies_no_further() {
    for later_ms in (0..1400).step_by(70) {
        let mut rig = Rig::flying();
        let path: Vec<_> = (1..9).map(|step| north(40 * step)).collect();
        rig.path(1, &path);
        rig.run(1000 + later_ms);
        assert!(rig.dsp.held.len() > 4);
        rig.dsp.silent = true;
        rig.run(4000);
        assert_eq!(rig.link(), LinkState::Connecting);
        assert!(rig.dsp.held.is_empty(), "{later_ms} ms later");
    }
}

#[test]
fn a_dsp_that_lost_its_mask_has_rebooted() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(5)]);
    rig.run(300);
    rig.dsp.silent = true;
    rig.run(1000);
    rig.dsp.reboot();
    rig.dsp.commands.clear();
    rig.dsp.silent = false;
    // Late answers to the unanswered probes could be meant, so one answer proves nothing.
    rig.run(3000);
    let start_up = rig.dsp.commands.windows(START_UP.len());
    assert_eq!(start_up.filter(|commands| *commands == START_UP).count(), 1);
    assert_eq!(
        rig.last(path[0]),
        (
            Stage::Aborted,
            Reason::DspRebooted,
            ImiError::HeroDspFatalError
        )
    );
    assert_eq!(rig.bridge.state().link.dsp_boots, 1);
    assert_eq!(rig.link(), LinkState::Up);
}

#[test]
fn a_clock_that_restarts_is_a_reboot() {
    let mut rig = Rig::started();
    rig.run(5000);
    rig.dsp.commands.clear();
    rig.dsp.time_ms = 0;
    rig.run(100);
    assert_eq!(rig.dsp.commands, START_UP);
    assert_eq!(rig.bridge.state().link.dsp_boots, 1);
    assert_eq!(
        rig.module(),
        ModuleStatus::Running,
        "at rest a reboot costs nothing"
    );
    assert_eq!(rig.out.telemetry.last().unwrap().dsp_boots, 1);
}

#[test]
fn a_dsp_that_only_answers_probes_is_started_again() {
    let mut rig = Rig::up(&config("[status]\ngroups = []\n"));
    assert_eq!(rig.dsp.mask, 0, "the mask says nothing about a reboot here");
    rig.dsp.commands.clear();
    // The scripted DSP sends no status with an empty mask; it answers, but grants nothing.
    for _ in 0..300 {
        rig.now = ipc_types::MonotonicNs(rig.now.0 + 10_000_000);
        rig.apply(Input::Advance);
        rig.exchange();
    }
    assert_eq!(rig.dsp.commands[..2], [PROBE, PROBE]);
    assert_eq!(rig.dsp.commands[5], Command::ActivateStatus);
}

#[test]
fn a_dsp_that_stops_its_status_alone_is_told_to_send_it_and_the_movement_goes_on() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(5)]);
    rig.run(300);
    rig.dsp.commands.clear();
    rig.dsp.sends_status = false;
    rig.run(1500);
    assert_eq!(rig.dsp.asked(), [], "not at once");
    rig.run(600);
    assert_eq!(rig.dsp.asked(), [PROBE, Command::ActivateStatus]);
    let samples = rig.out.telemetry.len();
    rig.dsp.at(north(5));
    rig.dsp.commands.clear();
    rig.run(3000);
    assert!(rig.out.telemetry.len() > samples + 100);
    assert_eq!(
        rig.dsp.asked(),
        [Command::InvalidatePath],
        "it is asked once; the path ends"
    );
    assert_eq!(rig.last(path[0]).0, Stage::Done);
}

#[test]
fn a_slow_status_is_waited_for() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.dsp.status_period_ms = 5000;
    rig.run(30_000);
    rig.dsp.commands.clear();
    rig.run(30_000);
    assert_eq!(rig.dsp.asked(), []);
    rig.dsp.sends_status = false;
    // Twice three periods of 5 s after the last one.
    rig.run(29_000);
    assert_eq!(rig.dsp.asked(), []);
    rig.run(2_000);
    assert_eq!(rig.dsp.asked(), [PROBE, Command::ActivateStatus]);
}

#[test]
fn a_mask_that_changes_on_the_dsp_is_written_again_and_nothing_ends() {
    for mask in [0b11, 0b10, 0] {
        let mut rig = Rig::flying();
        let path = rig.path(1, &[north(5)]);
        rig.run(300);
        rig.dsp.mask = mask;
        rig.dsp.commands.clear();
        for _ in 0..30 {
            rig.run(20);
            let mut status = rig.dsp.status;
            status.time_ms = Some(rig.dsp.time_ms);
            status.withdraw(dsp_protocol::StatusMask(!mask));
            if rig.dsp.mask == mask {
                rig.say(Downlink::Status(status));
            }
        }
        assert_eq!(rig.dsp.asked(), [PROBE, MASK], "mask {mask:#b}");
        assert_eq!(rig.dsp.mask, 0xFFFF, "it has our mask again");
        assert_eq!(rig.link(), LinkState::Up);
        assert_eq!(rig.bridge.state().link.dsp_boots, 0);
        assert_eq!(rig.last(path[0]).0, Stage::Progress, "the path goes on");
    }
}

#[test]
fn the_mask_is_read_at_the_second_status_in_a_row_with_the_same_other_groups() {
    let mut rig = Rig::flying();
    rig.dsp.sends_status = false;
    rig.dsp.acknowledges = false;
    let before = rig.dsp.asked().len();
    // Groups, and the commands that went out by then.
    for (mask, asked) in [
        (0b11, 0),
        (0b10, 0),
        (0b11, 0),
        (0b11, 1),
        (0b11, 1),
        (0b11, 1),
    ] {
        rig.dsp.time_ms += 20;
        let mut status = rig.dsp.status;
        status.time_ms = Some(rig.dsp.time_ms);
        status.withdraw(dsp_protocol::StatusMask(!mask));
        rig.say(Downlink::Status(status));
        rig.exchange();
        assert_eq!(rig.dsp.asked().len() - before, asked, "{mask:#b}");
    }
}

#[test]
fn a_port_that_goes_and_comes_back_is_started_again() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(5)]);
    rig.run(300);
    rig.apply(Input::PortClosed);
    assert_eq!(rig.link(), LinkState::Gone);
    assert_eq!(rig.last(path[0]).0, Stage::Unknown);
    assert!(rig.bridge.transmit(rig.now).is_empty());
    rig.dsp.commands.clear();
    rig.open();
    assert_eq!(rig.link(), LinkState::Up);
    assert_eq!(rig.dsp.commands, START_UP);
    assert_eq!(rig.bridge.state().link.port_openings, 2);
}

#[test]
fn which_dsp_errors_end_the_functionality() {
    let dsp = (ModuleStatus::Aborted, ImiError::HeroDspFatalError);
    let nothing = (ModuleStatus::Running, ImiError::None);
    for (code, expected) in [
        (8, dsp),
        (18, dsp),
        // A repetition cures it.
        (102, nothing),
        (40, nothing),
        (300, nothing),
        (77, nothing),
    ] {
        let mut rig = Rig::flying();
        let path = rig.path(1, &[north(5)]);
        rig.dsp_error(code);
        assert_eq!((rig.module(), rig.imi_error()), expected, "error {code}");
        let ended = expected != nothing;
        assert_eq!(rig.last(path[0]).0.is_final(), ended, "error {code}");
        rig.run(100);
        let emptied = rig
            .dsp
            .commands
            .ends_with(&[Command::InvalidatePath, Command::ClearErrors]);
        assert_eq!(emptied, ended, "error {code}");
        let errors = rig.bridge.state().dsp_errors;
        assert_eq!((errors.total, errors.last_code), (1, u32::from(code)));
        assert_eq!(errors.escalated, u32::from(ended));
        assert_eq!(errors.unknown, u32::from(code == 77));
    }
}

#[test]
fn the_error_table_can_be_changed() {
    let mut rig = Rig::up(&config(
        "[errors]\nhero_dsp_fatal = [40]\ncommunication_fatal = [102]\n",
    ));
    rig.control(ControlCommand::Start);
    rig.dsp_error(8);
    assert_eq!(rig.module(), ModuleStatus::Running);
    for (code, error) in [
        (40, ImiError::HeroDspFatalError),
        (102, ImiError::CommunicationFatalError),
    ] {
        rig.control(ControlCommand::Start);
        rig.dsp_error(code);
        assert_eq!(
            (rig.module(), rig.imi_error()),
            (ModuleStatus::Aborted, error)
        );
    }
}

#[test]
fn errors_before_the_end_of_the_start_up_are_not_fatal() {
    let mut rig = Rig::started();
    rig.dsp.silent = true;
    rig.run(3000);
    assert_eq!(rig.link(), LinkState::Connecting);
    rig.dsp_error(8);
    assert_eq!(rig.module(), ModuleStatus::Running);
    assert_eq!(rig.bridge.state().dsp_errors.total, 1);
}

#[test]
fn telemetry_is_published_at_once_or_confirmed_by_the_next() {
    for (rule, expected) in [(Rule::Immediate, [1, 2, 3]), (Rule::Confirmed, [0, 1, 2])] {
        let mut config = BridgeConfig::default();
        config.status.coherence = rule;
        let mut rig = Rig::closed(&config);
        rig.apply(Input::PortOpened(Default::default()));
        for (index, count) in expected.into_iter().enumerate() {
            let status = Status {
                time_ms: Some(20 * index as u32),
                ..Status::default()
            };
            rig.say(Downlink::Status(status));
            assert_eq!(rig.out.telemetry.len(), count, "{rule:?}");
        }
    }
}

#[test]
fn the_age_of_telemetry_counts_from_when_its_last_byte_left_the_dsp() {
    let mut rig = Rig::closed(&BridgeConfig::default());
    let line = Line {
        byte: Duration::from_micros(100),
        adapter: Duration::from_millis(1),
    };
    rig.apply(Input::PortOpened(line));
    rig.now = rig.now + Duration::from_secs(1);
    let status = Status {
        time_ms: Some(20),
        ..Status::default()
    };
    let mut bytes = Downlink::Status(status).encode().as_bytes().to_vec();
    let flow = Downlink::FlowControl(FlowControl::Send).encode();
    for _ in 0..10 {
        bytes.extend_from_slice(flow.as_bytes());
    }
    rig.apply(Input::Received(&bytes));
    let sample = rig.out.telemetry[0];
    assert_eq!(sample.received(), rig.now);
    let behind = 10 * flow.as_bytes().len() as u32;
    assert_eq!(rig.now.since(sample.sent()), behind * line.byte);
    assert_eq!(sample.sent_uncertainty_s, 0.001);
}

#[test]
fn a_status_without_the_time_that_was_asked_for_does_not_overtake_one_that_is_held_back() {
    for rule in [Rule::Immediate, Rule::Confirmed] {
        let mut config = BridgeConfig::default();
        config.status.coherence = rule;
        let mut rig = Rig::up(&config);
        rig.run(100);
        let (samples, dropped) = (
            rig.out.telemetry.len(),
            rig.bridge.state().link.telemetry_incoherent,
        );
        rig.say(Downlink::Status(Status::default()));
        assert_eq!(rig.out.telemetry.len(), samples, "{rule:?}");
        rig.run(1000);
        let now = rig.bridge.state().link.telemetry_incoherent;
        assert_eq!(now, dropped + 1, "{rule:?}");
        let times = rig.out.telemetry.iter().map(|sample| sample.received_ns);
        assert!(times.is_sorted(), "{rule:?}");
    }
}

#[test]
fn an_implausible_group_is_withdrawn_and_counted() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.dsp.status.attitude = Some(Attitude {
        pitch_deg: 120.0,
        ..Attitude::default()
    });
    rig.out.telemetry.clear();
    rig.run(20);
    let sample = rig.out.telemetry[0];
    rig.run(1000);
    let link = rig.bridge.state().link;
    assert!(link.last_telemetry_ns > sample.received_ns && link.telemetry_published > 10);
    assert_eq!(sample.valid_groups, !(1 << 5), "the other groups stay");
    assert_eq!(sample.attitude.pitch_deg, 0.0);
    rig.run(1000);
    let refused = rig.bridge.state().refused;
    assert_eq!(refused.implausible_mask, 1 << 5);
    assert!(refused.implausible_groups >= 1);
}

#[test]
fn noise_is_counted_by_reason_and_costs_no_good_message() {
    // Without the DSP's time every good status is published.
    let mut rig = Rig::up(&config("[status]\ngroups = [\"geographic\"]\n"));
    let status = Downlink::Status(Status::default()).encode();
    let bytes = status.as_bytes();
    rig.out.telemetry.clear();
    let mut wrong_sum = bytes.to_vec();
    *wrong_sum.last_mut().unwrap() ^= 1;
    let noise: [&[u8]; 4] = [&[0x01, 0x02], &[0x80, 0x05], &bytes[..4], &wrong_sum];
    for noise in noise {
        rig.apply(Input::Received(noise));
        rig.apply(Input::Received(bytes));
    }
    assert_eq!(rig.out.telemetry.len(), 4);
    rig.run(1000);
    let refused = rig.bridge.state().refused;
    assert_eq!(
        (
            refused.stray,
            refused.unknown_header,
            refused.truncated,
            refused.checksum
        ),
        (1, 1, 1, 1)
    );
}

#[test]
fn the_state_is_published_at_every_change_and_every_period() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.out.states.clear();
    rig.run(8000);
    // One a second while nothing changes, or a few more: it comes early when a status comes shortly before.
    let states = rig.out.states.len();
    assert!((8..=10).contains(&states), "{states}");
    rig.out.states.clear();
    rig.control(ControlCommand::Start);
    assert_eq!(rig.out.states.len(), 1);
}

/// A bridge whose DSP speaks `theirs` while the bridge speaks `ours`; both have had two seconds.
fn between(ours: Profile, theirs: Profile) -> Rig {
    let mut config = BridgeConfig::default();
    config.link.profile = ours;
    let mut rig = Rig::closed(&config);
    rig.dsp.speak(theirs);
    rig.open();
    rig.run(2000);
    rig
}

#[test]
fn both_profiles_connect_and_miss_nothing() {
    for profile in Profile::ALL {
        let mut rig = between(profile, profile);
        assert_eq!(rig.link(), LinkState::Up, "{profile:?}");
        rig.control(ControlCommand::Start);
        rig.lift_off();
        rig.dsp.loses = 1;
        let path = rig.path(1, &[north(3), north(6)]);
        rig.run(500);
        assert_eq!(rig.last_report(path[1]).waypoints_sent, 2, "{profile:?}");
        // A repetition has the number of what it repeats.
        let [lost, again, next] = rig.dsp.numbers[..] else {
            panic!("{:?}", rig.dsp.numbers)
        };
        assert_eq!((lost, again.map(Sequence::next)), (again, next));
        let refused = rig.bridge.state().refused;
        assert_eq!((refused.missed_messages, refused.checksum), (0, 0));
    }
}

#[test]
fn a_dsp_with_the_other_profile_is_recognised_and_not_taken_for_noise() {
    for (ours, theirs) in [
        (Profile::Classic, Profile::Extended),
        (Profile::Extended, Profile::Classic),
    ] {
        let rig = between(ours, theirs);
        assert_eq!(rig.link(), LinkState::Connecting);
        let refused = rig.bridge.state().refused;
        assert!(refused.other_profile > 0, "{ours:?}");
        assert_eq!((refused.unknown_header, refused.checksum), (0, 0));
    }
}

#[test]
fn messages_that_were_missed_are_counted_by_their_numbers() {
    let mut rig = between(Profile::Extended, Profile::Extended);
    for _ in 0..3 {
        rig.dsp
            .frame(&Downlink::FlowControl(FlowControl::Stop), None);
    }
    rig.run(1000);
    assert_eq!(rig.bridge.state().refused.missed_messages, 3);
}

/// What does not fit is counted. A waypoint waits for its next grant, a command for its next attempt.
#[test]
fn a_port_that_takes_nothing_costs_no_waypoint_and_no_command() {
    let mut rig = between(Profile::Extended, Profile::Extended);
    rig.control(ControlCommand::Start);
    rig.lift_off();
    rig.dsp.counts = false;
    let points: Vec<_> = (1..=40).map(|step| north(10 * step)).collect();
    let path = rig.path(1, &points);
    rig.run(50);
    let frame = Uplink::Waypoint(points[0]).encode_in(Profile::Extended, Sequence::FIRST);
    let len = frame.as_bytes().len();
    let fit = CAPACITY / len;
    for grant in 1..=points.len() {
        rig.say(Downlink::FlowControl(FlowControl::Send));
        let sent = rig.last_report(*path.last().unwrap()).waypoints_sent as usize;
        assert_eq!(sent, grant.min(fit));
    }
    let request_id = rig.request_id();
    rig.ask_parameter(ParameterRequest {
        request_id,
        issued_ns: rig.now.0,
        ..ParameterRequest::read(0, port::CRUISE_SPEED_MPS)
    });
    assert_eq!(rig.bridge.transmit(rig.now).len(), len * fit);
    rig.run(2500);
    let overflows = rig.bridge.state().refused.transmit_overflows as usize;
    assert_eq!(overflows, points.len() - fit + 1);
    assert_eq!(rig.last(request_id).0, Stage::Done);
    assert_eq!(rig.dsp.waypoints, points);
}

/// The acknowledgement may be that of the former start-up.
#[test]
fn a_start_up_whose_emptying_proves_nothing_empties_once_more_when_it_does() {
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    rig.hold();
    rig.dsp.acknowledges = true;
    rig.dsp.time_ms = 0;
    rig.dsp.commands.clear();
    for (ms, path, count) in [
        (1_900, DspPathState::Unknown, 1),
        (200, DspPathState::Empty, 2),
    ] {
        rig.run(ms);
        assert_eq!(rig.link(), LinkState::Up);
        assert_eq!(rig.bridge.state().link.dsp_path(), Some(path));
        let commands = rig.dsp.commands.iter();
        let emptied = commands.filter(|it| **it == Command::InvalidatePath);
        assert_eq!(emptied.count(), count);
    }
}
