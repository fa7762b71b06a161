//! [`RequestReader`]: the heads of requests out of bytes that come in any pieces. There are no bodies.

use httparse::{EMPTY_HEADER, Header, Status};

use super::refusal::Refusal;

/// Most bytes of a head; one that is longer is refused. Browsers send 0.5 to 1 kB to a server without cookies.
pub const MAX_HEAD_BYTES: usize = 8 << 10;

/// Most header lines of a head; one that has more is refused. Browsers send about 20.
const MAX_HEADERS: usize = 64;

/// Most bytes that wait while an answer is written: a head and what came with it in one piece. A browser waits for its
/// answer before it asks again, so a client that sends more is closed.
const MAX_WAITING_BYTES: usize = 2 * MAX_HEAD_BYTES + (16 << 10);

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Get,
    Head,
    /// Anything else, which is refused.
    Other,
}

/// A request to become a WebSocket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Upgrade {
    pub key: String,
    /// The subprotocols that the client offers, in its order.
    pub protocols: Vec<String>,
}

/// A head that was read. What it means is judged elsewhere, Host and Origin first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HttpRequest {
    pub method: Method,
    /// Without the query.
    pub path: String,
    /// The value of `token` in the query.
    pub token: Option<String>,
    pub host: String,
    pub origin: Option<String>,
    pub if_none_match: Option<String>,
    /// Whether the connection stays after the answer.
    pub stays: bool,
    /// `None` if a file is asked for; else how, or why that cannot be.
    pub upgrade: Option<Result<Upgrade, Refusal>>,
}

/// Reads the heads of requests out of bytes that come in any pieces.
#[derive(Debug, Default)]
pub struct RequestReader {
    waiting: Vec<u8>,
}

impl RequestReader {
    /// Takes bytes. False if more wait than may.
    pub fn receive(&mut self, bytes: &[u8]) -> bool {
        self.waiting.extend_from_slice(bytes);
        self.waiting.len() <= MAX_WAITING_BYTES
    }

    /// Whether a part of a head has come.
    pub fn has_begun(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Gives the bytes behind the last head.
    pub fn take_rest(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.waiting)
    }

    /// The next request, if its head is complete. After a refusal the bytes mean nothing any more.
    pub fn next(&mut self) -> Option<Result<HttpRequest, Refusal>> {
        if self.waiting.is_empty() {
            return None;
        }
        let head = &self.waiting[..self.waiting.len().min(MAX_HEAD_BYTES)];
        let mut headers = [EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Request::new(&mut headers);
        match parsed.parse(head) {
            Ok(Status::Complete(length)) => {
                let request = read(&parsed);
                self.waiting.drain(..length);
                Some(request)
            }
            Ok(Status::Partial) if head.len() == MAX_HEAD_BYTES => Some(Err(Refusal::TooLarge)),
            Ok(Status::Partial) => None,
            Err(httparse::Error::TooManyHeaders) => Some(Err(Refusal::TooLarge)),
            Err(_) => Some(Err(Refusal::Malformed)),
        }
    }
}

/// All values of a header.
fn values<'a>(
    headers: &'a [Header<'_>],
    name: &'a str,
) -> impl Iterator<Item = Result<&'a str, Refusal>> {
    headers
        .iter()
        .filter(move |header| header.name.eq_ignore_ascii_case(name))
        .map(|header| std::str::from_utf8(header.value).map_err(|_| Refusal::Malformed))
}

/// The value of a header that may be there once.
fn value(headers: &[Header<'_>], name: &str) -> Result<Option<String>, Refusal> {
    let mut values = values(headers, name);
    let first = values.next().transpose()?;
    match values.next() {
        None => Ok(first.map(str::to_owned)),
        Some(_) => Err(Refusal::Malformed),
    }
}

/// The items of a header that is a list, and may be there several times.
fn items<'a>(headers: &'a [Header<'_>], name: &'a str) -> Result<Vec<&'a str>, Refusal> {
    let mut items = Vec::new();
    for value in values(headers, name) {
        items.extend(
            value?
                .split(',')
                .map(str::trim)
                .filter(|item| !item.is_empty()),
        );
    }
    Ok(items)
}

fn read(parsed: &httparse::Request<'_, '_>) -> Result<HttpRequest, Refusal> {
    let headers = &*parsed.headers;
    let has_body = values(headers, "transfer-encoding").next().is_some()
        || !matches!(
            value(headers, "content-length")?.as_deref(),
            None | Some("0")
        );
    let target = parsed.path.unwrap_or_default();
    // An absolute target is for proxies, and would be a second Host.
    if has_body || !target.starts_with('/') {
        return Err(Refusal::Malformed);
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let token = query
        .split('&')
        .find_map(|pair| pair.strip_prefix("token="));
    let connection = items(headers, "connection")?;
    let has = |word: &str| {
        connection
            .iter()
            .any(|item| item.eq_ignore_ascii_case(word))
    };
    let upgrades = has("upgrade") && !items(headers, "upgrade")?.is_empty();
    Ok(HttpRequest {
        method: match parsed.method {
            Some("GET") => Method::Get,
            Some("HEAD") => Method::Head,
            _ => Method::Other,
        },
        path: path.to_owned(),
        token: token.map(str::to_owned),
        host: value(headers, "host")?.ok_or(Refusal::Malformed)?,
        origin: value(headers, "origin")?,
        if_none_match: value(headers, "if-none-match")?,
        stays: parsed.version == Some(1) && !has("close"),
        upgrade: upgrades.then(|| upgrade(parsed)),
    })
}

fn upgrade(parsed: &httparse::Request<'_, '_>) -> Result<Upgrade, Refusal> {
    let headers = &*parsed.headers;
    let to = items(headers, "upgrade")?;
    let is_web_socket = to.iter().any(|item| item.eq_ignore_ascii_case("websocket"));
    if !is_web_socket || parsed.method != Some("GET") || parsed.version != Some(1) {
        return Err(Refusal::Malformed);
    }
    if value(headers, "sec-websocket-version")?.as_deref() != Some("13") {
        return Err(Refusal::OtherVersion);
    }
    let key = value(headers, "sec-websocket-key")?.ok_or(Refusal::Malformed)?;
    let is_base64 = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/');
    // 16 bytes in Base64.
    let digits = key.strip_suffix("==").filter(|digits| digits.len() == 22);
    if !digits.is_some_and(|digits| digits.bytes().all(is_base64)) {
        return Err(Refusal::Malformed);
    }
    let protocols = items(headers, "sec-websocket-protocol")?;
    Ok(Upgrade {
        key,
        protocols: protocols.into_iter().map(str::to_owned).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "dGhlIHNhbXBsZSBub25jZQ==";

    fn one(text: &str) -> Option<Result<HttpRequest, Refusal>> {
        let mut reader = RequestReader::default();
        assert!(reader.receive(text.as_bytes()));
        reader.next()
    }

    #[test]
    fn a_head_is_read_as_it_is_written() {
        let text = "GET /a/b.js?x=1&token=abc HTTP/1.1\r\nhOsT: localhost:8765\r\nOrigin: http://localhost:8765\r\n\
            If-None-Match: \"1\", \"2\"\r\nConnection: keep-alive\r\n\r\n";
        let expected = HttpRequest {
            method: Method::Get,
            path: "/a/b.js".into(),
            token: Some("abc".into()),
            host: "localhost:8765".into(),
            origin: Some("http://localhost:8765".into()),
            if_none_match: Some("\"1\", \"2\"".into()),
            stays: true,
            upgrade: None,
        };
        assert_eq!(one(text), Some(Ok(expected.clone())));
        // Cut at each place, it is the same.
        for at in 1..text.len() {
            let mut reader = RequestReader::default();
            reader.receive(&text.as_bytes()[..at]);
            assert_eq!(reader.next(), None, "{at}");
            reader.receive(&text.as_bytes()[at..]);
            assert_eq!(reader.next(), Some(Ok(expected.clone())), "{at}");
            assert!(!reader.has_begun());
        }
        // Two in one piece are two.
        let mut reader = RequestReader::default();
        reader.receive(format!("{text}{text}rest").as_bytes());
        assert_eq!(reader.next(), Some(Ok(expected.clone())));
        assert_eq!(reader.next(), Some(Ok(expected)));
        assert_eq!(reader.take_rest(), b"rest");
    }

    #[test]
    fn heads_that_mean_nothing_are_refused() {
        let host = "Host: localhost\r\n";
        for (text, refusal) in [
            ("GET / HTTP/1.1\r\n\r\n".to_owned(), Refusal::Malformed),
            (
                format!("GET / HTTP/1.1\r\n{host}{host}\r\n"),
                Refusal::Malformed,
            ),
            (
                format!("GET / HTTP/1.1\r\n{host}Origin: a\r\nOrigin: a\r\n\r\n"),
                Refusal::Malformed,
            ),
            (
                format!("GET http://localhost/ HTTP/1.1\r\n{host}\r\n"),
                Refusal::Malformed,
            ),
            (
                format!("OPTIONS * HTTP/1.1\r\n{host}\r\n"),
                Refusal::Malformed,
            ),
            (format!("GET / HTTP/2.0\r\n{host}\r\n"), Refusal::Malformed),
            (
                format!("GET / HTTP/1.1\r\n{host}Content-Length: 1\r\n\r\n"),
                Refusal::Malformed,
            ),
            (
                format!("GET / HTTP/1.1\r\n{host}Content-Length: 0\r\nContent-Length: 0\r\n\r\n"),
                Refusal::Malformed,
            ),
            (
                format!("GET / HTTP/1.1\r\n{host}Transfer-Encoding: chunked\r\n\r\n"),
                Refusal::Malformed,
            ),
            (
                format!("GET / HTTP/1.1\r\n{host}Bad Name: 1\r\n\r\n"),
                Refusal::Malformed,
            ),
            ("\u{16}\u{3}\u{1}".to_owned(), Refusal::Malformed),
            (
                format!("GET / HTTP/1.1\r\n{}", "A: b\r\n".repeat(MAX_HEADERS + 1)),
                Refusal::TooLarge,
            ),
        ] {
            assert_eq!(one(&text), Some(Err(refusal)), "{text}");
        }
        let mut reader = RequestReader::default();
        reader.receive(b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\n\r\n");
        assert_eq!(reader.next(), Some(Err(Refusal::Malformed)));
    }

    #[test]
    fn a_head_may_have_8_kib() {
        let padded = |bytes: usize| {
            let head = "GET / HTTP/1.1\r\nHost: localhost\r\nX: ";
            format!("{head}{}\r\n\r\n", "x".repeat(bytes - head.len() - 4))
        };
        assert!(matches!(one(&padded(MAX_HEAD_BYTES)), Some(Ok(_))));
        assert_eq!(
            one(&padded(MAX_HEAD_BYTES + 1)),
            Some(Err(Refusal::TooLarge))
        );
        let mut reader = RequestReader::default();
        assert!(reader.receive(&vec![b'x'; MAX_WAITING_BYTES]));
        assert!(!reader.receive(b"x"));
    }

    #[test]
    fn upgrades_are_those_of_web_sockets() {
        let head = |lines: &str| format!("GET / HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n");
        let ask = "Connection: keep-alive, Upgrade\r\nUpgrade: websocket\r\n";
        let version = "Sec-WebSocket-Version: 13\r\n";
        let key = format!("Sec-WebSocket-Key: {KEY}\r\n");
        let upgrade = |text: &str| one(text).unwrap().unwrap().upgrade;
        let protocols = "Sec-WebSocket-Protocol: a, b\r\nSec-WebSocket-Protocol: c\r\n";
        let expected = Upgrade {
            key: KEY.into(),
            protocols: vec!["a".into(), "b".into(), "c".into()],
        };
        assert_eq!(
            upgrade(&head(&format!("{ask}{version}{key}{protocols}"))),
            Some(Ok(expected))
        );
        assert_eq!(upgrade(&head("Upgrade: websocket\r\n")), None);
        assert_eq!(upgrade(&head("Connection: Upgrade\r\n")), None);
        for (lines, refusal) in [
            (format!("{ask}{key}"), Refusal::OtherVersion),
            (
                format!("{ask}{key}Sec-WebSocket-Version: 8\r\n"),
                Refusal::OtherVersion,
            ),
            (format!("{ask}{version}"), Refusal::Malformed),
            (format!("{ask}{version}{key}{key}"), Refusal::Malformed),
            (
                format!("{ask}{version}Sec-WebSocket-Key: short==\r\n"),
                Refusal::Malformed,
            ),
            (
                format!(
                    "{ask}{version}Sec-WebSocket-Key: {}\r\n",
                    KEY.replace('G', "-")
                ),
                Refusal::Malformed,
            ),
            (
                format!("Connection: Upgrade\r\nUpgrade: h2c\r\n{version}{key}"),
                Refusal::Malformed,
            ),
        ] {
            assert_eq!(upgrade(&head(&lines)), Some(Err(refusal)), "{lines}");
        }
        let old = head(&format!("{ask}{version}{key}")).replace("HTTP/1.1", "HTTP/1.0");
        assert_eq!(upgrade(&old), Some(Err(Refusal::Malformed)));
    }

    #[test]
    fn the_connection_stays_unless_one_side_says_otherwise() {
        for (line, version, stays) in [
            ("", "1.1", true),
            ("Connection: close\r\n", "1.1", false),
            ("Connection: keep-alive, CLOSE\r\n", "1.1", false),
            ("", "1.0", false),
        ] {
            let text = format!("HEAD / HTTP/{version}\r\nHost: localhost\r\n{line}\r\n");
            let request = one(&text).unwrap().unwrap();
            assert_eq!(
                (request.stays, request.method),
                (stays, Method::Head),
                "{line}"
            );
        }
    }
}
