//! Messages between relays, byte by byte as docs/network.md has them: derived by hand from the document.

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use relay::message::Part;
use relay::message::{
    Ask, MAX_BYTES, NoMessage, Ping, Pong, Reply, SampleHeader, VERSION, decode, encode,
};
use relay::orders::message::{Answer, Order};

/// 300 as a varint: the lowest seven bits first, with the highest bit while more follow.
const THREE_HUNDRED: [u8; 2] = [0xAC, 0x02];

#[test]
fn a_ping_is_a_version_a_variant_and_six_fields() {
    let ping = Ask::Ping(Ping {
        station_instance: 1,
        sent_ns: 300,
        suspended_ns: 0,
        wants_latest: true,
        has_all: false,
        late_ms: Some(300),
    });
    let bytes = [
        &[VERSION, 0, 1][..],
        &THREE_HUNDRED,
        &[0, 1, 0, 1],
        &THREE_HUNDRED,
    ]
    .concat();
    assert_eq!(encode(&ping), bytes);
    assert_eq!(decode::<Ask>(&bytes), Ok(ping));
    let describe = Ask::Describe {
        robot_instance: 127,
        index: 128,
        from: 300,
    };
    let bytes = [&[VERSION, 1, 127, 0x80, 0x01][..], &THREE_HUNDRED].concat();
    assert_eq!(encode(&describe), bytes);
}

#[test]
fn a_sample_header_is_four_numbers() {
    let header = SampleHeader {
        robot_instance: u64::MAX,
        number: 2,
        left_out: 300,
        lost: 0,
    };
    let instance = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x01];
    assert_eq!(
        encode(&header),
        [&[VERSION][..], &instance, &[2], &THREE_HUNDRED, &[0]].concat()
    );
}

#[test]
fn an_order_ends_with_the_length_and_the_bytes_of_its_request() {
    let order = Order {
        session: 1,
        number: 2,
        floor: 3,
        service: 4,
        expires: MonotonicNs(300),
        is_repeat: true,
        is_given_up: false,
        request: vec![9, 8, 7],
    };
    let bytes = [
        &[VERSION, 1, 2, 3, 4][..],
        &THREE_HUNDRED,
        &[1, 0, 3, 9, 8, 7],
    ]
    .concat();
    assert_eq!(encode(&order), bytes);
    assert_eq!(decode(&bytes), Ok(order));
}

#[test]
fn what_a_robot_tells_has_four_variants() {
    let pong = Reply::Pong(Pong {
        robot_instance: 1,
        station_instance: 2,
        ping_sent_ns: 3,
        ping_suspended_ns: 4,
        received_ns: 5,
        sent_ns: 6,
        suspended_ns: 7,
        session: 8,
        pages: 9,
    });
    assert_eq!(encode(&pong), [VERSION, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    let part = Reply::Part(Part {
        robot_instance: 1,
        index: 2,
        page_bytes: 300,
        from: 4,
        bytes: b"x".to_vec(),
    });
    assert_eq!(
        encode(&part),
        [&[VERSION, 1, 1, 2][..], &THREE_HUNDRED, &[4, 1], b"x"].concat()
    );
    let report = RequestReport::new(Stage::Done, Reason::None);
    let answer = Answer {
        session: 1,
        number: 2,
        serial: 3,
        report,
    };
    let bytes = encode(&Reply::Answer(answer));
    // 160 as a varint.
    assert_eq!(bytes[..7], [VERSION, 2, 1, 2, 3, 0xA0, 0x01]);
    assert_eq!(bytes.len(), 7 + 160);
    let Ok(Reply::Answer(read)) = decode(&bytes) else {
        panic!("it is an answer");
    };
    assert_eq!(read, answer);
    let short = [&[VERSION, 2, 1, 2, 3, 159, 1][..], &bytes[7..166]].concat();
    assert!(matches!(
        decode::<Reply>(&short),
        Err(NoMessage::Contents(_))
    ));
    assert_eq!(encode(&Reply::UnknownSession(5)), [VERSION, 3, 5]);
}

#[test]
fn what_is_no_message_is_an_error() {
    assert_eq!(decode::<Ask>(&[]), Err(NoMessage::Length(0)));
    assert_eq!(decode::<Ask>(&[1, 0]), Err(NoMessage::Version(1)));
    assert_eq!(
        decode::<Ask>(&vec![1; MAX_BYTES + 1]),
        Err(NoMessage::Length(MAX_BYTES + 1))
    );
    for bytes in [
        &[VERSION][..],
        &[VERSION, 2],
        &[VERSION, 0, 1],
        &[VERSION, 3, 5, 0],
    ] {
        assert!(
            matches!(decode::<Ask>(bytes), Err(NoMessage::Contents(_))),
            "{bytes:?}"
        );
    }
    assert!(
        matches!(
            decode::<Reply>(&[VERSION, 3, 5, 0]),
            Err(NoMessage::Contents(_))
        ),
        "a byte too many"
    );
}
