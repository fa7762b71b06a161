//! Rounds that take turns: every case is measured once in each, in an order that changes.

use std::fmt::Display;

/// Rounds of a figure that is to be believed: at least seven, and more when the machine has other things to do.
pub const DEFAULT_ROUNDS: usize = 11;

/// What was measured: for each case its rounds, in order.
pub struct Measured<C, M> {
    cases: Vec<(C, Vec<M>)>,
}

impl<C: Copy + PartialEq + Display, M> Measured<C, M> {
    /// Measures every case of `cases` in every one of `rounds` rounds.
    ///
    /// # Errors
    /// The first failure of `measure`.
    pub fn take(
        cases: &[C],
        rounds: usize,
        mut measure: impl FnMut(C) -> anyhow::Result<M>,
    ) -> anyhow::Result<Measured<C, M>> {
        let mut measured = Measured {
            cases: cases.iter().map(|case| (*case, Vec::new())).collect(),
        };
        for round in 0..rounds {
            for index in order(cases.len(), round) {
                let (case, results) = &mut measured.cases[index];
                eprintln!("round {} of {rounds}: {case}", round + 1);
                results.push(measure(*case)?);
            }
        }
        Ok(measured)
    }

    /// The rounds of `case`; none when it was not measured.
    pub fn rounds(&self, case: C) -> &[M] {
        self.cases
            .iter()
            .find(|(measured, _)| *measured == case)
            .map_or(&[], |(_, rounds)| rounds)
    }

    /// One figure of each round of `case`.
    pub fn each(&self, case: C, figure: impl Fn(&M) -> f64) -> Vec<f64> {
        self.rounds(case).iter().map(figure).collect()
    }
}

/// The order of `count` cases in a round: forwards and backwards in turn, and each pair of rounds begins elsewhere, so that
/// none always follows the same other one.
fn order(count: usize, round: usize) -> Vec<usize> {
    let first = round / 2;
    let mut order: Vec<usize> = (0..count).map(|index| (index + first) % count).collect();
    if round % 2 == 1 {
        order.reverse();
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_round_has_every_case_once_and_the_order_changes() {
        let orders: Vec<_> = (0..4).map(|round| order(4, round)).collect();
        for order in &orders {
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, [0, 1, 2, 3]);
        }
        assert_eq!(orders[0], [0, 1, 2, 3]);
        assert_eq!(orders[1], [3, 2, 1, 0]);
        assert_eq!(orders[2], [1, 2, 3, 0]);
        assert_eq!(orders[3], [0, 3, 2, 1]);
        assert_eq!(order(0, 3), Vec::<usize>::new());
    }

    #[test]
    fn what_was_measured_is_found_by_its_case() {
        let mut next = 0.0;
        let measured = Measured::take(&['a', 'b'], 2, |_| {
            next += 1.0;
            Ok(next)
        })
        .unwrap();
        // The second round runs backwards.
        assert_eq!(measured.rounds('a'), [1.0, 4.0]);
        assert_eq!(measured.each('b', |value| value * 2.0), [4.0, 6.0]);
        assert!(measured.rounds('c').is_empty());
    }

    #[test]
    fn a_failure_ends_the_measurement() {
        let result = Measured::<char, ()>::take(&['a'], 1, |_| anyhow::bail!("no"));
        assert!(result.is_err());
    }
}
