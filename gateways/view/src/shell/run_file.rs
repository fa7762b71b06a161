//! [`RunFile`]: what a running view leaves for `ril view` and `ril doctor` of the same user: its process, and the token
//! with which a page may order.
//!
//! The server holds a lock on the file as long as it lives, which the kernel drops with it. So a file without a lock is
//! one of a process that was killed, and the next server writes over it. Only this user can read it.

use std::fs::{DirBuilder, File, OpenOptions};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use runtime::durable;
use runtime::exit::Failure;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use serde::{Deserialize, Serialize};

/// More than any of these files has.
const MAX_BYTES: u64 = 64 << 10;

/// What is in the file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunEntry {
    /// The server's process.
    pub pid: u32,
    /// Its port on loopback.
    pub port: u16,
    /// The folder of the domain that it shows.
    pub domain: PathBuf,
    /// The file that it shows; `None` if it shows live robots.
    pub recording: Option<PathBuf>,
    /// The token of a page that may order.
    pub token: String,
}

impl RunEntry {
    /// The address of the page, without the token.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// The address with the token, which is in no request: browsers keep what is behind `#` to themselves.
    pub fn address_with_token(&self) -> String {
        format!("{}#token={}", self.address(), self.token)
    }
}

/// The file of a server that lives in this process; it is removed at the end.
pub struct RunFile {
    path: PathBuf,
    file: File,
}

impl RunFile {
    /// Takes the file of this port, which says nothing yet.
    ///
    /// # Errors
    ///
    /// Code 1 when another view of this user has it, or the folder cannot be used.
    pub fn take(port: u16) -> Result<RunFile, Failure> {
        loop {
            let (file, path) = open_in(&place(), &file_name(port), |path| {
                private(true).read(true).open(path)
            })?;
            match flock(&file, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => {}
                Err(Errno::WOULDBLOCK) => return Err(taken(port, read(&file).ok().as_ref())),
                Err(error) => return Err(unusable(&path, &error.into())),
            }
            // A server that just ended may have removed it between opening and locking.
            if is_at(&file, &path) {
                return Ok(RunFile { path, file });
            }
        }
    }

    /// Says what runs.
    pub fn write(&mut self, running: &RunEntry) -> io::Result<()> {
        let text = serde_json::to_vec(running)?;
        self.file.set_len(0)?;
        self.file.rewind()?;
        self.file.write_all(&text)
    }
}

impl Drop for RunFile {
    fn drop(&mut self) {
        // Before the lock is released, so that the next server's files are not removed.
        for path in [self.path.with_extension("html"), self.path.clone()] {
            if let Err(error) = std::fs::remove_file(&path) {
                tracing::debug!(%error, path = %path.display(), "the file cannot be removed");
            }
        }
        // It stays while another view of this user has a file in it, or one in the background a log.
        let _ = std::fs::remove_dir(durable::folder_of(&self.path));
    }
}

/// The view of this user that runs on `port`; `None` if there is none, or it is not ready yet.
pub fn find(port: u16) -> Result<Option<RunEntry>, Failure> {
    if !place().exists() {
        return Ok(None);
    }
    let path = folder(&place())?.join(file_name(port));
    let file = match private(false).read(true).open(&path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(unusable(&path, &error)),
    };
    match flock(&file, FlockOperation::NonBlockingLockShared) {
        Err(Errno::WOULDBLOCK) => Ok(read(&file).ok()),
        _ => Ok(None),
    }
}

/// Where a view of this port that runs in the background logs.
pub fn log_file(port: u16) -> Result<(File, PathBuf), Failure> {
    let name = format!("view-{port}.log");
    open_in(&place(), &name, |path| {
        private(true).truncate(true).open(path)
    })
}

/// Writes the page that leads a browser to the address with the token. A command line is no place for the token: other
/// users can read it.
pub fn write_opener(running: &RunEntry) -> Result<PathBuf, Failure> {
    let address = running.address_with_token();
    let page = format!(
        "<!DOCTYPE html><meta charset=\"utf-8\"><title>ril view</title>\n\
         <meta http-equiv=\"refresh\" content=\"0; url={address}\">\n\
         <a href=\"{address}\">The page of ril view</a>\n"
    );
    let name = format!("view-{}.html", running.port);
    let (mut file, path) = open_in(&place(), &name, |path| {
        private(true).truncate(true).open(path)
    })?;
    file.write_all(page.as_bytes())
        .map_err(|error| unusable(&path, &error))?;
    Ok(path)
}

fn file_name(port: u16) -> String {
    format!("view-{port}.json")
}

/// Opens a file in the user's folder `place`, and says where it is. The last view of this user that ends removes the
/// folder: when that comes between, both are made anew.
fn open_in(
    place: &Path,
    name: &str,
    mut open: impl FnMut(&Path) -> io::Result<File>,
) -> Result<(File, PathBuf), Failure> {
    loop {
        let path = folder(place)?.join(name);
        match open(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            opened => {
                return opened
                    .map(|file| (file, path.clone()))
                    .map_err(|error| unusable(&path, &error));
            }
        }
    }
}

/// Opens a file of this user alone, to be written.
fn private(creates: bool) -> OpenOptions {
    let mut options = OpenOptions::new();
    let flags = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
    options
        .write(true)
        .create(creates)
        .mode(0o600)
        .custom_flags(flags);
    options
}

fn read(mut file: &File) -> io::Result<RunEntry> {
    let mut text = Vec::new();
    file.rewind()?;
    file.take(MAX_BYTES).read_to_end(&mut text)?;
    Ok(serde_json::from_slice(&text)?)
}

fn is_at(file: &File, path: &Path) -> bool {
    let (Ok(open), Ok(there)) = (file.metadata(), std::fs::symlink_metadata(path)) else {
        return false;
    };
    (open.dev(), open.ino()) == (there.dev(), there.ino())
}

/// Where this user's folder for files of running programs is.
fn place() -> PathBuf {
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|path| !path.is_empty());
    match runtime {
        Some(runtime) => PathBuf::from(runtime).join("ril"),
        None => PathBuf::from(format!(
            "/dev/shm/ril-{}",
            rustix::process::getuid().as_raw()
        )),
    }
}

/// Gives the folder `place`, which is made if there is none, and which no other user can enter.
fn folder(place: &Path) -> Result<&Path, Failure> {
    let uid = rustix::process::getuid().as_raw();
    let there = loop {
        match DirBuilder::new().mode(0o700).create(place) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                return Err(unusable(place, &error));
            }
            _ => {}
        }
        match std::fs::symlink_metadata(place) {
            // The last server has just removed it.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            there => break there.map_err(|error| unusable(place, &error))?,
        }
    };
    if !there.is_dir() || there.uid() != uid || there.mode() & 0o077 != 0 {
        let text = format!(
            "{} is no folder of this user alone, and the token must not lie where others read it",
            place.display()
        );
        return Err(Failure::internal(text).with_next_step("remove it, or set XDG_RUNTIME_DIR"));
    }
    Ok(place)
}

fn unusable(path: &Path, error: &io::Error) -> Failure {
    Failure::internal(format!("{} cannot be used: {error}", path.display()))
}

/// Why a server cannot start: another view of this user runs.
fn taken(port: u16, running: Option<&RunEntry>) -> Failure {
    let who = running.map_or_else(String::new, |running| {
        format!(
            " (process {} of domain {})",
            running.pid,
            running.domain.display()
        )
    });
    Failure::internal(format!(
        "a view of this user runs on port {port} already{who}"
    ))
    .with_next_step(format!(
        "`ril view --port {port}` opens its page; another port runs another one: `--port {}`",
        port.saturating_add(1)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_opened_although_the_last_view_has_just_removed_the_folder() {
        let parent = tempfile::tempdir().unwrap();
        let place = parent.path().join("ril");
        let mut is_removed = false;
        let opened = open_in(&place, "view-1.log", |path| {
            if !is_removed {
                std::fs::remove_dir(&place)?;
                is_removed = true;
            }
            private(true).truncate(true).open(path)
        });
        let (_, path) = opened.unwrap();
        assert!(is_removed && path.exists());
    }
}
