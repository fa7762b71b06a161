//! The stations that the robot side remembers.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// Stations that are remembered at the same time: a fleet's three ground stations, each restarted once or twice within the time
/// that an outage takes. One more makes the robot side forget the one that was silent longest, which then gets another session.
pub const SESSIONS: usize = 8;

/// For how long a station counts as there after its last message: six pings.
pub const LIFE_KEPT: Duration = Duration::from_secs(3);

/// What the robot side knows of one life of a station.
#[derive(Clone, Debug)]
pub(super) struct Session {
    pub(super) token: u64,
    /// Life of the station.
    pub(super) station: u64,
    /// Orders with a lower number are settled at the station.
    pub(super) floor: u64,
    heard: MonotonicNs,
    /// That it is silent was reported.
    is_reported: bool,
}

/// The sessions, of which there are at most [`SESSIONS`].
#[derive(Clone, Debug)]
pub(super) struct Sessions {
    sessions: Vec<Session>,
    /// State of the generator of tokens.
    random: u64,
}

impl Session {
    /// When the station has been silent for `link_loss`. None when that was reported.
    pub(super) fn lost_at(&self, link_loss: Duration) -> Option<MonotonicNs> {
        (!self.is_reported).then(|| self.heard + link_loss)
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
            sessions: Vec::with_capacity(SESSIONS),
            random: seed,
        }
    }

    pub(super) fn of(&mut self, token: u64) -> Option<&mut Session> {
        self.sessions
            .iter_mut()
            .find(|session| session.token == token)
    }

    pub(super) fn of_station(&mut self, station: u64) -> Option<&mut Session> {
        self.sessions
            .iter_mut()
            .find(|session| session.station == station)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Session> {
        self.sessions.iter()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Session> {
        self.sessions.iter_mut()
    }

    pub(super) fn begin(&mut self, station: u64, now: MonotonicNs) -> u64 {
        let token = self.fresh_token();
        self.sessions.push(Session {
            token,
            station,
            floor: 0,
            heard: now,
            is_reported: false,
        });
        token
    }

    /// Removes the session that must go before another one can begin: one that was silent for [`LIFE_KEPT`] if there is one, of those
    /// one without open orders, and of those the one that was silent longest.
    pub(super) fn make_room(
        &mut self,
        now: MonotonicNs,
        has_open: impl Fn(&Session) -> bool,
    ) -> Option<Session> {
        if self.sessions.len() < SESSIONS {
            return None;
        }
        let candidates = self.sessions.iter().enumerate();
        let (index, _) = candidates.min_by_key(|(_, session)| {
            let is_there = now.since(session.heard) < LIFE_KEPT;
            (is_there, has_open(session), session.heard)
        })?;
        Some(self.sessions.swap_remove(index))
    }

    /// The next number of SplitMix64. Random enough to tell sessions apart; it keeps no attacker out.
    fn fresh_token(&mut self) -> u64 {
        loop {
            self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut token = self.random;
            token = (token ^ (token >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            token = (token ^ (token >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            token ^= token >> 31;
            if token != 0 && self.of(token).is_none() {
                return token;
            }
        }
    }
}
