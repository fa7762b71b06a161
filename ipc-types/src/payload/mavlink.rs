//! [`MavlinkStations`]: what the gateway to MAVLink knows of ground stations.

use super::text::ascii_text;
use crate::code::MavlinkVehicle;
use crate::time::MonotonicNs;

/// Stations of MAVLink that the gateway takes at a time.
pub const MAX_MAVLINK_STATIONS: usize = 8;

/// Bytes of [`MavlinkStation::address`]: an IPv6 address with its port has 47.
pub const MAVLINK_ADDRESS_LEN: usize = 48;

shared_struct! {
    /// The ground stations and scripts that are connected over MAVLink, and what was not taken of them. Topic `mavlink/stations`,
    /// published by the gateway on its machine; at every change and at least once a second. It is not relayed.
    ///
    /// Times are host monotonic nanoseconds; 0 stands for "never". Counts begin with the gateway's process.
    pub struct MavlinkStations("hero.MavlinkStations.v1") = 1024 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// Since when `vehicle` holds.
        pub since_ns: u64,
        /// Frames that were read.
        pub frames_read: u64,
        /// Datagrams sent to stations.
        pub datagrams_sent: u64,
        /// Datagrams whose rest was dropped because it is no frame.
        pub refused_unreadable: u64,
        /// Frames of messages that are not read here.
        pub refused_unknown: u64,
        /// Frames with a wrong checksum.
        pub refused_checksum: u64,
        /// Frames without a signature, where one is asked for.
        pub refused_unsigned: u64,
        /// Frames with a signature of another key.
        pub refused_signature: u64,
        /// Signed frames that are not newer than one that came before.
        pub refused_replayed: u64,
        /// Heartbeats of stations for which there is no room.
        pub refused_full: u64,
        /// The stations, the first `count` of which mean something; the others are all zero.
        pub stations: [MavlinkStation; MAX_MAVLINK_STATIONS],
        /// How many stations there are, 0 … 8.
        pub count: u32,
        /// A [`MavlinkVehicle`](crate::code::MavlinkVehicle): whether telemetry is sent, and why not.
        pub vehicle: u32 => vehicle: MavlinkVehicle,
        /// The vehicle's number, 1 … 250.
        pub system: u32,
        /// 1 when frames without a signature are not taken.
        pub is_signed: u32,
        /// Datagrams that were not sent because the socket was full.
        pub datagrams_dropped: u64,
    }
}

shared_struct! {
    /// A ground station or script as the gateway knows it.
    pub struct MavlinkStation("hero.MavlinkStation.v1") = 112 {
        /// Its address, such as `127.0.0.1:14550`, ASCII, filled up with zeros.
        pub address: [u8; MAVLINK_ADDRESS_LEN],
        /// When its last frame came.
        pub last_heard_ns: u64,
        /// Since when it is there.
        pub since_ns: u64,
        /// When its last command was taken.
        pub last_command_ns: u64,
        /// Its commands that became orders.
        pub commands: u64,
        /// Its commands that were answered with a refusal.
        pub refused: u64,
        /// Its number, 1 … 255: a claim.
        pub system: u32,
        /// The number of its program.
        pub component: u32,
        /// 1 when its commands are taken.
        pub may_command: u32,
        /// 1 when nothing came of it for the configured time.
        pub is_lost: u32,
        /// 1 when the movement under way is one that it has ordered.
        pub has_movement: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

impl MavlinkStations {
    /// The stations. A count that the contract does not have is that of all places.
    pub fn stations(&self) -> &[MavlinkStation] {
        let count = usize::try_from(self.count).unwrap_or(MAX_MAVLINK_STATIONS);
        &self.stations[..count.min(MAX_MAVLINK_STATIONS)]
    }

    /// Whether telemetry is sent.
    pub fn is_heard(&self) -> bool {
        self.vehicle() == Some(MavlinkVehicle::Heard)
    }

    /// When it was published.
    pub const fn published(&self) -> MonotonicNs {
        MonotonicNs(self.published_ns)
    }
}

impl MavlinkStation {
    /// Its address; `None` if it is not printable ASCII.
    pub fn address(&self) -> Option<&str> {
        ascii_text(&self.address)
    }

    /// When its last command was taken, `None` before the first.
    pub fn last_command(&self) -> Option<MonotonicNs> {
        (self.last_command_ns != 0).then_some(MonotonicNs(self.last_command_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::super::text::ascii_bytes;
    use super::*;

    #[test]
    fn only_as_many_stations_as_there_are_places_are_shown() {
        let stations = |count| MavlinkStations {
            count,
            ..MavlinkStations::default()
        };
        assert_eq!(stations(2).stations().len(), 2);
        assert_eq!(stations(u32::MAX).stations().len(), MAX_MAVLINK_STATIONS);
        assert!(!stations(0).is_heard(), "0 is no state");
        let longest = "[ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff]:65535";
        let station = MavlinkStation {
            address: ascii_bytes(longest),
            ..MavlinkStation::default()
        };
        assert_eq!(station.address(), Some(longest));
        assert_eq!(station.last_command(), None);
    }
}
