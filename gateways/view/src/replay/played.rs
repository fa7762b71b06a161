//! [`PlayedRobot`]: a recorded robot as a live screen showed it. Its clock is that of the recording, so ages, alarms
//! and events are those of the flight at any speed of the replay.

use std::time::Duration;

use ipc_types::module::State;
use ipc_types::outline::OutlineReader;
use ipc_types::payload::{
    BridgeOutline, DspTelemetry, HeroTelemetry, ModuleState, RelayLink, RelayStations, SharedStruct,
};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{Module, MonotonicNs, RobotId, StatusModule, Topic};
use operator::robot::model::{Process, WatchedRobot};
use recording::EventKind;
use recording::play::key_of;
use recording::read::{RecordedEvent, RecordedMessage};

/// Time between two looks at what is wrong: as often as the page of a live robot is renewed.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// After so long without a message only ages change, so no looks are made until the next message. A recording may have
/// a gap of years, when its clock was damaged.
const QUIET: Duration = Duration::from_secs(60);

/// A recorded robot as a live screen showed it, by the clock of the recording.
#[derive(Clone, Debug)]
pub struct PlayedRobot {
    /// The model that the live screens use.
    pub robot: WatchedRobot,
    outline: OutlineReader,
    /// When the last message was recorded.
    heard: MonotonicNs,
    /// When alarms were judged last.
    looked: MonotonicNs,
}

impl PlayedRobot {
    /// A robot without any sample, at the moment of the first message.
    pub fn new(id: RobotId, begin: MonotonicNs) -> PlayedRobot {
        PlayedRobot {
            robot: WatchedRobot::new(id),
            outline: OutlineReader::new(),
            heard: begin,
            looked: begin,
        }
    }

    /// Takes the next message, which was recorded at `at`. The caller makes looks that were due earlier first.
    pub fn take(&mut self, message: &RecordedMessage, at: MonotonicNs) {
        if at > self.heard + QUIET {
            self.look(at);
        }
        self.heard = at;
        if let Some(event) = RecordedEvent::of(message) {
            self.take_event(&event, at);
            return;
        }
        let key = key_of(message.topic()).map(|(_, key)| key);
        let (Some(key), Some(sample)) = (key, message.data().get(CDR_HEADER.len()..)) else {
            return;
        };
        let robot = &mut self.robot;
        if key == ModuleState::KEY {
            of(sample, |state: &ModuleState| {
                let mut state = *state;
                // Each screen that shows the state marks it as replayed.
                state.safety.reserved = 1;
                robot.state(&state, at);
            });
        } else if key == HeroTelemetry::KEY {
            of(sample, |hero| robot.hero(hero, at));
        } else if key == DspTelemetry::KEY {
            of(sample, |dsp| robot.dsp(dsp, at));
        } else if key == StatusModule::STATE_KEY {
            of(sample, |state: &State| robot.status(state, at));
        } else if key == RelayStations::KEY {
            of(sample, |stations| robot.stations(stations));
        } else if key == RelayLink::KEY {
            // Only a station has this topic: all its samples came over its relay.
            robot.is_relayed = true;
            of(sample, |link| robot.relay(link, at));
        } else if key == BridgeOutline::KEY {
            of(sample, |piece| self.take_outline(piece));
        }
    }

    /// Takes the end of a process. It may be the last message of the file, so what is wrong is judged at once.
    fn take_event(&mut self, event: &RecordedEvent, at: MonotonicNs) {
        let key = key_of(&event.topic).map(|(_, key)| key);
        let mut processes = Process::ALL.into_iter();
        if event.kind == EventKind::End
            && let Some(process) = processes.find(|process| Some(process.key()) == key)
        {
            self.robot.provider(process, false, at);
            self.look(at);
        }
    }

    fn take_outline(&mut self, piece: &BridgeOutline) {
        if self.outline.take(piece)
            && let Some(outline) = self.outline.outline()
        {
            self.robot.held(outline);
        }
    }

    /// When [`PlayedRobot::look`] is due; `None` if not before the next message.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let regular = self.looked + LOOK_PERIOD;
        let own = self.robot.next(self.looked);
        let due = own.map_or(regular, |own| own.min(regular));
        Some(due.max(self.looked + Duration::from_millis(1)))
            .filter(|due| *due <= self.heard + QUIET)
    }

    /// Judges what is wrong at `now`.
    pub fn look(&mut self, now: MonotonicNs) {
        self.looked = now;
        // A process lives until the recording says that it has ended. Then no look for it is due before its successor's
        // first sample.
        let due: Vec<_> = self.robot.looks_due(now).collect();
        for process in due {
            self.robot.provider(process, true, now);
        }
        self.robot.judge(now);
    }
}

/// Gives a sample of this layout to `take`; one of another length is of another version, and is left out.
fn of<T: SharedStruct>(sample: &[u8], take: impl FnOnce(&T)) {
    if let Some(sample) = T::from_bytes(sample) {
        take(&sample);
    }
}
