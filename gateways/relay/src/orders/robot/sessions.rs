//! The stations that the robot side remembers: at most [`SESSIONS`] instances of stations, each with a session.
//!
//! An instance that is *active*, because a clock message of it came within [`INSTANCE_KEPT`], keeps its session
//! whatever others come; the next instance gets none. Of those that are not active the one that was silent longest goes
//! for a new one.

use std::time::Duration;

use fastrand::Rng;
use ipc_types::MonotonicNs;

use crate::orders::message::{NO_PLACE, NOT_PERMITTED, RelayVerdict, WINDOW};

/// Instances of stations that have a session at the same time: a fleet's three ground stations, each restarted once or
/// twice within the time that an outage takes. One more has to wait, and its requests are refused.
pub const SESSIONS: usize = 8;

/// For how long an instance counts as active after its last clock message: as long as `link_loss_s` by default, so that
/// a station keeps its session through an outage that is none to the movement that it has ordered. A relay that ends
/// and begins anew every two seconds leaves five instances behind that others wait for.
pub const INSTANCE_KEPT: Duration = Duration::from_secs(10);

/// What became of the orders of one session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OrderCounts {
    /// Handed to the robot's processes.
    pub executed: u64,
    /// Refused by the relay, or ended by it because their outcome is not known any more.
    pub refused: u64,
    /// Without a final report yet.
    pub open: usize,
    /// When the last one came that was handed on; 0 before the first.
    pub last: MonotonicNs,
}

impl OrderCounts {
    /// An order is there for the first time.
    pub(super) fn note(&mut self, verdict: Option<RelayVerdict>, now: MonotonicNs) {
        match verdict {
            None => (self.executed, self.last) = (self.executed + 1, now),
            Some(_) => self.refused += 1,
        }
    }
}

/// What the robot side knows of one instance of a station.
#[derive(Clone, Debug)]
pub(super) struct StationSession {
    pub(super) token: u64,
    /// Instance of the station.
    pub(super) station: u64,
    /// What the station is called that has shown this instance first.
    name: String,
    /// Orders with a lower number are settled at the station.
    pub(super) floor: u64,
    /// Which orders from the floor on were here: bit 0 is the floor's. It has [`WINDOW`] bits.
    seen: u128,
    /// What became of its orders; those that are open are counted where they are remembered.
    pub(super) counts: OrderCounts,
    /// When its last clock message came.
    last_ping: MonotonicNs,
    /// When any message of it came.
    last_message: MonotonicNs,
    /// Whether its silence was reported.
    is_reported: bool,
}

const _: () = assert!(WINDOW == u128::BITS as u64);

/// The sessions, of which there are at most [`SESSIONS`].
#[derive(Clone, Debug)]
pub(super) struct Sessions {
    sessions: Vec<StationSession>,
    /// State of the generator of tokens.
    random: Rng,
}

impl StationSession {
    /// When the station has been silent for `link_loss`. `None` if that was reported.
    pub(super) fn lost_at(&self, link_loss: Duration) -> Option<MonotonicNs> {
        (!self.is_reported).then(|| self.last_message + link_loss)
    }

    /// An order has come. Says whether it is one that the station sends: not below the floor, which it may raise, nor
    /// too far above.
    pub(super) fn see(&mut self, number: u64, floor: u64) -> bool {
        let risen = floor.saturating_sub(self.floor);
        let risen = u32::try_from(risen).unwrap_or(u32::MAX);
        self.seen = self.seen.checked_shr(risen).unwrap_or(0);
        self.floor = self.floor.max(floor);
        let Some(place) = number
            .checked_sub(self.floor)
            .filter(|place| *place < WINDOW)
        else {
            return false;
        };
        self.seen |= 1 << place;
        true
    }

    /// Whether all orders before this one were here.
    fn is_in_turn(&self, number: u64) -> bool {
        u64::from(self.seen.trailing_ones()) >= number.saturating_sub(self.floor)
    }

    pub(super) fn note_message(&mut self, now: MonotonicNs) {
        self.last_message = self.last_message.max(now);
        self.is_reported = false;
    }

    pub(super) fn report_loss(&mut self) {
        self.is_reported = true;
    }
}

impl Sessions {
    pub(super) fn new(seed: u64) -> Sessions {
        Sessions {
            sessions: Vec::with_capacity(SESSIONS),
            random: Rng::with_seed(seed),
        }
    }

    pub(super) fn of(&mut self, token: u64) -> Option<&mut StationSession> {
        self.sessions
            .iter_mut()
            .find(|session| session.token == token)
    }

    /// Whether all orders of this session before this one were here.
    pub(super) fn is_in_turn(&self, token: u64, number: u64) -> bool {
        let mut sessions = self.sessions.iter();
        sessions.any(|session| session.token == token && session.is_in_turn(number))
    }

    pub(super) fn of_station(&self, station: u64) -> Option<&StationSession> {
        self.sessions
            .iter()
            .find(|session| session.station == station)
    }

    /// What the station of this instance is called.
    pub(super) fn name_of(&self, station: u64) -> Option<&str> {
        self.of_station(station)
            .map(|session| session.name.as_str())
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &StationSession> {
        self.sessions.iter()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut StationSession> {
        self.sessions.iter_mut()
    }

    /// A clock message of this instance of the station `name` has come: the token of its session, and the session that
    /// was forgotten for it. The token is [`NO_PLACE`] if all sessions are those of active instances, and
    /// [`NOT_PERMITTED`] if the instance is another station's.
    pub(super) fn note_ping(
        &mut self,
        station: u64,
        name: &str,
        now: MonotonicNs,
    ) -> (u64, Option<StationSession>) {
        let mut sessions = self.sessions.iter_mut();
        if let Some(session) = sessions.find(|session| session.station == station) {
            if session.name != name {
                return (NOT_PERMITTED, None);
            }
            session.last_ping = session.last_ping.max(now);
            session.note_message(now);
            return (session.token, None);
        }
        let mut forgotten = None;
        if self.sessions.len() == SESSIONS {
            let Some(index) = self.silent_longest(now) else {
                return (NO_PLACE, None);
            };
            forgotten = Some(self.sessions.swap_remove(index));
        }
        let token = self.fresh_token();
        self.sessions.push(StationSession {
            token,
            station,
            name: name.to_owned(),
            floor: 0,
            seen: 0,
            counts: OrderCounts::default(),
            last_ping: now,
            last_message: now,
            is_reported: false,
        });
        (token, forgotten)
    }

    /// The session whose instance was silent longest of those that are not active.
    fn silent_longest(&self, now: MonotonicNs) -> Option<usize> {
        let sessions = self.sessions.iter().enumerate();
        let silent = sessions.filter(|(_, session)| now.since(session.last_ping) >= INSTANCE_KEPT);
        let longest = silent.min_by_key(|(_, session)| session.last_ping);
        longest.map(|(index, _)| index)
    }

    /// A random number that can be a token: it tells sessions apart, and keeps no attacker out.
    fn fresh_token(&mut self) -> u64 {
        loop {
            let token = self.random.u64(NO_PLACE + 1..);
            if self.of(token).is_none() {
                return token;
            }
        }
    }
}
