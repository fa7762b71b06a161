//! `hop`: one sample of telemetry from one process to another.

use std::fmt;

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;

use super::Common;
use crate::latency::Series;
use crate::peers::Peer;
use crate::plot::Plot;
use crate::process::Child;
use crate::report::{Bound, Section, us};
use crate::rounds::Measured;
use crate::setting::{Placement, Setting};
use crate::site::Site;
use crate::statistics::{Ratio, Times};

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Rates, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 100], value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rates: Vec<u32>,

    /// Where the two processes run
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Placement::PINNED)]
    placements: Vec<Placement>,

    /// Seconds that one case is measured for in one round
    #[arg(long, default_value_t = 1.0)]
    seconds: f64,

    /// Only these peers
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Peer::all().iter().copied())]
    peers: Vec<Peer>,
}

/// What is measured at once.
#[derive(Clone, Copy, PartialEq)]
pub struct Case {
    /// The way.
    pub peer: Peer,
    /// At which rate, and where.
    pub setting: Setting,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}", self.peer, self.setting)
    }
}

/// Measures `case` once, for about so many seconds.
pub fn measure(case: Case, seconds: f64) -> Result<Series> {
    let site = Site::placed(case.setting.placement)?;
    let (peer, folder) = (case.peer.key(), site.path());
    let (peer, rate_hz) = (peer.as_str(), case.setting.rate_hz);
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let mut receiver = Child::start(&site, &[&"hop-receive", &peer, &folder, &samples])?;
    let sender = Child::start(&site, &[&"hop-send", &peer, &folder, &rate_hz])?;
    let series = receiver.result()?;
    sender.end();
    drop(receiver);
    Ok(series)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let settings = Setting::all(&args.rates, &args.placements);
    let cases: Vec<Case> = settings
        .iter()
        .flat_map(|setting| {
            args.peers.iter().map(|peer| Case {
                peer: *peer,
                setting: *setting,
            })
        })
        .collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.seconds)
    })?;
    let mut section = Section::new("hop", "One hop: from a process to another");
    section.text(format!(
        "A `HeroTelemetry` ({} bytes) from one process to another, from just before it is given to the sender's library until \
         the receiver can read it; µs. {} rounds, in each of which every way is measured for {} s in two new processes, which \
         share a processor or have one each; the ratios are medians of the rounds' ratios of their medians.",
        size_of::<HeroTelemetry>(),
        args.common.rounds,
        args.seconds,
    ));
    section.plot(
        "performance-hop.svg",
        "Latency of one hop",
        plot(&settings[..args.placements.len()], args, &measured).to_svg(),
    );
    for setting in &settings {
        section.text(format!("At {setting}:"));
        let header = [
            "way",
            "p50",
            "p99",
            "p99.9",
            "lost",
            "to Unix socket",
            "to futex",
        ];
        let rows: Vec<_> = args
            .peers
            .iter()
            .map(|peer| row(&measured, *peer, *setting))
            .collect();
        section.table(&header, &rows);
    }
    goals(&mut section, &settings, &measured);
    section.publish(args.common.out().as_deref())
}

/// All rounds of a case together.
fn merged(rounds: &[Series]) -> Times {
    Times::merged(rounds.iter().map(Series::times))
}

fn row(measured: &Measured<Case, Series>, peer: Peer, setting: Setting) -> Vec<String> {
    let rounds = measured.rounds(Case { peer, setting });
    let times = merged(rounds);
    let to = |other| match ratio(measured, peer, other, setting) {
        Some(ratio) => format!("{:.2}", ratio.median),
        None => "–".to_owned(),
    };
    vec![
        peer.title().to_owned(),
        us(times.p50_ns()),
        us(times.quantile_ns(0.99)),
        us(times.quantile_ns(0.999)),
        rounds
            .iter()
            .map(|series| series.lost)
            .sum::<u64>()
            .to_string(),
        to(Peer::UnixSocket),
        to(Peer::Futex),
    ]
}

/// The ratio of the medians of two ways.
fn ratio(
    measured: &Measured<Case, Series>,
    peer: Peer,
    other: Peer,
    setting: Setting,
) -> Option<Ratio> {
    let medians = |peer| measured.each(Case { peer, setting }, |series| series.times().p50_ns());
    Ratio::of_rounds(&medians(peer), &medians(other))
}

fn goals(section: &mut Section, settings: &[Setting], measured: &Measured<Case, Series>) {
    for setting in settings {
        for (peer, other, most) in [
            (Peer::Ours, Peer::UnixSocket, 0.75),
            (Peer::Ours, Peer::Futex, 1.15),
            (Peer::OursSpin, Peer::IceoryxSpin, 1.1),
        ] {
            section.goal(
                format!("{peer} / {other}, p50, {setting}"),
                Bound::AtMost(most),
                ratio(measured, peer, other, *setting),
            );
        }
    }
}

/// The first rate, at each placement.
fn plot(settings: &[Setting], args: &Args, measured: &Measured<Case, Series>) -> Plot {
    Plot::of_latencies(
        "One sample of telemetry from a process to another",
        settings,
        &args.peers,
        |peer| (peer.title(), peer.is_ours()),
        |peer, setting| merged(measured.rounds(Case { peer, setting })),
    )
}
