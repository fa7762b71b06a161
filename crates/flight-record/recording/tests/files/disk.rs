//! A disk that is a value: files in memory, failures on demand, and all that was done to it, so that a test can cut the
//! power anywhere.

use recording::{DiskError, DiskErrorKind, FileAction, Part};

/// Files by index, and what was done.
#[derive(Clone, Debug, Default)]
pub struct Disk {
    pub files: Vec<Vec<u8>>,
    /// Whether each file was closed as a whole.
    pub is_whole: Vec<Option<bool>>,
    /// What the next actions answer; without it they work.
    pub failure: Option<DiskErrorKind>,
}

impl Disk {
    /// Performs an action, or fails before it has done anything.
    pub fn perform(&mut self, action: &FileAction) -> Result<(), DiskError> {
        if let Some(kind) = self.failure {
            let text = "the simulated disk fails".to_owned();
            return Err(DiskError { kind, text });
        }
        self.apply(action);
        Ok(())
    }

    fn apply(&mut self, action: &FileAction) {
        match action {
            FileAction::Open { index } => {
                assert_eq!(*index as usize, self.files.len());
                self.files.push(Vec::new());
                self.is_whole.push(None);
            }
            FileAction::Write { parts } => parts.iter().for_each(|part| self.write(part)),
            FileAction::Truncate { len } => self.last().truncate(*len as usize),
            FileAction::Sync => {}
            FileAction::Close { is_whole, .. } => {
                let last = self.is_whole.last_mut().expect("an open file");
                assert_eq!(last.replace(*is_whole), None, "a file is closed once");
            }
        }
    }

    /// Performs the first `bytes` of a write: the power is cut there.
    pub fn perform_cut(&mut self, parts: &[Part], mut bytes: usize) {
        for part in parts {
            let len = bytes.min(part.bytes.len());
            bytes -= len;
            if len > 0 {
                let bytes = part.bytes[..len].to_vec();
                self.write(&Part { at: part.at, bytes });
            }
        }
    }

    fn write(&mut self, part: &Part) {
        assert!(!part.bytes.is_empty());
        let at = part.at as usize;
        let file = self.last();
        let end = at + part.bytes.len();
        file.resize(file.len().max(end), 0);
        file[at..end].copy_from_slice(&part.bytes);
    }

    fn last(&mut self) -> &mut Vec<u8> {
        self.files.last_mut().expect("an open file")
    }
}
