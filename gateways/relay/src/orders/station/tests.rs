use super::*;
use ipc_types::code::{Reason, Stage};

const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;
const SESSION: u64 = 77;

struct Rig {
    station: StationOrders,
    now: u64,
    out: Vec<Output>,
}

impl Rig {
    /// A station with a session.
    fn new() -> Rig {
        let mut rig = Rig {
            station: StationOrders::new(Duration::from_secs(60)),
            now: SECOND,
            out: Vec::new(),
        };
        rig.session(SESSION);
        rig
    }

    fn act(
        &mut self,
        act: impl FnOnce(&mut StationOrders, MonotonicNs, &mut Vec<Output>),
    ) -> Vec<Output> {
        act(&mut self.station, MonotonicNs(self.now), &mut self.out);
        std::mem::take(&mut self.out)
    }

    fn session(&mut self, session: u64) -> Vec<Output> {
        self.act(|station, now, out| station.session(session, now, out))
    }

    fn request(&mut self, handle: u64) -> Vec<Output> {
        self.request_on(true, handle)
    }

    fn request_on(&mut self, is_link_up: bool, handle: u64) -> Vec<Output> {
        let request = ClientRequest {
            handle,
            path_id: 5,
            service: 3,
            expires: MonotonicNs(9),
            bytes: (100 + handle).to_le_bytes().to_vec(),
        };
        self.act(|station, now, out| station.request(request, is_link_up, now, out))
    }

    fn answer(&mut self, number: u64, serial: u32, stage: Option<Stage>) -> Vec<Output> {
        self.answer_in(SESSION, number, serial, stage)
    }

    fn answer_in(
        &mut self,
        session: u64,
        number: u64,
        serial: u32,
        stage: Option<Stage>,
    ) -> Vec<Output> {
        let report = stage.map(|stage| RequestReport::new(stage, Reason::None));
        let answer = Answer {
            session,
            number,
            serial,
            report: report.unwrap_or_default(),
        };
        self.act(|station, now, out| station.answer(&answer, now, out))
    }

    fn tick_after(&mut self, pause: u64) -> Vec<Output> {
        self.now += pause;
        self.act(|station, now, out| station.tick(now, out))
    }

    fn give_up(&mut self, handle: u64) -> Vec<Output> {
        self.act(|station, _, out| station.give_up(handle, out))
    }
}

/// Handle, stage and reason of each report; the rest of it is checked.
fn reports(out: &[Output]) -> Vec<(u64, Stage, u32)> {
    let reports = out.iter().filter_map(|output| match output {
        Output::Report { handle, report, .. } => {
            assert_eq!((report.request_id, report.path_id), (100 + handle, 5));
            Some((*handle, report.stage()?, report.reason))
        }
        Output::Send(_) => None,
    });
    reports.collect()
}

fn orders(out: &[Output]) -> Vec<Order> {
    let orders = out.iter().filter_map(|output| match output {
        Output::Send(order) => Some(order.clone()),
        Output::Report { .. } => None,
    });
    orders.collect()
}

/// Number, floor, and the two flags of each order.
fn asked(out: &[Output]) -> Vec<(u64, u64, bool, bool)> {
    let orders = orders(out).into_iter();
    let flags = |o: Order| (o.number, o.floor, o.is_repeat, o.is_given_up);
    orders.map(flags).collect()
}

#[test]
fn a_request_is_ordered_at_once_and_its_reports_are_handed_on() {
    let mut rig = Rig::new();
    let order = Order {
        session: SESSION,
        number: 1,
        floor: 1,
        service: 3,
        expires: MonotonicNs(9),
        is_repeat: false,
        is_given_up: false,
        request: 107_u64.to_le_bytes().to_vec(),
    };
    assert_eq!(rig.request(7), [Output::Send(order)]);
    assert_eq!(rig.answer(1, 0, None), []);
    for (serial, stage) in [(1, Stage::Accepted), (2, Stage::Progress), (3, Stage::Done)] {
        let out = rig.answer(1, serial, Some(stage));
        assert_eq!(reports(&out), [(7, stage, 0)]);
        assert_eq!(rig.answer(1, serial, Some(stage)), [], "once");
    }
    assert_eq!((rig.station.open(), rig.station.deadline()), (0, None));
    assert_eq!(
        asked(&rig.request(8)),
        [(2, 2, false, false)],
        "the floor rose"
    );
}

#[test]
fn an_order_is_repeated_until_its_final_report_with_pauses_up_to_a_second() {
    let mut rig = Rig::new();
    rig.station.round_trip(Duration::from_millis(10));
    rig.request(7);
    for pause in [100, 200, 400, 800, 1_000, 1_000] {
        let due = MonotonicNs(rig.now + pause * MS);
        assert_eq!(rig.station.deadline(), Some(due));
        assert_eq!(rig.tick_after(pause * MS - 1), []);
        assert_eq!(asked(&rig.tick_after(1)), [(1, 1, false, false)]);
    }
    rig.answer(1, 1, Some(Stage::Accepted));
    assert_eq!(asked(&rig.tick_after(999 * MS)), []);
    assert_eq!(asked(&rig.tick_after(MS)).len(), 1);
    assert_eq!(asked(&rig.tick_after(100 * MS)).len(), 1, "after silence");
    rig.answer(1, 2, Some(Stage::Done));
    assert_eq!(rig.tick_after(10 * SECOND), []);
}

#[test]
fn what_is_not_answered_is_asked_for_together_in_the_order_of_the_numbers() {
    let mut rig = Rig::new();
    rig.request(7);
    assert_eq!(rig.tick_after(150 * MS), []);
    rig.request(8);
    let both = [(1, 1, false, false), (2, 1, false, false)];
    assert_eq!(asked(&rig.tick_after(50 * MS)), both);
    assert_eq!(rig.tick_after(399 * MS), []);
    assert_eq!(asked(&rig.tick_after(MS)), both);
    rig.answer(2, 1, Some(Stage::Accepted));
    assert_eq!(rig.tick_after(200 * MS - 1), []);
    assert_eq!(asked(&rig.tick_after(1)), [both[0]]);
}

#[test]
fn a_new_order_delays_no_round_that_waits_for_its_pause_alone() {
    let mut rig = Rig::new();
    rig.station.round_trip(Duration::from_millis(150));
    rig.request(7);
    rig.answer(1, 1, Some(Stage::Accepted));
    assert_eq!(rig.tick_after(900 * MS), []);
    rig.request(8);
    rig.answer(2, 1, Some(Stage::Accepted));
    // From this moment on the first one is asked for, with the next round.
    rig.now += 100 * MS;
    rig.request(9);
    assert_eq!(rig.tick_after(200 * MS - 1), []);
    let both = [(1, 1, false, false), (3, 1, false, false)];
    assert_eq!(asked(&rig.tick_after(1)), both);
}

#[test]
fn the_pause_follows_the_round_trip() {
    for (round_trip_ms, pause_ms) in [(0, 100), (150, 300), (5_000, 1_000), (u64::MAX, 1_000)] {
        let mut rig = Rig::new();
        rig.station.round_trip(Duration::from_millis(round_trip_ms));
        rig.request(7);
        let due = MonotonicNs(rig.now + pause_ms * MS);
        assert_eq!(rig.station.deadline(), Some(due));
    }
}

#[test]
fn without_a_link_or_a_session_a_request_is_refused_at_once() {
    let refused = [(7, Stage::Refused, 37)];
    let mut rig = Rig::new();
    assert_eq!(reports(&rig.request_on(false, 7)), refused);
    rig.station.unknown_session(SESSION);
    assert_eq!(reports(&rig.request(7)), refused);
    assert_eq!(rig.station.open(), 0);
}

#[test]
fn an_open_id_is_busy_and_no_id_is_invalid() {
    let mut rig = Rig::new();
    rig.request(7);
    let refused = reports(&rig.request(7));
    assert_eq!(refused, [(7, Stage::Refused, Reason::StillOpen.code())]);
    let request = ClientRequest {
        handle: 8,
        path_id: 0,
        service: 0,
        expires: MonotonicNs(0),
        bytes: vec![0; 16],
    };
    let out = rig.act(|station, now, out| station.request(request, true, now, out));
    let [Output::Report { report, .. }] = &out[..] else {
        panic!("{out:?}");
    };
    assert_eq!(report.reason(), Some(Reason::InvalidRequest));
    assert_eq!(rig.station.open(), 1);
}

#[test]
fn progress_waits_for_the_first_report_and_is_overtaken_by_the_newest() {
    let mut rig = Rig::new();
    rig.request(7);
    assert_eq!(rig.answer(1, 3, Some(Stage::Progress)), []);
    assert_eq!(rig.answer(1, 2, Some(Stage::Progress)), []);
    assert_eq!(rig.answer(1, 4, Some(Stage::Done)), []);
    assert_eq!(asked(&rig.tick_after(200 * MS)).len(), 1, "asked for soon");
    let out = rig.answer(1, 1, Some(Stage::Accepted));
    assert_eq!(
        reports(&out),
        [(7, Stage::Accepted, 0), (7, Stage::Done, 0)]
    );
    assert_eq!(rig.station.open(), 0);
}

#[test]
fn an_outage_shorter_than_a_minute_ends_with_the_true_report() {
    let mut rig = Rig::new();
    rig.request(7);
    assert_eq!(reports(&rig.tick_after(59 * SECOND)), []);
    rig.answer(1, 0, None);
    assert_eq!(reports(&rig.tick_after(59 * SECOND)), []);
    let out = rig.answer(1, 1, Some(Stage::Done));
    assert_eq!(reports(&out), [(7, Stage::Done, 0)]);
}

#[test]
fn after_a_minute_of_silence_the_outcome_is_unknown_and_the_order_given_up() {
    let mut rig = Rig::new();
    rig.request(7);
    rig.answer(1, 1, Some(Stage::Accepted));
    let out = rig.tick_after(60 * SECOND);
    assert_eq!(reports(&out), [(7, Stage::Unknown, 38)]);
    assert_eq!(asked(&out), [(1, 1, false, true)]);
    assert_eq!(reports(&rig.tick_after(600 * SECOND)), [], "once");
    assert_eq!(rig.answer(1, 2, Some(Stage::Progress)), []);
    assert_eq!(rig.station.open(), 1);
    assert_eq!(
        rig.answer(1, 3, Some(Stage::Done)),
        [],
        "it has its final report"
    );
    assert_eq!(rig.station.open(), 0);
}

#[test]
fn a_final_report_whose_first_one_never_comes_is_handed_on_before_it_is_too_late() {
    let mut rig = Rig::new();
    rig.request(7);
    rig.answer(1, 2, Some(Stage::Done));
    assert_eq!(reports(&rig.tick_after(60 * SECOND)), [(7, Stage::Done, 0)]);
    assert_eq!(rig.station.open(), 0);
}

#[test]
fn a_client_that_goes_gets_nothing_and_its_order_is_given_up_until_it_is_settled() {
    let mut rig = Rig::new();
    rig.request(7);
    assert_eq!(asked(&rig.give_up(7)), [(1, 1, false, true)]);
    assert_eq!(rig.give_up(7), []);
    assert_eq!(rig.answer(1, 1, Some(Stage::Accepted)), []);
    assert_eq!(asked(&rig.tick_after(SECOND)), [(1, 1, false, true)]);
    assert_eq!(rig.answer(1, 2, Some(Stage::Unknown)), []);
    assert_eq!(rig.station.open(), 0);
}

#[test]
fn in_another_session_everything_that_is_open_is_asked_for_as_a_repetition() {
    let mut rig = Rig::new();
    rig.request(7);
    rig.answer(1, 1, Some(Stage::Accepted));
    rig.request(8);
    rig.give_up(8);
    rig.station.unknown_session(SESSION);
    assert_eq!(rig.tick_after(10 * SECOND), [], "nothing to ask in");
    let out = rig.session(88);
    assert_eq!(asked(&out), [(3, 3, true, false), (4, 3, true, true)]);
    assert!(orders(&out).iter().all(|order| order.session == 88));
    assert_eq!(
        rig.session(SESSION),
        [],
        "a late message of the former instance"
    );
    assert_eq!(
        rig.answer(1, 2, Some(Stage::Done)),
        [],
        "of the former session"
    );
    let out = rig.answer_in(88, 3, 1, Some(Stage::Accepted));
    assert_eq!(reports(&out), [], "it was accepted before");
    let out = rig.answer_in(88, 3, 2, Some(Stage::Done));
    assert_eq!(reports(&out), [(7, Stage::Done, 0)]);
}

#[test]
fn a_second_acceptance_is_not_handed_on_however_many_reports_came_before_it_and_the_end_is() {
    for progress in 0..4 {
        for sessions in 1..4 {
            let mut rig = Rig::new();
            rig.request(7);
            let mut seen = Vec::new();
            for session in 0..sessions {
                let (session, number) = (SESSION + session, 1 + session);
                rig.session(session);
                let stages = [Stage::Accepted].into_iter();
                let stages = stages.chain((0..progress).map(|_| Stage::Progress));
                for (serial, stage) in (1..).zip(stages) {
                    let out = rig.answer_in(session, number, serial, Some(stage));
                    seen.extend(reports(&out).iter().map(|(_, stage, _)| *stage));
                }
            }
            let (session, number) = (SESSION + sessions - 1, sessions);
            let out = rig.answer_in(session, number, progress + 2, Some(Stage::Done));
            seen.extend(reports(&out).iter().map(|(_, stage, _)| *stage));
            let progress = progress as usize * sessions as usize;
            let expected = [
                &[Stage::Accepted][..],
                &vec![Stage::Progress; progress],
                &[Stage::Done],
            ]
            .concat();
            assert_eq!(seen, expected, "{sessions} sessions");
            assert_eq!(rig.station.open(), 0);
        }
    }
}

#[test]
fn a_final_report_that_is_held_survives_its_session() {
    let mut rig = Rig::new();
    rig.request(7);
    rig.answer(1, 2, Some(Stage::Done));
    let out = rig.session(88);
    assert_eq!(reports(&out), [(7, Stage::Done, 0)]);
    assert_eq!((orders(&out).len(), rig.station.open()), (0, 0));
}

#[test]
fn an_unknown_session_that_is_not_the_present_one_changes_nothing() {
    let mut rig = Rig::new();
    rig.station.unknown_session(SESSION + 1);
    assert_eq!(asked(&rig.request(7)).len(), 1);
}

#[test]
fn late_messages_of_so_many_former_sessions_are_known_as_such() {
    let mut rig = Rig::new();
    rig.request(7);
    let newest = SESSION + FORMER_SESSIONS as u64 + 1;
    for session in SESSION + 1..=newest {
        assert_eq!(asked(&rig.session(session)).len(), 1);
    }
    for former in SESSION + 1..newest {
        assert_eq!(rig.session(former), [], "{former}");
    }
    assert_eq!(asked(&rig.session(SESSION)).len(), 1, "it is forgotten");
}

#[test]
fn more_open_orders_than_the_bound_are_refused() {
    let mut rig = Rig::new();
    for handle in 1..=OPEN_ORDERS as u64 {
        assert_eq!(reports(&rig.request(handle)), []);
    }
    let refused = reports(&rig.request(1_000));
    let reason = Reason::TooManyRequests.code();
    assert_eq!(refused, [(1_000, Stage::Refused, reason)]);
    rig.answer(5, 1, Some(Stage::Done));
    assert_eq!(reports(&rig.request(1_000)), []);
}

#[test]
fn a_long_movement_moves_to_another_number_and_holds_nothing_up() {
    let mut rig = Rig::new();
    rig.request(0);
    rig.answer(1, 1, Some(Stage::Accepted));
    for handle in 1..MOVE_AFTER {
        rig.request(handle);
        rig.answer(handle + 1, 1, Some(Stage::Done));
    }
    let moved = MOVE_AFTER + 1;
    let out = rig.request(MOVE_AFTER);
    let (long, short) = (moved, moved + 1);
    assert_eq!(
        asked(&out),
        [(long, 1, true, false), (short, 1, false, false)],
        "the floor waits for the answer under the new number"
    );
    assert_eq!(
        rig.answer(1, 2, Some(Stage::Progress)),
        [],
        "the former one"
    );
    let out = rig.answer(long, 2, Some(Stage::Progress));
    assert_eq!(reports(&out), [(0, Stage::Progress, 0)]);
    rig.answer(short, 1, Some(Stage::Done));
    let out = rig.request(1_000);
    assert_eq!(asked(&out), [(short + 1, long, false, false)]);
}

#[test]
fn numbers_end_with_the_window_when_the_oldest_order_is_never_answered() {
    let mut rig = Rig::new();
    rig.request(0);
    for handle in 1..WINDOW {
        rig.request(handle);
        rig.answer(handle + 1, 1, Some(Stage::Done));
    }
    let reason = Reason::TooManyRequests.code();
    let refused = reports(&rig.request(WINDOW));
    assert_eq!(refused, [(WINDOW, Stage::Refused, reason)]);
}

#[test]
fn a_station_without_a_place_is_told_so_and_what_is_open_goes_on_when_it_has_one() {
    let mut rig = Rig::new();
    rig.request(0);
    assert_eq!(rig.session(NO_PLACE), []);
    let reason = Reason::RelayTooManyStations.code();
    assert_eq!(reports(&rig.request(1)), [(1, Stage::Refused, reason)]);
    let down = reports(&rig.request_on(false, 2));
    assert_eq!(down[0].2, Reason::RelayLinkDown.code());
    // That answer was late: the session holds.
    assert_eq!(rig.session(SESSION), []);
    assert_eq!(asked(&rig.request(3)).len(), 1);
    // It was not: another session comes with the place.
    rig.session(NO_PLACE);
    rig.station.unknown_session(SESSION);
    assert_eq!(reports(&rig.request(4)), [(4, Stage::Refused, reason)]);
    let again = asked(&rig.session(SESSION + 1));
    assert_eq!(again.len(), 2, "both are asked for in the other session");
    assert!(again.iter().all(|(_, _, is_repeat, _)| *is_repeat));
}
