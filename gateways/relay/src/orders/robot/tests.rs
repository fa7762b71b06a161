use super::*;
use crate::orders::message::{Answer, NO_PLACE, NOT_PERMITTED, WINDOW};

const MOVEMENT: u64 = 0;
const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;
const STATION: u64 = 11;

struct Rig {
    robot: RobotOrders,
    session: u64,
    now: u64,
    out: Vec<Output>,
}

impl Rig {
    fn new() -> Rig {
        Rig::with(Config {
            link_loss: Some(Duration::from_secs(5)),
            ..Config::default()
        })
    }

    fn with(config: Config) -> Rig {
        let mut robot = RobotOrders::new(config, 1);
        let session = robot.session_for(STATION, "gcs", MonotonicNs(SECOND), &mut Vec::new());
        Rig {
            robot,
            session,
            now: SECOND,
            out: Vec::new(),
        }
    }

    /// An order for the request 100 + `number`.
    fn new_order(&self, number: u64) -> Order {
        Order {
            session: self.session,
            number,
            floor: 1,
            service: MOVEMENT,
            expires: MonotonicNs(self.now + SECOND),
            is_repeat: false,
            is_given_up: false,
            request: (100 + number).to_le_bytes().to_vec(),
        }
    }

    /// The order `number` as a repetition.
    fn repetition(&self, number: u64) -> Order {
        Order {
            is_repeat: true,
            ..self.new_order(number)
        }
    }

    fn order(&mut self, order: &Order) -> Vec<Output> {
        self.order_of(order, true)
    }

    fn order_of(&mut self, order: &Order, is_repeatable: bool) -> Vec<Output> {
        let traits = Traits {
            is_repeatable,
            ends_movement: false,
        };
        self.order_with(order, traits)
    }

    fn order_with(&mut self, order: &Order, traits: Traits) -> Vec<Output> {
        let now = MonotonicNs(self.now);
        let is_known = self.robot.order(order, traits, now, &mut self.out);
        assert!(is_known, "its session");
        std::mem::take(&mut self.out)
    }

    /// Whether the session of this order is known; if not, nothing is done.
    fn knows_session_of(&mut self, order: &Order) -> bool {
        let now = MonotonicNs(self.now);
        let is_known = self
            .robot
            .order(order, Traits::default(), now, &mut self.out);
        is_known || !std::mem::take(&mut self.out).is_empty()
    }

    fn report(&mut self, request_id: u64, stage: Stage, reason: Reason) -> Vec<Output> {
        let report = RequestReport {
            request_id,
            ..RequestReport::new(stage, reason)
        };
        let now = MonotonicNs(self.now);
        self.robot.report(MOVEMENT, &report, now, &mut self.out);
        std::mem::take(&mut self.out)
    }

    fn not_sent(&mut self, request_id: u64, why: NotSent) -> Vec<Output> {
        let now = MonotonicNs(self.now);
        let out = &mut self.out;
        self.robot.not_sent(MOVEMENT, request_id, why, now, out);
        std::mem::take(&mut self.out)
    }

    fn tick_after(&mut self, pause: u64) -> Vec<Output> {
        self.now += pause;
        self.robot.tick(MonotonicNs(self.now), &mut self.out);
        std::mem::take(&mut self.out)
    }

    fn ping(&mut self, station: u64) -> u64 {
        let now = MonotonicNs(self.now);
        self.robot.session_for(station, "gcs", now, &mut self.out)
    }
}

/// Number, serial, stage and reason of each answer.
fn answers(out: &[Output]) -> Vec<(u64, u32, u32, u32)> {
    let answers = out.iter().filter_map(|output| match output {
        Output::Answer { answer, .. } => Some(answer),
        _ => None,
    });
    let of = |a: &Answer| (a.number, a.serial, a.report.stage, a.report.reason);
    answers.map(of).collect()
}

fn answered(number: u64, serial: u32, stage: Stage, reason: Reason) -> (u64, u32, u32, u32) {
    (number, serial, stage.code(), reason.code())
}

/// Request and `repeat` of each request that is sent.
fn sent(out: &[Output]) -> Vec<(u64, bool)> {
    let sent = out.iter().filter_map(|output| match output {
        Output::Send {
            request_id,
            is_repeat,
            ..
        } => Some((*request_id, *is_repeat)),
        _ => None,
    });
    sent.collect()
}

/// The order after its client has gone.
fn given_up_of(order: &Order) -> Order {
    Order {
        is_given_up: true,
        ..order.clone()
    }
}

fn is_give_up(output: &Output) -> bool {
    matches!(output, Output::GiveUp { .. })
}

fn given_up(out: &[Output]) -> bool {
    out.iter().any(is_give_up)
}

#[test]
fn an_order_is_passed_on_once_and_every_copy_is_answered() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    let out = rig.order(&order);
    assert_eq!(sent(&out), [(101, false)]);
    assert_eq!(answers(&out), [(1, 0, 0, 0)], "nothing to report yet");
    assert_eq!(answers(&rig.order(&order)), [(1, 0, 0, 0)]);

    let accepted = answered(1, 1, Stage::Accepted, Reason::None);
    let pushed = rig.report(101, Stage::Accepted, Reason::None);
    assert_eq!(answers(&pushed), [accepted]);
    rig.report(101, Stage::Progress, Reason::None);
    rig.report(101, Stage::Progress, Reason::None);
    let progress = answered(1, 3, Stage::Progress, Reason::None);
    let out = rig.order(&order);
    assert_eq!(answers(&out), [accepted, progress], "first and newest");

    let done = answered(1, 4, Stage::Done, Reason::None);
    assert_eq!(answers(&rig.report(101, Stage::Done, Reason::None)), [done]);
    let out = rig.order(&order);
    assert_eq!((answers(&out), sent(&out)), (vec![accepted, done], vec![]));
    let again = rig.report(101, Stage::Done, Reason::None);
    assert_eq!(again, [], "it has ended");

    // A first request that its server refuses as busy has its final report as well.
    rig.order(&rig.new_order(2));
    let refused = answered(2, 1, Stage::Refused, Reason::Busy);
    let out = rig.report(102, Stage::Refused, Reason::Busy);
    assert_eq!(answers(&out), [refused]);
}

#[test]
fn orders_are_passed_on_in_the_order_of_their_numbers() {
    let mut rig = Rig::new();
    for early in [3, 2] {
        let out = rig.order(&rig.new_order(early));
        let known = vec![(early, 0, 0, 0)];
        assert_eq!((sent(&out), answers(&out)), (vec![], known));
    }
    let out = rig.order(&rig.new_order(1));
    assert_eq!(sent(&out), [(101, false), (102, false), (103, false)]);
    // What is settled at the station is waited for no more.
    let fifth = Order {
        floor: 5,
        ..rig.new_order(5)
    };
    assert_eq!(sent(&rig.order(&fifth)), [(105, false)]);
}

#[test]
fn what_ends_a_movement_waits_for_no_order_before_it() {
    let mut rig = Rig::new();
    let hold = Traits {
        is_repeatable: true,
        ends_movement: true,
    };
    let out = rig.order_with(&rig.new_order(2), hold);
    assert_eq!(sent(&out), [(102, false)]);
    assert_eq!(sent(&rig.order(&rig.new_order(1))), [(101, false)]);
}

#[test]
fn an_order_that_has_waited_until_it_is_too_late_is_refused() {
    let mut rig = Rig::new();
    rig.order(&rig.new_order(2));
    rig.now += SECOND + 1;
    let out = rig.order(&rig.new_order(1));
    assert_eq!(sent(&out), [(101, false)]);
    let refused = answered(2, 1, Stage::Refused, Reason::TooLate);
    assert_eq!(answers(&out), [(1, 0, 0, 0), refused]);
}

#[test]
fn an_order_waits_while_its_server_does_not_take_the_one_before_it() {
    let mut rig = Rig::new();
    rig.order(&rig.new_order(1));
    rig.not_sent(101, NotSent::Full);
    assert_eq!(sent(&rig.order(&rig.new_order(2))), []);
    let other = Order {
        service: MOVEMENT + 1,
        ..rig.new_order(3)
    };
    assert_eq!(sent(&rig.order(&other)), [(103, false)], "another server");
    let out = rig.tick_after(100 * MS);
    assert_eq!(sent(&out), [(101, false), (102, false)]);
}

#[test]
fn an_order_that_waits_is_given_up_and_forgotten_without_being_passed_on() {
    let mut rig = Rig::new();
    let second = rig.new_order(2);
    rig.order(&second);
    let given = given_up_of(&second);
    let out = rig.order(&given);
    assert!(!given_up(&out));
    assert_eq!(sent(&rig.order(&rig.new_order(1))), [(101, false)]);
    rig.order(&rig.new_order(4));
    rig.now += INSTANCE_KEPT.as_nanos() as u64;
    for station in 200..208 {
        rig.ping(station);
    }
    assert_eq!(rig.robot.remembered(), 1, "the one that was passed on");
}

#[test]
fn an_order_of_an_unknown_session_is_never_passed_on() {
    let mut rig = Rig::new();
    let mut order = rig.new_order(1);
    order.session ^= 1;
    assert!(!rig.knows_session_of(&order));
}

#[test]
fn below_the_floor_orders_are_forgotten_and_late_copies_ignored() {
    let mut rig = Rig::new();
    let first = rig.new_order(1);
    rig.order(&first);
    rig.report(101, Stage::Done, Reason::None);
    let second = Order {
        floor: 2,
        ..rig.new_order(2)
    };
    rig.order(&second);
    assert_eq!(rig.robot.remembered(), 1);
    assert_eq!(rig.order(&first), []);
    let third = Order {
        floor: 2,
        ..rig.new_order(3)
    };
    rig.order(&third);
    assert_eq!(
        rig.robot.remembered(),
        2,
        "the floor itself is not below it"
    );
    let above = rig.new_order(2 + WINDOW);
    assert_eq!(rig.order(&above), [], "no station sends this");
}

#[test]
fn an_order_that_comes_too_late_or_without_an_id_is_refused() {
    // At its last moment it is in time.
    let mut rig = Rig::new();
    let last = Order {
        expires: MonotonicNs(rig.now),
        ..rig.new_order(1)
    };
    assert_eq!(sent(&rig.order(&last)), [(101, false)]);
    let late = MonotonicNs(SECOND - 1);
    for (expires, request, reason) in [
        (Some(late), None, Reason::TooLate),
        (None, Some(vec![]), Reason::InvalidRequest),
        (None, Some(vec![1; 7]), Reason::InvalidRequest),
        (None, Some(vec![0; 16]), Reason::InvalidRequest),
    ] {
        let mut rig = Rig::new();
        let mut order = rig.new_order(1);
        order.expires = expires.unwrap_or(order.expires);
        order.request = request.unwrap_or(order.request);
        let out = rig.order(&order);
        let refused = answered(1, 1, Stage::Refused, reason);
        assert_eq!((answers(&out), sent(&out)), (vec![refused], vec![]));
    }
}

#[test]
fn an_unknown_repetition_asks_the_server_or_is_unknown_however_late_it_comes() {
    let mut rig = Rig::new();
    let order = rig.repetition(1);
    rig.now += 10 * SECOND;
    assert_eq!(sent(&rig.order(&order)), [(101, true)]);
    let order = rig.repetition(2);
    let out = rig.order_of(&order, false);
    let unknown = answered(2, 1, Stage::Unknown, Reason::NotRemembered);
    assert_eq!((answers(&out), sent(&out)), (vec![unknown], vec![]));
}

#[test]
fn a_repetition_that_is_open_at_the_server_is_asked_again_until_it_ends() {
    let mut rig = Rig::new();
    let order = rig.repetition(1);
    rig.order(&order);
    for _ in 0..3 {
        assert_eq!(rig.report(101, Stage::Refused, Reason::StillOpen), []);
        assert_eq!(answers(&rig.order(&order)), [(1, 0, 0, 0)]);
        assert_eq!(sent(&rig.tick_after(499 * MS)), []);
        assert_eq!(sent(&rig.tick_after(MS)), [(101, true)]);
    }
    for (number, stage, reason) in [
        (1, Stage::Aborted, Reason::Stopped),
        // Neither says that it is open.
        (2, Stage::Refused, Reason::Busy),
        (3, Stage::Unknown, Reason::StillOpen),
    ] {
        rig.order(&rig.repetition(number));
        let out = rig.report(100 + number, stage, reason);
        assert_eq!(answers(&out), [answered(number, 1, stage, reason)]);
    }
}

#[test]
fn a_repetition_that_stays_busy_is_unknown_after_an_hour() {
    let mut rig = Rig::new();
    let order = rig.repetition(1);
    rig.order(&order);
    rig.report(101, Stage::Refused, Reason::StillOpen);
    rig.tick_after(3600 * SECOND);
    let out = rig.report(101, Stage::Refused, Reason::StillOpen);
    let unknown = answered(1, 1, Stage::Unknown, Reason::StillOpen);
    assert_eq!(answers(&out), [unknown]);
}

#[test]
fn a_request_that_cannot_be_sent_is_tried_for_two_seconds_and_then_ended() {
    for (why, is_repeat, stage, reason) in [
        (NotSent::NoServer, false, Stage::Refused, Reason::BridgeGone),
        (NotSent::NoServer, true, Stage::Unknown, Reason::BridgeGone),
        (
            NotSent::Full,
            false,
            Stage::Refused,
            Reason::TooManyRequests,
        ),
    ] {
        let mut rig = Rig::new();
        let order = Order {
            is_repeat,
            expires: MonotonicNs(rig.now + 10 * SECOND),
            ..rig.new_order(1)
        };
        rig.order(&order);
        for _ in 0..20 {
            assert_eq!(rig.not_sent(101, why), []);
            assert_eq!(rig.tick_after(100 * MS - 1), []);
            assert_eq!(sent(&rig.tick_after(1)), [(101, is_repeat)]);
        }
        let out = rig.not_sent(101, why);
        assert_eq!(answers(&out), [answered(1, 1, stage, reason)]);
        assert_eq!(rig.tick_after(SECOND), []);
    }
}

#[test]
fn a_request_that_waits_is_not_sent_after_its_deadline() {
    let refused = answered(1, 1, Stage::Refused, Reason::TooLate);
    for (left, expected) in [
        (100 * MS - 1, (vec![refused], vec![])),
        (100 * MS, (vec![], vec![(101, false)])),
    ] {
        let mut rig = Rig::new();
        let order = Order {
            expires: MonotonicNs(rig.now + left),
            ..rig.new_order(1)
        };
        rig.order(&order);
        rig.not_sent(101, NotSent::NoServer);
        let out = rig.tick_after(100 * MS);
        assert_eq!((answers(&out), sent(&out)), expected);
    }
}

#[test]
fn an_order_that_is_given_up_is_dropped_at_the_server_and_settled() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    let given = given_up_of(&order);
    rig.order(&order);
    let settled = answered(1, 1, Stage::Unknown, Reason::None);
    let out = rig.order(&given);
    assert_eq!((given_up(&out), answers(&out)), (true, vec![settled]));
    let out = rig.order(&given);
    assert_eq!((given_up(&out), answers(&out)), (false, vec![settled]));
    assert_eq!(rig.report(101, Stage::Done, Reason::None), []);
}

#[test]
fn an_order_that_is_given_up_before_it_came_is_never_passed_on() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    let given = given_up_of(&order);
    let settled = answered(1, 1, Stage::Unknown, Reason::None);
    for order in [given, order] {
        let out = rig.order(&order);
        assert_eq!((sent(&out), answers(&out)), (vec![], vec![settled]));
        assert!(!given_up(&out));
    }
}

#[test]
fn an_order_that_moves_to_another_number_is_the_same_order() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    rig.order(&order);
    rig.report(101, Stage::Accepted, Reason::None);
    let moved = Order {
        number: 70,
        is_repeat: true,
        ..order.clone()
    };
    let accepted = answered(70, 1, Stage::Accepted, Reason::None);
    let out = rig.order(&moved);
    assert_eq!((sent(&out), answers(&out)), (vec![], vec![accepted]));
    rig.report(101, Stage::Done, Reason::None);
    let done = answered(70, 2, Stage::Done, Reason::None);
    for copy in [&order, &moved] {
        let out = rig.order(copy);
        assert_eq!((sent(&out), answers(&out)), (vec![], vec![accepted, done]));
    }
}

#[test]
fn an_order_that_ends_while_it_moves_keeps_its_end() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    rig.order(&order);
    rig.report(101, Stage::Done, Reason::None);
    let moved = Order {
        number: 70,
        is_repeat: true,
        ..order.clone()
    };
    let out = rig.order_of(&moved, false);
    let done = answered(70, 1, Stage::Done, Reason::None);
    assert_eq!((sent(&out), answers(&out)), (vec![], vec![done]));
}

#[test]
fn a_client_may_ask_the_server_again_with_the_id_of_a_request_that_has_ended() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    rig.order(&order);
    rig.report(101, Stage::Unknown, Reason::BridgeGone);
    let again = Order { number: 2, ..order };
    assert_eq!(sent(&rig.order(&again)), [(101, false)]);
}

#[test]
fn an_id_that_another_station_has_open_is_refused_as_busy() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    rig.order(&order);
    let other = Order {
        session: rig.ping(22),
        ..order
    };
    let out = rig.order(&other);
    let refused = answered(1, 1, Stage::Refused, Reason::StillOpen);
    assert_eq!((sent(&out), answers(&out)), (vec![], vec![refused]));
    // What became of one that a station has asked for before is not known.
    let again = Order {
        session: rig.ping(33),
        is_repeat: true,
        ..other
    };
    let unknown = answered(1, 1, Stage::Unknown, Reason::NotRemembered);
    assert_eq!(answers(&rig.order(&again)), [unknown]);
    // So is one that the station itself has open at another server, whose reports are about no other request.
    let elsewhere = Order {
        number: 2,
        service: MOVEMENT + 1,
        ..rig.new_order(1)
    };
    let out = rig.order(&elsewhere);
    let refused = answered(2, 1, Stage::Refused, Reason::StillOpen);
    assert_eq!((sent(&out), answers(&out)), (vec![], vec![refused]));
    let report = RequestReport {
        request_id: 101,
        ..RequestReport::new(Stage::Done, Reason::None)
    };
    let now = MonotonicNs(rig.now);
    rig.robot.report(MOVEMENT + 1, &report, now, &mut rig.out);
    assert_eq!(rig.out, []);
    let out = rig.report(101, Stage::Done, Reason::None);
    assert!(matches!(
        out[..],
        [Output::Answer {
            station: STATION,
            ..
        }]
    ));
}

#[test]
fn no_station_waits_for_the_orders_of_another_one() {
    let mut rig = Rig::new();
    let sessions = [rig.session, rig.ping(22)];
    // The requests 11 and 12 of the one, 21 and 22 of the other.
    let order = |rig: &mut Rig, station: u64, number: u64| {
        let order = Order {
            session: sessions[station as usize - 1],
            request: (10 * station + number).to_le_bytes().to_vec(),
            ..rig.new_order(number)
        };
        sent(&rig.order(&order))
    };
    assert_eq!(order(&mut rig, 1, 2), []);
    assert_eq!(order(&mut rig, 2, 2), []);
    assert_eq!(order(&mut rig, 2, 1), [(21, false), (22, false)]);
    // The server does not take the first one of station 2 now.
    rig.not_sent(21, NotSent::Full);
    assert_eq!(order(&mut rig, 1, 1), [(11, false), (12, false)]);
}

#[test]
fn an_active_session_is_never_forgotten_for_a_new_one() {
    let mut rig = Rig::with(Config::default());
    let order = rig.new_order(1);
    rig.order(&order);
    let others: Vec<u64> = (200..207).map(|station| rig.ping(station)).collect();
    for round in 0..100 {
        rig.now += 500 * MS;
        assert_eq!(rig.ping(300 + round), NO_PLACE, "the ninth");
        assert_eq!(rig.ping(STATION), rig.session);
        for (station, session) in (200..207).zip(&others) {
            assert_eq!(rig.ping(station), *session);
        }
    }
    assert_eq!(rig.robot.counts_of(300), None);
    let out = rig.report(101, Stage::Done, Reason::None);
    assert_eq!(answers(&out), [answered(1, 1, Stage::Done, Reason::None)]);
    assert_eq!(rig.out, [], "no station was lost");
}

#[test]
fn an_order_of_a_station_that_has_no_place_is_of_no_session() {
    let mut rig = Rig::new();
    for station in 200..207 {
        rig.ping(station);
    }
    let order = Order {
        session: rig.ping(300),
        ..rig.new_order(1)
    };
    assert!(!rig.knows_session_of(&order));
}

#[test]
fn the_station_that_was_silent_longest_is_forgotten_and_its_open_requests_go_on() {
    let mut rig = Rig::with(Config::default());
    let order = rig.new_order(1);
    rig.order(&order);
    for station in 200..207 {
        rig.now += MS;
        rig.ping(station);
    }
    rig.now += INSTANCE_KEPT.as_nanos() as u64 - 7 * MS - 1;
    assert_eq!(rig.ping(300), NO_PLACE);
    rig.now += 1;
    assert!(rig.ping(300) > NO_PLACE);
    assert_eq!(rig.robot.name_of(STATION), None);
    assert!(!rig.knows_session_of(&order));
    rig.now += INSTANCE_KEPT.as_nanos() as u64;
    let again = Order {
        session: rig.ping(STATION),
        is_repeat: true,
        ..order
    };
    let out = rig.order(&again);
    assert_eq!((sent(&out), answers(&out)), (vec![], vec![(1, 0, 0, 0)]));
    let out = rig.report(101, Stage::Done, Reason::None);
    let done = answered(1, 1, Stage::Done, Reason::None);
    assert_eq!(answers(&out), [done]);
}

#[test]
fn requests_of_forgotten_stations_are_bounded_and_forgotten_when_they_end() {
    let mut rig = Rig::with(Config::default());
    let stations = SESSIONS as u64 + 4;
    let mut given = 0;
    for station in 1..=stations {
        // The one of the rig is the first that is forgotten.
        rig.now += 2 * INSTANCE_KEPT.as_nanos() as u64;
        let session = rig.ping(1_000 + station);
        for number in 1..=32 {
            let id = 10_000 * station + number;
            let order = Order {
                session,
                request: id.to_le_bytes().to_vec(),
                ..rig.new_order(number)
            };
            let out = rig.order(&order);
            given += out.iter().filter(|output| is_give_up(output)).count();
        }
    }
    assert_eq!(rig.robot.remembered(), SESSIONS * 32 + ORPHANS);
    assert_eq!(given, 4 * 32 - ORPHANS);
    let before = rig.robot.remembered();
    for station in 1..=4 {
        for number in 1..=32 {
            rig.report(10_000 * station + number, Stage::Done, Reason::None);
        }
    }
    assert_eq!(rig.robot.remembered(), before - ORPHANS);
}

#[test]
fn the_orders_of_a_session_are_counted() {
    let mut rig = Rig::new();
    let order = rig.new_order(1);
    rig.order(&order);
    rig.order(&order);
    let late = Order {
        expires: MonotonicNs(rig.now - 1),
        ..rig.new_order(2)
    };
    rig.order(&late);
    let counts = OrderCounts {
        executed: 1,
        refused: 1,
        open: 1,
        last: MonotonicNs(rig.now),
    };
    assert_eq!(rig.robot.counts_of(STATION), Some(counts));
    rig.report(101, Stage::Done, Reason::None);
    let ended = OrderCounts { open: 0, ..counts };
    assert_eq!(rig.robot.counts_of(STATION), Some(ended));
}

#[test]
fn a_silent_station_with_an_open_order_is_lost_once() {
    let mut rig = Rig::new();
    let lost = Output::LinkLost { station: STATION };
    assert_eq!(rig.tick_after(60 * SECOND), [], "it has nothing open");
    let order = rig.new_order(1);
    rig.order(&order);
    let at = rig.robot.deadline();
    assert_eq!(at, Some(MonotonicNs(rig.now + 5 * SECOND)));
    assert_eq!(rig.tick_after(5 * SECOND), vec![lost.clone()]);
    assert_eq!(rig.tick_after(60 * SECOND), []);
    assert_eq!(rig.robot.deadline(), None);
    rig.ping(STATION);
    assert_eq!(rig.tick_after(5 * SECOND), [lost]);
    rig.ping(STATION);
    let out = rig.report(101, Stage::Done, Reason::None);
    assert_eq!(answers(&out).len(), 1, "the order stayed open");
    assert_eq!(rig.tick_after(60 * SECOND), []);
}

#[test]
fn sessions_of_two_instances_of_the_robot_side_differ() {
    let out = &mut Vec::new();
    let mut robots = [1, 2].map(|seed| RobotOrders::new(Config::default(), seed));
    let tokens = [0, 1].map(|index| robots[index].session_for(STATION, "gcs", MonotonicNs(1), out));
    assert_ne!(tokens[0], tokens[1]);
    let again = robots[0].session_for(STATION, "gcs", MonotonicNs(2), out);
    assert_eq!(again, tokens[0]);
}

#[test]
fn a_station_that_is_forgotten_with_open_orders_is_lost_unless_that_was_said() {
    for (link_loss_s, orders, is_lost) in [(60, 1, true), (60, 0, false), (5, 1, false)] {
        let mut rig = Rig::with(Config {
            link_loss: Some(Duration::from_secs(link_loss_s)),
            ..Config::default()
        });
        for number in 1..=orders {
            rig.order(&rig.new_order(number));
        }
        let said = rig.tick_after(INSTANCE_KEPT.as_nanos() as u64);
        assert_eq!(!said.is_empty(), link_loss_s == 5);
        for station in 200..208 {
            assert_eq!(rig.out, []);
            rig.ping(station);
        }
        let lost = is_lost.then_some(Output::LinkLost { station: STATION });
        assert_eq!(rig.out, Vec::from_iter(lost));
    }
}

#[test]
fn a_repetition_waits_longer_for_room_at_the_server() {
    let mut rig = Rig::new();
    let order = rig.repetition(1);
    rig.order(&order);
    rig.not_sent(101, NotSent::Full);
    assert_eq!(sent(&rig.tick_after(60 * SECOND)), [(101, true)]);
    assert_eq!(rig.not_sent(101, NotSent::Full), []);
    rig.tick_after(3600 * SECOND);
    let out = rig.not_sent(101, NotSent::Full);
    let unknown = answered(1, 1, Stage::Unknown, Reason::StillOpen);
    assert_eq!(answers(&out), [unknown]);
}

#[test]
fn an_instance_is_the_station_s_that_has_shown_it_first() {
    let mut rig = Rig::new();
    let now = MonotonicNs(rig.now);
    let out = &mut rig.out;
    let other = rig.robot.session_for(STATION, "other", now, out);
    assert_eq!(other, NOT_PERMITTED);
    assert_eq!(rig.robot.name_of(STATION), Some("gcs"));
    assert_eq!(rig.ping(STATION), rig.session);
}
