//! The path buffer, the numbers of waypoints, and the loss of the PC: sections 8.4, 8.8, 9 and 11.

use std::time::Duration;

use dsp_protocol::{FlowControl, Profile, Waypoint, port};

use crate::arrival::Arrival;
use crate::bench::Bench;
use crate::check::{Check, StartPlace};
use crate::outcome::{Judged, broken, ensure, not_judged};
use crate::permitted::{Harmless, QuietPort16, QuietPort32, RotorDisconnected};
use crate::pilot::{
    FLOW_MS, HEIGHT_M, INVALID, MOVEMENT_LIMIT, ON, PLACES, count, far_from, fill, flow_is,
    link_errors, next_count, offer_as, position, refused, silent, taken, taken_as,
};

/// Error of a waypoint that finds the buffer full.
const FULL: u16 = 15;

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks = of_the_buffer();
    checks.extend(of_waypoint_numbers());
    checks.extend(of_the_loss_of_the_pc());
    checks
}

fn of_the_buffer() -> Vec<Check> {
    vec![
        Check::moving(
            StartPlace::Hover,
            "8.4-taken",
            "8.4",
            "takes it: one more in port 10003",
            "three waypoints",
            "one more in port 10003 behind each, no error",
            |bench, proof| async move {
                let from = position(&bench).await?;
                for index in 0..3 {
                    taken(&bench, proof, far_from(&from, index)).await?;
                }
                Ok(())
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-sixteen-places",
            "8.4",
            "finds the buffer full",
            "17 waypoints that are far away",
            "16 that are taken, and error 15 for the last one",
            |bench, proof| async move {
                let from = position(&bench).await?;
                fill(&bench, proof, &from, PLACES).await?;
                refused(&bench, proof, far_from(&from, 17), FULL).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-two-free-places",
            "8.4",
            "buffer (16 waypoints) has at least two free places. The second place is for a waypoint that is still on its way.",
            "14 waypoints, and one more",
            "flow control 1 with 14 in the buffer, 0 with 15",
            |bench, proof| async move {
                let from = position(&bench).await?;
                flow_is(&bench, FlowControl::Send, "the empty buffer").await?;
                fill(&bench, proof, &from, PLACES - 2).await?;
                flow_is(&bench, FlowControl::Send, "14 waypoints").await?;
                taken(&bench, proof, far_from(&from, 15)).await?;
                flow_is(&bench, FlowControl::Stop, "15 waypoints").await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-invalidate-path",
            "8.4",
            "emptied; the helicopter brakes and hovers on the spot",
            "15 waypoints, invalidate path, and 16 waypoints",
            "flow control 1 again, and 16 that are taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                fill(&bench, proof, &from, PLACES - 1).await?;
                bench.ask(Harmless::INVALIDATE_PATH).await?;
                flow_is(&bench, FlowControl::Send, "invalidate path").await?;
                fill(&bench, proof, &from, PLACES).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-following-off-empties",
            "8.4",
            "invalidate path, following off",
            "15 waypoints, following off, a waypoint, following on",
            "error 30 for the waypoint, flow control 1 at the end",
            |bench, proof| async move {
                let from = position(&bench).await?;
                fill(&bench, proof, &from, PLACES - 1).await?;
                bench.ask(Harmless::FOLLOWING_OFF).await?;
                refused(&bench, proof, far_from(&from, 20), INVALID).await?;
                bench.ask(proof.permit(ON)).await?;
                flow_is(&bench, FlowControl::Send, "following off and on").await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-equal-waypoint",
            "8.4",
            "equals the newest waypoint in the buffer, the one being flown included, in all three values",
            "a waypoint, and the same under a new number; then two that differ in one step of one value",
            "the second is discarded in silence, the others are taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                let waypoint = far_from(&from, 0);
                taken(&bench, proof, waypoint).await?;
                silent(&bench, proof, waypoint).await?;
                let higher = Waypoint {
                    altitude_m: waypoint.altitude_m + 0.001,
                    ..waypoint
                };
                taken(&bench, proof, higher).await?;
                taken(&bench, proof, waypoint).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "9-waypoint-limits",
            "9",
            "A waypoint has the limits of the geographic position; the DSP discards one outside them with error 30.",
            "waypoints one step beyond each limit of latitude, longitude and altitude, and one at three limits",
            "error 30 for each, port 10003 as before; the last one is taken",
            |bench, proof| async move {
                let from = far_from(&position(&bench).await?, 0);
                let beyond = [
                    Waypoint {
                        latitude_deg: 90.000_000_1,
                        ..from
                    },
                    Waypoint {
                        latitude_deg: -90.000_000_1,
                        ..from
                    },
                    Waypoint {
                        longitude_deg: 180.000_000_1,
                        ..from
                    },
                    Waypoint {
                        longitude_deg: -180.000_000_1,
                        ..from
                    },
                    Waypoint {
                        altitude_m: 20_000.001,
                        ..from
                    },
                    Waypoint {
                        altitude_m: -1_000.001,
                        ..from
                    },
                ];
                for waypoint in beyond {
                    refused(&bench, proof, waypoint, INVALID).await?;
                }
                // Both ends are inside. The helicopter sets out slowly, and hovers when the check is over.
                let at_the_end = Waypoint {
                    latitude_deg: 90.0,
                    longitude_deg: -180.0,
                    altitude_m: 20_000.0,
                };
                taken(&bench, proof, at_the_end).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-too-low",
            "8.4",
            "lies outside the limits of section 9, or lower than 0.5 m above take-off",
            "a waypoint 2 m below the point of take-off",
            "error 30; port 10003 as before",
            |bench, proof| async move {
                let from = position(&bench).await?;
                let low = Waypoint {
                    altitude_m: from.altitude_m - f64::from(HEIGHT_M) - 2.0,
                    ..far_from(&from, 0)
                };
                refused(&bench, proof, low, INVALID).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.4-reached",
            "8.4",
            "A waypoint leaves the buffer when it is reached.",
            "a waypoint 2 m higher, and the same again when the helicopter is there and the buffer is empty",
            "a helicopter that is there, and a second waypoint that is taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                let speed = Harmless::write_32(QuietPort32::ClimbSpeed, 2.0);
                bench.ask(speed).await?;
                // A DSP may count the climb into its cruise speed.
                let speed = Harmless::write_32(QuietPort32::CruiseSpeed, 2.0);
                bench.ask(speed).await?;
                let radius = Harmless::write_32(QuietPort32::AcceptanceRadius, 0.5);
                bench.ask(radius).await?;
                let higher = Waypoint {
                    latitude_deg: from.latitude_deg,
                    longitude_deg: from.longitude_deg,
                    altitude_m: from.altitude_m + 2.0,
                };
                taken(&bench, proof, higher).await?;
                let limit = bench.now() + MOVEMENT_LIMIT;
                while position(&bench).await?.altitude_m < from.altitude_m + 1.3 {
                    if bench.now() > limit {
                        return not_judged(
                            "the helicopter does not fly to the waypoint: without a rotor it cannot",
                        );
                    }
                }
                bench.sleep(Duration::from_secs(5)).await;
                taken(&bench, proof, higher).await
            },
        ),
    ]
}

fn of_waypoint_numbers() -> Vec<Check> {
    let checks = vec![
        Check::moving(
            StartPlace::Hover,
            "11-waypoint-copy",
            "11",
            "A waypoint whose number equals that of the last waypoint that was taken is a copy and is discarded in silence.",
            "a waypoint, another under the same number, and it under the next",
            "the first and the last are taken, the other is discarded in silence",
            |bench, proof| async move {
                let from = position(&bench).await?;
                taken_as(&bench, proof, far_from(&from, 0), 40).await?;
                let before = count(&bench).await?;
                let came = offer_as(&bench, proof, far_from(&from, 1), 40).await?;
                ensure(came == (before, Vec::new()), || {
                    format!(
                        "a waypoint under the number of the last one: errors {:?}, port 10003 0x{:04X}",
                        came.1, came.0
                    )
                })?;
                taken_as(&bench, proof, far_from(&from, 1), 41).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "11-number-forgotten",
            "11",
            "Invalidate path, following off and the PC time-out make the DSP forget the number of the waypoint.",
            "a waypoint, invalidate path, another under the same number; the same with following off and on, and with a PC time-out of 0.5 s and 1 s of silence",
            "all are taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                taken_as(&bench, proof, far_from(&from, 0), 50).await?;
                bench.ask(Harmless::INVALIDATE_PATH).await?;
                taken_as(&bench, proof, far_from(&from, 1), 50).await?;
                bench.ask(Harmless::FOLLOWING_OFF).await?;
                bench.ask(proof.permit(ON)).await?;
                taken_as(&bench, proof, far_from(&from, 2), 50).await?;
                let write = Harmless::write_16(QuietPort16::PcTimeout, 500);
                bench.ask(write).await?;
                if bench.read_16(port::PC_TIMEOUT_MS).await? != 500 {
                    // A classic DSP has no PC time-out.
                    return Ok(());
                }
                bench.sleep(Duration::from_secs(1)).await;
                taken_as(&bench, proof, far_from(&from, 3), 50).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "11-refused-number",
            "11",
            "A waypoint that was discarded with an error leaves no number behind.",
            "a waypoint outside the limits, and another under the same number",
            "error 30, and a waypoint that is taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                let beyond = Waypoint {
                    latitude_deg: 91.0,
                    ..far_from(&from, 0)
                };
                let (_, errors) = offer_as(&bench, proof, beyond, 60).await?;
                ensure(errors == [INVALID], || {
                    format!("errors {errors:?} came where [30] should have")
                })?;
                taken_as(&bench, proof, far_from(&from, 0), 60).await
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "11-copy-of-read",
            "11",
            "It answers a copy of a read with the value of the first time.",
            "a read of 10003, a waypoint, and the same read under the same number",
            "the count from before the waypoint, and one more under a new number",
            |bench, proof| async move {
                let from = position(&bench).await?;
                let read = Harmless::read_16(port::WAYPOINT_COUNT);
                let frame = bench.frame(read);
                let mark = bench.mark();
                bench.send_raw(&frame, "read 10003")?;
                bench.statuses(2).await?;
                bench.send(proof.permit(far_from(&from, 0)))?;
                bench.send_raw(&frame, "read 10003, a copy")?;
                bench.statuses(2).await?;
                let values: Vec<u16> = bench
                    .since(mark)
                    .iter()
                    .filter_map(|seen| match seen.event {
                        Ok(dsp_protocol::Downlink::Ack16 { value, .. }) => Some(value),
                        _ => None,
                    })
                    .collect();
                let [first, copy] = values[..] else {
                    return broken(format!(
                        "{} answers came to a read and its copy",
                        values.len()
                    ));
                };
                ensure(first == copy, || {
                    format!("a read gave 0x{first:04X}, its copy 0x{copy:04X}")
                })?;
                let after = count(&bench).await?;
                ensure(after == next_count(first), || {
                    format!("port 10003 reads 0x{after:04X}, 0x{first:04X} before one waypoint")
                })
            },
        ),
    ];
    let extended = |check: Check| check.only_in(Profile::Extended);
    checks.into_iter().map(extended).collect()
}

fn of_the_loss_of_the_pc() -> Vec<Check> {
    vec![
        Check::moving(
            StartPlace::Hover,
            "8.8-pc-timeout",
            "8.8",
            "it empties the buffer, forgets the number of the last waypoint, and hovers on the spot",
            "a PC time-out of 1 s, 15 waypoints, and 3 s of silence",
            "flow control 0 for 1 s, and 1 within 0.3 s and two flow control periods then",
            |bench, proof| async move {
                let armed = arm(&bench, proof, 1_000).await?.at;
                let mark = bench.mark();
                bench.sleep(Duration::from_secs(3)).await;
                let seen = bench.since(mark);
                let send = |arrival: &&Arrival| arrival.flow() == Some(FlowControl::Send);
                let Some(first) = seen.iter().find(send) else {
                    return broken("the buffer was not emptied after the PC time-out");
                };
                let after = first.at.saturating_sub(armed);
                // 5 ms: the DSP may count in steps. What this computer sees late is later still.
                ensure(after >= Duration::from_millis(995), || {
                    format!(
                        "flow control 1 came {} ms after the last message of the PC, before the PC time-out",
                        after.as_millis()
                    )
                })?;
                let limit = Duration::from_millis(1_300 + 2 * u64::from(FLOW_MS))
                    + 2 * bench.frame_time()
                    + bench.slack();
                ensure(after <= limit, || {
                    format!(
                        "flow control 1 came {} ms after the last message of the PC, long after the PC time-out",
                        after.as_millis()
                    )
                })
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.8-sign-of-life",
            "8.8",
            "Any valid message of the PC restarts the time.",
            "a PC time-out of 1 s, 15 waypoints, and a read each 300 ms for 3 s",
            "flow control 0 all the time",
            |bench, proof| async move {
                arm(&bench, proof, 1_000).await?;
                let mark = bench.mark();
                for _ in 0..10 {
                    bench.sleep(Duration::from_millis(300)).await;
                    bench.read_16(port::PC_TIMEOUT_MS).await?;
                }
                all_stop(
                    &bench,
                    mark,
                    "the buffer was emptied although the PC was not silent",
                )
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.8-waypoint-sign-of-life",
            "8.8",
            "no valid message of the PC (command or waypoint, also one that is a copy or is refused) has arrived for that long",
            "a PC time-out of 1 s, 15 waypoints, and each 300 ms for 3 s the newest of them again; then each 300 ms for 3 s one outside the limits",
            "flow control 0 all the time",
            |bench, proof| async move {
                let newest = arm(&bench, proof, 1_000).await?.newest;
                let beyond = Waypoint {
                    latitude_deg: 91.0,
                    ..newest
                };
                for (waypoint, what) in [
                    (newest, "the newest waypoint came again"),
                    (beyond, "waypoints came that are refused"),
                ] {
                    let mark = bench.mark();
                    for _ in 0..10 {
                        bench.sleep(Duration::from_millis(300)).await;
                        bench.send(proof.permit(waypoint))?;
                    }
                    all_stop(
                        &bench,
                        mark,
                        &format!("the buffer was emptied though {what}"),
                    )?;
                }
                Ok(())
            },
        ),
        Check::moving(
            StartPlace::Hover,
            "8.8-off",
            "8.8",
            "When the port is not 0, no valid message of the PC (command or waypoint, also one that is a copy or is refused) has arrived for that long",
            "a PC time-out of 0, 15 waypoints, and 3 s of silence",
            "flow control 0 all the time",
            |bench, proof| async move {
                arm(&bench, proof, 0).await?;
                let mark = bench.mark();
                bench.sleep(Duration::from_secs(3)).await;
                all_stop(
                    &bench,
                    mark,
                    "the buffer was emptied although the PC time-out is off",
                )
            },
        ),
    ]
}

/// A DSP with 15 waypoints and a PC time-out.
struct Armed {
    /// When the PC time-out was sent.
    at: Duration,
    newest: Waypoint,
}

/// Fills 15 places and sets the PC time-out.
async fn arm(bench: &Bench, proof: RotorDisconnected, timeout_ms: u16) -> Judged<Armed> {
    let from = position(bench).await?;
    let mark = bench.mark();
    let found = bench.read_16(port::PC_TIMEOUT_MS).await?;
    bench.errors(2).await?;
    if found == 0 && link_errors(bench, mark).contains(&INVALID) {
        return not_judged("a classic DSP: it has no port 10004, which it may");
    }
    fill(bench, proof, &from, PLACES - 1).await?;
    flow_is(bench, FlowControl::Stop, "15 waypoints").await?;
    let at = bench.now();
    let write = Harmless::write_16(QuietPort16::PcTimeout, timeout_ms);
    bench.ask(write).await?;
    Ok(Armed {
        at,
        newest: far_from(&from, PLACES - 2),
    })
}

fn all_stop(bench: &Bench, mark: usize, found: &str) -> Judged {
    let flows = bench.since(mark);
    let mut flows = flows.iter().filter_map(Arrival::flow);
    ensure(flows.all(|flow| flow == FlowControl::Stop), || {
        found.to_owned()
    })
}
