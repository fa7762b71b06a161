//! [`Site`]: what the processes of one measurement share, and nobody else: a domain of shared memory and a folder. Both
//! are removed afterwards, also when the processes were killed.

use std::cell::Cell;
use std::path::Path;

use anyhow::Result;
use ipc_types::Domain;
use rustix::thread::{sched_getaffinity, sched_setaffinity};
use tempfile::TempDir;

use crate::peers;
use crate::setting::Placement;

/// See the module's documentation.
pub struct Site {
    domain: Domain,
    folder: TempDir,
    placement: Placement,
    started: Cell<usize>,
}

impl Site {
    /// A new one, whose processes run where the scheduler puts them.
    pub fn new() -> Result<Site> {
        Site::placed(Placement::Free)
    }

    /// A new one, whose processes run where `placement` says.
    pub fn placed(placement: Placement) -> Result<Site> {
        Ok(Site {
            placement,
            started: Cell::new(0),
            domain: Domain::isolated(),
            // Short, because the name of a socket in it has at most 108 bytes.
            folder: tempfile::Builder::new()
                .prefix("ril-bench-")
                .tempdir_in("/tmp")?,
        })
    }

    /// The domain, which children have as their own.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Runs `start`, which starts the next process, on the processors of that process: it inherits them.
    pub fn start_next<T>(&self, start: impl FnOnce() -> T) -> Result<T> {
        let allowed = sched_getaffinity(None)?;
        let position = self.started.replace(self.started.get() + 1);
        let Some(processors) = self.placement.processors(position, &allowed) else {
            return Ok(start());
        };
        sched_setaffinity(None, &processors)?;
        let started = start();
        sched_setaffinity(None, &allowed)?;
        Ok(started)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for Site {
    fn drop(&mut self) {
        // Plain iceoryx2 leaves its folders in the root.
        for folder in ["nodes", "services"] {
            let _ = std::fs::remove_dir_all(self.domain.root().join(folder));
        }
        // What cannot be removed is told, and is no reason to lose the measurement.
        if let Err(error) = self.domain.remove_if_dead() {
            eprintln!("the domain of a measurement is left behind: {error}");
        }
        let _ = std::fs::remove_file(peers::segment(self.path()));
        for path in self.domain.residue() {
            eprintln!("left behind: {}", path.display());
        }
    }
}
