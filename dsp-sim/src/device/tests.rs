//! The protocol as the PC sees it: every test speaks in bytes and looks at what comes back. The sentences of
//! docs/protocol.md are judged one by one in `crates/conform/tests/right.rs`; here is what those do not say.

mod extended;
mod firmware;
mod in_flight;

use dsp_protocol::{Command, Group, Received};
use proptest::prelude::*;

use super::*;
use crate::helicopter::Phase;
use crate::simulator::Setup;

/// A DSP with a helicopter, and a PC that takes every byte at once.
struct Harness {
    dsp: Dsp,
    helicopter: Helicopter,
    decoder: Decoder<Downlink>,
    /// The numbers of the next command and of the next waypoint.
    commands: Sequence,
    waypoints: Sequence,
    now: Duration,
}

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn write_16(port: u16, value: u16) -> Command {
    Command::Write16 { port, value }
}

fn write_32(port: u16, value: f32) -> Command {
    Command::Write32 { port, value }
}

impl Harness {
    /// A DSP that has just booted.
    fn new() -> Harness {
        Harness::with_boot_errors(&[])
    }

    fn with_boot_errors(errors: &[u16]) -> Harness {
        Harness::in_profile(Profile::Classic, errors)
    }

    fn in_profile(profile: Profile, errors: &[u16]) -> Harness {
        Harness::with_firmware(profile, errors, Firmware::default())
    }

    fn with_firmware(profile: Profile, errors: &[u16], firmware: Firmware) -> Harness {
        Harness {
            dsp: Dsp::boot(
                Duration::ZERO,
                profile,
                errors.iter().copied().map(DspErrorCode).collect(),
                firmware,
            ),
            helicopter: Helicopter::new(Setup::default().model, Ports::default().settings()),
            decoder: Decoder::with_profile(profile),
            commands: Sequence::FIRST,
            waypoints: Sequence::FIRST,
            now: Duration::ZERO,
        }
    }

    /// A DSP after the start-up of section 8.1, with time alone in its mask.
    fn started() -> Harness {
        Harness::new().start_up()
    }

    /// The start-up of section 8.1.
    fn start_up(mut self) -> Harness {
        for command in [
            write_16(port::STATUS_MASK, StatusMask::NONE.with(Group::Time).0),
            Command::ActivateStatus,
            Command::ClearErrors,
            Command::InvalidatePath,
            Command::Following { on: true },
        ] {
            let code = command.code();
            assert_eq!(self.command(command), [Downlink::Ack { command: code }]);
        }
        self
    }

    /// A DSP that has taken off and hovers.
    fn hovering() -> Harness {
        Harness::started().take_off()
    }

    fn take_off(mut self) -> Harness {
        self.command(write_16(port::TAKE_OFF, 1));
        self.finish_take_off();
        assert_eq!(self.errors(), [0_u16; 0]);
        self
    }

    /// Waits for the first flow control that asks for a waypoint.
    fn finish_take_off(&mut self) {
        self.fly_until(Phase::Hovering);
        while self.dsp.is_taking_off(&self.helicopter) {
            self.wait(ms(10));
        }
    }

    fn read_16(&mut self, port: u16) -> u16 {
        match self.command(Command::Read16 { port })[..] {
            [Downlink::Ack16 { command: 0, value }] => value,
            ref other => panic!("{other:?}"),
        }
    }

    /// What the DSP sends at this moment.
    fn drain(&mut self) -> Vec<Downlink> {
        let messages = self.drain_received().into_iter();
        messages.map(|received| received.message).collect()
    }

    /// What the DSP sends at this moment, each message with the number that it has in the extended profile.
    fn drain_received(&mut self) -> Vec<Received<Downlink>> {
        let mut messages = Vec::new();
        loop {
            let bytes = self.dsp.output().front().to_vec();
            if bytes.is_empty() {
                return messages;
            }
            self.dsp.sent(bytes.len());
            match self.decoder.receive(&bytes) {
                (taken, Decoded::Message(received)) if taken == bytes.len() => {
                    messages.push(received)
                }
                other => panic!("the DSP sent {other:?}"),
            }
        }
    }

    fn bytes(&mut self, bytes: &[u8]) -> Vec<Downlink> {
        self.dsp.receive(self.now, bytes, &mut self.helicopter);
        self.drain()
    }

    fn command(&mut self, command: Command) -> Vec<Downlink> {
        let sequence = self.commands;
        self.commands = sequence.next();
        self.numbered(sequence, Uplink::Command(command))
    }

    fn numbered(&mut self, sequence: Sequence, message: Uplink) -> Vec<Downlink> {
        let profile = self.decoder.profile();
        self.bytes(message.encode_in(profile, sequence).as_bytes())
    }

    fn waypoint(&mut self, point_m: (f64, f64, f64)) {
        let sequence = self.waypoints;
        self.waypoints = sequence.next();
        self.numbered_waypoint(sequence, point_m);
    }

    fn numbered_waypoint(&mut self, sequence: Sequence, point_m: (f64, f64, f64)) {
        let point = crate::helicopter::vector::Vector::new(point_m.0, point_m.1, point_m.2);
        let position = self.helicopter.world().to_geographic(point);
        let waypoint = Uplink::Waypoint(Waypoint {
            latitude_deg: position.latitude_deg,
            longitude_deg: position.longitude_deg,
            altitude_m: position.altitude_m,
        });
        let messages = self.numbered(sequence, waypoint);
        assert_eq!(messages, [], "a waypoint is never acknowledged");
    }

    /// Lets time pass and returns what the DSP sent, with the time of each.
    fn wait(&mut self, time: Duration) -> Vec<(Duration, Downlink)> {
        let end = self.now + time;
        let mut messages = Vec::new();
        while let Some(due) = self.dsp.next_deadline().filter(|due| *due <= end) {
            self.now = due;
            self.dsp.advance(due, &mut self.helicopter);
            messages.extend(self.drain().into_iter().map(|message| (due, message)));
        }
        self.now = end;
        messages
    }

    fn fly_until(&mut self, phase: Phase) {
        for _ in 0..6_000 {
            if self.helicopter.phase() == phase {
                return;
            }
            self.wait(ms(10));
            self.helicopter.advance(self.now);
        }
        panic!("never {phase:?}");
    }

    /// The codes of all errors that wait, reported one after each status.
    fn errors(&mut self) -> Vec<u16> {
        let mut codes = Vec::new();
        let mut after_status = false;
        while !self.dsp.errors().is_empty() {
            for (_, message) in self.wait(ms(20)) {
                if let Downlink::Error(code) = message {
                    assert!(after_status, "an error comes right after a status");
                    codes.push(code.0);
                }
                after_status = matches!(message, Downlink::Status(_));
            }
        }
        codes
    }

    fn statuses(messages: &[(Duration, Downlink)]) -> Vec<(Duration, Status)> {
        let statuses = messages.iter().filter_map(|(time, message)| match message {
            Downlink::Status(status) => Some((*time, *status)),
            _ => None,
        });
        statuses.collect()
    }

    fn flow(messages: &[(Duration, Downlink)]) -> Vec<FlowControl> {
        let requests = messages.iter().filter_map(|(_, message)| match message {
            Downlink::FlowControl(request) => Some(*request),
            _ => None,
        });
        requests.collect()
    }
}

#[test]
fn every_command_is_acknowledged_at_once_and_what_it_cannot_do_is_error_30() {
    let ack = |command| Downlink::Ack { command };
    let value = |value| Downlink::Ack16 { command: 0, value };
    let float = |value| Downlink::Ack32 { command: 2, value };
    let read_16 = |port| Command::Read16 { port };
    let read_32 = |port| Command::Read32 { port };
    for (command, answer, errors) in [
        (read_16(port::STATUS_PERIOD_MS), value(20), 0),
        (read_16(port::TAKE_OFF), value(0), 0),
        (read_16(9), value(0), 1),
        (read_16(port::CRUISE_SPEED_MPS), value(0), 1),
        (read_32(port::CRUISE_SPEED_MPS), float(5.0), 0),
        (read_32(port::STATUS_MASK), float(0.0), 1),
        (write_16(port::STATUS_PERIOD_MS, 10_000), ack(1), 0),
        (write_16(port::STATUS_PERIOD_MS, 10_001), ack(1), 1),
        (write_16(port::STATUS_PERIOD_MS, 0), ack(1), 1),
        (
            write_16(port::TRIM_TAIL_US, (-500_i16).cast_unsigned()),
            ack(1),
            0,
        ),
        (
            write_16(port::TRIM_TAIL_US, (-501_i16).cast_unsigned()),
            ack(1),
            1,
        ),
        (write_16(9, 1), ack(1), 1),
        (write_16(port::TAKE_OFF, 1), ack(1), 1),
        (write_16(port::TAKE_OFF, 0), ack(1), 1),
        (write_16(port::TAKE_OFF, 2), ack(1), 1),
        (write_16(port::LAND, 1), ack(1), 1),
        (write_32(port::CRUISE_SPEED_MPS, 20.0), ack(3), 0),
        (write_32(port::CRUISE_SPEED_MPS, 20.5), ack(3), 1),
        (write_32(port::CRUISE_SPEED_MPS, f32::NAN), ack(3), 1),
        (write_32(port::CRUISE_SPEED_MPS, f32::INFINITY), ack(3), 1),
        (write_32(9, 1.0), ack(3), 1),
        (Command::ClearErrors, ack(4), 0),
        (Command::ActivateStatus, ack(5), 0),
        (Command::InvalidatePath, ack(6), 0),
        (Command::Following { on: true }, ack(7), 0),
        (Command::Following { on: false }, ack(7), 0),
    ] {
        let mut harness = Harness::new();
        assert_eq!(harness.command(command), [answer], "{command:?}");
        assert_eq!(harness.dsp.errors().len(), errors, "{command:?}");
        assert_eq!(
            harness.dsp.counters().commands[usize::from(command.code())],
            1
        );
        harness.command(Command::ActivateStatus);
        assert!(
            harness.errors().iter().all(|code| *code == 30),
            "{command:?}"
        );
    }
}

#[test]
fn a_command_that_arrives_twice_has_the_effect_of_one() {
    for command in [
        write_16(port::STATUS_PERIOD_MS, 50),
        write_16(port::TAKE_OFF, 1),
        write_32(port::CLIMB_SPEED_MPS, 3.0),
        Command::ClearErrors,
        Command::ActivateStatus,
        Command::InvalidatePath,
        Command::Following { on: true },
        Command::Following { on: false },
    ] {
        let run = |times| {
            let mut harness = Harness::started();
            for _ in 0..times {
                harness.command(command);
            }
            harness.wait(ms(30));
            harness.command(command);
            let messages = harness.wait(ms(2_000));
            (
                messages,
                harness.dsp.ports().clone(),
                harness.helicopter.phase(),
            )
        };
        assert_eq!(run(1), run(2), "{command:?}");
    }
}

#[test]
fn a_status_comes_every_period_with_the_groups_of_the_mask() {
    for mask in [0, 1, 0x0402, 0xFFFF] {
        let mut harness = Harness::new();
        harness.command(write_16(port::STATUS_MASK, mask));
        harness.command(Command::ActivateStatus);
        let statuses = Harness::statuses(&harness.wait(ms(100)));
        let times: Vec<Duration> = statuses.iter().map(|(time, _)| *time).collect();
        assert_eq!(times, [20, 40, 60, 80, 100].map(ms));
        for (time, status) in statuses {
            assert_eq!(status.mask(), StatusMask(mask));
            assert!(!status.flying);
            let on_board = status.time_ms.map(|time_ms| ms(time_ms.into()));
            assert!(on_board.is_none_or(|on_board| on_board == time));
        }
    }
}

#[test]
fn more_acks_than_the_queue_holds_are_dropped_with_error_5() {
    let mut harness = Harness::started();
    let command = Uplink::Command(Command::InvalidatePath).encode();
    for _ in 0..60 {
        let now = harness.now;
        harness
            .dsp
            .receive(now, command.as_bytes(), &mut harness.helicopter);
    }
    let acks = harness.drain().len();
    assert!((32..60).contains(&acks), "{acks}");
    assert_eq!(harness.errors(), vec![5; 16.min(60 - acks)]);
    assert_eq!(harness.command(Command::ClearErrors).len(), 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Noise of any kind is survived, and the first command after it is understood.
    #[test]
    fn noise_never_ends_the_dsp(noise in prop::collection::vec(any::<u8>(), 0..2_000), piece in 1_usize..64) {
        let mut harness = Harness::started();
        for bytes in noise.chunks(piece) {
            let now = harness.now;
            harness.dsp.receive(now, bytes, &mut harness.helicopter);
            harness.wait(ms(1));
            prop_assert!(harness.dsp.errors().len() <= 16);
        }
        harness.drain();
        prop_assert_eq!(harness.command(Command::ActivateStatus), [Downlink::Ack { command: 5 }]);
    }

    /// How the bytes are cut makes no difference.
    #[test]
    fn chunks_make_no_difference(cut in 1_usize..20) {
        let bytes: Vec<u8> = [
            Uplink::Command(write_16(port::STATUS_MASK, 1)),
            Uplink::Command(Command::Following { on: true }),
            Uplink::Waypoint(Waypoint::default()),
            Uplink::Command(Command::Read32 { port: port::YAW_GAIN }),
        ]
        .iter()
        .flat_map(|message| message.encode().as_bytes().to_vec())
        .collect();
        let mut whole = Harness::new();
        let expected = whole.bytes(&bytes);
        let mut harness = Harness::new();
        let messages: Vec<Downlink> = bytes.chunks(cut).flat_map(|piece| harness.bytes(piece)).collect();
        prop_assert_eq!(messages, expected);
        prop_assert_eq!(harness.dsp.errors().len(), 1);
    }
}
