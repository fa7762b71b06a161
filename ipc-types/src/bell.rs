//! The bell: wakes whoever sleeps for shared memory in about the time of a futex.
//!
//! iceoryx2's own events go through a socket: two system calls to send one, two to read it, and one to wait, for each
//! listener. The bell is one page in shared memory for each robot. All its sleepers sleep on one word of it; each says
//! with a bit for every event which of them are to wake it, so that one sleep serves several ports.
//!
//! ```text
//! sleeper                                  ringer
//!   heard = rings                            write the data
//!   sleepers |= my bits                      unless sleepers & bits: done
//!   look for data: there is some, done       sleepers &= !bits
//!   sleep while rings == heard               rings += 1, wake those who sleep for bits
//! ```
//!
//! Either the ringer sees the sleeper's bit, or the sleeper sees the data: both write before they read, with a full
//! barrier between. And who has looked in vain either still finds `rings` changed, or is asleep and is woken. So no
//! wake-up is lost, and while nobody sleeps ringing costs a barrier and a load.
//!
//! Nothing of it can be left broken: a sleeper that is killed leaves at most its bit, which costs the next ringer one
//! system call; a ringer that is killed between data and bell leaves a sleep that its bound ends. The numbers in the page
//! are only hints to look at the data.

use std::fs::OpenOptions;
use std::io;
use std::num::NonZeroU32;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicU32, Ordering, fence};

use rustix::fs::{FallocateFlags, OFlags, fallocate};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;

use crate::domain::lock::is_ours;
use crate::domain::management::OTHERS;
use crate::domain::{Domain, SHM_DIR};
use crate::event::Channel;
use crate::files;
use crate::robot::RobotId;
use crate::service::{SERVICES, ServiceId};
use crate::time::MonotonicNs;

/// Length of the segment, bytes.
const LEN: usize = size_of::<Page>();

/// What lies in the segment. `docs/ipc.md` has it as a table; another layout needs another name for the segment.
#[repr(C, align(64))]
struct Page {
    /// Counts the rings; the word to sleep on.
    rings: AtomicU32,
    /// The bits that somebody sleeps for.
    sleepers: AtomicU32,
    /// For each service, how many subscribers have come: the publisher then has a latest sample to hand on.
    arrivals: [AtomicU32; SERVICES.len()],
}

/// Which events wake a sleeper, or are rung.
pub(crate) type Bits = NonZeroU32;

/// The bit of one of a service's events.
pub(crate) fn bits(service: ServiceId, channel: Channel) -> Bits {
    let direction = match channel {
        Channel::Samples | Channel::Responses => 0,
        Channel::Subscribers | Channel::Requests => 1,
    };
    const { assert!(2 * SERVICES.len() <= 32) };
    const TWO: Bits = Bits::new(2).unwrap();
    TWO.saturating_pow(2 * service as u32 + direction)
}

/// How a sleep ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slept {
    /// One of the bits was rung.
    Rung,
    /// Something was rung before the sleep began: look at the data.
    Passed,
    /// The time has come.
    TimedOut,
    /// A signal came.
    Interrupted,
}

/// The number of rings that a sleeper has heard of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heard(u32);

/// The bell of a robot.
#[derive(Debug)]
pub(crate) struct Bell {
    page: NonNull<Page>,
}

impl Bell {
    /// Where the bell of a robot lies.
    pub(crate) fn path(domain: &Domain, robot: RobotId) -> PathBuf {
        Path::new(SHM_DIR).join(format!("{}{robot}.v1.bell", domain.prefix()))
    }

    /// Opens the robot's bell, or makes it. A new one is all zeros, so that nobody finds it half made. It is removed
    /// with the domain, never by its users.
    ///
    /// # Errors
    ///
    /// When another user was there first, who then has nothing of it; or when shared memory is full.
    pub(crate) fn open(domain: &Domain, robot: RobotId) -> io::Result<Bell> {
        let mut options = OpenOptions::new();
        options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            // A link or a pipe that a stranger put there neither leads anywhere nor holds anybody up.
            .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32);
        let file = files::while_no_port_opens(|| options.open(Bell::path(domain, robot)))?;
        let metadata = file.metadata()?;
        if !metadata.is_file() || !is_ours(&metadata) || metadata.mode() & OTHERS != 0 {
            let reason = "it belongs to another user, or is open to others";
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, reason));
        }
        // Memory that is full is an error now, not a SIGBUS later.
        fallocate(&file, FallocateFlags::empty(), 0, LEN as u64)?;
        // SAFETY: a new mapping at an address of the kernel's choice; the file has been made long enough.
        #[allow(unsafe_code)]
        let page = unsafe {
            let access = ProtFlags::READ | ProtFlags::WRITE;
            mmap(ptr::null_mut(), LEN, access, MapFlags::SHARED, &file, 0)?
        };
        let page = NonNull::new(page.cast()).ok_or(io::ErrorKind::OutOfMemory)?;
        Ok(Bell { page })
    }

    fn page(&self) -> &Page {
        // SAFETY: mapped until the bell is dropped, aligned to a page, and nothing but atomics, for which every pattern
        // of bits is a value. Only this user can cut the segment short, whom the contract trusts not to.
        #[allow(unsafe_code)]
        unsafe {
            self.page.as_ref()
        }
    }

    /// Wakes whoever sleeps for one of `bits`. The data must have been written before.
    pub(crate) fn ring(&self, bits: Bits) {
        let page = self.page();
        fence(Ordering::SeqCst);
        if page.sleepers.load(Ordering::Relaxed) & bits.get() == 0 {
            return;
        }
        page.sleepers.fetch_and(!bits.get(), Ordering::SeqCst);
        page.rings.fetch_add(1, Ordering::SeqCst);
        // Everybody, which the kernel counts as a signed number.
        let result = futex::wake_bitset(&page.rings, futex::Flags::empty(), i32::MAX as u32, bits);
        if let Err(error) = result {
            tracing::debug!(%error, "the bell was not heard");
        }
    }

    /// Announces a sleeper. Look for data afterwards, then [`sleep`](Bell::sleep).
    pub(crate) fn listen(&self, bits: Bits) -> Heard {
        let page = self.page();
        let heard = page.rings.load(Ordering::SeqCst);
        page.sleepers.fetch_or(bits.get(), Ordering::SeqCst);
        fence(Ordering::SeqCst);
        Heard(heard)
    }

    /// Sleeps until one of `bits` is rung, unless it was since `heard`.
    ///
    /// # Errors
    ///
    /// When the kernel cannot do that.
    pub(crate) fn sleep(
        &self,
        heard: Heard,
        bits: Bits,
        until: MonotonicNs,
    ) -> Result<Slept, Errno> {
        let rings = &self.page().rings;
        let until = until.timespec();
        match futex::wait_bitset(rings, futex::Flags::empty(), heard.0, Some(&until), bits) {
            Ok(()) => Ok(Slept::Rung),
            Err(Errno::AGAIN) => Ok(Slept::Passed),
            Err(Errno::TIMEDOUT) => Ok(Slept::TimedOut),
            Err(Errno::INTR) => Ok(Slept::Interrupted),
            Err(errno) => Err(errno),
        }
    }

    /// Whether somebody still waits for all of `bits`: then nobody has rung since he listened.
    pub(crate) fn is_awaited(&self, bits: Bits) -> bool {
        !self.page().sleepers.load(Ordering::SeqCst) & bits.get() == 0
    }

    /// Counts a new subscriber of `service` and wakes its publisher.
    pub(crate) fn arrive(&self, service: ServiceId) {
        self.page().arrivals[service as usize].fetch_add(1, Ordering::SeqCst);
        self.ring(bits(service, Channel::Subscribers));
    }

    /// How many subscribers of `service` have come so far, wrapping around.
    pub(crate) fn arrivals(&self, service: ServiceId) -> u32 {
        self.page().arrivals[service as usize].load(Ordering::SeqCst)
    }
}

impl Drop for Bell {
    fn drop(&mut self) {
        // SAFETY: mapped by `open` with this length, and no reference to the page outlives the bell.
        #[allow(unsafe_code)]
        let result = unsafe { munmap(self.page.as_ptr().cast(), LEN) };
        if let Err(error) = result {
            tracing::debug!(%error, "the bell stays mapped");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::time::Duration;

    use super::*;

    const DATA: ServiceId = ServiceId::HeroTelemetry;

    fn samples() -> Bits {
        bits(DATA, Channel::Samples)
    }

    /// Two processes' views of one bell. The domain's lock is not needed for that.
    fn bells(domain: &Domain) -> [Bell; 2] {
        [(); 2].map(|()| Bell::open(domain, RobotId::DEFAULT).unwrap())
    }

    fn remove(domain: &Domain) {
        fs::remove_file(Bell::path(domain, RobotId::DEFAULT)).unwrap();
    }

    fn soon() -> MonotonicNs {
        MonotonicNs::now() + Duration::from_millis(1)
    }

    fn late() -> MonotonicNs {
        MonotonicNs::now() + Duration::from_secs(30)
    }

    #[test]
    fn every_event_has_a_bit_of_its_own() {
        let channels = [
            Channel::Samples,
            Channel::Subscribers,
            Channel::Requests,
            Channel::Responses,
        ];
        let mut all = Vec::new();
        for spec in &SERVICES {
            for channel in channels {
                all.push(bits(spec.id, channel).get());
            }
        }
        assert!(all.iter().all(|bits| bits.count_ones() == 1));
        all.sort_unstable();
        all.dedup();
        // A service publishes or serves, and so needs two of the four.
        assert_eq!(all.len(), 2 * SERVICES.len());
    }

    #[test]
    fn who_was_rung_after_listening_does_not_sleep() {
        let domain = Domain::isolated();
        let [sleeper, ringer] = bells(&domain);
        let heard = sleeper.listen(samples());
        ringer.ring(samples());
        assert_eq!(sleeper.sleep(heard, samples(), late()), Ok(Slept::Passed));
        remove(&domain);
    }

    #[test]
    fn nobody_is_woken_by_what_he_does_not_sleep_for() {
        let domain = Domain::isolated();
        let [sleeper, ringer] = bells(&domain);
        let heard = sleeper.listen(samples());
        ringer.ring(bits(DATA, Channel::Subscribers));
        ringer.ring(bits(ServiceId::DspTelemetry, Channel::Samples));
        let slept = sleeper.sleep(heard, samples(), soon());
        assert_eq!(slept, Ok(Slept::TimedOut));
        // A bit that was left, as by a process that was killed, does no harm.
        ringer.ring(samples());
        ringer.ring(samples());
        let heard = sleeper.listen(samples());
        let slept = sleeper.sleep(heard, samples(), soon());
        assert_eq!(slept, Ok(Slept::TimedOut));
        remove(&domain);
    }

    /// Both sides keep a count in the place of data. A lost wake-up would be a sleep until `late`.
    #[test]
    fn no_ring_is_lost_between_looking_and_sleeping() {
        const ROUNDS: u32 = 20_000;
        let domain = Domain::isolated();
        let bells = bells(&domain);
        let data = [const { AtomicU32::new(0) }; 2];
        let sides = [samples(), bits(DATA, Channel::Subscribers)];
        let play = |me: usize| {
            let bell = Bell::open(&domain, RobotId::DEFAULT).unwrap();
            for round in 1..=ROUNDS {
                data[me].store(round, Ordering::Release);
                bell.ring(sides[me]);
                loop {
                    let heard = bell.listen(sides[1 - me]);
                    if data[1 - me].load(Ordering::Acquire) >= round {
                        break;
                    }
                    let slept = bell.sleep(heard, sides[1 - me], late()).unwrap();
                    assert_ne!(slept, Slept::TimedOut, "round {round}");
                }
            }
        };
        std::thread::scope(|scope| {
            for me in 0..2 {
                scope.spawn(move || play(me));
            }
        });
        drop(bells);
        remove(&domain);
    }

    #[test]
    fn arrivals_are_counted_for_each_service() {
        let domain = Domain::isolated();
        let [subscriber, publisher] = bells(&domain);
        subscriber.arrive(DATA);
        subscriber.arrive(DATA);
        assert_eq!(publisher.arrivals(DATA), 2);
        assert_eq!(publisher.arrivals(ServiceId::DspTelemetry), 0);
        remove(&domain);
    }

    #[test]
    fn a_bell_that_others_may_touch_is_not_used() {
        let domain = Domain::isolated();
        let path = Bell::path(&domain, RobotId::DEFAULT);
        fs::write(&path, "").unwrap();
        for mode in [0o602, 0o640, 0o666] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            let error = Bell::open(&domain, RobotId::DEFAULT).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::PermissionDenied);
        }
        fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink("/dev/null", &path).unwrap();
        assert!(Bell::open(&domain, RobotId::DEFAULT).is_err());
        fs::remove_file(&path).unwrap();
    }
}
