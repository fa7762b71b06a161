//! `end-to-end`: from a byte that is available on the serial line to a consumer that reads the sample, and from a
//! request to the report that the DSP has acknowledged it.

use std::fmt;

use anyhow::Result;
use clap::ValueEnum;
use measure::median;
use ril_tests::process::Signal;

use super::{Common, hop};
use crate::harness::{At, Placement, Ril, Setting, Site};
use crate::measured::{Arrival, Measured, Part, Ratio, Round, WARM_UP, join};
use crate::peers::Peer;
use crate::report::{Bound, Section, percentiles, us};

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Rates, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 100], value_parser = clap::value_parser!(u32).range(1..=1000))]
    rates: Vec<u32>,

    /// Where the processes run
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = [Placement::SameProcessor, Placement::OtherProcessor])]
    placements: Vec<Placement>,

    /// Only these ways
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Way::value_variants().iter().copied())]
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
    /// From the terminal to a consumer, with bridge, status and consumer by hand.
    HeroByHand,
    /// A request and its answer over iceoryx2 alone.
    RawRequest,
    /// A request through a bridge by hand to the DSP and back.
    RequestByHand,
    /// A request through the bridge to the DSP and back.
    Request,
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Way::Pty => "pty → poll + read",
            Way::Hop => "one blocking hop",
            Way::Dsp => "pty → DspTelemetry",
            Way::Hero => "pty → HeroTelemetry",
            Way::HeroByHand => "pty → HeroTelemetry, by hand",
            Way::RawRequest => "iceoryx2 request + answer",
            Way::RequestByHand => "request → DSP → report, by hand",
            Way::Request => "request → DSP → report",
        })
    }
}

fn measure(case: At<Way>, seconds: f64) -> Result<Round> {
    let rate_hz = case.setting.rate_hz;
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let count = samples + WARM_UP;
    let rate = rate_hz.to_string();
    let site = Site::new(case.setting.placement)?;
    match case.way {
        Way::Hop => hop::measure(Peer::Ours, case.setting, seconds),
        Way::Pty => {
            let dsp = site.start(&format!("dsp {rate}"))?;
            let reader = site.start(&format!("read-raw {count}"))?;
            let arrivals = site.finish(reader)?;
            Ok(joined(arrivals, &site.end::<Vec<u64>>(dsp)?))
        }
        Way::Dsp | Way::Hero | Way::HeroByHand => {
            let (ril, consumer) = match case.way {
                Way::Dsp => (Ril::start(&site, &rate, false)?, "consume dsp"),
                Way::Hero => (Ril::start(&site, &rate, true)?, "consume hero"),
                _ => (Ril::by_hand(&site, &rate, true)?, "consume-by-hand"),
            };
            let consumer = site.start(&format!("{consumer} {count}"))?;
            let arrivals = site.finish(consumer)?;
            Ok(joined(arrivals, &ril.end(&site)?))
        }
        Way::RawRequest => {
            let mut server = site.start("serve-raw")?;
            let times = requests(&site, &format!("ask-raw {samples} {rate}"))?;
            server.signal(Signal::TERM);
            server.wait_exit();
            Ok(times)
        }
        Way::RequestByHand => {
            let ril = Ril::by_hand(&site, "10", false)?;
            let times = requests(&site, &format!("ask-raw {samples} {rate}"))?;
            ril.end(&site)?;
            Ok(times)
        }
        Way::Request => {
            // Ten frames a second keep the link up and the position known.
            let ril = Ril::start(&site, "10", false)?;
            let times = requests(&site, &format!("land {samples} {rate}"))?;
            ril.end(&site)?;
            Ok(times)
        }
    }
}

fn joined(mut arrivals: Vec<Arrival>, sent_ns: &[u64]) -> Round {
    join(&mut arrivals, sent_ns);
    let mut round = Round::default();
    round.add("", &arrivals[WARM_UP..]);
    round
}

fn requests(site: &Site, client: &str) -> Result<Round> {
    let times: Vec<u64> = site.finish(site.start(client)?)?;
    let mut round = Round::default();
    round.add_times("", &times);
    Ok(round)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let settings = Setting::all(&args.rates, &args.placements);
    let of = |setting| At::each(&args.ways, setting);
    let cases: Vec<At<Way>> = settings.iter().copied().flat_map(of).collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.seconds)
    })?;
    let mut section = Section::new(
        "end-to-end",
        "End to end: from the serial line to a consumer",
    );
    section.text(format!(
        "Real processes on a pseudo-terminal that is not paced: a DSP that writes full status frames (128 bytes) and answers \
         every command at once, `ril run bridge`, `ril run status`, a consumer that blocks. *By hand*: the same DSP, terminal and \
         decoder with processes on plain iceoryx2 that do nothing else of what the RIL does. Times begin just before the frame is \
         written to the terminal, or the request is sent; µs. {} rounds of {} s each, which take turns. All processes share a \
         processor, or each has another than its neighbours on the way. The request is a \
         landing: it takes one command to the DSP and its acknowledgement.",
        args.common.rounds, args.seconds,
    ));
    for setting in settings {
        section.text(format!("At {setting}:"));
        let cases: Vec<_> = of(setting)
            .map(|case| (case.way.to_string(), case))
            .collect();
        section.latencies(&measured, &cases, &[]);
        section.text(format!("Where it goes, at {setting}:"));
        let mut rows = Vec::new();
        for (name, case) in &cases {
            for part in Part::STEPS {
                let times = measured.times(*case, "", part);
                if times.count() > 0 {
                    let [p50, p99, _] = percentiles(&times);
                    rows.push(vec![format!("{name}: {part}"), p50, p99]);
                }
            }
        }
        section.table(&["part", "p50", "p99"], &rows);
        goals(&mut section, &measured, setting);
    }
    section.publish(args.common.out().as_deref())
}

/// From so many requests a second on the bridge's code stays in the processor between two. Below it what judges a
/// request is fetched again: 53 µs more than by hand until the DSP has its command, where the whole takes 150 by hand.
const AWAKE_HZ: u32 = 500;

fn goals(section: &mut Section, measured: &Measured<At<Way>>, setting: Setting) {
    let p50 = |way| measured.medians(At { way, setting });
    let (pty, hop, dsp, hero) = (p50(Way::Pty), p50(Way::Hop), p50(Way::Dsp), p50(Way::Hero));
    let zip = |a: &[f64], b: &[f64], f: fn(f64, f64) -> f64| -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()
    };
    section.goal(
        format!("pty → DspTelemetry / (pty read + hop), p50, {setting}"),
        Bound::AtMost(1.5),
        Ratio::of_rounds(&dsp, &zip(&pty, &hop, |a, b| a + b)),
    );
    section.goal(
        format!("pty → HeroTelemetry / the same by hand, p50, {setting}"),
        Bound::AtMost(1.15),
        Ratio::of_rounds(&hero, &p50(Way::HeroByHand)),
    );
    section.goal(
        format!("request / request by hand, p50, {setting}"),
        Bound::AtMost(match setting.rate_hz >= AWAKE_HZ {
            true => 1.15,
            false => 1.5,
        }),
        Ratio::of_rounds(&p50(Way::Request), &p50(Way::RequestByHand)),
    );
    let ways = [
        ("pty read", &pty),
        ("hop", &hop),
        ("to DspTelemetry", &dsp),
        ("to HeroTelemetry", &hero),
    ];
    let measured = ways
        .iter()
        .filter_map(|(name, rounds)| Some(format!("{name} {}", us(median(rounds)?))));
    let measured = measured.collect::<Vec<_>>().join(", ");
    if !measured.is_empty() {
        section.text(format!(
            "{setting}: {measured} µs (medians of the rounds' medians)."
        ));
    }
}
