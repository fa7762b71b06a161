//! [`Places`]: for which lives of stations the robot side keeps something. A pure value.
//!
//! There are [`SESSIONS`] places. A life that is *active*, because a clock message of it came within [`LIFE_KEPT`], keeps its place
//! whatever others come; the next life has none, and is told so. Of those that are not active the one that was silent longest goes
//! for a new one.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// Lives of stations that have a session at the same time: a fleet's three ground stations, each restarted once or twice within
/// the time that an outage takes. One more has to wait, and its requests are refused.
pub const SESSIONS: usize = 8;

/// For how long a life counts as active after its last clock message: as long as `link_loss_s` by default, so that a station keeps
/// its session through an outage that is none to the movement that it has ordered. A relay that ends and begins anew every two
/// seconds leaves five lives behind that others wait for.
pub const LIFE_KEPT: Duration = Duration::from_secs(10);

/// What is kept for lives, at most [`SESSIONS`].
#[derive(Clone, Debug)]
pub struct Places<T> {
    places: Vec<Place<T>>,
}

#[derive(Clone, Debug)]
struct Place<T> {
    life: u64,
    /// When its last clock message came.
    heard: MonotonicNs,
    kept: T,
}

/// What a life has that has sent a clock message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A place.
    Known,
    /// No place, and it can [get one](Places::take).
    New,
    /// No place, because all are those of active lives.
    NoPlace,
}

impl<T> Default for Places<T> {
    fn default() -> Places<T> {
        Places {
            places: Vec::with_capacity(SESSIONS),
        }
    }
}

impl<T> Places<T> {
    /// A clock message of this life has come.
    pub fn hear(&mut self, life: u64, now: MonotonicNs) -> Heard {
        if let Some(place) = self.places.iter_mut().find(|place| place.life == life) {
            place.heard = place.heard.max(now);
            return Heard::Known;
        }
        match self.places.len() < SESSIONS || self.silent_longest(now).is_some() {
            true => Heard::New,
            false => Heard::NoPlace,
        }
    }

    /// Keeps something for a [new](Heard::New) life. Returns what was kept for the one that has lost its place for it.
    pub fn take(&mut self, life: u64, now: MonotonicNs, kept: T) -> Option<T> {
        let forgotten = match self.places.len() < SESSIONS {
            true => None,
            false => self.silent_longest(now),
        };
        let forgotten = forgotten.map(|index| self.places.swap_remove(index).kept);
        if self.places.len() < SESSIONS {
            self.places.push(Place {
                life,
                heard: now,
                kept,
            });
        }
        forgotten
    }

    /// Where the life is that was silent longest of those that are not active.
    fn silent_longest(&self, now: MonotonicNs) -> Option<usize> {
        let places = self.places.iter().enumerate();
        let silent = places.filter(|(_, place)| now.since(place.heard) >= LIFE_KEPT);
        let longest = silent.min_by_key(|(_, place)| place.heard);
        longest.map(|(index, _)| index)
    }

    /// What is kept for this life.
    pub fn of(&self, life: u64) -> Option<&T> {
        let place = self.places.iter().find(|place| place.life == life);
        place.map(|place| &place.kept)
    }

    /// All that is kept.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.places.iter().map(|place| &place.kept)
    }

    /// The same, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.places.iter_mut().map(|place| &mut place.kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// Eight lives, heard one after the other.
    fn full() -> Places<u64> {
        let mut places = Places::default();
        for life in 1..=SESSIONS as u64 {
            assert_eq!(places.hear(life, at(life)), Heard::New);
            assert_eq!(places.take(life, at(life), 10 * life), None);
        }
        places
    }

    #[test]
    fn an_active_life_is_never_forgotten_for_a_new_one() {
        let mut places = full();
        for ms in (500..60_000).step_by(500) {
            for life in 1..=SESSIONS as u64 {
                assert_eq!(places.hear(life, at(ms)), Heard::Known);
            }
            assert_eq!(places.hear(9, at(ms)), Heard::NoPlace);
            assert_eq!(places.take(9, at(ms), 90), None, "not even by mistake");
        }
        assert_eq!((places.of(1), places.of(9)), (Some(&10), None));
        assert_eq!(places.iter().count(), SESSIONS);
    }

    #[test]
    fn the_life_that_was_silent_longest_makes_room_when_it_is_active_no_more() {
        let mut places = full();
        let kept = LIFE_KEPT.as_millis() as u64;
        assert_eq!(places.hear(1, at(9)), Heard::Known);
        assert_eq!(places.hear(9, at(kept + 1)), Heard::NoPlace);
        assert_eq!(places.hear(9, at(kept + 2)), Heard::New);
        assert_eq!(places.take(9, at(kept + 2), 90), Some(20));
        assert_eq!(places.hear(2, at(kept + 2)), Heard::NoPlace);
        assert_eq!((places.of(1), places.of(9)), (Some(&10), Some(&90)));
    }
}
