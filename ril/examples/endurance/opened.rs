//! What readers that others wrote find in the files of killed recorders, beside what our own reader finds.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use ril_tests::languages::target_folder;

use crate::readers::Reader;
use crate::sums::Sums;

/// A file as it was at the kill, and what our own reader found in it.
#[derive(Clone, Debug)]
pub struct Killed {
    /// Where it lies.
    pub path: PathBuf,
    /// What our own reader found.
    pub sums: Sums,
}

/// What one reader found in all files.
#[derive(Clone, Debug)]
pub struct Opened {
    reader: Reader,
    /// Files of which it has no complaint.
    opened: u64,
    /// Messages in all files.
    messages: u64,
    /// Files in which it found exactly what our own reader found: each message of each topic, with its time and its data.
    agreeing: u64,
    /// Which files it refused, or found other messages in.
    faults: Vec<String>,
}

impl Opened {
    /// Nothing yet, for each of `readers` that others wrote and that opens unfinished files.
    pub fn by(readers: &[Reader]) -> Vec<Opened> {
        let readers = readers.iter();
        let readers = readers.filter(|reader| reader.is_of_others() && reader.reads_unfinished());
        let opened = readers.map(|reader| Opened {
            reader: reader.clone(),
            opened: 0,
            messages: 0,
            agreeing: 0,
            faults: Vec::new(),
        });
        opened.collect()
    }

    /// Whether the reader opened every file, and agrees with ours in each.
    pub fn is_whole(&self) -> bool {
        self.faults.is_empty()
    }

    /// Opens all `files` with one process of the reader. A file with a fault is copied, and the fault names the copy.
    pub fn open(&mut self, files: &[Killed]) {
        let paths: Vec<&Path> = files.iter().map(|file| file.path.as_path()).collect();
        for (file, found) in files.iter().zip(self.reader.sums(&paths)) {
            self.messages += found.messages();
            let agrees = found.topics == file.sums.topics;
            self.agreeing += u64::from(agrees);
            self.opened += u64::from(found.error.is_none());
            let complaint = match &found.error {
                None if agrees => continue,
                None => "it found other messages",
                Some(error) => error,
            };
            let copy = keep(&file.path);
            let (reader, copy) = (&self.reader, copy.display());
            self.faults.push(format!("{copy}: {reader}: {complaint}"));
        }
    }
}

/// Copies a file to where nobody removes it.
fn keep(file: &Path) -> PathBuf {
    let folder = target_folder().join("tmp/refused-recordings");
    fs::create_dir_all(&folder).expect("a folder for the files");
    let copy = folder.join(file.file_name().expect("a file"));
    fs::copy(file, &copy).expect("a copy");
    copy
}

impl fmt::Display for Opened {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "| {} | {} | {} | {} |",
            self.reader, self.opened, self.messages, self.agreeing
        )?;
        for fault in &self.faults {
            write!(f, "\n{fault}")?;
        }
        Ok(())
    }
}
