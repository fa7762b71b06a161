//! [`Mission`]: the items of a mission, bit by bit as a station has uploaded them, and the file that keeps them over
//! restarts.
//!
//! The file is written as a whole beside the old one, synced and renamed, so that there is always the old mission or
//! the new one. Its layout, numbers in little-endian:
//!
//! | bytes | content |
//! |--:|---|
//! | 4 | `RILM` |
//! | 2, 2 | version 1, how many items |
//! | 33 each | the items, as in MISSION_ITEM_INT without number and target |
//! | 4 | CRC-32 of all before it |

use std::sync::Arc;

use crc::{CRC_32_ISO_HDLC, Crc};
use plans::mavlink::{FRAME_MISSION, MissionItem};

use crate::message::MISSION_ITEM_INT;
use crate::number::{coordinate, widened};
use crate::stations::StationAddress;
use crate::wire::{MessageWriter, Payload};

/// Most items: a transfer over a slow line ends in this life, and QGroundControl's surveys are shorter.
pub const MAX_ITEMS: usize = 2048;

/// Bytes of an item.
const ITEM: usize = 33;
const HEADER: usize = 8;
const CHECKSUM: usize = 4;
const MAGIC: &[u8; 4] = b"RILM";
const VERSION: u16 = 1;

/// Longest file, bytes.
pub const MAX_FILE_BYTES: usize = HEADER + MAX_ITEMS * ITEM + CHECKSUM;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// MISSION_ITEM_INT without number and target: parameters, x, y, z, command, frame, current, autocontinue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item([u8; ITEM]);

impl Item {
    /// The item in the payload of a MISSION_ITEM_INT.
    pub fn of(payload: Payload<'_>) -> Item {
        Item(std::array::from_fn(|at| match at {
            0..28 => payload.u8(at),
            28..30 => payload.u8(at + 2),
            _ => payload.u8(at + 4),
        }))
    }

    /// An item of a geofence: `param1` is how many corners the area has, or the radius, m; the place in degrees.
    pub fn of_area(command: u16, param1: f32, place: [f64; 2]) -> Item {
        let [x, y] = place.map(|degrees| (degrees * 1e7).round() as i32);
        let message = MessageWriter::new(MISSION_ITEM_INT)
            .f32(param1)
            .f32s(0.0, 3)
            .i32(x)
            .i32(y)
            .f32(0.0)
            .u16(0)
            .u16(command);
        Item::of(message.u16(0).u8(0).u8(0).u8(1).payload())
    }

    /// The message that gives it to a station.
    pub fn message(&self, sequence: u16, to: StationAddress, mission_type: u8) -> MessageWriter {
        let Item(bytes) = self;
        let add = |message: MessageWriter, bytes: &[u8]| {
            bytes
                .iter()
                .fold(message, |message, byte| message.u8(*byte))
        };
        let message = add(MessageWriter::new(MISSION_ITEM_INT), &bytes[..28]).u16(sequence);
        let message = add(message, &bytes[28..30]).u8(to.system).u8(to.component);
        add(message, &bytes[30..]).u8(mission_type)
    }

    fn payload(&self) -> Payload<'_> {
        Payload(&self.0)
    }

    /// Field `current`: 1 of the item that a mission begins with.
    pub fn current(&self) -> u8 {
        self.payload().u8(31)
    }

    /// Whether it is no part of a mission, but to be flown to at once: `current` is 2, or 3 for the height alone.
    pub fn is_guided(&self) -> bool {
        matches!(self.current(), 2 | 3)
    }

    /// What tells it from another one.
    pub fn bits(&self) -> [u32; 8] {
        let payload = self.payload();
        std::array::from_fn(|index| match index {
            7 => {
                u32::from(self.frame()) << 16
                    | u32::from(self.command()) ^ u32::from(self.current()) << 24
            }
            index => payload.u32(4 * index),
        })
    }

    /// MAV_CMD.
    pub fn command(&self) -> u16 {
        self.payload().u16(28)
    }

    /// MAV_FRAME.
    pub fn frame(&self) -> u8 {
        self.payload().u8(30)
    }

    /// The item as `plans` reads it. Stations write "no value" as not a number, and in integers in several ways.
    pub fn read(&self) -> MissionItem {
        let payload = self.payload();
        let is_place = u16::from(self.frame()) != FRAME_MISSION;
        let integer = |at: usize| coordinate(payload.i32(at), is_place);
        MissionItem {
            frame: self.frame().into(),
            command: self.command(),
            params: [
                widened(payload.f32(0)),
                widened(payload.f32(4)),
                widened(payload.f32(8)),
                widened(payload.f32(12)),
                integer(16),
                integer(20),
                widened(payload.f32(24)),
            ],
            auto_continue: payload.u8(32) != 0,
        }
    }
}

/// The items of a mission, bit by bit as a station has uploaded them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mission {
    items: Arc<[Item]>,
}

impl Mission {
    /// A mission of these items; at most 2,048.
    pub fn new(items: Vec<Item>) -> Mission {
        Mission {
            items: items.into(),
        }
    }

    /// Its items.
    pub fn items(&self) -> &Arc<[Item]> {
        &self.items
    }

    /// How many items it has.
    pub fn count(&self) -> u16 {
        self.items.len() as u16
    }

    /// What tells it from another mission, so that stations see that theirs is still the one; 0 if it has no item.
    pub fn id(&self) -> u32 {
        if self.items.is_empty() {
            return 0;
        }
        let mut digest = CRC.digest();
        self.items.iter().for_each(|Item(item)| digest.update(item));
        // 0 says that there is no such number.
        digest.finalize().max(1)
    }

    /// The file.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER + self.items.len() * ITEM + CHECKSUM);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(self.count().to_le_bytes());
        self.items.iter().for_each(|Item(item)| bytes.extend(item));
        bytes.extend(CRC.checksum(&bytes).to_le_bytes());
        bytes
    }

    /// The mission of a file.
    ///
    /// # Errors
    ///
    /// Why it is no file of a mission, as a clause.
    pub fn decode(bytes: &[u8]) -> Result<Mission, &'static str> {
        let Some((content, checksum)) = bytes.split_last_chunk::<CHECKSUM>() else {
            return Err("it is cut short");
        };
        let header = Payload(content);
        if content.len() < HEADER || content[..4] != *MAGIC {
            return Err("it is no mission");
        }
        if header.u16(4) != VERSION {
            return Err("it is of another version");
        }
        let count = usize::from(header.u16(6));
        if count > MAX_ITEMS || content.len() != HEADER + count * ITEM {
            return Err("its length is not that of its items");
        }
        if CRC.checksum(content) != u32::from_le_bytes(*checksum) {
            return Err("its checksum is wrong");
        }
        let items = content[HEADER..].as_chunks::<ITEM>().0;
        Ok(Mission::new(items.iter().map(|item| Item(*item)).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::frames;

    fn item(command: u16, frame: u8, x: i32, z: f32) -> MessageWriter {
        let message = MessageWriter::new(MISSION_ITEM_INT)
            .f32(5.3)
            .f32(f32::from_bits(0x7fc0_1234));
        let message = message.f32(0.0).f32(-1.0).i32(x).i32(-60_010_000).f32(z);
        let message = message.u16(7).u16(command).u8(1).u8(1);
        message.u8(frame).u8(1).u8(1).u8(0)
    }

    fn read(message: &MessageWriter) -> Item {
        Item::of(message.payload())
    }

    #[test]
    fn an_item_is_given_back_bit_by_bit() {
        let uploaded = item(16, 6, 374_112_000, 20.0);
        let to = StationAddress {
            address: ([127, 0, 0, 1], 1).into(),
            system: 1,
            component: 1,
        };
        assert_eq!(read(&uploaded).message(7, to, 0), uploaded);
        // Also over the wire, which cuts zeros off.
        let frame = item(16, 0, 0, 0.0).frame(0, 255, 190);
        let received = frames(&frame).next().unwrap().unwrap();
        assert_eq!(Item::of(received.payload), read(&item(16, 0, 0, 0.0)));
    }

    #[test]
    fn numbers_are_those_of_the_author_and_none_is_none() {
        let plain = read(&item(16, 6, 374_112_000, 18.1)).read();
        let [hold, nan, _, _, latitude, longitude, altitude] = plain.params;
        assert_eq!(
            (hold, latitude, longitude, altitude),
            (5.3, 37.4112, -6.001, 18.1)
        );
        assert!(nan.is_nan() && plain.auto_continue && plain.frame == 6);
        for none in [i32::MAX, i32::MIN, 0x7ff8_0000] {
            assert!(read(&item(16, 6, none, 1.0)).read().params[4].is_nan());
        }
        // Without a place the integers are numbers.
        assert_eq!(read(&item(178, 2, 3, 1.0)).read().params[4], 3.0);
    }

    #[test]
    fn a_file_is_read_again_and_one_that_is_not_whole_is_none() {
        let items = [item(22, 3, 0, 15.0), item(16, 3, 1, 15.0)];
        let mission = Mission::new(items.iter().map(read).collect());
        let bytes = mission.encode();
        assert_eq!(Mission::decode(&bytes), Ok(mission.clone()));
        assert_eq!(
            Mission::decode(&Mission::default().encode()),
            Ok(Mission::default())
        );
        for length in 0..bytes.len() {
            assert!(Mission::decode(&bytes[..length]).is_err(), "{length}");
        }
        for bit in 0..8 * bytes.len() {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(Mission::decode(&changed).is_err(), "bit {bit}");
        }
        // What is no header of it, with a checksum that is right.
        for at in 0..HEADER {
            let mut changed = bytes[..bytes.len() - CHECKSUM].to_vec();
            changed[at] ^= 1;
            changed.extend(CRC.checksum(&changed).to_le_bytes());
            assert!(Mission::decode(&changed).is_err(), "byte {at}");
        }
        let most = Mission::new(vec![mission.items[0]; MAX_ITEMS]);
        assert_eq!(most.encode().len(), MAX_FILE_BYTES);
        assert_eq!(Mission::decode(&most.encode()).unwrap().count(), 2048);
        assert!(Mission::decode(&Mission::new(vec![mission.items[0]; 2049]).encode()).is_err());
    }

    /// A copy of a command has the same bits, and nothing else has.
    #[test]
    fn each_field_of_an_item_tells_it_from_another_one() {
        let payload = item(16, 3, 1, 15.0);
        let bytes: Vec<u8> = (0..37).map(|at| payload.payload().u8(at)).collect();
        let of = |bytes: &[u8]| {
            let message = MessageWriter::new(MISSION_ITEM_INT);
            read(
                &bytes
                    .iter()
                    .fold(message, |message, byte| message.u8(*byte)),
            )
        };
        let mut seen = vec![of(&bytes).bits()];
        // Parameters, place, command, frame, current.
        for at in (0..28).chain([30, 31, 34, 35]) {
            for bit in [0, 6] {
                let mut changed = bytes.clone();
                changed[at] ^= 1 << bit;
                seen.push(of(&changed).bits());
            }
        }
        let count = seen.len();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), count);
    }

    #[test]
    fn another_mission_has_another_id() {
        let one = Mission::new(vec![read(&item(16, 3, 1, 15.0))]);
        let other = Mission::new(vec![read(&item(16, 3, 1, 15.5))]);
        assert!(one.id() != other.id() && one.id() == one.clone().id());
        assert_eq!(Mission::default().id(), 0);
    }
}
