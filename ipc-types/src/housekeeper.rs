//! The thread of a process that provides something: it removes what dead members left, beside everything that carries data.
//! In other processes it only drops former generations, whose last member deletes them.
//!
//! Removing is best effort, through iceoryx2's own means, and only the provider of a generation does it. What cannot be
//! removed is left behind: when it becomes much, or removing stalls, the provider begins a new generation, and the old one is
//! deleted when its last member has gone.

use std::any::Any;
use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Weak};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{DeadNodeView, NodeDetails, NodeView};
use iceoryx2::prelude::{CallbackProgression, NodeState};

use crate::domain::Domain;
use crate::generation::{self, Generation};
use crate::iox::{Node, Svc};
use crate::lock_file::entries;
use crate::{reserve, robot_folder};

/// How often it looks for dead members: their partners learn of the death after that time.
const PERIOD: Duration = Duration::from_secs(1);

/// Deaths in one generation after which another begins. A member that was killed while it started can leave some files that
/// no process knows of, up to 2 MB.
const MAX_DEATHS: u32 = 256;

/// Dead members that cannot be removed, after which another generation begins.
const MAX_STUCK: u32 = 8;

/// Files in a generation beyond what its living members account for, after which another generation begins. A member that was
/// killed while it made its node leaves three that belong to no member.
const MAX_LEFTOVERS: usize = 256;

/// Most files of a living member: its node, two events, a port, and their tags.
const FILES_PER_MEMBER: usize = 24;

/// Passes from one count of files to the next: ten seconds.
const PASSES_PER_COUNT: u32 = 10;

/// How long a session that ends waits for a removal that is under way. One that takes longer is left to its thread, which ends with
/// the process.
const END_LIMIT: Duration = Duration::from_secs(2);

/// A generation that is looked after.
#[derive(Debug)]
pub(crate) struct Tended {
    config: Config,
    domain: Domain,
    /// The folder of the service.
    service: PathBuf,
    /// The folder of the generation.
    folder: PathBuf,
    /// Whether its clients may need the reserve.
    keeps_reserve: bool,
    passes: AtomicU32,
    /// Members that lived at the last pass, the provider included.
    living: AtomicUsize,
    deaths: AtomicU32,
    is_worn: AtomicBool,
}

impl Tended {
    pub(crate) fn new(
        domain: &Domain,
        service: PathBuf,
        generation: &Generation,
        keeps_reserve: bool,
    ) -> Arc<Tended> {
        Arc::new(Tended {
            config: generation.config().clone(),
            domain: domain.clone(),
            service,
            keeps_reserve,
            folder: generation.path().to_owned(),
            passes: AtomicU32::new(0),
            living: AtomicUsize::new(1),
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

    /// Takes note of how many places for ports are taken. A member that was killed between taking a place and saying so leaves it
    /// taken for good; before there are too few left, another generation begins.
    pub(crate) fn count_places(&self, taken: usize, places: usize) {
        // Living members may take as many as they like: a new generation would be no emptier.
        let living = self.living.load(Ordering::Relaxed);
        if taken * 4 >= places * 3 && taken > living + places / 8 {
            self.wear_out("killed processes took places in the old one");
        }
    }

    /// Asks its provider to begin another generation.
    pub(crate) fn wear_out(&self, why: &str) {
        if !self.is_worn.swap(true, Ordering::Relaxed) {
            tracing::info!(service = %self.service.display(), why, "a new generation of shared memory begins");
        }
    }

    fn tend(&self) {
        let pass = catch_unwind(AssertUnwindSafe(|| {
            let _removing = Removing::begin()?;
            Some(remove_dead(&self.config))
        }));
        let pass = match pass {
            Ok(Some(pass)) => pass,
            Ok(None) => return,
            Err(_) => return self.wear_out("a dead process could not be removed"),
        };
        self.living.store(pass.living, Ordering::Relaxed);
        let deaths = self.deaths.fetch_add(pass.removed, Ordering::AcqRel) + pass.removed;
        if deaths >= MAX_DEATHS {
            self.wear_out("many processes died in the old one");
        } else if pass.stuck >= MAX_STUCK {
            self.wear_out("dead processes cannot be removed");
        } else if self.is_littered(pass.living) {
            self.wear_out("killed processes left files in the old one");
        }
        generation::delete_dead(&self.domain, &self.service);
        self.keep_reserve();
    }

    fn keep_reserve(&self) {
        if let Some(robot_folder) = self.service.parent().filter(|_| self.keeps_reserve) {
            reserve::fill(robot_folder);
        }
    }
}

impl Tended {
    /// Whether it is time to count the files of the generation, and there are too many.
    fn is_littered(&self, living: usize) -> bool {
        let passes = self.passes.fetch_add(1, Ordering::Relaxed);
        passes % PASSES_PER_COUNT == PASSES_PER_COUNT - 1
            && count_files(&self.folder) > MAX_LEFTOVERS + living * FILES_PER_MEMBER
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

/// The one removal of this process, until this is dropped. Another one meanwhile would take the dead for those that cannot be
/// removed; it waits for the next pass instead.
///
/// A removal does not hold the lock of [`crate::files`]: iceoryx2 reads files of other processes meanwhile, which can take long,
/// and no port could be opened. It needs none, because it binds no socket, and what it creates gets its mode explicitly or is
/// for the owner alone.
struct Removing;

static IS_REMOVING: AtomicBool = AtomicBool::new(false);

impl Removing {
    fn begin() -> Option<Removing> {
        (!IS_REMOVING.swap(true, Ordering::Acquire)).then_some(Removing)
    }
}

impl Drop for Removing {
    fn drop(&mut self) {
        IS_REMOVING.store(false, Ordering::Release);
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
                    tracing::debug!(?error, "a dead process was not removed");
                    pass.stuck += 1;
                }
            }
        }
        CallbackProgression::Continue
    });
    if let Err(error) = listed {
        tracing::debug!(?error, "the members of a generation cannot be listed");
    }
    pass
}

/// The messages to the thread.
enum Order {
    Tend(Weak<Tended>),
    /// Something whose removal may take long.
    Drop(Box<dyn Any + Send>),
    /// To end, and then to drop the sender.
    End(Sender<Infallible>),
}

/// The thread; it ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Housekeeper {
    orders: Sender<Order>,
    thread: Option<JoinHandle<()>>,
}

impl Housekeeper {
    pub(crate) fn start(domain: &Domain) -> Housekeeper {
        let (sender, orders) = mpsc::channel();
        let domain = domain.clone();
        let thread = thread::Builder::new()
            .name("housekeeper".to_owned())
            .spawn(move || keep_house(&domain, &orders))
            .inspect_err(
                |error| tracing::warn!(%error, "no thread removes what dead processes leave"),
            )
            .ok();
        Housekeeper {
            orders: sender,
            thread,
        }
    }

    /// Looks after a generation for as long as it is held.
    pub(crate) fn tend(&self, tended: &Arc<Tended>) {
        self.order(Order::Tend(Arc::downgrade(tended)));
    }

    /// Drops something on the thread.
    pub(crate) fn drop_later(&self, thing: impl Any + Send) {
        self.order(Order::Drop(Box::new(thing)));
    }

    fn order(&self, order: Order) {
        // Without the thread the order is dropped here, and with it what it holds.
        let _ = self.orders.send(order);
    }
}

impl Drop for Housekeeper {
    fn drop(&mut self) {
        let (sender, ended) = mpsc::channel();
        self.order(Order::End(sender));
        if let Some(thread) = self.thread.take() {
            if ended.recv_timeout(END_LIMIT) == Err(RecvTimeoutError::Timeout) {
                return tracing::warn!("what dead processes left cannot be removed in time");
            }
            // A panic in it has been reported.
            let _ = thread.join();
        }
    }
}

fn keep_house(domain: &Domain, orders: &Receiver<Order>) {
    let mut tended: Vec<Weak<Tended>> = Vec::new();
    loop {
        // A process that provides nothing has nothing to look after, and sleeps.
        let order = match tended.is_empty() {
            true => orders.recv().map_err(RecvTimeoutError::from),
            false => orders.recv_timeout(PERIOD),
        };
        match order {
            Ok(Order::Tend(one)) => {
                if tended.is_empty() {
                    robot_folder::delete_discarded(domain);
                    generation::delete_orphans(domain);
                }
                if let Some(one) = one.upgrade() {
                    // Not only after the first period, which a process that crashes in a loop never reaches.
                    generation::delete_dead(domain, &one.service);
                    one.keep_reserve();
                }
                tended.push(one);
            }
            Ok(Order::Drop(thing)) => drop(thing),
            Ok(Order::End(ended)) => return drop(ended),
            Err(RecvTimeoutError::Timeout) => {
                tended.retain(|one| one.upgrade().inspect(|one| one.tend()).is_some());
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}
