//! [`WebSocket`]: frames in memory. Bytes in, messages out; messages in, bytes out.

use std::io::{self, ErrorKind, Read, Write};

use tungstenite::protocol::frame::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{Role, WebSocketConfig, WebSocketContext};
use tungstenite::{Error, Message};

/// Most bytes of a message from a viewer, whole or in fragments. The longest that a page means has 300; a service call
/// of a Foxglove client may be longer. More is answered with close code 1009.
pub const MAX_MESSAGE_BYTES: usize = 64 << 10;

/// What the library takes for each viewer at once; by itself it would be 128 KiB.
const READ_BUFFER_BYTES: usize = 4 << 10;

/// Why a WebSocket ends, as its other end reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Close {
    pub code: u16,
    pub why: &'static str,
}

impl Close {
    /// The peer does what the protocol forbids.
    pub const PROTOCOL: Close = Close::new(1002, "a frame that the protocol forbids");
    /// The peer sends what is no text, no JSON, or no message of the subprotocol.
    pub const MEANING: Close = Close::new(1007, "a message without meaning");
    /// The peer may not do this.
    pub const TOKEN: Close = Close::new(1008, "no token, and another user or another machine");
    /// The peer sends too much.
    pub const PACE: Close = Close::new(1008, "too many messages");
    /// The peer is too slow for what may not be left out.
    pub const SLOW: Close = Close::new(1008, "too slow for answers");
    /// The client has not sent its first message.
    pub const MUTE: Close = Close::new(1008, "nothing was opened in time");
    /// The peer is silent.
    pub const SILENT: Close = Close::new(1008, "no answer to pings");
    /// A message is too long.
    pub const SIZE: Close = Close::new(1009, "a message of more than 64 KiB");
    /// The peer is to connect anew.
    pub const ANEW: Close = Close::new(1012, "another beginning of time");

    const fn new(code: u16, why: &'static str) -> Close {
        Close { code, why }
    }
}

/// What has come.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum WebSocketMessage {
    Text(String),
    Binary(Vec<u8>),
    /// A ping or a pong, which is answered already.
    Sign,
}

/// A WebSocket in memory: bytes in, messages out; messages in, bytes out.
#[derive(Debug)]
pub(crate) struct WebSocket {
    context: WebSocketContext,
    is_open: bool,
}

/// The bytes that have come, and those that are to go. Neither ever blocks.
struct Memory<'i, 'o> {
    input: &'i [u8],
    output: &'o mut Vec<u8>,
}

impl Read for Memory<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.input.read(buffer)? {
            0 => Err(ErrorKind::WouldBlock.into()),
            count => Ok(count),
        }
    }
}

impl Write for Memory<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.output.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl WebSocket {
    pub fn new() -> WebSocket {
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_BUFFER_BYTES)
            // Each frame goes to `output` at once, whose bound the connection watches.
            .write_buffer_size(0)
            .max_message_size(Some(MAX_MESSAGE_BYTES))
            .max_frame_size(Some(MAX_MESSAGE_BYTES));
        WebSocket {
            context: WebSocketContext::new(Role::Server, Some(config)),
            is_open: true,
        }
    }

    /// Whether messages can still come and go.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Takes the next message out of `input`; `None` if no whole one is left. `input` is shortened by what was taken.
    /// An error is what was sent to the client before the end.
    pub fn receive(
        &mut self,
        input: &mut &[u8],
        output: &mut Vec<u8>,
    ) -> Result<Option<WebSocketMessage>, Close> {
        while self.is_open {
            let mut memory = Memory {
                input,
                output: &mut *output,
            };
            let read = self.context.read(&mut memory);
            *input = memory.input;
            let close = match read {
                Ok(Message::Text(text)) => {
                    return Ok(Some(WebSocketMessage::Text(text.as_str().to_owned())));
                }
                Ok(Message::Binary(bytes)) => {
                    return Ok(Some(WebSocketMessage::Binary(bytes.to_vec())));
                }
                Ok(Message::Ping(_) | Message::Pong(_)) => return Ok(Some(WebSocketMessage::Sign)),
                // The answer goes out with the next turn, which ends the connection.
                Ok(Message::Close(_) | Message::Frame(_)) => continue,
                Err(Error::Io(_)) => return Ok(None),
                Err(Error::ConnectionClosed | Error::AlreadyClosed) => {
                    self.is_open = false;
                    return Ok(None);
                }
                Err(Error::Capacity(_)) => Close::SIZE,
                Err(Error::Utf8(_)) => Close::MEANING,
                Err(_) => Close::PROTOCOL,
            };
            self.close(close, output);
            return Err(close);
        }
        Ok(None)
    }

    /// Writes a message, if the connection still takes one.
    pub fn send(&mut self, message: Message, output: &mut Vec<u8>) {
        let mut memory = Memory { input: &[], output };
        if self.is_open && self.context.write(&mut memory, message).is_err() {
            self.is_open = false;
        }
    }

    /// Says why it ends. An answer is not waited for: the other end may be the reason.
    pub fn close(&mut self, close: Close, output: &mut Vec<u8>) {
        if !self.is_open {
            return;
        }
        self.is_open = false;
        let frame = CloseFrame {
            code: CloseCode::from(close.code),
            reason: close.why.into(),
        };
        let mut memory = Memory { input: &[], output };
        // Only a socket can refuse, and this is memory.
        let _ = self.context.close(&mut memory, Some(frame));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of a client with the mask 0.
    fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
        let mut frame = vec![first];
        match payload.len() {
            length @ ..126 => frame.push(0x80 | length as u8),
            length @ ..65536 => {
                frame.push(0x80 | 126);
                frame.extend((length as u16).to_be_bytes());
            }
            length => {
                frame.push(0x80 | 127);
                frame.extend((length as u64).to_be_bytes());
            }
        }
        frame.extend([0; 4]);
        frame.extend(payload);
        frame
    }

    fn feed(
        socket: &mut WebSocket,
        mut bytes: &[u8],
        output: &mut Vec<u8>,
    ) -> Result<Vec<WebSocketMessage>, Close> {
        let mut all = Vec::new();
        while let Some(one) = socket.receive(&mut bytes, output)? {
            all.push(one);
        }
        Ok(all)
    }

    #[test]
    fn messages_are_the_same_however_bytes_are_cut() {
        let mut bytes = frame(0x81, b"{\"a\":1}");
        bytes.extend(frame(0x89, b"ping"));
        bytes.extend(frame(0x01, "grü".as_bytes().split_at(3).0));
        bytes.extend(frame(0x8a, b""));
        bytes.extend(frame(0x80, "grü".as_bytes().split_at(3).1));
        bytes.extend(frame(0x82, &[7; 300]));
        let expected = vec![
            WebSocketMessage::Text("{\"a\":1}".into()),
            WebSocketMessage::Sign,
            WebSocketMessage::Sign,
            WebSocketMessage::Text("grü".into()),
            WebSocketMessage::Binary(vec![7; 300]),
        ];
        for at in 0..=bytes.len() {
            let (mut socket, mut output) = (WebSocket::new(), Vec::new());
            let mut all = feed(&mut socket, &bytes[..at], &mut output).unwrap();
            all.extend(feed(&mut socket, &bytes[at..], &mut output).unwrap());
            assert_eq!(all, expected, "{at}");
            assert_eq!(output, b"\x8a\x04ping", "{at}");
        }
    }

    #[test]
    fn hostile_frames_close_with_their_code() {
        let mut unmasked = frame(0x81, b"");
        unmasked[1] = 0;
        unmasked.truncate(2);
        let mut fragments = frame(0x01, &vec![b'x'; 40 << 10]);
        fragments.extend(frame(0x80, &vec![b'x'; 40 << 10]));
        let mut huge = frame(0x82, &vec![0; 70_000]);
        huge.truncate(14);
        let mut twice = frame(0x01, b"a");
        twice.extend(frame(0x81, b"b"));
        let cases = [
            ("unmasked", unmasked, 1002),
            ("reserved bit", frame(0xc1, b"x"), 1002),
            ("reserved data opcode", frame(0x83, b"x"), 1002),
            ("reserved control opcode", frame(0x8b, b"x"), 1002),
            ("fragmented control frame", frame(0x09, b"x"), 1002),
            ("long control frame", frame(0x89, &[0; 126]), 1002),
            ("continuation of nothing", frame(0x80, b"x"), 1002),
            ("a message within another", twice, 1002),
            ("bad UTF-8", frame(0x81, b"\xff"), 1007),
            ("a cut character", frame(0x81, b"\xc3"), 1007),
            ("oversized, from its head alone", huge, 1009),
            ("oversized fragments", fragments, 1009),
        ];
        for (name, bytes, code) in cases {
            let (mut socket, mut output) = (WebSocket::new(), Vec::new());
            let close = feed(&mut socket, &bytes, &mut output).unwrap_err();
            assert_eq!(close.code, code, "{name}");
            assert_eq!(output[0], 0x88, "{name}: {output:?}");
            assert_eq!(output[2..4], code.to_be_bytes(), "{name}");
            assert!(!socket.is_open(), "{name}");
            assert_eq!(
                feed(&mut socket, &frame(0x81, b"{}"), &mut output),
                Ok(vec![])
            );
        }
    }

    #[test]
    fn a_message_may_have_64_kib() {
        let (mut socket, mut output) = (WebSocket::new(), Vec::new());
        let most = vec![b'x'; MAX_MESSAGE_BYTES];
        let all = feed(&mut socket, &frame(0x81, &most), &mut output).unwrap();
        assert_eq!(all.len(), 1);
        let more = vec![b'x'; MAX_MESSAGE_BYTES + 1];
        assert_eq!(
            feed(&mut socket, &frame(0x81, &more), &mut output),
            Err(Close::SIZE)
        );
    }

    #[test]
    fn a_close_is_answered_and_ends() {
        let (mut socket, mut output) = (WebSocket::new(), Vec::new());
        assert_eq!(
            feed(&mut socket, &frame(0x88, b"\x03\xe8"), &mut output),
            Ok(vec![])
        );
        assert_eq!(output, b"\x88\x02\x03\xe8");
        assert!(!socket.is_open());
        socket.send(Message::text("late"), &mut output);
        assert_eq!(output.len(), 4);
    }
}
