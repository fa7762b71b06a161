//! [`Response`]: what a request gets. All texts are fixed, but for the page's files, tiles, and the name by which the
//! server was called.

use tungstenite::Bytes;
use tungstenite::handshake::derive_accept_key;

use super::refusal::{GUARDS, Refusal};
use super::request::{HttpRequest, Method, Upgrade};
use super::tile::{FileRequest, Wanted, content_type};
use crate::assets::Assets;
use crate::metrics;

/// What is written.
#[derive(Debug)]
pub struct Response {
    pub head: String,
    pub body: Bytes,
    /// Whether the connection stays.
    pub stays: bool,
}

impl Response {
    /// The file that is asked for, or that the browser has it already.
    pub fn file(
        request: &HttpRequest,
        assets: &Assets,
        is_encrypted: bool,
    ) -> Result<Response, Refusal> {
        if request.method == Method::Other {
            return Err(Refusal::OtherMethod);
        }
        let (asset, tag) = assets.find(&request.path).ok_or(Refusal::NotFound)?;
        let known = request.if_none_match.as_deref().unwrap_or_default();
        let has_it = known.split(',').any(|one| {
            let one = one.trim();
            one == "*" || one.strip_prefix("W/").unwrap_or(one) == tag
        });
        let status = if has_it { "304 Not Modified" } else { "200 OK" };
        let connection = if request.stays { "keep-alive" } else { "close" };
        // Older Safari does not take 'self' for WebSockets. The Host has been checked, so it has no characters of this
        // policy.
        let (scheme, host) = (if is_encrypted { "wss" } else { "ws" }, &request.host);
        let mut head = format!(
            "HTTP/1.1 {status}\r\nConnection: {connection}\r\nCache-Control: no-cache\r\nETag: {tag}\r\n\
             Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
             connect-src 'self' {scheme}://{host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n{GUARDS}"
        );
        if !has_it {
            let (kind, length) = (asset.content_type, asset.bytes.len());
            head.push_str(&format!(
                "Content-Type: {kind}\r\nContent-Length: {length}\r\n"
            ));
        }
        head.push_str("\r\n");
        let has_body = !has_it && request.method == Method::Get;
        Ok(Response {
            head,
            body: Bytes::from_static(if has_body { asset.bytes } else { &[] }),
            stays: request.stays,
        })
    }

    /// What was read, or that it is missing. A browser keeps a tile for an hour, and asks again for one that is
    /// missing. The browser gives a report an origin of its own: whatever a recording has brought into it, its script
    /// reads nothing of the view.
    pub fn read(request: FileRequest, bytes: Option<Vec<u8>>) -> Response {
        let kind = match (request.wanted, &bytes) {
            (_, None) => None,
            (Wanted::Tile(_), Some(image)) => content_type(image)
                .map(|kind| format!("Cache-Control: max-age=3600\r\nContent-Type: {kind}\r\n")),
            (Wanted::Report, Some(_)) => Some(
                "Cache-Control: no-store\r\nContent-Type: text/html; charset=utf-8\r\n\
                 Content-Security-Policy: sandbox allow-scripts allow-downloads; frame-ancestors 'none'\r\n"
                    .to_owned(),
            ),
            (Wanted::Metrics, Some(_)) => Some(format!(
                "Cache-Control: no-store\r\nContent-Type: {}\r\n",
                metrics::CONTENT_TYPE
            )),
        };
        let connection = if request.stays { "keep-alive" } else { "close" };
        let body = bytes.filter(|_| kind.is_some()).unwrap_or_default();
        let length = body.len();
        let head = match kind {
            Some(kind) => format!("HTTP/1.1 200 OK\r\nConnection: {connection}\r\n{kind}"),
            None => format!(
                "HTTP/1.1 404 Not Found\r\nConnection: {connection}\r\nCache-Control: no-store\r\n"
            ),
        };
        Response {
            head: format!("{head}{GUARDS}Content-Length: {length}\r\n\r\n"),
            body: if request.has_body {
                body.into()
            } else {
                Bytes::new()
            },
            stays: request.stays,
        }
    }

    /// From here on it is a WebSocket.
    pub fn upgraded(upgrade: &Upgrade, protocol: &str) -> Response {
        let accept = derive_accept_key(upgrade.key.as_bytes());
        let head = format!(
            "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Accept: {accept}\r\nSec-WebSocket-Protocol: {protocol}\r\n\r\n"
        );
        Response {
            head,
            body: Bytes::new(),
            stays: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::request::RequestReader;

    fn request(lines: &str) -> HttpRequest {
        let mut reader = RequestReader::default();
        reader.receive(format!("{lines}\r\nHost: localhost:1\r\n\r\n").as_bytes());
        reader.next().unwrap().unwrap()
    }

    #[test]
    fn files_come_whole_or_not_at_all_if_the_browser_has_them() {
        let assets = Assets::new();
        let file = |lines: &str| Response::file(&request(lines), &assets, false);
        let (_, tag) = assets.find("/app.js").unwrap();
        let answer = file("GET /app.js HTTP/1.1").unwrap();
        assert!(
            answer.head.starts_with("HTTP/1.1 200 OK\r\n"),
            "{}",
            answer.head
        );
        for line in [
            &format!("ETag: {tag}\r\n"),
            &format!("Content-Length: {}\r\n", answer.body.len()),
            "Cache-Control: no-cache\r\n",
            "Content-Type: text/javascript; charset=utf-8\r\n",
            "default-src 'none'",
            "frame-ancestors 'none'",
            "connect-src 'self' ws://localhost:1;",
            "Referrer-Policy: no-referrer\r\n",
        ] {
            assert!(answer.head.contains(line), "{line}: {}", answer.head);
        }
        assert!(!answer.body.is_empty());
        let head = file("HEAD /app.js HTTP/1.1").unwrap();
        assert_eq!((head.head, head.body.len()), (answer.head, 0));
        for (given, is_known) in [
            (tag.to_owned(), true),
            (format!("W/{tag}"), true),
            (format!("\"x\", {tag}"), true),
            ("*".to_owned(), true),
            ("\"x\"".to_owned(), false),
            (tag.trim_matches('"').to_owned(), false),
        ] {
            let answer = file(&format!("GET /app.js HTTP/1.1\r\nIf-None-Match: {given}")).unwrap();
            assert_eq!(answer.head.contains(" 304 "), is_known, "{given}");
            assert_eq!(answer.body.is_empty(), is_known, "{given}");
        }
        assert_eq!(
            file("GET /../secret HTTP/1.1").unwrap_err(),
            Refusal::NotFound
        );
        assert_eq!(file("POST / HTTP/1.1").unwrap_err(), Refusal::OtherMethod);
        let encrypted = Response::file(&request("GET / HTTP/1.1"), &assets, true).unwrap();
        assert!(encrypted.head.contains("wss://localhost:1;"));
    }

    #[test]
    fn an_upgrade_is_answered_with_the_hash_of_its_key() {
        let upgrade = Upgrade {
            key: "dGhlIHNhbXBsZSBub25jZQ==".into(),
            protocols: vec![],
        };
        let answer = Response::upgraded(&upgrade, "hero.view.v1");
        // The example of RFC 6455.
        assert!(
            answer
                .head
                .contains("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n")
        );
        assert!(
            answer
                .head
                .ends_with("Sec-WebSocket-Protocol: hero.view.v1\r\n\r\n")
        );
    }
}
