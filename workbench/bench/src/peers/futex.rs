//! The least that shared memory needs to wake a reader: one slot under a sequence lock, and a futex.
//!
//! This is no library: no discovery, one writer, one slot, nothing survives a death. It is the floor that a blocking
//! hop through shared memory can be measured against.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use ipc_types::payload::{HeroTelemetry, SharedStruct};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap};
use rustix::thread::futex;

use super::ends::{Mark, Receive, Send, TIMEOUT};

/// Words of a sample.
const WORDS: usize = size_of::<HeroTelemetry>() / 8;

const _: () = assert!(size_of::<HeroTelemetry>() == WORDS * 8);

/// What lies in shared memory. All zero is a valid beginning.
#[repr(C)]
struct Shared {
    /// Rises by two with each sample; odd while one is written. It is the futex.
    sequence: AtomicU32,
    /// How many readers sleep, so that a writer without a sleeper makes no system call.
    sleepers: AtomicU32,
    words: [AtomicU64; WORDS],
}

/// The file of the segment, to be removed when both ends are gone.
pub fn segment(folder: &Path) -> PathBuf {
    Path::new("/dev/shm").join(folder.file_name().unwrap_or_default())
}

/// The segment of the folder that this process runs in, mapped for as long as the process lives.
fn map() -> Result<&'static Shared> {
    let file = File::options()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(segment(&std::env::current_dir()?))?;
    let len = size_of::<Shared>();
    file.set_len(len as u64)?;
    let (access, kind) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED);
    // SAFETY: the mapping is new, large enough, aligned to a page, never unmapped, and holds only atomics, for which
    // every bit pattern is valid and which other processes may change.
    #[allow(unsafe_code)]
    unsafe {
        let address = mmap(std::ptr::null_mut(), len, access, kind, &file, 0)?;
        Ok(&*address.cast::<Shared>())
    }
}

pub fn sender() -> Result<Send> {
    let shared = map()?;
    Ok(Box::new(move |sample| {
        let before = shared.sequence.load(Ordering::Relaxed);
        shared
            .sequence
            .store(before.wrapping_add(1), Ordering::Relaxed);
        fence(Ordering::Release);
        for (slot, word) in shared.words.iter().zip(sample.bytes().as_chunks().0) {
            slot.store(u64::from_ne_bytes(*word), Ordering::Relaxed);
        }
        // Sequentially consistent with the reader's: either this sees the sleeper, or the sleeper sees the sample.
        shared
            .sequence
            .store(before.wrapping_add(2), Ordering::SeqCst);
        if shared.sleepers.load(Ordering::SeqCst) > 0 {
            futex::wake(&shared.sequence, futex::Flags::empty(), u32::MAX >> 1)?;
        }
        Ok(())
    }))
}

pub fn receiver() -> Result<Receive> {
    let shared = map()?;
    let mut seen = shared.sequence.load(Ordering::Acquire);
    Ok(Box::new(move |take| {
        loop {
            let sequence = shared.sequence.load(Ordering::SeqCst);
            if sequence == seen {
                sleep(shared, seen)?;
            } else if sequence % 2 == 1 {
                std::hint::spin_loop();
            } else if let Some(mark) = read(shared, sequence)? {
                seen = sequence;
                take(mark);
                return Ok(());
            }
        }
    }))
}

/// The sample with this sequence, or `None` when the writer was faster.
fn read(shared: &Shared, sequence: u32) -> Result<Option<Mark>> {
    let mut bytes = [0; WORDS * 8];
    for (word, slot) in bytes.as_chunks_mut().0.iter_mut().zip(&shared.words) {
        *word = slot.load(Ordering::Relaxed).to_ne_bytes();
    }
    fence(Ordering::Acquire);
    if shared.sequence.load(Ordering::Relaxed) != sequence {
        return Ok(None);
    }
    let sample = HeroTelemetry::from_bytes(&bytes).context("the size is equal")?;
    Ok(Some(Mark::of(&sample)))
}

fn sleep(shared: &Shared, seen: u32) -> Result<()> {
    let timeout = Duration::try_into(TIMEOUT)?;
    shared.sleepers.fetch_add(1, Ordering::SeqCst);
    let result = futex::wait(
        &shared.sequence,
        futex::Flags::empty(),
        seen,
        Some(&timeout),
    );
    shared.sleepers.fetch_sub(1, Ordering::SeqCst);
    match result {
        Ok(()) | Err(Errno::AGAIN | Errno::INTR) => Ok(()),
        Err(Errno::TIMEDOUT) => bail!("no sample came"),
        Err(error) => Err(error.into()),
    }
}
