//! The limit on the total size of a log's files: the oldest are removed, and never a file of another log or program.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use super::file_name::{Series, Stamp};
use super::store::Store;

/// What a file takes at least, and in steps of what: a file system's block. So a limit on the size is one on the number
/// of files too, even of empty ones.
const BLOCK_BYTES: u64 = 4096;

/// Most files of a log, whatever their size, so that looking through them stays a matter of milliseconds. Logs of the
/// usual size reach their total long before; what reaches this is many starts of the process.
pub const MAX_FILES: usize = 10_000;

/// The old files of a log.
pub struct Retention {
    series: Series,
    /// Names of the files that this process created, numbered in that order, as far as they were still there when it
    /// last looked. They are younger than all others, whatever the clock showed when they were created: it may have
    /// been set back since.
    created: BTreeMap<String, u64>,
    next_number: u64,
}

/// What became of old files.
#[derive(Debug, Default)]
pub struct Removal {
    /// Files that were removed, with their lengths in bytes.
    pub removed: Vec<(PathBuf, u64)>,
    /// Why there is still too much.
    pub error: Option<io::Error>,
}

impl Retention {
    /// Retention of the files of `series`.
    pub fn new(series: Series) -> Retention {
        Retention {
            series,
            created: BTreeMap::new(),
            next_number: 0,
        }
    }

    /// The series that the files belong to.
    pub fn series(&self) -> &Series {
        &self.series
    }

    /// The newest file of the series in `directory`, if there is one and it can be found.
    pub fn newest(&self, store: &mut impl Store, directory: &Path) -> Option<PathBuf> {
        let own = |name: &str| self.series.stamp(name).is_some();
        let files = store.list(directory, &own).ok()?;
        let names = files.into_iter().map(|(name, _)| name);
        let newest = names.max_by_key(|name| self.age(name))?;
        Some(directory.join(newest))
    }

    /// Takes note that this process created `file`.
    pub fn created(&mut self, file: &Path) {
        if let Some(name) = file.file_name().and_then(|name| name.to_str()) {
            self.created.insert(name.to_owned(), self.next_number);
            self.next_number += 1;
        }
    }

    /// Removes the oldest files of the series in `directory` until one more of `next_bytes` makes no more than
    /// `max_total_bytes` and no more than [`MAX_FILES`].
    ///
    /// The newest file stays, even when it and the next one have no room together: it is the one that was just
    /// finished, and may be a little longer than a file should be. A file that cannot be removed is passed over and
    /// still counts.
    pub fn make_room(
        &mut self,
        store: &mut impl Store,
        directory: &Path,
        next_bytes: u64,
        max_total_bytes: u64,
    ) -> Removal {
        let mut removal = Removal::default();
        let own = |name: &str| self.series.stamp(name).is_some();
        let mut files = match store.list(directory, &own) {
            Ok(files) => files,
            Err(error) => {
                removal.error = Some(error);
                return removal;
            }
        };
        let names: BTreeSet<_> = files.iter().map(|(name, _)| name.as_str()).collect();
        self.created.retain(|name, _| names.contains(name.as_str()));
        files.sort_by_cached_key(|(name, _)| self.age(name));

        let mut count = files.len() + 1;
        let sizes = files.iter().map(|(_, bytes)| *bytes);
        let mut total: u128 = sizes.chain([next_bytes]).map(on_disk).sum();
        files.pop();
        for (name, bytes) in files {
            if total <= u128::from(max_total_bytes) && count <= MAX_FILES {
                break;
            }
            let file = directory.join(name);
            match store.remove(&file) {
                Ok(()) => {
                    total -= on_disk(bytes);
                    count -= 1;
                    removal.removed.push((file, bytes));
                }
                Err(error) => removal.error = Some(error),
            }
        }
        if total <= u128::from(max_total_bytes) && count <= MAX_FILES {
            removal.error = None;
        }
        removal
    }

    /// Orders files by age: those of earlier processes by their names, then this one's as they came.
    fn age(&self, name: &str) -> (Option<u64>, Option<Stamp>) {
        (self.created.get(name).copied(), self.series.stamp(name))
    }
}

/// The room that a file of `bytes` needs. Wide enough for the sum of any lengths that a directory may claim.
fn on_disk(bytes: u64) -> u128 {
    u128::from(bytes.div_ceil(BLOCK_BYTES).max(1)) * u128::from(BLOCK_BYTES)
}
