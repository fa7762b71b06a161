//! A script as a TOML file: `seed` and an array of `[[fault]]` tables. The annotated example `dsp-sim/faults.toml`
//! shows every kind.
//!
//! A table is read with all keys that any kind has, each within its range; then the kind takes its own, and a key
//! that is left over or missing refuses the table.

use std::time::Duration;

use dsp_protocol::{DspErrorCode, StatusMask};
use runtime::config::Deserializer;
use serde::Deserialize;
use serde::de::Error as _;

use super::script::{
    Act, AfterStall, Damage, Directions, DspEvent, Fault, HelicopterEvent, MessageKind, Script,
    Times, Window,
};

/// Faults that a file may hold: each byte is checked against each of them, and no person writes more by hand.
pub const MAX_FAULTS: usize = 256;

/// Defines [`FaultKind`]; each row is `Kind = "name in a file";`.
macro_rules! kinds {
    ($( $(#[$doc:meta])* $kind:ident = $name:literal; )+) => {
        /// The values of `kind` in a `[[fault]]` table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
        pub enum FaultKind {
            $( $(#[$doc])* #[serde(rename = $name)] $kind, )+
        }

        impl FaultKind {
            /// All kinds.
            pub const ALL: &[FaultKind] = &[$(FaultKind::$kind),+];

            /// The name in a file.
            pub const fn name(self) -> &'static str {
                match self {
                    $( FaultKind::$kind => $name, )+
                }
            }
        }
    };
}

kinds! {
    /// Bits turn over.
    FlipBits = "flip_bits";
    /// Bytes are lost.
    DropBytes = "drop_bytes";
    /// Bytes come twice.
    DuplicateBytes = "duplicate_bytes";
    /// Random bytes are put in.
    InsertBytes = "insert_bytes";
    /// Bytes come late.
    DelayBytes = "delay_bytes";
    /// Bytes come in pieces.
    SplitBytes = "split_bytes";
    /// Runs of bytes are replaced by random ones.
    Burst = "burst";
    /// Nothing comes out of the serial link for a time.
    Stall = "stall";
    /// Everything is lost.
    Outage = "outage";
    /// Messages are lost.
    Drop = "drop";
    /// Messages come twice.
    Repeat = "repeat";
    /// Messages come late.
    Late = "late";
    /// Messages change places.
    Reorder = "reorder";
    /// The DSP queues an error.
    RaiseError = "raise_error";
    /// The DSP boots again.
    Reboot = "reboot";
    /// The DSP stops its status transmission.
    StopStatus = "stop_status";
    /// The DSP hangs for a time.
    Hang = "hang";
    /// The DSP's clock jumps.
    ClockJump = "clock_jump";
    /// The status mask changes on the DSP.
    ChangeMask = "change_mask";
    /// The pilot flies for a time.
    PilotTakesOver = "pilot_takes_over";
    /// The battery is low.
    BatteryLow = "battery_low";
    /// The fuel is low.
    FuelLow = "fuel_low";
    /// The altitude of the GPS drifts.
    GpsAltitudeDrift = "gps_altitude_drift";
    /// The GPS has no fix for a time.
    LoseFix = "lose_fix";
    /// The port goes and comes back.
    HangUp = "hang_up";
}

impl<'de> Deserialize<'de> for Script {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Script, D::Error> {
        let File { seed, faults } = File::deserialize(deserializer)?;
        Ok(Script { seed, faults })
    }
}

/// The whole file.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct File {
    #[serde(deserialize_with = "seed")]
    seed: u64,
    #[serde(rename = "fault", deserialize_with = "faults")]
    faults: Vec<Fault>,
}

impl Default for File {
    fn default() -> File {
        let Script { seed, faults } = Script::default();
        File { seed, faults }
    }
}

/// Defines [`FaultTable`]; each row is a key that some kind has, and its type.
macro_rules! keys {
    ($($(#[$attribute:meta])* $key:ident: $type:ty;)+) => {
        /// One `[[fault]]` table with the keys of all kinds.
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct FaultTable {
            kind: FaultKind,
            $($(#[$attribute])* $key: Option<$type>,)+
        }

        impl FaultTable {
            /// A key that the kind did not take.
            fn left_over(&self) -> Option<&'static str> {
                let keys = [$((self.$key.is_some(), stringify!($key))),+];
                keys.into_iter().find_map(|(is_left, key)| is_left.then_some(key))
            }
        }
    };
}

keys! {
    direction: Directions;
    message: MessageKind;
    #[serde(default, deserialize_with = "moment")]
    from_s: Duration;
    #[serde(default, deserialize_with = "moment")]
    until_s: Duration;
    #[serde(default, deserialize_with = "moment")]
    at_s: Duration;
    #[serde(default, deserialize_with = "span")]
    every_s: Duration;
    #[serde(default, deserialize_with = "span")]
    for_s: Duration;
    #[serde(default, deserialize_with = "probability")]
    rate: f64;
    #[serde(default, deserialize_with = "probability")]
    bit_error_rate: f64;
    #[serde(default, deserialize_with = "length_bytes")]
    length_bytes: u32;
    #[serde(default, deserialize_with = "chunk_bytes")]
    chunk_bytes: usize;
    #[serde(default, deserialize_with = "delay")]
    delay_ms: Duration;
    #[serde(default, deserialize_with = "delay")]
    jitter_ms: Duration;
    #[serde(default, deserialize_with = "gap")]
    gap_ms: Duration;
    then: AfterStall;
    code: u16;
    #[serde(default, deserialize_with = "jump_ms")]
    jump_ms: i64;
    elsewhere: bool;
    mask: u16;
    #[serde(default, deserialize_with = "volts")]
    volts: f64;
    #[serde(default, deserialize_with = "percent")]
    percent: f64;
    #[serde(default, deserialize_with = "drift_mps")]
    drift_mps: f64;
}

/// What is wrong with a table as a whole.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
enum TableError {
    #[error("a fault of kind `{kind}` needs `{key}`")]
    Missing {
        kind: &'static str,
        key: &'static str,
    },
    #[error("a fault of kind `{kind}` has no `{key}`; leave it out")]
    LeftOver {
        kind: &'static str,
        key: &'static str,
    },
    #[error("`until_s` must be later than `from_s`")]
    Backwards,
    #[error("`every_s` must be longer than the fault lasts")]
    TooOften,
    #[error("`every_s` needs `until_s`: what lasts for ever does not come again")]
    ForEver,
}

impl<'de> Deserialize<'de> for Fault {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Fault, D::Error> {
        let mut table = FaultTable::deserialize(deserializer)?;
        let fault = table.fault().map_err(D::Error::custom)?;
        match table.left_over() {
            Some(key) => Err(D::Error::custom(TableError::LeftOver {
                kind: table.kind.name(),
                key,
            })),
            None => Ok(fault),
        }
    }
}

impl FaultTable {
    /// Takes out the keys of this kind.
    fn fault(&mut self) -> Result<Fault, TableError> {
        match self.kind {
            FaultKind::FlipBits => {
                let bit_error_rate =
                    self.need(|table| &mut table.bit_error_rate, "bit_error_rate")?;
                self.bytes(Damage::FlipBits { bit_error_rate })
            }
            FaultKind::DropBytes => {
                let rate = self.rate()?;
                self.bytes(Damage::Drop { rate })
            }
            FaultKind::DuplicateBytes => {
                let rate = self.rate()?;
                self.bytes(Damage::Duplicate { rate })
            }
            FaultKind::InsertBytes => {
                let rate = self.rate()?;
                self.bytes(Damage::Insert { rate })
            }
            FaultKind::DelayBytes => {
                let delay = self.delay()?;
                let jitter = self.jitter_ms.take().unwrap_or_default();
                self.bytes(Damage::Delay { delay, jitter })
            }
            FaultKind::SplitBytes => {
                let chunk_bytes = self.need(|table| &mut table.chunk_bytes, "chunk_bytes")?;
                let gap = self.need(|table| &mut table.gap_ms, "gap_ms")?;
                self.bytes(Damage::Split { chunk_bytes, gap })
            }
            FaultKind::Burst => {
                let rate = self.rate()?;
                let length_bytes = self.need(|table| &mut table.length_bytes, "length_bytes")?;
                self.bytes(Damage::Burst { rate, length_bytes })
            }
            FaultKind::Stall if self.until_s.is_none() => Err(self.missing("until_s")),
            FaultKind::Stall => {
                let then = self.then.take().unwrap_or_default();
                self.bytes(Damage::Stall { then })
            }
            FaultKind::Outage => self.bytes(Damage::Outage),
            FaultKind::Drop => self.messages(Act::Drop),
            FaultKind::Repeat => self.messages(Act::Repeat),
            FaultKind::Reorder => self.messages(Act::Reorder),
            FaultKind::Late => {
                let delay = self.delay()?;
                self.messages(Act::Late(delay))
            }
            FaultKind::RaiseError => {
                let code = self.need(|table| &mut table.code, "code")?;
                self.dsp(DspEvent::RaiseError(DspErrorCode(code)))
            }
            FaultKind::Reboot => self.dsp(DspEvent::Reboot),
            FaultKind::StopStatus => self.dsp(DspEvent::StopStatus),
            FaultKind::Hang => {
                let length = self.length()?;
                self.dsp(DspEvent::Hang(length))
            }
            FaultKind::ClockJump => {
                let jump_ms = self.need(|table| &mut table.jump_ms, "jump_ms")?;
                self.dsp(DspEvent::ClockJump(jump_ms))
            }
            FaultKind::ChangeMask => {
                let mask = self.need(|table| &mut table.mask, "mask")?;
                self.dsp(DspEvent::ChangeMask(StatusMask(mask)))
            }
            FaultKind::PilotTakesOver => {
                let length = self.length()?;
                self.helicopter(HelicopterEvent::PilotTakesOver(length))
            }
            FaultKind::BatteryLow => {
                let volts = self.need(|table| &mut table.volts, "volts")?;
                self.helicopter(HelicopterEvent::BatteryLow { volts })
            }
            FaultKind::FuelLow => {
                let percent = self.need(|table| &mut table.percent, "percent")?;
                self.helicopter(HelicopterEvent::FuelLow { percent })
            }
            FaultKind::GpsAltitudeDrift => {
                let rate_mps = self.need(|table| &mut table.drift_mps, "drift_mps")?;
                let length = self.length()?;
                self.helicopter(HelicopterEvent::GpsAltitudeDrift { rate_mps, length })
            }
            FaultKind::LoseFix => {
                let length = self.length()?;
                self.helicopter(HelicopterEvent::LoseFix(length))
            }
            FaultKind::HangUp => Ok(Fault::HangUp {
                times: self.times()?,
                length: self.length()?,
                elsewhere: self.elsewhere.take().unwrap_or(false),
            }),
        }
    }

    /// A fault of bytes; without a direction it meets both.
    fn bytes(&mut self, damage: Damage) -> Result<Fault, TableError> {
        Ok(Fault::Bytes {
            direction: self.direction.take().unwrap_or_default(),
            window: self.window()?,
            damage,
        })
    }

    /// A fault of messages; without a rate it meets all of them.
    fn messages(&mut self, act: Act) -> Result<Fault, TableError> {
        Ok(Fault::Messages {
            message: self.need(|table| &mut table.message, "message")?,
            window: self.window()?,
            rate: self.rate.take().unwrap_or(1.0),
            act,
        })
    }

    fn dsp(&mut self, event: DspEvent) -> Result<Fault, TableError> {
        Ok(Fault::Dsp {
            times: self.times()?,
            event,
        })
    }

    fn helicopter(&mut self, event: HelicopterEvent) -> Result<Fault, TableError> {
        Ok(Fault::Helicopter {
            times: self.times()?,
            event,
        })
    }

    fn window(&mut self) -> Result<Window, TableError> {
        let from = self.from_s.take().unwrap_or_default();
        let until = self.until_s.take();
        match (until, self.every_s.take()) {
            (None, None) => Ok(Window::since(from)),
            (None, Some(_)) => Err(TableError::ForEver),
            (Some(until), _) if until <= from => Err(TableError::Backwards),
            (Some(until), None) => Ok(Window::between(from, until)),
            (Some(until), Some(every)) if every <= until - from => Err(TableError::TooOften),
            (Some(until), Some(every)) => Ok(Window::between(from, until).every(every)),
        }
    }

    fn times(&mut self) -> Result<Times, TableError> {
        let at = self.need(|table| &mut table.at_s, "at_s")?;
        let every = self.every_s.take();
        Ok(every.map_or(Times::once(at), |every| Times::every(at, every)))
    }

    fn rate(&mut self) -> Result<f64, TableError> {
        self.need(|table| &mut table.rate, "rate")
    }

    fn delay(&mut self) -> Result<Duration, TableError> {
        self.need(|table| &mut table.delay_ms, "delay_ms")
    }

    fn length(&mut self) -> Result<Duration, TableError> {
        self.need(|table| &mut table.for_s, "for_s")
    }

    /// Takes out a key that this kind cannot do without.
    fn need<T>(
        &mut self,
        place: impl FnOnce(&mut FaultTable) -> &mut Option<T>,
        key: &'static str,
    ) -> Result<T, TableError> {
        place(self).take().ok_or_else(|| self.missing(key))
    }

    fn missing(&self, key: &'static str) -> TableError {
        TableError::Missing {
            kind: self.kind.name(),
            key,
        }
    }
}

runtime::ranged! {
    // TOML has no unsigned integers.
    fn seed(u64) in 0..=i64::MAX.cast_unsigned();
}

/// Defines functions for `#[serde(deserialize_with)]` that read a bounded number of an optional key and make `$into` of
/// it.
macro_rules! optional {
    ($( fn $name:ident($number:ty => $into:ty) in $range:expr, $make:expr; )+) => {
        $(
            fn $name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<$into>, D::Error> {
                runtime::config::in_range::<$number, D>(deserializer, $range).map($make).map(Some)
            }
        )+
    };
}

optional! {
    // Eleven days: longer than anybody watches.
    fn moment(f64 => Duration) in 0.0..=1_000_000.0, Duration::from_secs_f64;
    fn span(f64 => Duration) in 0.001..=1_000_000.0, Duration::from_secs_f64;
    fn probability(f64 => f64) in 0.0..=1.0, |rate| rate;
    fn length_bytes(u32 => u32) in 1..=100_000, |bytes| bytes;
    fn chunk_bytes(usize => usize) in 1..=1_024, |bytes| bytes;
    // What the queue of delayed bytes holds of a serial link of 115200 baud.
    fn delay(f64 => Duration) in 0.0..=5_000.0, milliseconds;
    fn gap(f64 => Duration) in 0.01..=1_000.0, milliseconds;
    // A day to and fro.
    fn jump_ms(i64 => i64) in -86_400_000..=86_400_000, |milliseconds| milliseconds;
    fn volts(f64 => f64) in 0.0..=60.0, |volts| volts;
    fn percent(f64 => f64) in 0.0..=100.0, |percent| percent;
    fn drift_mps(f64 => f64) in -100.0..=100.0, |drift| drift;
}

fn milliseconds(count: f64) -> Duration {
    Duration::from_secs_f64(count / 1_000.0)
}

fn faults<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Fault>, D::Error> {
    let faults = Vec::<Fault>::deserialize(deserializer)?;
    if faults.len() > MAX_FAULTS {
        return Err(D::Error::custom(format_args!(
            "a script has at most {MAX_FAULTS} faults, not {}",
            faults.len()
        )));
    }
    Ok(faults)
}

#[cfg(test)]
mod tests;
