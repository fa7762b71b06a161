//! How the kit flies a DSP: to a hover, to the ground, waypoints and what becomes of them. All of it can move a rotor.

use std::time::Duration;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, FlowControl, Group, Sequence, StatusMask, Waypoint, port};

use crate::arrival::Arrival;
use crate::bench::Bench;
use crate::outcome::{Judged, broken, ensure, not_judged};
use crate::permitted::{Harmless, Permitted, QuietPort32, RotorDisconnected};

/// Error of a command, or a waypoint, that cannot be carried out.
pub(crate) const INVALID: u16 = 30;
/// Places of the path buffer.
pub(crate) const PLACES: usize = 16;
/// Height of the kit's take-offs, m.
pub(crate) const HEIGHT_M: f32 = 3.0;
/// How long a take-off, a landing or a short leg may take.
pub(crate) const MOVEMENT_LIMIT: Duration = Duration::from_secs(120);
/// How far away the waypoints are that are not to be reached, degrees of latitude: 1.1 km.
const FAR_DEG: f64 = 0.01;
/// How often a waypoint is sent that a line that damages bytes has lost, as the PC does.
const LOSSY_ATTEMPTS: usize = 16;
/// Flow control period between checks, ms.
pub(crate) const FLOW_MS: u16 = 100;
/// Following on.
pub(crate) const ON: Command = Command::Following { on: true };

/// Climb speed of the kit's take-offs and landings, m/s: so slow that all that is sent meanwhile comes before their
/// end.
const SLOW_CLIMB_MPS: f32 = 0.5;

/// Brings the helicopter from the ground to a hover with following on and an empty buffer, or from a hover to that.
pub(crate) async fn to_hover(bench: &Bench, proof: RotorDisconnected) -> Judged {
    bench.ask(proof.permit(ON)).await?;
    if !flies(bench).await? {
        set_height(bench).await?;
        let errors = errors_of(bench, write(proof, port::TAKE_OFF, 1)).await?;
        if !errors.is_empty() {
            return not_judged(format!("the DSP refuses the take-off: errors {errors:?}"));
        }
    }
    if bench.read_16(port::TAKE_OFF).await? != 0 || !flies(bench).await? {
        wait_for_hover(bench).await?;
    }
    // So that nothing comes near a waypoint that is not to be reached.
    let slow = Harmless::write_32(QuietPort32::CruiseSpeed, 0.1);
    bench.ask(slow).await?;
    bench.ask(Harmless::INVALIDATE_PATH).await?;
    Ok(())
}

/// Brings the helicopter to the ground, and switches following off.
pub(crate) async fn to_ground(bench: &Bench, proof: RotorDisconnected) -> Judged {
    let climbs = bench.read_16(port::TAKE_OFF).await? != 0;
    if climbs {
        bench.ask(proof.permit(ON)).await?;
        wait_for_hover(bench).await?;
    }
    if flies(bench).await? || bench.read_16(port::LAND).await? != 0 {
        bench.ask(write(proof, port::LAND, 1)).await?;
        wait_for_ground(bench).await?;
    }
    bench.ask(Harmless::FOLLOWING_OFF).await?;
    Ok(())
}

pub(crate) async fn flies(bench: &Bench) -> Judged<bool> {
    let seen = bench.statuses(2).await?;
    Ok(seen.last().is_some_and(|(_, status)| status.flying))
}

/// Waits until flow control says 1 while the helicopter flies.
pub(crate) async fn wait_for_hover(bench: &Bench) -> Judged {
    let limit = bench.now() + MOVEMENT_LIMIT;
    bench.forget();
    let mut flying = flies(bench).await?;
    while let Some(arrival) = bench.next(limit).await {
        if let Some(status) = arrival.status() {
            flying = status.flying;
        }
        if flying && arrival.flow() == Some(FlowControl::Send) {
            return Ok(());
        }
    }
    not_judged(
        "the helicopter did not come to a hover: without a rotor it cannot, unless the DSP simulates its flight",
    )
}

/// Waits until the flag is 0 and 10122 reads 0.
pub(crate) async fn wait_for_ground(bench: &Bench) -> Judged {
    let limit = bench.now() + MOVEMENT_LIMIT;
    while bench.now() < limit {
        if !flies(bench).await? && bench.read_16(port::LAND).await? == 0 {
            return Ok(());
        }
        bench.sleep(Duration::from_millis(250)).await;
    }
    broken("the landing does not end: the flag is 1 or 10122 reads 1 after two minutes")
}

/// Makes the next take-off or landing slow.
pub(crate) async fn slow_climb(bench: &Bench) -> Judged {
    let speed = Harmless::write_32(QuietPort32::ClimbSpeed, SLOW_CLIMB_MPS);
    bench.ask(speed).await.map(|_| ())
}

pub(crate) async fn set_height(bench: &Bench) -> Judged {
    let height = Harmless::write_32(QuietPort32::TakeOffAltitude, HEIGHT_M);
    bench.ask(height).await.map(|_| ())
}

/// Where the helicopter is.
pub(crate) async fn position(bench: &Bench) -> Judged<Geographic> {
    let mask = StatusMask::NONE.with(Group::Time).with(Group::Geographic);
    bench.set_mask(mask).await?;
    let seen = bench.statuses(3).await?;
    match seen.last().and_then(|(_, status)| status.geographic) {
        Some(position) => Ok(position),
        None => not_judged("the DSP sends no geographic position, from which waypoints follow"),
    }
}

/// A waypoint far to the north; each index gives another one.
pub(crate) fn far_from(from: &Geographic, index: usize) -> Waypoint {
    Waypoint {
        latitude_deg: from.latitude_deg + FAR_DEG + index as f64 * 1e-4,
        longitude_deg: from.longitude_deg,
        altitude_m: from.altitude_m + 10.0,
    }
}

pub(crate) fn write(proof: RotorDisconnected, port: u16, value: u16) -> Permitted {
    proof.permit(Command::Write16 { port, value })
}

pub(crate) async fn reads(bench: &Bench, port: u16, value: u16) -> Judged {
    let read = bench.read_16(port).await?;
    ensure(read == value, || format!("{port} reads {read}"))
}

pub(crate) fn link_errors(bench: &Bench, mark: usize) -> Vec<u16> {
    let seen = bench.since(mark);
    seen.iter().filter_map(Arrival::link_error).collect()
}

/// The errors that a command brings.
pub(crate) async fn errors_of(bench: &Bench, command: Permitted) -> Judged<Vec<u16>> {
    let mark = bench.mark();
    bench.ask(command).await?;
    bench.errors(2).await?;
    Ok(link_errors(bench, mark))
}

/// Port 10003.
pub(crate) async fn count(bench: &Bench) -> Judged<u16> {
    match count_if_any(bench).await? {
        Some(count) => Ok(count),
        None => not_judged(
            "the DSP has no port 10003, which may be missing: whether a waypoint is taken cannot be seen",
        ),
    }
}

/// Port 10003; `None` if the DSP does not have it. Then the error of the read is cleared.
pub(crate) async fn count_if_any(bench: &Bench) -> Judged<Option<u16>> {
    let count = bench.read_16(port::WAYPOINT_COUNT).await?;
    if count & 0x8000 != 0 {
        return Ok(Some(count));
    }
    bench.ask(Harmless::CLEAR_ERRORS).await?;
    bench.statuses(2).await?;
    Ok(None)
}

pub(crate) const fn next_count(count: u16) -> u16 {
    0x8000 | (count.wrapping_add(1) & 0x7FFF)
}

/// Sends a waypoint; gives port 10003 behind it, and the errors.
pub(crate) async fn offer(
    bench: &Bench,
    proof: RotorDisconnected,
    waypoint: Waypoint,
) -> Judged<(u16, Vec<u16>)> {
    let mark = bench.mark();
    bench.send(proof.permit(waypoint))?;
    let after = count(bench).await?;
    bench.errors(2).await?;
    Ok((after, link_errors(bench, mark)))
}

/// Sends a waypoint under a number of the caller's choice, and asks how many the DSP holds then.
pub(crate) async fn offer_as(
    bench: &Bench,
    proof: RotorDisconnected,
    waypoint: Waypoint,
    number: u8,
) -> Judged<(u16, Vec<u16>)> {
    let mark = bench.mark();
    let raw = bench.frame_numbered(proof.permit(waypoint), Sequence::new(number));
    bench.send_raw(&raw, &format!("a waypoint under number {number}"))?;
    let after = count(bench).await?;
    bench.errors(2).await?;
    Ok((after, link_errors(bench, mark)))
}

pub(crate) async fn taken(bench: &Bench, proof: RotorDisconnected, waypoint: Waypoint) -> Judged {
    let before = count(bench).await?;
    let came = offer(bench, proof, waypoint).await?;
    judge_taken(before, came)
}

pub(crate) async fn taken_as(
    bench: &Bench,
    proof: RotorDisconnected,
    waypoint: Waypoint,
    number: u8,
) -> Judged {
    let before = count(bench).await?;
    let came = offer_as(bench, proof, waypoint, number).await?;
    judge_taken(before, came)
}

pub(crate) fn judge_taken(before: u16, (after, errors): (u16, Vec<u16>)) -> Judged {
    ensure(after == next_count(before) && errors.is_empty(), || {
        format!(
            "a waypoint was not taken: port 10003 read 0x{before:04X} and reads 0x{after:04X}, errors {errors:?}"
        )
    })
}

pub(crate) async fn refused(
    bench: &Bench,
    proof: RotorDisconnected,
    waypoint: Waypoint,
    error: u16,
) -> Judged {
    let Some(before) = count_if_any(bench).await? else {
        let mark = bench.mark();
        bench.send(proof.permit(waypoint))?;
        bench.errors(3).await?;
        let errors = link_errors(bench, mark);
        return ensure(errors == [error], || {
            format!("a waypoint should have brought error {error}: errors {errors:?}")
        });
    };
    let (after, errors) = offer(bench, proof, waypoint).await?;
    ensure(after == before && errors == [error], || {
        format!(
            "a waypoint should have brought error {error}: errors {errors:?}, port 10003 read 0x{before:04X} and reads 0x{after:04X}"
        )
    })
}

pub(crate) async fn silent(bench: &Bench, proof: RotorDisconnected, waypoint: Waypoint) -> Judged {
    let before = count(bench).await?;
    let (after, errors) = offer(bench, proof, waypoint).await?;
    ensure(after == before && errors.is_empty(), || {
        format!(
            "a waypoint should have been discarded in silence: errors {errors:?}, port 10003 read 0x{before:04X} and reads 0x{after:04X}"
        )
    })
}

/// Sends `places` waypoints that are far away.
pub(crate) async fn fill(
    bench: &Bench,
    proof: RotorDisconnected,
    from: &Geographic,
    places: usize,
) -> Judged {
    let mut before = count(bench).await?;
    for index in 0..places {
        bench.send(proof.permit(far_from(from, index)))?;
        let mut after = count(bench).await?;
        for _ in 0..LOSSY_ATTEMPTS {
            if after != before || !bench.is_lossy() {
                break;
            }
            bench.send(proof.permit(far_from(from, index)))?;
            after = count(bench).await?;
        }
        ensure(after == next_count(before), || {
            format!(
                "waypoint {} of {places} was not taken: port 10003 read 0x{before:04X} and reads 0x{after:04X}",
                index + 1
            )
        })?;
        before = after;
    }
    Ok(())
}

/// Judges the second flow control from now on: the first may have been composed before.
pub(crate) async fn flow_is(bench: &Bench, expected: FlowControl, what: &str) -> Judged {
    let limit = bench.now()
        + 3 * Duration::from_millis(FLOW_MS.into())
        + 2 * bench.frame_time()
        + bench.slack();
    bench.forget();
    let mut seen = 0;
    while let Some(arrival) = bench.next(limit).await {
        let Some(flow) = arrival.flow() else { continue };
        seen += 1;
        if seen == 2 {
            return ensure(flow == expected, || {
                format!(
                    "behind {what} flow control says {}, {} was expected",
                    u8::from(flow == FlowControl::Send),
                    u8::from(expected == FlowControl::Send)
                )
            });
        }
    }
    broken(format!("behind {what} no flow control came"))
}
