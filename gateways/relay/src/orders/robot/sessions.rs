//! The stations that the robot side remembers.

use std::time::Duration;

use ipc_types::MonotonicNs;

use super::places::{Heard, Places};
use crate::orders::WINDOW;
use crate::orders::message::NO_PLACE;
use crate::orders::verdict::Verdict;

/// What became of the orders of one session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OrderCounts {
    /// Handed to the robot's processes.
    pub executed: u64,
    /// Refused by the relay, or ended by it because their outcome is not known any more.
    pub refused: u64,
    /// Without a final report yet.
    pub open: usize,
}

impl OrderCounts {
    /// An order is there for the first time.
    pub(super) fn note(&mut self, verdict: Option<Verdict>) {
        match verdict {
            None => self.executed += 1,
            Some(_) => self.refused += 1,
        }
    }
}

/// What the robot side knows of one life of a station.
#[derive(Clone, Debug)]
pub(super) struct Session {
    pub(super) token: u64,
    /// Life of the station.
    pub(super) station: u64,
    /// Orders with a lower number are settled at the station.
    pub(super) floor: u64,
    /// Which orders from the floor on were here: bit 0 is the floor's. It has [`WINDOW`] bits.
    seen: u128,
    /// What became of its orders; those that are open are counted where they are remembered.
    pub(super) counts: OrderCounts,
    /// When any message of it came.
    heard: MonotonicNs,
    /// That it is silent was reported.
    is_reported: bool,
}

const _: () = assert!(WINDOW == u128::BITS as u64);

/// The sessions, of which there are at most [`SESSIONS`](super::SESSIONS).
#[derive(Clone, Debug)]
pub(super) struct Sessions {
    sessions: Places<Session>,
    /// State of the generator of tokens.
    random: u64,
}

impl Session {
    /// When the station has been silent for `link_loss`. None when that was reported.
    pub(super) fn lost_at(&self, link_loss: Duration) -> Option<MonotonicNs> {
        (!self.is_reported).then(|| self.heard + link_loss)
    }

    /// An order has come. Says whether it is one that the station sends: not below the floor, which it may raise, nor too far above.
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

    pub(super) fn hear(&mut self, now: MonotonicNs) {
        self.heard = self.heard.max(now);
        self.is_reported = false;
    }

    pub(super) fn report_loss(&mut self) {
        self.is_reported = true;
    }
}

impl Sessions {
    pub(super) fn new(seed: u64) -> Sessions {
        Sessions {
            sessions: Places::default(),
            random: seed,
        }
    }

    pub(super) fn of(&mut self, token: u64) -> Option<&mut Session> {
        self.sessions
            .iter_mut()
            .find(|session| session.token == token)
    }

    /// Whether all orders of this session before this one were here.
    pub(super) fn is_in_turn(&self, token: u64, number: u64) -> bool {
        let mut sessions = self.sessions.iter();
        sessions.any(|session| session.token == token && session.is_in_turn(number))
    }

    pub(super) fn of_station(&self, station: u64) -> Option<&Session> {
        self.sessions.of(station)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Session> {
        self.sessions.iter()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Session> {
        self.sessions.iter_mut()
    }

    /// A clock message of this life of a station has come: the token of its session, and the session that was forgotten for it.
    /// Without a place for it, the token is [`NO_PLACE`].
    pub(super) fn hear(&mut self, station: u64, now: MonotonicNs) -> (u64, Option<Session>) {
        match self.sessions.hear(station, now) {
            Heard::NoPlace => (NO_PLACE, None),
            Heard::Known => {
                let mut sessions = self.sessions.iter_mut();
                let session = sessions.find(|session| session.station == station);
                let token = session.map(|session| {
                    session.hear(now);
                    session.token
                });
                (token.unwrap_or(NO_PLACE), None)
            }
            Heard::New => {
                let token = self.fresh_token();
                let session = Session {
                    token,
                    station,
                    floor: 0,
                    seen: 0,
                    counts: OrderCounts::default(),
                    heard: now,
                    is_reported: false,
                };
                (token, self.sessions.take(station, now, session))
            }
        }
    }

    /// The next number of SplitMix64 that can be a token. Random enough to tell sessions apart; it keeps no attacker out.
    fn fresh_token(&mut self) -> u64 {
        loop {
            self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut token = self.random;
            token = (token ^ (token >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            token = (token ^ (token >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            token ^= token >> 31;
            if token > NO_PLACE && self.of(token).is_none() {
                return token;
            }
        }
    }
}
