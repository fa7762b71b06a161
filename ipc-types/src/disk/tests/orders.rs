//! Explores every order of the steps of processes that come, provide, follow, look, repair and go, over the model of
//! the file system.

use std::path::PathBuf;
use std::rc::Rc;

use super::model::{self, Call, Disk, Fault, Handle};
use crate::disk;
use crate::disk::LockFile;
use crate::domain::Domain;
use crate::generation::{self, EnterError, Stay};
use crate::provider::ProviderLock;
use crate::robot::RobotId;
use crate::robot_folder::{self, Joining, Place};
use crate::tests::explore::{Explored, Life, Play, Script, State, explore};

/// A stage of a process: the calls of one function of the crate.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Join,
    /// Deletes what joining has set aside.
    Clean,
    /// Becomes the provider, or goes on with [`Stage::Leave`].
    Provide,
    Begin,
    Announce,
    DeleteDiscarded,
    DeleteOrphans,
    DeleteDead,
    /// Ends its stay in a former generation.
    EndFormer,
    Withdraw,
    /// Ends its stay in the last generation.
    End,
    /// Provides no more.
    Release,
    Leave,
    DeleteRobots,
    RemoveRoot,
    Unlock,
    /// Looks which generation is current, and enters it.
    Follow,
    /// Looks whether a process is there.
    Look,
}

use Stage::*;

/// A process that takes part and goes.
const MEMBER: &[Stage] = &[
    Join,
    Clean,
    Leave,
    DeleteRobots,
    DeleteDiscarded,
    RemoveRoot,
    Unlock,
];
const PROVIDER: &[Stage] = &[
    Join,
    Clean,
    Provide,
    Begin,
    Announce,
    DeleteDiscarded,
    DeleteOrphans,
    DeleteDead,
    Withdraw,
    End,
    Release,
    Leave,
    DeleteRobots,
    DeleteDiscarded,
    RemoveRoot,
    Unlock,
];
/// A provider that goes on.
const SERVING: &[Stage] = &[Join, Clean, Provide, Begin, Announce, DeleteDead];
/// A provider whose generation is worn.
const RENEWING: &[Stage] = &[
    Join, Clean, Provide, Begin, Announce, Begin, Announce, EndFormer, DeleteDead,
];
const CONSUMER: &[Stage] = &[
    Join,
    Clean,
    Follow,
    Follow,
    EndFormer,
    End,
    Leave,
    DeleteRobots,
    DeleteDiscarded,
    RemoveRoot,
    Unlock,
];
const FOLLOWING: &[Stage] = &[Join, Clean, Follow];
/// What `ril doctor` does.
const REPAIRING: &[Stage] = &[
    Look,
    DeleteRobots,
    DeleteDiscarded,
    DeleteOrphans,
    RemoveRoot,
];

/// How often a process finds the doorbell locked before it takes the folder away.
const PATIENCE: u32 = 2;

/// How often a process looks for set-aside folders that it may delete.
const LOOKS: u32 = 2;

/// More steps than any process needs that is alone.
const ALONE: usize = 400;

/// A stay in a generation.
#[derive(Clone, Debug, Hash, PartialEq)]
struct Kept {
    name: String,
    lock: Handle,
    provider: Option<Handle>,
    segment: Handle,
}

#[derive(Clone, Debug, Default, Hash, PartialEq)]
struct Local {
    at: usize,
    waited: u32,
    discarded: Option<PathBuf>,
    member: Option<Handle>,
    provider: Option<Handle>,
    stays: Vec<Kept>,
    announced: Option<String>,
    names: u8,
    looks: u32,
    /// Whether it and others kept one another from deleting, as often as it looks.
    has_given_up: bool,
    error: Option<String>,
}

struct Lives {
    roles: Vec<&'static [Stage]>,
    fault: Fault,
    domain: Domain,
    robot: RobotId,
    service: PathBuf,
}

impl Lives {
    fn new(roles: &[&'static [Stage]], fault: Fault) -> Lives {
        let (domain, robot) = (
            Domain::new("/dev/shm/hx".as_ref()).unwrap(),
            RobotId::DEFAULT,
        );
        Lives {
            // And one that comes when all are gone.
            roles: roles.iter().copied().chain([PROVIDER]).collect(),
            fault,
            service: domain.robot_folder(robot).join("s"),
            domain,
            robot,
        }
    }

    fn path(&self, below: &str) -> String {
        format!("{}/{below}", self.service.display())
    }

    /// The segment of a process in a generation.
    fn segment(&self, who: usize, name: &str) -> PathBuf {
        let (tag, letter) = (self.domain.tag(), model::letter(who));
        PathBuf::from(format!("/dev/shm/{tag}{name}_{letter}"))
    }

    fn lock(&self, local: &Local) -> ProviderLock {
        ProviderLock::of_model(local.provider.unwrap(), self.service.join("lock"))
    }

    fn place(&self, local: &mut Local) -> Place {
        Place {
            domain: self.domain.clone(),
            robot: self.robot,
            lock: LockFile::of_model(local.member.take().unwrap()),
        }
    }

    fn keep(&self, who: usize, mut stay: Stay) -> Kept {
        let segment = self.segment(who, &stay.name);
        let segment = model::ask(|| Call::Create(model::text(&segment)));
        // Not there only when the process stops here.
        let segment = segment.unwrap().open().map(|mut segment| segment.keep());
        let lock = stay.lock.keep();
        Kept {
            name: stay.name.clone(),
            lock,
            provider: stay.provider.as_mut().map(LockFile::keep),
            segment: segment.unwrap_or(lock),
        }
    }

    fn stay(&self, kept: &Kept) -> (Stay, LockFile) {
        let stay = Stay {
            lock: LockFile::of_model(kept.lock),
            provider: kept.provider.map(LockFile::of_model),
            name: kept.name.clone(),
            path: self.service.join(&kept.name),
            prefix: format!("{}{}_", self.domain.tag(), kept.name),
        };
        (stay, LockFile::of_model(kept.segment))
    }

    fn end(&self, kept: &Kept) {
        let (stay, segment) = self.stay(kept);
        // Its ports and its node go before.
        drop(segment);
        drop(stay);
    }

    /// Whether the stage ended with nothing to do again.
    fn act(&self, who: usize, stage: Stage, local: &mut Local) -> Result<bool, String> {
        let role = self.roles[who];
        let said = |error: &dyn std::fmt::Display| format!("{stage:?}: {error}");
        match stage {
            Join => {
                let mut joining = Joining {
                    waited: local.waited,
                    discarded: local.discarded.take(),
                };
                let patience = match self.fault {
                    Fault::NoPatience => u32::MAX,
                    _ => PATIENCE,
                };
                let entered = joining.attempt(&self.domain, self.robot, patience);
                local.waited = joining.waited % PATIENCE;
                local.discarded = joining.discarded;
                let entered = entered.map_err(|error| said(&error))?;
                local.member = entered.map(|mut lock| lock.keep());
                return Ok(local.member.is_some());
            }
            Clean => {
                if let Some(folder) = local.discarded.take() {
                    robot_folder::clean_now(&self.domain, &folder);
                }
            }
            Provide => match ProviderLock::attempt(&self.service).map_err(|error| said(&error))? {
                None => return Ok(false),
                Some(Ok(lock)) => local.provider = Some(lock.keep()),
                Some(Err(_)) => {
                    let leave = role.iter().position(|stage| *stage == Leave);
                    local.at = leave.unwrap_or(role.len()) - 1;
                }
            },
            Begin => {
                if self.fault == Fault::AnnouncedFirst {
                    let name = disk::fresh_name(6);
                    let _ = generation::announce(&self.domain, &self.service, &name, "s");
                }
                let stay =
                    Stay::begin(&self.domain, &self.service).map_err(|error| said(&error))?;
                let kept = self.keep(who, stay);
                local.stays.push(kept);
            }
            Announce => {
                let name = &local.stays.last().unwrap().name;
                generation::announce(&self.domain, &self.service, name, "s")
                    .map_err(|error| said(&error))?;
                local.announced = Some(name.clone());
            }
            DeleteDiscarded => {
                let is_disturbed = robot_folder::look_at_discarded(&self.domain, &mut 0);
                local.looks += 1;
                let gives_up = is_disturbed && local.looks == LOOKS;
                local.has_given_up |= gives_up;
                if is_disturbed && !gives_up {
                    return Ok(false);
                }
                local.looks = 0;
            }
            DeleteOrphans => drop(generation::delete_orphans(&self.domain)),
            DeleteDead => {
                let lock = self.lock(local);
                if lock.is_in_place() {
                    generation::delete_dead(&self.domain, &self.service);
                }
                lock.keep();
            }
            EndFormer if local.stays.len() > 1 => self.end(&local.stays.remove(0)),
            EndFormer => {}
            Withdraw => {
                let lock = self.lock(local);
                generation::withdraw(&lock);
                lock.keep();
                local.announced = None;
            }
            End => {
                if let Some(kept) = local.stays.pop() {
                    self.end(&kept);
                }
            }
            Release => {
                drop(self.lock(local));
                local.provider = None;
            }
            Leave => {
                let mut place = self.place(local);
                let was_last = place.leave().map_err(|error| said(&error))?;
                local.member = Some(place.lock.keep());
                if !was_last {
                    local.at = role.len() - 2;
                }
            }
            DeleteRobots => {
                robot_folder::delete_dead_robots(&self.domain).map_err(|error| said(&error))?;
            }
            RemoveRoot => robot_folder::remove_root(&self.domain),
            Unlock => drop(LockFile::of_model(local.member.take().unwrap())),
            Follow => {
                let current = generation::current(&self.service).map_err(|error| said(&error))?;
                let present = local.stays.last().map(|kept| &kept.name);
                let name = current.map(|current| current.name);
                if let Some(name) = name.filter(|name| Some(name) != present) {
                    match Stay::enter(&self.domain, &self.service, &name) {
                        Ok(stay) => {
                            let kept = self.keep(who, stay);
                            local.stays.push(kept);
                        }
                        Err(EnterError::Ended) => {}
                        Err(error) => return Err(said(&error)),
                    }
                }
            }
            Look => drop(robot_folder::is_any_process_in(&self.domain, self.robot)),
        }
        Ok(true)
    }
}

impl Play<Disk> for Lives {
    type Local = Local;

    fn run(&self, who: usize, local: &Local, script: &Rc<Script<Disk>>) -> Option<Local> {
        let role = self.roles[who];
        let stage = *role.get(local.at)?;
        let mut next = local.clone();
        let (done, model) = model::with(script, who, local.names, self.fault, || {
            self.act(who, stage, &mut next)
        });
        if script.has_stopped() {
            return None;
        }
        next.names = model.names;
        match done {
            Ok(true) => next.at += 1,
            Ok(false) => {}
            Err(error) => {
                next.error = Some(error);
                next.at = role.len();
            }
        }
        Some(next)
    }

    fn check(&self, state: &State<Disk, Local>) -> Result<(), String> {
        let disk = &state.world;
        let mut providers = 0;
        for (who, life) in state.lives().enumerate() {
            let Some(local) = life.local() else { continue };
            let stage = self.roles[who].get(local.at).copied();
            let is_at = |handle: Handle, path: &str| disk.find(path) == Some(handle.inode);
            let must = |holds: bool, what: &str| match holds {
                true => Ok(()),
                false => Err(format!("{who}, {stage:?}: {what}")),
            };
            if let Some(error) = &local.error {
                return Err(format!("{who}: {error}"));
            }
            let is_leaving = self.roles[who][..local.at].contains(&Leave);
            if stage != Some(Leave)
                && !is_leaving
                && let Some(member) = local.member
            {
                let doorbell = format!(
                    "{}/doorbell",
                    self.domain.robot_folder(self.robot).display()
                );
                must(is_at(member, &doorbell), "its robot's folder is lost")?;
            }
            if stage != Some(Release)
                && let Some(lock) = local.provider
            {
                providers += 1;
                must(
                    is_at(lock, &self.path("lock")),
                    "its service's folder is lost",
                )?;
            }
            for (index, kept) in local.stays.iter().enumerate() {
                let is_ending = stage == Some(End) || stage == Some(EndFormer) && index == 0;
                let lock = self.path(&format!("{}/lock", kept.name));
                must(
                    is_ending || is_at(kept.lock, &lock),
                    "its generation is lost",
                )?;
                let segment = self.segment(who, &kept.name);
                let segment = segment.to_str().unwrap();
                must(
                    is_ending || is_at(kept.segment, segment),
                    "its segment is lost",
                )?;
            }
            let current = disk.content(&self.path("current")).unwrap_or_default();
            let is_own = local.provider.is_some() && current.starts_with(model::letter(who));
            let mut stays = local.stays.iter();
            must(
                !is_own || stays.any(|kept| current.starts_with(&kept.name)),
                "what it announces is not there",
            )?;
            if !matches!(stage, Some(Announce | Withdraw))
                && let Some(name) = &local.announced
            {
                must(
                    current.starts_with(name.as_str()),
                    "it is not announced any more",
                )?;
            }
            if stage == Some(Join) && state.begins_stage(who) && matches!(life, Life::Lives(_)) {
                let alone = state.run_alone(who, local.clone(), self, ALONE);
                let after = alone.lives().nth(who).and_then(Life::local).unwrap();
                must(
                    after.at > local.at,
                    "it does not get in beside processes that stand still",
                )?;
            }
        }
        match providers {
            0 | 1 => Ok(()),
            _ => Err("two processes provide".to_owned()),
        }
    }

    fn check_end(&self, state: &State<Disk, Local>) -> Result<(), String> {
        let last = self.roles.len() - 1;
        let is_in = |local: &Local| local.member.is_some() && local.provider.is_some();
        let provider = state
            .lives()
            .filter_map(Life::local)
            .find(|local| is_in(local));
        if let Some(provider) = provider {
            let consumer = Lives {
                roles: vec![FOLLOWING; last + 1],
                ..Lives::new(&[], self.fault)
            };
            let state = state.run_alone(last, Local::default(), &consumer, ALONE);
            let entered = &state.lives().nth(last).and_then(Life::local).unwrap().stays;
            let own = &provider.stays.last().unwrap().name;
            return match entered.first().is_some_and(|kept| kept.name == *own) {
                true => Ok(()),
                false => Err("a consumer does not find the provider".to_owned()),
            };
        }
        let left = |disk: &Disk| disk.all().map(|name| name.to_string()).collect::<Vec<_>>();
        let was_killed = state.lives().any(|life| *life == Life::Killed);
        let is_member = |local: &Local| local.member.is_some();
        if state.lives().filter_map(Life::local).any(is_member) {
            return Ok(());
        }
        let gave_up = |local: &Local| local.has_given_up;
        let gave_up = state.lives().filter_map(Life::local).any(gave_up);
        if !was_killed && !gave_up && !left(&state.world).is_empty() {
            return Err(format!("left, though none was killed: {:?}", state.world));
        }
        let state = state.run_alone(last, Local::default(), self, ALONE);
        match left(&state.world).is_empty() {
            true => Ok(()),
            false => Err(format!("left by the last: {:?}", state.world)),
        }
    }
}

/// What a process does, by a letter.
fn role(letter: char) -> &'static [Stage] {
    match letter {
        'M' => MEMBER,
        'P' => PROVIDER,
        'S' => SERVING,
        'R' => RENEWING,
        'C' => CONSUMER,
        'D' => REPAIRING,
        _ => panic!("no process does `{letter}`"),
    }
}

/// Explores the lives of processes, of which the first `joined` have joined before.
fn play(letters: &str, joined: usize, kills: u32, fault: Fault) -> Result<Explored, String> {
    let roles: Vec<_> = letters.chars().map(role).collect();
    let lives = Lives::new(&roles, fault);
    let ended = Local {
        at: PROVIDER.len(),
        ..Local::default()
    };
    let locals = (0..roles.len()).map(|_| Local::default()).chain([ended]);
    let mut state = State::begin(Disk::new(roles.len() + 1, fault), locals.collect(), kills);
    for who in 0..joined {
        state.run_while(who, &lives, |local| local.at < 2);
    }
    let explored = explore(&lives, state);
    if let Ok(explored) = explored {
        println!("{letters} {joined} {kills} {fault:?}: {explored:?}");
    }
    explored
}

/// Processes, how many of them have joined, and kills.
type Plays<'a> = &'a [(&'a str, usize, u32)];

const SHORT: Plays<'_> = &[("MM", 1, 1), ("SP", 2, 1), ("RC", 2, 1), ("MD", 1, 1)];

const LONG: Plays<'_> = &[
    ("SPC", 3, 1),
    ("RCP", 3, 1),
    ("MM", 0, 1),
    ("MD", 0, 1),
    ("MMD", 1, 1),
    ("MMM", 1, 1),
];

fn play_all(plays: Plays<'_>, fault: Fault) -> Result<(), String> {
    for (letters, joined, kills) in plays {
        play(letters, *joined, *kills, fault)?;
    }
    Ok(())
}

#[test]
fn folders_are_there_for_those_in_them_and_gone_after_the_last() {
    play_all(SHORT, Fault::None).unwrap_or_else(|found| panic!("{found}"));
}

#[test]
fn a_life_cycle_with_a_fault_is_found() {
    for fault in [
        Fault::NoCompare,
        Fault::AnyDoorbell,
        Fault::Replaces,
        Fault::NoFolderLock,
        Fault::AnnouncedFirst,
        Fault::NoPatience,
    ] {
        let found = play_all(&[("SP", 2, 0), ("RC", 2, 1), ("MM", 1, 0)], fault);
        let found = found.expect_err(&format!("{fault:?} was not found"));
        println!("{fault:?}: {}", found.lines().next().unwrap());
    }
}

/// `RIL_PLAY="MMM 0 1"` plays one alone, of processes by their letters.
#[test]
#[ignore = "the long form, of docs/reliability.md"]
fn folders_of_three_processes_are_there_for_those_in_them_and_gone_after_the_last() {
    let Ok(one) = std::env::var("RIL_PLAY") else {
        return play_all(LONG, Fault::None).unwrap_or_else(|found| panic!("{found}"));
    };
    let words: Vec<&str> = one.split(' ').collect();
    let (joined, kills) = (words[1].parse().unwrap(), words[2].parse().unwrap());
    play(words[0], joined, kills, Fault::None).unwrap_or_else(|found| panic!("{found}"));
}
