//! A file system in memory that fails as a test asks for, for the tests of this crate.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use ipc_types::MonotonicNs;

use crate::log::clock::ClockAnchor;
use crate::log::file_name::{FileKind, file_name};
use crate::log::store::{LogFile, Store};
use crate::log::tsv::whole_rows;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StoreFault {
    /// The disk is full: nothing is created and nothing gets longer.
    NoSpace,
    /// The disk is full in the middle of a write, which takes half of its bytes.
    HalfFull,
    /// The disk is broken: nothing works.
    Broken,
    /// The disk breaks in the middle of a write, which takes half of its bytes, and nothing can be truncated any more.
    BreaksHalfway,
}

impl StoreFault {
    pub(crate) const ALL: [StoreFault; 4] = [
        StoreFault::NoSpace,
        StoreFault::HalfFull,
        StoreFault::Broken,
        StoreFault::BreaksHalfway,
    ];

    pub(crate) fn is_full_disk(self) -> bool {
        matches!(self, StoreFault::NoSpace | StoreFault::HalfFull)
    }

    fn error(self) -> io::Error {
        if self.is_full_disk() {
            ErrorKind::StorageFull.into()
        } else {
            // EIO
            io::Error::from_raw_os_error(5)
        }
    }
}

/// What is done to the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StoreAct {
    Prepare,
    List,
    Remove,
    TruncatePartialRow,
    Create,
    Write,
    Truncate,
    Sync,
}

/// The state of the file system.
pub(crate) struct Disk {
    pub(crate) files: BTreeMap<PathBuf, Vec<u8>>,
    /// Paths in the order in which they were created, without those that were removed.
    pub(crate) created: Vec<PathBuf>,
    /// Paths that cannot be removed.
    pub(crate) stubborn: BTreeSet<PathBuf>,
    /// All that was done.
    pub(crate) acts: Vec<StoreAct>,
    /// The acts, by their index, of which the fault is made.
    pub(crate) fault: Option<(Range<usize>, StoreFault)>,
    pub(crate) free_bytes: u64,
    pub(crate) unix_s: u64,
    /// What the monotonic clock shows.
    pub(crate) monotonic: MonotonicNs,
}

impl Disk {
    /// Takes note of an act; gives the fault that it meets.
    fn act(&mut self, act: StoreAct) -> Option<StoreFault> {
        let index = self.acts.len();
        self.acts.push(act);
        let (range, fault) = self.fault.as_ref()?;
        let needs_room = matches!(act, StoreAct::Create | StoreAct::Write);
        let meets = range.contains(&index) && (needs_room || !fault.is_full_disk());
        meets.then_some(*fault)
    }

    fn check(&mut self, act: StoreAct) -> io::Result<()> {
        match self.act(act) {
            Some(fault) => Err(fault.error()),
            None => Ok(()),
        }
    }

    /// The content of the only file.
    pub(crate) fn only_file(&self) -> String {
        assert_eq!(self.files.len(), 1, "{:?}", self.files.keys());
        self.texts().remove(0)
    }

    /// The contents of the files in the order of their creation.
    pub(crate) fn texts(&self) -> Vec<String> {
        let text = |path| String::from_utf8(self.files[path].clone()).unwrap();
        self.created.iter().map(text).collect()
    }

    /// What all files take together, bytes.
    pub(crate) fn total_bytes(&self) -> u64 {
        self.files.values().map(|bytes| bytes.len() as u64).sum()
    }
}

/// A handle to the file system.
#[derive(Clone)]
pub(crate) struct MemoryStore(pub(crate) Rc<RefCell<Disk>>);

impl Default for MemoryStore {
    fn default() -> Self {
        MemoryStore(Rc::new(RefCell::new(Disk {
            files: BTreeMap::new(),
            created: Vec::new(),
            stubborn: BTreeSet::new(),
            acts: Vec::new(),
            fault: None,
            free_bytes: u64::MAX,
            unix_s: 1_156_797_566,
            monotonic: MonotonicNs::default(),
        })))
    }
}

impl Store for MemoryStore {
    type File = MemoryFile;

    fn clock(&self) -> ClockAnchor {
        let disk = self.0.borrow();
        ClockAnchor {
            unix_ns: disk.unix_s * 1_000_000_000,
            monotonic: disk.monotonic,
        }
    }

    fn prepare(&mut self, _directory: &Path) -> io::Result<()> {
        self.0.borrow_mut().check(StoreAct::Prepare)
    }

    fn free_bytes(&mut self, _directory: &Path) -> io::Result<u64> {
        Ok(self.0.borrow().free_bytes)
    }

    fn list(
        &mut self,
        directory: &Path,
        wanted: &dyn Fn(&str) -> bool,
    ) -> io::Result<Vec<(String, u64)>> {
        let mut disk = self.0.borrow_mut();
        disk.check(StoreAct::List)?;
        let in_directory = disk
            .files
            .iter()
            .filter(|(path, _)| path.parent() == Some(directory));
        let named = in_directory.map(|(path, bytes)| {
            let name = path.file_name().unwrap().to_str().unwrap();
            (name.to_owned(), bytes.len() as u64)
        });
        Ok(named.filter(|(name, _)| wanted(name)).collect())
    }

    fn remove(&mut self, file: &Path) -> io::Result<()> {
        let mut disk = self.0.borrow_mut();
        disk.check(StoreAct::Remove)?;
        if disk.stubborn.contains(file) {
            return Err(ErrorKind::PermissionDenied.into());
        }
        disk.files.remove(file);
        disk.created.retain(|created| created != file);
        Ok(())
    }

    fn truncate_partial_row(&mut self, file: &Path) -> io::Result<u64> {
        let mut disk = self.0.borrow_mut();
        disk.check(StoreAct::TruncatePartialRow)?;
        let bytes = disk.files.get_mut(file).unwrap();
        let before = bytes.len();
        match whole_rows(bytes) {
            0 => {}
            whole => bytes.truncate(whole),
        }
        Ok((before - bytes.len()) as u64)
    }

    fn create(
        &mut self,
        directory: &Path,
        stem: &str,
        kind: FileKind,
    ) -> io::Result<(PathBuf, MemoryFile)> {
        let mut disk = self.0.borrow_mut();
        disk.check(StoreAct::Create)?;
        let path = (1..)
            .map(|number| directory.join(file_name(stem, number, kind)))
            .find(|path| !disk.files.contains_key(path))
            .unwrap();
        disk.files.insert(path.clone(), Vec::new());
        disk.created.push(path.clone());
        let file = MemoryFile {
            store: self.clone(),
            path: path.clone(),
        };
        Ok((path, file))
    }
}

/// An open file.
pub(crate) struct MemoryFile {
    store: MemoryStore,
    path: PathBuf,
}

impl Write for MemoryFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut disk = self.store.0.borrow_mut();
        let fault = disk.act(StoreAct::Write);
        let taken = match fault {
            None => bytes.len(),
            // The next write fails and gives the reason.
            Some(StoreFault::HalfFull | StoreFault::BreaksHalfway) if bytes.len() > 1 => {
                bytes.len() / 2
            }
            Some(fault) => return Err(fault.error()),
        };
        let file = disk.files.get_mut(&self.path).unwrap();
        file.extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl LogFile for MemoryFile {
    fn truncate(&mut self, bytes: u64) -> io::Result<()> {
        let mut disk = self.store.0.borrow_mut();
        disk.check(StoreAct::Truncate)?;
        let file = disk.files.get_mut(&self.path).unwrap();
        file.truncate(usize::try_from(bytes).unwrap());
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        self.store.0.borrow_mut().check(StoreAct::Sync)
    }
}
