//! [`Connection`]: one connection as HTTP, then maybe as a WebSocket. Bytes and times in; requests, messages, bytes and
//! a deadline out.

use std::time::Duration;

use ipc_types::MonotonicNs;
use tungstenite::{Bytes, Message};

use crate::event::Peer;
use crate::http::answer::Response;
use crate::http::refusal::Refusal;
use crate::http::request::{HttpRequest, RequestReader, Upgrade};
use crate::pace::{MESSAGES_PER_S, RateLimit};
use crate::websocket::{Close, WebSocket, WebSocketMessage};

/// How long a head may take; then it is answered with 408.
pub const HEAD_TIME: Duration = Duration::from_secs(5);

/// How long a connection may lie idle between requests, and before the first. Browsers open some that they do not use.
pub const IDLE_TIME: Duration = Duration::from_secs(2);

/// How long an answer may take: the largest file over 20 kbit/s. Then its connection is closed.
pub const ANSWER_TIME: Duration = Duration::from_secs(60);

/// How often a WebSocket is pinged.
pub const PING_PERIOD: Duration = Duration::from_secs(5);

/// A WebSocket from which nothing has come for so long is closed: three pings without an answer.
pub const SILENCE: Duration = Duration::from_secs(15);

/// Bytes that are made ready for a viewer at once. What is made later is newer.
const AHEAD_BYTES: usize = 16 << 10;

/// Bytes that wait without being asked for: answers to pings. A client that sends pings and reads nothing is closed at
/// this bound.
const MAX_OUTPUT_BYTES: usize = 256 << 10;

/// What the other end wants.
#[derive(Debug)]
pub(crate) enum Input {
    Request(HttpRequest),
    Message(WebSocketMessage),
}

/// Why a connection was ended here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Refused(Refusal),
    Closed(Close),
}

impl Ending {
    /// For the log.
    pub fn why(self) -> &'static str {
        match self {
            Ending::Refused(refusal) => refusal.why(),
            Ending::Closed(close) => close.why,
        }
    }
}

#[derive(Debug)]
enum ConnectionStage {
    /// Waits for requests.
    Http(RequestReader),
    Socket {
        socket: Box<WebSocket>,
        pace: RateLimit,
        next_ping: MonotonicNs,
    },
    /// The connection reads no further bytes.
    Ended,
}

/// One connection as HTTP, then maybe as a WebSocket.
#[derive(Debug)]
pub(crate) struct Connection {
    pub peer: Peer,
    stage: ConnectionStage,
    /// Bytes to write, of which the first `written` are gone.
    output: Vec<u8>,
    written: usize,
    /// What follows `output`: a file of the page, a tile, or a fixed answer.
    body: Bytes,
    /// When something came last, or an answer was gone.
    heard_at: MonotonicNs,
    /// When the head began that has not ended yet.
    head_began: Option<MonotonicNs>,
    /// When the answer began that is not gone yet, or was asked for elsewhere.
    answer_began: Option<MonotonicNs>,
}

impl Connection {
    pub fn new(peer: Peer, now: MonotonicNs) -> Connection {
        Connection {
            peer,
            stage: ConnectionStage::Http(RequestReader::default()),
            output: Vec::new(),
            written: 0,
            body: Bytes::new(),
            heard_at: now,
            head_began: None,
            answer_began: None,
        }
    }

    /// Its bytes are those of TLS. Only the first call counts, so that a handshake cannot go on for ever.
    pub fn encrypted(&mut self, now: MonotonicNs) {
        if !self.peer.is_encrypted {
            self.peer.is_encrypted = true;
            self.heard_at = now;
        }
    }

    /// Whether it is a WebSocket that is open.
    pub fn is_socket(&self) -> bool {
        matches!(self.stage, ConnectionStage::Socket { .. })
    }

    /// Whether it ends when its output is gone.
    pub fn is_ended(&self) -> bool {
        matches!(self.stage, ConnectionStage::Ended)
    }

    /// Whether it has ended and all its bytes are written.
    pub fn is_gone(&self) -> bool {
        self.is_ended() && !self.has_output()
    }

    /// Since when it has been waiting for a request, or for its last bytes to be read; `None` if it is neither.
    pub fn idle_since(&self) -> Option<MonotonicNs> {
        let is_idle = match &self.stage {
            ConnectionStage::Http(reader) => !reader.has_begun() && self.answer_began.is_none(),
            ConnectionStage::Socket { .. } => false,
            ConnectionStage::Ended => self.has_output(),
        };
        is_idle.then_some(self.heard_at)
    }

    fn has_output(&self) -> bool {
        self.written < self.output.len() || !self.body.is_empty()
    }

    /// Takes bytes; the caller then asks for what they mean until there is nothing. `input` is shortened by what was
    /// taken.
    pub fn next(&mut self, input: &mut &[u8], now: MonotonicNs) -> Result<Option<Input>, Ending> {
        if !input.is_empty() {
            self.heard_at = now;
        }
        match &mut self.stage {
            ConnectionStage::Ended => *input = &[],
            ConnectionStage::Http(reader) => {
                let has_room = reader.receive(std::mem::take(input));
                if !has_room {
                    return Err(self.refuse(Refusal::TooLarge, now));
                }
                // One at a time: the next request is read when the answer to this one is gone.
                if self.answer_began.is_some() {
                    return Ok(None);
                }
                match reader.next() {
                    Some(Ok(request)) => {
                        self.head_began = None;
                        return Ok(Some(Input::Request(request)));
                    }
                    Some(Err(refusal)) => return Err(self.refuse(refusal, now)),
                    None if reader.has_begun() => _ = self.head_began.get_or_insert(now),
                    None => {}
                }
            }
            ConnectionStage::Socket { socket, pace, .. } => {
                let received = socket.receive(input, &mut self.output);
                let is_open = socket.is_open();
                match received {
                    Ok(Some(_)) if !pace.allows(now) => {
                        self.close(Close::PACE, now);
                        return Err(Ending::Closed(Close::PACE));
                    }
                    Ok(Some(_)) if self.output.len() - self.written > MAX_OUTPUT_BYTES => {
                        self.end();
                        return Err(Ending::Closed(Close::SLOW));
                    }
                    Ok(Some(received)) => return Ok(Some(Input::Message(received))),
                    Ok(None) if is_open => {}
                    Ok(None) => self.ends(now),
                    Err(close) => {
                        self.ends(now);
                        return Err(Ending::Closed(close));
                    }
                }
            }
        }
        Ok(None)
    }

    /// The answer to a request comes later; until then no further one is read.
    pub fn waits(&mut self, now: MonotonicNs) {
        self.answer_began = Some(now);
    }

    /// Whether a request is to be answered that was read before.
    pub fn is_waiting(&self) -> bool {
        matches!(self.stage, ConnectionStage::Http(_))
            && self.answer_began.is_some()
            && !self.has_output()
    }

    /// Answers a request.
    pub fn answer(&mut self, answer: Response, now: MonotonicNs) {
        self.output.extend_from_slice(answer.head.as_bytes());
        self.body = answer.body;
        self.answer_began = Some(now);
        if !answer.stays {
            self.ends(now);
        }
    }

    /// Answers with a refusal, which is the end.
    pub fn refuse(&mut self, refusal: Refusal, now: MonotonicNs) -> Ending {
        self.body = Bytes::from_static(refusal.bytes());
        self.ends(now);
        Ending::Refused(refusal)
    }

    /// Becomes a WebSocket. Gives what came behind the request.
    pub fn upgrade(&mut self, upgrade: &Upgrade, protocol: &str, now: MonotonicNs) -> Vec<u8> {
        let rest = match &mut self.stage {
            ConnectionStage::Http(reader) => reader.take_rest(),
            _ => Vec::new(),
        };
        let answer = Response::upgraded(upgrade, protocol);
        self.output.extend_from_slice(answer.head.as_bytes());
        self.stage = ConnectionStage::Socket {
            socket: Box::new(WebSocket::new()),
            pace: RateLimit::new(MESSAGES_PER_S),
            next_ping: now + PING_PERIOD,
        };
        rest
    }

    /// Whether messages may be made ready now: nothing waits, so that they are written at once.
    pub fn is_free(&self) -> bool {
        self.is_socket() && !self.has_output()
    }

    /// Whether enough is ready, and the rest can wait to become newer.
    pub fn is_full(&self) -> bool {
        !self.is_socket() || self.output.len() - self.written >= AHEAD_BYTES
    }

    /// Makes a text ready.
    pub fn send_text(&mut self, text: &str) {
        self.send(Message::text(text.to_owned()));
    }

    /// Makes a binary message ready.
    pub fn send_binary(&mut self, bytes: Vec<u8>) {
        self.send(Message::binary(bytes));
    }

    fn send(&mut self, message: Message) {
        if let ConnectionStage::Socket { socket, .. } = &mut self.stage {
            socket.send(message, &mut self.output);
        }
    }

    /// Ends a WebSocket and says why.
    pub fn close(&mut self, close: Close, now: MonotonicNs) {
        if let ConnectionStage::Socket { socket, .. } = &mut self.stage {
            socket.close(close, &mut self.output);
        }
        self.ends(now);
    }

    /// Reads nothing any more; what waits has the time of an answer to be written.
    fn ends(&mut self, now: MonotonicNs) {
        self.stage = ConnectionStage::Ended;
        self.answer_began = Some(now);
    }

    /// Ends without a word.
    pub fn end(&mut self) {
        self.output.clear();
        self.written = 0;
        self.body = Bytes::new();
        self.answer_began = None;
        self.stage = ConnectionStage::Ended;
    }

    /// The bytes to write next.
    pub fn output(&self) -> &[u8] {
        match &self.output[self.written..] {
            [] => &self.body,
            head => head,
        }
    }

    /// Takes note that so many of them were written. True if a request that waits can be read now.
    pub fn sent(&mut self, count: usize, now: MonotonicNs) -> bool {
        let of_output = count.min(self.output.len() - self.written);
        self.written += of_output;
        let of_body = (count - of_output).min(self.body.len());
        self.body = self.body.slice(of_body..);
        if self.written == self.output.len() {
            self.output.clear();
            self.written = 0;
        }
        let is_answered = self.answer_began.is_some() && !self.has_output();
        if is_answered {
            self.answer_began = None;
            self.heard_at = now;
        }
        is_answered
    }

    /// When [`Connection::advance`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        match &self.stage {
            ConnectionStage::Socket { next_ping, .. } => {
                Some((*next_ping).min(self.heard_at + SILENCE))
            }
            _ if self.answer_began.is_some() => self.answer_began.map(|at| at + ANSWER_TIME),
            ConnectionStage::Http(_) if self.head_began.is_some() => {
                self.head_began.map(|at| at + HEAD_TIME)
            }
            ConnectionStage::Http(_) => Some(self.heard_at + IDLE_TIME),
            ConnectionStage::Ended => None,
        }
    }

    /// Does what is due. An error is why it has ended.
    pub fn advance(&mut self, now: MonotonicNs) -> Result<(), Ending> {
        if self.deadline().is_none_or(|deadline| now < deadline) {
            return Ok(());
        }
        match &mut self.stage {
            ConnectionStage::Socket { .. } if now >= self.heard_at + SILENCE => {
                // What waits would not be read, and neither would be the reason.
                self.end();
                Err(Ending::Closed(Close::SILENT))
            }
            ConnectionStage::Socket {
                socket, next_ping, ..
            } => {
                *next_ping = now + PING_PERIOD;
                socket.send(Message::Ping(Bytes::new()), &mut self.output);
                Ok(())
            }
            ConnectionStage::Http(_)
                if self.answer_began.is_none() && self.head_began.is_some() =>
            {
                Err(self.refuse(Refusal::TooSlow, now))
            }
            _ => {
                self.end();
                Ok(())
            }
        }
    }
}
