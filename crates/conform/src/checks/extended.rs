//! The extended profile and the end that speaks the other one: section 11.

use std::time::Duration;

use dsp_protocol::{Command, Profile, Sequence, Uplink, header, port};

use crate::arrival::Arrival;
use crate::bench::{ACK_TIME, Bench};
use crate::check::Check;
use crate::monitor::Rule;
use crate::outcome::{Judged, ensure};
use crate::permitted::{Harmless, QuietPort16, Raw};

const INVALID: u16 = 30;
const UNKNOWN_HEADER: u16 = 100;
const CHECK_FIELD: u16 = 102;

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks = of_numbers();
    checks.extend(of_the_other_profile());
    checks
}

fn of_numbers() -> Vec<Check> {
    let extended = |check: Check| check.only_in(Profile::Extended);
    vec![
        extended(Check::watched(
            Rule::Numbers,
            "11-sequence",
            "11",
            "with each message, in the order in which they are sent",
            "a number that is one more than that of the message before, modulo 128",
        )),
        extended(Check::harmless(
            "11-acknowledged-number",
            "11",
            "the sequence of the acknowledged command, `u7`",
            "reads and writes under 130 numbers, so that they go round",
            "each acknowledgement with the number of its command",
            |bench| async move {
                for step in 0..130 {
                    let command = match step % 2 {
                        0 => Harmless::read_16(port::STATUS_PERIOD_MS),
                        _ => Harmless::write_16(QuietPort16::FlowControlPeriod, 100),
                    };
                    bench.ask(command).await?;
                }
                Ok(())
            },
        )),
        extended(Check::harmless(
            "11-copy",
            "11",
            "It executes a command once and acknowledges every copy: a command whose number and bytes equal those of the last command is a copy.",
            "a read of an unknown port, three times under one number",
            "three acknowledgements, one error 30",
            |bench| async move {
                let frame = bench.frame(Harmless::read_16(9));
                let raw = frame.clone().then(frame.clone()).then(frame);
                bench
                    .expect(&raw, "a command and two copies", 3, &[INVALID])
                    .await
            },
        )),
        extended(Check::harmless(
            "11-new-number",
            "11",
            "with each new command, across start-up sequences",
            "a read of an unknown port under two numbers",
            "two acknowledgements, two errors 30: the second is no copy",
            |bench| async move {
                let read = Harmless::read_16(9);
                let raw = bench.frame(read).then(bench.frame(read));
                bench
                    .expect(&raw, "two equal commands", 2, &[INVALID, INVALID])
                    .await
            },
        )),
        extended(Check::harmless(
            "11-other-bytes",
            "11",
            "a command whose number and bytes equal those of the last command is a copy",
            "reads of two unknown ports under one number",
            "two acknowledgements, two errors 30: the second is no copy",
            |bench| async move {
                let number = Sequence::new(101);
                let raw = bench
                    .frame_numbered(Harmless::read_16(9), number)
                    .then(bench.frame_numbered(Harmless::read_16(11), number));
                bench
                    .expect(
                        &raw,
                        "two commands under one number",
                        2,
                        &[INVALID, INVALID],
                    )
                    .await
            },
        )),
        extended(Check::harmless(
            "11-any-number",
            "11",
            "A receiver must take any first number: the other end may have been running for a while.",
            "reads of an unknown port under the numbers 127, 0, 64 and 3",
            "an acknowledgement and an error 30 for each",
            |bench| async move {
                for number in [127, 0, 64, 3] {
                    let read = Harmless::read_16(9);
                    let raw = bench.frame_numbered(read, Sequence::new(number));
                    let what = format!("a command under number {number}");
                    bench.expect(&raw, &what, 1, &[INVALID]).await?;
                }
                Ok(())
            },
        )),
        extended(Check::harmless(
            "11-kind",
            "11",
            "The order of judgement is: kind (an unknown one is discarded like an unknown header), CRC, padding, value.",
            "a read with an unknown kind, with a right and with a wrong CRC",
            "error 100 each time, no acknowledgement",
            |bench| async move {
                let read = Harmless::read_16(port::STATUS_PERIOD_MS);
                let wrong = bench.frame(read).flip(2, 0x02);
                let right = wrong.clone().sealed(Profile::Extended);
                for raw in [right, wrong] {
                    bench
                        .expect(&raw, "a read with an unknown kind", 0, &[UNKNOWN_HEADER])
                        .await?;
                }
                Ok(())
            },
        )),
        extended(Check::harmless(
            "11-crc-of-the-pc",
            "11",
            "It is sent as a `u32` of section 3: five bytes, the topmost 4 bits first.",
            "a read with each of the 35 bits of its CRC field changed in turn",
            "error 102 each time, no acknowledgement",
            |bench| async move {
                for index in 1..=5 {
                    for bit in 0..7 {
                        let read = Harmless::read_16(port::STATUS_PERIOD_MS);
                        let raw = bench.frame(read).flip(-index, 1 << bit);
                        let what = format!("a read with bit {bit} of byte n−{index} changed");
                        bench.expect(&raw, &what, 0, &[CHECK_FIELD]).await?;
                    }
                }
                Ok(())
            },
        )),
    ]
}

fn of_the_other_profile() -> Vec<Check> {
    vec![Check::harmless(
        "11-other-profile",
        "11",
        "A DSP that meets one sends error 100 at once, in its own profile, whether or not status transmission is active, but only if it has sent no such error in the last second.",
        "clear errors in the other profile: twice within 0.2 s, and once 1.5 s later, while a status comes each 5 s",
        "one error 100 within 50 ms, and one more; no acknowledgement",
        |bench| async move {
            bench.sleep(Duration::from_millis(1_200)).await;
            bench.set_period(5_000).await?;
            bench.statuses(1).await?;
            let raw = in_other_profile(bench.profile());
            let mark = bench.mark();
            let at = bench.send_raw(&raw, "clear errors in the other profile")?;
            let limit = at + ACK_TIME + bench.frame_time() + bench.slack();
            let first = loop {
                match bench.next(limit).await {
                    Some(arrival) if arrival.link_error() == Some(UNKNOWN_HEADER) => break true,
                    Some(_) => {}
                    None => break false,
                }
            };
            ensure(first, || "no error 100 came at once".to_owned())?;
            bench.sleep(Duration::from_millis(150)).await;
            bench.send_raw(&raw, "clear errors in the other profile")?;
            bench.sleep(Duration::from_millis(150)).await;
            judge_alarms(&bench, mark, 1).await?;
            bench.sleep(Duration::from_millis(1_500)).await;
            bench.send_raw(&raw, "clear errors in the other profile")?;
            judge_alarms(&bench, mark, 2).await
        },
    )]
}

/// Judges how many alarms have come since `mark`; a command behind them bounds the wait.
async fn judge_alarms(bench: &Bench, mark: usize, count: usize) -> Judged {
    bench.ask(Harmless::read_16(port::STATUS_PERIOD_MS)).await?;
    bench.sleep(bench.frame_time() + bench.line_time(20)).await;
    let seen = bench.since(mark);
    let alarms = seen.iter().filter_map(Arrival::link_error).count();
    ensure(alarms == count, || {
        format!("{alarms} errors came about the other profile where {count} should have")
    })?;
    let acks = seen.iter().filter_map(Arrival::ack);
    let strange = acks.filter(|ack| {
        matches!(ack, dsp_protocol::Downlink::Ack { command } if *command == Command::ClearErrors.code())
    });
    ensure(strange.count() == 0, || {
        "a command of the other profile was acknowledged".to_owned()
    })
}

fn in_other_profile(profile: Profile) -> Raw {
    let clear = Uplink::Command(Command::ClearErrors);
    let frame = match profile {
        Profile::Classic => clear.encode_in(Profile::Extended, Sequence::new(5)),
        Profile::Extended => clear.encode_in(Profile::Classic, Sequence::FIRST),
    };
    debug_assert!(
        frame
            .as_bytes()
            .first()
            .copied()
            .is_some_and(header::is_header)
    );
    Raw::bytes(frame.as_bytes())
}
