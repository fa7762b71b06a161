//! What the simulated DSP's path buffer truly holds, against what the bridge says about it (requirement H1).
//!
//! * While the bridge publishes that the buffer is empty, it is.
//! * It is published to hold waypoints of the path under way only while a path is under way.
//! * When a movement, a hold or a stop is reported as done, it is empty.
//! * The first waypoint of a path is sent to an empty buffer, so none of an ended path is in it.
//! * After an early end the bridge sends *invalidate path* as long as the buffer is not known to be empty and the link
//!   is up, and on a line that loses nothing the buffer is empty soon.
//! * A DSP that has the time-out for the PC holds nothing soon after the bridge is gone.
//!
//! It looks at the simulator, at the published states and reports, and at the wire: never into the bridge.

use std::time::Duration;

use ipc_types::code::{DspPathState, Functionality, LinkState};
use ipc_types::payload::ModuleState;

/// Longest time with the link up between two *invalidate path* while the buffer is not known to be empty: an
/// acknowledgement that may be a late one makes the bridge wait for 2 s, three attempts take 600 ms, and other commands
/// go first.
const ATTEMPT_WITHIN: Duration = Duration::from_secs(6);

/// Longest time from an early end until the buffer is empty, with the link up and a line that loses nothing: the
/// command that is under way, a waypoint and a status on the line, and *invalidate path*.
const EMPTY_WITHIN: Duration = Duration::from_secs(1);

/// Longest time from an early end until the buffer is empty, on a line that loses and damages messages. A DSP that does
/// not hear the bridge flies on for so long at most.
const EMPTY_AT_LAST: Duration = Duration::from_secs(60);

/// Longest time from the end of a bridge until a DSP that was told 2 s has stopped by itself.
const STOPS_WITHIN: Duration = Duration::from_millis(2500);

/// What is looked at.
pub struct Look<'a> {
    pub now: Duration,
    /// Waypoints that the simulated DSP holds.
    pub held: usize,
    /// The state as last published by a bridge that runs.
    pub state: Option<&'a ModuleState>,
    /// *Invalidate path* sent so far.
    pub attempts: usize,
    /// For how long a DSP that stops by itself has been without a bridge.
    pub without_bridge: Duration,
}

/// Judges what the bridge says about the DSP's path buffer by what the simulated DSP holds.
pub struct Buffer {
    is_sound: bool,
    last_look: Duration,
    attempts: usize,
    /// Time with the link up and the buffer not known to be empty, since the last attempt.
    without_attempt: Duration,
    /// Time with the link up and the buffer not empty, since the last path ended.
    after_end: Duration,
    /// How often the buffer held something when a path ended: what would go unseen otherwise.
    pub cleared: u64,
}

impl Buffer {
    pub fn new(is_sound: bool) -> Buffer {
        Buffer {
            is_sound,
            last_look: Duration::ZERO,
            attempts: 0,
            without_attempt: Duration::ZERO,
            after_end: Duration::ZERO,
            cleared: 0,
        }
    }

    /// A movement, a hold or a stop was reported as done.
    pub fn done(&self, what: &str, held: usize) {
        assert_eq!(
            held, 0,
            "{what} is done, but the DSP holds {held} waypoints"
        );
    }

    /// The first waypoint of a path is being sent.
    pub fn path_begins(&mut self, held: usize) {
        assert_eq!(held, 0, "a path begins, but the DSP holds {held} waypoints");
    }

    /// A movement ended early, or the bridge died.
    pub fn ended_early(&mut self, held: usize) {
        self.cleared += u64::from(held > 0);
    }

    /// Looks at everything; at each step.
    pub fn look(&mut self, look: &Look<'_>) {
        let passed = look.now - self.last_look;
        self.last_look = look.now;
        if std::mem::replace(&mut self.attempts, look.attempts) != look.attempts {
            self.without_attempt = Duration::ZERO;
        }
        assert!(
            look.held == 0 || look.without_bridge <= STOPS_WITHIN,
            "at {:?} the DSP has {} waypoints, {:?} after the bridge was gone",
            look.now,
            look.held,
            look.without_bridge
        );
        let Some(state) = look.state else {
            self.without_attempt = Duration::ZERO;
            return;
        };
        let path = state.link.dsp_path();
        let is_up = state.link.state() == Some(LinkState::Up);
        if path == Some(DspPathState::Empty) {
            assert_eq!(
                look.held, 0,
                "at {:?} the bridge publishes an empty path buffer, but the DSP holds {} waypoints: {state:?}",
                look.now, look.held
            );
        }
        assert!(
            path != Some(DspPathState::Ours)
                || state.functionality() == Some(Functionality::FollowingPath),
            "at {:?} the DSP holds waypoints of a path that is not under way: {state:?}",
            look.now
        );
        if path != Some(DspPathState::Unknown) || !is_up {
            self.without_attempt = Duration::ZERO;
        } else {
            self.without_attempt += passed;
            assert!(
                self.without_attempt <= ATTEMPT_WITHIN,
                "at {:?} the bridge does not know the path buffer, and does not empty it: {state:?}",
                look.now
            );
        }
        if look.held == 0 || path == Some(DspPathState::Ours) {
            self.after_end = Duration::ZERO;
        } else if is_up {
            self.after_end += passed;
            let most = if self.is_sound {
                EMPTY_WITHIN
            } else {
                EMPTY_AT_LAST
            };
            assert!(
                self.after_end <= most,
                "at {:?} the DSP holds {} waypoints of a movement that has ended: {state:?}",
                look.now,
                look.held
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::witness::assert_panics;

    const SECOND: Duration = Duration::from_secs(1);

    fn state(path: DspPathState) -> ModuleState {
        let mut state = ModuleState::default();
        state.link.state = LinkState::Up.code();
        state.link.dsp_path = path.code();
        state.functionality = Functionality::FollowingPath.code();
        state
    }

    /// Looks every second, so many times, with an attempt every so many seconds.
    fn watch(is_sound: bool, path: DspPathState, held: usize, seconds: u32, every: usize) {
        let state = state(path);
        let mut buffer = Buffer::new(is_sound);
        for second in 0..=seconds {
            buffer.look(&Look {
                now: second * SECOND,
                held,
                state: Some(&state),
                attempts: second as usize / every,
                without_bridge: Duration::ZERO,
            });
        }
    }

    #[test]
    fn what_is_wrong_is_noticed() {
        let look = |held, state, seconds, without_bridge| {
            Buffer::new(true).look(&Look {
                now: seconds * SECOND,
                held,
                state,
                attempts: 0,
                without_bridge,
            });
        };
        let mut at_rest = state(DspPathState::Ours);
        at_rest.functionality = Functionality::AtRest.code();
        type Case<'a> = (&'a str, &'a dyn Fn());
        let cases: [Case; 7] = [
            ("publishes an empty path buffer", &|| {
                watch(true, DspPathState::Empty, 1, 0, 1);
            }),
            ("a path that is not under way", &|| {
                look(1, Some(&at_rest), 1, Duration::ZERO);
            }),
            ("does not empty it", &|| {
                watch(false, DspPathState::Unknown, 0, 7, 100);
            }),
            ("of a movement that has ended", &|| {
                watch(true, DspPathState::Unknown, 3, 2, 1);
            }),
            ("after the bridge was gone", &|| {
                look(1, None, 10, 3 * SECOND);
            }),
            ("a path begins", &|| Buffer::new(true).path_begins(1)),
            ("stop is done", &|| Buffer::new(true).done("stop", 1)),
        ];
        for (expected, act) in cases {
            assert_panics(expected, act);
        }
    }

    #[test]
    fn what_is_in_order_passes() {
        watch(true, DspPathState::Empty, 0, 100, 1000);
        watch(true, DspPathState::Ours, 16, 100, 1000);
        watch(true, DspPathState::Unknown, 1, 1, 1);
        watch(false, DspPathState::Unknown, 16, 60, 3);
    }
}
