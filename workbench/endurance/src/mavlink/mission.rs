//! Missions from the view of a station: it sends one as it is asked for, and reads it item by item. What it waits for
//! comes within [`WAIT_LIMIT`], or it panics.

use std::time::{Duration, Instant};

use mavlink_gateway::message::{
    MISSION_ACK, MISSION_COUNT, MISSION_ITEM_INT, MISSION_REQUEST_INT, MISSION_REQUEST_LIST,
};
use mavlink_gateway::wire::MessageWriter;
use ril_tests::process::WAIT_LIMIT;

use super::station::{Received, Station};

/// When a station sends a count or an item again that the next question did not follow.
const RETRY: Duration = Duration::from_millis(250);

/// When it asks for an item again: as soon as the gateway does.
const QUESTION_RETRY: Duration = Duration::from_millis(20);

/// A take-off to this height, then waypoints beside home, `count` items in all.
pub fn mission(count: u16, height_m: f32) -> Vec<MessageWriter> {
    let item = |sequence: u16| {
        let (command, x, y) = match sequence {
            0 => (22, 0, 0),
            number => (16, 374_110_000 + 50 * i32::from(number), -60_010_000),
        };
        let message = MessageWriter::new(MISSION_ITEM_INT)
            .f32s(0.0, 3)
            .f32(f32::NAN);
        let message = message.i32(x).i32(y).f32(height_m);
        let bytes = [1, 1, 6, 0, 1, 0];
        bytes
            .into_iter()
            .fold(message.u16(sequence).u16(command), MessageWriter::u8)
    };
    (0..count).map(item).collect()
}

fn count(count: usize) -> MessageWriter {
    let message = MessageWriter::new(MISSION_COUNT).u16(count as u16);
    message.u8(1).u8(1).u8(0)
}

/// What of an item is the mission's own.
fn content(item: &MessageWriter) -> Vec<u8> {
    let bytes = item.payload().0;
    [&bytes[..32], &bytes[34..37]].concat()
}

/// MAV_MISSION_OPERATION_CANCELLED: an item did not come in time, as when the machine stalls.
const CANCELLED: u8 = 15;

/// Sends a mission as it is asked for; what got no answer is sent again, and all of it when it came too late. Gives the
/// result.
#[track_caller]
pub fn upload(station: &mut Station, items: &[MessageWriter]) -> u8 {
    upload_until(station, items, None).expect("a result")
}

/// Sends a mission as it is asked for, and gives the result; `None` as soon as `stop` items were sent.
#[track_caller]
pub fn upload_until(
    station: &mut Station,
    items: &[MessageWriter],
    stop: Option<usize>,
) -> Option<u8> {
    let mut give_up = Instant::now() + WAIT_LIMIT;
    let mut last = count(items.len());
    station.send(&last);
    if stop == Some(0) {
        return None;
    }
    let mut again = Instant::now() + RETRY;
    while Instant::now() < give_up {
        let message = station.next_message();
        match &message {
            Some(message) if message.is(MISSION_ACK.id) && message.u8(2) == CANCELLED => {
                last = count(items.len());
                station.send(&last);
                again = Instant::now() + RETRY;
            }
            Some(message) if message.is(MISSION_ACK.id) => return Some(message.u8(2)),
            Some(message) if message.is(MISSION_REQUEST_INT.id) => {
                let number = usize::from(message.u16(0));
                last = items[number].clone();
                station.send(&last);
                if stop == Some(number + 1) {
                    return None;
                }
                again = Instant::now() + RETRY;
                give_up = Instant::now() + WAIT_LIMIT;
            }
            _ if Instant::now() >= again => {
                station.send(&last);
                again = Instant::now() + RETRY;
            }
            _ => {}
        }
    }
    panic!("the upload does not end");
}

/// Asks until the answer comes.
#[track_caller]
fn ask(
    station: &mut Station,
    question: &MessageWriter,
    is_answer: impl Fn(&Received) -> bool,
) -> Received {
    let give_up = Instant::now() + WAIT_LIMIT;
    station.send(question);
    let mut again = Instant::now() + QUESTION_RETRY;
    while Instant::now() < give_up {
        if let Some(message) = station.next_message()
            && is_answer(&message)
        {
            return message;
        }
        if Instant::now() >= again {
            station.send(question);
            again = Instant::now() + QUESTION_RETRY;
        }
    }
    panic!("no answer to {question:?}");
}

/// What the items of the gateway's mission are.
#[track_caller]
pub fn download(station: &mut Station) -> Vec<Vec<u8>> {
    let list = MessageWriter::new(MISSION_REQUEST_LIST).u8(1).u8(1).u8(0);
    let total = ask(station, &list, |message| message.is(MISSION_COUNT.id)).u16(0);
    let item = |sequence: u16| {
        let request = MessageWriter::new(MISSION_REQUEST_INT).u16(sequence);
        let item = ask(station, &request.u8(1).u8(1).u8(0), |message| {
            message.is(MISSION_ITEM_INT.id) && message.u16(28) == sequence
        });
        [item.part(0..32), item.part(34..37)].concat()
    };
    let items = (0..total).map(item).collect();
    station.send(&MessageWriter::new(MISSION_ACK).u8(1).u8(1).u8(0).u8(0));
    items
}

/// What [`download`] gives of a mission that is whole.
pub fn contents(items: &[MessageWriter]) -> Vec<Vec<u8>> {
    items.iter().map(content).collect()
}
