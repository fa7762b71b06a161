//! Requests, refusals, and the bounds of connections.

use std::fs;
use std::path::Path;
use std::time::Duration;

use view::page::TileRange;
use view::{
    ANSWER_TIME, Event, HEAD_TIME, IDLE_TIME, MAX_HTTP, MAX_VIEWERS, Settings, Tile, Wanted,
};

use crate::common::{WATCH, World, own, peer, settings, upgrade};

const GET: &str = "GET / HTTP/1.1\r\nHost: localhost:8765\r\n\r\n";
const NS: Duration = Duration::from_nanos(1);

fn world() -> World {
    World::new(settings())
}

#[test]
fn the_page_comes_again_and_again_on_one_connection() {
    let mut world = world();
    let mut client = world.connect(own());
    for _ in 0..3 {
        world.send(&client, GET.as_bytes());
        let answer = world.answer(&mut client);
        assert!(
            answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.contains("<!doctype html>"),
            "{answer}"
        );
        assert!(answer.contains("frame-ancestors 'none'"));
    }
    // Several in one piece are answered one after the other, whole.
    world.send(&client, format!("{GET}{GET}").as_bytes());
    assert_eq!(
        world.answer(&mut client).matches("HTTP/1.1 200 OK").count(),
        2
    );
    // A connection that says so is closed behind the answer.
    world.send(
        &client,
        b"HEAD /app.js HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
    );
    assert!(!world.server.output(client.id).is_empty());
    assert!(world.server.is_ended(client.id));
    let head = world.answer(&mut client);
    assert!(
        head.ends_with("\r\n\r\n") && head.contains("Content-Length: "),
        "{head}"
    );
    assert!(!world.server.has_viewers());
}

#[test]
fn the_report_of_a_recording_is_for_those_that_may_look_without_a_token() {
    let ask = "GET /report HTTP/1.1\r\nHost: localhost:8765\r\n\r\n";
    let replayed = |has_report| Settings {
        has_report,
        ..settings()
    };
    let mut world = World::new(replayed(true));
    let mut client = world.connect(own());
    for (bytes, status) in [(Some(b"<p>".to_vec()), "200 OK"), (None, "404 Not Found")] {
        world.send(&client, ask.as_bytes());
        let Some(Event::File {
            connection,
            request,
        }) = world.server.poll_event()
        else {
            panic!("no report is wanted");
        };
        assert_eq!(request.wanted, Wanted::Report);
        let (has_it, now) = (bytes.is_some(), world.now);
        world.server.file(connection, request, bytes, now);
        let answer = world.answer(&mut client);
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status}\r\n")),
            "{answer}"
        );
        // What a file made of it has nothing of the view's origin.
        let policy = "Content-Security-Policy: sandbox allow-scripts allow-downloads; frame-ancestors 'none'\r\n";
        assert_eq!(answer.contains(policy), has_it, "{answer}");
    }
    for (has_report, peer) in [(true, peer("127.0.0.1:5", false)), (false, own())] {
        let mut world = World::new(replayed(has_report));
        let mut client = world.connect(peer);
        world.send(&client, ask.as_bytes());
        let answer = world.answer(&mut client);
        assert!(answer.starts_with("HTTP/1.1 404 "), "{answer}");
        let event = world.server.poll_event();
        assert!(!matches!(event, Some(Event::File { .. })), "{event:?}");
    }
}

#[test]
fn metrics_are_for_those_that_may_look() {
    let token = format!("?token={WATCH}");
    let stranger = || peer("127.0.0.1:5", false);
    for (peer, query, may_look) in [
        (own(), "", true),
        (stranger(), "", false),
        (stranger(), &*token, true),
    ] {
        let mut world = world();
        let mut client = world.connect(peer);
        let ask = format!("GET /metrics{query} HTTP/1.1\r\nHost: localhost:8765\r\n\r\n");
        world.send(&client, ask.as_bytes());
        let asked = world.server.poll_event();
        if let Some(Event::File {
            connection,
            request,
        }) = asked
        {
            assert!(may_look && request.wanted == Wanted::Metrics);
            let (text, now) = (b"# EOF\n".to_vec(), world.now);
            world.server.file(connection, request, Some(text), now);
        }
        let answer = world.answer(&mut client);
        let is_given = answer.starts_with("HTTP/1.1 200 OK\r\n")
            && answer.contains("Content-Type: application/openmetrics-text; version=1.0.0");
        assert_eq!(is_given, may_look, "{answer}");
        assert_eq!(answer.starts_with("HTTP/1.1 401 "), !may_look, "{answer}");
    }
}

#[test]
fn a_tile_is_answered_when_it_was_read_and_the_connection_goes_on() {
    let tiles = TileRange {
        min_zoom: 15,
        max_zoom: 19,
    };
    let mut world = World::new(Settings {
        tiles: Some(tiles),
        ..settings()
    });
    let mut client = world.connect(own());
    let ask = "GET /tiles/18/126690/101200?3 HTTP/1.1\r\nHost: localhost:8765\r\n\r\n";
    let asked = |world: &mut World| match world.server.poll_event() {
        Some(Event::File {
            connection,
            request,
        }) => Some((connection, request)),
        _ => None,
    };
    let png = b"\x89PNG\r\n\x1a\n...".to_vec();
    for (image, status, kind) in [
        (Some(png.clone()), "200 OK", "image/png"),
        (None, "404 Not Found", ""),
        (Some(b"<svg>".to_vec()), "404 Not Found", ""),
    ] {
        // A second request waits for the answer to the first.
        world.send(&client, format!("{ask}{GET}").as_bytes());
        let (connection, request) = asked(&mut world).expect("a tile");
        let tile = Tile {
            zoom: 18,
            x: 126_690,
            y: 101_200,
        };
        assert_eq!(
            (connection, request.wanted),
            (client.id, Wanted::Tile(tile))
        );
        assert_eq!(world.answer(&mut client), "");
        assert!(asked(&mut world).is_none());
        // It does not count as idle meanwhile.
        world.pass(IDLE_TIME * 2);
        assert!(!world.server.is_ended(client.id));
        let now = world.now;
        world.server.file(connection, request, image, now);
        let answer = world.answer(&mut client);
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status}\r\n")),
            "{answer}"
        );
        assert!(answer.contains(kind), "{answer}");
        assert!(answer.ends_with("</html>\n"), "the page follows: {answer}");
        // An answer that comes twice, or too late, goes nowhere.
        world
            .server
            .file(connection, request, Some(png.clone()), now);
        assert_eq!(world.answer(&mut client), "");
    }
    let head = ask.replace("GET ", "HEAD ");
    world.send(&client, head.as_bytes());
    let (connection, request) = asked(&mut world).expect("a tile");
    let now = world.now;
    world
        .server
        .file(connection, request, Some(png.clone()), now);
    let answer = world.answer(&mut client);
    assert!(
        answer.contains("Content-Length: 11\r\n") && answer.ends_with("\r\n\r\n"),
        "{answer}"
    );
    // What is no tile, and a server without any.
    for (path, has_tiles) in [
        ("/tiles/18/1/x", true),
        ("/tiles/24/1/1", true),
        ("/tiles/18/1/1", false),
    ] {
        let mut world = World::new(Settings {
            tiles: has_tiles.then_some(tiles),
            ..settings()
        });
        let mut client = world.connect(own());
        world.send(
            &client,
            format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes(),
        );
        assert!(
            world.answer(&mut client).starts_with("HTTP/1.1 404 "),
            "{path}"
        );
        assert!(asked(&mut world).is_none(), "{path}");
    }
}

/// What lies beside the files that are served: for tests, for those who read, and for the report, which is one file.
const NOT_SERVED: [&str; 4] = ["protocol.d.ts", "report/", "vendor/vendor.toml", "test/"];

fn files(folder: &Path, prefix: &str, found: &mut Vec<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_str().unwrap());
        match path.is_dir() {
            true => files(&path, &format!("{name}/"), found),
            false => found.push(name),
        }
    }
}

#[test]
fn all_files_of_the_page_are_served_with_their_kind_and_bytes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("page");
    let mut found = Vec::new();
    files(&folder, "", &mut found);
    assert!(found.len() > 20);
    let mut world = world();
    for name in found {
        let mut client = world.connect(own());
        world.send(
            &client,
            format!("GET /{name} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes(),
        );
        let answer = world.answer(&mut client);
        let is_served = !NOT_SERVED.iter().any(|not| name.starts_with(not));
        assert_eq!(answer.starts_with("HTTP/1.1 200 "), is_served, "{name}");
        let kind = match name.rsplit_once('.').unwrap().1 {
            _ if !is_served => "text/plain",
            "html" => "text/html",
            "js" => "text/javascript",
            "css" => "text/css",
            "svg" => "image/svg+xml",
            _ => "text/plain",
        };
        assert!(answer.contains(&format!("Content-Type: {kind}")), "{name}");
        let file = fs::read_to_string(folder.join(&name)).unwrap();
        assert_eq!(answer.ends_with(&file), is_served, "{name}");
        world.server.closed(client.id, world.now);
    }
}

#[test]
fn a_request_is_the_same_however_its_bytes_are_cut() {
    let bytes = upgrade("/", "hero.view.v1", "Origin: http://localhost:8765\r\n");
    let mut all = Vec::new();
    let mut world = world();
    for at in 0..=bytes.len() {
        let mut client = world.connect(own());
        world.send(&client, &bytes[..at]);
        world.send(&client, &bytes[at..]);
        all.push(world.answer(&mut client));
        world.server.closed(client.id, world.now);
    }
    all.dedup();
    assert_eq!(all.len(), 1);
    assert!(all[0].contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{all:?}");
}

#[test]
fn what_may_not_be_asked_for_is_refused_with_its_code_and_ends() {
    let host = "Host: localhost:8765\r\n";
    let get = |lines: &str| format!("GET / HTTP/1.1\r\n{lines}\r\n").into_bytes();
    let page = |lines: &str| upgrade("/", "hero.view.v1", lines);
    let cases = [
        (get("Host: evil.example:8765\r\n"), 403),
        (get(&format!("{host}Origin: http://evil.example\r\n")), 403),
        (get(&format!("{host}Origin: null\r\n")), 403),
        (page("Origin: http://localhost:3000\r\n"), 403),
        (page("Origin: null\r\n"), 403),
        // Host and Origin come first: a stranger does not learn what there is.
        (
            b"DELETE /nothing HTTP/1.1\r\nHost: evil.example\r\n\r\n".to_vec(),
            403,
        ),
        (upgrade("/nothing", "x", "Origin: null\r\n"), 403),
        (b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec(), 405),
        (
            b"GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec(),
            404,
        ),
        (
            b"GET /%2e%2e/secret HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec(),
            404,
        ),
        (get(""), 400),
        (get(&format!("{host}Content-Length: 5\r\n")), 400),
        (b"\x16\x03\x01\x02\x00\x01".to_vec(), 400),
        (get(&format!("{host}X: {}\r\n", "x".repeat(9000))), 431),
        (upgrade("/other", "hero.view.v1", ""), 404),
        (upgrade("/", "chat", ""), 400),
        (
            String::from_utf8(page(""))
                .unwrap()
                .replace("Version: 13", "Version: 12")
                .into_bytes(),
            426,
        ),
    ];
    for (bytes, code) in cases {
        let mut world = world();
        let mut client = world.connect(own());
        world.send(&client, &bytes);
        let sent = String::from_utf8_lossy(&bytes).into_owned();
        let answer = world.answer(&mut client);
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {code} ")),
            "{sent}: {answer}"
        );
        assert!(world.server.is_ended(client.id), "{sent}");
        let events = world.events();
        assert!(
            matches!(events[..], [Event::Rejected { count: 1, .. }]),
            "{sent}: {events:?}"
        );
        // What comes behind is not read.
        world.send(&client, GET.as_bytes());
        assert_eq!(world.answer(&mut client), "");
    }
}

#[test]
fn who_comes_from_where_may_connect() {
    let far = peer("10.0.0.9:50000", false);
    for (from, line, works) in [
        (own(), "", true),
        (own(), "Origin: http://localhost:8765\r\n", true),
        (own(), "Origin: https://studio.example\r\n", true),
        (own(), "Origin: file://\r\n", true),
        (far.clone(), "Origin: file://\r\n", false),
        (far, "", true),
    ] {
        let mut world = world();
        let mut client = world.connect(from);
        world.send(&client, &upgrade("/", "hero.view.v1", line));
        let answer = world.answer(&mut client);
        assert_eq!(
            answer.starts_with("HTTP/1.1 101 "),
            works,
            "{line}: {answer}"
        );
    }
}

#[test]
fn the_subprotocol_is_the_best_that_is_offered() {
    for (offered, taken) in [
        ("hero.view.v1", "hero.view.v1"),
        ("foxglove.websocket.v1", "foxglove.websocket.v1"),
        ("foxglove.websocket.v1, foxglove.sdk.v1", "foxglove.sdk.v1"),
        ("foxglove.sdk.v1, hero.view.v1", "hero.view.v1"),
        ("foxglove.sdk.v1.1, foxglove.sdk.v1", "foxglove.sdk.v1"),
    ] {
        let mut world = world();
        let mut client = world.connect(own());
        world.send(&client, &upgrade("/", offered, ""));
        let head = world.upgraded(&mut client);
        assert!(
            head.contains(&format!("Sec-WebSocket-Protocol: {taken}\r\n")),
            "{offered}: {head}"
        );
    }
}

#[test]
fn connections_that_do_nothing_end_in_time() {
    let mut world = world();
    let idle = world.connect(own());
    let mut begun = world.connect(own());
    world.send(&begun, b"GET /");
    assert_eq!(world.server.deadline(), Some(world.now + IDLE_TIME));
    world.pass(IDLE_TIME - NS);
    assert!(!world.server.is_ended(idle.id));
    world.pass(NS);
    assert!(world.server.is_ended(idle.id) && world.server.output(idle.id).is_empty());
    world.server.closed(idle.id, world.now);
    // A byte now and then does not put the end of a head off.
    world.pass(HEAD_TIME - IDLE_TIME - NS);
    world.send(&begun, b"x");
    assert!(!world.server.is_ended(begun.id));
    world.pass(NS);
    let answer = world.answer(&mut begun);
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    assert!(world.server.is_ended(begun.id));

    // One that does not read its answer, and one that does not read why it was refused.
    let slow = world.connect(own());
    world.send(&slow, GET.as_bytes());
    let mut refused = world.connect(own());
    world.send(&refused, b"BAD\r\n\r\n");
    assert_eq!(world.write(&mut refused, 10), 10);
    world.pass(ANSWER_TIME - NS);
    assert!(
        !world.server.output(slow.id).is_empty() && !world.server.output(refused.id).is_empty()
    );
    world.pass(NS);
    for client in [slow, refused] {
        assert!(world.server.is_ended(client.id) && world.server.output(client.id).is_empty());
    }
}

#[test]
fn at_the_bound_the_one_that_is_idle_longest_goes() {
    let mut world = world();
    let mut clients = Vec::new();
    for _ in 0..MAX_HTTP {
        clients.push(world.connect(own()));
        world.pass_ms(1);
    }
    // The first one is busy, so the second goes.
    world.send(&clients[0], b"GET");
    let more = world.connect(own());
    let ended: Vec<bool> = clients
        .iter()
        .map(|one| world.server.is_ended(one.id))
        .collect();
    assert_eq!(ended.iter().filter(|ended| **ended).count(), 1);
    assert!(ended[1] && !world.server.is_ended(more.id));
    // If all are busy, the new one is refused.
    for client in clients.iter().chain([&more]) {
        world.send(client, b"GET");
    }
    assert!(world.server.accept(own(), world.now).is_none());
    // One that does not read why it was refused makes room, too.
    world.send(&more, b"\0");
    assert!(!world.server.output(more.id).is_empty());
    assert!(world.server.accept(own(), world.now).is_some());
    assert!(world.server.output(more.id).is_empty());
}

#[test]
fn viewers_have_a_bound_of_their_own() {
    let mut world = world();
    let mut viewers: Vec<_> = (0..MAX_VIEWERS)
        .map(|index| world.page(None, index as u32 % 2))
        .collect();
    let mut more = world.connect(own());
    world.send(&more, &upgrade("/", "foxglove.sdk.v1", ""));
    let answer = world.answer(&mut more);
    assert!(answer.starts_with("HTTP/1.1 503 "), "{answer}");
    // The page can be loaded meanwhile, and says why there is no contact.
    let mut plain = world.connect(own());
    world.send(&plain, GET.as_bytes());
    assert!(world.answer(&mut plain).starts_with("HTTP/1.1 200 "));
    let gone = viewers.pop().unwrap();
    world.server.closed(gone.id, world.now);
    // One that does not say what it wants makes room for others.
    let mut mute = world.viewer(own(), "/", "hero.view.v1");
    world.viewer(own(), "/", "foxglove.sdk.v1");
    assert_eq!(world.close_code(&mut mute), Some(1008));
}

#[test]
fn rejections_are_said_at_each_doubling() {
    let mut world = world();
    let mut counts = Vec::new();
    for _ in 0..20 {
        let client = world.connect(own());
        world.send(&client, b"\0");
        world.server.closed(client.id, world.now);
        counts.extend(world.events().into_iter().map(|event| match event {
            Event::Rejected { count, from, .. } => {
                assert_eq!(from, "127.0.0.1:50000");
                count
            }
            other => panic!("{other:?}"),
        }));
    }
    assert_eq!(counts, [1, 2, 4, 8, 16]);
}

#[test]
fn nothing_is_due_without_connections() {
    let mut world = World::new(Settings::default());
    assert_eq!(world.server.deadline(), None);
    let client = world.connect(own());
    assert!(world.server.deadline().is_some());
    world.server.closed(client.id, world.now);
    assert_eq!(world.server.deadline(), None);
    // What is not there does nothing.
    world.server.closed(client.id, world.now);
    world.send(&client, GET.as_bytes());
    world.server.sent(client.id, 5, world.now);
    assert!(world.server.output(client.id).is_empty() && world.server.is_ended(client.id));
}
