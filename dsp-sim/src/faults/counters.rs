//! What a script did, in figures.

use std::fmt;

/// What was done to one direction of the line.
///
/// No byte is lost uncounted: `entered + duplicated + inserted + repeated_bytes` equals `left + dropped + stall_dropped
/// + outage_dropped + overflowed + swallowed_bytes` and what still waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DirectionCounters {
    /// Bytes that the faults were given.
    pub entered: u64,
    /// Bytes that came out of them.
    pub left: u64,
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
    /// Messages that were swallowed.
    pub swallowed: u64,
    /// Their bytes.
    pub swallowed_bytes: u64,
    /// Messages that came twice.
    pub repeated: u64,
    /// The bytes of their copies.
    pub repeated_bytes: u64,
    /// Messages that came late.
    pub late: u64,
    /// Messages that changed places with the next of their kind, or wait for it.
    pub reordered: u64,
}

impl DirectionCounters {
    /// All counters with their names, in the order in which they are told.
    fn named(&self) -> [(u64, &'static str); 20] {
        // Without `..`: a new counter does not compile until it is told.
        let DirectionCounters {
            entered,
            left,
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
            swallowed,
            swallowed_bytes,
            repeated,
            repeated_bytes,
            late,
            reordered,
        } = *self;
        [
            (entered, "bytes in"),
            (left, "bytes out"),
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
            (swallowed, "messages swallowed"),
            (swallowed_bytes, "bytes swallowed"),
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
    /// To what the DSP says.
    pub to_pc: DirectionCounters,
    /// To what the PC says.
    pub to_dsp: DirectionCounters,
    /// Errors that were raised.
    pub errors_raised: u64,
    /// Reboots.
    pub reboots: u64,
    /// How often the status transmission was stopped.
    pub status_stops: u64,
    /// How often the DSP hung.
    pub hangs: u64,
    /// Bytes from the PC that a hanging DSP did not hear.
    pub unheard_bytes: u64,
    /// How often the DSP's clock jumped.
    pub clock_jumps: u64,
    /// How often the port was hung up.
    pub hang_ups: u64,
    /// Bytes to the PC that found the port gone.
    pub unplugged_bytes: u64,
}

impl fmt::Display for FaultCounters {
    /// The counters that are not zero, by direction.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FaultCounters {
            to_pc,
            to_dsp,
            errors_raised,
            reboots,
            status_stops,
            hangs,
            unheard_bytes,
            clock_jumps,
            hang_ups,
            unplugged_bytes,
        } = self;
        let events = [
            (*errors_raised, "errors raised"),
            (*reboots, "reboots"),
            (*status_stops, "status stops"),
            (*hangs, "hangs"),
            (*unheard_bytes, "bytes not heard"),
            (*clock_jumps, "clock jumps"),
            (*hang_ups, "port hang-ups"),
            (*unplugged_bytes, "bytes to a port that was gone"),
        ];
        let mut is_first = true;
        for (what, counters) in [
            ("to the PC", &to_pc.named()[..]),
            ("to the DSP", &to_dsp.named()),
            ("events", &events),
        ] {
            let mut counters = counters.iter().filter(|(count, _)| *count > 0);
            let Some((count, name)) = counters.next() else {
                continue;
            };
            let separator = if is_first { "" } else { "; " };
            write!(f, "{separator}{what}: {count} {name}")?;
            for (count, name) in counters {
                write!(f, ", {count} {name}")?;
            }
            is_first = false;
        }
        if is_first {
            f.write_str("nothing")?;
        }
        Ok(())
    }
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
        counters.to_pc.late = 3;
        assert_eq!(
            counters.to_string(),
            "to the PC: 9 bytes in, 3 messages late; to the DSP: 7 bytes in; events: 2 reboots, 1 port hang-ups"
        );
    }
}
