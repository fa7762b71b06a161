//! What the gateway says of itself: its stations, and what was not taken.

use ipc_types::MonotonicNs;
use ipc_types::payload::{MAX_MAVLINK_STATIONS, MavlinkStation, MavlinkStations, ascii_bytes};

use super::Gateway;
use crate::stations::{MAX_STATIONS, Station};

const _: () = assert!(MAX_STATIONS == MAX_MAVLINK_STATIONS);

impl Gateway {
    /// Writes everything but what each publisher writes itself.
    pub fn describe(&self, sample: &mut MavlinkStations, now: MonotonicNs) {
        let counts = &self.counts;
        let (vehicle, since) = self.told_vehicle;
        *sample = MavlinkStations {
            sequence: sample.sequence,
            epoch_ns: sample.epoch_ns,
            published_ns: now.0,
            since_ns: since.0,
            frames_read: counts.frames_read,
            datagrams_sent: counts.datagrams_sent,
            refused_unreadable: counts.unreadable,
            refused_unknown: counts.unknown,
            refused_checksum: counts.checksum,
            refused_unsigned: counts.unsigned,
            refused_signature: counts.signature,
            refused_replayed: counts.replayed,
            refused_full: counts.full,
            vehicle: vehicle.code(),
            system: self.settings.system.into(),
            is_signed: self.signing.is_some().into(),
            ..MavlinkStations::default()
        };
        let stations = self.stations.all();
        sample.count = stations.len() as u32;
        for (place, station) in sample.stations.iter_mut().zip(stations) {
            *place = self.describe_station(station);
        }
    }

    fn describe_station(&self, station: &Station) -> MavlinkStation {
        let sender = station.sender;
        let mut movements = self.pending.iter().filter(|one| one.is_movement());
        let has_movement = movements.any(|one| one.key.sender == sender);
        MavlinkStation {
            address: ascii_bytes(&sender.address.to_string()),
            last_heard_ns: station.heard.0,
            since_ns: station.since.0,
            last_command_ns: station.last_command.map_or(0, |last| last.0),
            commands: station.commands,
            refused: station.refused,
            system: sender.system.into(),
            component: sender.component.into(),
            may_command: self.not_permitted(sender, true).is_none().into(),
            is_lost: station.is_lost.into(),
            has_movement: has_movement.into(),
            ..MavlinkStation::default()
        }
    }
}
