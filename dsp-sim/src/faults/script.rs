//! What goes wrong, where and when: the values that a script of faults consists of.
//!
//! All times are simulated, since the start of the simulator. A script is built in code, or read from a file
//! (`faults::table`); it does nothing by itself.

use std::time::Duration;

use dsp_protocol::{DspErrorCode, StatusMask};
use serde::Deserialize;

/// Shortest period of what repeats: without a bound, time would stand still at a period of zero.
pub const MIN_PERIOD: Duration = Duration::from_millis(1);

/// A seeded, timed script of faults.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    /// Seed of everything that is left to chance. Each fault draws from a stream of its own, chosen by its place: a
    /// fault that is appended changes nothing of those before it.
    pub seed: u64,
    /// The faults. Those of one kind that are active together all apply, one after the other in this order.
    pub faults: Vec<Fault>,
}

impl Default for Script {
    /// No faults.
    fn default() -> Self {
        Script {
            seed: 1,
            faults: Vec::new(),
        }
    }
}

/// One fault of a script.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The serial link damages bytes.
    Bytes {
        /// Of which direction.
        direction: Directions,
        /// When.
        window: Window,
        /// How.
        damage: Damage,
    },
    /// Whole messages are lost, repeated or moved.
    Messages {
        /// Which ones.
        message: MessageKind,
        /// When.
        window: Window,
        /// Which share of them, 0 … 1.
        rate: f64,
        /// What becomes of them.
        act: Act,
    },
    /// Something happens inside the DSP.
    Dsp {
        /// When.
        times: Times,
        /// What.
        event: DspEvent,
    },
    /// Something happens to the helicopter.
    Helicopter {
        /// When.
        times: Times,
        /// What.
        event: HelicopterEvent,
    },
    /// The serial port of the PC is hung up and comes back.
    HangUp {
        /// When.
        times: Times,
        /// How long the port is gone.
        length: Duration,
        /// Whether it comes back as another device, as a plug in another socket does: the link leads elsewhere then.
        elsewhere: bool,
    },
}

/// One direction of the serial link, or both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Directions {
    /// From the DSP to the PC.
    ToPc,
    /// From the PC to the DSP.
    ToDsp,
    /// Both, each with random numbers of its own.
    #[default]
    Both,
}

impl Directions {
    /// Whether `direction` is meant.
    pub fn contain(self, direction: Direction) -> bool {
        match self {
            Directions::ToPc => direction == Direction::ToPc,
            Directions::ToDsp => direction == Direction::ToDsp,
            Directions::Both => true,
        }
    }
}

/// One direction of the serial link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the DSP to the PC.
    ToPc,
    /// From the PC to the DSP.
    ToDsp,
}

/// What happens to bytes. A rate is the probability for each byte, 0 … 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damage {
    /// Each bit is turned over with this probability.
    FlipBits {
        /// For each bit, 0 … 1.
        bit_error_rate: f64,
    },
    /// Bytes are lost.
    Drop {
        /// For each byte.
        rate: f64,
    },
    /// Bytes come twice.
    Duplicate {
        /// For each byte.
        rate: f64,
    },
    /// Random bytes come before others.
    Insert {
        /// For each byte.
        rate: f64,
    },
    /// Bytes come late, in their order: each by `delay` and a random part of `jitter`.
    Delay {
        /// What every byte takes longer.
        delay: Duration,
        /// What it takes longer at the most beyond that; all values are equally likely.
        jitter: Duration,
    },
    /// Bytes come in pieces with a pause before each. The serial link then carries no more than `chunk_bytes` each
    /// `gap`.
    Split {
        /// The longest piece; all lengths from 1 on are equally likely.
        chunk_bytes: usize,
        /// The pause.
        gap: Duration,
    },
    /// A run of bytes is replaced by random ones.
    Burst {
        /// Probability that a run begins, for each byte outside a run.
        rate: f64,
        /// How long it is.
        length_bytes: u32,
    },
    /// Nothing comes out of the serial link.
    Stall {
        /// What becomes of the bytes that should have.
        then: AfterStall,
    },
    /// Everything that is put on the serial link is lost.
    Outage,
}

/// What becomes of the bytes that a stall held up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AfterStall {
    /// They come all at once at the end of the stall.
    #[default]
    Pass,
    /// They are lost.
    Drop,
}

/// Which messages a fault is about; each goes one way only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MessageKind {
    /// Acknowledgements of all three kinds.
    Ack,
    /// Flow control.
    FlowControl,
    /// Status.
    Status,
    /// Errors.
    Error,
    /// Commands.
    Command,
    /// Waypoints.
    Waypoint,
}

impl MessageKind {
    /// The way that they go.
    pub fn direction(self) -> Direction {
        match self {
            MessageKind::Ack
            | MessageKind::FlowControl
            | MessageKind::Status
            | MessageKind::Error => Direction::ToPc,
            MessageKind::Command | MessageKind::Waypoint => Direction::ToDsp,
        }
    }
}

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// It is lost.
    Drop,
    /// It comes twice.
    Repeat,
    /// It comes this much later, and others overtake it.
    Late(Duration),
    /// It comes right after the next of its kind.
    Reorder,
}

/// What a script lets happen beyond the serial link and the port.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Happening {
    /// Inside the DSP.
    Dsp(DspEvent),
    /// To the helicopter.
    Helicopter(HelicopterEvent),
}

/// What happens inside the DSP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DspEvent {
    /// It queues an error.
    RaiseError(DspErrorCode),
    /// It boots again.
    Reboot,
    /// It sends no status until the PC activates it.
    StopStatus,
    /// It neither receives nor sends for this time, and then goes on as if nothing had happened. The helicopter flies
    /// on.
    Hang(Duration),
    /// Its clock, as a status carries it, jumps by so many milliseconds, but not below zero.
    ClockJump(i64),
    /// Its status mask becomes this one, and nothing else changes.
    ChangeMask(StatusMask),
}

/// What happens to the helicopter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HelicopterEvent {
    /// The pilot's switch stands on manual for this time.
    PilotTakesOver(Duration),
    /// The battery falls to a voltage.
    BatteryLow {
        /// At rest, V; in a hover it reads 0.4 V less.
        volts: f64,
    },
    /// The fuel falls to an amount.
    FuelLow {
        /// What is left of a full tank, %.
        percent: f64,
    },
    /// The altitude of the GPS drifts for a time; the error that it has reached then stays.
    GpsAltitudeDrift {
        /// By how much the altitude error grows, m/s.
        rate_mps: f64,
        /// For how long.
        length: Duration,
    },
    /// The GPS has no fix for this time.
    LoseFix(Duration),
}

/// A span of time, once or again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    from: Duration,
    until: Option<Duration>,
    every: Option<Duration>,
}

impl Window {
    /// From the start for ever.
    pub const ALWAYS: Window = Window {
        from: Duration::ZERO,
        until: None,
        every: None,
    };

    /// From `from` for ever.
    pub fn since(from: Duration) -> Window {
        Window {
            from,
            ..Window::ALWAYS
        }
    }

    /// From `from` to before `until`; never, when that is no later.
    pub fn between(from: Duration, until: Duration) -> Window {
        Window {
            from,
            until: Some(until),
            every: None,
        }
    }

    /// This span, repeated every `period`, counted from beginning to beginning and no shorter than [`MIN_PERIOD`].
    /// Nothing changes for a window without an end.
    #[must_use]
    pub fn every(self, period: Duration) -> Window {
        Window {
            every: Some(period.max(MIN_PERIOD)),
            ..self
        }
    }

    /// Whether `time` lies in it.
    pub fn contains(&self, time: Duration) -> bool {
        self.span_at(time).is_some()
    }

    /// The end of the span that `time` lies in; `None` if it lies in none, or that one has no end.
    pub fn end_at(&self, time: Duration) -> Option<Duration> {
        self.span_at(time)?
    }

    /// The end, if it has one, of the span that `time` lies in, if it lies in one.
    fn span_at(&self, time: Duration) -> Option<Option<Duration>> {
        let since_first = time.checked_sub(self.from)?;
        let Some(until) = self.until else {
            return Some(None);
        };
        let length = until.saturating_sub(self.from);
        let since_this = match self.every {
            Some(every) => {
                let rest_ns = since_first.as_nanos() % every.as_nanos();
                // Simulated time is far from 584 years.
                Duration::from_nanos(u64::try_from(rest_ns).unwrap_or(u64::MAX))
            }
            None => since_first,
        };
        (since_this < length).then(|| Some((time - since_this).saturating_add(length)))
    }
}

/// A moment, once or again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    at: Duration,
    every: Option<Duration>,
}

impl Times {
    /// Once.
    pub fn once(at: Duration) -> Times {
        Times { at, every: None }
    }

    /// At `at` and then every `period`, no shorter than [`MIN_PERIOD`].
    pub fn every(at: Duration, period: Duration) -> Times {
        Times {
            at,
            every: Some(period.max(MIN_PERIOD)),
        }
    }

    /// The first moment.
    pub fn first(&self) -> Duration {
        self.at
    }

    /// The moment after `moment`, which is one of them.
    pub fn after(&self, moment: Duration) -> Option<Duration> {
        moment.checked_add(self.every?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn a_window_has_its_beginning_and_not_its_end() {
        let once = Window::between(ms(10), ms(20));
        let repeated = once.every(ms(30));
        let touching = once.every(ms(10));
        let overlapping = once.every(ms(4));
        let empty = Window::between(ms(20), ms(20));
        let backwards = Window::between(ms(20), ms(10)).every(ms(1));
        let since = Window::since(ms(10));
        for (window, time_ms, expected) in [
            (once, 9, None),
            (once, 10, Some(20)),
            (once, 19, Some(20)),
            (once, 20, None),
            (repeated, 9, None),
            (repeated, 15, Some(20)),
            (repeated, 39, None),
            (repeated, 40, Some(50)),
            (repeated, 3_000_050, None),
            (repeated, 3_000_010, Some(3_000_020)),
            (touching, 20, Some(30)),
            (overlapping, 21, Some(28)),
            (empty, 20, None),
            (backwards, 20, None),
        ] {
            let end = window.end_at(ms(time_ms));
            assert_eq!(end, expected.map(ms), "{window:?} at {time_ms} ms");
            assert_eq!(window.contains(ms(time_ms)), expected.is_some());
        }
        assert!(!since.contains(ms(9)));
        assert!(since.contains(ms(10)) && since.contains(Duration::MAX));
        assert_eq!(since.end_at(Duration::MAX), None, "it has no end");
        assert!(Window::ALWAYS.contains(Duration::ZERO));
    }

    #[test]
    fn moments_repeat_and_never_stand_still() {
        assert_eq!(Times::once(ms(5)).first(), ms(5));
        assert_eq!(Times::once(ms(5)).after(ms(5)), None);
        assert_eq!(Times::every(ms(5), ms(7)).after(ms(5)), Some(ms(12)));
        let fastest = Times::every(ms(5), Duration::ZERO);
        assert_eq!(fastest.after(ms(5)), Some(ms(6)));
        assert_eq!(fastest.after(Duration::MAX), None);
    }
}
