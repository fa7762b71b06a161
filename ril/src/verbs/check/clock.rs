//! Judges the wall clock, for the doctor and the preflight: recordings and logs are named by it, and certificates are compared with it.

use runtime::finding::Finding;
use status::log::clock::Utc;

use super::facts::ClockFacts;

const ID: &str = "clock";

/// What the wall clock means.
pub(super) fn diagnose(facts: &ClockFacts) -> Finding {
    let clock = facts.clock;
    let now = Utc::from_unix(clock.unix_s);
    let check = if !clock.was_set() {
        Finding::warning(
            ID,
            format!("the clock was never set: {now} is before this program was installed"),
            "set it: connect a network that has the time, or `sudo date --set 'YYYY-MM-DD hh:mm'`; until then files have wrong names and times, \
             and no certificate of other machines is taken",
        )
    } else if facts.is_synchronized {
        Finding::note(ID, format!("{now}, synchronized"))
    } else {
        Finding::note(
            ID,
            format!("{now}; whether it is synchronized is not known"),
        )
    };
    check.with_limit(format!("after {}", Utc::from_unix(clock.not_before_unix_s)))
}
