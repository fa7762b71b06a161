//! `end-to-end`: from a byte that is available on the serial line to a consumer that reads the sample, and from a request
//! to the report that the DSP has acknowledged it.

use std::fmt;

use anyhow::Result;
use clap::ValueEnum;

use super::{Common, hop};
use crate::consumer::Arrival;
use crate::dsp::Sent;
use crate::latency::{Series, WARM_UP};
use crate::peers::Peer;
use crate::plot::Plot;
use crate::process::{Child, Ril, Stage, start_dsp};
use crate::report::{Bound, Section, us};
use crate::rounds::Measured;
use crate::setting::{Placement, Setting};
use crate::site::Site;
use crate::statistics::{Ratio, Times, median};

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Rates, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 100], value_parser = clap::value_parser!(u32).range(1..=1000))]
    rates: Vec<u32>,

    /// Where the processes run
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Placement::PINNED)]
    placements: Vec<Placement>,

    /// Only these ways
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Way::ALL)]
    ways: Vec<Way>,

    /// Seconds that one case is measured for in one round
    #[arg(long, default_value_t = 1.0)]
    seconds: f64,
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum Way {
    /// From the terminal to `poll` and `read`.
    Pty,
    /// One hop to a consumer that blocks.
    Hop,
    /// From the terminal through the bridge to a consumer.
    Dsp,
    /// From the terminal through bridge and status to a consumer.
    Hero,
    /// A request and its answer over iceoryx2 alone.
    RawRequest,
    /// A request through the bridge to the DSP and back.
    Request,
}

impl Way {
    const ALL: [Way; 6] = [
        Way::Pty,
        Way::Hop,
        Way::Dsp,
        Way::Hero,
        Way::RawRequest,
        Way::Request,
    ];

    fn title(self) -> &'static str {
        match self {
            Way::Pty => "pty → poll + read",
            Way::Hop => "one blocking hop",
            Way::Dsp => "pty → DspTelemetry",
            Way::Hero => "pty → HeroTelemetry",
            Way::RawRequest => "iceoryx2 request + answer",
            Way::Request => "request → DSP → report",
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
struct Case {
    way: Way,
    setting: Setting,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}", self.way.title(), self.setting)
    }
}

/// One round of one case: the whole time, and of the telemetry where it goes.
struct Round {
    whole: Series,
    /// From the bridge's read on.
    after_read: Times,
    parts: Vec<(&'static str, Times)>,
}

impl Round {
    fn whole(series: Series) -> Round {
        Round {
            whole: series,
            after_read: Times::new(),
            parts: Vec::new(),
        }
    }

    /// Joins what was sent with what has arrived; the first arrivals do not count.
    fn join(sent: &Sent, arrivals: &[Arrival]) -> Round {
        let mut whole = Series::default();
        let mut after_read = Times::new();
        let mut parts = [
            ("written → read by the bridge", Times::new()),
            ("read by the bridge → published by status", Times::new()),
            ("read or published last → consumer", Times::new()),
        ];
        let mut last = None;
        for arrival in arrivals.iter().skip(WARM_UP) {
            if let Some(last) = last.replace(arrival.index) {
                whole.lost += u64::from(arrival.index.saturating_sub(last + 1));
            }
            // The first frame has the index 1.
            let Some(sent_ns) = sent.sent_ns.get(arrival.index as usize - 1) else {
                continue;
            };
            whole
                .times_ns
                .push(arrival.arrived_ns.saturating_sub(*sent_ns));
            if arrival.received_ns == 0 {
                continue;
            }
            after_read.add(arrival.arrived_ns.saturating_sub(arrival.received_ns));
            parts[0].1.add(arrival.received_ns.saturating_sub(*sent_ns));
            if arrival.published_ns > 0 {
                parts[1]
                    .1
                    .add(arrival.published_ns.saturating_sub(arrival.received_ns));
            }
            let before = arrival.published_ns.max(arrival.received_ns);
            parts[2].1.add(arrival.arrived_ns.saturating_sub(before));
        }
        let parts = parts.into_iter().filter(|(_, times)| times.count() > 0);
        Round {
            whole,
            after_read,
            parts: parts.collect(),
        }
    }
}

fn measure(case: Case, seconds: f64) -> Result<Round> {
    let setting = case.setting;
    let rate_hz = setting.rate_hz;
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let rate = rate_hz.to_string();
    let site = Site::placed(setting.placement)?;
    match case.way {
        Way::Hop => {
            let peer = Peer::Ours;
            hop::measure(hop::Case { peer, setting }, seconds).map(Round::whole)
        }
        Way::Pty => {
            let (dsp, port) = start_dsp(&site, &rate)?;
            let port = port.as_path();
            let count = samples + WARM_UP;
            let mut reader = Child::start(&site, &[&"read-raw", &port, &count])?;
            let arrivals: Vec<Arrival> = reader.result()?;
            Ok(Round::join(&dsp.finish()?, &arrivals))
        }
        Way::Dsp => telemetry(&site, &rate, Stage::Bridge, "dsp", samples),
        Way::Hero => telemetry(&site, &rate, Stage::Status, "hero", samples),
        Way::RawRequest => {
            let server = Child::start(&site, &[&"serve-raw"])?;
            let mut client = Child::start(&site, &[&"ask-raw", &samples, &rate_hz])?;
            let times_ns = client.result()?;
            server.end();
            Ok(Round::whole(Series { times_ns, lost: 0 }))
        }
        Way::Request => {
            // Ten frames a second keep the link up and the position known.
            let ril = Ril::start(&site, "10", Stage::Bridge)?;
            let mut client = Child::start(&site, &[&"land", &samples, &rate_hz])?;
            let times_ns = client.result()?;
            ril.finish::<Sent>()?;
            Ok(Round::whole(Series { times_ns, lost: 0 }))
        }
    }
}

fn telemetry(
    site: &Site,
    rate: &str,
    stage: Stage,
    service: &str,
    samples: usize,
) -> Result<Round> {
    let ril = Ril::start(site, rate, stage)?;
    let count = samples + WARM_UP;
    let mut consumer = Child::start(site, &[&"consume", &service, &count])?;
    let arrivals: Vec<Arrival> = consumer.result()?;
    Ok(Round::join(&ril.finish()?, &arrivals))
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let settings = Setting::all(&args.rates, &args.placements);
    let cases: Vec<Case> = settings
        .iter()
        .flat_map(|setting| {
            args.ways.iter().map(|way| Case {
                way: *way,
                setting: *setting,
            })
        })
        .collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.seconds)
    })?;
    let mut section = Section::new(
        "end-to-end",
        "End to end: from the serial line to a consumer",
    );
    section.text(format!(
        "Real processes on a pseudo-terminal that is not paced: a DSP that writes full status frames (128 bytes) and answers \
         every command at once, `ril run bridge`, `ril run status`, a consumer that blocks. Times begin just before the frame is \
         written to the terminal, or the request is sent; µs. {} rounds of {} s each, which take turns. All processes share a \
         processor, or each has another than its neighbours on the way. The request is a \
         landing: it takes one command to the DSP and its acknowledgement.",
        args.common.rounds, args.seconds,
    ));
    section.plot(
        "performance-end-to-end.svg",
        "Latency from the serial line to a consumer",
        plot(&settings[..args.placements.len()], args, &measured).to_svg(),
    );
    for setting in &settings {
        section.text(format!("At {setting}:"));
        let rows: Vec<_> = args
            .ways
            .iter()
            .map(|way| row(&measured, *way, *setting))
            .collect();
        section.table(&["what", "p50", "p99", "p99.9", "lost"], &rows);
        section.text(format!("Where it goes, at {setting}:"));
        section.table(&["part", "p50", "p99"], &parts(&measured, *setting));
    }
    for setting in &settings {
        goals(&mut section, &measured, *setting);
    }
    section.publish(args.common.out().as_deref())
}

type Rounds = Measured<Case, Round>;

fn merged(rounds: &[Round]) -> Times {
    Times::merged(rounds.iter().map(|round| round.whole.times()))
}

fn row(measured: &Rounds, way: Way, setting: Setting) -> Vec<String> {
    let rounds = measured.rounds(Case { way, setting });
    let times = merged(rounds);
    vec![
        way.title().to_owned(),
        us(times.p50_ns()),
        us(times.quantile_ns(0.99)),
        us(times.quantile_ns(0.999)),
        rounds
            .iter()
            .map(|round| round.whole.lost)
            .sum::<u64>()
            .to_string(),
    ]
}

/// The parts of the ways that have some.
fn parts(measured: &Rounds, setting: Setting) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for way in Way::ALL {
        let rounds = measured.rounds(Case { way, setting });
        let Some(first) = rounds.first() else {
            continue;
        };
        for (index, (name, _)) in first.parts.iter().enumerate() {
            let mut all = Times::new();
            for round in rounds {
                if let Some((_, times)) = round.parts.get(index) {
                    all.merge(times);
                }
            }
            rows.push(vec![
                format!("{}: {name}", way.title()),
                us(all.p50_ns()),
                us(all.quantile_ns(0.99)),
            ]);
        }
    }
    rows
}

fn goals(section: &mut Section, measured: &Rounds, setting: Setting) {
    let p50 = |way| measured.each(Case { way, setting }, |round| round.whole.times().p50_ns());
    let (pty, hop, dsp, hero) = (p50(Way::Pty), p50(Way::Hop), p50(Way::Dsp), p50(Way::Hero));
    let sum = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + b).collect() };
    section.goal(
        format!("pty → DspTelemetry / (pty read + hop), p50, {setting}"),
        Bound::AtMost(1.5),
        Ratio::of_rounds(&dsp, &sum(&pty, &hop)),
    );
    // From the bridge's read on, because what the terminal takes differs more from run to run than a hop takes.
    let after_read = |way| measured.each(Case { way, setting }, |round| round.after_read.p50_ns());
    let further: Vec<f64> = after_read(Way::Hero)
        .iter()
        .zip(after_read(Way::Dsp))
        .map(|(hero, dsp)| hero - dsp)
        .collect();
    section.goal(
        format!("further to HeroTelemetry, from the bridge's read on / hop, p50, {setting}"),
        Bound::AtMost(1.3),
        Ratio::of_rounds(&further, &hop),
    );
    let reference = sum(&sum(&pty, &pty), &p50(Way::RawRequest));
    section.goal(
        format!("request / (two pty reads + iceoryx2 request), p50, {setting}"),
        Bound::AtMost(1.5),
        Ratio::of_rounds(&p50(Way::Request), &reference),
    );
    let medians = [&pty, &hop, &dsp, &hero].map(|rounds| us(median(rounds).unwrap_or_default()));
    let [pty, hop, dsp, hero] = medians;
    section.text(format!(
        "{setting}: pty read {pty}, hop {hop}, to DspTelemetry {dsp}, to HeroTelemetry {hero} µs (medians of the rounds' \
         medians)."
    ));
}

/// The first rate, at each placement.
fn plot(settings: &[Setting], args: &Args, measured: &Rounds) -> Plot {
    Plot::of_latencies(
        "From the serial line to a consumer, and a request to the DSP",
        settings,
        &args.ways,
        |way| (way.title(), !matches!(way, Way::Pty | Way::RawRequest)),
        |way, setting| merged(measured.rounds(Case { way, setting })),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrivals_are_joined_with_what_was_sent_and_gaps_are_losses() {
        let count = WARM_UP as u32 + 4;
        let sent = Sent {
            sent_ns: (1..=u64::from(count)).map(|index| index * 1000).collect(),
        };
        let arrival = |index: u32| Arrival {
            index,
            received_ns: u64::from(index) * 1000 + 10,
            published_ns: u64::from(index) * 1000 + 30,
            arrived_ns: u64::from(index) * 1000 + 60,
        };
        // The last frame but one is missing.
        let arrivals: Vec<_> = (1..=count)
            .filter(|index| *index != count - 1)
            .map(arrival)
            .collect();
        let round = Round::join(&sent, &arrivals);
        assert_eq!((round.whole.times_ns, round.whole.lost), (vec![60; 3], 1));
        let medians: Vec<_> = round
            .parts
            .iter()
            .map(|(_, times)| times.p50_ns())
            .collect();
        assert_eq!(medians, [10.0, 20.0, 30.0]);
    }

    #[test]
    fn without_a_bridge_there_are_no_parts() {
        let sent = Sent {
            sent_ns: vec![0; 100],
        };
        let arrivals: Vec<_> = (1..=100)
            .map(|index| Arrival {
                index,
                received_ns: 0,
                published_ns: 0,
                arrived_ns: 5,
            })
            .collect();
        let round = Round::join(&sent, &arrivals);
        assert!(round.parts.is_empty());
        assert_eq!(round.whole.times_ns.len(), 100 - WARM_UP);
    }
}
