//! [`Playback`]: a recording under the controls of Foxglove's time line.
//!
//! Clients of the older protocol end at a message that they do not know. So the state goes to those alone that have
//! used the controls.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::event::{Event, Events, ViewerId};
use crate::page::{ReplayAction, ReplayInfo, ReplayRequest, ReplayStatus};

/// Opcode of the state to clients.
const PLAYBACK_STATE: u8 = 5;

/// The capability.
pub(super) const CAPABILITY: &str = "playbackControl";

/// Most characters of what a client calls a request.
const MAX_ID: usize = 64;

/// Values of the status.
const PLAYING: u8 = 0;
const PAUSED: u8 = 1;
const ENDED: u8 = 3;

/// A moment in `serverInfo`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Moment {
    sec: u64,
    nsec: u32,
}

impl Moment {
    fn of(unix_ns: u64) -> Moment {
        const SECOND_NS: u64 = 1_000_000_000;
        Moment {
            sec: unix_ns / SECOND_NS,
            nsec: u32::try_from(unix_ns % SECOND_NS).unwrap_or_default(),
        }
    }
}

/// What a client wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ControlRequest<'a> {
    is_play: bool,
    speed: f32,
    /// Where to go to, Unix time; `None` if it does not want to.
    seek_ns: Option<u64>,
    id: &'a str,
}

/// Reads a request behind its opcode; `None` if it means nothing.
pub(super) fn read(bytes: &[u8]) -> Option<ControlRequest<'_>> {
    let (command, rest) = bytes.split_first()?;
    let (speed, rest) = rest.split_first_chunk()?;
    let (has_seek, rest) = rest.split_first()?;
    let (seek_ns, rest) = rest.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let id = rest.get(..usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
    let id = std::str::from_utf8(id).ok()?;
    Some(ControlRequest {
        is_play: match command {
            0 => true,
            1 => false,
            _ => return None,
        },
        speed: f32::from_le_bytes(*speed),
        seek_ns: (*has_seek != 0).then_some(u64::from_le_bytes(*seek_ns)),
        id: if id.len() <= MAX_ID { id } else { "" },
    })
}

/// A request that is to be answered with the next state.
#[derive(Debug, Default)]
struct OpenControl {
    id: String,
    did_seek: bool,
}

/// A recording under the controls of Foxglove's time line.
#[derive(Debug, Default)]
pub(super) struct Playback {
    /// Unix time of the beginning and the end, ns; `None` without a replay, or if the recording has no wall time.
    range_ns: Option<(u64, u64)>,
    /// Clients that have used the controls, each with what is to be answered.
    clients: BTreeMap<ViewerId, OpenControl>,
}

impl Playback {
    pub fn new(replay: Option<&ReplayInfo>) -> Playback {
        let range_ns = replay.and_then(|info| {
            let start_ns = info.start_unix_ms?.checked_mul(1_000_000)?;
            Some((start_ns, start_ns.saturating_add(to_ns(info.duration_s))))
        });
        Playback {
            range_ns,
            clients: BTreeMap::new(),
        }
    }

    /// The beginning and the end; `None` if there is no replay to control.
    pub fn range(&self) -> Option<(Moment, Moment)> {
        let (start_ns, end_ns) = self.range_ns?;
        Some((Moment::of(start_ns), Moment::of(end_ns)))
    }

    /// A client is gone.
    pub fn leave(&mut self, viewer: ViewerId) {
        self.clients.remove(&viewer);
    }

    /// Takes what a client wants.
    pub fn take(&mut self, viewer: ViewerId, wanted: &ControlRequest<'_>, events: &mut Events) {
        let Some((start_ns, _)) = self.range_ns else {
            return;
        };
        let mut want = |action, position_s, speed| {
            let request = ReplayRequest {
                action,
                position_s,
                speed,
            };
            events.push_back(Event::Replay { viewer, request });
        };
        if let Some(seek_ns) = wanted.seek_ns {
            let position_s = seek_ns.saturating_sub(start_ns) as f64 / 1e9;
            want(ReplayAction::Seek, Some(position_s), None);
        }
        // 0 leaves the speed as it is.
        if wanted.speed > 0.0 {
            want(ReplayAction::Speed, None, Some(f64::from(wanted.speed)));
        }
        match wanted.is_play {
            true => want(ReplayAction::Play, None, None),
            false => want(ReplayAction::Pause, None, None),
        }
        let outstanding = self.clients.entry(viewer).or_default();
        wanted.id.clone_into(&mut outstanding.id);
        outstanding.did_seek |= wanted.seek_ns.is_some();
    }

    /// What to send to which clients, when the recording is there.
    pub fn states(&mut self, replay: &ReplayStatus) -> Vec<(ViewerId, Vec<u8>)> {
        let Some((start_ns, end_ns)) = self.range_ns else {
            return Vec::new();
        };
        let now_ns = start_ns.saturating_add(to_ns(replay.position_s));
        let status = match replay.playing {
            true => PLAYING,
            false if now_ns >= end_ns => ENDED,
            false => PAUSED,
        };
        let states = self.clients.iter_mut().map(|(viewer, outstanding)| {
            let answered = std::mem::take(outstanding);
            let mut bytes = vec![PLAYBACK_STATE, status];
            bytes.extend(now_ns.min(end_ns).to_le_bytes());
            bytes.extend((replay.speed as f32).to_le_bytes());
            bytes.push(u8::from(answered.did_seek));
            bytes.extend((answered.id.len() as u32).to_le_bytes());
            bytes.extend(answered.id.as_bytes());
            (*viewer, bytes)
        });
        states.collect()
    }
}

/// Seconds as ns; a cast of floating point stops at the ends of the range, and what is no number is 0.
fn to_ns(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    const REQUEST: &[u8] =
        b"\x00\x00\x00\x00\x40\x01\x00\xe4\x0b\x54\x02\x00\x00\x00\x02\x00\x00\x00id";

    #[test]
    fn a_request_is_read_or_means_nothing() {
        let expected = ControlRequest {
            is_play: true,
            speed: 2.0,
            seek_ns: Some(10_000_000_000),
            id: "id",
        };
        assert_eq!(read(REQUEST), Some(expected));
        for length in 0..REQUEST.len() {
            assert_eq!(read(&REQUEST[..length]), None, "{length}");
        }
        let mut other = REQUEST.to_vec();
        other[5] = 0;
        assert_eq!(read(&other).unwrap().seek_ns, None);
        (other[0], other[18]) = (1, 0xff);
        assert_eq!(read(&other), None, "no text");
        (other[0], other[18]) = (2, b'i');
        assert_eq!(read(&other), None, "no command");
    }

    #[test]
    fn the_range_is_that_of_the_recording() {
        let info = ReplayInfo {
            file: String::new(),
            duration_s: 61.5,
            start_unix_ms: Some(1_700_000_000_250),
            phases: Vec::new(),
            events: Vec::new(),
        };
        let range = Playback::new(Some(&info)).range();
        let moment = |sec, nsec| Moment { sec, nsec };
        let expected = (
            moment(1_700_000_000, 250_000_000),
            moment(1_700_000_061, 750_000_000),
        );
        assert_eq!(range, Some(expected));
        let nowhen = ReplayInfo {
            start_unix_ms: None,
            ..info
        };
        assert_eq!(Playback::new(Some(&nowhen)).range(), None);
        assert_eq!(Playback::new(None).range(), None);
    }
}
