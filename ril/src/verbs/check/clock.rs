//! Judges the wall clock, for the doctor and the preflight: recordings and logs are named by it, and certificates are compared with it.

use runtime::finding::Finding;
use status::log::clock::Utc;

use super::facts::ClockFacts;

const ID: &str = "clock";

/// What the wall clock means.
pub(super) fn diagnose(facts: &ClockFacts) -> Finding {
    let shown = |unix_s| {
        let Utc {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = Utc::from_unix(unix_s);
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
    };
    let clock = facts.clock;
    let now = shown(clock.unix_s);
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
    check.with_limit(format!("after {}", shown(clock.not_before_unix_s)))
}
