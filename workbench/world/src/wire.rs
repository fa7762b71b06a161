//! The bytes between a browser and the live view: a connection that keeps their order, delays them, and breaks; the
//! request for a WebSocket, and its frames.

use std::collections::VecDeque;

use view::ConnectionId;

use crate::script::Dice;

/// Most bytes that are on their way to a page that does not read.
const KERNEL_BYTES: usize = 64 << 10;

const TEXT: u8 = 1;
const PING: u8 = 9;
const PONG: u8 = 10;

/// A connection, or an attempt at one.
pub struct Wire {
    pub sender: usize,
    /// What the server calls it.
    pub id: Option<ConnectionId>,
    /// Whether the page uses it, and whether the server may.
    pub has_page: bool,
    pub has_view: bool,
    pub is_upgraded: bool,
    up: VecDeque<(u64, Piece)>,
    down: VecDeque<(u64, Piece)>,
    last_up: u64,
    last_down: u64,
    on_way_down: usize,
    /// What has come to the machine of the server, and was not read.
    pub socket: VecDeque<Piece>,
    received: Vec<u8>,
    /// When something of the page was read last.
    pub read_ms: u64,
    /// Whether its page commands, as the server has said on it last.
    pub commands: bool,
    /// The page has said that it is hidden.
    pub is_hidden: bool,
}

/// Bytes, or the end.
pub enum Piece {
    Bytes(Vec<u8>),
    End,
}

/// What a page gets.
pub enum Got {
    Upgraded,
    Text(Vec<u8>),
    Ping,
    End,
}

impl Wire {
    pub fn new(sender: usize) -> Wire {
        Wire {
            sender,
            id: None,
            has_page: true,
            has_view: true,
            is_upgraded: false,
            up: VecDeque::new(),
            down: VecDeque::new(),
            last_up: 0,
            last_down: 0,
            on_way_down: 0,
            socket: VecDeque::new(),
            received: Vec::new(),
            read_ms: 0,
            commands: false,
            is_hidden: false,
        }
    }

    /// What is lost is sent again by the kernels, so it is late.
    fn way_ms(dice: &mut Dice) -> u64 {
        let most = if dice.once_in(25) { 800 } else { 30 };
        dice.count(1, most)
    }

    pub fn send_up(&mut self, piece: Piece, now_ms: u64, dice: &mut Dice) {
        self.last_up = self.last_up.max(now_ms + Wire::way_ms(dice));
        self.up.push_back((self.last_up, piece));
    }

    pub fn send_down(&mut self, piece: Piece, now_ms: u64, dice: &mut Dice) {
        self.last_down = self.last_down.max(now_ms + Wire::way_ms(dice));
        if let Piece::Bytes(bytes) = &piece {
            self.on_way_down += bytes.len();
        }
        self.down.push_back((self.last_down, piece));
    }

    /// How many bytes the kernel takes.
    pub fn room(&self) -> usize {
        KERNEL_BYTES.saturating_sub(self.on_way_down)
    }

    /// What is on its way to the server is lost.
    pub fn loses_up(&mut self) {
        self.up.clear();
    }

    /// Its bytes come to the machine of the server.
    pub fn arrive(&mut self, now_ms: u64) {
        let due = self.up.partition_point(|(at, _)| *at <= now_ms);
        self.socket
            .extend(self.up.drain(..due).map(|(_, piece)| piece));
    }

    /// What has come to the page.
    pub fn take(&mut self, now_ms: u64) -> Vec<Got> {
        let mut got = Vec::new();
        let due = self.down.partition_point(|(at, _)| *at <= now_ms);
        for (_, piece) in self.down.drain(..due).collect::<Vec<_>>() {
            match piece {
                Piece::End => got.push(Got::End),
                Piece::Bytes(bytes) => {
                    self.on_way_down -= bytes.len();
                    self.received.extend_from_slice(&bytes);
                    self.parse(&mut got);
                }
            }
        }
        got
    }

    fn parse(&mut self, got: &mut Vec<Got>) {
        if !self.is_upgraded {
            let end = self
                .received
                .windows(4)
                .position(|four| four == b"\r\n\r\n");
            let Some(end) = end else { return };
            self.received.drain(..end + 4);
            self.is_upgraded = true;
            got.push(Got::Upgraded);
        }
        let mut at = 0;
        while let Some((opcode, payload)) = frame_at(&self.received, at) {
            match opcode {
                TEXT => got.push(Got::Text(self.received[payload.clone()].to_vec())),
                PING => got.push(Got::Ping),
                _ => {}
            }
            at = payload.end;
        }
        self.received.drain(..at);
    }
}

/// The frame that begins there, if it is whole.
fn frame_at(bytes: &[u8], at: usize) -> Option<(u8, std::ops::Range<usize>)> {
    let head = bytes.get(at..at + 2)?;
    let begin = at + 2;
    let (length, begin) = match head[1] {
        126 => {
            let length = bytes.get(begin..begin + 2)?.try_into().ok()?;
            (usize::from(u16::from_be_bytes(length)), begin + 2)
        }
        127 => {
            let length = bytes.get(begin..begin + 8)?.try_into().ok()?;
            (u64::from_be_bytes(length) as usize, begin + 8)
        }
        length => (usize::from(length), begin),
    };
    let end = begin + length;
    (bytes.len() >= end).then_some((head[0] & 15, begin..end))
}

/// A frame of a page, with the mask 0.
fn frame(opcode: u8, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x80 | opcode];
    match payload.len() {
        length @ ..126 => frame.push(0x80 | length as u8),
        length => {
            frame.push(0x80 | 126);
            frame.extend((length as u16).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(payload);
    frame
}

pub fn text(message: &str) -> Vec<u8> {
    frame(TEXT, message.as_bytes())
}

pub fn pong() -> Vec<u8> {
    frame(PONG, &[])
}

/// The text of a frame of a page.
pub fn text_of(frame: &[u8]) -> Option<&str> {
    let begin = match frame.get(1)? & 0x7f {
        126 => 8,
        _ => 6,
    };
    let is_text = frame[0] == 0x80 | TEXT;
    std::str::from_utf8(frame.get(begin..)?)
        .ok()
        .filter(|_| is_text)
}

/// The request for a WebSocket.
pub fn upgrade(protocol: &str) -> Vec<u8> {
    format!(
        "GET / HTTP/1.1\r\nHost: localhost:8765\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
         Sec-WebSocket-Protocol: {protocol}\r\n\r\n"
    )
    .into_bytes()
}
