//! Seeds: every mission of chance is repeated by its number.

use std::ops::{AddAssign, Range};
use std::sync::atomic::{AtomicU64, Ordering};

/// Environment variable that runs other seeds: one (`17`), to repeat a failure, or a range (`5000..9000`), to look for
/// more.
const VARIABLE: &str = "RIL_SEED";

/// A struct of figures that are added up, each by itself; with a sentence, by which it is printed.
macro_rules! sums {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$about:meta])* pub $field:ident: $kind:ty,)+ } $text:literal) => {
        $crate::missions::seeds::sums! {
            $(#[$meta])* pub struct $name { $($(#[$about])* pub $field: $kind,)+ }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                let $name { $($field,)+ } = self;
                write!(f, $text)
            }
        }
    };
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$about:meta])* pub $field:ident: $kind:ty,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default)]
        pub struct $name {
            $($(#[$about])* pub $field: $kind,)+
        }

        impl std::ops::AddAssign for $name {
            fn add_assign(&mut self, other: $name) {
                $(self.$field += other.$field;)+
            }
        }
    };
}
pub(crate) use sums;

/// Flies each seed, or those in `RIL_SEED`, on all cores, and adds up what they saw.
pub fn fly_each<T: Default + AddAssign + Send>(
    seeds: Range<u64>,
    fly: impl Fn(u64) -> T + Sync,
) -> T {
    let others = std::env::var(VARIABLE).ok().map(|text| {
        parse(&text).unwrap_or_else(|| panic!("{VARIABLE}={text} is neither `17` nor `17..20`"))
    });
    fly_range(others.unwrap_or(seeds), fly)
}

/// Flies each seed on all cores and adds up what they saw. A failure names its seed, and panics when the others that
/// had begun have ended.
pub fn fly_range<T: Default + AddAssign + Send>(
    seeds: Range<u64>,
    fly: impl Fn(u64) -> T + Sync,
) -> T {
    let next = AtomicU64::new(seeds.start);
    let work = || {
        let mut sum = T::default();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return sum;
            }
            let named = Named { seed, next: &next };
            sum += fly(seed);
            std::mem::forget(named);
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        let mut sum = T::default();
        for worker in workers {
            match worker.join() {
                Ok(part) => sum += part,
                Err(reason) => std::panic::resume_unwind(reason),
            }
        }
        sum
    })
}

/// `17` or `17..20`.
pub fn parse(text: &str) -> Option<Range<u64>> {
    match text.split_once("..") {
        Some((first, end)) => Some(first.parse().ok()?..end.parse().ok()?),
        None => {
            let seed = text.parse().ok()?;
            Some(seed..seed + 1)
        }
    }
}

/// Says its seed when it is dropped, which only a failure does, and lets no other seed begin.
struct Named<'a> {
    seed: u64,
    next: &'a AtomicU64,
}

impl Drop for Named<'_> {
    fn drop(&mut self) {
        // Far from the end of the numbers, so that the other workers' steps do not wrap.
        self.next.store(u64::MAX / 2, Ordering::Relaxed);
        let seed = self.seed;
        eprintln!(
            "seed {seed} failed: {VARIABLE}={seed} before the test, or --seeds {seed} after the program, repeats it"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_is_flown_once() {
        assert_eq!(fly_range(5..105, |seed| seed), (5..105).sum::<u64>());
        assert_eq!(parse("17"), Some(17..18));
        assert_eq!(parse("3..9"), Some(3..9));
        assert_eq!(parse("many"), None);
    }

    #[test]
    #[should_panic(expected = "seed 7 is bad")]
    fn a_failure_of_any_worker_is_one_of_all() {
        fly_range(0..100, |seed| {
            assert!(seed != 7, "seed 7 is bad");
            seed
        });
    }
}
