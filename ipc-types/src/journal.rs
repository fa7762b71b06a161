//! The input journals in shared memory: [`JournalPiece`], their topics; [`JournalTail`], the piece that is not
//! published yet, in a file that outlives the process that fills it; and [`LeftTail`], by which a reader has it when
//! that process was killed.
//!
//! The file `tail` in the folder of the journal's service is laid out as a sample of the topic, and mapped into its
//! publisher, which holds an exclusive lock on it. Each publisher makes a file of its own: a reader that has opened one
//! keeps it when the next publisher comes. A process that is killed has carried out its instructions in their order up
//! to one of them, on every processor, and the reader looks when the kernel has given the lock back. So `length` is
//! written after the bytes that it counts, and `sequence` last. The compiler keeps that order: each store of the head
//! releases what was written before, and a fence keeps the bytes behind the stores before them.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, compiler_fence};

use rustix::fs::{AtFlags, FallocateFlags, FlockOperation, fallocate, renameat, unlinkat};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

use crate::domain_error::DomainError;
use crate::lock_file::{LockFile, flock, make_lock_file_in, open_folder, open_lock_file_in};
use crate::payload::{
    BRIDGE_JOURNAL_ROOM, BridgeJournal, STATUS_JOURNAL_ROOM, SharedStruct, StatusJournal,
};
use crate::service::Topic;
use crate::time::MonotonicNs;

/// Subscribers of a journal, in all processes: a recorder, one that takes its place, and two that look. A piece is
/// large, and the memory for all that can wait grows with this number.
pub const JOURNAL_SUBSCRIBERS: usize = 4;

/// A topic whose samples are pieces of a journal.
pub trait JournalPiece: Topic {
    /// Most bytes of a piece.
    const ROOM: usize;

    /// Fills in a piece that is all zeros. Of `bytes`, [`ROOM`](JournalPiece::ROOM) are taken.
    fn fill(&mut self, published_ns: u64, begins: bool, beginnings: u32, bytes: &[u8]);

    /// Whether reading can begin with this piece.
    fn begins(&self) -> bool;

    /// How often the journal was begun by this publisher.
    fn beginnings(&self) -> u32;

    /// The bytes that mean something; a length that the contract does not have is that of all.
    fn bytes_of_journal(&self) -> &[u8];
}

macro_rules! journal {
    ($piece:ty, $key:literal, $provider:literal, $room:expr) => {
        crate::topic!($piece, $key, $provider, JOURNAL_SUBSCRIBERS);

        impl JournalPiece for $piece {
            const ROOM: usize = $room;

            fn fill(&mut self, published_ns: u64, begins: bool, beginnings: u32, bytes: &[u8]) {
                let length = bytes.len().min($room);
                self.published_ns = published_ns;
                self.begins = begins.into();
                self.beginnings = beginnings;
                self.length = length as u32;
                self.data[..length].copy_from_slice(&bytes[..length]);
            }

            fn begins(&self) -> bool {
                self.begins == 1
            }

            fn beginnings(&self) -> u32 {
                self.beginnings
            }

            fn bytes_of_journal(&self) -> &[u8] {
                let length = usize::try_from(self.length).unwrap_or($room);
                &self.data[..length.min($room)]
            }
        }

        const _: () = assert!(<$piece as SharedStruct>::LAYOUT.size == $room + 40);
    };
}

journal!(
    BridgeJournal,
    "bridge/journal",
    "bridge",
    BRIDGE_JOURNAL_ROOM
);
journal!(
    StatusJournal,
    "status/journal",
    "status",
    STATUS_JOURNAL_ROOM
);

/// Its name in the folder of the journal's service.
const TAIL_FILE: &str = "tail";

/// Its name while it is made.
const NEW_FILE: &str = "tail.new";

/// What every [`JournalPiece`] begins with; its bytes follow.
#[repr(C)]
struct Head {
    sequence: AtomicU64,
    epoch_ns: AtomicU64,
    published_ns: AtomicU64,
    begins: AtomicU32,
    length: AtomicU32,
    beginnings: AtomicU32,
    reserved: AtomicU32,
}

/// A field of a head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Field {
    Sequence,
    Epoch,
    Published,
    Begins,
    Length,
    Beginnings,
}

/// The writes to a tail, so that tests explore where their order may end.
trait TailMemory {
    fn load(&self, field: Field) -> u64;

    /// Writes after everything that was written before.
    fn store(&mut self, field: Field, value: u64);

    /// What is written later is not written before what came until now.
    fn fence(&mut self);

    /// Writes bytes of the piece from its byte `at` on.
    fn copy(&mut self, at: usize, bytes: &[u8]);
}

/// See [`JournalTail::keep`]. `bytes` have room.
fn keep(
    tail: &mut impl TailMemory,
    now: MonotonicNs,
    [epoch_ns, sequence]: [u64; 2],
    begins: bool,
    beginnings: u32,
    bytes: &[u8],
) {
    let mut kept = tail.load(Field::Length) as usize;
    let is_other = tail.load(Field::Sequence) != sequence
        || tail.load(Field::Beginnings) != u64::from(beginnings)
        || kept > bytes.len();
    if is_other {
        tail.store(Field::Sequence, 0);
        tail.store(Field::Length, 0);
        tail.store(Field::Epoch, epoch_ns);
        tail.store(Field::Beginnings, beginnings.into());
        kept = 0;
    }
    if kept == bytes.len() {
        return;
    }
    tail.store(Field::Begins, begins.into());
    tail.store(Field::Published, now.0);
    tail.fence();
    tail.copy(kept, &bytes[kept..]);
    tail.store(Field::Length, bytes.len() as u64);
    tail.store(Field::Sequence, sequence);
}

/// What a journal has beyond its published pieces, kept by its publisher.
#[derive(Debug)]
pub struct JournalTail {
    head: NonNull<Head>,
    /// Bytes that a piece has room for behind its head.
    room: usize,
    /// Locked as long as its publisher lives.
    _file: LockFile,
}

// SAFETY: the mapping belongs to this value alone; other processes read the file.
#[allow(unsafe_code)]
unsafe impl Send for JournalTail {}

impl JournalTail {
    /// Makes the file in the folder of the service, which this process provides.
    pub(crate) fn create<P: JournalPiece>(folder: &Path) -> Result<JournalTail, DomainError> {
        let path = folder.join(TAIL_FILE);
        let failed = |action, error: Errno| DomainError::io(action, &path, error);
        let is_gone = || DomainError::io("open", folder, io::ErrorKind::NotFound);
        let dir = open_folder(folder)?.ok_or_else(is_gone)?;
        match unlinkat(&*dir, NEW_FILE, AtFlags::empty()) {
            Ok(()) | Err(Errno::NOENT) => {}
            Err(error) => return Err(failed("remove", error)),
        }
        let file = make_lock_file_in(&dir, NEW_FILE, folder)?.ok_or_else(is_gone)?;
        flock(&file, FlockOperation::NonBlockingLockExclusive, &path)?;
        let len = size_of::<Head>() + P::ROOM;
        // Memory that is full is an error now, not a SIGBUS later.
        fallocate(&*file, FallocateFlags::empty(), 0, len as u64)
            .map_err(|error| failed("write", error))?;
        // SAFETY: a new mapping at an address of the kernel's choice; the file has been made long enough.
        #[allow(unsafe_code)]
        let head = unsafe {
            let access = ProtFlags::READ | ProtFlags::WRITE;
            mmap(ptr::null_mut(), len, access, MapFlags::SHARED, &*file, 0)
        };
        let head = head.map_err(|error| failed("map", error))?;
        // No reader finds it before it is locked.
        renameat(&*dir, NEW_FILE, &*dir, TAIL_FILE).map_err(|error| failed("rename", error))?;
        Ok(JournalTail {
            head: NonNull::new(head.cast()).ok_or_else(is_gone)?,
            room: P::ROOM,
            _file: file,
        })
    }

    fn head(&self) -> &Head {
        // SAFETY: mapped until this is dropped, aligned to a page, and nothing but atomics, for which every pattern of
        // bits is a value.
        #[allow(unsafe_code)]
        unsafe {
            self.head.as_ref()
        }
    }

    /// Keeps the piece that will be published with this `epoch_ns` and `sequence`: all `bytes` that it has
    /// until now. Only those that have come since the last call are copied.
    pub fn keep(
        &mut self,
        now: MonotonicNs,
        id: [u64; 2],
        begins: bool,
        beginnings: u32,
        bytes: &[u8],
    ) {
        let bytes = &bytes[..bytes.len().min(self.room)];
        keep(self, now, id, begins, beginnings, bytes);
    }

    /// Nothing waits: all is published, or nothing is recorded.
    pub fn clear(&mut self) {
        self.head().sequence.store(0, Ordering::Release);
    }
}

impl TailMemory for JournalTail {
    fn load(&self, field: Field) -> u64 {
        let (head, order) = (self.head(), Ordering::Relaxed);
        match field {
            Field::Sequence => head.sequence.load(order),
            Field::Epoch => head.epoch_ns.load(order),
            Field::Published => head.published_ns.load(order),
            Field::Begins => head.begins.load(order).into(),
            Field::Length => head.length.load(order).into(),
            Field::Beginnings => head.beginnings.load(order).into(),
        }
    }

    fn store(&mut self, field: Field, value: u64) {
        let (head, order) = (self.head(), Ordering::Release);
        match field {
            Field::Sequence => head.sequence.store(value, order),
            Field::Epoch => head.epoch_ns.store(value, order),
            Field::Published => head.published_ns.store(value, order),
            Field::Begins => head.begins.store(value as u32, order),
            Field::Length => head.length.store(value as u32, order),
            Field::Beginnings => head.beginnings.store(value as u32, order),
        }
    }

    fn fence(&mut self) {
        compiler_fence(Ordering::SeqCst);
    }

    fn copy(&mut self, at: usize, bytes: &[u8]) {
        assert!(at + bytes.len() <= self.room);
        // SAFETY: the mapping has `room` bytes behind the head, which nothing else in this process uses.
        #[allow(unsafe_code)]
        unsafe {
            let data = self.head.as_ptr().add(1).cast::<u8>();
            ptr::copy_nonoverlapping(bytes.as_ptr(), data.add(at), bytes.len());
        }
    }
}

impl Drop for JournalTail {
    fn drop(&mut self) {
        let len = size_of::<Head>() + self.room;
        // SAFETY: mapped by `create` with this length, and no reference to the head outlives this value.
        #[allow(unsafe_code)]
        let result = unsafe { munmap(self.head.as_ptr().cast(), len) };
        if let Err(error) = result {
            crate::log::debug!(%error, "the tail of a journal stays mapped");
        }
    }
}

/// The tail of a journal whose publisher may end.
#[derive(Debug)]
pub struct LeftTail {
    file: LockFile,
    path: PathBuf,
}

impl LeftTail {
    /// `None` if there is none.
    pub(crate) fn open(folder: &Path) -> Result<Option<LeftTail>, DomainError> {
        let Some(dir) = open_folder(folder)? else {
            return Ok(None);
        };
        let file = open_lock_file_in(&dir, TAIL_FILE, folder)?;
        let path = folder.join(TAIL_FILE);
        Ok(file.map(|file| LeftTail { file, path }))
    }

    /// Whether its publisher is gone: the kernel gives the lock back with the process.
    pub fn is_left(&self) -> bool {
        let shared = FlockOperation::NonBlockingLockShared;
        flock(&self.file, shared, &self.path).unwrap_or(false)
    }

    /// The sample that the publisher would have published next; `None` if nothing waited. Look first whether it [is
    /// gone](LeftTail::is_left).
    pub fn read<P: JournalPiece>(&self) -> Option<P> {
        let mut bytes = vec![0; size_of::<P>()];
        let file: &File = &self.file;
        file.read_exact_at(&mut bytes, 0).ok()?;
        let piece = P::from_bytes(&bytes)?;
        (piece.sequence() > 0).then_some(piece)
    }
}

#[cfg(test)]
mod orders;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::test_folder;

    #[test]
    fn a_piece_takes_what_it_has_room_for_and_gives_it_back() {
        let mut piece = BridgeJournal::default();
        piece.fill(7, true, 2, &[9; 5000]);
        assert!(piece.begins());
        assert_eq!(piece.bytes_of_journal(), &[9; BRIDGE_JOURNAL_ROOM][..]);
        piece.length = u32::MAX;
        assert_eq!(piece.bytes_of_journal().len(), BRIDGE_JOURNAL_ROOM);
        let mut piece = StatusJournal::default();
        piece.fill(7, false, 2, &[1, 2, 3]);
        assert!(!piece.begins());
        assert_eq!(piece.bytes_of_journal(), &[1, 2, 3]);
    }

    fn open(folder: &Path) -> LeftTail {
        LeftTail::open(folder).unwrap().expect("a tail")
    }

    #[test]
    fn what_was_kept_is_read_when_its_publisher_is_gone_and_not_before() {
        let folder = test_folder();
        assert!(LeftTail::open(folder.path()).unwrap().is_none());
        let mut tail = JournalTail::create::<BridgeJournal>(folder.path()).unwrap();
        let left = open(folder.path());
        tail.keep(MonotonicNs(9), [7, 3], true, 2, &[1, 2]);
        tail.keep(MonotonicNs(10), [7, 3], true, 2, &[1, 2, 3]);
        assert!(!left.is_left());
        drop(tail);
        assert!(left.is_left());
        let mut expected = BridgeJournal::default();
        expected.fill(10, true, 2, &[1, 2, 3]);
        (expected.sequence, expected.epoch_ns) = (3, 7);
        assert_eq!(left.read::<BridgeJournal>(), Some(expected));
        // The next publisher has a file of its own.
        let next = JournalTail::create::<BridgeJournal>(folder.path()).unwrap();
        assert_eq!(left.read::<BridgeJournal>(), Some(expected));
        drop(next);
        assert!(open(folder.path()).read::<BridgeJournal>().is_none());
    }

    #[test]
    fn a_piece_replaces_the_one_before() {
        let folder = test_folder();
        let read = |keep: &dyn Fn(&mut JournalTail)| {
            let mut tail = JournalTail::create::<BridgeJournal>(folder.path()).unwrap();
            tail.keep(MonotonicNs(9), [7, 3], true, 2, &[1, 2, 3]);
            keep(&mut tail);
            drop(tail);
            let piece = open(folder.path()).read::<BridgeJournal>()?;
            Some((piece.sequence, piece.bytes_of_journal().to_vec()))
        };
        let now = MonotonicNs(10);
        let next = read(&|tail| tail.keep(now, [7, 4], false, 2, &[4]));
        assert_eq!(next, Some((4, vec![4])));
        let began_anew = read(&|tail| tail.keep(now, [7, 3], true, 3, &[5, 6, 7, 8]));
        assert_eq!(began_anew, Some((3, vec![5, 6, 7, 8])));
        assert_eq!(read(&|tail| tail.keep(now, [7, 4], false, 2, &[])), None);
        assert_eq!(read(&JournalTail::clear), None);
        let too_many = read(&|tail| tail.keep(now, [7, 4], false, 2, &[1; 5000]));
        assert_eq!(too_many.unwrap().1.len(), BridgeJournal::ROOM);
    }
}
