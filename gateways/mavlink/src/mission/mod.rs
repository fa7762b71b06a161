//! The mission of the helicopter: `store`: its items and their file; `transfer`: how it comes from a station; `check`:
//! whether it can be flown. [`Missions`]: the one in force, and how far it is.
//!
//! | how far | it is begun | its steps are done | a hold, another movement | a refusal | a new mission |
//! |---|---|---|---|---|---|
//! | none | refused | – | – | – | → not started |
//! | not started | → active | – | – | – | → not started |
//! | active | stays | → complete | → paused | → paused | refused |
//! | paused | → active, with the item that was not done | – | – | – | → not started |
//! | complete | → active, with the first item | – | – | – | → not started |

pub mod check;
pub mod store;
pub mod transfer;

use std::time::Duration;

use ipc_types::MonotonicNs;
use plans::executor::{Executor, Progress};
use plans::flight::Flight;
use plans::mavlink::command;

use self::store::{Item, MAX_ITEMS, Mission};
use self::transfer::Transfer;
use crate::commands::CommandKey;
use crate::stations::StationAddress;

/// How long a mission that was chosen on the ground waits for the arming that starts it.
pub const PRIMED: Duration = Duration::from_secs(10);

/// How far a mission is: MISSION_STATE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum MissionState {
    None = 1,
    NotStarted = 2,
    Active = 3,
    Paused = 4,
    Complete = 5,
}

/// What stations see of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MissionView {
    pub state: MissionState,
    /// The item that is flown, or is the next one, from 0.
    pub sequence: u16,
    pub total: u16,
    /// Whether the mode is that of a mission.
    pub is_mode: bool,
    pub id: u32,
}

/// A mission under way, or the last one.
#[derive(Clone, Debug)]
pub struct Run {
    pub executor: Executor,
    /// The command that has begun it.
    pub key: CommandKey,
    /// Whether that command was answered.
    pub is_answered: bool,
    /// When that command came.
    pub issued: MonotonicNs,
    /// The order to the bridge that is open.
    pub order: Option<u64>,
    /// The request to the bridge that was the last step, which the next one names; 0 if there is none.
    pub before: u64,
    /// Items that stations were told of as reached, from the first one on.
    reported: u32,
    /// The last item that is reached, from 1.
    last: u32,
    /// The item that is next, if its end or pause was told.
    pub told: Option<u32>,
}

impl Run {
    /// A mission as it is started.
    pub fn new(mission: &Mission, flight: &Flight, starting: &Starting) -> Run {
        let Starting {
            key, from, issued, ..
        } = *starting;
        let is_endless = |item: &&Item| item.command() == command::LOITER_UNLIMITED;
        let rest = mission.items().iter().skip(from as usize - 1);
        let before_endless = rest.take_while(|item| !is_endless(item)).count() as u32;
        let mut executor = Executor::new(flight.steps.clone(), from);
        executor.begin();
        Run {
            executor,
            key,
            is_answered: false,
            issued,
            order: None,
            before: 0,
            reported: from - 1,
            last: u32::from(mission.count()).min(from + before_endless),
            told: None,
        }
    }

    /// The numbers of the items that were reached since the last call, from 0. All are, also those that need no step.
    pub fn take_reached(&mut self) -> std::ops::Range<u32> {
        let reached = match self.executor.progress() {
            Progress::Done => self.last,
            _ => self.executor.next_item().map_or(self.last, |next| next - 1),
        };
        let new = self.reported..reached.max(self.reported);
        self.reported = new.end;
        new
    }
}

/// A start that waits for the bridge's rules.
#[derive(Clone, Copy, Debug)]
pub struct Starting {
    pub key: CommandKey,
    /// The item that it begins with, from 1.
    pub from: u32,
    pub issued: MonotonicNs,
    /// Until when the rules must have come.
    pub until: MonotonicNs,
}

/// What the disk has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnDisk {
    /// The mission in force.
    InForce,
    /// Something is on its way to it, also what was given up.
    Writing,
    /// The last one could not be kept, or only up to its last step.
    Unknown,
}

/// The mission in force, how far it is flown, and the transfer of another one.
#[derive(Clone, Debug)]
pub struct Missions {
    pub mission: Mission,
    pub transfer: Transfer,
    /// The `mission_type` that the answer to the transfer repeats.
    pub asked_type: u8,
    /// What has come and waits for the check.
    pub awaiting_rules: Option<(StationAddress, Mission)>,
    /// Until when the disk has to take the one that is on its way to it.
    pub saving: Option<MonotonicNs>,
    pub on_disk: OnDisk,
    pub run: Option<Run>,
    /// The item that the next start begins with, from 1.
    pub next: u32,
    /// Who has chosen it on the ground, and until when that holds.
    pub primed: Option<(StationAddress, MonotonicNs)>,
    pub starting: Option<Starting>,
    /// What is kept of its progress, and since when.
    pub kept: (KeptProgress, Option<MonotonicNs>),
    /// Whether the gateway before has flown it, and it was not begun again since.
    is_interrupted: bool,
}

/// Longest file of a progress.
pub const MAX_PROGRESS_BYTES: usize = 64;

/// How the file of a progress begins, and its version.
const HEAD: [&str; 2] = ["ril-progress", "1"];

/// How far a mission is, kept over restarts of the gateway.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeptProgress {
    /// The mission's id.
    mission: u32,
    /// The item that the next start begins with, from 1; 0 if there is no mission.
    next: u32,
}

impl KeptProgress {
    /// The file: one line.
    pub fn encode(&self) -> String {
        let [head, version] = HEAD;
        format!("{head} {version} {} {}\n", self.mission, self.next)
    }

    /// The progress in a file.
    ///
    /// # Errors
    ///
    /// Why there is none, as a clause.
    pub fn decode(bytes: &[u8]) -> Result<KeptProgress, String> {
        let text = str::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
        let words: Vec<&str> = text.split_whitespace().collect();
        let number = |word: &str| word.parse().map_err(|_| format!("`{word}` is no number"));
        match words.as_slice() {
            [head, version, mission, next] if [*head, *version] == HEAD => Ok(KeptProgress {
                mission: number(mission)?,
                next: number(next)?,
            }),
            _ => Err("it is no progress of a mission".to_owned()),
        }
    }
}

impl Missions {
    /// None is there.
    pub fn new() -> Missions {
        Missions {
            mission: Mission::default(),
            transfer: Transfer::new(MAX_ITEMS),
            asked_type: 0,
            awaiting_rules: None,
            saving: None,
            on_disk: OnDisk::InForce,
            run: None,
            next: 1,
            primed: None,
            starting: None,
            kept: (KeptProgress::default(), None),
            is_interrupted: false,
        }
    }

    /// Puts another mission in force.
    pub fn set(&mut self, mission: Mission) {
        self.mission = mission;
        (self.run, self.next, self.primed, self.starting) = (None, 1, None, None);
        self.is_interrupted = false;
    }

    /// How far it is.
    pub fn progress(&self) -> KeptProgress {
        let running = self.run.as_ref().filter(|run| run.executor.is_running());
        let next = running.map_or(self.next, |run| run.executor.next_item().unwrap_or(1));
        match self.mission.count() {
            0 => KeptProgress::default(),
            _ => KeptProgress {
                mission: self.mission.id(),
                next,
            },
        }
    }

    /// How far it was before a restart, unless that is said of another mission.
    pub fn restore_progress(&mut self, progress: KeptProgress) {
        self.kept.0 = progress;
        let KeptProgress { mission, next } = progress;
        let is_within = (2..=u32::from(self.mission.count())).contains(&next);
        if is_within && mission == self.mission.id() {
            (self.next, self.is_interrupted) = (next, true);
        }
    }

    /// What stations are told of a mission that the gateway before has flown.
    pub fn interrupted(&self) -> Option<String> {
        let next = self.next;
        let is_told = self.is_interrupted && self.run.is_none();
        is_told.then(|| {
            format!("mission paused: the gateway was started anew; item {next} is the next one")
        })
    }

    pub fn is_running(&self) -> bool {
        self.run
            .as_ref()
            .is_some_and(|run| run.executor.is_running())
    }

    /// Why no other mission may take its place now.
    pub fn is_in_use(&self) -> bool {
        self.is_running() || self.starting.is_some()
    }

    pub fn is_primed(&self) -> bool {
        self.primed.is_some()
    }

    pub fn view(&self) -> MissionView {
        let total = self.mission.count();
        let progress = self.run.as_ref().map(|run| run.executor.progress());
        let state = match progress {
            _ if total == 0 => MissionState::None,
            None if self.is_interrupted => MissionState::Paused,
            None | Some(Progress::Ready) => MissionState::NotStarted,
            Some(Progress::Step) => MissionState::Active,
            Some(Progress::Paused | Progress::Failed(_)) => MissionState::Paused,
            Some(Progress::Done) => MissionState::Complete,
        };
        let item = match (&self.run, state) {
            (Some(run), MissionState::Active) => {
                run.executor.next_item().unwrap_or(u32::from(total))
            }
            (_, MissionState::Complete) if self.next == 1 => u32::from(total),
            _ => self.next,
        };
        MissionView {
            state,
            sequence: item.saturating_sub(1).min(u32::from(u16::MAX)) as u16,
            total,
            is_mode: self.is_running() || self.is_primed(),
            id: self.mission.id(),
        }
    }

    /// When something is due.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let hover = self.run.as_ref().and_then(|run| run.executor.deadline());
        let primed = self.primed.map(|(_, until)| until);
        let starting = self.starting.map(|starting| starting.until);
        [
            hover,
            primed,
            starting,
            self.saving,
            self.transfer.deadline(),
        ]
        .into_iter()
        .flatten()
        .min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::Form;

    #[test]
    fn the_next_moment_is_that_of_whatever_is_due_first() {
        let at = |seconds: u64| MonotonicNs(seconds * 1_000_000_000);
        let sender = StationAddress {
            address: ([127, 0, 0, 1], 1).into(),
            system: 255,
            component: 190,
        };
        let mut missions = Missions::new();
        assert_eq!(missions.deadline(), None);
        missions.saving = Some(at(9));
        assert_eq!(missions.deadline(), Some(at(9)));
        missions.primed = Some((sender, at(8)));
        assert_eq!(missions.deadline(), Some(at(8)));
        missions.starting = Some(Starting {
            key: CommandKey::new(sender, Form::Mode, [0; 8]),
            from: 1,
            issued: at(0),
            until: at(7),
        });
        assert_eq!(missions.deadline(), Some(at(7)));
        missions.transfer.begin(sender, 1, at(0));
        let first = missions.transfer.deadline();
        assert!(first < Some(at(7)));
        assert_eq!(missions.deadline(), first);
    }
}
