//! Bytes in, bytes out, at the right simulated times.

mod faults;
mod flight;

use dsp_protocol::{Command, Decoded, Decoder, Downlink, FlowControl, Uplink, Waypoint, port};
use proptest::prelude::*;

use super::*;
use crate::helicopter::Phase;

fn setup(baud: u32) -> Setup {
    Setup {
        baud: NonZeroU32::new(baud),
        ..Setup::default()
    }
}

fn bytes_of(message: Uplink) -> Vec<u8> {
    message.encode().as_bytes().to_vec()
}

fn command(command: Command) -> Vec<u8> {
    bytes_of(Uplink::Command(command))
}

/// A PC in virtual time: it jumps from deadline to deadline and understands what comes.
struct Pc {
    simulator: Simulator,
    decoder: Decoder<Downlink>,
}

impl Pc {
    fn new(setup: Setup) -> Pc {
        Pc {
            simulator: Simulator::new(setup),
            decoder: Decoder::new(),
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        let taken = self.simulator.receive(self.simulator.now(), bytes);
        assert_eq!(taken, bytes.len());
    }

    /// Jumps to the next deadline; gives the messages whose last byte came there.
    fn jump(&mut self) -> Vec<Downlink> {
        let next = self.simulator.next_deadline().expect("something goes on");
        self.simulator.advance(next);
        let mut messages = Vec::new();
        let decoder = &mut self.decoder;
        self.simulator.transmit(|bytes| {
            let mut rest = bytes;
            while !rest.is_empty() {
                let (taken, decoded) = decoder.decode(rest);
                rest = &rest[taken..];
                match decoded {
                    Decoded::Message(message) => messages.push(message),
                    Decoded::Incomplete => {}
                    Decoded::Rejected(error) => panic!("{error:?}"),
                }
            }
            bytes.len()
        });
        messages
    }

    /// Sends a command and waits for its acknowledgement; gives how long that took.
    fn order(&mut self, order: Command) -> Duration {
        let start = self.simulator.now();
        self.send(&command(order));
        loop {
            for message in self.jump() {
                if let Downlink::Ack { command } = message {
                    assert_eq!(command, order.code());
                    return self.simulator.now() - start;
                }
            }
        }
    }

    /// The start-up of section 8.1 with all groups.
    fn start_up(&mut self) {
        for order in [
            Command::Write16 {
                port: port::STATUS_MASK,
                value: u16::MAX,
            },
            Command::ActivateStatus,
            Command::ClearErrors,
            Command::InvalidatePath,
            Command::Following { on: true },
        ] {
            self.order(order);
        }
    }

    fn write(&mut self, port: u16, value: u16) {
        self.order(Command::Write16 { port, value });
    }

    fn until(&mut self, phase: Phase) {
        while self.simulator.helicopter().phase() != phase {
            self.jump();
        }
    }
}

#[test]
fn bytes_take_their_time_on_the_line_both_ways() {
    for (baud, byte_ns) in [(10_000, 1_000_000), (115_200, 86_806), (1_000_000, 10_000)] {
        let mut simulator = Simulator::new(setup(baud));
        let start = Duration::from_millis(3);
        assert_eq!(simulator.receive(start, &command(Command::ClearErrors)), 3);
        let mut arrivals = Vec::new();
        while let Some(next) = simulator.next_deadline() {
            simulator.advance(next);
            simulator.transmit(|bytes| {
                arrivals.push((next, bytes.len()));
                bytes.len()
            });
        }
        // Three bytes there, and three back: the ack is complete after six.
        let [(time, 3)] = arrivals[..] else {
            panic!("{baud}: {arrivals:?}");
        };
        let took_ns = (time - start).as_nanos();
        assert!(took_ns.abs_diff(6 * byte_ns) <= 6, "{baud}: {took_ns}");
    }
}

#[test]
fn without_a_baud_rate_the_answer_is_there_at_once() {
    let mut simulator = Simulator::new(setup(0));
    simulator.receive(Duration::from_secs(1), &command(Command::ClearErrors));
    let mut answer = Vec::new();
    simulator.transmit(|bytes| {
        answer.extend_from_slice(bytes);
        bytes.len()
    });
    assert_eq!(answer, Downlink::Ack { command: 4 }.encode().as_bytes());
    assert_eq!(simulator.now(), Duration::from_secs(1));
}

#[test]
fn every_ack_is_there_within_50_ms_while_the_line_is_full_of_status() {
    let mut pc = Pc::new(setup(115_200));
    pc.start_up();
    pc.write(port::STATUS_PERIOD_MS, 12);
    let mut worst = Duration::ZERO;
    for _ in 0..200 {
        worst = worst.max(pc.order(Command::ClearErrors));
        pc.jump();
    }
    assert!(worst < Duration::from_millis(50), "{worst:?}");
    assert!(pc.simulator.dsp().counters().statuses > 100);
}

#[test]
fn a_line_too_slow_for_the_period_carries_whole_frames_and_no_old_ones() {
    let mut pc = Pc::new(setup(9_600));
    pc.start_up();
    let mut ages = Vec::new();
    while ages.len() < 20 {
        for message in pc.jump() {
            if let Downlink::Status(status) = message {
                let measured = Duration::from_millis(status.time_ms.unwrap_or(0).into());
                ages.push(pc.simulator.now() - measured);
            }
        }
    }
    // 128 bytes take 133.3 ms; what else waits its turn are acks and flow control.
    let oldest = ages.into_iter().max().unwrap();
    assert!(oldest < Duration::from_millis(150), "{oldest:?}");
    let counters = pc.simulator.dsp().counters();
    assert!(
        counters.statuses_left_out > 5 * counters.statuses,
        "{counters:?}"
    );
}

#[test]
fn what_does_not_fit_on_the_line_is_left_with_the_pc() {
    let mut simulator = Simulator::new(setup(115_200));
    let babble = vec![0x01; 3 * INPUT_PLACES];
    assert_eq!(simulator.receive(Duration::ZERO, &babble), INPUT_PLACES);
    assert_eq!(simulator.receive(Duration::ZERO, &babble), 0);
    // A tenth of a second is 1152 bytes.
    assert_eq!(
        simulator.receive(Duration::from_millis(100), &babble),
        INPUT_PLACES
    );
}

#[test]
fn bytes_that_nobody_fetches_are_bounded() {
    let mut simulator = Simulator::new(setup(115_200));
    simulator.receive(
        Duration::ZERO,
        &command(Command::Write16 {
            port: port::STATUS_MASK,
            value: u16::MAX,
        }),
    );
    simulator.receive(Duration::ZERO, &command(Command::ActivateStatus));
    simulator.advance(Duration::from_secs(30));
    let mut fetched = 0;
    simulator.transmit(|bytes| {
        fetched += bytes.len();
        bytes.len()
    });
    assert_eq!(fetched, OUTPUT_PLACES);
    assert!(simulator.overrun() > 50_000);
}

#[test]
fn a_sink_that_takes_less_gets_the_rest_later() {
    let mut simulator = Simulator::new(setup(0));
    simulator.receive(Duration::ZERO, &command(Command::ClearErrors));
    let mut taken = Vec::new();
    for _ in 0..3 {
        let mut first = true;
        simulator.transmit(|bytes| {
            let count = usize::from(std::mem::take(&mut first));
            taken.extend_from_slice(&bytes[..count]);
            count
        });
    }
    assert_eq!(taken, Downlink::Ack { command: 4 }.encode().as_bytes());
}

/// The bytes of three seconds of a busy start, when time goes on by the given steps.
fn bytes_by_steps(mut step: impl FnMut(&Simulator) -> Duration) -> Vec<u8> {
    let mut simulator = Simulator::new(setup(115_200));
    let orders = [
        command(Command::Write16 {
            port: port::STATUS_MASK,
            value: u16::MAX,
        }),
        command(Command::ActivateStatus),
        command(Command::Following { on: true }),
        command(Command::Write16 {
            port: port::TAKE_OFF,
            value: 1,
        }),
    ]
    .concat();
    simulator.receive(Duration::ZERO, &orders);
    let mut bytes = Vec::new();
    let end = Duration::from_secs(3);
    while simulator.now() < end {
        let next = step(&simulator).min(end);
        simulator.advance(next);
        simulator.transmit(|some| {
            bytes.extend_from_slice(some);
            some.len()
        });
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// However late or early the caller advances the clock, the DSP sends the same: a late wake costs nothing but time.
    #[test]
    fn the_steps_of_the_clock_make_no_difference(steps_us in prop::collection::vec(50_u64..200_000, 1..40)) {
        let expected = bytes_by_steps(|simulator| simulator.next_deadline().unwrap());
        let mut steps = steps_us.into_iter().cycle();
        let bytes = bytes_by_steps(|simulator| {
            simulator.now() + Duration::from_micros(steps.next().unwrap())
        });
        prop_assert!(bytes.len() > 15_000);
        prop_assert!(bytes == expected, "{} and {} bytes", bytes.len(), expected.len());
    }
}
