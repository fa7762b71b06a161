use proptest::prelude::*;

use super::*;

const MS: u64 = 1_000_000;
const US: u64 = 1_000;

/// Numbers that look random, the same in each run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % bound.max(1)
    }
}

/// What a consumer does who acts on the predictor.
#[derive(Debug, Default)]
struct Outcome {
    samples: u64,
    caught: u64,
    spun_ns: u64,
}

impl Outcome {
    fn caught(&self) -> f64 {
        self.caught as f64 / self.samples as f64
    }
}

/// Waits for the samples with the predictor, as [`Anticipation`](super::super::Anticipation) does.
fn wait_for(predictor: &mut Predictor, samples: impl IntoIterator<Item = u64>) -> Outcome {
    let mut outcome = Outcome::default();
    let mut now = MonotonicNs(0);
    for sample in samples {
        let mut is_caught = false;
        while let Some(window) = predictor.window(now) {
            assert!(window.begin <= window.end && window.end > now, "{window:?}");
            let begin = window.begin.0.max(now.0);
            if sample <= begin {
                break;
            }
            if window.begin > now {
                predictor.woke_late(Duration::ZERO);
            }
            let end = sample.min(window.end.0);
            predictor.spent(Duration::from_nanos(end - begin));
            outcome.spun_ns += end - begin;
            if sample <= window.end.0 {
                outcome.caught += 1;
                is_caught = true;
                break;
            }
            now = window.end;
        }
        outcome.samples += 1;
        now = MonotonicNs(sample);
        predictor.arrived(now, is_caught);
    }
    outcome
}

/// Samples on a grid, each late by chance.
fn jittered(count: u64, period_ns: u64, jitter_ns: u64) -> impl Iterator<Item = u64> {
    let mut dice = Dice(7);
    (1..=count).map(move |n| 12_345 * MS + n * period_ns + dice.below(jitter_ns))
}

#[test]
fn regular_samples_are_caught_for_next_to_nothing() {
    for period_ns in [MS, 10 * MS, 20 * MS] {
        let mut predictor = Predictor::new(0.02);
        let outcome = wait_for(&mut predictor, jittered(1_000, period_ns, US));
        assert!(outcome.caught() > 0.9, "{outcome:?}");
        assert!(outcome.spun_ns < outcome.samples * 10 * US, "{outcome:?}");
    }
}

#[test]
fn jittering_samples_are_caught_as_far_as_the_budget_goes() {
    for (period_ns, budget) in [(20 * MS, 0.02), (10 * MS, 0.02), (MS, 0.12)] {
        let mut predictor = Predictor::new(budget);
        let outcome = wait_for(&mut predictor, jittered(5_000, period_ns, 500 * US));
        assert!(outcome.caught() > 0.5, "{period_ns}: {outcome:?}");
        let most_ns = budget * (outcome.samples * period_ns) as f64;
        assert!(outcome.spun_ns as f64 <= 1.01 * most_ns, "{outcome:?}");
    }
}

/// Half a period of jitter at the budget of a hundredth: nothing to be had.
#[test]
fn samples_without_a_rhythm_are_left_to_the_doorbell() {
    let mut predictor = Predictor::new(0.01);
    let outcome = wait_for(&mut predictor, jittered(2_000, 10 * MS, 5 * MS));
    assert_eq!(outcome.caught, 0, "{outcome:?}");
}

#[test]
fn another_rhythm_is_learned() {
    let mut predictor = Predictor::new(0.02);
    wait_for(&mut predictor, (1..500).map(|n| n * 20 * MS));
    let outcome = wait_for(&mut predictor, (1..500).map(|n| 10_000 * MS + n * 7 * MS));
    assert!(outcome.caught() > 0.9, "{outcome:?}");
}

/// The predictor looks out in time, but the thread does not run: it gives up, and tries again.
#[test]
fn looking_out_rests_when_nothing_is_caught() {
    let mut predictor = Predictor::new(0.02);
    wait_for(&mut predictor, (1..200).map(|n| n * 10 * MS));
    let mut now = MonotonicNs(200 * 10 * MS);
    assert!(predictor.pays(now));
    while predictor.pays(now) {
        predictor.arrived(now, false);
        now = now + Duration::from_millis(10);
    }
    assert_eq!(predictor.window(now), None);
    assert!(now < MonotonicNs(4_000 * MS), "{now:?}");
    assert!(predictor.pays(now + REST));
}

/// Each tenth sample is missing; the grid goes on.
#[test]
fn a_lost_sample_does_not_disturb() {
    let mut predictor = Predictor::new(0.02);
    let samples = (1..1_000).filter(|n| n % 10 != 0).map(|n| n * 10 * MS);
    let outcome = wait_for(&mut predictor, samples);
    assert!(outcome.caught() > 0.9, "{outcome:?}");
}

/// The publisher's clock drifts by 100 ppm against ours.
#[test]
fn a_drifting_clock_is_followed() {
    let mut predictor = Predictor::new(0.02);
    let samples = (1..10_000).map(|n| n * 10_001_000);
    assert!(wait_for(&mut predictor, samples).caught() > 0.9);
}

#[test]
fn a_timer_that_wakes_late_is_set_earlier() {
    let mut predictor = Predictor::new(0.02);
    wait_for(&mut predictor, (1..100).map(|n| n * 10 * MS));
    for _ in 0..WAKES {
        predictor.woke_late(Duration::from_micros(40));
    }
    for n in 100..200 {
        predictor.arrived(MonotonicNs(n * 10 * MS), true);
    }
    let now = MonotonicNs(199 * 10 * MS);
    let window = predictor.window(now).unwrap();
    let lead = MonotonicNs(200 * 10 * MS).since(window.begin);
    assert!(lead >= Duration::from_micros(39), "{lead:?}");
}

proptest! {
    /// Whatever comes, and whenever: windows lie in the future, and looking out stays within the budget.
    #[test]
    fn the_budget_is_never_exceeded(
        budget in 0.001..0.5,
        steps in prop::collection::vec((1_u64..50_000, 0_u64..4), 1..400),
    ) {
        let mut predictor = Predictor::new(budget);
        let mut now = MonotonicNs(0);
        let mut spent_ns = 0.0;
        for (step_us, kind) in steps {
            now = now + Duration::from_micros(step_us);
            if kind > 0 {
                predictor.arrived(now, kind == 2);
            }
            // It never comes: the whole window is looked through, again and again.
            for _ in 0..kind {
                if let Some(window) = predictor.window(now) {
                    prop_assert!(window.end > now);
                    let spent = window.end.since(window.begin.max(now));
                    predictor.spent(spent);
                    spent_ns += spent.as_nanos() as f64;
                    now = window.end;
                }
            }
        }
        let most_ns = budget * (now.0 as f64 + CREDIT_TIME.as_nanos() as f64);
        prop_assert!(spent_ns <= most_ns + 1.0, "{spent_ns} of {most_ns}");
    }
}
