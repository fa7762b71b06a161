//! [`Disk`]: what a power cut can leave of files. Until a file was forced onto the disk, each of its pages may be there
//! as it was after any write to it, whatever became of the others, and the file may have its old length or its new one;
//! what is between is zeros. Names come onto the disk in the order in which they were given, as with a journal of the
//! file system, and no later than their folder is forced there.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use fastrand::Rng;

use super::trace::Step;

/// What comes onto the disk as a whole, unless it is torn.
const PAGE_LEN: usize = 4096;

/// What does not tear.
const SECTOR_LEN: usize = 512;

/// How many states of chance each step has.
const BY_CHANCE: u64 = 4;

/// A file that has a number as long as it lives, whatever its names are.
#[derive(Clone, Debug, Default)]
pub struct DiskFile {
    /// What was forced onto the disk.
    pub durable: Vec<u8>,
    /// What programs see.
    current: Vec<u8>,
    /// Pages as they were after each write since the last sync, by their number.
    pages: BTreeMap<usize, Vec<Vec<u8>>>,
    /// These writes in their order: page, and which of its versions.
    writes: Vec<(usize, usize)>,
    /// How often it was forced onto the disk.
    pub syncs: u64,
}

/// What became of a name.
#[derive(Clone, Debug)]
enum NameChange {
    Given(PathBuf, usize),
    Moved(PathBuf, PathBuf),
    Taken(PathBuf),
}

/// A version of a file that is replaced as a whole.
#[derive(Clone, Debug)]
struct Version {
    /// Which change of a name put it in its place; 0 before the first one.
    since: usize,
    /// All of it.
    bytes: Vec<u8>,
}

/// What was written to files and names, and from it what a power cut can leave.
#[derive(Debug, Default)]
pub struct Disk {
    files: Vec<DiskFile>,
    by_inode: HashMap<u64, usize>,
    names: Vec<NameChange>,
    /// How many of them are on the disk.
    durable_names: usize,
    /// Versions of files that are replaced as a whole.
    versions: BTreeMap<PathBuf, Vec<Version>>,
}

/// What the disk has done of the pages that were written since the last sync.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// Nothing.
    None,
    /// The first so many writes.
    First(usize),
    /// These, of the last one only so many sectors.
    Torn(usize, usize),
    /// Only this one.
    Only(usize),
    /// All but this one.
    Without(usize),
    /// Some, by chance.
    Chance(u64),
}

/// A state in which a power cut leaves a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    reached: Reached,
    /// Whether it has the new length.
    is_long: bool,
    /// How many changes of names are on the disk.
    names: usize,
}

impl Disk {
    /// With the files that are there before the trace: they are on the disk.
    pub fn with(files: impl IntoIterator<Item = (PathBuf, u64, Vec<u8>)>) -> Disk {
        let mut disk = Disk::default();
        for (path, inode, bytes) in files {
            let first = Version {
                since: 0,
                bytes: bytes.clone(),
            };
            disk.versions.insert(path.clone(), vec![first]);
            disk.create(path, inode);
            let file = disk.files.last_mut().expect("it was created");
            (file.durable, file.current) = (bytes.clone(), bytes);
        }
        disk.durable_names = disk.names.len();
        disk
    }

    /// Does a step; which file it was about, or which files may be others by it.
    pub fn perform(&mut self, step: &Step) -> Option<usize> {
        let file = |disk: &Disk, inode: &u64| disk.by_inode.get(inode).copied();
        match step {
            Step::Created { path, inode } => {
                self.create(path.clone(), *inode);
                Some(self.files.len() - 1)
            }
            Step::Wrote { inode, at, bytes } => {
                let index = file(self, inode)?;
                self.files[index].write(*at as usize, bytes);
                Some(index)
            }
            Step::Truncated { inode, len } => {
                let index = file(self, inode)?;
                self.files[index].current.resize(*len as usize, 0);
                Some(index)
            }
            Step::Synced { inode } => {
                let index = file(self, inode)?;
                self.files[index].sync();
                Some(index)
            }
            Step::SyncedFolder => {
                self.durable_names = self.names.len();
                None
            }
            Step::Renamed { from, to } => {
                self.names.push(NameChange::Moved(from.clone(), to.clone()));
                self.replaced(to)
            }
            Step::Linked { from, to } => {
                let index = *self.tree(self.names.len()).get(from)?;
                self.names.push(NameChange::Given(to.clone(), index));
                self.replaced(to)
            }
            Step::Unlinked { path } => {
                let index = self.tree(self.names.len()).get(path).copied();
                self.names.push(NameChange::Taken(path.clone()));
                index.filter(|index| self.name(*index).is_some())
            }
        }
    }

    /// A file.
    pub fn file(&self, index: usize) -> &DiskFile {
        &self.files[index]
    }

    /// The name that a file has for programs; of several, that of what it replaces.
    pub fn name(&self, index: usize) -> Option<PathBuf> {
        let tree = self.tree(self.names.len());
        let names = tree.into_iter().filter(|(_, found)| *found == index);
        let names = names.map(|(path, _)| path);
        names.max_by_key(|path| self.versions.contains_key(path))
    }

    /// Whether a file is one that is replaced as a whole.
    pub fn is_replaced(&self, path: &Path) -> bool {
        self.versions.contains_key(path)
    }

    /// Whether this may be in the place of a file that is replaced as a whole: the version that is certainly on the
    /// disk, or a later one.
    ///
    /// # Errors
    ///
    /// What is there, and how many versions it could be.
    pub fn judge_replaced(&self, path: &Path, content: Option<&[u8]>) -> Result<(), String> {
        let versions = self.versions.get(path).map_or(&[][..], Vec::as_slice);
        let is_durable = |version: &Version| version.since <= self.durable_names;
        let durable = versions.iter().rposition(is_durable);
        let possible = &versions[durable.unwrap_or(0)..];
        let is_possible = match content {
            None => durable.is_none(),
            Some(bytes) => possible.iter().any(|version| version.bytes == bytes),
        };
        let wrong = || {
            let len = content.map_or("nothing".to_owned(), |bytes| {
                format!("{} bytes", bytes.len())
            });
            format!("{len}, which is none of {} versions", possible.len())
        };
        is_possible.then_some(()).ok_or_else(wrong)
    }

    /// The states of a file after the last step, with so many by chance.
    pub fn states(&self, index: usize) -> Vec<State> {
        let file = &self.files[index];
        let writes = file.writes.len();
        let mut reached = vec![Reached::None, Reached::First(writes)];
        for write in 0..writes {
            reached.extend([
                Reached::Only(write),
                Reached::Without(write),
                Reached::First(write),
            ]);
            reached.extend([1, 4, 7].map(|sectors| Reached::Torn(write, sectors)));
        }
        if writes > 1 {
            reached.extend((0..BY_CHANCE).map(Reached::Chance));
        }
        let mut states = Vec::new();
        for names in self.durable_names..=self.names.len() {
            for reached in &reached {
                for is_long in [false, true] {
                    states.push(State {
                        reached: *reached,
                        is_long,
                        names,
                    });
                }
            }
        }
        states
    }

    /// The bytes at `path` in a state of the file `index`, all of whose names it has; `None` if nothing is there.
    pub fn content(&self, path: &Path, index: usize, state: State) -> Option<Vec<u8>> {
        let found = *self.tree(state.names).get(path)?;
        Some(match found == index {
            true => self.files[index].content(state),
            // The name belonged to another file, which was forced onto the disk.
            false => self.files[found].durable.clone(),
        })
    }

    fn create(&mut self, path: PathBuf, inode: u64) {
        self.by_inode.insert(inode, self.files.len());
        self.names.push(NameChange::Given(path, self.files.len()));
        self.files.push(DiskFile::default());
    }

    /// A name was given to another file: that is a version of what has the name.
    fn replaced(&mut self, path: &Path) -> Option<usize> {
        let index = *self.tree(self.names.len()).get(path)?;
        let version = Version {
            since: self.names.len(),
            bytes: self.files[index].current.clone(),
        };
        let versions = self.versions.entry(path.to_owned());
        versions.or_default().push(version);
        Some(index)
    }

    /// Which files have which names after so many changes.
    fn tree(&self, changes: usize) -> BTreeMap<PathBuf, usize> {
        let mut tree = BTreeMap::new();
        for change in &self.names[..changes] {
            match change {
                NameChange::Given(path, index) => drop(tree.insert(path.clone(), *index)),
                NameChange::Moved(from, to) => {
                    if let Some(index) = tree.remove(from) {
                        tree.insert(to.clone(), index);
                    }
                }
                NameChange::Taken(path) => drop(tree.remove(path)),
            }
        }
        tree
    }
}

impl DiskFile {
    fn write(&mut self, at: usize, bytes: &[u8]) {
        let end = at + bytes.len();
        self.current.resize(self.current.len().max(end), 0);
        self.current[at..end].copy_from_slice(bytes);
        for page in at / PAGE_LEN..end.div_ceil(PAGE_LEN) {
            let from = page * PAGE_LEN;
            let until = self.current.len().min(from + PAGE_LEN);
            let versions = self.pages.entry(page).or_default();
            versions.push(self.current[from..until].to_vec());
            self.writes.push((page, versions.len()));
        }
    }

    fn sync(&mut self) {
        self.durable.clone_from(&self.current);
        self.pages.clear();
        self.writes.clear();
        self.syncs += 1;
    }

    fn content(&self, state: State) -> Vec<u8> {
        // Of each page, how many of its versions the disk has seen.
        let mut seen: BTreeMap<usize, usize> = BTreeMap::new();
        let mut torn = None;
        let latest = |writes: &[(usize, usize)]| writes.iter().copied().collect::<BTreeMap<_, _>>();
        match state.reached {
            Reached::None => {}
            Reached::First(count) => seen = latest(&self.writes[..count]),
            Reached::Torn(last, sectors) => {
                seen = latest(&self.writes[..last]);
                torn = Some((self.writes[last], sectors));
            }
            Reached::Only(write) => seen = latest(&self.writes[write..=write]),
            Reached::Without(write) => {
                seen = latest(&self.writes);
                let (page, version) = self.writes[write];
                seen.insert(page, version - 1);
            }
            Reached::Chance(seed) => {
                let mut chance = Rng::with_seed(seed << 32 | self.writes.len() as u64);
                for (page, versions) in &self.pages {
                    seen.insert(*page, chance.usize(..=versions.len()));
                }
            }
        }
        let len = match state.is_long {
            true => self.current.len(),
            false => self.durable.len(),
        };
        let mut bytes = self.durable.clone();
        bytes.resize(len, 0);
        let mut put = |page: usize, content: &[u8]| {
            let from = (page * PAGE_LEN).min(len);
            let until = (from + content.len()).min(len);
            bytes[from..until].copy_from_slice(&content[..until - from]);
        };
        for (page, version) in seen {
            if let Some(version) = version.checked_sub(1) {
                put(page, &self.pages[&page][version]);
            }
        }
        if let Some(((page, version), sectors)) = torn {
            let content = &self.pages[&page][version - 1];
            put(page, &content[..content.len().min(sectors * SECTOR_LEN)]);
        }
        bytes
    }
}
