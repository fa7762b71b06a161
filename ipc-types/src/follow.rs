//! [`Follower`]: which generation of a service is current, and when to open another one.

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use crate::doorbell::{Bits, Doorbell, SeenRings, ServiceEvent, doorbell_slot};
use crate::generation::{self, Generation};
use crate::inspect;
use crate::open::OpenError;
use crate::session::Session;
use crate::time::MonotonicNs;

/// How long after a failure the same generation is tried again. A generation that its provider has announced can be
/// opened; failing means that memory is full, that the service has as many members as it can, or that the provider has
/// just gone.
const RETRY: Duration = Duration::from_millis(100);

/// How long a new port waits for a place when all are taken: the provider finds out within a second which are held by
/// dead processes, and begins a new generation, or removes them.
const ROOM_LIMIT: Duration = Duration::from_secs(2);

/// How often it tries at least: of a machine that stands still for longer than [`ROOM_LIMIT`], the provider has had no
/// time either.
const ROOM_TRIES: u32 = 20;

/// Opens a port for the first time, and tries again for a while when all places for such ports are taken.
///
/// They may be held by processes that were killed. Only the provider can find out, so it is told.
pub(crate) fn until_room(
    session: &Session,
    key: &str,
    mut open: impl FnMut() -> Result<(), OpenError>,
) -> Result<(), OpenError> {
    let slot = doorbell_slot(key);
    let deadline = MonotonicNs::now() + ROOM_LIMIT;
    let doorbell = session.doorbell();
    // A new generation wakes every sleeper.
    let bits = slot.bits(ServiceEvent::Samples);
    let mut tries = 0;
    loop {
        let seen = doorbell.listen(bits);
        let opened = open();
        tries += 1;
        let now = MonotonicNs::now();
        let has_waited = now >= deadline && tries >= ROOM_TRIES;
        if !matches!(opened, Err(OpenError::Full { .. })) {
            return opened;
        }
        doorbell.join(slot);
        if has_waited || !sleep_for_generation(doorbell, bits, seen, now + RETRY) {
            let users = inspect::users(session, key);
            return opened.map_err(|error| error.with_members(&users));
        }
    }
}

/// Sleeps until `until`, or until there is another generation: samples wake the same sleepers, and make no room. False
/// when that cannot be waited for.
fn sleep_for_generation(
    doorbell: &Doorbell,
    bits: Bits,
    mut seen: SeenRings,
    until: MonotonicNs,
) -> bool {
    let generations = doorbell.generations();
    while doorbell.generations() == generations && MonotonicNs::now() < until {
        if doorbell.sleep(seen, bits, until).is_err() {
            return false;
        }
        seen = doorbell.listen(bits);
    }
    true
}

/// Watches the generations of a service for a process that does not provide it.
pub(crate) struct Follower {
    session: Arc<Session>,
    key: String,
    folder: PathBuf,
    /// What the doorbell said at the last look; `None` before the first.
    seen: Cell<Option<u32>>,
    /// When to try again what failed.
    retry: Cell<Option<MonotonicNs>>,
}

impl Follower {
    pub(crate) fn new(session: &Arc<Session>, key: &str) -> Follower {
        Follower {
            session: Arc::clone(session),
            key: key.to_owned(),
            folder: session.service_folder(key),
            seen: Cell::new(None),
            retry: Cell::new(None),
        }
    }

    /// Whether something failed and is to be tried again.
    pub(crate) fn is_retrying(&self) -> bool {
        self.retry.get().is_some()
    }

    /// Whether there may be another generation than the one that was last looked at.
    pub(crate) fn is_due(&self) -> bool {
        self.seen.get() != Some(self.session.doorbell().generations())
            || self
                .retry
                .get()
                .is_some_and(|retry| retry <= MonotonicNs::now())
    }

    /// Enters the current generation and makes something in it, unless `present` is the current one, or there is none.
    pub(crate) fn follow<P>(
        &self,
        present: Option<&str>,
        make: impl FnOnce(&Arc<Session>, Generation) -> Result<P, OpenError>,
    ) -> Result<Option<P>, OpenError> {
        if !self.is_due() {
            return Ok(None);
        }
        // Before `current` is read: what changes later is seen by the next look.
        self.seen.set(Some(self.session.doorbell().generations()));
        self.retry.set(None);
        let made = self.enter_current(present, make);
        if made.is_err() {
            self.retry.set(Some(MonotonicNs::now() + RETRY));
        }
        made
    }

    fn enter_current<P>(
        &self,
        present: Option<&str>,
        make: impl FnOnce(&Arc<Session>, Generation) -> Result<P, OpenError>,
    ) -> Result<Option<P>, OpenError> {
        let current = generation::current(&self.folder)?.map(|current| current.name);
        let Some(name) = current.filter(|name| present != Some(name)) else {
            return Ok(None);
        };
        let Some(generation) = self.session.enter(&self.key, &name)? else {
            // It is being deleted. Soon it is gone, or another one is announced.
            self.retry.set(Some(MonotonicNs::now() + RETRY));
            return Ok(None);
        };
        make(&self.session, generation).map(Some)
    }

    /// Looks again at the next opportunity, whatever the doorbell says.
    pub(crate) fn forget(&self) {
        self.seen.set(None);
    }
}
