//! `anticipate`: a consumer that is awake when the sample comes, against one that is woken for it.

use std::fmt;

use anyhow::Result;

use super::Common;
use crate::consumer::Cost;
use crate::peers::Peer;
use crate::process::Child;
use crate::report::{Bound, Section, us};
use crate::rounds::Measured;
use crate::site::Site;
use crate::statistics::{Ratio, Times};

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Rates, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [50, 100, 1000], value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rates: Vec<u32>,

    /// How late a sample may be by chance, µs
    #[arg(long, value_delimiter = ',', default_values_t = [0, 500])]
    jitters_us: Vec<u32>,

    /// Seconds that one case is measured for in one round
    #[arg(long, default_value_t = 4.0)]
    seconds: f64,
}

/// What is measured at once.
#[derive(Clone, Copy, PartialEq)]
struct Case {
    rate_hz: u32,
    jitter_us: u32,
    anticipates: bool,
}

impl Case {
    /// The share of a processor that looking out may use: of what the goal allows the whole consumer, all but its two wakes for
    /// each sample.
    fn budget(self) -> f64 {
        match self.anticipates {
            false => 0.0,
            true => most_cpu(self.rate_hz) - 2.0 * wake_s(self.rate_hz) * f64::from(self.rate_hz),
        }
    }
}

/// What a wake takes of the processor, s, as the rows of the blocking consumer show: more where caches are cold.
fn wake_s(rate_hz: u32) -> f64 {
    if rate_hz < 1000 { 30e-6 } else { 9e-6 }
}

/// The goal: share of a processor that the consumer may use.
fn most_cpu(rate_hz: u32) -> f64 {
    if rate_hz < 1000 { 0.02 } else { 0.08 }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = if self.anticipates {
            "anticipating"
        } else {
            "blocking"
        };
        write!(
            f,
            "{how} at {} Hz, jitter {} µs",
            self.rate_hz, self.jitter_us
        )
    }
}

fn measure(case: Case, seconds: f64) -> Result<Cost> {
    let site = Site::new()?;
    let folder = site.path();
    let samples = (f64::from(case.rate_hz) * seconds).ceil() as usize;
    let budget = case.budget();
    let mut receiver = Child::start(&site, &[&"anticipate", &samples, &budget])?;
    let peer = Peer::Ours.key();
    let peer = peer.as_str();
    let (rate_hz, jitter_us) = (case.rate_hz, case.jitter_us);
    let sender = Child::start(&site, &[&"hop-send", &peer, &folder, &rate_hz, &jitter_us])?;
    let cost = receiver.result()?;
    sender.end();
    drop(receiver);
    Ok(cost)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let mut cases = Vec::new();
    for rate_hz in &args.rates {
        for jitter_us in &args.jitters_us {
            for anticipates in [false, true] {
                cases.push(Case {
                    rate_hz: *rate_hz,
                    jitter_us: *jitter_us,
                    anticipates,
                });
            }
        }
    }
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.seconds)
    })?;
    let mut section = Section::new("anticipate", "Awake before the sample comes");
    section.text(format!(
        "A `HeroTelemetry` from one process to another, as in *One hop*; the receiver blocks, or anticipates \
         (`Subscriber::anticipate`) with what the goal for processor time leaves beside its wakes. Samples come on a grid, late by \
         chance up to the jitter. µs; {} rounds of {} s for each way in two new processes; ratios are medians of the rounds' \
         ratios.",
        args.common.rounds, args.seconds,
    ));
    let header = [
        "rate, jitter",
        "way",
        "p50",
        "p99",
        "lost",
        "of a core",
        "caught",
    ];
    let rows: Vec<_> = cases.iter().map(|case| row(&measured, *case)).collect();
    section.table(&header, &rows);
    goals(&mut section, &cases, &measured);
    section.publish(args.common.out().as_deref())
}

fn row(measured: &Measured<Case, Cost>, case: Case) -> Vec<String> {
    let rounds = measured.rounds(case);
    let times = Times::merged(rounds.iter().map(|cost| cost.series.times()));
    let lost: u64 = rounds.iter().map(|cost| cost.series.lost).sum();
    let percent = |share: fn(&Cost) -> f64| {
        let shares: Vec<f64> = rounds.iter().map(share).collect();
        let median = crate::statistics::median(&shares).unwrap_or_default();
        format!("{:.2} %", 100.0 * median)
    };
    vec![
        format!("{} Hz, {} µs", case.rate_hz, case.jitter_us),
        if case.anticipates {
            "anticipating"
        } else {
            "blocking"
        }
        .to_owned(),
        us(times.p50_ns()),
        us(times.quantile_ns(0.99)),
        lost.to_string(),
        percent(|cost| cost.cpu),
        if case.anticipates {
            percent(|cost| cost.caught)
        } else {
            "–".to_owned()
        },
    ]
}

fn goals(section: &mut Section, cases: &[Case], measured: &Measured<Case, Cost>) {
    for case in cases.iter().filter(|case| case.anticipates) {
        let blocking = Case {
            anticipates: false,
            ..*case
        };
        let name = format!("{} Hz, jitter {} µs", case.rate_hz, case.jitter_us);
        for (percentile, fraction, most) in [("p50", 0.5, 0.3), ("p99", 0.99, 1.0)] {
            let quantile = |cost: &Cost| cost.series.times().quantile_ns(fraction);
            let (ours, theirs) = (
                measured.each(*case, quantile),
                measured.each(blocking, quantile),
            );
            section.goal(
                format!("anticipating / blocking, {percentile}, {name}"),
                Bound::AtMost(most),
                Ratio::of_rounds(&ours, &theirs),
            );
        }
        let cpu = measured.each(*case, |cost| cost.cpu);
        section.goal(
            format!("share of a core, {name}"),
            Bound::AtMost(most_cpu(case.rate_hz)),
            Ratio::of_values(&cpu),
        );
    }
}
