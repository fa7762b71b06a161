//! What a script did, in figures.

use std::fmt;

use super::script::{DspEvent, Happening, HelicopterEvent};

/// Defines counters, each with its name in the summary: `counter = "name";`.
macro_rules! counters {
    ($(#[$meta:meta])* $name:ident $(beside { $($(#[$other_doc:meta])* $other:ident: $type:ty,)+ })? {
        $($(#[$doc:meta])* $counter:ident = $text:literal;)+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $name {
            $($($(#[$other_doc])* pub $other: $type,)+)?
            $($(#[$doc])* pub $counter: u64,)+
        }

        impl $name {
            /// The counters with their names, in the order of the summary.
            fn named(&self) -> impl Iterator<Item = (u64, &'static str)> {
                [$((self.$counter, $text)),+].into_iter()
            }
        }
    };
}

/// What was done to one direction of the serial link.
///
/// No byte is lost uncounted: [`gained`](Self::gained) equals [`lost`](Self::lost), those that `left`, and those that
/// still wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DirectionCounters {
    /// Bytes that the faults were given.
    pub entered: u64,
    /// Bytes that came out of them.
    pub left: u64,
    /// To single bytes.
    pub bytes: ByteCounters,
    /// To whole messages.
    pub messages: MessageCounters,
}

impl DirectionCounters {
    /// Bytes that were there to be delivered: those that entered and those that faults added.
    pub fn gained(&self) -> u64 {
        self.entered + self.bytes.duplicated + self.bytes.inserted + self.messages.repeated_bytes
    }

    /// Bytes that faults took away.
    pub fn lost(&self) -> u64 {
        let bytes = &self.bytes;
        bytes.dropped
            + bytes.stall_dropped
            + bytes.outage_dropped
            + bytes.overflowed
            + self.messages.dropped_bytes
    }

    /// All counters with their names, in the order of the summary.
    fn named(&self) -> impl Iterator<Item = (u64, &'static str)> {
        [(self.entered, "bytes in"), (self.left, "bytes out")]
            .into_iter()
            .chain(self.bytes.named())
            .chain(self.messages.named())
    }
}

counters! {
    /// What was done to single bytes.
    ByteCounters {
        /// Bits that were turned over.
        flipped_bits = "bits flipped";
        /// Bytes that were lost one by one.
        dropped = "bytes dropped";
        /// Bytes that came twice.
        duplicated = "bytes duplicated";
        /// Random bytes that were put in.
        inserted = "bytes inserted";
        /// Bytes that came late because of a delay.
        delayed = "bytes delayed";
        /// Pieces that began after a pause.
        pieces = "pieces";
        /// Bursts that began.
        bursts = "bursts";
        /// Bytes that bursts replaced.
        burst_bytes = "bytes in bursts";
        /// Bytes that a stall held up and then let pass.
        stalled = "bytes stalled";
        /// Bytes that a stall held up and then lost.
        stall_dropped = "bytes dropped by stalls";
        /// Bytes that were lost in an outage.
        outage_dropped = "bytes dropped by outages";
        /// Bytes that found the queue of delayed ones full.
        overflowed = "bytes dropped by a full queue";
    }
}

counters! {
    /// What was done to whole messages.
    MessageCounters {
        /// Messages that were dropped.
        dropped = "messages dropped";
        /// Their bytes.
        dropped_bytes = "bytes dropped";
        /// Messages that came twice.
        repeated = "messages repeated";
        /// The bytes of their copies.
        repeated_bytes = "bytes repeated";
        /// Messages that came late, or will.
        late = "messages late";
        /// Messages that come after the next of their kind.
        reordered = "messages reordered";
    }
}

counters! {
    /// What a script did.
    FaultCounters beside {
        /// To what the DSP sends.
        to_pc: DirectionCounters,
        /// To what the PC sends.
        to_dsp: DirectionCounters,
    } {
        /// Errors that were raised.
        errors_raised = "errors raised";
        /// Reboots.
        reboots = "reboots";
        /// How often the status transmission was stopped.
        status_stops = "status stops";
        /// How often the DSP hung.
        hangs = "hangs";
        /// Bytes from the PC that arrived while the DSP hung.
        missed_bytes = "bytes missed by a DSP that hung";
        /// How often the DSP's clock jumped.
        clock_jumps = "clock jumps";
        /// How often the status mask changed on the DSP.
        mask_changes = "mask changes";
        /// How often the pilot took over.
        pilot_takeovers = "pilot takeovers";
        /// How often the battery fell to a voltage of the script.
        battery_drops = "battery drops";
        /// How often the fuel fell to an amount of the script.
        fuel_drops = "fuel drops";
        /// How often the altitude of the GPS began to drift.
        gps_drifts = "GPS altitude drifts";
        /// How often the GPS lost its fix.
        gps_fix_losses = "GPS fix losses";
        /// How often the port was hung up.
        hang_ups = "port hang-ups";
        /// Bytes to the PC that found the port gone.
        unplugged_bytes = "bytes to a port that was gone";
    }
}

impl FaultCounters {
    /// Counts something that happens beyond the serial link and the port.
    pub(super) fn count(&mut self, happening: Happening) {
        let counter = match happening {
            Happening::Dsp(event) => match event {
                DspEvent::RaiseError(_) => &mut self.errors_raised,
                DspEvent::Reboot => &mut self.reboots,
                DspEvent::StopStatus => &mut self.status_stops,
                DspEvent::Hang(_) => &mut self.hangs,
                DspEvent::ClockJump(_) => &mut self.clock_jumps,
                DspEvent::ChangeMask(_) => &mut self.mask_changes,
            },
            Happening::Helicopter(event) => match event {
                HelicopterEvent::PilotTakesOver(_) => &mut self.pilot_takeovers,
                HelicopterEvent::BatteryLow { .. } => &mut self.battery_drops,
                HelicopterEvent::FuelLow { .. } => &mut self.fuel_drops,
                HelicopterEvent::GpsAltitudeDrift { .. } => &mut self.gps_drifts,
                HelicopterEvent::LoseFix(_) => &mut self.gps_fix_losses,
            },
        };
        *counter += 1;
    }
}

impl fmt::Display for FaultCounters {
    /// The counters that are not zero.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = [
            summary("to the PC", self.to_pc.named()),
            summary("to the DSP", self.to_dsp.named()),
            summary("events", self.named()),
        ]
        .into_iter()
        .flatten()
        .collect();
        if parts.is_empty() {
            return f.write_str("nothing");
        }
        f.write_str(&parts.join("; "))
    }
}

/// The counters that are not zero; `None` if all are.
fn summary(what: &str, counters: impl IntoIterator<Item = (u64, &'static str)>) -> Option<String> {
    let counters: Vec<String> = counters
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, name)| format!("{count} {name}"))
        .collect();
    (!counters.is_empty()).then(|| format!("{what}: {}", counters.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_says_what_was_done_and_nothing_else() {
        assert_eq!(FaultCounters::default().to_string(), "nothing");
        let mut counters = FaultCounters {
            reboots: 2,
            hang_ups: 1,
            ..FaultCounters::default()
        };
        assert_eq!(counters.to_string(), "events: 2 reboots, 1 port hang-ups");
        counters.to_dsp.entered = 7;
        counters.to_pc.entered = 9;
        counters.to_pc.messages.late = 3;
        counters.to_pc.bytes.dropped = 1;
        assert_eq!(
            counters.to_string(),
            "to the PC: 9 bytes in, 1 bytes dropped, 3 messages late; to the DSP: 7 bytes in; events: 2 reboots, 1 port hang-ups"
        );
    }
}
