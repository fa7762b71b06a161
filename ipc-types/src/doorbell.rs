//! The doorbell: wakes processes that sleep for shared memory in about the time of a futex.
//!
//! iceoryx2's own events go through a socket: two system calls to send one, two to read it, and one to wait, for each
//! listener. The doorbell is one page in shared memory for each robot. All its sleepers sleep on one word of it; each
//! says with a bit for every event which of them are to wake it, so that one sleep serves several ports.
//!
//! ```text
//! sleeper                                  ringer
//!   seen = rings                             write the data
//!   sleepers |= my bits, and count           unless sleepers & bits: done
//!   look for data: there is some, done       rings += 1, wake those who sleep for bits
//!   sleep while rings == seen                sleepers &= !bits, unless it was counted since
//! ```
//!
//! Either the ringer sees the sleeper's bit, or the sleeper sees the data: both write before they read, with a full
//! barrier between. And a process that has looked in vain either still finds `rings` changed, or is asleep and is
//! woken. So no wake-up is lost, and while no process sleeps ringing costs a barrier and a load.
//!
//! A bit is cleared last, in one step with the look whether a process has announced itself since the ringer looked: so
//! no process sleeps for a bit that is not there. A ringer that is killed or stands still, at whichever step, therefore
//! takes nobody's wake-up but its own.
//!
//! Nothing of it can be left broken: a sleeper or ringer that is killed leaves at most a bit, which costs the next
//! ringer one system call; a ringer that is killed between its data and the wake leaves a sleep that its bound ends.
//! The numbers in the page are only hints to look at the data.

use std::fs::File;
use std::io;
use std::mem::offset_of;
use std::num::NonZeroU32;
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;

use crate::forked::{Forked, Maker};
use crate::lease_page::{LeasePlace, PLACES};
use crate::random;
use crate::service::{SERVICES, own};
use crate::time::MonotonicNs;

/// Length of the page, bytes.
const LEN: usize = size_of::<DoorbellPage>();

/// Services that the page tells apart. Those beyond share a slot, which wakes a process without need now and then.
const SLOTS: usize = 15;

/// What lies in the file. `docs/ipc.md` has it as a table; another layout needs another name for the file.
#[repr(C, align(64))]
struct DoorbellPage {
    /// Counts the rings; the word to sleep on.
    rings: AtomicU32,
    /// Counts the generations of the robot's services: another value is a reason to look which one is current.
    generations: AtomicU32,
    /// The bits that a process sleeps for; above them, how often a process announced itself.
    sleepers: AtomicU64,
    /// For each service, how many subscribers have joined: the publisher then has a latest sample to hand on.
    joined: [AtomicU32; SLOTS + 1],
    /// The leases of paths: see [`lease_page`](crate::lease_page).
    leases: [LeasePlace; PLACES],
    reserved: [u32; 76],
}

const _: () = assert!(
    offset_of!(DoorbellPage, joined) == 16 && offset_of!(DoorbellPage, leases) == 80 && LEN == 640
);

/// Which of a service's events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ServiceEvent {
    /// From publisher to subscribers: the service's own name.
    Samples,
    /// From subscribers to the publisher: `<service>/subscribers`.
    Subscribers,
    /// From clients to the server: `<service>/requests`.
    Requests,
    /// From the server to clients: `<service>/responses`.
    Responses,
}

/// Which events wake a sleeper, or are signalled.
pub type Bits = NonZeroU32;

/// Signalled when a service has another generation. Every sleeper sleeps for it.
const GENERATION: Bits = Bits::new(1 << 31).unwrap();

/// The slot of the service `key` in the page: the robot's own have one each, modules' share the rest.
pub(crate) fn doorbell_slot(key: &str) -> DoorbellSlot {
    const { assert!(SERVICES.len() < SLOTS) };
    let shared = SLOTS - SERVICES.len();
    let index = match own(key) {
        Some(id) => id as usize,
        None => SERVICES.len() + (random::hash(key.as_bytes()) % shared as u64) as usize,
    };
    DoorbellSlot(index)
}

/// A service's slot in the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DoorbellSlot(usize);

impl DoorbellSlot {
    /// The bit of one of the service's events.
    pub(crate) fn bits(self, event: ServiceEvent) -> Bits {
        let direction = match event {
            ServiceEvent::Samples | ServiceEvent::Responses => 0,
            ServiceEvent::Subscribers | ServiceEvent::Requests => 1,
        };
        const TWO: Bits = Bits::new(2).unwrap();
        TWO.saturating_pow(2 * self.0 as u32 + direction)
    }
}

/// How a sleep ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slept {
    /// One of the bits was signalled.
    Signalled,
    /// Something was signalled before the sleep began: look at the data.
    Passed,
    /// The time has come.
    TimedOut,
    /// A signal came.
    Interrupted,
}

/// The number of rings that a sleeper has seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenRings(u32);

/// The doorbell of a robot.
#[derive(Debug)]
pub struct Doorbell {
    page: NonNull<DoorbellPage>,
    maker: Maker,
}

// SAFETY: the page is shared between processes, and nothing but atomics.
#[allow(unsafe_code)]
unsafe impl Send for Doorbell {}
// SAFETY: as above.
#[allow(unsafe_code)]
unsafe impl Sync for Doorbell {}

/// The steps of sleeper and ringer on the page and in the kernel, so that tests explore every order of them.
trait Bell {
    /// A full barrier.
    fn barrier(&self);

    /// Reads how often was rung.
    fn rings(&self) -> u32;

    /// Counts a ring.
    fn count_ring(&self);

    /// Reads which bits a process sleeps for, and how often one announced itself. Needs a barrier.
    fn sleepers(&self) -> u64;

    /// Sets bits and counts, in one step.
    fn announce(&self, bits: u32);

    /// Clears bits, unless `sleepers` is another by now.
    fn clear(&self, sleepers: u64, bits: u32);

    /// Wakes all that sleep for one of the bits.
    fn wake(&self, bits: Bits);

    /// Sleeps for these bits unless `rings` is another by now.
    fn wait(&self, rings: u32, bits: Bits, until: MonotonicNs) -> Result<Slept, Errno>;
}

/// One announcement of a sleeper, above the bits.
const ANNOUNCEMENT: u64 = 1 << 32;

/// What `sleepers` is after an announcement.
fn announced(sleepers: u64, bits: u32) -> u64 {
    sleepers.wrapping_add(ANNOUNCEMENT) | u64::from(bits)
}

fn ring(bell: &impl Bell, bits: Bits) {
    bell.barrier();
    let sleepers = bell.sleepers();
    if sleepers & u64::from(bits.get()) == 0 {
        return;
    }
    bell.count_ring();
    bell.wake(bits);
    // Whoever announced itself before `sleepers` was read is woken by now, or finds `rings` changed.
    bell.clear(sleepers, bits.get());
}

fn listen(bell: &impl Bell, bits: Bits) -> SeenRings {
    // Before the bits: a ring that clears them counts before.
    let seen = bell.rings();
    bell.announce((bits | GENERATION).get());
    bell.barrier();
    SeenRings(seen)
}

impl Bell for DoorbellPage {
    fn barrier(&self) {
        fence(Ordering::SeqCst);
    }

    fn rings(&self) -> u32 {
        self.rings.load(Ordering::SeqCst)
    }

    fn count_ring(&self) {
        self.rings.fetch_add(1, Ordering::SeqCst);
    }

    fn sleepers(&self) -> u64 {
        self.sleepers.load(Ordering::Relaxed)
    }

    fn announce(&self, bits: u32) {
        let order = Ordering::SeqCst;
        let _ = (self.sleepers).fetch_update(order, order, |now| Some(announced(now, bits)));
    }

    fn clear(&self, sleepers: u64, bits: u32) {
        let cleared = sleepers & !u64::from(bits);
        let order = Ordering::SeqCst;
        let _ = (self.sleepers).compare_exchange(sleepers, cleared, order, order);
    }

    fn wake(&self, bits: Bits) {
        // All of them; the kernel counts with a signed number.
        let all = i32::MAX as u32;
        if let Err(error) = futex::wake_bitset(&self.rings, futex::Flags::empty(), all, bits) {
            crate::log::debug!(%error, "nobody was woken");
        }
    }

    fn wait(&self, rings: u32, bits: Bits, until: MonotonicNs) -> Result<Slept, Errno> {
        let (until, flags) = (until.timespec(), futex::Flags::empty());
        match futex::wait_bitset(&self.rings, flags, rings, Some(&until), bits) {
            Ok(()) => Ok(Slept::Signalled),
            Err(Errno::AGAIN) => Ok(Slept::Passed),
            Err(Errno::TIMEDOUT) => Ok(Slept::TimedOut),
            Err(Errno::INTR) => Ok(Slept::Interrupted),
            Err(errno) => Err(errno),
        }
    }
}

impl Doorbell {
    /// Maps the doorbell that is the content of `file`. A new one is all zeros, so that no process finds it half made.
    ///
    /// # Errors
    ///
    /// When shared memory is full.
    pub(crate) fn map(file: &File) -> io::Result<Doorbell> {
        // Memory that is full is an error now, not a SIGBUS later.
        fallocate(file, FallocateFlags::empty(), 0, LEN as u64)?;
        // SAFETY: a new mapping at an address of the kernel's choice; the file has been made long enough.
        #[allow(unsafe_code)]
        let page = unsafe {
            let access = ProtFlags::READ | ProtFlags::WRITE;
            mmap(ptr::null_mut(), LEN, access, MapFlags::SHARED, file, 0)?
        };
        let page = NonNull::new(page.cast()).ok_or(io::ErrorKind::OutOfMemory)?;
        Ok(Doorbell {
            page,
            maker: Maker::this_process(),
        })
    }

    fn page(&self) -> &DoorbellPage {
        // SAFETY: mapped until the doorbell is dropped, aligned to a page, and nothing but atomics and an unused word,
        // for which every pattern of bits is a value. Only this user can cut the file short, whom the contract trusts
        // not to.
        #[allow(unsafe_code)]
        unsafe {
            self.page.as_ref()
        }
    }

    /// Whether this is the process that mapped it.
    pub(crate) fn check_process(&self) -> Result<(), Forked> {
        self.maker.check()
    }

    /// Wakes the processes that sleep for one of `bits`. The data must have been written before.
    pub(crate) fn ring(&self, bits: Bits) {
        ring(self.page(), bits);
    }

    /// Announces a sleeper. Look for data afterwards, then [`sleep`](Doorbell::sleep).
    pub(crate) fn listen(&self, bits: Bits) -> SeenRings {
        listen(self.page(), bits)
    }

    /// Sleeps until one of `bits` is signalled, or a service has another generation, unless that was since `seen`.
    ///
    /// # Errors
    ///
    /// When the kernel cannot do that.
    pub(crate) fn sleep(
        &self,
        seen: SeenRings,
        bits: Bits,
        until: MonotonicNs,
    ) -> Result<Slept, Errno> {
        self.page().wait(seen.0, bits | GENERATION, until)
    }

    /// Whether a process still waits for all of `bits`: then none of them was signalled since it listened, or another
    /// process has listened since.
    pub(crate) fn is_awaited(&self, bits: Bits) -> bool {
        !self.page().sleepers.load(Ordering::SeqCst) as u32 & bits.get() == 0
    }

    /// The leases of the robot's paths.
    pub(crate) fn leases(&self) -> &[LeasePlace; PLACES] {
        &self.page().leases
    }

    /// Counts a new subscriber of the service at `slot` and wakes its publisher.
    pub(crate) fn join(&self, slot: DoorbellSlot) {
        self.page().joined[slot.0].fetch_add(1, Ordering::SeqCst);
        self.ring(slot.bits(ServiceEvent::Subscribers));
    }

    /// How many subscribers of the service at `slot` have joined so far, wrapping around.
    pub(crate) fn joined(&self, slot: DoorbellSlot) -> u32 {
        self.page().joined[slot.0].load(Ordering::SeqCst)
    }

    /// Says that a service has another generation, or none, and wakes every sleeper.
    pub(crate) fn change_generation(&self) {
        self.page().generations.fetch_add(1, Ordering::SeqCst);
        self.ring(GENERATION);
    }

    /// Changes whenever a service has another generation.
    pub(crate) fn generations(&self) -> u32 {
        self.page().generations.load(Ordering::SeqCst)
    }
}

impl Drop for Doorbell {
    fn drop(&mut self) {
        // SAFETY: mapped by `map` with this length, and no reference to the page outlives the doorbell.
        #[allow(unsafe_code)]
        let result = unsafe { munmap(self.page.as_ptr().cast(), LEN) };
        if let Err(error) = result {
            crate::log::debug!(%error, "the doorbell stays mapped");
        }
    }
}

#[cfg(test)]
mod tests {
    mod orders;

    use std::collections::BTreeSet;
    use std::time::Duration;

    use super::*;

    const DATA: &str = "hero_telemetry";

    fn samples() -> Bits {
        doorbell_slot(DATA).bits(ServiceEvent::Samples)
    }

    /// Two processes' views of one doorbell.
    fn doorbells() -> [Doorbell; 2] {
        let file = tempfile::tempfile().unwrap();
        [(); 2].map(|()| Doorbell::map(&file).unwrap())
    }

    fn soon() -> MonotonicNs {
        MonotonicNs::now() + Duration::from_millis(1)
    }

    fn late() -> MonotonicNs {
        MonotonicNs::now() + Duration::from_secs(30)
    }

    #[test]
    fn every_event_has_a_bit_of_its_own() {
        let events = [
            ServiceEvent::Samples,
            ServiceEvent::Subscribers,
            ServiceEvent::Requests,
            ServiceEvent::Responses,
        ];
        let mut all = vec![GENERATION.get()];
        for spec in &SERVICES {
            for event in events {
                all.push(doorbell_slot(spec.contract.key).bits(event).get());
            }
        }
        assert!(all.iter().all(|bits| bits.count_ones() == 1));
        all.sort_unstable();
        all.dedup();
        // A service publishes or serves, and so needs two of the four.
        assert_eq!(all.len(), 2 * SERVICES.len() + 1);
    }

    #[test]
    fn services_of_modules_share_the_slots_that_are_left() {
        let keys = (0..1000).map(|number| format!("module_{number}/state"));
        let slots: BTreeSet<usize> = keys.map(|key| doorbell_slot(&key).0).collect();
        assert_eq!(slots, (SERVICES.len()..SLOTS).collect());
    }

    #[test]
    fn a_process_that_was_rung_after_listening_does_not_sleep() {
        let [sleeper, ringer] = doorbells();
        let seen = sleeper.listen(samples());
        ringer.ring(samples());
        assert_eq!(sleeper.sleep(seen, samples(), late()), Ok(Slept::Passed));
    }

    #[test]
    fn a_ring_takes_back_no_bits_but_its_own() {
        let [sleeper, ringer] = doorbells();
        let other = doorbell_slot("dsp_telemetry").bits(ServiceEvent::Samples);
        sleeper.listen(samples() | other);
        ringer.ring(samples());
        assert!(!sleeper.is_awaited(samples()));
        assert!(sleeper.is_awaited(other));
    }

    #[test]
    fn a_new_generation_wakes_every_sleeper() {
        let [sleeper, ringer] = doorbells();
        let before = sleeper.generations();
        let seen = sleeper.listen(samples());
        ringer.change_generation();
        assert_ne!(sleeper.generations(), before);
        assert_eq!(sleeper.sleep(seen, samples(), late()), Ok(Slept::Passed));
    }

    #[test]
    fn a_process_is_not_woken_by_what_it_does_not_sleep_for() {
        let [sleeper, ringer] = doorbells();
        let seen = sleeper.listen(samples());
        ringer.ring(doorbell_slot(DATA).bits(ServiceEvent::Subscribers));
        ringer.ring(doorbell_slot("dsp_telemetry").bits(ServiceEvent::Samples));
        let slept = sleeper.sleep(seen, samples(), soon());
        assert_eq!(slept, Ok(Slept::TimedOut));
        // A bit that was left, as by a process that was killed, does no harm.
        ringer.ring(samples());
        ringer.ring(samples());
        let seen = sleeper.listen(samples());
        let slept = sleeper.sleep(seen, samples(), soon());
        assert_eq!(slept, Ok(Slept::TimedOut));
    }

    /// Both sides keep a count in the place of data. A lost wake-up would be a sleep until `late`.
    #[test]
    fn no_ring_is_lost_between_looking_and_sleeping() {
        const ROUNDS: u32 = 20_000;
        let doorbells = doorbells();
        let data = [const { AtomicU32::new(0) }; 2];
        let sides = [
            samples(),
            doorbell_slot(DATA).bits(ServiceEvent::Subscribers),
        ];
        let play = |me: usize| {
            let doorbell = &doorbells[me];
            for round in 1..=ROUNDS {
                data[me].store(round, Ordering::Release);
                doorbell.ring(sides[me]);
                loop {
                    let seen = doorbell.listen(sides[1 - me]);
                    if data[1 - me].load(Ordering::Acquire) >= round {
                        break;
                    }
                    let slept = doorbell.sleep(seen, sides[1 - me], late()).unwrap();
                    assert_ne!(slept, Slept::TimedOut, "round {round}");
                }
            }
        };
        std::thread::scope(|scope| {
            for me in 0..2 {
                scope.spawn(move || play(me));
            }
        });
    }

    #[test]
    fn subscribers_are_counted_for_each_service() {
        let [subscriber, publisher] = doorbells();
        subscriber.join(doorbell_slot(DATA));
        subscriber.join(doorbell_slot(DATA));
        assert_eq!(publisher.joined(doorbell_slot(DATA)), 2);
        assert_eq!(publisher.joined(doorbell_slot("dsp_telemetry")), 0);
    }

    #[test]
    fn a_module_s_service_shares_a_slot_with_none_of_the_robot_s_own() {
        for key in ["battery_watch/voltages", "a", "b", "c", "camera/state"] {
            let slot = doorbell_slot(key).0;
            assert!((SERVICES.len()..SLOTS).contains(&slot), "{key}: {slot}");
        }
    }
}
