//! [`Step`]: what traced programs did with their files, as `preload/trace.c` of `ril-tests` has written it down.

use std::path::PathBuf;

/// Something that was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// A new, empty file has this name.
    Created {
        /// Its name.
        path: PathBuf,
        /// Its number, which another one has when it is gone.
        inode: u64,
    },
    /// Bytes went to a place of a file.
    Wrote {
        /// The file.
        inode: u64,
        /// Offset of the first one.
        at: u64,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// A file has another length.
    Truncated {
        /// The file.
        inode: u64,
        /// Its length in bytes.
        len: u64,
    },
    /// What a file has was forced onto the disk.
    Synced {
        /// The file.
        inode: u64,
    },
    /// The names in a folder were.
    SyncedFolder,
    /// A file has another name.
    Renamed {
        /// The name that is gone.
        from: PathBuf,
        /// The one that it has.
        to: PathBuf,
    },
    /// A file has a further name.
    Linked {
        /// One that it has.
        from: PathBuf,
        /// The further one.
        to: PathBuf,
    },
    /// A name is gone.
    Unlinked {
        /// Which.
        path: PathBuf,
    },
}

/// Length of the head of a step: four numbers of 32 bits and three of 64.
const HEAD_LEN: usize = 40;

/// The steps of a trace.
///
/// # Errors
///
/// Where it is no trace.
pub fn read(mut bytes: &[u8]) -> Result<Vec<Step>, String> {
    let mut steps = Vec::new();
    while !bytes.is_empty() {
        let step = take_step(&mut bytes);
        steps.push(step.ok_or_else(|| format!("the trace ends in step {}", steps.len()))?);
    }
    Ok(steps)
}

fn take_step(bytes: &mut &[u8]) -> Option<Step> {
    let head = bytes.split_off(..HEAD_LEN)?;
    let word = |at: usize| Some(u32::from_ne_bytes(head.get(at..at + 4)?.try_into().ok()?));
    let long = |at: usize| Some(u64::from_ne_bytes(head.get(at..at + 8)?.try_into().ok()?));
    let kind = word(0)?;
    let mut path = |at| {
        let path = bytes.split_off(..word(at)? as usize)?;
        Some(PathBuf::from(str::from_utf8(path).ok()?))
    };
    let (path, to) = (path(4)?, path(8)?);
    let (inode, at, len) = (long(16)?, long(24)?, long(32)?);
    Some(match kind {
        1 => Step::Created { path, inode },
        2 => Step::Wrote {
            inode,
            at,
            bytes: bytes.split_off(..usize::try_from(len).ok()?)?.to_vec(),
        },
        3 => Step::Truncated { inode, len: at },
        4 => Step::Synced { inode },
        5 => Step::SyncedFolder,
        6 => Step::Renamed { from: path, to },
        7 => Step::Linked { from: path, to },
        8 => Step::Unlinked { path },
        _ => return None,
    })
}
