//! The thread of a process that provides something: it removes what dead members left, beside everything that carries
//! data. In other processes it only drops former generations, whose last member deletes them.
//!
//! The kernel tells when a process has left a generation; a look each minute is the safety net.
//!
//! Removing is best effort, through iceoryx2's own means, and only the provider of a generation does it. What cannot be
//! removed is left behind: when it becomes much, or removing stalls, the provider begins a new generation, and the old
//! one is deleted when its last member has gone.

use std::any::Any;
use std::convert::Infallible;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::sync::{Arc, OnceLock, Weak};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{DeadNodeView, NodeDetails, NodeView};
use iceoryx2::prelude::{CallbackProgression, NodeState};
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fs::inotify;

use crate::domain::Domain;
use crate::forked::Maker;
use crate::generation::{self, Generation};
use crate::iox::{Node, Svc};
use crate::limits;
use crate::lock_file::entries;
use crate::provider::ProviderLock;
use crate::time::MonotonicNs;
use crate::{reserve, robot_folder};

/// How often it looks for dead members though the kernel told of none, and for what else dead processes left.
const PERIOD: Duration = Duration::from_secs(60);

/// How often it looks while the kernel cannot tell (each user has 128 inotify instances by default), or dead members
/// could not be removed.
const SHORT_PERIOD: Duration = Duration::from_secs(1);

/// Shortest time between two looks: processes that end in groups are removed in groups.
const REST: Duration = Duration::from_millis(100);

/// Deaths in one generation after which another begins. A member that was killed while it started can leave some files
/// that no process knows of, up to 2 MB.
const MAX_DEATHS: u32 = 256;

/// Dead members that cannot be removed, after which another generation begins.
const MAX_STUCK: u32 = 8;

/// Files in a generation beyond what its living members account for, after which another generation begins. A member
/// that was killed while it made its node leaves three that belong to no member.
const MAX_LEFTOVERS: usize = 256;

/// How often it is judged at most who has the places of a generation.
const JUDGING_PERIOD: Duration = Duration::from_secs(1);

/// Most files of a living member: its node, two events, a port, and their tags.
const FILES_PER_MEMBER: usize = 24;

/// Passes from one count of files to the next.
const PASSES_PER_COUNT: u32 = 10;

/// How long a session that ends waits for a removal that is under way. One that takes longer is left to its thread,
/// which ends with the process.
const END_LIMIT: Duration = Duration::from_secs(2);

/// A generation that is looked after.
#[derive(Debug)]
pub(crate) struct Maintained {
    config: Config,
    domain: Domain,
    /// Weak, so that the provider gives it back when it ends, whatever the thread does meanwhile.
    lock: Weak<ProviderLock>,
    is_removed: AtomicBool,
    is_limit_said: AtomicBool,
    /// The folder of the service.
    service: PathBuf,
    /// The folder of the generation.
    folder: PathBuf,
    /// Whether its clients may need the reserve.
    keeps_reserve: bool,
    passes: AtomicU32,
    tasks: TaskSender,
    /// When the thread was last asked to judge who has the places, host monotonic ns.
    asked_ns: AtomicU64,
    deaths: AtomicU32,
    is_worn: AtomicBool,
}

impl Maintained {
    pub(crate) fn new(
        housekeeper: &Housekeeper,
        domain: &Domain,
        lock: &Arc<ProviderLock>,
        service: PathBuf,
        generation: &Generation,
        keeps_reserve: bool,
    ) -> Arc<Maintained> {
        Arc::new(Maintained {
            config: generation.config().clone(),
            domain: domain.clone(),
            lock: Arc::downgrade(lock),
            is_removed: AtomicBool::new(false),
            is_limit_said: AtomicBool::new(false),
            service,
            keeps_reserve,
            folder: generation.path().to_owned(),
            passes: AtomicU32::new(0),
            tasks: housekeeper.tasks.clone(),
            asked_ns: AtomicU64::new(0),
            deaths: AtomicU32::new(0),
            is_worn: AtomicBool::new(false),
        })
    }

    /// Whether its provider should begin another generation.
    pub(crate) fn is_worn(&self) -> bool {
        self.is_worn.load(Ordering::Relaxed)
    }

    /// Dead members that were removed so far.
    pub(crate) fn deaths(&self) -> u32 {
        self.deaths.load(Ordering::Acquire)
    }

    /// Takes note of the places for ports that are taken, and has it judged when those are most of them. A member that
    /// was killed between taking a place and saying so leaves it taken for good; before there are too few left, another
    /// generation begins.
    pub(crate) fn count_places(
        self: &Arc<Maintained>,
        (taken, places): (usize, usize),
        members: impl FnOnce() -> usize,
    ) {
        if taken * 4 < places * 3 {
            return;
        }
        let now = MonotonicNs::now();
        let asked = MonotonicNs(self.asked_ns.load(Ordering::Relaxed));
        if now.since(asked) < JUDGING_PERIOD {
            return;
        }
        self.asked_ns.store(now.0, Ordering::Relaxed);
        let crowd = Crowd {
            // First: what is removed meanwhile may be among the members.
            deaths: self.deaths(),
            members: members(),
            places,
            is_full: taken >= places,
        };
        // Without the thread the places stay as they are.
        self.tasks
            .give(HousekeeperTask::Judge(Arc::downgrade(self), crowd));
    }

    /// Says once when a partner was not connected for want of descriptors.
    pub(crate) fn note_unconnected(&self) {
        if limits::are_files_used_up() && !self.is_limit_said.swap(true, Ordering::Relaxed) {
            crate::log::warn!(
                service = %self.service.display(),
                limits = limits::too_low(),
                "this process has as many files open as it may: further subscribers and clients are not connected; raise its limit `nofile` (`ulimit -n`, `LimitNOFILE=`)"
            );
        }
    }

    /// Asks its provider to begin another generation.
    pub(crate) fn wear_out(&self, why: &str) {
        if !self.is_worn.swap(true, Ordering::Relaxed) {
            crate::log::info!(service = %self.service.display(), why, "a new generation of shared memory begins");
        }
    }

    /// Whether other processes still find this provider. What has its lock in another file is not theirs to clean up.
    fn is_in_place(&self) -> bool {
        let Some(lock) = self.lock.upgrade() else {
            return false;
        };
        let is_in_place = lock.is_in_place();
        if !is_in_place && !self.is_removed.swap(true, Ordering::Relaxed) {
            crate::log::error!(
                service = %self.service.display(),
                "the folder of this live service was removed from outside: no other process finds it; start this process again"
            );
        }
        is_in_place
    }

    /// Removes dead members, and asks for another generation when this one is worn. `crowd` was counted before. Says
    /// when to do so again though the kernel tells of no other death.
    fn remove_dead(&self, crowd: Option<Crowd>) -> Duration {
        if !self.is_in_place() {
            return PERIOD;
        }
        let pass = catch_unwind(AssertUnwindSafe(|| {
            let _removing = Removing::begin()?;
            Some(remove_dead(&self.config))
        }));
        let pass = match pass {
            Ok(Some(pass)) => pass,
            Ok(None) => return REST,
            Err(_) => {
                self.wear_out("a dead process could not be removed");
                return PERIOD;
            }
        };
        let deaths = self.deaths.fetch_add(pass.removed, Ordering::AcqRel) + pass.removed;
        if deaths >= MAX_DEATHS {
            self.wear_out("many processes died in the old one");
        } else if pass.stuck >= MAX_STUCK {
            self.wear_out("dead processes cannot be removed");
        } else if self.is_littered(pass.living) {
            self.wear_out("killed processes left files in the old one");
        } else if crowd.is_some_and(|crowd| crowd.is_of_the_dead(pass.living, deaths)) {
            self.wear_out("killed processes took places in the old one");
        }
        match pass.stuck {
            0 => PERIOD,
            _ => SHORT_PERIOD,
        }
    }

    /// Deletes the generations of the service in which no process is, and makes the reserve. Says when to do so again.
    fn tidy_up(&self) -> Duration {
        if !self.is_in_place() {
            return PERIOD;
        }
        generation::delete_dead(&self.domain, &self.service);
        let robot_folder = self.service.parent().filter(|_| self.keeps_reserve);
        match robot_folder.is_none_or(reserve::fill) {
            true => PERIOD,
            false => SHORT_PERIOD,
        }
    }

    /// Whether it is time to count the files of the generation, and there are too many.
    fn is_littered(&self, living: usize) -> bool {
        let passes = self.passes.fetch_add(1, Ordering::Relaxed);
        passes % PASSES_PER_COUNT == PASSES_PER_COUNT - 1
            && count_files(&self.folder) > MAX_LEFTOVERS + living * FILES_PER_MEMBER
    }
}

/// The members that have places for ports of one kind, counted before a pass.
#[derive(Clone, Copy, Debug)]
struct Crowd {
    members: usize,
    places: usize,
    is_full: bool,
    /// Dead members that had been removed.
    deaths: u32,
}

impl Crowd {
    /// Whether more members have places than can live, so that places are lost. The living may take as many as they
    /// like: a new generation would be no emptier.
    fn is_of_the_dead(self, living: usize, deaths: u32) -> bool {
        // The provider lives, and has none. What was removed has given its places back.
        let accounted = living.saturating_sub(1) + deaths.wrapping_sub(self.deaths) as usize;
        // Some may have left between the count and the pass.
        let margin = match self.is_full {
            true => (self.places / 8).min(1),
            false => self.places / 8,
        };
        self.members > accounted + margin
    }
}

fn count_files(folder: &Path) -> usize {
    entries(folder)
        .map(|entry| match entry.file_type() {
            Ok(kind) if kind.is_dir() => 1 + count_files(&entry.path()),
            _ => 1,
        })
        .sum()
}

/// What a pass over the members of a generation did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pass {
    /// Dead members that were removed.
    pub(crate) removed: u32,
    /// Dead members that could not be.
    pub(crate) stuck: u32,
    /// Members that live.
    pub(crate) living: usize,
}

/// The one removal of this process, until this is dropped. Another one meanwhile would take the dead for those that
/// cannot be removed; it waits for the next pass instead.
///
/// A removal does not hold the lock of [`crate::files`]: iceoryx2 reads files of other processes meanwhile, which can
/// take long, and no port could be opened. It needs none, because it binds no socket, and what it creates gets its mode
/// explicitly or is for the owner alone.
struct Removing;

/// The process that removes, so that a child that is forked meanwhile is not kept from it; 0 is none.
static REMOVES: AtomicU32 = AtomicU32::new(0);

impl Removing {
    fn begin() -> Option<Removing> {
        let this = Maker::this_process().number();
        (REMOVES.swap(this, Ordering::Acquire) != this).then_some(Removing)
    }
}

impl Drop for Removing {
    fn drop(&mut self) {
        REMOVES.store(0, Ordering::Release);
    }
}

fn remove_dead(config: &Config) -> Pass {
    let mut pass = Pass::default();
    let listed = Node::list(config, |state| {
        if matches!(state, NodeState::Alive(_)) {
            pass.living += 1;
        }
        if let NodeState::Dead(node) = state {
            let result = match node.details() {
                Some(_) => node.try_remove_stale_resources(),
                // iceoryx2 itself would look in its global configuration.
                None => DeadNodeView::<Svc>::__internal_try_remove_stale_resources(
                    *node.id(),
                    NodeDetails::__internal_new(&None, config),
                ),
            };
            match result {
                Ok(()) => pass.removed += 1,
                Err(error) => {
                    crate::log::debug!(?error, "a dead process was not removed");
                    pass.stuck += 1;
                }
            }
        }
        CallbackProgression::Continue
    });
    if let Err(error) = listed {
        crate::log::debug!(?error, "the members of a generation cannot be listed");
    }
    pass
}

/// The messages to the thread.
#[derive(Debug)]
enum HousekeeperTask {
    Tend(Weak<Maintained>),
    /// To look now who has the places.
    Judge(Weak<Maintained>, Crowd),
    /// Something whose removal may take long.
    Drop(Box<dyn Any + Send>),
    /// To end, and then to drop the sender.
    End(Sender<Infallible>),
}

/// Wakes the thread when it sleeps on descriptors. A process that provides nothing needs none.
#[derive(Debug, Default)]
struct ThreadWaker(OnceLock<OwnedFd>);

impl ThreadWaker {
    fn open(&self) {
        let flags = EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK;
        match eventfd(0, flags) {
            Ok(descriptor) => drop(self.0.set(descriptor)),
            Err(error) => {
                crate::log::warn!(%error, "dead processes are looked for each second");
            }
        }
    }

    fn signal(&self) {
        if let Some(descriptor) = self.0.get() {
            // It cannot fail but for a count that is full, and then the thread is awake.
            let _ = rustix::io::write(descriptor, &1_u64.to_ne_bytes());
        }
    }
}

/// Where tasks are given to the thread.
#[derive(Clone, Debug)]
struct TaskSender {
    sender: Sender<HousekeeperTask>,
    waker: Arc<ThreadWaker>,
}

impl TaskSender {
    fn give(&self, task: HousekeeperTask) {
        // Without the thread the task is dropped here, and with it what it holds.
        let _ = self.sender.send(task);
        self.waker.signal();
    }
}

/// The thread; it ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Housekeeper {
    tasks: TaskSender,
    thread: Option<JoinHandle<()>>,
}

impl Housekeeper {
    pub(crate) fn start(domain: &Domain) -> Housekeeper {
        let (sender, tasks) = mpsc::channel();
        let waker = Arc::<ThreadWaker>::default();
        let mut house = House {
            domain: domain.clone(),
            tasks,
            waker: Arc::clone(&waker),
            deaths: Deaths(None),
            rooms: Vec::new(),
        };
        let thread = thread::Builder::new()
            .name("housekeeper".to_owned())
            .spawn(move || house.keep())
            .inspect_err(
                |error| crate::log::warn!(%error, "no thread removes what dead processes leave"),
            )
            .ok();
        Housekeeper {
            tasks: TaskSender { sender, waker },
            thread,
        }
    }

    /// Looks after a generation for as long as it is held.
    pub(crate) fn service(&self, maintained: &Arc<Maintained>) {
        if self.tasks.waker.0.get().is_none() {
            self.tasks.waker.open();
        }
        self.tasks
            .give(HousekeeperTask::Tend(Arc::downgrade(maintained)));
    }

    /// Drops something on the thread.
    pub(crate) fn drop_later(&self, thing: impl Any + Send) {
        self.tasks.give(HousekeeperTask::Drop(Box::new(thing)));
    }
}

impl Drop for Housekeeper {
    fn drop(&mut self) {
        let (sender, ended) = mpsc::channel();
        self.tasks.give(HousekeeperTask::End(sender));
        if let Some(thread) = self.thread.take() {
            if ended.recv_timeout(END_LIMIT) == Err(RecvTimeoutError::Timeout) {
                return crate::log::warn!("what dead processes left cannot be removed in time");
            }
            // A panic in it has been reported.
            let _ = thread.join();
        }
    }
}

/// Tells when a process has left a generation, however it ended: the kernel closes its lock file. It also tells when
/// that file was removed from outside.
///
/// The kernel drops the locks by which iceoryx2 knows the living before it says that the file was closed.
struct Deaths(Option<OwnedFd>);

impl Deaths {
    fn begin(&mut self) {
        let flags = inotify::CreateFlags::CLOEXEC | inotify::CreateFlags::NONBLOCK;
        self.0 = inotify::init(flags)
            .inspect_err(
                |error| crate::log::debug!(%error, "dead processes are looked for each second"),
            )
            .ok();
    }

    /// Watches a generation. Nothing when that cannot be.
    fn watch(&self, lock_file: &Path) -> Option<i32> {
        let closed = inotify::WatchFlags::CLOSE_NOWRITE | inotify::WatchFlags::CLOSE_WRITE;
        // The count of its names is one of its attributes.
        let removed = inotify::WatchFlags::ATTRIB;
        inotify::add_watch(self.0.as_ref()?, lock_file, closed | removed)
            .inspect_err(|error| crate::log::debug!(%error, "a generation is not watched"))
            .ok()
    }

    /// Hands on the watches of which a process has left the generation; nothing is all of them.
    fn take(&self, mut left: impl FnMut(Option<i32>)) {
        let Some(inotify) = &self.0 else { return };
        let mut buffer = [MaybeUninit::uninit(); 1024];
        let mut events = inotify::Reader::new(inotify, &mut buffer);
        while let Ok(event) = events.next() {
            let is_overflow = event.events().contains(inotify::ReadFlags::QUEUE_OVERFLOW);
            left((!is_overflow).then_some(event.wd()));
        }
    }
}

/// What the thread looks after.
struct House {
    domain: Domain,
    tasks: Receiver<HousekeeperTask>,
    waker: Arc<ThreadWaker>,
    deaths: Deaths,
    rooms: Vec<Room>,
}

/// A generation in it.
struct Room {
    maintained: Weak<Maintained>,
    watch: Option<i32>,
    /// When to look for dead members.
    due: MonotonicNs,
    /// When to look for what else dead processes left.
    tidy: MonotonicNs,
}

impl Room {
    fn remove_dead(&mut self, maintained: &Maintained, crowd: Option<Crowd>) {
        let period = maintained.remove_dead(crowd);
        self.due = MonotonicNs::now()
            + match self.watch {
                Some(_) => period,
                None => period.min(SHORT_PERIOD),
            };
    }
}

impl House {
    fn keep(&mut self) {
        // The first moment of the next look.
        let mut rested = MonotonicNs::default();
        loop {
            let mut task = self.sleep(rested);
            loop {
                match task {
                    Ok(HousekeeperTask::Tend(one)) => self.move_in(one),
                    Ok(HousekeeperTask::Judge(one, crowd)) => self.judge(&one, crowd),
                    Ok(HousekeeperTask::Drop(thing)) => drop(thing),
                    Ok(HousekeeperTask::End(ended)) => return drop(ended),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
                task = self.tasks.try_recv();
            }
            let now = MonotonicNs::now();
            if now >= rested && self.look(now) {
                rested = MonotonicNs::now() + REST;
            }
        }
    }

    fn move_in(&mut self, maintained: Weak<Maintained>) {
        let Some(one) = maintained.upgrade() else {
            return;
        };
        if self.rooms.is_empty() {
            if self.waker.0.get().is_some() && self.deaths.0.is_none() {
                self.deaths.begin();
            }
            robot_folder::delete_discarded(&self.domain);
            generation::delete_orphans(&self.domain);
        }
        // Not only after the first period, which a process that crashes in a loop never reaches.
        let period = one.tidy_up();
        let now = MonotonicNs::now();
        self.rooms.push(Room {
            watch: self.deaths.watch(&generation::lock_file(&one.folder)),
            maintained,
            // A process may have come and died before the generation was watched.
            due: now + SHORT_PERIOD,
            tidy: now + period,
        });
    }

    /// Looks for dead members in a generation, and who has its places.
    fn judge(&mut self, judged: &Weak<Maintained>, crowd: Crowd) {
        for room in &mut self.rooms {
            if room.maintained.ptr_eq(judged)
                && let Some(maintained) = judged.upgrade()
            {
                room.remove_dead(&maintained, Some(crowd));
            }
        }
    }

    /// Looks for dead members where one may be. Says whether it looked.
    fn look(&mut self, now: MonotonicNs) -> bool {
        self.rooms.retain(|room| room.maintained.strong_count() > 0);
        for room in &mut self.rooms {
            let Some(maintained) = room.maintained.upgrade() else {
                continue;
            };
            if now >= room.tidy {
                room.tidy = now + maintained.tidy_up();
                room.due = now;
            }
        }
        // After the generations were looked at, which closes their lock files, too.
        let rooms = &mut self.rooms;
        self.deaths.take(|watch| {
            for room in rooms
                .iter_mut()
                .filter(|room| watch.is_none() || room.watch == watch)
            {
                room.due = now;
            }
        });
        let mut has_looked = false;
        for room in self.rooms.iter_mut().filter(|room| now >= room.due) {
            let Some(maintained) = room.maintained.upgrade() else {
                continue;
            };
            room.remove_dead(&maintained, None);
            has_looked = true;
        }
        has_looked
    }

    /// Sleeps until there is a task, which it returns, a process has left a generation, or a look is due; not for that
    /// before `rested`.
    fn sleep(&self, rested: MonotonicNs) -> Result<HousekeeperTask, TryRecvError> {
        let now = MonotonicNs::now();
        let due = self.rooms.iter().map(|room| room.due.min(room.tidy)).min();
        // A process that provides nothing has nothing to look after.
        let Some(due) = due else {
            return self.tasks.recv().map_err(|_| TryRecvError::Disconnected);
        };
        let mut timeout = due.max(rested).since(now);
        let Some(waker) = self.waker.0.get() else {
            return match self.tasks.recv_timeout(timeout) {
                Ok(task) => Ok(task),
                Err(RecvTimeoutError::Timeout) => Err(TryRecvError::Empty),
                Err(RecvTimeoutError::Disconnected) => Err(TryRecvError::Disconnected),
            };
        };
        let mut sources = vec![PollFd::new(waker, PollFlags::IN)];
        match &self.deaths.0 {
            Some(inotify) if now >= rested => sources.push(PollFd::new(inotify, PollFlags::IN)),
            // What comes meanwhile is looked at then.
            Some(_) => timeout = rested.since(now),
            None => {}
        }
        let timeout = Timespec::try_from(timeout).ok();
        // It fails when a signal comes, or memory is short; then there is one look more.
        let _ = poll(&mut sources, timeout.as_ref());
        let _ = rustix::io::read(waker, &mut [0; 8]);
        self.tasks.try_recv()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};

    use super::*;

    #[test]
    fn the_kernel_tells_when_a_lock_file_is_closed_and_when_it_is_removed() {
        let folder = crate::files::test_folder();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        let [held, _] = [&one, &other].map(|path| File::create(path).unwrap());
        let mut deaths = Deaths(None);
        deaths.begin();
        let watches = [&one, &other].map(|path| deaths.watch(path));
        let told = |deaths: &Deaths| {
            let mut told = Vec::new();
            deaths.take(|watch| told.push(watch));
            told
        };
        if watches.contains(&None) {
            return eprintln!("SKIPPED: no inotify instance is left");
        }
        assert_eq!(told(&deaths), []);
        drop(File::open(&other).unwrap());
        assert_eq!(told(&deaths), [watches[1]]);
        fs::remove_file(&one).unwrap();
        assert_eq!(told(&deaths), [watches[0]]);
        drop(held);
        assert_eq!(told(&deaths).first(), Some(&watches[0]));
    }

    #[test]
    fn places_of_the_living_are_no_reason_for_another_generation() {
        // Members counted, places, living with the provider, removed: whether places are lost.
        let cases = [
            (24, 32, 25, 0, false),
            (32, 32, 33, 0, false),
            (3, 4, 4, 0, false),
            (4, 4, 5, 0, false),
            (24, 32, 1, 24, false),
            (32, 32, 32, 0, false),
            (32, 32, 31, 0, true),
            (24, 32, 20, 0, true),
            (3, 4, 3, 0, true),
        ];
        for (members, places, living, removed, expected) in cases {
            let crowd = Crowd {
                members,
                places,
                is_full: members == places,
                deaths: 7,
            };
            let lost = crowd.is_of_the_dead(living, 7 + removed);
            assert_eq!(lost, expected, "{crowd:?} {living} {removed}");
        }
    }
}
