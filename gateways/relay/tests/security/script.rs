//! Bytes of any kind as messages, and as scripts of what strangers do to the pure parts of both sides.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{MAX_STATIONS, RequestReport};
use relay::message::{Ask, Ping, Pong, Reply, SampleHeader, decode, encode};
use relay::message::{Part, ServicesPage};
use relay::orders::message::{Answer, NO_PLACE, Order, WINDOW};
use relay::orders::robot::{
    Config as RobotConfig, NotSent, ORPHANS, Output, RobotOrders, SESSIONS, Traits,
};
use relay::orders::station::{ClientRequest, Config as StationConfig, OPEN_ORDERS, StationOrders};
use relay::robot::mailbox::Admission;
use relay::robot::stations::Stations;
use relay::station::link::RobotLink;
use relay::station::moments::Moments;
use relay::telemetry::SampleReceiver;

/// When a script begins.
const BEGIN: MonotonicNs = MonotonicNs(1_000_000_000_000);

/// What the stations of a script are called; of the first two the first may command.
const NAMES: [&str; 5] = ["gcs", "viewer", "x", "*", "hero/1"];

/// Reads the bytes as each kind of message. What is one has the same bytes when it was written and read again.
pub fn messages(data: &[u8]) {
    fn one<T: serde::de::DeserializeOwned + serde::Serialize>(data: &[u8]) {
        if let Ok(message) = decode::<T>(data) {
            let bytes = encode(&message);
            let again = decode::<T>(&bytes).expect("it was one");
            assert_eq!(encode(&again), bytes);
        }
    }
    let with_version = [&[relay::message::VERSION][..], data].concat();
    for data in [data, &with_version] {
        one::<Ask>(data);
        one::<Order>(data);
        one::<Reply>(data);
        one::<Part>(data);
        one::<SampleHeader>(data);
        if let Ok(Reply::Part(part)) = decode::<Reply>(data) {
            for service in ServicesPage::unpack(&part.bytes).unwrap_or_default() {
                let _ = ipc_types::Schema::parse(&service.schema);
            }
        }
    }
}

/// Takes numbers off a script; behind its end all are 0.
struct Script<'a> {
    data: &'a [u8],
}

impl<'a> Script<'a> {
    fn byte(&mut self) -> u8 {
        let Some((byte, rest)) = self.data.split_first() else {
            return 0;
        };
        self.data = rest;
        *byte
    }

    /// A small number, or one near a power of two: where limits are.
    fn number(&mut self) -> u64 {
        match self.byte() {
            byte @ 0..=127 => byte.into(),
            byte @ 128..=191 => 1_u64 << (byte - 128),
            byte => u64::MAX >> (byte - 192),
        }
    }

    fn bytes(&mut self) -> &'a [u8] {
        let len = usize::from(self.byte()).min(self.data.len());
        let (bytes, rest) = self.data.split_at(len);
        self.data = rest;
        bytes
    }

    /// Passes some time, up to 65 s.
    fn pass(&mut self, now: &mut MonotonicNs) {
        let ms = u64::from(self.byte()) * u64::from(self.byte());
        *now = *now + Duration::from_millis(ms);
    }

    fn report(&mut self) -> RequestReport {
        let stages = [
            Stage::Accepted,
            Stage::Progress,
            Stage::Done,
            Stage::Refused,
        ];
        let stage = stages[usize::from(self.byte()) % stages.len()];
        RequestReport {
            request_id: self.number(),
            reported_ns: self.number(),
            ..RequestReport::new(stage, Reason::Busy)
        }
    }

    fn order(&mut self, sessions: &[u64]) -> Order {
        let session = usize::from(self.byte());
        let session = sessions.get(session % (sessions.len() + 1)).copied();
        let mut request = self.number().to_le_bytes().to_vec();
        request.resize(usize::from(self.byte()), 0);
        Order {
            session: session.unwrap_or(3),
            number: self.number(),
            floor: self.number(),
            service: self.number() % 3,
            expires: MonotonicNs(BEGIN.0.saturating_add(self.number())),
            is_repeat: self.byte().is_multiple_of(2),
            is_given_up: self.byte().is_multiple_of(4),
            request,
        }
    }
}

/// What the robot's side knows.
struct RobotSide {
    admission: Admission,
    stations: Stations,
    orders: RobotOrders,
    sessions: Vec<u64>,
    out: Vec<Output>,
}

impl RobotSide {
    fn ask(&mut self, key: &str, ask: &Ask, now: MonotonicNs) {
        let (Some(name), Ask::Ping(ping)) = (self.admission.asks(key, now), ask) else {
            return;
        };
        let may_command = name == NAMES[0];
        let _ = self
            .stations
            .on_message(name, ping.station_instance, may_command, now);
        if may_command {
            let instance = ping.station_instance;
            let session = self.orders.session_for(instance, name, now, &mut self.out);
            if session <= NO_PLACE {
                return;
            }
            self.sessions.retain(|other| *other != session);
            self.sessions.insert(0, session);
            self.sessions.truncate(2 * SESSIONS);
        }
    }

    fn order(&mut self, key: &str, order: &Order, now: MonotonicNs) {
        if self.admission.orders(key, now).is_some() {
            let traits = Traits {
                is_repeatable: order.service > 0,
                ends_movement: order.service > 1,
            };
            self.orders.order(order, traits, now, &mut self.out);
        }
    }
}

/// What strangers, stations and servers do to the robot's side.
pub fn robot_side(data: &[u8]) {
    let mut script = Script { data };
    let names = [NAMES[0].to_owned(), NAMES[1].to_owned()];
    let (ask, order) = ("hero/1/ask/", "hero/1/order/");
    let mut side = RobotSide {
        admission: Admission::new(ask.to_owned(), order.to_owned(), &names[..1], &names),
        stations: Stations::new(Duration::from_millis(2500)),
        orders: RobotOrders::new(
            RobotConfig {
                link_loss: Some(Duration::from_secs(10)),
                ..RobotConfig::default()
            },
            1,
        ),
        sessions: Vec::new(),
        out: Vec::new(),
    };
    let mut now = BEGIN;
    while !script.data.is_empty() {
        let action = script.byte();
        let name = NAMES[usize::from(script.byte()) % NAMES.len()];
        match action % 8 {
            0 => script.pass(&mut now),
            1 => {
                if let Ok(message) = decode::<Ask>(script.bytes()) {
                    side.ask(&format!("{ask}{name}"), &message, now);
                }
            }
            2 => {
                if let Ok(message) = decode::<Order>(script.bytes()) {
                    side.order(&format!("{order}{name}"), &message, now);
                }
            }
            3 => {
                let ping = Ping {
                    station_instance: script.number(),
                    sent_ns: script.number(),
                    suspended_ns: script.number(),
                    wants_latest: true,
                    has_all: true,
                    late_ms: None,
                };
                side.ask(&format!("{ask}{name}"), &Ask::Ping(ping), now);
            }
            4 | 5 => {
                let message = script.order(&side.sessions);
                side.order(&format!("{order}{name}"), &message, now);
            }
            6 => {
                let report = script.report();
                side.orders
                    .report(u64::from(action / 8) % 3, &report, now, &mut side.out);
            }
            _ => {
                let why = [NotSent::NoServer, NotSent::Full][usize::from(action / 8) % 2];
                let (topic, id) = (script.number() % 3, script.number());
                side.orders.not_sent(topic, id, why, now, &mut side.out);
            }
        }
        side.orders.tick(now, &mut side.out);
        let _ = side.stations.pass(now);
        let _ = (side.orders.deadline(), side.stations.deadline());
        assert!(side.orders.remembered() <= SESSIONS * WINDOW as usize + ORPHANS);
        assert!(side.stations.rows(0, |_| None).len() <= MAX_STATIONS);
        let most = 2 * side.orders.remembered() + SESSIONS * WINDOW as usize + 8;
        assert!(
            side.out.len() <= most,
            "one message brings {}",
            side.out.len()
        );
        side.out.clear();
    }
}

/// What robots that are none, and clients, do to the station's side.
pub fn station_side(data: &[u8]) {
    const INSTANCE: u64 = 5;
    let mut script = Script { data };
    let mut link = RobotLink::new(INSTANCE, Duration::from_millis(2500), BEGIN);
    let mut orders = StationOrders::new(StationConfig {
        give_up: Duration::from_secs(60),
    });
    let (mut receiver, mut out, mut handle, mut now) =
        (SampleReceiver::default(), Vec::new(), 0, BEGIN);
    let mut moments = Moments::default();
    while !script.data.is_empty() {
        let action = script.byte();
        let reply = match action % 8 {
            0 => {
                script.pass(&mut now);
                None
            }
            1 => decode::<Reply>(script.bytes()).ok(),
            2 => Some(Reply::Pong(Pong {
                robot_instance: script.number(),
                station_instance: [INSTANCE, script.number()][usize::from(action / 8) % 2],
                ping_sent_ns: now.0.saturating_sub(script.number()),
                ping_suspended_ns: script.number(),
                received_ns: script.number(),
                sent_ns: script.number(),
                suspended_ns: script.number(),
                session: script.number(),
                pages: script.number() as u16,
            })),
            3 => Some(Reply::Answer(Answer {
                session: script.number(),
                number: script.number(),
                serial: script.number() as u32,
                report: script.report(),
            })),
            4 if action >= 128 => Some(Reply::Part(Part {
                robot_instance: link.robot_instance().unwrap_or_default(),
                index: script.byte().into(),
                page_bytes: script.number() as u32,
                from: script.number() as u32,
                bytes: script.bytes().to_vec(),
            })),
            4 => Some(Reply::UnknownSession(script.number())),
            5 => {
                let header = SampleHeader {
                    robot_instance: script.number(),
                    number: script.number(),
                    left_out: script.number(),
                    lost: script.number(),
                };
                let _ = receiver.take(&header);
                let _ = receiver.counts();
                None
            }
            6 => {
                handle += 1;
                let request = ClientRequest {
                    handle,
                    path_id: script.number(),
                    service: script.number() % 3,
                    expires: MonotonicNs(script.number()),
                    bytes: script.number().to_le_bytes().to_vec(),
                };
                let is_up = link.is_up();
                orders.request(request, is_up, now, &mut out);
                None
            }
            _ => {
                orders.give_up(script.number(), &mut out);
                None
            }
        };
        match reply {
            Some(Reply::Pong(pong)) => {
                let _ = link.take(&pong, now, script.number());
                if pong.session != 0 {
                    orders.session(pong.session, now, &mut out);
                }
                if let Some(estimate) = link.clock().estimate(now) {
                    orders.round_trip(Duration::from_nanos(estimate.round_trip_ns));
                }
            }
            Some(Reply::Part(part)) => {
                let described = link.take_part(&part);
                let texts = described.iter().map(|service| service.schema.len());
                assert!(texts.sum::<usize>() <= relay::message::MAX_PAGE_TEXT);
            }
            Some(Reply::Answer(answer)) => orders.answer(&answer, now, &mut out),
            Some(Reply::UnknownSession(session)) => orders.unknown_session(session),
            None => {}
        }
        let _ = link.pass(now);
        let _ = (link.ping(now, 0), link.question(now), link.deadline());
        let _ = link
            .clock()
            .to_local(relay::clock::RemoteNs(script.number()));
        let moment = MonotonicNs(script.number());
        let _ = link.clock().to_remote(moment);
        let _ = moments.issued(moment, link.clock(), now);
        orders.tick(now, &mut out);
        let _ = orders.deadline();
        assert!(orders.open() <= OPEN_ORDERS);
        out.clear();
    }
}

/// The first byte says against what.
pub fn play(data: &[u8]) {
    let Some((target, data)) = data.split_first() else {
        return;
    };
    match target % 3 {
        0 => messages(data),
        1 => robot_side(data),
        _ => station_side(data),
    }
}

/// Schemas that take as long as any of their length.
pub fn worst_schemas() -> Vec<String> {
    let begin = "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\n";
    let rule = "=".repeat(80);
    let most = ipc_types::schema::MAX_TEXT_LEN;
    let mut many_fields = begin.to_owned();
    let mut many_definitions = begin.to_owned();
    for number in 0.. {
        let more = format!("uint8 a{number}\n");
        if many_fields.len() + more.len() > most {
            break;
        }
        many_fields += &more;
    }
    for number in 0.. {
        let more = format!("{rule}\nMSG: a_msgs/B{number}\n# Layout: a.B{number}.v1\nuint64 a\n");
        if many_definitions.len() + more.len() > most {
            break;
        }
        many_definitions += &more;
    }
    // Each level has as many of the next as a payload can have numbers.
    let mut deep = format!("{begin}a_msgs/B0[4] b\n");
    for level in 0..14 {
        let next = level + 1;
        deep += &format!(
            "{rule}\nMSG: a_msgs/B{level}\n# Layout: a.B{level}.v1\na_msgs/B{next}[4] b\na_msgs/B{next}[4] c\n"
        );
    }
    deep += &format!("{rule}\nMSG: a_msgs/B14\n# Layout: a.B14.v1\nuint64 a\n");
    let comments = format!("{begin}{}", "# a\n".repeat((most - begin.len()) / 4));
    vec![many_fields, many_definitions, deep, comments]
}
