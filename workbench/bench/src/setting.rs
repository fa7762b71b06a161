//! [`Setting`]: how often something is sent, and on which processors the processes run that are measured.
//!
//! A wake-up on the processor of the one who wakes takes a few microseconds, and one on another that sleeps several times that.
//! Where the scheduler puts a process changes from run to run, so each placement is measured for itself.

use std::fmt;

use clap::ValueEnum;
use rustix::thread::CpuSet;

/// Where the processes of a measurement run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Placement {
    /// All on one processor.
    SameProcessor,
    /// Each on another processor than the process that it listens to.
    OtherProcessor,
    /// Wherever the scheduler puts them.
    Free,
}

impl Placement {
    /// What is measured unless the command line says otherwise.
    pub const PINNED: [Placement; 2] = [Placement::SameProcessor, Placement::OtherProcessor];

    /// The processors of the process that is started as number `position` (from 0) of a measurement, out of those that are
    /// `allowed`; `None` for any of them.
    ///
    /// Each process of a measurement listens to the one that was started before it, or is listened to by it.
    pub fn processors(self, position: usize, allowed: &CpuSet) -> Option<CpuSet> {
        let mut two = (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu));
        let first = two.next()?;
        let chosen = match self {
            Placement::Free => return None,
            Placement::SameProcessor => first,
            Placement::OtherProcessor if position.is_multiple_of(2) => first,
            Placement::OtherProcessor => two.next().unwrap_or(first),
        };
        let mut set = CpuSet::new();
        set.set(chosen);
        Some(set)
    }
}

impl fmt::Display for Placement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Placement::SameProcessor => "same processor",
            Placement::OtherProcessor => "other processor",
            Placement::Free => "any processor",
        })
    }
}

/// A rate at a placement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Samples or requests a second.
    pub rate_hz: u32,
    /// Where the processes run.
    pub placement: Placement,
}

impl Setting {
    /// Every rate at every placement.
    pub fn all(rates_hz: &[u32], placements: &[Placement]) -> Vec<Setting> {
        let of_rate = |rate_hz| {
            placements.iter().map(move |placement| Setting {
                rate_hz,
                placement: *placement,
            })
        };
        rates_hz.iter().copied().flat_map(of_rate).collect()
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} Hz, {}", self.rate_hz, self.placement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(cpus: &[usize]) -> CpuSet {
        let mut set = CpuSet::new();
        cpus.iter().for_each(|cpu| set.set(*cpu));
        set
    }

    #[test]
    fn neighbours_share_a_processor_or_have_one_each() {
        let allowed = set(&[3, 5, 6]);
        let places = |placement: Placement| {
            [0, 1, 2].map(|position| placement.processors(position, &allowed))
        };
        assert_eq!(places(Placement::Free), [None, None, None]);
        assert_eq!(
            places(Placement::SameProcessor),
            [&[3], &[3], &[3]].map(|cpus| Some(set(cpus)))
        );
        assert_eq!(
            places(Placement::OtherProcessor),
            [&[3], &[5], &[3]].map(|cpus| Some(set(cpus)))
        );
    }

    #[test]
    fn on_a_machine_with_one_processor_all_share_it() {
        let only = set(&[0]);
        assert_eq!(
            Placement::OtherProcessor.processors(1, &only),
            Some(set(&[0]))
        );
    }

    #[test]
    fn every_rate_is_measured_at_every_placement() {
        let all = Setting::all(&[1000, 100], &Placement::PINNED);
        let names: Vec<_> = all.iter().map(Setting::to_string).collect();
        assert_eq!(
            names,
            [
                "1000 Hz, same processor",
                "1000 Hz, other processor",
                "100 Hz, same processor",
                "100 Hz, other processor"
            ]
        );
    }
}
