//! What a script did, in figures.

use std::fmt;

use super::script::{DspEvent, Happening, HelicopterEvent};

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

/// What was done to single bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByteCounters {
    /// Bits that were turned over.
    pub flipped_bits: u64,
    /// Bytes that were lost one by one.
    pub dropped: u64,
    /// Bytes that came twice.
    pub duplicated: u64,
    /// Random bytes that were put in.
    pub inserted: u64,
    /// Bytes that came late because of a delay.
    pub delayed: u64,
    /// Pieces that began after a pause.
    pub pieces: u64,
    /// Bursts that began.
    pub bursts: u64,
    /// Bytes that bursts replaced.
    pub burst_bytes: u64,
    /// Bytes that a stall held up and then let pass.
    pub stalled: u64,
    /// Bytes that a stall held up and then lost.
    pub stall_dropped: u64,
    /// Bytes that were lost in an outage.
    pub outage_dropped: u64,
    /// Bytes that found the queue of delayed ones full.
    pub overflowed: u64,
}

impl ByteCounters {
    fn named(&self) -> [(u64, &'static str); 12] {
        // Without `..`: a new counter does not compile until it is in the summary.
        let ByteCounters {
            flipped_bits,
            dropped,
            duplicated,
            inserted,
            delayed,
            pieces,
            bursts,
            burst_bytes,
            stalled,
            stall_dropped,
            outage_dropped,
            overflowed,
        } = *self;
        [
            (flipped_bits, "bits flipped"),
            (dropped, "bytes dropped"),
            (duplicated, "bytes duplicated"),
            (inserted, "bytes inserted"),
            (delayed, "bytes delayed"),
            (pieces, "pieces"),
            (bursts, "bursts"),
            (burst_bytes, "bytes in bursts"),
            (stalled, "bytes stalled"),
            (stall_dropped, "bytes dropped by stalls"),
            (outage_dropped, "bytes dropped by outages"),
            (overflowed, "bytes dropped by a full queue"),
        ]
    }
}

/// What was done to whole messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MessageCounters {
    /// Messages that were dropped.
    pub dropped: u64,
    /// Their bytes.
    pub dropped_bytes: u64,
    /// Messages that came twice.
    pub repeated: u64,
    /// The bytes of their copies.
    pub repeated_bytes: u64,
    /// Messages that came late, or will.
    pub late: u64,
    /// Messages that come after the next of their kind.
    pub reordered: u64,
}

impl MessageCounters {
    fn named(&self) -> [(u64, &'static str); 6] {
        let MessageCounters {
            dropped,
            dropped_bytes,
            repeated,
            repeated_bytes,
            late,
            reordered,
        } = *self;
        [
            (dropped, "messages dropped"),
            (dropped_bytes, "bytes dropped"),
            (repeated, "messages repeated"),
            (repeated_bytes, "bytes repeated"),
            (late, "messages late"),
            (reordered, "messages reordered"),
        ]
    }
}

/// What a script did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounters {
    /// To what the DSP sends.
    pub to_pc: DirectionCounters,
    /// To what the PC sends.
    pub to_dsp: DirectionCounters,
    /// Errors that were raised.
    pub errors_raised: u64,
    /// Reboots.
    pub reboots: u64,
    /// How often the status transmission was stopped.
    pub status_stops: u64,
    /// How often the DSP hung.
    pub hangs: u64,
    /// Bytes from the PC that arrived while the DSP hung.
    pub missed_bytes: u64,
    /// How often the DSP's clock jumped.
    pub clock_jumps: u64,
    /// How often the status mask changed on the DSP.
    pub mask_changes: u64,
    /// How often the pilot took over.
    pub pilot_takeovers: u64,
    /// How often the battery fell to a voltage of the script.
    pub battery_drops: u64,
    /// How often the fuel fell to an amount of the script.
    pub fuel_drops: u64,
    /// How often the altitude of the GPS began to drift.
    pub gps_drifts: u64,
    /// How often the GPS lost its fix.
    pub gps_fix_losses: u64,
    /// How often the port was hung up.
    pub hang_ups: u64,
    /// Bytes to the PC that found the port gone.
    pub unplugged_bytes: u64,
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

    /// What was done elsewhere than on the serial link.
    fn events(&self) -> [(u64, &'static str); 14] {
        let FaultCounters {
            to_pc: _,
            to_dsp: _,
            errors_raised,
            reboots,
            status_stops,
            hangs,
            missed_bytes,
            clock_jumps,
            mask_changes,
            pilot_takeovers,
            battery_drops,
            fuel_drops,
            gps_drifts,
            gps_fix_losses,
            hang_ups,
            unplugged_bytes,
        } = *self;
        [
            (errors_raised, "errors raised"),
            (reboots, "reboots"),
            (status_stops, "status stops"),
            (hangs, "hangs"),
            (missed_bytes, "bytes missed by a DSP that hung"),
            (clock_jumps, "clock jumps"),
            (mask_changes, "mask changes"),
            (pilot_takeovers, "pilot takeovers"),
            (battery_drops, "battery drops"),
            (fuel_drops, "fuel drops"),
            (gps_drifts, "GPS altitude drifts"),
            (gps_fix_losses, "GPS fix losses"),
            (hang_ups, "port hang-ups"),
            (unplugged_bytes, "bytes to a port that was gone"),
        ]
    }
}

impl fmt::Display for FaultCounters {
    /// The counters that are not zero.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = [
            summary("to the PC", self.to_pc.named()),
            summary("to the DSP", self.to_dsp.named()),
            summary("events", self.events()),
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
