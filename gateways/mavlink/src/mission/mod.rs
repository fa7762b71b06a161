//! The mission of the helicopter: `store`: its items and their file; `transfer`: how it comes from a station; `check`: whether it can be
//! flown. [`Missions`]: the one in force, and how far it is.
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
    /// Whether its end was told.
    pub is_told: bool,
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
            is_told: false,
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

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct Missions {
    pub mission: Mission,
    pub transfer: Transfer,
    /// The `mission_type` that the answer to the transfer repeats.
    pub asked_type: u8,
    /// What has come and waits for the check.
    pub spare: Option<(StationAddress, Mission)>,
    /// Whether one is on its way to the disk.
    pub is_saving: bool,
    pub run: Option<Run>,
    /// The item that the next start begins with, from 1.
    pub next: u32,
    /// Who has chosen it on the ground, and until when that holds.
    pub primed: Option<(StationAddress, MonotonicNs)>,
    pub starting: Option<Starting>,
}

impl Missions {
    /// None is there.
    pub fn new() -> Missions {
        Missions {
            mission: Mission::default(),
            transfer: Transfer::new(MAX_ITEMS),
            asked_type: 0,
            spare: None,
            is_saving: false,
            run: None,
            next: 1,
            primed: None,
            starting: None,
        }
    }

    /// Another mission is in force.
    pub fn set(&mut self, mission: Mission) {
        self.mission = mission;
        (self.run, self.next, self.primed, self.starting) = (None, 1, None, None);
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
        [hover, primed, starting, self.transfer.deadline()]
            .into_iter()
            .flatten()
            .min()
    }
}
