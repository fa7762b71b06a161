//! The queue of errors: section 8.6.

use dsp_protocol::port;

use crate::bench::{Arrival, Bench, Judged, ensure};
use crate::check::Check;
use crate::monitor::Rule;
use crate::permitted::{Harmless, Raw};

const INVALID: u16 = 30;
const UNKNOWN_HEADER: u16 = 100;
const CHECK_FIELD: u16 = 102;
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
