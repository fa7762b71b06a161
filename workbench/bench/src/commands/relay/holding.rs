//! [`Holding`]: memory and files of a process.

use std::fs;

use anyhow::{Context, Result};

use crate::machine::field;

/// What a process holds at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Holding {
    /// Memory that is resident, shared pages included, KiB.
    pub resident_kib: u64,
    /// The same with shared pages divided by the processes that share them, KiB.
    pub proportional_kib: u64,
    /// Open files.
    pub files: u64,
}

impl Holding {
    /// What process `id` holds now.
    ///
    /// # Errors
    /// There is no such process, or it is another user's.
    pub fn of(id: u32) -> Result<Holding> {
        let memory = fs::read_to_string(format!("/proc/{id}/smaps_rollup"))?;
        let kib = |key| -> Result<u64> {
            let value = field(&memory, key).context(key)?;
            value.trim_end_matches(" kB").parse().context(key)
        };
        Ok(Holding {
            resident_kib: kib("Rss")?,
            proportional_kib: kib("Pss")?,
            files: fs::read_dir(format!("/proc/{id}/fd"))?.count() as u64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_holds_memory_and_files() {
        let holding = Holding::of(std::process::id()).unwrap();
        assert!(holding.resident_kib >= holding.proportional_kib && holding.files > 0);
        assert!(Holding::of(0).is_err());
    }
}
