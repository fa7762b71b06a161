//! [`Streams`]: when which message goes to a station that was heard.
//!
//! A message that is made of a sample is sent when that sample comes, so that it is new: of the samples it is the one
//! that comes nearest to the moment at which the message is due. No sample is sent twice. When the next sample does not
//! come, the one that is there is sent.
//!
//! The moments are a period apart, whenever the messages go: a late sample does not delay the one after it. Moments
//! that have passed without a message are left out, so that a machine that stalls makes up for nothing; only the last
//! one is still good for a sample that comes less than an interval of samples later.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::message::{self, MessageKind};
use crate::number::MavResult;

/// Shortest period of a message.
const MIN_PERIOD: Duration = Duration::from_millis(20);

macro_rules! streams {
    ($($(#[$meta:meta])* $name:ident = $kind:ident, $tenths:literal, $content:ident;)*) => {
        /// A message that is sent periodically.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum StreamId {
            $($(#[$meta])* $name,)*
        }

        impl StreamId {
            /// All, by their numbers.
            pub const ALL: [StreamId; [$(message::$kind),*].len()] = [$(StreamId::$name),*];

            /// The message, how often it is sent by default in tenths of a hertz, and what it is made of.
            fn row(self) -> (MessageKind, u64, StreamContent) {
                match self {
                    $(StreamId::$name => (message::$kind, $tenths, StreamContent::$content),)*
                }
            }
        }
    };
}

streams! {
    /// The helicopter is there. First, because stations look for it first.
    Heartbeat = HEARTBEAT, 10, State;
    /// The mode, as MAVLink's own.
    CurrentMode = CURRENT_MODE, 5, State;
    /// Sensors, supply, readiness.
    SysStatus = SYS_STATUS, 10, Sample;
    /// On the ground or in the air.
    ExtendedSysState = EXTENDED_SYS_STATE, 10, State;
    /// Place and velocity on the globe.
    GlobalPosition = GLOBAL_POSITION_INT, 50, Sample;
    /// Angles and rates.
    Attitude = ATTITUDE, 100, Sample;
    /// Angles and rates, with a quaternion; on request.
    AttitudeQuaternion = ATTITUDE_QUATERNION, 0, Sample;
    /// Place and velocity in metres.
    LocalPosition = LOCAL_POSITION_NED, 20, Sample;
    /// What a pilot looks at.
    VfrHud = VFR_HUD, 40, Sample;
    /// Altitudes.
    Altitude = ALTITUDE, 20, Sample;
    /// Satellites.
    GpsRaw = GPS_RAW_INT, 20, Sample;
    /// The battery.
    Battery = BATTERY_STATUS, 5, Sample;
    /// The fuel.
    Fuel = FUEL_STATUS, 5, Sample;
    /// Where home is.
    Home = HOME_POSITION, 2, State;
    /// Which item of the mission is flown.
    Mission = MISSION_CURRENT, 10, State;
}

/// What a message is made of, so that it is not sent again unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamContent {
    /// A sample of telemetry.
    Sample,
    /// States, which hold until they change.
    State,
}

impl StreamId {
    /// The message.
    pub fn kind(self) -> MessageKind {
        self.row().0
    }

    /// The stream of this message.
    pub fn of(id: u32) -> Option<StreamId> {
        StreamId::ALL
            .into_iter()
            .find(|stream| stream.kind().id == id)
    }

    /// Its period without a station's wish; `None` if it is sent on request alone.
    pub fn default_period(self) -> Option<Duration> {
        match self.row().1 {
            0 => None,
            tenths => Some(Duration::from_millis(10_000 / tenths)),
        }
    }

    /// What it is made of.
    pub fn content(self) -> StreamContent {
        self.row().2
    }

    /// The period that param2 of SET_MESSAGE_INTERVAL asks for, µs: −1 for none, 0 for the default. The heartbeat
    /// cannot be switched off.
    ///
    /// # Errors
    ///
    /// When it is no period that can be had.
    pub fn period(self, interval_us: f64) -> Result<Option<Duration>, MavResult> {
        match interval_us {
            -1.0 if self == StreamId::Heartbeat => Err(MavResult::Denied),
            -1.0 => Ok(None),
            0.0 => Ok(self.default_period()),
            us if us.is_finite() && us > 0.0 => {
                let period = Duration::from_micros(us as u64);
                let is_possible = period >= MIN_PERIOD
                    && (self != StreamId::Heartbeat || period <= Duration::from_secs(1));
                is_possible.then_some(Some(period)).ok_or(MavResult::Denied)
            }
            _ => Err(MavResult::Denied),
        }
    }
}

/// One message to one station.
#[derive(Clone, Copy, Debug)]
struct Beat {
    period: Option<Duration>,
    due: MonotonicNs,
    /// The moment of the sample that was sent last.
    sent: MonotonicNs,
}

impl Beat {
    /// When it is due again, after a sample was sent now. The moments drift to those of the samples, so that samples
    /// which come as often as the message is wanted are all sent, also those that are a little early or late. A stall
    /// moves them no farther than that, so that the rate stays what it is.
    fn next_after_sample(&self, period: Duration, now: MonotonicNs) -> MonotonicNs {
        const SHARE: u32 = 8;
        let drift = |off: Duration| off.min(MIN_PERIOD / 2) / SHARE;
        match now > self.due {
            true => self.due + period + drift(now.since(self.due)),
            false => self.due + (period - drift(self.due.since(now))),
        }
    }
}

/// The first of the moments `next`, `next + period`, … that comes after `now`, or has passed for less than `grace`.
fn on_grid(next: MonotonicNs, period: Duration, now: MonotonicNs, grace: Duration) -> MonotonicNs {
    let late = (now + Duration::from_nanos(1)).since(next + grace);
    let left_out = late.as_nanos().div_ceil(period.as_nanos().max(1));
    let left_out = u32::try_from(left_out).unwrap_or(u32::MAX);
    next + period.saturating_mul(left_out)
}

/// When which message goes to a station that was heard.
#[derive(Clone, Debug)]
pub struct Streams {
    beats: [Beat; StreamId::ALL.len()],
    /// The moment of the newest sample, and how long after the one before it was measured.
    sample: MonotonicNs,
    interval: Duration,
    /// Until when everything that is due has been looked at.
    looked: MonotonicNs,
}

impl Streams {
    /// All with their default periods, due now.
    pub fn new(now: MonotonicNs) -> Streams {
        Streams {
            beats: StreamId::ALL.map(|stream| Beat {
                period: stream.default_period(),
                due: now,
                sent: MonotonicNs(0),
            }),
            sample: MonotonicNs(0),
            interval: Duration::ZERO,
            looked: MonotonicNs(0),
        }
    }

    /// The heartbeat alone, for an address at which no station was heard.
    pub fn heartbeat_alone() -> Streams {
        let mut streams = Streams::new(MonotonicNs(0));
        for beat in &mut streams.beats[1..] {
            beat.period = None;
        }
        streams
    }

    /// The messages that are due and have something to say, of a sample that was measured at `sample`. They count as
    /// sent.
    pub fn take_due(&mut self, sample: MonotonicNs, now: MonotonicNs) -> Vec<StreamId> {
        self.looked = now;
        let has_come = sample > self.sample;
        if has_come {
            if self.sample > MonotonicNs(0) {
                self.interval = sample.since(self.sample);
            }
            self.sample = sample;
        }
        let interval = self.interval;
        let mut due = Vec::new();
        for (stream, beat) in StreamId::ALL.into_iter().zip(&mut self.beats) {
            let Some(period) = beat.period else {
                continue;
            };
            let next = match stream.content() {
                StreamContent::State if beat.due <= now => beat.due + period,
                StreamContent::Sample if sample > beat.sent => {
                    let is_nearest = has_come && beat.due <= now + interval.min(period) / 2;
                    if !is_nearest && now < beat.due + interval {
                        continue;
                    }
                    beat.sent = sample;
                    beat.next_after_sample(period, now)
                }
                _ => continue,
            };
            let grace = match stream.content() {
                StreamContent::State => Duration::ZERO,
                StreamContent::Sample => interval.min(period),
            };
            beat.due = on_grid(next, period, now, grace);
            due.push(stream);
        }
        due
    }

    /// When the next one is due although no sample comes. Those that wait for a sample are looked at when one comes.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let beats = StreamId::ALL.into_iter().zip(&self.beats);
        beats
            .filter(|(_, beat)| beat.period.is_some())
            .filter_map(|(stream, beat)| match stream.content() {
                StreamContent::State => Some(beat.due),
                StreamContent::Sample if self.sample > beat.sent => Some(beat.due + self.interval),
                StreamContent::Sample => None,
            })
            .filter(|due| *due > self.looked)
            .min()
    }

    /// Sends `stream` next, whenever it was due.
    pub fn hurry(&mut self, stream: StreamId, now: MonotonicNs) {
        self.beats[stream as usize].due = now;
    }

    /// Sets how often `stream` is sent.
    pub fn set_period(&mut self, stream: StreamId, period: Option<Duration>, now: MonotonicNs) {
        let beat = &mut self.beats[stream as usize];
        (beat.period, beat.due) = (period, now);
    }

    /// How often `stream` is sent.
    pub fn period(&self, stream: StreamId) -> Option<Duration> {
        self.beats[stream as usize].period
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn numbers_are_places() {
        for (index, stream) in StreamId::ALL.into_iter().enumerate() {
            assert_eq!(stream as usize, index);
            assert_eq!(StreamId::of(stream.kind().id), Some(stream));
        }
    }

    /// How often each is sent in ten seconds, of samples that come every `sample_ms`.
    fn sent(sample_ms: u64) -> Vec<usize> {
        let mut streams = Streams::new(MonotonicNs(0));
        let mut counts = vec![0; StreamId::ALL.len()];
        for ms in 0..10_000 {
            let now = MonotonicNs(ms * MS);
            let sample = MonotonicNs((1 + ms / sample_ms * sample_ms) * MS);
            for stream in streams.take_due(sample, now) {
                counts[stream as usize] += 1;
            }
            assert!(streams.deadline() > Some(now));
        }
        counts
    }

    #[test]
    fn rates_are_those_of_the_table_and_no_sample_goes_twice() {
        let expected = [10, 5, 10, 10, 50, 100, 0, 20, 40, 20, 20, 5, 5, 2, 10];
        assert_eq!(sent(20), expected);
        // One sample a second: what is made of samples comes once a second.
        let rare = expected.map(|count: usize| count.min(10));
        assert_eq!(sent(1_000), rare);
    }

    /// Of 200 samples every 20 ms, up to 4 ms early or late, the first `phase_ms` after the station: how old each was
    /// when ATTITUDE was made of it, ms. The station wants one every `period_ms`.
    fn ages(phase_ms: u64, period_ms: u64) -> Vec<u64> {
        let mut streams = Streams::new(MonotonicNs(0));
        let period = Duration::from_millis(period_ms);
        streams.set_period(StreamId::Attitude, Some(period), MonotonicNs(0));
        let jitters = [0, 4, 1, 3, 2, 0, 0, 4, 4];
        let mut ages = Vec::new();
        let mut sample_ms = 0;
        for ms in 100..4_100 {
            let number = (ms - 100) / 20;
            let comes_ms = 100 + number * 20 + phase_ms + jitters[number as usize % jitters.len()];
            if ms == comes_ms {
                sample_ms = ms;
            }
            let now = MonotonicNs(ms * MS);
            let due = streams.take_due(MonotonicNs(sample_ms * MS), now);
            if due.contains(&StreamId::Attitude) {
                ages.push(ms - sample_ms);
            }
        }
        ages
    }

    #[test]
    fn a_message_is_sent_when_the_sample_comes_that_is_nearest_to_its_moment() {
        for phase_ms in 0..16 {
            // Each one, but for the first few.
            let each = ages(phase_ms, 20);
            assert!(each.iter().all(|age| *age == 0), "{phase_ms}: {each:?}");
            assert!(each.len() >= 197, "{phase_ms}: {}", each.len());
            let fifth = ages(phase_ms, 100);
            assert!(fifth.iter().all(|age| *age == 0), "{phase_ms}: {fifth:?}");
            assert!((39..=41).contains(&fifth.len()), "{}", fifth.len());
        }
    }

    /// Which samples, by their moments in ms, go into ATTITUDE each `period_ms`.
    fn taken(period_ms: u64, samples: &[u64]) -> Vec<u64> {
        let mut streams = Streams::new(MonotonicNs(0));
        let period = Duration::from_millis(period_ms);
        streams.set_period(StreamId::Attitude, Some(period), MonotonicNs(0));
        let is_due = |ms: &u64| {
            let now = MonotonicNs(ms * MS);
            streams.take_due(now, now).contains(&StreamId::Attitude)
        };
        samples.iter().copied().filter(is_due).collect()
    }

    #[test]
    fn a_late_sample_does_not_skip_the_one_after_it() {
        // That of 140 comes late by so much; the one after it, when it has its time.
        for late_ms in 0..=60 {
            let late = 140 + late_ms;
            let after = (8..20).map(|number| number * 20).filter(|ms| *ms > late);
            let mut samples: Vec<u64> = (1..=6).map(|number| number * 20).collect();
            samples.push(late);
            samples.extend(after);
            assert_eq!(taken(20, &samples), samples, "{late_ms} ms late");
        }
        // Of one in ten with a stall each second: the rate stays what was asked.
        let mut samples: Vec<u64> = (1..=2_000).map(|number| number * 20).collect();
        samples.retain(|ms| ms % 1_000 < 600 || ms % 1_000 > 740);
        let count = taken(200, &samples).len();
        assert!((199..=201).contains(&count), "{count}");
    }

    #[test]
    fn the_last_sample_of_telemetry_that_ends_is_sent() {
        let mut streams = Streams::new(MonotonicNs(0));
        for ms in [1, 21, 41] {
            let now = MonotonicNs(ms * MS);
            let _ = streams.take_due(now, now);
        }
        let sample = MonotonicNs(41 * MS);
        let sent = (42..1_000).find(|ms| {
            let due = streams.take_due(sample, MonotonicNs(ms * MS));
            due.contains(&StreamId::Attitude)
        });
        // It was due at 101, and another sample could have come until 121.
        assert_eq!(sent, Some(121));
    }

    #[test]
    fn a_stall_is_not_made_up_for_and_an_interval_is_what_was_asked() {
        let mut streams = Streams::new(MonotonicNs(0));
        let _ = streams.take_due(MonotonicNs(1), MonotonicNs(0));
        let late = MonotonicNs(60_000 * MS);
        assert_eq!(streams.take_due(late, late).len(), 14);
        assert_eq!(streams.take_due(late, late), []);

        for (interval_us, expected) in [
            (-1.0, Ok(None)),
            (0.0, Ok(Some(Duration::from_millis(100)))),
            (20_000.0, Ok(Some(Duration::from_millis(20)))),
            (19_999.0, Err(MavResult::Denied)),
            (f64::NAN, Err(MavResult::Denied)),
            (-2.0, Err(MavResult::Denied)),
            (f64::INFINITY, Err(MavResult::Denied)),
        ] {
            assert_eq!(
                StreamId::Attitude.period(interval_us),
                expected,
                "{interval_us}"
            );
        }
        for interval_us in [-1.0, 2e6] {
            assert_eq!(
                StreamId::Heartbeat.period(interval_us),
                Err(MavResult::Denied)
            );
        }
    }
}
