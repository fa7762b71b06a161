//! [`StampReader`]: what a sample says of its publisher and of its times, whatever its struct.

use ipc_types::payload::{DspTelemetry, HeroTelemetry, Number, SharedStruct};
use ipc_types::schema::Value;
use ipc_types::service::{EPOCH_OFFSET, SEQUENCE_OFFSET};
use ipc_types::{MonotonicNs, Schema, TelemetryGroup};

/// What a sample says of its publisher and of its times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamps {
    /// Which publisher made it.
    pub epoch_ns: u64,
    /// Its number.
    pub sequence: u64,
    /// When it was made, as its publisher says: of raw telemetry the moment at which the last byte was read.
    pub sent: MonotonicNs,
    /// When the bridge read the last byte of what it says; `None` for a sample that no message of the DSP makes.
    pub received: Option<MonotonicNs>,
    /// When the publisher sent it, if it says so.
    pub published: Option<MonotonicNs>,
    /// When the DSP's message left it at the latest, if that is said.
    pub from_dsp: Option<MonotonicNs>,
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

/// Reads the stamps of samples by their schema.
///
/// A module says when it sent a sample in a field `published_ns: u64`, and when it learnt what the sample says in a
/// field `received_ns: u64`, both host monotonic ns. Of the robot's own telemetry, `sent_ns` says when its message left
/// the DSP, and the DSP's clock is known too.
#[derive(Clone, Copy, Debug)]
pub struct StampReader {
    /// For structs that this program was built with.
    dsp_clock: Option<ClockReader>,
    received: Option<usize>,
    published: Option<usize>,
    from_dsp: Option<usize>,
}

/// Reads the DSP's clock of one struct; `None` if it was not transmitted, or the bytes are not as many as the struct
/// has.
type ClockReader = fn(&[u8]) -> Option<DspClock>;

impl StampReader {
    /// The reader of samples that `schema` describes.
    pub fn of(schema: &Schema) -> StampReader {
        let place = |name| {
            let leaf = schema.number(name)?;
            (leaf.number == Number::U64).then_some(leaf.offset)
        };
        let dsp_clock: Option<ClockReader> = match schema.type_name() {
            DspTelemetry::TYPE_NAME => Some(clock_of_dsp),
            HeroTelemetry::TYPE_NAME => Some(clock_of_hero),
            _ => None,
        };
        StampReader {
            dsp_clock,
            received: place("received_ns"),
            published: place("published_ns"),
            from_dsp: dsp_clock.and_then(|_| place("sent_ns")),
        }
    }

    /// What is known of a sample that came at `now`. One that does not say when it was made was made at that moment.
    pub fn read(self, payload: &[u8], now: MonotonicNs) -> Stamps {
        let number = |offset| Value::read(Number::U64, payload, offset)?.as_u64();
        let time = |place: Option<usize>| place.and_then(number).map(MonotonicNs);
        let (received, published) = (time(self.received), time(self.published));
        Stamps {
            epoch_ns: number(EPOCH_OFFSET).unwrap_or_default(),
            sequence: number(SEQUENCE_OFFSET).unwrap_or_default(),
            sent: published.or(received).unwrap_or(now),
            received,
            published,
            from_dsp: time(self.from_dsp).filter(|at| at.0 > 0),
            dsp: self.dsp_clock.and_then(|read| read(payload)),
        }
    }
}

fn clock_of_dsp(payload: &[u8]) -> Option<DspClock> {
    let dsp = DspTelemetry::from_bytes(payload)?;
    dsp.valid(TelemetryGroup::Time).then(|| DspClock {
        since_boot_ns: u64::from(dsp.dsp_time_ms) * 1_000_000,
        boots: dsp.dsp_boots,
    })
}

fn clock_of_hero(payload: &[u8]) -> Option<DspClock> {
    let hero = HeroTelemetry::from_bytes(payload)?;
    hero.valid(TelemetryGroup::Time).then(|| DspClock {
        // A conversion of floats saturates, so that no value of shared memory does harm.
        since_boot_ns: ((hero.dsp_time_s * 1e3).round() as u64).saturating_mul(1_000_000),
        boots: hero.dsp_boots,
    })
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::ModuleState;

    use super::*;

    const NOW: MonotonicNs = MonotonicNs(99);

    fn stamps<T: ipc_types::Topic>(sample: &T) -> Stamps {
        StampReader::of(&Schema::of::<T>()).read(sample.bytes(), NOW)
    }

    #[test]
    fn each_sample_says_when_it_was_made_and_the_dsp_s_time_only_if_it_is_valid() {
        let mut dsp = DspTelemetry {
            sequence: 7,
            epoch_ns: 3,
            received_ns: 50,
            sent_ns: 48,
            dsp_time_ms: 20,
            dsp_boots: 1,
            ..DspTelemetry::default()
        };
        assert_eq!(stamps(&dsp).dsp, None);
        dsp.valid_groups = TelemetryGroup::Time.bit();
        let clock = DspClock {
            since_boot_ns: 20_000_000,
            boots: 1,
        };
        let of_dsp = Stamps {
            epoch_ns: 3,
            sequence: 7,
            sent: MonotonicNs(50),
            received: Some(MonotonicNs(50)),
            published: None,
            from_dsp: Some(MonotonicNs(48)),
            dsp: Some(clock),
        };
        assert_eq!(stamps(&dsp), of_dsp);
        let hero = HeroTelemetry {
            sequence: 7,
            epoch_ns: 3,
            received_ns: 50,
            sent_ns: 48,
            published_ns: 60,
            dsp_time_s: 0.02,
            dsp_boots: 1,
            valid_groups: u32::from(TelemetryGroup::Time.bit()),
            ..HeroTelemetry::default()
        };
        let of_hero = Stamps {
            sent: MonotonicNs(60),
            published: Some(MonotonicNs(60)),
            ..of_dsp
        };
        assert_eq!(stamps(&hero), of_hero);
        let state = ModuleState {
            sequence: 7,
            epoch_ns: 3,
            published_ns: 60,
            ..ModuleState::default()
        };
        let of_state = Stamps {
            received: None,
            from_dsp: None,
            dsp: None,
            ..of_hero
        };
        assert_eq!(stamps(&state), of_state);
        let text = "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\nuint64 sent_ns\n";
        let strange = Schema::parse(text);
        let bytes = [7, 3, 48].map(u64::to_le_bytes).concat();
        let of_strange = Stamps {
            sent: NOW,
            published: None,
            ..of_state
        };
        assert_eq!(
            StampReader::of(&strange.unwrap()).read(&bytes, NOW),
            of_strange
        );
    }

    #[test]
    fn absurd_values_of_shared_memory_do_no_harm() {
        for dsp_time_s in [f64::NAN, f64::INFINITY, -1.0, f64::MAX] {
            let hero = HeroTelemetry {
                dsp_time_s,
                valid_groups: u32::from(TelemetryGroup::Time.bit()),
                ..HeroTelemetry::default()
            };
            assert!(stamps(&hero).dsp.is_some());
        }
    }
}
