//! For each act: which messages go in, which come out, and when; in both profiles.

use dsp_protocol::{
    Command, Downlink, DspErrorCode, FlowControl, Sequence, Status, Uplink, Waypoint,
};

use super::*;

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

const WAYPOINT: Waypoint = Waypoint {
    latitude_deg: 37.0,
    longitude_deg: -6.0,
    altitude_m: 10.0,
};

/// The six kinds of message.
fn kinds() -> [(MessageKind, Said); 6] {
    let status = Status {
        time_ms: Some(1_000),
        ..Status::default()
    };
    [
        (MessageKind::Ack, Said::Dsp(Downlink::Ack { command: 4 })),
        (
            MessageKind::FlowControl,
            Said::Dsp(Downlink::FlowControl(FlowControl::Send)),
        ),
        (MessageKind::Status, Said::Dsp(Downlink::Status(status))),
        (
            MessageKind::Error,
            Said::Dsp(Downlink::Error(DspErrorCode(30))),
        ),
        (
            MessageKind::Command,
            Said::Pc(Uplink::Command(Command::ClearErrors)),
        ),
        (MessageKind::Waypoint, Said::Pc(Uplink::Waypoint(WAYPOINT))),
    ]
}

#[derive(Clone, Copy)]
enum Said {
    Dsp(Downlink),
    Pc(Uplink),
}

impl Said {
    fn frame(self, profile: Profile, number: u8) -> Vec<u8> {
        let sequence = Sequence::new(number);
        let frame = match self {
            Said::Dsp(message) => message.encode_in(profile, sequence, Sequence::FIRST),
            Said::Pc(message) => message.encode_in(profile, sequence),
        };
        frame.as_bytes().to_vec()
    }
}

fn status(time_ms: u32) -> Vec<u8> {
    let status = Status {
        time_ms: Some(time_ms),
        ..Status::default()
    };
    Said::Dsp(Downlink::Status(status)).frame(Profile::Classic, 0)
}

fn ack(command: u8) -> Vec<u8> {
    Said::Dsp(Downlink::Ack { command }).frame(Profile::Classic, 0)
}

fn fault(message: MessageKind, act: Act) -> MessageFault {
    MessageFault::new(message, Window::ALWAYS, 1.0, act, Random::new(7, 1))
}

fn stage(faults: Vec<MessageFault>) -> MessageStage<Downlink> {
    stage_of(Profile::Classic, faults)
}

fn stage_of<M: dsp_protocol::Direction>(
    profile: Profile,
    faults: Vec<MessageFault>,
) -> MessageStage<M> {
    let mut stage = MessageStage::new(profile);
    faults.into_iter().for_each(|fault| stage.add(fault));
    stage
}

/// Feeds each piece at its time in milliseconds, then lets everything come that is late.
fn pass<M: dsp_protocol::Direction>(
    stage: &mut MessageStage<M>,
    pieces: &[(u64, Vec<u8>)],
) -> Vec<(u128, Vec<u8>)> {
    let mut out: Vec<(u128, Vec<u8>)> = Vec::new();
    let mut sink = |at: Duration, bytes: &[u8]| out.push((at.as_millis(), bytes.to_vec()));
    for (at, piece) in pieces {
        for byte in piece {
            stage.enter(ms(*at), *byte, &mut sink);
        }
    }
    stage.release(Duration::MAX, &mut sink);
    out
}

fn all_bytes(out: &[(u128, Vec<u8>)]) -> Vec<u8> {
    out.iter().flat_map(|(_, bytes)| bytes.clone()).collect()
}

#[test]
fn every_kind_of_message_is_known_in_either_profile() {
    for profile in Profile::ALL {
        for (dropped, _) in kinds() {
            let fault = || vec![fault(dropped, Act::Drop)];
            let mut downlink = stage_of::<Downlink>(profile, fault());
            let mut uplink = stage_of::<Uplink>(profile, fault());
            for (kind, example) in kinds() {
                let frame = example.frame(profile, 5);
                let pieces = [(0, frame.clone())];
                let out = match example {
                    Said::Dsp(_) => pass(&mut downlink, &pieces),
                    Said::Pc(_) => pass(&mut uplink, &pieces),
                };
                let expected = if kind == dropped { vec![] } else { frame };
                assert_eq!(
                    all_bytes(&out),
                    expected,
                    "{profile:?} {dropped:?} {kind:?}"
                );
            }
            let counters = (downlink.counters(), uplink.counters());
            assert_eq!(counters.0.dropped + counters.1.dropped, 1);
        }
    }
}

#[test]
fn what_is_no_message_passes_untouched_and_nothing_of_it_is_held() {
    // Strays, an unknown header with a tail, a message cut short by another, a wrong checksum, a header of the PC.
    let garbage = [
        vec![0x01, 0x02, 0x91, 0x05, 0x06, 0xC3, 0x04],
        vec![0xC3, 0x04, 0x00, 0x11, 0xF0, 0x04, 0x74],
        vec![0xDA, 0x01],
        ack(5),
        vec![0x7F; 300],
    ]
    .concat();
    let mut stage = stage(vec![fault(MessageKind::Status, Act::Drop)]);
    let out = pass(&mut stage, &[(0, garbage.clone())]);
    assert_eq!(all_bytes(&out), garbage);
    assert_eq!(stage.waiting(), 0);
    assert_eq!(stage.counters(), MessageCounters::default());
}

#[test]
fn a_message_comes_out_whole_when_its_last_byte_has_come() {
    let mut stage = stage(vec![fault(MessageKind::Status, Act::Repeat)]);
    let frame = ack(4);
    let pieces: Vec<(u64, Vec<u8>)> = frame
        .iter()
        .enumerate()
        .map(|(number, byte)| (10 * number as u64, vec![*byte]))
        .collect();
    assert_eq!(pass(&mut stage, &pieces[..2]), []);
    assert_eq!(stage.waiting(), 2);
    assert_eq!(pass(&mut stage, &pieces[2..]), [(20, frame)]);
    assert_eq!(stage.waiting(), 0);
}

#[test]
fn a_share_of_the_messages_is_dropped_within_the_window() {
    let window = Window::between(ms(1_000), ms(3_000));
    let fault = MessageFault::new(MessageKind::Ack, window, 0.3, Act::Drop, Random::new(1, 1));
    let mut stage = stage(vec![fault]);
    let pieces: Vec<_> = (0..4_000).map(|at| (at, ack((at % 8) as u8))).collect();
    let out = pass(&mut stage, &pieces);
    let counters = stage.counters();
    assert_eq!(out.len() as u64 + counters.dropped, 4_000);
    assert_eq!(counters.dropped_bytes, 3 * counters.dropped);
    assert!((500..700).contains(&counters.dropped), "{counters:?}");
    let outside = out.iter().filter(|(at, _)| !(1_000..3_000).contains(at));
    assert_eq!(outside.count(), 2_000);
}

#[test]
fn a_repeated_message_comes_twice_at_once() {
    let mut stage = stage(vec![fault(MessageKind::Ack, Act::Repeat)]);
    let out = pass(&mut stage, &[(5, ack(1)), (6, status(1)), (7, ack(2))]);
    let expected = [
        (5, ack(1)),
        (5, ack(1)),
        (6, status(1)),
        (7, ack(2)),
        (7, ack(2)),
    ];
    assert_eq!(out, expected);
    let counters = stage.counters();
    assert_eq!((counters.repeated, counters.repeated_bytes), (2, 6));
}

#[test]
fn a_late_message_is_overtaken_and_never_put_into_another() {
    let mut stage = stage(vec![fault(MessageKind::Ack, Act::Late(ms(70)))]);
    let long = status(9);
    let (front, back) = long.split_at(4);
    let out = pass(
        &mut stage,
        &[
            (10, ack(1)),
            (11, ack(2)),
            (20, status(1)),
            // While this one is on the serial link, the first ack becomes due.
            (75, front.to_vec()),
            (80, back.to_vec()),
            (90, status(2)),
        ],
    );
    let expected = [
        (20, status(1)),
        (80, ack(1)),
        (80, long.clone()),
        (81, ack(2)),
        (90, status(2)),
    ];
    assert_eq!(out, expected);
    assert_eq!(stage.counters().late, 2);
}

#[test]
fn late_messages_tell_when_they_come() {
    let mut stage = stage(vec![fault(MessageKind::Ack, Act::Late(ms(70)))]);
    let mut out = Vec::new();
    for byte in ack(1) {
        stage.enter(ms(10), byte, &mut |_, bytes| out.extend_from_slice(bytes));
    }
    assert_eq!(stage.next_deadline(), Some(ms(80)));
    assert_eq!(stage.waiting(), 3);
    stage.release(ms(79), &mut |_, _| panic!("too early"));
    stage.release(ms(80), &mut |_, bytes| out.extend_from_slice(bytes));
    assert_eq!(out, ack(1));
    assert_eq!((stage.next_deadline(), stage.waiting()), (None, 0));
}

#[test]
fn two_messages_change_places() {
    let mut stage = stage(vec![fault(MessageKind::Status, Act::Reorder)]);
    let pieces: Vec<_> = (1..=5)
        .map(|number| (number, status(number as u32)))
        .collect();
    let mut with_ack = pieces.clone();
    with_ack.insert(1, (1, ack(1)));
    let out = pass(&mut stage, &with_ack);
    let expected = [
        (1, ack(1)),
        (2, status(2)),
        (2, status(1)),
        (4, status(4)),
        (4, status(3)),
    ];
    assert_eq!(out, expected);
    assert_eq!(stage.counters().reordered, 3);
    assert_eq!(stage.waiting(), status(5).len(), "it waits for the next");
}

#[test]
fn acts_on_one_message_add_up() {
    let late = |milliseconds| fault(MessageKind::Ack, Act::Late(ms(milliseconds)));
    let repeat = fault(MessageKind::Ack, Act::Repeat);
    let mut two_late = stage(vec![late(3), repeat, late(4)]);
    let out = pass(&mut two_late, &[(0, ack(1))]);
    assert_eq!(out, [(7, ack(1)), (7, ack(1))]);

    let repeat = fault(MessageKind::Ack, Act::Repeat);
    let drop = fault(MessageKind::Ack, Act::Drop);
    let mut dropped = stage(vec![drop, repeat]);
    assert_eq!(pass(&mut dropped, &[(0, ack(1))]), []);
    assert_eq!(dropped.counters().repeated, 0);
}

#[test]
fn late_messages_are_bounded_and_the_others_in_time() {
    let mut stage = stage(vec![fault(MessageKind::Ack, Act::Late(ms(1_000)))]);
    let pieces: Vec<_> = (0..100).map(|at| (at, ack(4))).collect();
    let out = pass(&mut stage, &pieces);
    let in_time = out.iter().filter(|(at, _)| *at < 1_000).count();
    assert_eq!((in_time, out.len()), (100 - MAX_LATE, 100));
    assert_eq!(stage.counters().late, MAX_LATE as u64);
}
