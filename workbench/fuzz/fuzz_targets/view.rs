//! Any bytes of a peer, in pieces that the input chooses, against the live view's server: as HTTP, as a page, and as a
//! Foxglove client.

#![no_main]

use std::time::Duration;

use ipc_types::MonotonicNs;
use view::page::Role;
use view::{ConnectionId, Event, Instance, Peer, Server, Settings, Token};

const UPGRADE: &str = "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
    Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: ";

/// A text that opens a page which may not order.
const OPEN: &[u8] = b"\x81\xab\0\0\0\0{\"type\":\"open\",\"robot\":1,\"rate_hz\":20.0000}";

fn server() -> Server {
    let token = Token { name: "page".into(), role: Role::Command, secret: "0123456789abcdef0123456789abcdef".into(), is_local: false };
    let settings = Settings { tokens: vec![token], ..Settings::default() };
    let mut server = Server::new(settings, Instance("life".into()));
    server.set_robots(vec![1, 2]);
    server
}

/// Writes what waits, as a kernel that takes `most` bytes.
fn write(server: &mut Server, id: ConnectionId, most: usize, now: MonotonicNs) {
    let count = server.output(id).len().min(most);
    server.sent(id, count, now);
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((how, mut rest)) = data.split_first() else {
        return;
    };
    let mut server = server();
    let mut now = MonotonicNs(1_000_000_000);
    let peer = Peer { address: ([127, 0, 0, 1], 5).into(), at: [127, 0, 0, 1].into(), is_own_user: true, is_encrypted: false };
    let Some(id) = server.accept(peer, now) else {
        return;
    };
    let protocol = match how % 3 {
        0 => None,
        1 => Some("hero.view.v1"),
        _ => Some("foxglove.sdk.v1"),
    };
    if let Some(protocol) = protocol {
        server.receive(id, format!("{UPGRADE}{protocol}\r\n\r\n").as_bytes(), now);
    }
    if how % 3 == 1 {
        server.receive(id, OPEN, now);
    }
    // Each piece begins with its length and with what happens behind it.
    while let [length, act, behind @ ..] = rest {
        let (piece, after) = behind.split_at(usize::from(*length).min(behind.len()));
        rest = after;
        server.receive(id, piece, now);
        match act % 4 {
            0 => write(&mut server, id, usize::MAX, now),
            1 => write(&mut server, id, usize::from(*act), now),
            2 => {
                now = now + Duration::from_millis(u64::from(*act) * 10);
                server.advance(now);
            }
            _ => {}
        }
        while let Some(event) = server.poll_event() {
            // It has no token.
            assert!(!matches!(event, Event::Order { .. } | Event::Check { .. }), "{event:?}");
        }
        assert!(server.deadline().is_none_or(|deadline| deadline > now));
    }
    server.closed(id, now);
    assert!(server.deadline().is_none() && !server.has_viewers());
});
