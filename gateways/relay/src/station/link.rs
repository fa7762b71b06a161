//! [`RobotLink`]: how the link to a robot is, what its clock shows, and which services it has. A pure value.
//!
//! | state | becomes | when |
//! |---|---|---|
//! | connecting | up | an answer has come, and the clocks are known |
//! | up | down | no answer has come for the configured time |
//! | down | up | an answer has come, and the clocks are known |
//!
//! Requests and samples pass while it is up alone. Of two robots that answer under one number it keeps to the first:
//! see `twins`.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, RelayLinkState};
use ipc_types::payload::RelayLink;

use super::catalog::{Catalog, Question};
use super::twins::Twins;
use crate::clock::{Clock, Exchange, RemoteNs, Suspended};
use crate::message::{PING_PERIOD, Part, Ping, Pong, Service};
use crate::orders::message::{NO_PLACE, NOT_PERMITTED};

/// How often the robot is asked while no answer comes, so that a link that is back is up at once, and until all is
/// described: over a link that loses much, TCP and QUIC find a loss by what comes after it.
const SEARCH_PERIOD: Duration = Duration::from_millis(200);

/// A robot that has not answered for so long since the beginning, or since the link went down, may never: an operator
/// is told what to look at. Longer than an attempt to connect takes.
const HINT_AFTER: Duration = Duration::from_secs(10);

/// Pings without an answer that are remembered. The oldest says how late the answer is, and of the others some come to
/// be the oldest.
const UNANSWERED: usize = 32;

/// The link to one robot.
#[derive(Debug)]
pub struct RobotLink {
    silent_after: Duration,
    instance: u64,
    state: RelayLinkState,
    since: MonotonicNs,
    last_answer: Option<MonotonicNs>,
    next_ping: MonotonicNs,
    outages: u32,
    /// Whether it was said that nothing comes, since the link was up last.
    has_hinted: bool,
    clock: Clock,
    /// Instance of the robot's relay. `None` before its first answer.
    robot_instance: Option<u64>,
    twins: Twins,
    session: u64,
    catalog: Catalog,
    /// Whether all services that the robot had at first were described once.
    is_complete: bool,
    latest: Latest,
    /// By how much longer the last exchange took than the quickest one of late, if it began after `measured_from`.
    late: Option<Duration>,
    quickest: Duration,
    /// How long the last exchange took.
    round_trip: Duration,
    /// When all was described: an exchange that began before may have waited behind a part.
    measured_from: Option<MonotonicNs>,
    /// When the pings were sent that have no answer yet, oldest first, at most [`UNANSWERED`].
    unanswered: VecDeque<MonotonicNs>,
}

/// What the station has of samples that were published before it could take any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Latest {
    /// Nothing: the robot is asked to send the latest sample of each topic again, as soon as all topics are described.
    /// The first ping that asked so.
    Wanted(Option<MonotonicNs>),
    /// The robot has said that it was asked.
    Coming,
    /// They came.
    Here,
}

/// What an answer of the robot has changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Update {
    /// Another instance of the robot's relay has begun: its services must be described anew.
    pub is_other_instance: bool,
    /// The link has come up.
    pub is_up: bool,
}

impl RobotLink {
    /// A link of which nothing is known. `instance` is that of this relay.
    pub fn new(instance: u64, silent_after: Duration, now: MonotonicNs) -> RobotLink {
        RobotLink {
            silent_after,
            instance,
            state: RelayLinkState::Connecting,
            since: now,
            last_answer: None,
            next_ping: now,
            outages: 0,
            has_hinted: false,
            clock: Clock::new(),
            robot_instance: None,
            twins: Twins::default(),
            session: NOT_PERMITTED,
            catalog: Catalog::default(),
            is_complete: false,
            latest: Latest::Wanted(None),
            late: None,
            quickest: Duration::ZERO,
            round_trip: Duration::ZERO,
            measured_from: None,
            unanswered: VecDeque::new(),
        }
    }

    /// The ping that is due.
    pub fn ping(&mut self, now: MonotonicNs, suspended_ns: u64) -> Option<Ping> {
        if now < self.next_ping {
            return None;
        }
        self.next_ping = now
            + if self.is_up() && self.is_complete {
                PING_PERIOD
            } else {
                SEARCH_PERIOD
            };
        // What is not described cannot be provided here, and would take the place of the description on a narrow link.
        let wants_latest =
            self.latest != Latest::Here && self.is_up() && self.catalog.is_complete();
        if wants_latest && self.latest == Latest::Wanted(None) {
            self.latest = Latest::Wanted(Some(now));
        }
        if !self.catalog.is_complete() {
            self.measured_from = None;
        } else if self.measured_from.is_none() && self.is_up() {
            self.measured_from = Some(now);
            self.unanswered.clear();
            self.late = None;
        }
        let late_ms = self.late_ms(now);
        if self.unanswered.len() < UNANSWERED {
            self.unanswered.push_back(now);
        }
        Some(Ping {
            station_instance: self.instance,
            sent_ns: now.0,
            suspended_ns,
            wants_latest,
            has_all: self.is_complete,
            late_ms,
        })
    }

    /// An answer has come, when this machine had been suspended for `suspended_ns`. One that is not for this relay
    /// changes nothing.
    pub fn take(&mut self, pong: &Pong, at: MonotonicNs, suspended_ns: u64) -> Update {
        let mut update = Update::default();
        if pong.station_instance != self.instance {
            return update;
        }
        if self.robot_instance == Some(pong.robot_instance) {
            self.twins.note_own(pong);
        } else {
            let last = self.last_answer.filter(|_| self.is_up());
            let silent = last.map(|last| at.since(last));
            if !self.twins.note_other(pong, silent, at) {
                return update;
            }
            self.robot_instance = Some(pong.robot_instance);
            self.catalog = Catalog::default();
            self.latest = Latest::Wanted(None);
            update.is_other_instance = true;
        }
        if let Latest::Wanted(Some(asked)) = self.latest
            && pong.ping_sent_ns >= asked.0
        {
            self.latest = Latest::Coming;
        }
        self.session = pong.session;
        self.catalog.expect(pong.pages);
        let exchange = Exchange {
            sent: MonotonicNs(pong.ping_sent_ns),
            remote_received: RemoteNs(pong.received_ns),
            remote_sent: RemoteNs(pong.sent_ns),
            received: at,
            suspended: Suspended {
                at_sent_ns: pong.ping_suspended_ns,
                remote_ns: pong.suspended_ns,
                at_received_ns: suspended_ns,
            },
        };
        if let Err(error) = self.clock.take(&exchange) {
            tracing::debug!(%error, "an exchange of time stamps says nothing");
        }
        let there = Duration::from_nanos(pong.sent_ns.saturating_sub(pong.received_ns));
        let took = at.since(exchange.sent).saturating_sub(there);
        self.round_trip = took;
        let quickest = self.clock.estimate(at).map(|of| of.round_trip_ns);
        self.quickest = quickest.map_or(took, Duration::from_nanos);
        let is_measured = self.measured_from.is_some_and(|from| exchange.sent >= from);
        self.late = is_measured.then(|| took.saturating_sub(self.quickest));
        self.unanswered.retain(|sent| *sent > exchange.sent);
        self.last_answer = Some(at);
        if self.state != RelayLinkState::Up && self.clock.estimate(at).is_some() {
            self.change(RelayLinkState::Up, at);
            update.is_up = true;
        }
        update
    }

    /// By how much longer the last exchange took than the quickest, or the next one takes already. `None` if none has
    /// ended yet, since nobody knows how long the way is, or if it may have waited behind a description.
    fn late_ms(&self, now: MonotonicNs) -> Option<u32> {
        self.measured_from?;
        let oldest = self.unanswered.front();
        let waits = oldest.map_or(Duration::ZERO, |sent| now.since(*sent));
        let overdue = waits.saturating_sub(self.quickest);
        if self.late.is_none() && overdue.is_zero() {
            return None;
        }
        let late = self.late.unwrap_or_default().max(overdue);
        Some(u32::try_from(late.as_millis()).unwrap_or(u32::MAX))
    }

    /// A sample has come: the robot need not send the latest ones again, if it was asked to.
    pub fn note_sample(&mut self) {
        if self.latest == Latest::Coming {
            self.latest = Latest::Here;
        }
    }

    /// The time passes. Says whether the link has gone down.
    pub fn tick(&mut self, now: MonotonicNs) -> bool {
        self.twins.tick(now);
        let last = self.last_answer.unwrap_or(self.since);
        if !self.is_up() || now.since(last) < self.silent_after {
            return false;
        }
        self.change(RelayLinkState::Down, now);
        self.outages = self.outages.saturating_add(1);
        self.latest = Latest::Wanted(None);
        self.next_ping = now;
        true
    }

    /// Whether it is to be said that nothing has come for long: once for each time that the link is not up.
    pub fn take_hint(&mut self, now: MonotonicNs) -> bool {
        let is_due = !self.is_up() && !self.has_hinted && now.since(self.since) >= HINT_AFTER;
        self.has_hinted |= is_due;
        is_due
    }

    fn change(&mut self, state: RelayLinkState, now: MonotonicNs) {
        self.state = state;
        self.has_hinted = false;
        self.since = now;
    }

    /// The instance of the robot's relay, and what is to be asked about its services now.
    pub fn question(&mut self, now: MonotonicNs) -> Option<(u64, Question)> {
        let robot_instance = self.robot_instance.filter(|_| self.is_up())?;
        Some((robot_instance, self.catalog.question(now)?))
    }

    /// Takes note whether all that the robot has is described.
    pub fn note_complete(&mut self) {
        self.is_complete |= self.is_up() && self.catalog.is_complete();
    }

    /// State of the link as operators see it: up when they can use what the robot has.
    pub fn shown_state(&self) -> RelayLinkState {
        match self.state {
            RelayLinkState::Up if !self.is_complete => RelayLinkState::Connecting,
            state => state,
        }
    }

    /// A part of a page of descriptions has come. Says which services are described by now that were not before.
    pub fn take_part(&mut self, part: &Part) -> Vec<Service> {
        if self.robot_instance != Some(part.robot_instance) {
            return Vec::new();
        }
        let services = self.catalog.take(part);
        if !services.is_empty() && self.catalog.is_complete() {
            self.latest = Latest::Wanted(None);
        }
        services
    }

    /// When something is to be done though nothing comes.
    pub fn deadline(&self) -> MonotonicNs {
        let silent = match self.last_answer {
            Some(last) if self.is_up() => last + self.silent_after,
            _ => MonotonicNs(u64::MAX),
        };
        let question = self.catalog.deadline().filter(|_| self.is_up());
        self.next_ping
            .min(silent)
            .min(question.unwrap_or(MonotonicNs(u64::MAX)))
    }

    /// Whether the link is up.
    pub fn is_up(&self) -> bool {
        self.state == RelayLinkState::Up
    }

    /// Writes how the link is, and what the robot's clock shows, into what is published.
    pub fn fill(&self, row: &mut RelayLink, now: MonotonicNs) {
        row.since_ns = self.since.0;
        row.last_heard_ns = self.last_answer.unwrap_or_default().0;
        row.state = self.shown_state().code();
        row.outages = self.outages;
        row.clock_resets = u32::try_from(self.clock.resets()).unwrap_or(u32::MAX);
        if let Some(estimate) = self.clock.estimate(now) {
            row.clock_offset_ns = estimate.offset_ns;
            row.clock_uncertainty_s = estimate.uncertainty_ns as f64 * 1e-9;
            row.round_trip_s = estimate.round_trip_ns as f64 * 1e-9;
            row.clock_drift_ppb = i32::try_from(estimate.drift_ppb).unwrap_or_default();
            row.clock_valid = 1;
        }
    }

    /// How long the last exchange took: an answer to what is sent now comes about then.
    pub fn round_trip(&self) -> Duration {
        self.round_trip
    }

    /// What the robot's clock shows.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The session of this station, as the robot's relay said in its last answer.
    pub fn session(&self) -> u64 {
        self.session
    }

    /// Whether the robot's relay lets this station command, as it said in its last answer.
    pub fn may_command(&self) -> bool {
        self.session != NOT_PERMITTED
    }

    /// Why the robot takes no requests from this station: as its relay said in its last answer, or because there are
    /// two. [`Reason::None`] when it takes them, and before the first answer.
    pub fn refusal(&self) -> Reason {
        match (self.robot_instance, self.session) {
            _ if self.twins.twin().is_some() => Reason::RelayTwoRobots,
            (Some(_), NOT_PERMITTED) => Reason::RelayNotPermitted,
            (Some(_), NO_PLACE) => Reason::RelayTooManyStations,
            _ => Reason::None,
        }
    }

    /// The instances of two robots that answer under one number: the station's robot, and the one that it refuses.
    pub fn two_robots(&self) -> Option<[u64; 2]> {
        Some([self.robot_instance?, self.twins.twin()?])
    }

    /// Whether an answer is for this relay, and of the robot that it keeps to.
    pub fn is_of_robot(&self, pong: &Pong) -> bool {
        pong.station_instance == self.instance && self.robot_instance == Some(pong.robot_instance)
    }

    /// Instance of the robot's relay.
    pub fn robot_instance(&self) -> Option<u64> {
        self.robot_instance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::ServicesPage;

    const INSTANCE: u64 = 5;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn link() -> RobotLink {
        RobotLink::new(INSTANCE, Duration::from_millis(2000), at(0))
    }

    fn service() -> Service {
        Service {
            key: "a/b".to_owned(),
            takes_requests: false,
            schema: String::new(),
        }
    }

    /// The answer of a robot whose clock shows an hour more, 10 ms after the ping.
    fn pong(robot_instance: u64, ping: &Ping, pages: u16) -> Pong {
        let robot_ns = ping.sent_ns + 3_600_000_000_000 + 5_000_000;
        Pong {
            robot_instance,
            station_instance: ping.station_instance,
            ping_sent_ns: ping.sent_ns,
            ping_suspended_ns: ping.suspended_ns,
            received_ns: robot_ns,
            sent_ns: robot_ns,
            suspended_ns: 0,
            session: 2,
            pages,
        }
    }

    fn answered(link: &mut RobotLink, now: u64, robot_instance: u64, pages: u16) -> Update {
        let ping = link.ping(at(now), 0).expect("it is due");
        link.take(&pong(robot_instance, &ping, pages), at(now + 10), 0)
    }

    #[test]
    fn the_first_answer_brings_the_link_up_and_silence_takes_it_down() {
        let mut link = link();
        assert_eq!(link.state, RelayLinkState::Connecting);
        let update = answered(&mut link, 0, 1, 0);
        assert!(update.is_up && update.is_other_instance && link.is_up());
        assert!(link.ping(at(100), 0).is_none());
        assert!(!link.tick(at(2009)));
        assert!(link.tick(at(2010)) && !link.is_up());
        assert_eq!((link.outages, link.deadline()), (1, at(2010)));
        assert!(answered(&mut link, 2010, 1, 0).is_up);
        assert!(!answered(&mut link, 2600, 1, 0).is_up, "it is up already");
    }

    #[test]
    fn a_robot_that_does_not_answer_for_ten_seconds_is_reported_once() {
        let mut link = link();
        assert!(!link.take_hint(at(9_999)) && link.take_hint(at(10_000)));
        assert!(!link.take_hint(at(60_000)));
        let _ = answered(&mut link, 60_000, 1, 0);
        assert!(!link.take_hint(at(61_000)));
        assert!(link.tick(at(63_000)) && !link.take_hint(at(72_999)));
        assert!(link.take_hint(at(73_000)) && !link.take_hint(at(74_000)));
    }

    #[test]
    fn a_robot_that_takes_no_requests_from_this_station_says_why() {
        let mut link = link();
        assert_eq!(link.refusal(), Reason::None);
        for (session, expected) in [
            (0, Reason::RelayNotPermitted),
            (NO_PLACE, Reason::RelayTooManyStations),
            (NO_PLACE + 1, Reason::None),
        ] {
            let ping = Ping {
                station_instance: INSTANCE,
                sent_ns: 0,
                suspended_ns: 0,
                wants_latest: false,
                has_all: false,
                late_ms: None,
            };
            let pong = Pong {
                session,
                ..pong(1, &ping, 0)
            };
            link.take(&pong, at(10), 0);
            assert_eq!(link.refusal(), expected, "{session}");
        }
    }

    /// A station pings twice a second for so long; `alive` says which robots answer at each ms. Returns what the
    /// station keeps to, and whether it orders.
    fn heard(link: &mut RobotLink, ms: std::ops::Range<u64>, alive: &[u64]) -> (Option<u64>, bool) {
        for now in ms {
            link.tick(at(now));
            let Some(ping) = link.ping(at(now), 0) else {
                continue;
            };
            for robot in alive {
                link.take(&pong(*robot, &ping, 0), at(now + 10), 0);
                link.note_complete();
            }
        }
        (link.robot_instance(), link.refusal() == Reason::None)
    }

    #[test]
    fn of_two_robots_of_one_number_the_first_is_kept_and_none_is_ordered_until_one_is_gone() {
        for both in [[1, 2], [2, 1]] {
            let mut link = link();
            assert_eq!(heard(&mut link, 0..5_000, &[1]), (Some(1), true));
            assert_eq!(heard(&mut link, 5_000..6_100, &both), (Some(1), false));
            assert_eq!(link.two_robots(), Some([1, 2]));
            assert_eq!(heard(&mut link, 6_100..60_000, &both), (Some(1), false));
            assert_eq!(link.clock().resets(), 0);
            let mut second_goes = link;
            assert!(!heard(&mut second_goes, 60_000..69_000, &[1]).1);
            assert_eq!(
                heard(&mut second_goes, 69_000..71_000, &[1]),
                (Some(1), true)
            );
            assert_eq!(second_goes.outages, 0);
        }
        let mut link = link();
        heard(&mut link, 0..5_000, &[1]);
        heard(&mut link, 5_000..9_000, &[1, 2]);
        assert_eq!(
            heard(&mut link, 9_000..13_000, &[2]),
            (Some(2), true),
            "the first is gone"
        );
    }

    #[test]
    fn a_relay_that_is_started_again_takes_the_place_of_the_one_before_within_a_second() {
        let mut link = link();
        heard(&mut link, 0..5_000, &[1]);
        assert_eq!(heard(&mut link, 5_000..6_600, &[2]), (Some(2), true));
        assert_eq!(link.outages, 0);
        // What the one before had answered comes late.
        let ping = Ping {
            sent_ns: at(4_500).0,
            ..link.ping(at(7_000), 0).unwrap()
        };
        link.take(&pong(1, &ping, 0), at(7_000), 0);
        assert_eq!(heard(&mut link, 7_001..9_000, &[2]), (Some(2), true));
    }

    #[test]
    fn the_robot_s_clock_is_known() {
        let mut link = link();
        let _ = answered(&mut link, 0, 1, 0);
        let robot = link.clock().to_remote(at(10)).unwrap().0;
        let truth = at(10).0 + 3_600_000_000_000;
        assert!(robot.abs_diff(truth) <= 5_100_000, "{robot} {truth}");
    }

    #[test]
    fn services_are_asked_about_while_the_link_is_up_and_anew_in_another_instance_of_the_robot_s_relay()
     {
        let mut link = link();
        assert_eq!(link.question(at(0)), None);
        let _ = answered(&mut link, 0, 9, 2);
        let question = |index| Question { index, from: 0 };
        assert_eq!(link.question(at(10)), Some((9, question(0))));
        let service = service();
        let page = ServicesPage::of(std::slice::from_ref(&service)).remove(0);
        let part = |robot_instance, index| page.part(robot_instance, index, 0).unwrap();
        assert_eq!(link.take_part(&part(8, 0)), [], "of another instance");
        assert_eq!(link.take_part(&part(9, 0)), std::slice::from_ref(&service));
        link.note_complete();
        assert_eq!(link.shown_state(), RelayLinkState::Connecting);
        assert_eq!(link.take_part(&part(9, 1)), [service]);
        link.note_complete();
        assert_eq!(link.shown_state(), RelayLinkState::Up);
        assert!(answered(&mut link, 2000, 10, 1).is_other_instance);
        assert_eq!(link.take_part(&part(9, 0)), [], "that was another instance");
        assert_eq!(link.question(at(2100)), Some((10, question(0))));
    }

    #[test]
    fn the_latest_samples_are_asked_for_when_all_is_described_until_one_comes_and_again_after_an_outage()
     {
        let mut link = link();
        let service = service();
        let asks = |link: &mut RobotLink, ms| {
            let ping = link.ping(at(ms), 0).unwrap();
            (ping.wants_latest, ping)
        };
        assert!(!asks(&mut link, 0).0, "nothing is known");
        let _ = answered(&mut link, 500, 1, 1);
        assert!(!asks(&mut link, 1000).0, "it is not described");
        let page = ServicesPage::of(&[service]).remove(0);
        assert_eq!(link.take_part(&page.part(1, 0, 0).unwrap()).len(), 1);
        link.note_sample();
        let (is_asked, ping) = asks(&mut link, 1500);
        assert!(is_asked, "that came before it was asked for");
        link.note_sample();
        assert!(asks(&mut link, 2000).0, "that may have been under way");
        link.take(&pong(1, &ping, 1), at(2010), 0);
        assert!(asks(&mut link, 2500).0, "none has come");
        link.note_sample();
        assert!(!asks(&mut link, 3000).0);
        assert!(link.tick(at(6000)));
        assert!(!asks(&mut link, 6000).0, "it is down");
        assert!(answered(&mut link, 6200, 1, 1).is_up);
        assert!(asks(&mut link, 6700).0);
    }

    #[test]
    fn a_ping_says_by_how_much_the_last_answer_was_late_or_the_next_one_is_overdue() {
        let mut link = link();
        let ping = |link: &mut RobotLink, ms| link.ping(at(ms), 0).unwrap();
        assert_eq!(ping(&mut link, 0).late_ms, None);
        let _ = answered(&mut link, 200, 1, 0);
        let first = ping(&mut link, 1000);
        assert_eq!(first.late_ms, None, "none has ended since all is described");
        link.take(&pong(1, &first, 0), at(1410), 0);
        assert_eq!(ping(&mut link, 1500).late_ms, Some(400));
        assert_eq!(ping(&mut link, 2000).late_ms, Some(490));
        assert_eq!(ping(&mut link, 3000).late_ms, Some(1490));
    }

    #[test]
    fn while_descriptions_come_nobody_knows_how_late_an_answer_is() {
        let mut link = link();
        let page = ServicesPage::of(&[service()]).remove(0);
        let ping = |link: &mut RobotLink, ms| link.ping(at(ms), 0).unwrap();
        let _ = answered(&mut link, 0, 1, 1);
        let first = ping(&mut link, 500);
        link.take(&pong(1, &first, 1), at(1200), 0);
        let behind_a_part = ping(&mut link, 1200);
        assert_eq!(behind_a_part.late_ms, None);
        assert_eq!(ping(&mut link, 3000).late_ms, None);
        assert!(!ping(&mut link, 3200).has_all);
        assert_eq!(link.take_part(&page.part(1, 0, 0).unwrap()).len(), 1);
        link.note_complete();
        let clean = ping(&mut link, 3500);
        assert!(clean.has_all);
        link.take(&pong(1, &behind_a_part, 1), at(3600), 0);
        // What was asked before does not count; that the clean one takes 490 ms longer already does.
        assert_eq!(ping(&mut link, 4000).late_ms, Some(490));
        link.take(&pong(1, &clean, 1), at(4200), 0);
        assert_eq!(ping(&mut link, 4500).late_ms, Some(690));
    }

    #[test]
    fn an_answer_to_another_station_of_this_name_changes_nothing() {
        let mut link = link();
        let ping = link.ping(at(0), 0).unwrap();
        let other = Pong {
            station_instance: INSTANCE + 1,
            ..pong(1, &ping, 0)
        };
        assert_eq!(link.take(&other, at(1), 0), Update::default());
        assert_eq!(link.state, RelayLinkState::Connecting);
    }
}
