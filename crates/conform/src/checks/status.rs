//! The status: section 8.3, and what a slow line does to it (section 1).

use std::time::Duration;

use dsp_protocol::{Group, Status, StatusMask, port};

use crate::bench::Bench;
use crate::check::Check;
use crate::outcome::{Judged, broken, ensure, not_judged};
use crate::permitted::{Harmless, QuietPort16};

const TIME: StatusMask = StatusMask::NONE.with(Group::Time);

/// How near the wrap of its clock a DSP must be for the kit to wait for it, ms.
const WRAP_WAIT_MS: u32 = 30_000;

/// The checks.
pub fn checks() -> Vec<Check> {
    vec![
        Check::harmless(
            "8.3-period",
            "8.3",
            "While active, the DSP sends one status every status period.",
            "status periods of 100 ms and 250 ms",
            "one status a period by the DSP's clock, which 8.3-time-counts-ms compares with that of this computer",
            |bench| async move {
                judge_period(&bench, 100).await?;
                judge_period(&bench, 250).await
            },
        ),
        Check::harmless(
            "8.3-shorter-period",
            "8.3",
            "if one would be due later than a new period from now, it is due a new period from now.",
            "a period of 3 s, and 0.5 s after a status one of 100 ms",
            "the next status 100 ms after the write",
            |bench| async move {
                bench.set_period(3_000).await?;
                bench.statuses(1).await?;
                bench.sleep(Duration::from_millis(500)).await;
                let sent = bench.now();
                bench.set_period(100).await?;
                let from = bench.now();
                let statuses = bench.statuses(1).await?;
                let limit = from + Duration::from_millis(100) + bench.frame_time() + bench.slack();
                ensure(statuses.iter().all(|(at, _)| *at <= limit), || {
                    "the status waited for the old period".to_owned()
                })?;
                // 10 ms: the DSP may count its periods in steps.
                let least = sent + Duration::from_millis(90);
                ensure(statuses.iter().all(|(at, _)| *at >= least), || {
                    "the status came before a new period had passed".to_owned()
                })
            },
        ),
        Check::harmless(
            "8.3-longer-period",
            "8.3",
            "A status that is due already keeps its time",
            "a period of 300 ms, and 100 ms after a status one of 5 s",
            "the next status still 300 ms after the one before",
            |bench| async move {
                bench.set_period(300).await?;
                let first = bench.statuses(2).await?;
                bench.sleep(Duration::from_millis(100)).await;
                bench.set_period(5_000).await?;
                let second = bench.statuses(1).await?;
                let passed = match (first.last(), second.first()) {
                    (Some((from, _)), Some((at, _))) => at.saturating_sub(*from),
                    _ => Duration::ZERO,
                };
                let limit = Duration::from_millis(330) + bench.frame_time() + bench.slack();
                ensure(passed <= limit, || {
                    format!(
                        "the status that was due came after {} ms, in the new period",
                        passed.as_millis()
                    )
                })
            },
        ),
        Check::harmless(
            "8.3-activate-again",
            "8.3",
            "activating what is active changes nothing",
            "a period of 400 ms, and activate status transmission 200 ms after a status",
            "the next status 400 ms after the one before, and no more of them",
            |bench| async move {
                bench.set_period(400).await?;
                let mut seen = bench.statuses(2).await?;
                bench.sleep(Duration::from_millis(200)).await;
                bench.ask(Harmless::ACTIVATE_STATUS).await?;
                seen.extend(bench.statuses(3).await?);
                judge_gaps(&bench, &seen, 400)
            },
        ),
        Check::harmless(
            "8.3-no-group",
            "8.3",
            "A mask of 0 gives frames that carry the flying flag alone.",
            "a mask of 0",
            "statuses without a group",
            |bench| async move {
                bench.set_mask(StatusMask::NONE).await?;
                let seen = bench.statuses(3).await?;
                let last = seen.last().map_or(StatusMask::ALL, |(_, last)| last.mask());
                ensure(last == StatusMask::NONE, || {
                    format!("a status came with mask 0x{:04X}", last.0)
                })
            },
        ),
        Check::harmless(
            "4.1-mask",
            "4.1",
            "The mask is the one that the PC wrote to port 10000 (section 6), without the groups that the DSP has no values for (section 8.3).",
            "seven masks, one after the other",
            "from the second status on none with a group that was not asked for, and the time where it was",
            masks,
        ),
        Check::harmless(
            "8.3-time-counts-ms",
            "8.3",
            "*Time* is the number of milliseconds since the DSP's boot modulo 2³², measured when the status is composed.",
            "nothing, for 3 s",
            "a clock that advances as this computer's does, to 2 % and the slack",
            |bench| async move {
                bench.set_period(100).await?;
                let first = last_of(&bench, 2).await?;
                bench.sleep(Duration::from_secs(3)).await;
                bench.forget();
                let second = last_of(&bench, 2).await?;
                let here = (second.0 - first.0).as_secs_f64();
                let there = f64::from(time_of(&second.1)?.wrapping_sub(time_of(&first.1)?)) / 1e3;
                let allowed =
                    0.02 * here + 2.0 * (bench.slack() + bench.frame_time()).as_secs_f64();
                ensure((here - there).abs() <= allowed, || {
                    format!("{there:.3} s passed on the DSP's clock, {here:.3} s here")
                })
            },
        ),
        Check::harmless(
            "8.3-time-rises",
            "8.3",
            "The PC publishes only statuses whose time is newer than that of the one before.",
            "nothing, for forty statuses of 20 ms",
            "times of which each follows the one before by 1 … 60000 ms, modulo 2³²",
            |bench| async move {
                bench.set_period(20).await?;
                bench.statuses(1).await?;
                let seen = bench.statuses(40).await?;
                judge_order(&seen)
            },
        ),
        Check::harmless(
            "8.3-clock-wraps",
            "8.3",
            "It wraps after 49.7 days; that is no reboot.",
            "nothing, if the clock wraps within 30 s",
            "times near 0 behind those near 2³², and ports that keep their values",
            |bench| async move {
                let now = time_of(&last_of(&bench, 2).await?.1)?;
                let left_ms = u32::MAX - now;
                if left_ms > WRAP_WAIT_MS {
                    return not_judged(format!(
                        "the clock wraps in {:.1} days; set it near its end in a build for tests",
                        f64::from(left_ms) / 86_400_000.0
                    ));
                }
                let write = Harmless::write_16(QuietPort16::FlowControlPeriod, 170);
                bench.ask(write).await?;
                let wait = Duration::from_millis(u64::from(left_ms) + 500);
                let mark = bench.mark();
                bench.sleep(wait).await;
                let seen: Vec<(Duration, Status)> = bench
                    .since(mark)
                    .iter()
                    .filter_map(|arrival| Some((arrival.at, arrival.status()?)))
                    .collect();
                judge_order(&seen)?;
                let wrapped = seen
                    .last()
                    .is_some_and(|(_, last)| last.time_ms.is_some_and(|time| time < WRAP_WAIT_MS));
                ensure(wrapped, || "the clock did not begin again at 0".to_owned())?;
                let period = bench.read_16(port::FLOW_CONTROL_PERIOD_MS).await?;
                ensure(period == 170, || {
                    format!("port 10002 reads {period} after the wrap, 170 before")
                })
            },
        ),
        Check::harmless(
            "8.3-left-out",
            "8.3",
            "The DSP leaves out a status that is due while the one before has not left completely: it never queues a second one.",
            "all groups every millisecond, and then a mask of the time alone",
            "whole statuses whose times rise, and at most one of the old mask after the acknowledgement",
            |bench| async move {
                bench.set_mask(StatusMask::ALL).await?;
                bench.set_period(1).await?;
                let seen = bench.statuses(12).await?;
                let times = seen.iter().filter(|(_, status)| status.time_ms.is_some());
                let times: Vec<_> = times.copied().collect();
                judge_order(&times)?;
                bench.set_mask(TIME).await?;
                let seen = bench.statuses(6).await?;
                let old = seen
                    .iter()
                    .filter(|(_, status)| status.mask().0 & !TIME.0 != 0);
                let old = old.count();
                ensure(old <= 1, || {
                    format!(
                        "{old} statuses of the old mask came after the new one was acknowledged: they had queued"
                    )
                })
            },
        ),
    ]
}

/// Judges that the DSP sends one status each `period_ms`.
pub async fn judge_period(bench: &Bench, period_ms: u16) -> Judged {
    bench.set_mask(TIME).await?;
    bench.set_period(period_ms).await?;
    bench.statuses(2).await?;
    let seen = bench.statuses(9).await?;
    judge_gaps(bench, &seen, period_ms)
}

/// Judges the gaps between statuses and their mean: by the DSP's clock, or by that of this computer if the statuses
/// lack the time.
fn judge_gaps(bench: &Bench, seen: &[(Duration, Status)], period_ms: u16) -> Judged {
    let period = f64::from(period_ms);
    for pair in seen.windows(2) {
        let [(_, a), (_, b)] = pair else { continue };
        if let (Some(a), Some(b)) = (a.time_ms, b.time_ms) {
            let gap = f64::from(b.wrapping_sub(a));
            ensure((gap - period).abs() <= 0.2 * period + 2.0, || {
                format!(
                    "two statuses are {gap} ms apart by the DSP's clock where {period_ms} ms are set"
                )
            })?;
        }
    }
    let (Some((from, first)), Some((to, last))) = (seen.first(), seen.last()) else {
        return Ok(());
    };
    let gaps = (seen.len() - 1).max(1) as f64;
    if let (Some(first), Some(last)) = (first.time_ms, last.time_ms) {
        let mean = f64::from(last.wrapping_sub(first)) / gaps;
        // One step of the DSP's control loop, at most 20 ms, over all gaps; and the accuracy of its oscillator.
        return ensure((mean - period).abs() <= 0.01 * period + 20.0 / gaps, || {
            format!(
                "statuses are {mean:.1} ms apart by the DSP's clock where {period_ms} ms are set"
            )
        });
    }
    let mean = (*to - *from).as_secs_f64() * 1e3 / gaps;
    let slack = 1e3 * (bench.slack() + bench.frame_time()).as_secs_f64() / gaps;
    ensure((mean - period).abs() <= 0.05 * period + 1.0 + slack, || {
        format!(
            "statuses are {mean:.1} ms apart by this computer's clock where {period_ms} ms are set"
        )
    })
}

/// Judges that each time follows the one before (section 8.3, coherence).
fn judge_order(seen: &[(Duration, Status)]) -> Judged {
    for pair in seen.windows(2) {
        let [(_, a), (_, b)] = pair else { continue };
        let (a, b) = (time_of(a)?, time_of(b)?);
        ensure((1..=60_000).contains(&b.wrapping_sub(a)), || {
            format!("a status with time {b} ms came behind one with time {a} ms")
        })?;
    }
    Ok(())
}

async fn last_of(bench: &Bench, count: usize) -> Judged<(Duration, Status)> {
    match bench.statuses(count).await?.last() {
        Some(last) => Ok(*last),
        None => broken("no status came"),
    }
}

fn time_of(status: &Status) -> Judged<u32> {
    match status.time_ms {
        Some(time) => Ok(time),
        None => broken("a status came without the time, which was asked for"),
    }
}

async fn masks(bench: Bench) -> Judged {
    for bits in [0x0001, 0x8001, 0x0401, 0x5555, 0xAAAA, 0x0002, 0xFFFF] {
        let mask = StatusMask(bits);
        bench.set_mask(mask).await?;
        let seen = bench.statuses(4).await?;
        for (_, status) in seen.iter().skip(1) {
            let extra = StatusMask(status.mask().0 & !bits);
            ensure(extra == StatusMask::NONE, || {
                format!(
                    "a status came with the groups 0x{:04X}, which mask 0x{bits:04X} does not ask for",
                    extra.0
                )
            })?;
            ensure(
                !mask.contains(Group::Time) || status.time_ms.is_some(),
                || format!("a status came without the time, which mask 0x{bits:04X} asks for"),
            )?;
        }
    }
    Ok(())
}
