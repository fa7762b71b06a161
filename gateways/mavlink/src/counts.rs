//! [`Counts`]: what was read and sent, and what was not taken, by reason.

use crate::wire::Rejected;

/// Of all stations since the gateway began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that were read.
    pub frames_read: u64,
    /// Datagrams given to be sent.
    pub datagrams_sent: u64,
    /// Datagrams whose rest is no frame.
    pub unreadable: u64,
    /// Frames of messages that are not read here: stations send many.
    pub unknown: u64,
    /// Frames with a wrong checksum.
    pub checksum: u64,
    /// Frames without a signature, of where one is asked for.
    pub unsigned: u64,
    /// Frames with a signature of another key.
    pub signature: u64,
    /// Signed frames that are not newer than one that came before.
    pub replayed: u64,
    /// Heartbeats of stations for which there is no room.
    pub full: u64,
}

impl Counts {
    /// A frame was rejected.
    pub fn reject(&mut self, why: Rejected) {
        let count = match why {
            Rejected::Stray | Rejected::CutShort | Rejected::Flags => &mut self.unreadable,
            Rejected::UnknownMessage => &mut self.unknown,
            Rejected::Checksum => &mut self.checksum,
        };
        *count += 1;
    }

    /// Frames that say that something is wrong.
    pub fn suspicious(&self) -> u64 {
        let forged = self.unsigned + self.signature + self.replayed;
        self.unreadable + self.checksum + self.full + forged
    }
}
