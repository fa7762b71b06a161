//! The least that shared memory needs to wake somebody: one slot under a sequence lock, and a futex.
//!
//! What is built here is no library: no discovery, one writer, one slot, nothing survives a death. It is the floor that
//! a blocking hop through shared memory can be measured against.

use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
use std::time::Duration;

use anyhow::{Result, bail};
use ipc_types::payload::HeroTelemetry;
use rustix::fs::{Mode, ftruncate};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap};
use rustix::shm;
use rustix::thread::futex;

use super::ends::{Mark, PATIENCE};
use crate::plain::{self, WORDS};

/// What lies in shared memory. All zero is a valid beginning.
#[repr(C)]
struct Shared {
    /// Rises by two with each sample; odd while one is written. Its low half is the futex.
    sequence: AtomicU32,
    /// How many readers sleep, so that nobody is woken for nothing.
    sleepers: AtomicU32,
    words: [AtomicU64; WORDS],
}

/// The segment, mapped for as long as the process lives.
fn map(site: &Path) -> Result<&'static Shared> {
    let name = format!(
        "/{}",
        site.file_name().unwrap_or_default().to_string_lossy()
    );
    let flags = shm::OFlags::CREATE | shm::OFlags::RDWR;
    let file = shm::open(name, flags, Mode::RUSR | Mode::WUSR)?;
    let len = size_of::<Shared>();
    ftruncate(&file, len as u64)?;
    let (access, kind) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED);
    // SAFETY: the mapping is new, large enough, aligned to a page, never unmapped, and holds only atomics, for which
    // every bit pattern is valid and which other processes may change.
    #[allow(unsafe_code)]
    unsafe {
        let address = mmap(std::ptr::null_mut(), len, access, kind, &file, 0)?;
        Ok(&*address.cast::<Shared>())
    }
}

/// The name of the segment in `/dev/shm`, to be removed when both ends are gone.
pub fn segment(site: &Path) -> std::path::PathBuf {
    Path::new("/dev/shm").join(site.file_name().unwrap_or_default())
}

pub struct Writer(&'static Shared);

impl Writer {
    pub fn new(site: &Path) -> Result<Writer> {
        Ok(Writer(map(site)?))
    }
}

impl super::ends::Sender for Writer {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        let shared = self.0;
        let before = shared.sequence.load(Ordering::Relaxed);
        shared
            .sequence
            .store(before.wrapping_add(1), Ordering::Relaxed);
        fence(Ordering::Release);
        for (slot, word) in shared.words.iter().zip(plain::to_words(sample)) {
            slot.store(word, Ordering::Relaxed);
        }
        // Sequentially consistent with the reader's: either this sees the sleeper, or the sleeper sees the sample.
        shared
            .sequence
            .store(before.wrapping_add(2), Ordering::SeqCst);
        if shared.sleepers.load(Ordering::SeqCst) > 0 {
            futex::wake(&shared.sequence, futex::Flags::empty(), u32::MAX >> 1)?;
        }
        Ok(())
    }
}

pub struct Reader {
    shared: &'static Shared,
    seen: u32,
}

impl Reader {
    pub fn new(site: &Path) -> Result<Reader> {
        let shared = map(site)?;
        Ok(Reader {
            shared,
            seen: shared.sequence.load(Ordering::Acquire),
        })
    }

    /// The sample with the sequence `wanted`, or nothing when the writer was faster.
    fn read(&self, wanted: u32) -> Option<HeroTelemetry> {
        let mut words = [0; WORDS];
        for (word, slot) in words.iter_mut().zip(&self.shared.words) {
            *word = slot.load(Ordering::Relaxed);
        }
        fence(Ordering::Acquire);
        let after = self.shared.sequence.load(Ordering::Relaxed);
        (after == wanted).then(|| plain::from_words(words))
    }

    fn sleep(&self) -> Result<()> {
        let timeout = Duration::try_into(PATIENCE)?;
        self.shared.sleepers.fetch_add(1, Ordering::SeqCst);
        let result = futex::wait(
            &self.shared.sequence,
            futex::Flags::empty(),
            self.seen,
            Some(&timeout),
        );
        self.shared.sleepers.fetch_sub(1, Ordering::SeqCst);
        match result {
            Ok(()) | Err(Errno::AGAIN | Errno::INTR) => Ok(()),
            Err(Errno::TIMEDOUT) => bail!("no sample came"),
            Err(error) => Err(error.into()),
        }
    }
}

impl super::ends::Receiver for Reader {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        loop {
            let sequence = self.shared.sequence.load(Ordering::SeqCst);
            if sequence == self.seen {
                self.sleep()?;
            } else if sequence % 2 == 1 {
                std::hint::spin_loop();
            } else if let Some(sample) = self.read(sequence) {
                self.seen = sequence;
                take(Mark::of(&sample));
                return Ok(());
            }
        }
    }
}
