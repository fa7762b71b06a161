//! Any bytes as the file of a mission, and as its items: for the fuzz target `mission`, and for the short play in
//! `chance`.

use ipc_types::MonotonicNs;
use mavlink_gateway::{Gateway, Mission, Settings, Task};

/// Bytes of an item, and those before the items.
const ITEM: usize = 33;
const HEADER: usize = 8;

/// Panics where a promise is broken: what is read is what was written, and no item makes the check panic.
pub fn check(bytes: &[u8]) {
    if let Ok(mission) = Mission::decode(bytes) {
        assert_eq!(mission.encode(), bytes);
    }
    // These bytes as items of a file that is whole.
    let items = bytes.as_chunks::<ITEM>().0;
    let mut file = b"RILM\x01\x00".to_vec();
    file.extend((items.len() as u16).to_le_bytes());
    items.iter().for_each(|item| file.extend(item));
    file.extend(
        crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC)
            .checksum(&file)
            .to_le_bytes(),
    );
    assert_eq!(file.len(), HEADER + items.len() * ITEM + 4);
    let mission = Mission::decode(&file);
    assert_eq!(mission.is_ok(), items.len() <= 2048);
    let Ok(mission) = mission else { return };
    assert_eq!(usize::from(mission.count()), items.len());
    upload(&mission);
}

/// A station sends the mission, and it is checked.
fn upload(mission: &Mission) {
    use mavlink_gateway::message::{HEARTBEAT, MISSION_COUNT, MISSION_ITEM_INT};
    use mavlink_gateway::wire::MessageWriter;
    let station = ([127, 0, 0, 1], 1).into();
    let mut gateway = Gateway::new(Settings::default(), 1);
    let now = MonotonicNs(1_000_000_000);
    let receive = |gateway: &mut Gateway, message: &MessageWriter| {
        gateway.datagram(station, &message.frame(0, 255, 190), now, now);
    };
    receive(
        &mut gateway,
        &MessageWriter::new(HEARTBEAT).u32(0).u8(6).u8(8),
    );
    let count = MessageWriter::new(MISSION_COUNT).u16(mission.count());
    receive(&mut gateway, &count.u8(1).u8(1).u8(0));
    let encoded = mission.encode();
    let items = encoded[HEADER..].as_chunks::<ITEM>().0;
    for (number, item) in items.iter().take(mission.count().into()).enumerate() {
        let add = |message: MessageWriter, bytes: &[u8]| {
            bytes
                .iter()
                .fold(message, |message, byte| message.u8(*byte))
        };
        let message = add(MessageWriter::new(MISSION_ITEM_INT), &item[..28]).u16(number as u16);
        let message = add(message, &item[28..30]).u8(1).u8(1);
        receive(&mut gateway, &add(message, &item[30..]).u8(0));
    }
    let mut saved = 0;
    while let Some(task) = gateway.poll_task() {
        match task {
            Task::Rules => gateway.rules(None, now),
            Task::PutFence(_) | Task::RestoreFence => panic!("no fence was sent"),
            Task::Save(kept) => {
                assert_eq!(kept, *mission);
                saved += 1;
                gateway.saved(kept, Ok(()), now);
            }
        }
    }
    assert!(saved <= 1);
}
