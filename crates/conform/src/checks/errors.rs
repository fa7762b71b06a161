//! The queue of errors: section 8.6.

use std::time::Duration;

use dsp_protocol::{StatusMask, port};

use crate::arrival::{Arrival, describe_downlink};
use crate::bench::Bench;
use crate::check::Check;
use crate::monitor::Rule;
use crate::outcome::{Judged, broken, ensure};
use crate::permitted::{Harmless, Raw};

const INVALID: u16 = 30;
const UNKNOWN_HEADER: u16 = 100;
const CHECK_FIELD: u16 = 102;
/// Errors that wait at once.
const MANY: usize = 6;
/// Places of the queue.
const PLACES: usize = 16;

/// The checks.
pub fn checks() -> Vec<Check> {
    vec![
        Check::harmless(
            "8.6-oldest-first",
            "8.6",
            "While status transmission is active it sends the oldest right after a status, one for each status",
            "a frame with a wrong check field, an unknown header and a read of an unknown port, before the next status",
            "errors 102, 100 and 30 in this order, one behind each of three statuses",
            |bench| async move {
                let mark = in_one_pause(&bench, 400).await?;
                bench.send_raw(&wrong_check(&bench), "a read with a wrong check field")?;
                bench.send_raw(&unknown_header(), "an unknown header")?;
                bench.ask(Harmless::read_16(9)).await?;
                let errors = collect(&bench, mark, 5).await?;
                ensure(errors == [CHECK_FIELD, UNKNOWN_HEADER, INVALID], || {
                    format!("errors {errors:?} came where [102, 100, 30] should have")
                })?;
                one_for_each_status(&bench, mark)
            },
        ),
        Check::watched(
            Rule::PlaceOfErrors,
            "8.6-behind-status",
            "8.6",
            "nothing comes between the two",
            "no error that is not right behind a status, but those about the other profile",
        ),
        Check::harmless(
            "8.6-before-acknowledgements",
            "8.6",
            "nothing comes between the two",
            "6 unknown headers, then all groups every 100 ms (200 ms at 19200 baud and below), and one read after the other",
            "an error right behind each status until six have come: an acknowledgement that waits comes after it",
            |bench| async move {
                in_one_pause(&bench, 1_000).await?;
                for _ in 0..MANY {
                    bench.send_raw(&unknown_header(), "an unknown header")?;
                }
                bench.set_mask(StatusMask::ALL).await?;
                let period_ms = match bench.frame_time() < Duration::from_millis(50) {
                    true => 100,
                    false => 200,
                };
                bench.set_period(period_ms).await?;
                // The errors wait. A status that was composed before may come without one.
                bench.statuses(1).await?;
                let mark = bench.mark();
                let limit = bench.now() + 10 * bench.period() + 10 * bench.frame_time();
                let statuses =
                    |seen: &[Arrival]| seen.iter().filter(|one| one.status().is_some()).count();
                while statuses(&bench.since(mark)) <= MANY && bench.now() < limit {
                    bench.ask(Harmless::read_16(port::STATUS_PERIOD_MS)).await?;
                }
                each_right_behind(&bench.since(mark))
            },
        ),
        Check::harmless(
            "8.6-sixteen-places",
            "8.6",
            "The DSP queues its errors (16 places; an error that finds the queue full is dropped).",
            "16 reads with a wrong check field and 4 unknown headers before the next status",
            "16 errors 102 and no error 100",
            |bench| async move {
                let mark = in_one_pause(&bench, 3_000).await?;
                for _ in 0..PLACES {
                    bench.send_raw(&wrong_check(&bench), "a read with a wrong check field")?;
                }
                for _ in 0..4 {
                    bench.send_raw(&unknown_header(), "an unknown header")?;
                }
                bench.ask(Harmless::read_16(port::STATUS_PERIOD_MS)).await?;
                bench.set_period(50).await?;
                let errors = collect(&bench, mark, PLACES + 6).await?;
                ensure(errors == [CHECK_FIELD; PLACES], || {
                    format!("errors {errors:?} came where sixteen times 102 should have")
                })
            },
        ),
        Check::harmless(
            "8.6-clear-errors",
            "8.6",
            "Clear errors empties the queue, and takes back an error whose status has not left yet.",
            "3 unknown headers, and clear errors before the next status",
            "no error",
            |bench| async move {
                let mark = in_one_pause(&bench, 1_000).await?;
                for _ in 0..3 {
                    bench.send_raw(&unknown_header(), "an unknown header")?;
                }
                bench.ask(Harmless::CLEAR_ERRORS).await?;
                bench.set_period(50).await?;
                let errors = collect(&bench, mark, 5).await?;
                ensure(errors.is_empty(), || {
                    format!("errors {errors:?} came after clear errors")
                })
            },
        ),
    ]
}

/// Judges that an error stands right behind each status but the last errors: five or six, as the status before had one
/// or not.
fn each_right_behind(seen: &[Arrival]) -> Judged {
    let mut errors = 0;
    for pair in seen.windows(2) {
        let [first, second] = pair else { continue };
        if second.link_error().is_some() {
            errors += 1;
        } else if first.status().is_some() && errors < MANY - 1 {
            return broken(format!(
                "no error came right behind a status while errors waited: {} came",
                second.event.map_or_else(
                    |error| error.name().to_owned(),
                    |message| describe_downlink(&message)
                )
            ));
        }
    }
    ensure(errors >= MANY - 1, || {
        format!("{errors} errors came where {MANY} waited")
    })
}

/// Waits for the beginning of a pause of `period_ms` between two statuses.
async fn in_one_pause(bench: &Bench, period_ms: u16) -> Judged<usize> {
    bench.set_period(period_ms).await?;
    bench.statuses(1).await?;
    Ok(bench.mark())
}

/// The errors since `mark` until `statuses` more statuses have come.
async fn collect(bench: &Bench, mark: usize, statuses: usize) -> Judged<Vec<u16>> {
    bench.statuses(statuses).await?;
    let seen = bench.since(mark);
    Ok(seen.iter().filter_map(Arrival::link_error).collect())
}

fn one_for_each_status(bench: &Bench, mark: usize) -> Judged {
    let mut statuses = 0;
    for arrival in bench.since(mark) {
        if arrival.status().is_some() {
            statuses += 1;
        }
        if arrival.link_error().is_some() {
            ensure(statuses > 0, || {
                "two errors came behind one status".to_owned()
            })?;
            statuses = 0;
        }
    }
    Ok(())
}

fn wrong_check(bench: &Bench) -> Raw {
    let read = Harmless::read_16(port::STATUS_PERIOD_MS);
    bench.frame(read).flip(-1, 0x01)
}

fn unknown_header() -> Raw {
    Raw::bytes([0x81])
}
