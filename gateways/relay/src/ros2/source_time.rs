//! [`SourceTime`]: when a sample was published, as it says itself.

use ipc_types::payload::Number;
use ipc_types::{MonotonicNs, Schema};

/// Fields that say it, the better one first: when the sample was published, and when the data came that it is made of.
const FIELDS: [&str; 2] = ["published_ns", "received_ns"];

/// Where a topic's samples say when they were published.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SourceTime {
    offsets: [Option<usize>; FIELDS.len()],
}

impl SourceTime {
    /// Of the samples that `schema` describes.
    pub fn of(schema: &Schema) -> SourceTime {
        let offset = |field| {
            let leaf = schema.number(field)?;
            let is_moment = leaf.number == Number::U64 && leaf.len.is_none();
            is_moment.then_some(leaf.offset)
        };
        SourceTime {
            offsets: FIELDS.map(offset),
        }
    }

    /// When `sample` was published; `now` when it does not say so, or names a moment that is still to come.
    pub fn of_sample(self, sample: &[u8], now: MonotonicNs) -> MonotonicNs {
        let moment = |offset: usize| {
            let bytes = sample.get(offset..)?.first_chunk()?;
            let moment = MonotonicNs(u64::from_le_bytes(*bytes));
            (moment.0 != 0 && moment <= now).then_some(moment)
        };
        let moments = self.offsets.into_iter().flatten();
        moments.filter_map(moment).next().unwrap_or(now)
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::{DspTelemetry, HeroTelemetry, SharedStruct};

    use super::*;

    const NOW: MonotonicNs = MonotonicNs(1000);

    fn of_telemetry(received_ns: u64, published_ns: u64) -> u64 {
        let sample = HeroTelemetry {
            received_ns,
            published_ns,
            ..HeroTelemetry::ZERO
        };
        let source_time = SourceTime::of(&Schema::of::<HeroTelemetry>());
        source_time.of_sample(sample.bytes(), NOW).0
    }

    #[test]
    fn publishing_comes_before_receiving_and_receiving_before_now() {
        assert_eq!(of_telemetry(700, 800), 800);
        assert_eq!(of_telemetry(700, 0), 700);
        assert_eq!(of_telemetry(0, 0), NOW.0);
        let sample = DspTelemetry {
            received_ns: 600,
            ..DspTelemetry::ZERO
        };
        let source_time = SourceTime::of(&Schema::of::<DspTelemetry>());
        assert_eq!(source_time.of_sample(sample.bytes(), NOW).0, 600);
    }

    #[test]
    fn a_moment_that_is_still_to_come_is_none() {
        assert_eq!(of_telemetry(700, NOW.0 + 1), 700);
        assert_eq!(of_telemetry(u64::MAX, u64::MAX), NOW.0);
    }

    #[test]
    fn other_fields_of_these_names_and_short_samples_mean_now() {
        let text = "# Layout: a.B.v1\n\nuint64 sequence\nuint64 epoch_ns\nint64 published_ns\nuint64[2] received_ns\n";
        let schema = Schema::parse(text).unwrap();
        let source_time = SourceTime::of(&schema);
        assert_eq!(source_time, SourceTime::default());
        assert_eq!(source_time.of_sample(&[1; 40], NOW), NOW);
        let source_time = SourceTime::of(&Schema::of::<HeroTelemetry>());
        assert_eq!(source_time.of_sample(&[1; 20], NOW), NOW);
    }
}
