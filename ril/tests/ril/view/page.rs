//! [`Page`]: a page of the view as a browser would be one: an HTTP request, then WebSocket frames with JSON. Written by
//! hand, so that it can ask for what no browser does.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};

/// Longer than anything takes; a page that waits for more hangs.
pub const WATCHDOG: Duration = Duration::from_secs(60);

/// Opcodes of frames.
const TEXT: u8 = 1;
const BINARY: u8 = 2;
const CLOSE: u8 = 8;
const PING: u8 = 9;
const PONG: u8 = 10;

/// What a page is connected by: TCP, or TLS over it.
pub trait Stream: Read + Write + Send {}

impl<T: Read + Write + Send> Stream for T {}

/// A connection on which `hero.view.v1` is spoken.
pub struct Page {
    stream: Box<dyn Stream>,
    /// Bytes that came behind the last frame.
    rest: Vec<u8>,
    /// The newest `now` that has come.
    seen: u64,
}

/// A message of a server.
pub enum Message {
    /// JSON.
    Text(Value),
    /// Bytes.
    Binary(Vec<u8>),
}

/// What a server answers to a request: its first line and its body.
pub fn request(port: u16, path: &str, headers: &[(&str, &str)]) -> (String, String) {
    let mut stream = connect(port);
    write!(stream, "GET {path} HTTP/1.1\r\n{}\r\n", lines(headers)).expect("a request");
    let mut answer = Vec::new();
    let mut buffer = [0; 4096];
    // The server may keep the connection: the head says how long the body is.
    loop {
        let text = String::from_utf8_lossy(&answer).into_owned();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let length = head.lines().find_map(|line| {
                let (name, value) = line.split_once(':')?;
                let is_it = name.eq_ignore_ascii_case("content-length");
                is_it.then(|| value.trim().parse::<usize>().ok()).flatten()
            });
            if body.len() >= length.unwrap_or(usize::MAX) {
                let status = head.lines().next().unwrap_or_default();
                return (status.to_owned(), body.to_owned());
            }
        }
        match stream.read(&mut buffer).expect("an answer") {
            0 => {
                let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
                let status = head.lines().next().unwrap_or_default();
                return (status.to_owned(), body.to_owned());
            }
            count => answer.extend_from_slice(&buffer[..count]),
        }
    }
}

pub fn connect(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).expect("a server");
    stream.set_read_timeout(Some(WATCHDOG)).expect("a time-out");
    stream
}

fn lines(headers: &[(&str, &str)]) -> String {
    let lines = headers
        .iter()
        .map(|(name, value)| format!("{name}: {value}\r\n"));
    lines.collect()
}

impl Page {
    /// Connects as the view's own page does, and opens with `token`.
    pub fn open(port: u16, token: Option<&str>) -> Page {
        let host = format!("127.0.0.1:{port}");
        let origin = format!("http://{host}");
        let mut page = Page::upgrade(port, &host, Some(&origin)).expect("an upgrade");
        page.send(&json!({"type": "open", "token": token, "robot": null, "rate_hz": 20}));
        page
    }

    /// Asks for a WebSocket; gives the first line of the answer when it is refused.
    pub fn upgrade(port: u16, host: &str, origin: Option<&str>) -> Result<Page, String> {
        Page::speak("hero.view.v1", port, host, origin)
    }

    /// Asks for a WebSocket with `protocol`; gives the first line of the answer when it is refused.
    pub fn speak(
        protocol: &str,
        port: u16,
        host: &str,
        origin: Option<&str>,
    ) -> Result<Page, String> {
        Page::speak_at("/", protocol, port, host, origin)
    }

    /// Connects as a Foxglove client of this user, with `token` in the address.
    pub fn foxglove(protocol: &str, port: u16, token: Option<&str>) -> Result<Page, String> {
        let path = token.map_or("/".to_owned(), |token| format!("/?token={token}"));
        Page::speak_at(&path, protocol, port, &format!("127.0.0.1:{port}"), None)
    }

    fn speak_at(
        path: &str,
        protocol: &str,
        port: u16,
        host: &str,
        origin: Option<&str>,
    ) -> Result<Page, String> {
        Page::over(Box::new(connect(port)), path, protocol, host, origin)
    }

    /// Asks for a WebSocket over a connection that is there; gives the first line of the answer when it is refused.
    pub fn over(
        mut stream: Box<dyn Stream>,
        path: &str,
        protocol: &str,
        host: &str,
        origin: Option<&str>,
    ) -> Result<Page, String> {
        let mut headers = vec![
            ("Host", host),
            ("Upgrade", "websocket"),
            ("Connection", "Upgrade"),
            ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Protocol", protocol),
        ];
        headers.extend(origin.map(|origin| ("Origin", origin)));
        // A server that turns away may have closed already: then nothing is read.
        let _ = write!(stream, "GET {path} HTTP/1.1\r\n{}\r\n", lines(&headers));
        let mut rest = Vec::new();
        let mut buffer = [0; 4096];
        loop {
            if let Some(end) = rest.windows(4).position(|four| four == b"\r\n\r\n") {
                let head = String::from_utf8_lossy(&rest[..end]).into_owned();
                let status = head.lines().next().unwrap_or_default().to_owned();
                rest.drain(..end + 4);
                return match status.contains(" 101 ") {
                    true => Ok(Page {
                        stream,
                        rest,
                        seen: 0,
                    }),
                    false => Err(status),
                };
            }
            match stream.read(&mut buffer) {
                Ok(count @ 1..) => rest.extend_from_slice(&buffer[..count]),
                _ => return Err(String::from_utf8_lossy(&rest).into_owned()),
            }
        }
    }

    /// Sends a message.
    pub fn send(&mut self, message: &Value) {
        self.frame(TEXT, message.to_string().as_bytes());
    }

    /// Sends bytes.
    pub fn send_binary(&mut self, bytes: &[u8]) {
        self.frame(BINARY, bytes);
    }

    /// A frame with the mask 0, which every client must have.
    fn frame(&mut self, opcode: u8, payload: &[u8]) {
        let mut frame = vec![0x80 | opcode];
        match u16::try_from(payload.len()) {
            Ok(length @ ..126) => frame.push(0x80 | length as u8),
            Ok(length) => {
                frame.push(0x80 | 126);
                frame.extend(length.to_be_bytes());
            }
            Err(_) => panic!("a message of {} bytes", payload.len()),
        }
        frame.extend([0; 4]);
        frame.extend(payload);
        self.stream.write_all(&frame).expect("a server that reads");
    }

    /// The next message; `None` when the server has closed.
    pub fn next(&mut self) -> Option<Value> {
        loop {
            let Message::Text(message) = self.next_message()? else {
                continue;
            };
            // As a page that draws at once.
            if message["type"] == "now" {
                self.seen = message["n"].as_u64().expect("a number");
                self.send(&json!({"type": "seen", "n": self.seen}));
            }
            return Some(message);
        }
    }

    /// The next message of either kind; `None` when the server has closed.
    pub fn next_message(&mut self) -> Option<Message> {
        loop {
            let (opcode, payload) = self.next_frame()?;
            match opcode {
                TEXT => {
                    return Some(Message::Text(
                        serde_json::from_slice(&payload).expect("JSON"),
                    ));
                }
                BINARY => return Some(Message::Binary(payload)),
                PING => self.frame(PONG, &payload),
                CLOSE => return None,
                _ => {}
            }
        }
    }

    /// The next frame: its opcode and what is in it; `None` when the server has closed.
    fn next_frame(&mut self) -> Option<(u8, Vec<u8>)> {
        let head = self.take(2)?;
        let length = match head[1] & 0x7f {
            126 => u64::from(u16::from_be_bytes(self.take(2)?.try_into().ok()?)),
            127 => u64::from_be_bytes(self.take(8)?.try_into().ok()?),
            short => short.into(),
        };
        let payload = self.take(usize::try_from(length).expect("a length"))?;
        assert_eq!(head[0] & 0x80, 0x80, "the server sends whole messages");
        Some((head[0] & 0x0f, payload))
    }

    fn take(&mut self, count: usize) -> Option<Vec<u8>> {
        let mut buffer = [0; 16 << 10];
        while self.rest.len() < count {
            match self.stream.read(&mut buffer) {
                Ok(0) => return None,
                Ok(count) => self.rest.extend_from_slice(&buffer[..count]),
                Err(error) => match error.kind() {
                    std::io::ErrorKind::ConnectionReset => return None,
                    _ => panic!("nothing came: {error}"),
                },
            }
        }
        Some(self.rest.drain(..count).collect())
    }

    /// Reads until a message `is_it`.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut is_it: impl FnMut(&Value) -> bool) -> Value {
        let begin = std::time::Instant::now();
        let mut last = Value::Null;
        while begin.elapsed() < WATCHDOG {
            let Some(message) = self.next() else {
                panic!("the server closed before {what}; last: {last}");
            };
            if is_it(&message) {
                return message;
            }
            last = message;
        }
        panic!("no {what} came; last: {last}");
    }

    /// Reads until a message of this type.
    #[track_caller]
    pub fn until_type(&mut self, name: &str) -> Value {
        self.until(name, |message| message["type"] == name)
    }

    /// Gives an order, by what was drawn last.
    pub fn press(&mut self, order: &Value) {
        let mut order = order.clone();
        if order["seen"] == 0 {
            order["seen"] = json!(self.seen);
        }
        self.send(&order);
    }

    /// Gives an order, and reads until its report is final.
    #[track_caller]
    pub fn order(&mut self, order: &Value) -> Value {
        let number = order["order"].clone();
        self.press(order);
        self.until("the final report", |message| {
            message["type"] == "order" && message["order"] == number && message["final"] == true
        })
    }
}
