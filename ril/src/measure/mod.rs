//! What `ril hz`, `ril delay` and `ril bw` measure, as pure values: they are given samples with the moment at which each
//! came, and say what that makes.
//!
//! Nothing here reads a clock or a port. Losses are not guessed from times: they are those that the subscriber counted by
//! sequence numbers.
//!
//! * [`rate`]: how often samples come, and how often they are published;
//! * [`delay`]: how old they are when they come;
//! * [`bandwidth`]: how many bytes that makes;
//! * [`histogram`]: percentiles and histogram of a quantity.

pub mod bandwidth;
pub mod delay;
pub mod histogram;
pub mod rate;

use std::fmt;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, Number, SharedStruct};
use ipc_types::schema::Value;
use ipc_types::service::{EPOCH_OFFSET, SEQUENCE_OFFSET};
use ipc_types::{Losses, MonotonicNs, Schema, TelemetryGroup, Topic};
use serde::Serialize;

use crate::words::count;

/// What a measurement wants to know of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamps {
    /// Which publisher made it.
    pub epoch_ns: u64,
    /// Its number.
    pub sequence: u64,
    /// When it was made, as its publisher says: of raw telemetry the moment at which the last byte was read.
    pub sent: MonotonicNs,
    /// When the bridge read the last byte of what it says; nothing for a sample that no message of the DSP makes.
    pub received: Option<MonotonicNs>,
    /// When the publisher sent it, if it says so.
    pub published: Option<MonotonicNs>,
    /// The DSP's clock, if it was transmitted.
    pub dsp: Option<DspClock>,
}

/// The DSP's clock in a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DspClock {
    /// Since the DSP's boot, ns; steps of a millisecond.
    pub since_boot_ns: u64,
    /// How often the publisher saw the DSP boot: another count is another clock.
    pub boots: u32,
}

/// A sample that can be measured.
pub trait Measured: Topic {
    /// What a measurement wants to know of it.
    fn stamps(&self) -> Stamps;
}

impl Measured for DspTelemetry {
    fn stamps(&self) -> Stamps {
        let received = MonotonicNs(self.received_ns);
        Stamps {
            epoch_ns: self.epoch_ns,
            sequence: self.sequence,
            sent: received,
            received: Some(received),
            published: None,
            dsp: self.valid(TelemetryGroup::Time).then(|| DspClock {
                since_boot_ns: u64::from(self.dsp_time_ms) * 1_000_000,
                boots: self.dsp_boots,
            }),
        }
    }
}

impl Measured for HeroTelemetry {
    fn stamps(&self) -> Stamps {
        let published = MonotonicNs(self.published_ns);
        Stamps {
            epoch_ns: self.epoch_ns,
            sequence: self.sequence,
            sent: published,
            received: Some(MonotonicNs(self.received_ns)),
            published: Some(published),
            dsp: self.valid(TelemetryGroup::Time).then(|| DspClock {
                // A conversion of floats saturates, so that no value of shared memory does harm.
                since_boot_ns: ((self.dsp_time_s * 1e3).round() as u64).saturating_mul(1_000_000),
                boots: self.dsp_boots,
            }),
        }
    }
}

impl Measured for ModuleState {
    fn stamps(&self) -> Stamps {
        let published = MonotonicNs(self.published_ns);
        Stamps {
            epoch_ns: self.epoch_ns,
            sequence: self.sequence,
            sent: published,
            received: None,
            published: Some(published),
            dsp: None,
        }
    }
}

/// Reads from samples of any struct what a measurement wants to know, by their schema.
///
/// A module says when it sent a sample in a field `published_ns: u64`, and when it learnt what the sample says in a field
/// `received_ns: u64`, both host monotonic ns. Of the robot's own telemetry the DSP's clock is known too.
#[derive(Clone, Copy, Debug)]
pub struct StampReader {
    /// For structs that this program was built with.
    own: Option<OwnReader>,
    received: Option<usize>,
    published: Option<usize>,
}

/// Reads the stamps of one struct; nothing when the bytes are not as many as it has.
type OwnReader = fn(&[u8]) -> Option<Stamps>;

impl StampReader {
    /// The reader of samples that `schema` describes.
    pub fn of(schema: &Schema) -> StampReader {
        let place = |name| {
            let leaf = schema.number(name)?;
            (leaf.number == Number::U64).then_some(leaf.offset)
        };
        StampReader {
            own: match schema.type_name() {
                DspTelemetry::TYPE_NAME => Some(own::<DspTelemetry>),
                HeroTelemetry::TYPE_NAME => Some(own::<HeroTelemetry>),
                _ => None,
            },
            received: place("received_ns"),
            published: place("published_ns"),
        }
    }

    /// What is known of a sample that came at `now`. One that does not say when it was made was made at that moment.
    pub fn read(self, payload: &[u8], now: MonotonicNs) -> Stamps {
        if let Some(stamps) = self.own.and_then(|own| own(payload)) {
            return stamps;
        }
        let number = |offset| Value::read(Number::U64, payload, offset)?.as_u64();
        let time = |place: Option<usize>| place.and_then(number).map(MonotonicNs);
        let (received, published) = (time(self.received), time(self.published));
        Stamps {
            epoch_ns: number(EPOCH_OFFSET).unwrap_or_default(),
            sequence: number(SEQUENCE_OFFSET).unwrap_or_default(),
            sent: published.or(received).unwrap_or(now),
            received,
            published,
            dsp: None,
        }
    }
}

fn own<T: Measured>(payload: &[u8]) -> Option<Stamps> {
    T::from_bytes(payload).map(|sample| sample.stamps())
}

/// How much of a report is shown to people. Programs get everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The figures, which fit a terminal of 80 columns and 24 rows.
    Figures,
    /// The histograms as well.
    Histograms,
}

/// What a measurement says to people.
pub trait Report: Serialize {
    /// Writes it as lines of at most 80 characters.
    ///
    /// # Errors
    ///
    /// Those of `f`.
    fn write(&self, detail: Detail, f: &mut fmt::Formatter<'_>) -> fmt::Result;

    /// It as something to be printed.
    fn text(&self, detail: Detail) -> Text<'_, Self>
    where
        Self: Sized,
    {
        Text(self, detail)
    }
}

/// A report as it is shown to people.
#[derive(Clone, Copy, Debug)]
pub struct Text<'a, R>(&'a R, Detail);

impl<R: Report> fmt::Display for Text<'_, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.write(self.1, f)
    }
}

/// A measurement: samples go in, a report comes out at any time.
pub trait Meter {
    /// What comes out: as text for people, as JSON for programs.
    type Report: Report;

    /// Whether it compares times of samples with the clock of this machine.
    const SHOWS_AGES: bool = false;

    /// Begins to measure samples of so many bytes.
    fn begin(payload_bytes: usize) -> Self;

    /// Takes a sample that came at `now`.
    fn take(&mut self, stamps: &Stamps, now: MonotonicNs);

    /// What was measured so far.
    fn report(&self, of: Of, losses: Losses) -> Self::Report;
}

/// Whose samples are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Of<'a> {
    /// Robot id.
    pub robot: u32,
    /// Key of the service, such as `hero_telemetry`.
    pub service: &'a str,
    /// How true times of another machine are; nothing when the samples are of this machine.
    pub relayed: Option<RelayedTimes>,
}

/// How true the times in samples are that come from another machine: the relay translated them to this machine's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelayedTimes {
    /// How far they may be from the truth, to either side, s; nothing when the relay does not know it.
    pub uncertainty_s: Option<f64>,
}

/// What every report begins with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counts {
    /// Name of the JSON object's layout.
    pub schema: &'static str,
    /// Robot id.
    pub robot: u32,
    /// Key of the service.
    pub service: String,
    /// Samples that were measured.
    pub samples: u64,
    /// From the first to the last of them, s.
    pub seconds: f64,
    /// Samples that were published and never came, by their sequence numbers.
    pub lost: u64,
    /// The same in percent of those that should have come.
    pub lost_percent: f64,
    /// Samples that came twice; the second was dropped.
    pub repeated: u64,
    /// How often another publisher took over.
    pub publisher_restarts: u64,
}

impl Counts {
    fn new(schema: &'static str, of: Of, samples: u64, seconds: f64, losses: Losses) -> Counts {
        let due = losses.received.saturating_add(losses.lost);
        Counts {
            schema,
            robot: of.robot,
            service: of.service.to_owned(),
            samples,
            seconds: rounded(seconds, 6),
            lost: losses.lost,
            lost_percent: rounded(100.0 * losses.lost as f64 / due.max(1) as f64, 4),
            repeated: losses.repeated,
            publisher_restarts: losses.publisher_restarts,
        }
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} of robot {}: {} in {:.3} s",
            self.service,
            self.robot,
            count(self.samples, "sample"),
            self.seconds
        )?;
        writeln!(
            f,
            "{} lost ({:.2} %), {}",
            self.lost,
            self.lost_percent,
            count(self.publisher_restarts, "publisher restart")
        )
    }
}

/// A number with so many decimals: more would be noise.
fn rounded(number: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (number * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_says_when_it_was_made_and_the_dsp_s_time_only_if_it_is_valid() {
        let mut dsp = DspTelemetry {
            sequence: 7,
            epoch_ns: 3,
            received_ns: 50,
            dsp_time_ms: 20,
            dsp_boots: 1,
            ..DspTelemetry::default()
        };
        assert_eq!(dsp.stamps().dsp, None);
        dsp.valid_groups = TelemetryGroup::Time.bit();
        let clock = DspClock {
            since_boot_ns: 20_000_000,
            boots: 1,
        };
        let stamps = Stamps {
            epoch_ns: 3,
            sequence: 7,
            sent: MonotonicNs(50),
            received: Some(MonotonicNs(50)),
            published: None,
            dsp: Some(clock),
        };
        assert_eq!(dsp.stamps(), stamps);
        let hero = HeroTelemetry {
            sequence: 7,
            epoch_ns: 3,
            received_ns: 50,
            published_ns: 60,
            dsp_time_s: 0.02,
            dsp_boots: 1,
            valid_groups: u32::from(TelemetryGroup::Time.bit()),
            ..HeroTelemetry::default()
        };
        let stamps = Stamps {
            sent: MonotonicNs(60),
            published: Some(MonotonicNs(60)),
            ..stamps
        };
        assert_eq!(hero.stamps(), stamps);
        let state = ModuleState {
            sequence: 7,
            epoch_ns: 3,
            published_ns: 60,
            ..ModuleState::default()
        };
        let stamps = Stamps {
            received: None,
            dsp: None,
            ..stamps
        };
        assert_eq!(state.stamps(), stamps);
        // By the schema the same is read.
        let now = MonotonicNs(99);
        let read = |schema: Schema, payload: &[u8]| StampReader::of(&schema).read(payload, now);
        assert_eq!(
            read(Schema::of::<DspTelemetry>(), dsp.bytes()),
            dsp.stamps()
        );
        assert_eq!(
            read(Schema::of::<HeroTelemetry>(), hero.bytes()),
            hero.stamps()
        );
        assert_eq!(read(Schema::of::<ModuleState>(), state.bytes()), stamps);
        let strange = Schema::parse("# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\n");
        let bytes = [7_u64.to_le_bytes(), 3_u64.to_le_bytes()].concat();
        let stamps = Stamps {
            sent: now,
            published: None,
            ..stamps
        };
        assert_eq!(read(strange.unwrap(), &bytes), stamps);
    }

    #[test]
    fn absurd_values_of_shared_memory_do_no_harm() {
        for dsp_time_s in [f64::NAN, f64::INFINITY, -1.0, f64::MAX] {
            let hero = HeroTelemetry {
                dsp_time_s,
                valid_groups: u32::from(TelemetryGroup::Time.bit()),
                ..HeroTelemetry::default()
            };
            assert!(hero.stamps().dsp.is_some());
        }
    }
}
