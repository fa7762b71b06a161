//! Flow control on the ground, take-off and landing: sections 8.4 and 8.5.

use std::time::Duration;

use dsp_protocol::{FlowControl, port};

use crate::arrival::Arrival;
use crate::bench::{Bench, Observed};
use crate::check::{Check, StartPlace};
use crate::outcome::{Judged, ensure, not_judged};
use crate::permitted::{Harmless, QuietPort16, RotorDisconnected};
use crate::pilot::{
    INVALID, MOVEMENT_LIMIT, ON, count_if_any, errors_of, far_from, fill, link_errors, position,
    reads, refused, set_height, slow_climb, wait_for_ground, wait_for_hover, write,
};

/// The checks up to a take-off.
pub fn before_hover() -> Vec<Check> {
    let mut checks = on_the_ground();
    checks.extend(of_a_take_off());
    checks
}

/// The checks of the landing.
pub fn after_hover() -> Vec<Check> {
    of_a_landing()
}

fn on_the_ground() -> Vec<Check> {
    vec![
        Check::moving(
            StartPlace::Ground,
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
            StartPlace::Ground,
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
            StartPlace::Ground,
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
            StartPlace::Ground,
            "8.5-land-on-ground",
            "8.5",
            "ground | 10121 | 0 | 0 | 0 | 0 | refused | begins | refused",
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
            StartPlace::Ground,
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

/// Makes the checks that judge one movement, which the first of them that runs observes.
fn observing<T: Clone + 'static>(
    place: StartPlace,
    sends: &'static str,
    observe: impl AsyncFn(&Bench, RotorDisconnected) -> Judged<T> + Copy + 'static,
) -> impl Fn(&str, &str, &str, fn(&T) -> Judged) -> Check {
    let observed = Observed::<T>::default();
    move |id, sentence, expects, judge| {
        let section = match id.starts_with("8.4") {
            true => "8.4",
            false => "8.5",
        };
        let observed = observed.clone();
        let run = move |bench, proof| {
            let observed = observed.clone();
            async move { judge(&observed.or(&bench, observe(&bench, proof)).await?) }
        };
        Check::moving(place, id, section, sentence, sends, expects, run)
    }
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
    /// Whether it was under way still when all that was sent.
    lasted: bool,
    /// Whether 10121 read 0 though no flow control 1 was due.
    read_zero_early: bool,
    /// Whether the flag was 1 when the first flow control 1 came.
    flag_at_first: bool,
    /// What 10121 read right behind it.
    last_read: u16,
    /// How far it climbed, m; `None` without a position.
    climb_m: Option<f64>,
    /// Errors of invalidate path during the take-off, which goes on.
    invalidate: Vec<u16>,
}

fn of_a_take_off() -> Vec<Check> {
    let check = observing(
        StartPlace::Ground,
        "following on, a height of 3 m, 0.5 m/s, a flow control period of 0.85 s, 1 to 10121; during the take-off 10121 and 10122 again, a waypoint and invalidate path, and reads of 10121 until flow control 1",
        observe_take_off,
    );
    vec![
        check(
            "8.5-take-off-begins",
            "10121 reads 1 from before the acknowledgement of the write that starts the take-off is sent",
            "1 in the read behind the acknowledgement",
            |facts| has_read(port::TAKE_OFF, facts.first_read, 1),
        ),
        check(
            "8.5-take-off-again",
            "rotor starts | leaves the ground | 0 | 1 | 0 | 0 | refused | no change | refused",
            "no error of the second write of 10121",
            |facts| {
                must_last(facts.lasted, "the take-off")?;
                brought("of the second write of 10121", &facts.again, &[])
            },
        ),
        check(
            "8.5-land-during-take-off",
            "climb | altitude reached, first flow control 1 due | 1 | 1 | 0 | 0 | refused | no change | refused",
            "error 30 of the write of 10122",
            |facts| {
                must_last(facts.lasted, "the take-off")?;
                brought("of the write of 10122", &facts.land, &[INVALID])
            },
        ),
        check(
            "8.5-waypoint-during-take-off",
            "*wp* is what happens to a waypoint, *refused* is error 30",
            "error 30 of the waypoint",
            |facts| {
                must_last(facts.lasted, "the take-off")?;
                brought("of the waypoint", &facts.waypoint, &[INVALID])
            },
        ),
        check(
            "8.5-flag",
            "The flag is 1 from the moment the helicopter leaves the ground until it touches it again.",
            "the flag 1 before the first flow control 1",
            |facts| {
                ensure(facts.flag_at_first, || {
                    "flow control 1 came while the flag was 0".to_owned()
                })
            },
        ),
        check(
            "8.5-take-off-ends",
            "until the first flow control message with 1 is due to be sent",
            "1 until the first flow control 1, 0 in the read behind it",
            |facts| {
                ensure(!facts.read_zero_early, || {
                    "10121 read 0, and no flow control 1 came right behind it".to_owned()
                })?;
                has_read(port::TAKE_OFF, facts.last_read, 0)
            },
        ),
        check(
            "8.5-height",
            "starts the rotor and climbs vertically to the take-off altitude (port 20121) above the point of take-off, then hovers",
            "a climb of 2 … 4 m by the geographic position",
            |facts| match facts.climb_m {
                None => not_judged("the DSP sends no geographic position"),
                Some(climb) => ensure((2.0..=4.0).contains(&climb), || {
                    format!("the helicopter has climbed {climb:.1} m")
                }),
            },
        ),
        check(
            "8.4-invalidate-during-take-off",
            "*Invalidate path* and *following off* are then acknowledged, change nothing in the movement, and it goes on.",
            "an acknowledgement of invalidate path, no error, and a take-off that ends",
            |facts| brought("of invalidate path", &facts.invalidate, &[]),
        ),
    ]
}

async fn observe_take_off(bench: &Bench, proof: RotorDisconnected) -> Judged<TakeOff> {
    bench.ask(proof.permit(ON)).await?;
    let ground = position(bench).await.ok();
    set_height(bench).await?;
    slow_climb(bench).await?;
    let write_period = Harmless::write_16(QuietPort16::FlowControlPeriod, 850);
    bench.ask(write_period).await?;
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
    facts.lasted = bench.read_16(port::TAKE_OFF).await? == 1;
    facts.read_zero_early = facts.lasted && !ends_with_flow_control(bench).await?;
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

/// Reads 10121 until it reads 0; gives whether flow control 1 came by then or right behind it.
async fn ends_with_flow_control(bench: &Bench) -> Judged<bool> {
    let limit = bench.now() + MOVEMENT_LIMIT;
    let mark = bench.mark();
    while bench.now() < limit {
        bench.sleep(Duration::from_millis(50)).await;
        if bench.read_16(port::TAKE_OFF).await? == 0 {
            break;
        }
    }
    // Flow control waits while a status with its error is sent, and a DSP may send it one step of its loop later.
    bench
        .sleep(Duration::from_millis(20) + bench.frame_time() + bench.slack())
        .await;
    let flow = |arrival: &Arrival| arrival.flow() == Some(FlowControl::Send);
    Ok(bench.since(mark).iter().any(flow))
}

fn must_last(lasted: bool, movement: &str) -> Judged {
    match lasted {
        true => Ok(()),
        false => not_judged(format!("{movement} was over before all was sent")),
    }
}

fn has_read(port: u16, read: u16, expected: u16) -> Judged {
    ensure(read == expected, || format!("{port} reads {read}"))
}

/// Judges the errors that came of something.
fn brought(of: &str, errors: &[u16], expected: &[u16]) -> Judged {
    ensure(errors == expected, || {
        format!("errors {errors:?} came {of} where {expected:?} should have")
    })
}

/// What one landing has shown.
#[derive(Clone, Debug, Default)]
struct Landing {
    /// Whether it was under way still when all was sent.
    lasted: bool,
    first_read: u16,
    again: Vec<u16>,
    take_off: Vec<u16>,
    waypoint: Vec<u16>,
    flows: Vec<bool>,
}

fn of_a_landing() -> Vec<Check> {
    let check = observing(
        StartPlace::Hover,
        "3 waypoints, a climb speed of 0.5 m/s, 1 to 10122; during the landing 10122 and 10121 again and a waypoint",
        observe_landing,
    );
    vec![
        check(
            "8.5-landing-begins",
            "10122 reads 1 from before the acknowledgement until the rotor has stopped.",
            "1 in the read behind the acknowledgement, 0 at the end",
            |facts| has_read(port::LAND, facts.first_read, 1),
        ),
        check(
            "8.5-landing-again",
            "descent | touches the ground | 1 | 0 | 1 | 0 | refused | refused | no change",
            "no error of the second write of 10122, error 30 of that of 10121 and of the waypoint",
            |facts| {
                must_last(facts.lasted, "the landing")?;
                brought("of the second write of 10122", &facts.again, &[])?;
                brought("of the write of 10121", &facts.take_off, &[INVALID])?;
                brought("of the waypoint", &facts.waypoint, &[INVALID])
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
    match count_if_any(bench).await? {
        Some(_) => fill(bench, proof, &from, 3).await?,
        None => {
            for index in 0..3 {
                bench.send(proof.permit(far_from(&from, index)))?;
            }
        }
    }
    slow_climb(bench).await?;
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
    facts.lasted = bench.read_16(port::LAND).await? == 1;
    wait_for_ground(bench).await?;
    let seen = bench.since(mark);
    let flows = seen.iter().filter_map(Arrival::flow).skip(1);
    facts.flows = flows.map(|flow| flow == FlowControl::Send).collect();
    Ok(facts)
}
