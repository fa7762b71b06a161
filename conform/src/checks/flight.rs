//! Flow control, waypoints, take-off, landing and the loss of the PC: sections 8.4, 8.5 and 8.8. All of it can move a rotor,
//! so every function here takes the proof that none is connected.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, FlowControl, Group, Profile, Sequence, StatusMask, Waypoint, port};

use crate::bench::{Arrival, Bench, Judged, Stop, broken, ensure, not_judged};
use crate::check::{Check, Place};
use crate::permitted::{Harmless, QuietPort16, QuietPort32, RotorDisconnected};

const INVALID: u16 = 30;
const FULL: u16 = 15;
/// Places of the path buffer.
const PLACES: usize = 16;
/// Height of the kit's take-offs, m.
const HEIGHT_M: f32 = 3.0;
/// How long a take-off, a landing or a short leg may take.
const MOVEMENT_LIMIT: Duration = Duration::from_secs(120);
/// How far away the waypoints are that are not to be reached, degrees of latitude: 1.1 km.
const FAR_DEG: f64 = 0.01;
/// How often a waypoint is sent that a line that damages bytes has lost, as the PC does.
const LOSSY_ATTEMPTS: usize = 16;
/// Flow control period of these checks, ms.
const FLOW_MS: u16 = 100;

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks = on_the_ground();
    checks.extend(of_a_take_off());
    checks.extend(of_the_buffer());
    checks.extend(of_waypoint_numbers());
    checks.extend(of_the_loss_of_the_pc());
    checks.extend(of_a_landing());
    checks
}

/// Following on.
const ON: Command = Command::Following { on: true };

fn on_the_ground() -> Vec<Check> {
    vec![
        Check::moving(
            Place::Ground,
            "8.4-flow-control",
            "8.4",
            "While following is on, the DSP sends flow control every flow control period; the first comes one period after following was switched on.",
            "a flow control period of 200 ms, following on, and following on again 1.1 s later",
            "flow control 0 after 200 ms and then every 200 ms: the helicopter stands",
            |bench, proof| async move {
                let write = Harmless::write_16(QuietPort16::FlowControlPeriod, 200);
                bench.ask(write).await?;
                let mark = bench.mark();
                let mut last = bench.ask(proof.permit(ON)).await?.at;
                bench.sleep(Duration::from_millis(1_100)).await;
                bench.ask(proof.permit(ON)).await?;
                bench.sleep(Duration::from_millis(1_000)).await;
                let late =
                    (bench.slack() + bench.frame_time() + bench.line_time(30)).as_secs_f64() * 1e3;
                let seen = bench.since(mark);
                let flows = seen.iter().filter(|seen| seen.flow().is_some());
                let mut count = 0;
                for flow in flows {
                    let gap = (flow.at - last).as_secs_f64() * 1e3;
                    ensure((gap - 200.0).abs() <= 12.0 + late, || {
                        format!(
                            "flow control came {gap:.0} ms after the one before where 200 ms are set"
                        )
                    })?;
                    ensure(flow.flow() == Some(FlowControl::Stop), || {
                        "flow control 1 came on the ground".to_owned()
                    })?;
                    last = flow.at;
                    count += 1;
                }
                ensure(count >= 9, || {
                    format!("{count} flow controls came in 2.1 s")
                })
            },
        ),
        Check::moving(
            Place::Ground,
            "8.5-no-flow-control",
            "8.5",
            "With following off there is no flow control",
            "following on, off, and 0.6 s of silence",
            "no flow control after the acknowledgement of following off, but one that waited",
            |bench, proof| async move {
                bench.ask(proof.permit(ON)).await?;
                bench.sleep(Duration::from_millis(350)).await;
                bench.ask(Harmless::FOLLOWING_OFF).await?;
                let mark = bench.mark();
                bench
                    .sleep(Duration::from_millis(600) + bench.slack().min(Duration::from_secs(1)))
                    .await;
                let seen = bench.since(mark);
                let count = seen.iter().filter_map(Arrival::flow).count();
                ensure(count <= 1, || {
                    format!("{count} flow controls came with following off")
                })
            },
        ),
        Check::moving(
            Place::Ground,
            "8.4-waypoint-on-ground",
            "8.4",
            "arrives on the ground, during take-off or landing, or with following off",
            "following on, and a waypoint",
            "error 30; port 10003 as before",
            |bench, proof| async move {
                bench.ask(proof.permit(ON)).await?;
                let waypoint = far_from(&position(&bench).await?, 0);
                refused(&bench, proof, waypoint, INVALID).await
            },
        ),
        Check::moving(
            Place::Ground,
            "8.5-land-on-ground",
            "8.5",
            "ground, not started up | following on | 0 | 0 | 0 | none | refused | refused | refused",
            "following on, and 1 to 10122",
            "error 30; 10122 reads 0",
            |bench, proof| async move {
                bench.ask(proof.permit(ON)).await?;
                bench
                    .expect_command(write(proof, port::LAND, 1), &[INVALID])
                    .await?;
                reads(&bench, port::LAND, 0).await
            },
        ),
        Check::moving(
            Place::Ground,
            "8.5-other-value",
            "8.5",
            "Writing another value than 1 to either port is refused.",
            "0, 2 and 65535 to 10121 and to 10122",
            "error 30 each time; both read 0",
            |bench, proof| async move {
                bench.ask(proof.permit(ON)).await?;
                for number in [port::TAKE_OFF, port::LAND] {
                    for value in [0, 2, u16::MAX] {
                        bench
                            .expect_command(write(proof, number, value), &[INVALID])
                            .await?;
                        reads(&bench, number, 0).await?;
                    }
                }
                Ok(())
            },
        ),
    ]
}

/// What one take-off has shown.
#[derive(Clone, Debug, Default)]
struct TakeOff {
    /// What 10121 read right behind the acknowledgement of its write.
    first_read: u16,
    /// Errors of a second write of 10121, of a write of 10122 and of a waypoint during the take-off.
    again: Vec<u16>,
    land: Vec<u16>,
    waypoint: Vec<u16>,
    /// Whether the flag was 1 when the first flow control 1 came.
    flag_at_first: bool,
    /// What 10121 read right behind it.
    last_read: u16,
    /// How far it climbed, m; `None` without a position.
    climb_m: Option<f64>,
    /// Errors of invalidate path during the take-off, which goes on.
    invalidate: Vec<u16>,
}

type Shared<T> = Rc<RefCell<Option<Result<T, Stop>>>>;

fn of_a_take_off() -> Vec<Check> {
    let shared: Shared<TakeOff> = Rc::default();
    let check = |id: &str, sentence: &str, expects: &str, judge: fn(&TakeOff) -> Judged| {
        let shared = Rc::clone(&shared);
        let sends = "following on, a height of 3 m, 1 to 10121; during the take-off 10121 and 10122 again, a waypoint and invalidate path";
        Check::moving(
            Place::Ground,
            id,
            "8.5",
            sentence,
            sends,
            expects,
            move |bench, proof| {
                let shared = Rc::clone(&shared);
                async move {
                    let known = shared.borrow().clone();
                    let facts = match known {
                        Some(facts) => facts,
                        None => {
                            let facts = observe_take_off(&bench, proof).await;
                            if !bench.is_lossy() {
                                shared.replace(Some(facts.clone()));
                            }
                            facts
                        }
                    };
                    judge(&facts?)
                }
            },
        )
    };
    vec![
        check(
            "8.5-take-off-begins",
            "10121 reads 1 from before the acknowledgement of the write that starts the take-off is sent",
            "1 in the read behind the acknowledgement",
            |facts| ensure(facts.first_read == 1, || format!("10121 reads {}", facts.first_read)),
        ),
        check(
            "8.5-take-off-again",
            "rotor starts | leaves the ground | 0 | 1 | 0 | 0 | refused | no change | refused",
            "no error of the second write of 10121",
            |facts| ensure(facts.again.is_empty(), || format!("errors {:?} came", facts.again)),
        ),
        check(
            "8.5-land-during-take-off",
            "climb | altitude reached, first flow control 1 due | 1 | 1 | 0 | 0 | refused | no change | refused",
            "error 30 of the write of 10122",
            |facts| ensure(facts.land == [INVALID], || format!("errors {:?} came where [30] should have", facts.land)),
        ),
        check(
            "8.5-waypoint-during-take-off",
            "*wp* is what happens to a waypoint, *refused* is error 30",
            "error 30 of the waypoint",
            |facts| ensure(facts.waypoint == [INVALID], || format!("errors {:?} came where [30] should have", facts.waypoint)),
        ),
        check(
            "8.5-flag",
            "The flag is 1 from the moment the helicopter leaves the ground until it touches it again.",
            "the flag 1 before the first flow control 1",
            |facts| ensure(facts.flag_at_first, || "flow control 1 came while the flag was 0".to_owned()),
        ),
        check(
            "8.5-take-off-ends",
            "until the first flow control message with 1 is due to be sent",
            "0 in the read behind the first flow control 1",
            |facts| ensure(facts.last_read == 0, || format!("10121 reads {}", facts.last_read)),
        ),
        check(
            "8.5-height",
            "starts the rotor and climbs vertically to the take-off altitude (port 20121) above the point of take-off, then hovers",
            "a climb of 2 … 4 m by the geographic position",
            |facts| match facts.climb_m {
                None => not_judged("the DSP sends no geographic position"),
                Some(climb) => ensure((2.0..=4.0).contains(&climb), || format!("the helicopter has climbed {climb:.1} m")),
            },
        ),
        check(
            "8.4-invalidate-during-take-off",
            "*Invalidate path* and *following off* are then acknowledged, change nothing in the movement, and it goes on.",
            "an acknowledgement of invalidate path, no error, and a take-off that ends",
            |facts| ensure(facts.invalidate.is_empty(), || format!("errors {:?} came", facts.invalidate)),
        ),
    ]
    .into_iter()
    .map(|mut check| {
        if check.id.starts_with("8.4") {
            check.section = "8.4";
        }
        check
    })
    .collect()
}

async fn observe_take_off(bench: &Bench, proof: RotorDisconnected) -> Judged<TakeOff> {
    bench.ask(proof.permit(ON)).await?;
    let ground = position(bench).await.ok();
    set_height(bench).await?;
    bench.set_period(50).await?;
    let mut facts = TakeOff::default();
    let mark = bench.mark();
    bench.ask(write(proof, port::TAKE_OFF, 1)).await?;
    facts.first_read = bench.read_16(port::TAKE_OFF).await?;
    facts.again = errors_of(bench, write(proof, port::TAKE_OFF, 1)).await?;
    facts.land = errors_of(bench, write(proof, port::LAND, 1)).await?;
    facts.invalidate = errors_of(bench, Harmless::INVALIDATE_PATH.into()).await?;
    let waypoint = far_from(&ground.unwrap_or_default(), 1);
    let before = bench.mark();
    bench.send(proof.permit(waypoint))?;
    bench.errors(3).await?;
    facts.waypoint = link_errors(bench, before);
    wait_for_hover(bench).await?;
    facts.last_read = bench.read_16(port::TAKE_OFF).await?;
    let seen = bench.since(mark);
    let first = seen
        .iter()
        .position(|seen| seen.flow() == Some(FlowControl::Send));
    let flags = seen.iter().take(first.unwrap_or(seen.len()));
    facts.flag_at_first = flags
        .filter_map(Arrival::status)
        .next_back()
        .is_some_and(|status| status.flying);
    if let (Some(ground), Ok(now)) = (ground, position(bench).await) {
        facts.climb_m = Some(now.altitude_m - ground.altitude_m);
    }
    Ok(facts)
}

fn of_the_buffer() -> Vec<Check> {
    vec![
        Check::moving(
            Place::Hover,
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
            Place::Hover,
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
            Place::Hover,
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
            Place::Hover,
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
            Place::Hover,
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
            Place::Hover,
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
            Place::Hover,
            "9-waypoint-limits",
            "9",
            "A waypoint has the limits of the geographic position; the DSP discards one outside them with error 30.",
            "waypoints one step beyond each limit of latitude, longitude and altitude",
            "error 30 for each; port 10003 as before",
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
                Ok(())
            },
        ),
        Check::moving(
            Place::Hover,
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
            Place::Hover,
            "8.4-reached",
            "8.4",
            "A waypoint leaves the buffer when it is reached.",
            "a waypoint 2 m higher, and the same again when the helicopter is there and the buffer is empty",
            "a helicopter that is there, and a second waypoint that is taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                let speed = Harmless::write_32(QuietPort32::ClimbSpeed, 2.0);
                bench.ask(speed).await?;
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
            Place::Hover,
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
            Place::Hover,
            "11-number-forgotten",
            "11",
            "Invalidate path, following off and the PC time-out make the DSP forget the number of the waypoint.",
            "a waypoint, invalidate path, another under the same number; the same with following off and on",
            "all are taken",
            |bench, proof| async move {
                let from = position(&bench).await?;
                taken_as(&bench, proof, far_from(&from, 0), 50).await?;
                bench.ask(Harmless::INVALIDATE_PATH).await?;
                taken_as(&bench, proof, far_from(&from, 1), 50).await?;
                bench.ask(Harmless::FOLLOWING_OFF).await?;
                bench.ask(proof.permit(ON)).await?;
                taken_as(&bench, proof, far_from(&from, 2), 50).await
            },
        ),
        Check::moving(
            Place::Hover,
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
            Place::Hover,
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
            Place::Hover,
            "8.8-pc-timeout",
            "8.8",
            "it empties the buffer, forgets the number of the last waypoint, and hovers on the spot",
            "a PC time-out of 1 s, 15 waypoints, and 3 s of silence",
            "flow control 0 for 0.6 s, and 1 at the end",
            |bench, proof| async move {
                arm(&bench, proof, 1_000).await?;
                let mark = bench.mark();
                bench.sleep(Duration::from_millis(600)).await;
                let early = bench.since(mark);
                let early = early.iter().filter_map(Arrival::flow);
                ensure(early.clone().all(|flow| flow == FlowControl::Stop), || {
                    "flow control 1 came before the PC time-out".to_owned()
                })?;
                bench.sleep(Duration::from_millis(2_400)).await;
                let flows = bench.since(mark);
                let last = flows.iter().filter_map(Arrival::flow).next_back();
                ensure(last == Some(FlowControl::Send), || {
                    "the buffer was not emptied after the PC time-out".to_owned()
                })
            },
        ),
        Check::moving(
            Place::Hover,
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
            Place::Hover,
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

/// Sets the PC time-out and fills 15 places.
async fn arm(bench: &Bench, proof: RotorDisconnected, timeout_ms: u16) -> Judged {
    let from = position(bench).await?;
    let mark = bench.mark();
    let found = bench.read_16(port::PC_TIMEOUT_MS).await?;
    bench.errors(2).await?;
    if found == 0 && link_errors(bench, mark).contains(&INVALID) {
        return not_judged("a classic DSP: it has no port 10004, which it may");
    }
    fill(bench, proof, &from, PLACES - 1).await?;
    flow_is(bench, FlowControl::Stop, "15 waypoints").await?;
    let write = Harmless::write_16(QuietPort16::PcTimeout, timeout_ms);
    bench.ask(write).await?;
    Ok(())
}

fn all_stop(bench: &Bench, mark: usize, found: &str) -> Judged {
    let flows = bench.since(mark);
    let mut flows = flows.iter().filter_map(Arrival::flow);
    ensure(flows.all(|flow| flow == FlowControl::Stop), || {
        found.to_owned()
    })
}

/// What one landing has shown.
#[derive(Clone, Debug, Default)]
struct Landing {
    first_read: u16,
    again: Vec<u16>,
    take_off: Vec<u16>,
    waypoint: Vec<u16>,
    flows: Vec<bool>,
}

fn of_a_landing() -> Vec<Check> {
    let shared: Shared<Landing> = Rc::default();
    let check = |id: &str, sentence: &str, expects: &str, judge: fn(&Landing) -> Judged| {
        let shared = Rc::clone(&shared);
        let sends =
            "3 waypoints, 1 to 10122; during the landing 10122 and 10121 again and a waypoint";
        Check::moving(
            Place::Hover,
            id,
            "8.5",
            sentence,
            sends,
            expects,
            move |bench, proof| {
                let shared = Rc::clone(&shared);
                async move {
                    let known = shared.borrow().clone();
                    let facts = match known {
                        Some(facts) => facts,
                        None => {
                            let facts = observe_landing(&bench, proof).await;
                            if !bench.is_lossy() {
                                shared.replace(Some(facts.clone()));
                            }
                            facts
                        }
                    };
                    judge(&facts?)
                }
            },
        )
    };
    vec![
        check(
            "8.5-landing-begins",
            "10122 reads 1 from before the acknowledgement until the rotor has stopped.",
            "1 in the read behind the acknowledgement, 0 at the end",
            |facts| {
                ensure(facts.first_read == 1, || {
                    format!("10122 reads {}", facts.first_read)
                })
            },
        ),
        check(
            "8.5-landing-again",
            "descent | touches the ground | 1 | 0 | 1 | 0 | refused | refused | no change",
            "no error of the second write of 10122, error 30 of that of 10121 and of the waypoint",
            |facts| {
                ensure(facts.again.is_empty(), || {
                    format!("errors {:?} came of the second write of 10122", facts.again)
                })?;
                ensure(facts.take_off == [INVALID], || {
                    format!("errors {:?} came of the write of 10121", facts.take_off)
                })?;
                ensure(facts.waypoint == [INVALID], || {
                    format!("errors {:?} came of the waypoint", facts.waypoint)
                })
            },
        ),
        check(
            "8.5-landing-empties",
            "Writing 1 to port 10122 in flight empties the path buffer and descends vertically to the ground; the landing ends on the ground with the rotor stopped.",
            "flow control 0 until the end, the flag 0 and 10122 0 at the end",
            |facts| {
                ensure(!facts.flows.contains(&true), || {
                    "flow control 1 came during the landing".to_owned()
                })
            },
        ),
    ]
}

async fn observe_landing(bench: &Bench, proof: RotorDisconnected) -> Judged<Landing> {
    let from = position(bench).await?;
    fill(bench, proof, &from, 3).await?;
    let mut facts = Landing::default();
    bench.ask(write(proof, port::LAND, 1)).await?;
    facts.first_read = bench.read_16(port::LAND).await?;
    let mark = bench.mark();
    facts.again = errors_of(bench, write(proof, port::LAND, 1)).await?;
    facts.take_off = errors_of(bench, write(proof, port::TAKE_OFF, 1)).await?;
    let before = bench.mark();
    bench.send(proof.permit(far_from(&from, 9)))?;
    bench.errors(3).await?;
    facts.waypoint = link_errors(bench, before);
    wait_for_ground(bench).await?;
    let seen = bench.since(mark);
    let flows = seen.iter().filter_map(Arrival::flow).skip(1);
    facts.flows = flows.map(|flow| flow == FlowControl::Send).collect();
    Ok(facts)
}

/// Brings the helicopter from the ground to a hover with following on and an empty buffer, or from a hover to that.
pub async fn to_hover(bench: &Bench, proof: RotorDisconnected) -> Judged {
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
pub async fn to_ground(bench: &Bench, proof: RotorDisconnected) -> Judged {
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

async fn flies(bench: &Bench) -> Judged<bool> {
    let seen = bench.statuses(2).await?;
    Ok(seen.last().is_some_and(|(_, status)| status.flying))
}

/// Waits until flow control says 1 while the helicopter flies.
async fn wait_for_hover(bench: &Bench) -> Judged {
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
async fn wait_for_ground(bench: &Bench) -> Judged {
    let limit = bench.now() + MOVEMENT_LIMIT;
    while bench.now() < limit {
        if !flies(bench).await? && bench.read_16(port::LAND).await? == 0 {
            return Ok(());
        }
        bench.sleep(Duration::from_millis(250)).await;
    }
    broken("the landing does not end: the flag is 1 or 10122 reads 1 after two minutes")
}

async fn set_height(bench: &Bench) -> Judged {
    let height = Harmless::write_32(QuietPort32::TakeOffAltitude, HEIGHT_M);
    bench.ask(height).await.map(|_| ())
}

/// Where the helicopter is.
async fn position(bench: &Bench) -> Judged<Geographic> {
    let mask = StatusMask::NONE.with(Group::Time).with(Group::Geographic);
    bench.set_mask(mask).await?;
    let seen = bench.statuses(3).await?;
    match seen.last().and_then(|(_, status)| status.geographic) {
        Some(position) => Ok(position),
        None => not_judged("the DSP sends no geographic position, from which waypoints follow"),
    }
}

/// A waypoint far to the north; each index gives another one.
fn far_from(from: &Geographic, index: usize) -> Waypoint {
    Waypoint {
        latitude_deg: from.latitude_deg + FAR_DEG + index as f64 * 1e-4,
        longitude_deg: from.longitude_deg,
        altitude_m: from.altitude_m + 10.0,
    }
}

fn write(proof: RotorDisconnected, port: u16, value: u16) -> crate::permitted::Permitted {
    proof.permit(Command::Write16 { port, value })
}

async fn reads(bench: &Bench, port: u16, value: u16) -> Judged {
    let read = bench.read_16(port).await?;
    ensure(read == value, || format!("{port} reads {read}"))
}

fn link_errors(bench: &Bench, mark: usize) -> Vec<u16> {
    let seen = bench.since(mark);
    seen.iter().filter_map(Arrival::link_error).collect()
}

/// The errors that a command brings.
async fn errors_of(bench: &Bench, command: crate::permitted::Permitted) -> Judged<Vec<u16>> {
    let mark = bench.mark();
    bench.ask(command).await?;
    bench.errors(2).await?;
    Ok(link_errors(bench, mark))
}

/// Port 10003.
async fn count(bench: &Bench) -> Judged<u16> {
    match bench.read_16(port::WAYPOINT_COUNT).await? {
        count if count & 0x8000 != 0 => Ok(count),
        _ => not_judged(
            "the DSP has no port 10003, which may be missing: whether a waypoint is taken cannot be seen",
        ),
    }
}

const fn next_count(count: u16) -> u16 {
    0x8000 | (count.wrapping_add(1) & 0x7FFF)
}

/// Sends a waypoint; gives port 10003 behind it, and the errors.
async fn offer(
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

/// The same under a number of the caller's choice.
async fn offer_as(
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

async fn taken(bench: &Bench, proof: RotorDisconnected, waypoint: Waypoint) -> Judged {
    let before = count(bench).await?;
    let came = offer(bench, proof, waypoint).await?;
    judge_taken(before, came)
}

async fn taken_as(
    bench: &Bench,
    proof: RotorDisconnected,
    waypoint: Waypoint,
    number: u8,
) -> Judged {
    let before = count(bench).await?;
    let came = offer_as(bench, proof, waypoint, number).await?;
    judge_taken(before, came)
}

fn judge_taken(before: u16, (after, errors): (u16, Vec<u16>)) -> Judged {
    ensure(after == next_count(before) && errors.is_empty(), || {
        format!(
            "a waypoint was not taken: port 10003 read 0x{before:04X} and reads 0x{after:04X}, errors {errors:?}"
        )
    })
}

async fn refused(
    bench: &Bench,
    proof: RotorDisconnected,
    waypoint: Waypoint,
    error: u16,
) -> Judged {
    let before = count(bench).await?;
    let (after, errors) = offer(bench, proof, waypoint).await?;
    ensure(after == before && errors == [error], || {
        format!(
            "a waypoint should have brought error {error}: errors {errors:?}, port 10003 read 0x{before:04X} and reads 0x{after:04X}"
        )
    })
}

async fn silent(bench: &Bench, proof: RotorDisconnected, waypoint: Waypoint) -> Judged {
    let before = count(bench).await?;
    let (after, errors) = offer(bench, proof, waypoint).await?;
    ensure(after == before && errors.is_empty(), || {
        format!(
            "a waypoint should have been discarded in silence: errors {errors:?}, port 10003 read 0x{before:04X} and reads 0x{after:04X}"
        )
    })
}

/// Sends `places` waypoints that are far away.
async fn fill(bench: &Bench, proof: RotorDisconnected, from: &Geographic, places: usize) -> Judged {
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
async fn flow_is(bench: &Bench, expected: FlowControl, what: &str) -> Judged {
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
                format!("behind {what} flow control says {flow:?}, {expected:?} was expected")
            });
        }
    }
    broken(format!("behind {what} no flow control came"))
}
