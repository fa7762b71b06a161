//! [`Axis`]: from where to where, and where its ticks stand.

use crate::text;

/// An axis with its ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The beginning.
    pub from: f64,
    /// The end, greater than the beginning.
    pub to: f64,
    /// Where ticks stand, ascending.
    pub ticks: Vec<f64>,
    /// What is written at each tick.
    pub labels: Vec<String>,
}

/// Steps of a clock, s.
const TIME_STEPS_S: [f64; 20] = [
    0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0,
    3600.0, 7200.0, 10_800.0, 21_600.0, 43_200.0,
];

/// A day, s.
const DAY_S: f64 = 86_400.0;

/// No number of ours is greater, so that every tick is a number of its own.
const LARGEST: f64 = 1e12;

impl Axis {
    /// Time from 0 to `span_s`, with at most `most` ticks.
    pub fn time(span_s: f64, most: usize) -> Axis {
        let span_s = span_s.clamp(1e-3, LARGEST);
        let is_enough = |step: &f64| span_s / step <= most as f64;
        let step = TIME_STEPS_S.into_iter().find(is_enough);
        let step = step.unwrap_or_else(|| (span_s / most as f64 / DAY_S).ceil() * DAY_S);
        let ticks = ticks(0.0, span_s, step);
        let label = |tick: &f64| match span_s {
            ..10.0 => format!("{tick:.1} s"),
            10.0..60.0 => format!("{tick:.0} s"),
            _ => text::clock(*tick),
        };
        Axis {
            from: 0.0,
            to: span_s,
            labels: ticks.iter().map(label).collect(),
            ticks,
        }
    }

    /// Values from `least` to `greatest`, with about `most` ticks; its ends are ticks.
    pub fn values(least: f64, greatest: f64, most: usize) -> Axis {
        let least = least.clamp(-LARGEST, LARGEST);
        let greatest = greatest.clamp(least + 1e-6 * least.abs().max(1.0), LARGEST * 1.1);
        let step = nice((greatest - least) / most.max(1) as f64);
        let from = (least / step + 1e-9).floor() * step;
        let to = (greatest / step - 1e-9).ceil() * step;
        let ticks = ticks(from, to, step);
        let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        // No `-0`.
        let label = |tick: &f64| format!("{:.digits$}", tick + 0.0);
        Axis {
            from,
            to,
            labels: ticks.iter().map(label).collect(),
            ticks,
        }
    }

    /// Decades from `least`, greater than 0, so far that `greatest` is in. Values are their decimal logarithms.
    pub fn decades(least: f64, greatest: f64) -> Axis {
        let from = least.max(1e-9).log10().floor();
        let to = greatest
            .clamp(least, LARGEST)
            .max(1e-9)
            .log10()
            .ceil()
            .max(from + 1.0);
        let ticks = ticks(from, to, 1.0);
        let label = |tick: &f64| match *tick {
            ..0.0 => format!("{:.*}", -tick as usize, 10_f64.powf(*tick)),
            _ => format!("{:.0}", 10_f64.powf(*tick)),
        };
        Axis {
            from,
            to,
            labels: ticks.iter().map(label).collect(),
            ticks,
        }
    }

    /// What stands at the tick nearest to `value`.
    pub fn label(&self, value: f64) -> String {
        let nearest = (0..self.ticks.len()).min_by(|one, other| {
            distance(self.ticks[*one], value).total_cmp(&distance(self.ticks[*other], value))
        });
        nearest.map_or_else(String::new, |index| self.labels[index].clone())
    }
}

fn distance(one: f64, other: f64) -> f64 {
    (one - other).abs()
}

/// Multiples of `step` between the ends.
fn ticks(from: f64, to: f64, step: f64) -> Vec<f64> {
    /// More than any axis has.
    const MOST: usize = 100;
    let first = (from / step - 1e-9).ceil();
    let all = (0..MOST).map(|index| (first + index as f64) * step);
    all.take_while(|tick| *tick <= to + step * 1e-9).collect()
}

/// The least of 1, 2, 5, 10, … that is not less than `step`.
fn nice(step: f64) -> f64 {
    let decade = 10_f64.powf(step.log10().floor());
    let rest = step / decade;
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|factor| rest <= factor + 1e-9);
    factor.unwrap_or(10.0) * decade
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_time_are_those_of_a_clock() {
        for (span_s, most, expected) in [
            (7.0, 8, "0.0 s 1.0 s 2.0 s 3.0 s 4.0 s 5.0 s 6.0 s 7.0 s"),
            (19.5, 5, "0 s 5 s 10 s 15 s"),
            (507.0, 6, "0:00 2:00 4:00 6:00 8:00"),
            (3600.0, 6, "0:00 10:00 20:00 30:00 40:00 50:00 1:00:00"),
        ] {
            assert_eq!(Axis::time(span_s, most).labels.join(" "), expected);
        }
        assert!(Axis::time(1e30, 6).ticks.len() <= 7);
        assert!(!Axis::time(f64::MIN_POSITIVE, 6).ticks.is_empty());
    }

    #[test]
    fn ticks_of_values_are_round() {
        for (least, greatest, expected) in [
            (9.7, 35.2, "0 10 20 30 40"),
            (23.9, 25.2, "23.5 24.0 24.5 25.0 25.5"),
            (-2.1, 3.9, "-4 -2 0 2 4"),
            (-0.05, 0.1, "-0.05 0.00 0.05 0.10"),
        ] {
            assert_eq!(Axis::values(least, greatest, 4).labels.join(" "), expected);
        }
        for (least, greatest) in [
            (5.0, 5.0),
            (1e300, -1e300),
            (f64::MIN, f64::MAX),
            (0.0, 1e-300),
        ] {
            let axis = Axis::values(least, greatest, 4);
            assert!(axis.from < axis.to && axis.ticks.len() < 12, "{axis:?}");
        }
    }

    #[test]
    fn decades_are_written_as_numbers() {
        assert_eq!(
            Axis::decades(0.1, 800.0).labels.join(" "),
            "0.1 1 10 100 1000"
        );
        assert_eq!(Axis::decades(1.0, 1.0).labels.join(" "), "1 10");
        assert_eq!(Axis::decades(0.1, 800.0).label(2.1), "100");
    }
}
