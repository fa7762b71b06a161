//! `hop`: one sample of telemetry from one process to another.

use anyhow::Result;
use clap::ValueEnum;
use ipc_types::payload::HeroTelemetry;
use ril_tests::process::Signal;

use super::Common;
use crate::harness::{At, Placement, Setting, Site};
use crate::measured::{Arrival, Measured, Part, Ratio, Round};
use crate::peers::Peer;
use crate::plot::{self, Bar};
use crate::report::{Bound, PERCENTILES, Section};

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Rates, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 100], value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rates: Vec<u32>,

    /// Where the two processes run
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = [Placement::SameProcessor, Placement::OtherProcessor])]
    placements: Vec<Placement>,

    /// Seconds that one case is measured for in one round
    #[arg(long, default_value_t = 1.0)]
    seconds: f64,

    /// Only these peers
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Peer::value_variants().iter().copied())]
    peers: Vec<Peer>,
}

/// Measures a way once, for about so many seconds.
pub fn measure(peer: Peer, setting: Setting, seconds: f64) -> Result<Round> {
    let site = Site::new(setting.placement)?;
    let (key, rate_hz) = (peer.key(), setting.rate_hz);
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let receiver = site.start(&format!("hop-receive {key} {samples}"))?;
    let mut sender = site.start(&format!("hop-send {key} {rate_hz}"))?;
    let arrivals: Vec<Arrival> = site.finish(receiver)?;
    // Over some ways it has failed by now, because the receiver is gone.
    sender.signal(Signal::TERM);
    sender.wait_exit();
    let mut round = Round::default();
    round.add("", &arrivals);
    Ok(round)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let settings = Setting::all(&args.rates, &args.placements);
    let of = |setting| At::each(&args.peers, setting);
    let cases: Vec<At<Peer>> = settings.iter().copied().flat_map(of).collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case.way, case.setting, args.seconds)
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
    if let Some(setting) = settings.first() {
        let bar = |case: At<Peer>| {
            let times = measured.times(case, "", Part::Whole);
            Bar {
                name: case.way.to_string(),
                is_ours: case.way.is_ours(),
                us: PERCENTILES.map(|(_, fraction)| times.quantile_ns(fraction) / 1000.0),
            }
        };
        let bars: Vec<Bar> = of(*setting).map(bar).collect();
        let title = format!("One sample of telemetry from a process to another, {setting}");
        let svg = plot::svg(&title, &bars)?;
        section.plot("performance-hop.svg", "Latency of one hop", svg);
    }
    for &setting in &settings {
        section.text(format!("At {setting}:"));
        let case = |way| At { way, setting };
        let named = |case: At<Peer>| (case.way.to_string(), case);
        section.latencies(
            &measured,
            &of(setting).map(named).collect::<Vec<_>>(),
            &[
                ("to Unix socket", case(Peer::UnixSocket)),
                ("to futex", case(Peer::Futex)),
            ],
        );
        goals(&mut section, &measured, setting, &settings);
    }
    section.publish(args.common.out().as_deref())
}

/// A consumer that blocks is to take what the wake of a futex takes, and what plain iceoryx2 takes without a wake: that
/// is what one takes that has a processor of its own and spins. Where the processor did not sleep it is to take less
/// than a socket. A consumer that spins is for a processor of its own.
fn goals(
    section: &mut Section,
    measured: &Measured<At<Peer>>,
    setting: Setting,
    settings: &[Setting],
) {
    let medians = |way, setting| measured.medians(At { way, setting });
    let ours = medians(Peer::Ours, setting);
    let apart = Setting {
        placement: Placement::OtherProcessor,
        ..setting
    };
    let floor: Vec<f64> = medians(Peer::Futex, setting)
        .iter()
        .zip(medians(Peer::IceoryxSpin, apart))
        .map(|(wake, path)| wake + path)
        .collect();
    if settings.contains(&apart) {
        section.goal(
            format!(
                "{} / (futex + iceoryx2 that spins elsewhere), p50, {setting}",
                Peer::Ours
            ),
            Bound::AtMost(1.15),
            Ratio::of_rounds(&ours, &floor),
        );
    }
    if setting.placement == Placement::SameProcessor && setting.rate_hz >= 1000 {
        section.goal(
            format!("{} / {}, p50, {setting}", Peer::Ours, Peer::UnixSocket),
            Bound::AtMost(0.75),
            Ratio::of_rounds(&ours, &medians(Peer::UnixSocket, setting)),
        );
    }
    if setting == apart {
        section.goal(
            format!("{} / {}, p50, {setting}", Peer::OursSpin, Peer::IceoryxSpin),
            Bound::AtMost(1.1),
            Ratio::of_rounds(
                &medians(Peer::OursSpin, setting),
                &medians(Peer::IceoryxSpin, setting),
            ),
        );
    }
}
