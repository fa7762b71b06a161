//! [`Link`]: how the link to a robot is, what its clock shows, and which services it has. A pure value.
//!
//! | state | becomes | when |
//! |---|---|---|
//! | connecting | up | an answer has come, and the clocks are known |
//! | up | down | no answer has come for the configured time |
//! | down | up | an answer has come, and the clocks are known |
//!
//! Requests and samples pass while it is up alone.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, RelayLinkState};
use ipc_types::payload::RelayLink;

use super::catalog::{Catalog, Question};
use crate::clock::{Clock, Exchange, RemoteNs, Suspended};
use crate::message::{Part, Service};
use crate::message::{Ping, Pong};
use crate::orders::message::{NO_PLACE, NOT_PERMITTED};

/// How often the robot is asked for its time. A loss is noticed after some of these, and the clocks need no more.
pub const PING_PERIOD: Duration = Duration::from_millis(500);

/// The same while no answer comes, so that a link that is back is up at once.
const SEARCH_PERIOD: Duration = Duration::from_millis(200);

/// The link to one robot.
#[derive(Debug)]
pub struct Link {
    silent_after: Duration,
    instance: u64,
    state: RelayLinkState,
    since: MonotonicNs,
    last_heard: Option<MonotonicNs>,
    next_ping: MonotonicNs,
    outages: u32,
    clock: Clock,
    /// Instance of the robot's relay. `None` before its first answer.
    robot_instance: Option<u64>,
    session: u64,
    catalog: Catalog,
    /// Whether all services that the robot had at first were described once.
    is_complete: bool,
    wants_latest: bool,
    /// By how much longer the last exchange took than the quickest one of late.
    late: Duration,
}

/// What an answer of the robot has changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Update {
    /// Another instance of the robot's relay has begun: its services must be described anew.
    pub is_other_instance: bool,
    /// The link has come up.
    pub is_up: bool,
}

impl Link {
    /// A link of which nothing is known. `instance` is that of this relay.
    pub fn new(instance: u64, silent_after: Duration, now: MonotonicNs) -> Link {
        Link {
            silent_after,
            instance,
            state: RelayLinkState::Connecting,
            since: now,
            last_heard: None,
            next_ping: now,
            outages: 0,
            clock: Clock::new(),
            robot_instance: None,
            session: NOT_PERMITTED,
            catalog: Catalog::default(),
            is_complete: false,
            wants_latest: true,
            late: Duration::ZERO,
        }
    }

    /// The ping that is due.
    pub fn ping(&mut self, now: MonotonicNs, suspended_ns: u64) -> Option<Ping> {
        if now < self.next_ping {
            return None;
        }
        self.next_ping = now
            + if self.is_up() {
                PING_PERIOD
            } else {
                SEARCH_PERIOD
            };
        Some(Ping {
            station_instance: self.instance,
            sent_ns: now.0,
            suspended_ns,
            wants_latest: self.wants_latest,
            late_ms: self.late_ms(now),
        })
    }

    /// An answer has come, when this machine had been suspended for `suspended_ns`. One that is not for this relay changes nothing.
    pub fn take(&mut self, pong: &Pong, at: MonotonicNs, suspended_ns: u64) -> Update {
        let mut update = Update::default();
        if pong.station_instance != self.instance {
            return update;
        }
        if self.robot_instance != Some(pong.robot_instance) {
            self.robot_instance = Some(pong.robot_instance);
            self.catalog = Catalog::default();
            self.wants_latest = true;
            update.is_other_instance = true;
        }
        self.session = pong.session;
        self.catalog.expect(pong.services);
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
        let quickest = self.clock.estimate(at).map(|of| of.round_trip_ns);
        self.late = took.saturating_sub(quickest.map_or(took, Duration::from_nanos));
        self.last_heard = Some(at);
        if self.state != RelayLinkState::Up && self.clock.estimate(at).is_some() {
            self.change(RelayLinkState::Up, at);
            update.is_up = true;
        }
        update
    }

    /// By how much longer the last exchange took than the quickest, or the next one is overdue.
    fn late_ms(&self, now: MonotonicNs) -> u32 {
        let heard = self.last_heard.map_or(Duration::ZERO, |at| now.since(at));
        let overdue = heard.saturating_sub(2 * PING_PERIOD);
        u32::try_from(self.late.max(overdue).as_millis()).unwrap_or(u32::MAX)
    }

    /// A sample has come: the robot need not send the latest ones again.
    pub fn hear_sample(&mut self) {
        self.wants_latest = false;
    }

    /// The time passes. Says whether the link has gone down.
    pub fn pass(&mut self, now: MonotonicNs) -> bool {
        let heard = self.last_heard.unwrap_or(self.since);
        if !self.is_up() || now.since(heard) < self.silent_after {
            return false;
        }
        self.change(RelayLinkState::Down, now);
        self.outages = self.outages.saturating_add(1);
        self.wants_latest = true;
        self.next_ping = now;
        true
    }

    fn change(&mut self, state: RelayLinkState, now: MonotonicNs) {
        self.state = state;
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

    /// A part of a description has come. Says which service is described by now that was not before.
    pub fn take_part(&mut self, part: &Part) -> Option<Service> {
        match self.robot_instance == Some(part.robot_instance) {
            true => self.catalog.take(part),
            false => None,
        }
    }

    /// When something is to be done though nothing comes.
    pub fn deadline(&self) -> MonotonicNs {
        let silent = match self.last_heard {
            Some(heard) if self.is_up() => heard + self.silent_after,
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
        row.last_heard_ns = self.last_heard.unwrap_or_default().0;
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

    /// What the robot's clock shows.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Whether the robot's relay lets this station command, as it said in its last answer.
    pub fn may_command(&self) -> bool {
        self.session != NOT_PERMITTED
    }

    /// Why the robot's relay takes no requests from this station, as it said in its last answer; [`Reason::None`] when it takes
    /// them, and before the first answer.
    pub fn refusal(&self) -> Reason {
        match (self.robot_instance, self.session) {
            (Some(_), NOT_PERMITTED) => Reason::RelayNotPermitted,
            (Some(_), NO_PLACE) => Reason::RelayTooManyStations,
            _ => Reason::None,
        }
    }

    /// Instance of the robot's relay.
    pub fn robot_instance(&self) -> Option<u64> {
        self.robot_instance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INSTANCE: u64 = 5;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn link() -> Link {
        Link::new(INSTANCE, Duration::from_millis(2000), at(0))
    }

    /// The answer of a robot whose clock shows an hour more, 10 ms after the ping.
    fn pong(robot_instance: u64, ping: &Ping, services: u16) -> Pong {
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
            services,
        }
    }

    fn answered(link: &mut Link, now: u64, robot_instance: u64, services: u16) -> Update {
        let ping = link.ping(at(now), 0).expect("it is due");
        link.take(&pong(robot_instance, &ping, services), at(now + 10), 0)
    }

    #[test]
    fn the_first_answer_brings_the_link_up_and_silence_takes_it_down() {
        let mut link = link();
        assert_eq!(link.state, RelayLinkState::Connecting);
        let update = answered(&mut link, 0, 1, 0);
        assert!(update.is_up && update.is_other_instance && link.is_up());
        assert!(link.ping(at(100), 0).is_none());
        assert!(!link.pass(at(2009)));
        assert!(link.pass(at(2010)) && !link.is_up());
        assert_eq!((link.outages, link.deadline()), (1, at(2010)));
        assert!(answered(&mut link, 2010, 1, 0).is_up);
        assert!(!answered(&mut link, 2600, 1, 0).is_up, "it is up already");
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
                late_ms: 0,
            };
            let pong = Pong {
                session,
                ..pong(1, &ping, 0)
            };
            link.take(&pong, at(10), 0);
            assert_eq!(link.refusal(), expected, "{session}");
        }
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
        let service = Service {
            key: "a/b".to_owned(),
            takes_requests: false,
            schema: String::new(),
        };
        let part = |robot_instance, index| service.part(robot_instance, index, 0).unwrap();
        assert_eq!(link.take_part(&part(8, 0)), None, "of another instance");
        assert_eq!(link.take_part(&part(9, 0)), Some(service.clone()));
        link.note_complete();
        assert_eq!(link.shown_state(), RelayLinkState::Connecting);
        assert_eq!(link.take_part(&part(9, 1)), Some(service.clone()));
        link.note_complete();
        assert_eq!(link.shown_state(), RelayLinkState::Up);
        assert!(answered(&mut link, 2000, 10, 1).is_other_instance);
        assert_eq!(
            link.take_part(&part(9, 0)),
            None,
            "that was another instance"
        );
        assert_eq!(link.question(at(2100)), Some((10, question(0))));
    }

    #[test]
    fn the_latest_samples_are_asked_for_until_one_comes_and_again_after_an_outage() {
        let mut link = link();
        assert!(link.ping(at(0), 0).unwrap().wants_latest);
        let _ = answered(&mut link, 500, 1, 0);
        link.hear_sample();
        assert!(!link.ping(at(1000), 0).unwrap().wants_latest);
        assert!(link.pass(at(5000)));
        assert!(link.ping(at(5000), 0).unwrap().wants_latest);
    }

    #[test]
    fn a_ping_says_by_how_much_the_last_answer_was_late_or_the_next_one_is_overdue() {
        let mut link = link();
        let _ = answered(&mut link, 0, 1, 0);
        let ping = link.ping(at(1000), 0).unwrap();
        assert_eq!(ping.late_ms, 0);
        link.take(&pong(1, &ping, 0), at(1410), 0);
        assert_eq!(link.ping(at(1500), 0).unwrap().late_ms, 400);
        assert_eq!(link.ping(at(3000), 0).unwrap().late_ms, 590);
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
