//! What was measured: times and figures of each case in each round, and the ratio of two cases of the same round. Pure.

use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::time::Duration;

use measure::{Times, median};
use serde::{Deserialize, Serialize};

/// Rounds of a figure that is to be believed: at least seven, and more when the machine has other things to do.
pub const DEFAULT_ROUNDS: usize = 11;

/// Samples at the beginning that do not count: connections are made, pages touched, processors awake.
pub const WARM_UP: usize = 50;

/// The quantity of samples that were published and did not come.
pub const LOST: &str = "lost";

/// A sample as it came to a consumer. All moments are `CLOCK_MONOTONIC`, ns; 0 is one that is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Arrival {
    /// Counts what was sent, from 1.
    pub index: u64,
    /// Just before it was given to what is measured.
    pub sent_ns: u64,
    /// When the bridge had read it.
    pub received_ns: u64,
    /// When status published it.
    pub published_ns: u64,
    /// When the consumer could read it.
    pub arrived_ns: u64,
}

/// Fills in when the samples were sent: `sent_ns` has those moments in order, from index 1.
pub fn join(arrivals: &mut [Arrival], sent_ns: &[u64]) {
    for arrival in arrivals {
        let place = arrival.index as usize - 1;
        arrival.sent_ns = sent_ns.get(place).copied().unwrap_or_default();
    }
}

/// A part of the way of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// From just before it was sent until the consumer could read it.
    Whole,
    /// Until the bridge had read it.
    ToBridge,
    /// From there until status published it.
    InStatus,
    /// From the last process until the consumer could read it.
    ToConsumer,
    /// From the bridge's read until the consumer could read it.
    AfterRead,
}

impl Part {
    /// The parts that add up to the whole.
    pub const STEPS: [Part; 3] = [Part::ToBridge, Part::InStatus, Part::ToConsumer];
}

impl Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Part::Whole => "whole",
            Part::ToBridge => "written → read by the bridge",
            Part::InStatus => "read by the bridge → published by status",
            Part::ToConsumer => "read or published last → consumer",
            Part::AfterRead => "from the bridge's read on",
        })
    }
}

/// What one case has shown in one round. What of a case is measured side by side has names of its own; else the name is
/// empty.
#[derive(Clone, Debug, Default)]
pub struct Round {
    times: BTreeMap<(&'static str, Part), Times>,
    figures: BTreeMap<(&'static str, &'static str), f64>,
}

impl Round {
    /// Adds whole times, ns.
    pub fn add_times(&mut self, name: &'static str, times_ns: &[u64]) {
        let times = self.times.entry((name, Part::Whole)).or_default();
        times.extend(times_ns.iter().map(|ns| Duration::from_nanos(*ns)));
    }

    /// Adds arrivals of one publisher, in order: a gap in their index is a loss.
    pub fn add(&mut self, name: &'static str, arrivals: &[Arrival]) {
        let mut lost = 0;
        let mut last = None;
        for arrival in arrivals {
            if let Some(last) = last.replace(arrival.index) {
                lost += arrival.index.saturating_sub(last + 1);
            }
            self.add_arrival(name, arrival);
        }
        self.add_figure(name, LOST, lost as f64);
    }

    fn add_arrival(&mut self, name: &'static str, arrival: &Arrival) {
        let Arrival {
            sent_ns: sent,
            received_ns: read,
            published_ns: published,
            arrived_ns: arrived,
            ..
        } = *arrival;
        let mut add = |part, from: u64, to: u64| {
            if from > 0 && to > 0 {
                let times = self.times.entry((name, part)).or_default();
                times.push(Duration::from_nanos(to.saturating_sub(from)));
            }
        };
        add(Part::Whole, sent, arrived);
        if sent > 0 && read > 0 {
            add(Part::ToBridge, sent, read);
            add(Part::InStatus, read, published);
            add(Part::ToConsumer, read.max(published), arrived);
            add(Part::AfterRead, read, arrived);
        }
    }

    /// Adds to a figure.
    pub fn add_figure(&mut self, name: &'static str, quantity: &'static str, value: f64) {
        *self.figures.entry((name, quantity)).or_default() += value;
    }

    /// A figure; 0 when it was not measured.
    pub fn figure(&self, name: &'static str, quantity: &'static str) -> f64 {
        self.figures
            .get(&(name, quantity))
            .copied()
            .unwrap_or_default()
    }
}

/// Each case with its rounds, in order.
pub struct Measured<C>(Vec<(C, Vec<Round>)>);

impl<C: Copy + PartialEq + Display> Measured<C> {
    /// Measures every case once in each of `rounds` rounds, which take turns: whatever else the machine does falls upon
    /// all alike.
    ///
    /// # Errors
    /// The first failure of `measure`.
    pub fn take(
        cases: &[C],
        rounds: usize,
        mut measure: impl FnMut(C) -> anyhow::Result<Round>,
    ) -> anyhow::Result<Measured<C>> {
        let mut measured: Vec<_> = cases.iter().map(|case| (*case, Vec::new())).collect();
        for round in 0..rounds {
            for index in order(cases.len(), round) {
                let (case, results) = &mut measured[index];
                eprintln!("round {} of {rounds}: {case}", round + 1);
                results.push(measure(*case)?);
            }
        }
        Ok(Measured(measured))
    }

    fn rounds(&self, case: C) -> &[Round] {
        let found = self.0.iter().find(|(measured, _)| *measured == case);
        found.map_or(&[], |(_, rounds)| rounds)
    }

    /// The times of all rounds together.
    pub fn times(&self, case: C, name: &'static str, part: Part) -> Times {
        let mut all = Times::default();
        for round in self.rounds(case) {
            if let Some(times) = round.times.get(&(name, part)) {
                all.extend(times.0.iter().copied());
            }
        }
        all
    }

    /// A quantile of each round, ns.
    pub fn quantiles(&self, case: C, name: &'static str, part: Part, fraction: f64) -> Vec<f64> {
        let quantile = |round: &Round| {
            let times = round.times.get(&(name, part));
            times.map_or(0.0, |times| times.quantile_ns(fraction))
        };
        self.rounds(case).iter().map(quantile).collect()
    }

    /// The median of the whole of each round, ns.
    pub fn medians(&self, case: C) -> Vec<f64> {
        self.quantiles(case, "", Part::Whole, 0.5)
    }

    /// A figure of each round.
    pub fn figures(&self, case: C, name: &'static str, quantity: &'static str) -> Vec<f64> {
        let rounds = self.rounds(case).iter();
        rounds.map(|round| round.figure(name, quantity)).collect()
    }

    /// A figure of all rounds together.
    pub fn sum(&self, case: C, name: &'static str, quantity: &'static str) -> f64 {
        self.figures(case, name, quantity).iter().sum()
    }
}

/// The order of `count` cases in a round: forwards and backwards in turn, and each pair of rounds begins elsewhere, so
/// that none always follows the same other one.
fn order(count: usize, round: usize) -> Vec<usize> {
    let first = round / 2;
    let mut order: Vec<usize> = (0..count).map(|index| (index + first) % count).collect();
    if round % 2 == 1 {
        order.reverse();
    }
    order
}

/// A ratio, round by round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// Median over the rounds: the figure.
    pub median: f64,
    /// Smallest of a round.
    pub least: f64,
    /// Greatest of a round.
    pub most: f64,
}

impl Ratio {
    /// Values that are no ratios but have a bound all the same, one of each round; `None` without rounds.
    pub fn of_values(values: &[f64]) -> Option<Ratio> {
        Ratio::of_rounds(values, &vec![1.0; values.len()])
    }

    /// The ratio of `numerators` to `denominators`, which belong to the same rounds in the same order; `None` without
    /// rounds.
    pub fn of_rounds(numerators: &[f64], denominators: &[f64]) -> Option<Ratio> {
        let ratios: Vec<f64> = numerators
            .iter()
            .zip(denominators)
            .filter(|(_, denominator)| **denominator > 0.0)
            .map(|(numerator, denominator)| numerator / denominator)
            .collect();
        Some(Ratio {
            median: median(&ratios)?,
            least: ratios.iter().copied().fold(f64::INFINITY, f64::min),
            most: ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_is_taken_round_by_round_so_that_a_slow_round_cancels_out() {
        // The machine was ten times slower in the second round; the ratio of the medians would be 1.5.
        let ratio = Ratio::of_rounds(&[10.0, 100.0, 30.0], &[5.0, 50.0, 20.0]).unwrap();
        assert_eq!((ratio.least, ratio.median, ratio.most), (1.5, 2.0, 2.0));
        let without_zero = Ratio::of_rounds(&[1.0, 2.0], &[0.0, 1.0]).unwrap();
        assert_eq!(without_zero.median, 2.0);
        assert_eq!(Ratio::of_rounds(&[1.0], &[0.0]), None);
        assert_eq!(Ratio::of_values(&[3.0, 1.0]).unwrap().median, 2.0);
    }

    #[test]
    fn arrivals_are_joined_with_what_was_sent_and_gaps_are_losses() {
        let arrival = |index: u64| Arrival {
            index,
            received_ns: index * 1000 + 10,
            published_ns: index * 1000 + 30,
            arrived_ns: index * 1000 + 60,
            ..Arrival::default()
        };
        let mut arrivals: Vec<_> = [1, 2, 4, 9].map(arrival).into();
        join(&mut arrivals, &[1000, 2000, 3000, 4000]);
        let measured = Measured::take(&['a'], 1, |_| {
            let mut round = Round::default();
            round.add("", &arrivals);
            Ok(round)
        });
        let measured = measured.unwrap();
        assert_eq!(measured.sum('a', "", LOST), 5.0);
        let of = |part| measured.times('a', "", part);
        assert_eq!(
            of(Part::Whole).count(),
            3,
            "when the last was sent is not known"
        );
        let medians = Part::STEPS.map(|part| of(part).quantile_ns(0.5));
        assert_eq!(medians, [10.0, 20.0, 30.0]);
        assert_eq!(of(Part::AfterRead).quantile_ns(0.5), 50.0);
    }

    #[test]
    fn every_round_has_every_case_once_and_the_order_changes() {
        let orders = [0, 1, 2, 3].map(|round| order(4, round));
        let expected = [[0, 1, 2, 3], [3, 2, 1, 0], [1, 2, 3, 0], [0, 3, 2, 1]];
        assert_eq!(orders, expected);
        let mut next = 0.0;
        let measured = Measured::take(&['a', 'b'], 2, |_| {
            next += 1.0;
            let mut round = Round::default();
            round.add_figure("", "x", next);
            Ok(round)
        });
        // The second round runs backwards.
        assert_eq!(measured.unwrap().figures('a', "", "x"), [1.0, 4.0]);
        assert!(Measured::take(&['a'], 1, |_| anyhow::bail!("no")).is_err());
    }
}
