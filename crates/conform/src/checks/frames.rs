//! Bytes and frames: sections 1, 2 and 3, and what is reported about rejected bytes (section 5.1).

use std::time::Duration;

use dsp_protocol::{Profile, header, port};

use crate::bench::Bench;
use crate::check::Check;
use crate::monitor::Rule;
use crate::outcome::Judged;
use crate::permitted::{Harmless, QuietPort32, Raw};

/// Errors of the DSP about bytes of the PC.
const UNKNOWN_HEADER: u16 = 100;
const CHECK_FIELD: u16 = 102;
const INVALID: u16 = 30;

/// A frame whose damage moves nothing: the read of port 10001.
const READ: Harmless = Harmless::read_16(port::STATUS_PERIOD_MS);

/// Its bytes before the command's code.
fn front(profile: Profile) -> isize {
    match profile {
        Profile::Classic => 1,
        Profile::Extended => 3,
    }
}

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks = of_the_line();
    checks.extend(of_rejections());
    checks
}

fn of_the_line() -> Vec<Check> {
    vec![
        Check::harmless(
            "1-bytes-apart",
            "1",
            "A receiver assumes nothing about the timing within a frame: bytes may arrive one by one or all at once.",
            "a read, each byte 20 ms after the one before",
            "one acknowledgement",
            |bench| async move {
                let pieces = single_bytes(&bench);
                let reaction = bench
                    .provoke_pieces(&pieces, Duration::from_millis(20), "a read byte by byte")
                    .await?;
                reaction.judge("a read byte by byte", 1, &[])
            },
        ),
        Check::harmless(
            "2-no-timeout-within-frame",
            "2",
            "There is no time-out within a frame.",
            "the first two bytes of a read, and 1.5 s later the others",
            "one acknowledgement",
            |bench| async move {
                let frame = bench.frame(READ);
                let pieces = [frame.clone().cut(2), frame.rest(2)];
                let what = "a read with a pause of 1.5 s in its middle";
                let pause = Duration::from_millis(1_500);
                let reaction = bench.provoke_pieces(&pieces, pause, what).await?;
                reaction.judge(what, 1, &[])
            },
        ),
        Check::harmless(
            "8.2-burst",
            "8.2",
            "the DSP must be able to receive 40 bytes without a pause (28 in the classic profile)",
            "17 bytes that are no frame (23 in the extended profile) and a write of 32 bits behind them without a pause",
            "one acknowledgement, no error",
            |bench| async move {
                let height = bench.read_32(port::TAKE_OFF_ALTITUDE_M).await?;
                let write = Harmless::write_32(QuietPort32::TakeOffAltitude, height);
                let strays = match bench.profile() {
                    Profile::Classic => 17,
                    Profile::Extended => 23,
                };
                let raw = Raw::strays(3, strays).then(bench.frame(write));
                bench
                    .expect(&raw, "a write at the end of a burst", 1, &[])
                    .await
            },
        ),
        Check::watched(
            Rule::Frames,
            "2-frames",
            "2",
            "A message is one frame:",
            "only whole frames with headers of the DSP, nothing between them",
        ),
        Check::watched(
            Rule::CheckField,
            "2-checksum",
            "2",
            "checksum, bit 7 is 0: the sum of bytes 0 … n−2, cut to 7 bits",
            "a right checksum in each frame",
        )
        .only_in(Profile::Classic),
        Check::watched(
            Rule::CheckField,
            "11-crc",
            "11",
            "CRC, `u32`: CRC-32/ISCSI (polynomial `0x1EDC6F41`, reflected, initial value and final xor `0xFFFFFFFF`) over bytes 0 … n−6 as they are on the line",
            "a right CRC in each frame",
        )
        .only_in(Profile::Extended),
        Check::watched(
            Rule::Padding,
            "3-padding",
            "3",
            "Its bits are right-aligned; the unused bits on top are zero",
            "no frame with an unused bit that is set",
        ),
        Check::watched(
            Rule::Values,
            "4.1-values",
            "4.1",
            "bits 1…6 are zero, a receiver rejects others (*value*)",
            "no frame with a value that the field cannot have",
        ),
        Check::watched(
            Rule::Profile,
            "11-profile",
            "11",
            "Both ends are configured to speak either the *classic* profile, which is everything above, or the *extended* profile.",
            "only frames of the profile that the kit was told",
        ),
    ]
}

fn of_rejections() -> Vec<Check> {
    vec![
        Check::harmless(
            "5.1-damaged-byte",
            "5.1",
            "102 for a wrong checksum",
            "a read with one bit changed in each of its bytes in turn, but for header and kind",
            "error 102 each time, no acknowledgement",
            damaged_bytes,
        ),
        Check::harmless(
            "5.1-damaged-header",
            "5.1",
            "error 100 for an unknown header",
            "a read whose header has one bit changed, for three of the bits",
            "error 100 each time, no acknowledgement",
            |bench| async move {
                for flip in [0x01, 0x04, 0x20] {
                    let raw = bench.frame(READ).flip(0, flip);
                    let what = "a read with a damaged header";
                    bench.expect(&raw, what, 0, &[UNKNOWN_HEADER]).await?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "2-unknown-header",
            "2",
            "A header of the other direction, or none of the table, is an *unknown header*: it and all bytes up to the next header are discarded, and they count once.",
            "the header of a status, and one that no message has, with five bytes behind each",
            "one error 100 for each, no acknowledgement",
            |bench| async move {
                for header in [header::STATUS, 0x81] {
                    let raw = Raw::bytes([header]).then(Raw::strays(40, 5));
                    let what = format!("header {header:02X}");
                    bench.expect(&raw, &what, 0, &[UNKNOWN_HEADER]).await?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "2-lost-bit-7",
            "2",
            "a byte without bit 7 while no message is open",
            "a read whose header has lost bit 7",
            "nothing",
            |bench| async move {
                let raw = bench.frame(READ).flip(0, 0x80);
                bench.expect(&raw, "a read without a header", 0, &[]).await
            },
        ),
        Check::harmless(
            "2-gained-bit-7",
            "2",
            "A header inside a message starts a new message: the receiver discards what had arrived of the old one (*truncated*).",
            "a read with bit 7 set in a byte of its middle, so that an unknown header begins there",
            "one error 100, for the header; no acknowledgement",
            |bench| async move {
                let raw = bench.frame(READ).flip(3, 0x80);
                let what = "a read with a header in its middle";
                bench.expect(&raw, what, 0, &[UNKNOWN_HEADER]).await
            },
        ),
        Check::harmless(
            "5.1-truncated",
            "5.1",
            "nothing for strays and truncated messages",
            "the first bytes of a read, for each number of them, and a whole command behind them",
            "the acknowledgement of the command, no error",
            |bench| async move {
                let len = bench.frame(READ).as_bytes().len();
                for count in 1..len {
                    let raw = bench.frame(READ).cut(count);
                    let what = format!("{count} bytes of a read");
                    bench.expect(&raw, &what, 0, &[]).await?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "2-stray",
            "2",
            "(*stray*; a run of such bytes counts once)",
            "60 bytes without bit 7, and then 3 right behind a read",
            "no error, and the acknowledgement of the read",
            |bench| async move {
                let raw = Raw::strays(7, 60);
                bench.expect(&raw, "60 stray bytes", 0, &[]).await?;
                let raw = bench.frame(READ).then(Raw::strays(90, 3));
                bench
                    .expect(&raw, "a read and 3 stray bytes behind it", 1, &[])
                    .await
            },
        ),
        Check::harmless(
            "2-resynchronise",
            "2",
            "So a receiver is in step again at the first header after any disturbance.",
            "five times 200 bytes of noise, and a read behind each",
            "the acknowledgement of each read, at the first attempt",
            |bench| async move {
                for seed in 1..=5 {
                    let raw = noise(seed);
                    let what = format!("noise {seed}");
                    bench.provoke(&raw, &what).await?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "5.1-padding",
            "5.1",
            "30 for an unknown command, padding or value",
            "a read with an unused bit of its port set and a right check field",
            "error 30, no acknowledgement",
            |bench| async move {
                let at = front(bench.profile()) + 1;
                let raw = bench.frame(READ).flip(at, 0x40).sealed(bench.profile());
                let what = "a read with an unused bit set";
                bench.expect(&raw, what, 0, &[INVALID]).await
            },
        ),
        Check::harmless(
            "2-order-of-judgement",
            "2",
            "A receiver judges a whole frame in this order: *checksum*, then *padding* (section 3), then *value* (sections 4 and 5).",
            "a read with an unused bit of its port set and a wrong check field",
            "error 102 alone, no acknowledgement",
            |bench| async move {
                let at = front(bench.profile()) + 1;
                let raw = bench.frame(READ).flip(at, 0x40);
                let what = "a read with an unused bit set and a wrong check field";
                bench.expect(&raw, what, 0, &[CHECK_FIELD]).await
            },
        ),
        Check::harmless(
            "5.1-unknown-command",
            "5.1",
            "it is discarded up to the next header whatever its checksum (*unknown command*), is not acknowledged, and the DSP reports error 30.",
            "commands 8, 12 and 68, with a right and with a wrong check field",
            "error 30 for each, no acknowledgement",
            |bench| async move {
                let at = front(bench.profile());
                // Clear errors is command 4.
                for flip in [0x0C, 0x08, 0x40] {
                    let wrong = bench.frame(Harmless::CLEAR_ERRORS).flip(at, flip);
                    let right = wrong.clone().sealed(bench.profile());
                    let what = format!("command {}", 4 ^ flip);
                    bench.expect(&right, &what, 0, &[INVALID]).await?;
                    bench.expect(&wrong, &what, 0, &[INVALID]).await?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "2-damaged-write",
            "2",
            "It discards a frame that it rejects for any of them as a whole",
            "a write of port 20121 with a damaged value, and a read of the port",
            "error 102, and the value from before",
            |bench| async move {
                let before = bench.read_32(port::TAKE_OFF_ALTITUDE_M).await?;
                let write = Harmless::write_32(QuietPort32::TakeOffAltitude, 12.5);
                // A low bit of the value, so that what a DSP might take is in the range.
                let raw = bench.frame(write).flip(front(bench.profile()) + 7, 0x01);
                let what = "a write with a damaged value";
                bench.expect(&raw, what, 0, &[CHECK_FIELD]).await?;
                let after = bench.read_32(port::TAKE_OFF_ALTITUDE_M).await?;
                crate::outcome::ensure(before.to_bits() == after.to_bits(), || {
                    format!("port 20121 was {before} and is {after} after a damaged write")
                })
            },
        ),
    ]
}

async fn damaged_bytes(bench: Bench) -> Judged {
    let len = bench.frame(READ).as_bytes().len() as isize;
    for index in 1..len {
        // The kind has an error of its own (section 11).
        if bench.profile() == Profile::Extended && index == 2 {
            continue;
        }
        // Bit 1 leaves the length as it is: command 0 becomes command 2.
        let raw = bench.frame(READ).flip(index, 0x02);
        let what = format!("a read with a changed bit in byte {index}");
        bench.expect(&raw, &what, 0, &[CHECK_FIELD]).await?;
    }
    Ok(())
}

fn single_bytes(bench: &Bench) -> Vec<Raw> {
    let frame = bench.frame(READ);
    let bytes = frame.as_bytes().iter();
    bytes.map(|byte| Raw::bytes([*byte])).collect()
}

/// 200 bytes in which no message of the PC begins.
fn noise(seed: u32) -> Raw {
    let mut state = seed.wrapping_mul(0x9E37_79B9) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        (state >> 11) as u8
    };
    let byte = |byte| match byte {
        header::COMMAND | header::WAYPOINT | header::EXTENDED_UPLINK => byte & 0x7F,
        other => other,
    };
    Raw::bytes((0..200).map(|_| byte(next())).collect::<Vec<u8>>())
}
