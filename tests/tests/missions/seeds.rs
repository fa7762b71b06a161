//! Seeds: every mission of chance is repeated by its number.

use std::ops::Range;

/// Environment variable that runs other seeds: one (`17`), to repeat a failure, or a range (`5000..9000`), to look for
/// more.
const VARIABLE: &str = "RIL_SEED";

/// Runs `check` for each seed, or for those in `RIL_SEED`. A failure names its seed.
pub fn for_each(seeds: Range<u64>, check: impl Fn(u64)) {
    let others = std::env::var(VARIABLE).ok().map(|text| {
        parse(&text).unwrap_or_else(|| panic!("{VARIABLE}={text} is neither `17` nor `17..20`"))
    });
    for seed in others.unwrap_or(seeds) {
        let named = Named(seed);
        check(seed);
        drop(named);
    }
}

fn parse(text: &str) -> Option<Range<u64>> {
    match text.split_once("..") {
        Some((first, end)) => Some(first.parse().ok()?..end.parse().ok()?),
        None => {
            let seed = text.parse().ok()?;
            Some(seed..seed + 1)
        }
    }
}

/// Says its seed when it is dropped by a failure.
struct Named(u64);

impl Drop for Named {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let test = std::thread::current();
            let test = test.name().unwrap_or("this test");
            eprintln!(
                "seed {}: repeat with {VARIABLE}={} and the test `{test}`",
                self.0, self.0
            );
        }
    }
}
