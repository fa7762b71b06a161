//! A script of faults in the whole simulator: what the PC receives, and when.

use super::*;
use crate::faults::{Act, Fault, MessageKind, Times, Window};

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn dsp(at: Duration, event: DspEvent) -> Fault {
    Fault::Dsp {
        times: Times::once(at),
        event,
    }
}

fn with_faults(faults: Vec<Fault>) -> Setup {
    Setup {
        faults: Some(Script { seed: 7, faults }),
        ..setup(115_200)
    }
}

/// A PC whose serial link may be noisy: it skips what is rejected.
struct Listener {
    simulator: Simulator,
    decoder: Decoder<Downlink>,
    rejections: u32,
}

impl Listener {
    /// A PC that has started the DSP up at time zero; the status carries the time alone.
    fn new(setup: Setup) -> Listener {
        let mut listener = Listener {
            simulator: Simulator::new(setup),
            decoder: Decoder::new(),
            rejections: 0,
        };
        listener.send(Command::Write16 {
            port: port::STATUS_MASK,
            value: 1,
        });
        listener.send(Command::ActivateStatus);
        listener
    }

    fn send(&mut self, order: Command) {
        let now = self.simulator.now();
        self.simulator.receive(now, &command(order));
    }

    /// Listens until `end`; gives the messages and when they came.
    fn listen(&mut self, end: Duration) -> Vec<(Duration, Downlink)> {
        let mut messages = Vec::new();
        while let Some(next) = self.simulator.next_deadline().filter(|next| *next <= end) {
            self.simulator.advance(next);
            let (decoder, rejections) = (&mut self.decoder, &mut self.rejections);
            self.simulator.transmit(|bytes| {
                let mut rest = bytes;
                while !rest.is_empty() {
                    let (taken, decoded) = decoder.decode(rest);
                    rest = &rest[taken..];
                    match decoded {
                        Decoded::Message(message) => messages.push((next, message)),
                        Decoded::Incomplete => {}
                        Decoded::Rejected(_) => *rejections += 1,
                    }
                }
                bytes.len()
            });
        }
        self.simulator.advance(end);
        messages
    }

    fn done(&self) -> FaultCounters {
        self.simulator.faults().unwrap()
    }
}

/// When each status came, and what the DSP's clock read in it.
fn statuses(messages: &[(Duration, Downlink)]) -> Vec<(u64, u64)> {
    let statuses = messages.iter().filter_map(|(at, message)| match message {
        Downlink::Status(status) => Some((at.as_millis() as u64, status.time_ms?.into())),
        _ => None,
    });
    statuses.collect()
}

fn acks(messages: &[(Duration, Downlink)]) -> Vec<u64> {
    let acks = messages
        .iter()
        .filter(|(_, message)| matches!(message, Downlink::Ack { .. }));
    acks.map(|(at, _)| at.as_millis() as u64).collect()
}

#[test]
fn an_empty_script_changes_nothing() {
    let mut without = Listener::new(setup(115_200));
    let mut with = Listener::new(with_faults(Vec::new()));
    assert_eq!(with.listen(ms(2_000)), without.listen(ms(2_000)));
    assert_eq!(without.simulator.faults(), None);
    let done = with.done();
    assert_eq!(done.to_pc.entered, done.to_pc.left);
    assert_eq!((done.to_pc.lost(), done.to_dsp.lost()), (0, 0));
}

#[test]
fn a_raised_error_is_reported_after_the_next_status() {
    let error = DspErrorCode(45);
    let fault = dsp(ms(100), DspEvent::RaiseError(error));
    let mut listener = Listener::new(with_faults(vec![fault]));
    let messages = listener.listen(ms(200));
    let reported: Vec<&Duration> = messages
        .iter()
        .filter(|(_, message)| *message == Downlink::Error(error))
        .map(|(at, _)| at)
        .collect();
    assert_eq!(reported.len(), 1);
    assert!((ms(100)..ms(125)).contains(reported[0]), "{reported:?}");
}

#[test]
fn a_reboot_by_script_is_a_reboot() {
    let mut listener = Listener::new(with_faults(vec![dsp(ms(100), DspEvent::Reboot)]));
    let messages = listener.listen(ms(500));
    assert!(
        messages.iter().all(|(at, _)| *at <= ms(101)),
        "then silence"
    );
    listener.send(Command::ActivateStatus);
    let messages = listener.listen(ms(600));
    assert_eq!(acks(&messages).len(), 1);
    assert_eq!(listener.done().reboots, 1);
}

#[test]
fn the_status_stops_until_it_is_activated_again() {
    let mut listener = Listener::new(with_faults(vec![dsp(ms(100), DspEvent::StopStatus)]));
    let before = statuses(&listener.listen(ms(300)));
    assert!(before.last().unwrap().0 <= 102, "{before:?}");
    listener.send(Command::ActivateStatus);
    let after = statuses(&listener.listen(ms(400)));
    assert!(after.len() >= 4);
    assert!(after[0].1 >= 320, "the clock has gone on: {after:?}");
}

#[test]
fn the_clock_jumps_there_and_back_but_not_below_zero() {
    let mut listener = Listener::new(with_faults(vec![
        dsp(ms(1_011), DspEvent::ClockJump(5_000)),
        dsp(ms(2_011), DspEvent::ClockJump(-4_000)),
        dsp(ms(3_011), DspEvent::ClockJump(-86_400_000)),
        dsp(ms(4_011), DspEvent::Reboot),
    ]));
    for (at, clock) in statuses(&listener.listen(ms(4_000))) {
        let expected = match at {
            0..1_011 => at,
            1_011..2_011 => at + 5_000,
            2_011..3_011 => at + 1_000,
            _ => 0,
        };
        assert!(clock.abs_diff(expected) <= 2, "{clock} at {at} ms");
    }
    listener.listen(ms(4_100));
    listener.send(Command::Write16 {
        port: port::STATUS_MASK,
        value: 1,
    });
    listener.send(Command::ActivateStatus);
    let after = statuses(&listener.listen(ms(4_200)));
    let (at, clock) = after[0];
    assert!((at - 4_011).abs_diff(clock) <= 2, "a reboot sets it right");
}

#[test]
fn a_dsp_that_hangs_neither_hears_nor_speaks_and_then_goes_on() {
    let hang = dsp(ms(101), DspEvent::Hang(ms(400)));
    let mut listener = Listener::new(with_faults(vec![hang]));
    assert!(!listener.listen(ms(200)).is_empty());
    listener.send(Command::ClearErrors);
    let messages = listener.listen(ms(1_000));
    assert_eq!(acks(&messages), [0_u64; 0], "it received nothing");
    assert_eq!(listener.done().missed_bytes, 3);
    let statuses = statuses(&messages);
    for (at, clock) in &statuses {
        assert!(*at >= 501, "{at}");
        assert!(at - clock <= 2, "no status is old: {clock} at {at} ms");
    }
    assert!((24..=26).contains(&statuses.len()), "{}", statuses.len());
    listener.send(Command::ClearErrors);
    assert_eq!(acks(&listener.listen(ms(1_010))).len(), 1);
    assert_eq!(listener.rejections, 0, "no frame is cut");
}

#[test]
fn a_frame_that_a_hang_cuts_goes_on_after_it() {
    // All groups: 128 bytes, 11 ms; the hang begins in the middle of the first.
    let hang = dsp(ms(25), DspEvent::Hang(ms(300)));
    let mut listener = Listener::new(with_faults(vec![hang]));
    listener.send(Command::Write16 {
        port: port::STATUS_MASK,
        value: u16::MAX,
    });
    let messages = listener.listen(ms(400));
    let first = statuses(&messages)[0];
    assert!((325..335).contains(&first.0) && first.1 < 25, "{first:?}");
    assert_eq!(listener.rejections, 0);
}

#[test]
fn a_reboot_ends_a_hang() {
    let mut listener = Listener::new(with_faults(vec![
        dsp(ms(100), DspEvent::Hang(Duration::from_secs(60))),
        dsp(ms(200), DspEvent::Reboot),
    ]));
    listener.listen(ms(300));
    listener.send(Command::ClearErrors);
    assert_eq!(acks(&listener.listen(ms(310))).len(), 1);
}

#[test]
fn a_dropped_waypoint_is_not_counted_by_the_dsp_and_a_repeated_one_once() {
    for (act, waypoints, copies) in [(Act::Drop, 0, 0), (Act::Repeat, 1, 1)] {
        let fault = Fault::Messages {
            message: MessageKind::Waypoint,
            window: Window::ALWAYS,
            rate: 1.0,
            act,
        };
        let mut pc = Pc::new(with_faults(vec![fault]));
        pc.start_up();
        pc.write(port::TAKE_OFF, 1);
        while pc.simulator.dsp().counters().waypoint_requests == 0 {
            pc.jump();
        }
        let home = Setup::default().model.home;
        pc.send(&bytes_of(Uplink::Waypoint(Waypoint {
            latitude_deg: home.latitude_deg + 1e-4,
            longitude_deg: home.longitude_deg,
            altitude_m: home.altitude_m + 10.0,
        })));
        pc.order(Command::ClearErrors);
        let counters = pc.simulator.dsp().counters();
        assert_eq!(counters.waypoints, waypoints, "{act:?}");
        assert_eq!(counters.waypoint_copies, copies, "{act:?}");
    }
}

#[test]
fn while_the_port_is_gone_nothing_waits_for_its_return() {
    let hang_up = Fault::HangUp {
        times: Times::every(ms(100), ms(500)),
        length: ms(200),
        elsewhere: true,
    };
    let mut listener = Listener::new(with_faults(vec![hang_up]));
    let mut changes = Vec::new();
    let mut last = PortState::default();
    let mut old = 0;
    for at in (0..1_000).map(ms) {
        for (at, clock) in statuses(&listener.listen(at)) {
            assert!(at % 500 < 102 || at % 500 >= 300, "{at}");
            old += usize::from(at - clock > 2);
        }
        let port = listener.simulator.port();
        if port != last {
            changes.push((at.as_millis(), port.hang_ups, port.is_gone, port.elsewhere));
            last = port;
        }
    }
    let expected = [
        (100, 1, true, true),
        (300, 1, false, true),
        (600, 2, true, true),
        (800, 2, false, true),
    ];
    assert_eq!(changes, expected);
    assert_eq!(old, 0, "no status of before");
    let done = listener.done();
    assert_eq!(done.hang_ups, 2);
    assert!(done.unplugged_bytes > 100, "{done}");
}
