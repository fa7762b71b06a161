//! The calls to the file system by which processes come, go, and delete what dead ones left. Each is one step of what
//! [`robot_folder`](crate::robot_folder), [`generation`](crate::generation) and [`provider`](crate::provider) do
//! together with other processes.
//!
//! Tests put a model in their place, on their own thread, and explore every order of the steps of several processes.

use std::fs::{self, DirBuilder, DirEntry, File, Metadata, OpenOptions};
use std::io::{self, Read};
use std::ops::Deref;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::{
    AtFlags, CWD, FlockOperation, Mode, OFlags, RenameFlags, openat, renameat_with, unlinkat,
};
use rustix::io::Errno;

use crate::files;
use crate::forked::Maker;
use crate::random;

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::model;

/// An open file or folder that may be locked. Dropping it gives the lock back, even while a child process has a copy of
/// the descriptor: one that was forked and lives on, or one that has not yet called `exec`.
#[derive(Debug)]
pub(crate) struct LockFile {
    file: File,
    maker: Maker,
    /// A file of a model, which may have been taken out.
    #[cfg(test)]
    modelled: Option<Option<model::Handle>>,
}

impl LockFile {
    pub(crate) fn new(file: File) -> LockFile {
        LockFile {
            file,
            maker: Maker::this_process(),
            #[cfg(test)]
            modelled: None,
        }
    }

    /// A file of a model; the real one is none.
    #[cfg(test)]
    pub(crate) fn of_model(handle: model::Handle) -> LockFile {
        let mut file = LockFile::new(File::open("/dev/null").unwrap());
        file.modelled = Some(Some(handle));
        file
    }

    #[cfg(test)]
    pub(crate) fn modelled(&self) -> model::Handle {
        self.modelled.flatten().expect("a file of the model")
    }

    /// Takes the model's file out, which stays open.
    #[cfg(test)]
    pub(crate) fn keep(&mut self) -> model::Handle {
        let handle = self.modelled();
        self.modelled = Some(None);
        handle
    }

    #[cfg(test)]
    pub(crate) fn is_modelled(&self) -> bool {
        self.modelled.is_some()
    }

    /// Whether this process has opened it, not one that it was forked from.
    pub(crate) fn is_own(&self) -> bool {
        #[cfg(test)]
        if self.modelled == Some(None) {
            return false;
        }
        self.maker.check().is_ok()
    }

    /// By what a folder or file is known that has any name.
    pub(crate) fn inode(&self) -> io::Result<u64> {
        #[cfg(test)]
        if let Some(Some(handle)) = self.modelled {
            return Ok(handle.inode.into());
        }
        self.file.metadata().map(|metadata| metadata.ino())
    }
}

impl Deref for LockFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.file
    }
}

impl Drop for LockFile {
    fn drop(&mut self) {
        #[cfg(test)]
        if let Some(Some(handle)) = self.modelled {
            return model::close(handle);
        }
        if self.is_own() {
            // Closing gives the lock back in any case, if no other process has a copy.
            let _ = rustix::fs::flock(&self.file, FlockOperation::NonBlockingUnlock);
        }
    }
}

/// On the thread of a test with a model, the call goes to that.
macro_rules! or_model {
    ($call:expr, $take:ident) => {
        #[cfg(test)]
        {
            use model::Call;
            if let Some(answer) = model::ask(|| $call) {
                return answer.$take();
            }
        }
    };
}

/// Makes a folder that only this user may enter.
pub(crate) fn create_folder(path: &Path) -> io::Result<()> {
    or_model!(Call::MakeFolder(model::text(path)), done);
    files::while_no_port_opens(|| DirBuilder::new().mode(0o700).create(path))
}

/// Opens a folder, and nothing else.
pub(crate) fn open_folder(path: &Path) -> io::Result<LockFile> {
    or_model!(Call::Open(model::text(path)), open);
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
        .map(LockFile::new)
}

/// Opens a file without making it, and without waiting for a pipe that stands in its place.
pub(crate) fn open_to_look(path: &Path) -> io::Result<LockFile> {
    or_model!(Call::Open(model::text(path)), open);
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
        .map(LockFile::new)
}

/// Opens a file of a folder.
pub(crate) fn open_in(folder: &LockFile, name: &str) -> io::Result<LockFile> {
    open_or_make_in(folder, name, OFlags::empty())
}

/// Opens a file of a folder, and makes it if need be.
pub(crate) fn make_in(folder: &LockFile, name: &str) -> io::Result<LockFile> {
    files::while_no_port_opens(|| open_or_make_in(folder, name, OFlags::CREATE))
}

fn open_or_make_in(folder: &LockFile, name: &str, flags: OFlags) -> io::Result<LockFile> {
    or_model!(
        Call::OpenIn(folder.modelled(), name.into(), flags == OFlags::CREATE),
        open
    );
    let flags = flags | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let file = openat(&**folder, name, flags, Mode::RUSR | Mode::WUSR)?;
    Ok(LockFile::new(File::from(file)))
}

/// Locks without waiting.
pub(crate) fn flock(file: &LockFile, operation: FlockOperation) -> io::Result<()> {
    or_model!(Call::Flock(file.modelled(), operation), done);
    loop {
        match rustix::fs::flock(&**file, operation) {
            Err(Errno::INTR) => {}
            result => return Ok(result?),
        }
    }
}

/// Whether `file` is still the one at `path`, not one that was removed or renamed meanwhile.
pub(crate) fn is_at(file: &LockFile, path: &Path) -> bool {
    or_model!(Call::IsAt(file.modelled(), model::text(path)), yes);
    is_one(file.metadata(), fs::symlink_metadata(path))
}

/// Renames, and replaces nothing.
pub(crate) fn rename(from: &Path, to: &Path) -> Result<(), Errno> {
    or_model!(Call::Rename(model::text(from), model::text(to)), renamed);
    renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE)
}

/// Writes a file anew, and gives it its name only then. `draft` is its name until then.
pub(crate) fn replace(path: &Path, draft: &Path, text: &str) -> io::Result<()> {
    or_model!(Call::Replace(model::text(path), text.into()), done);
    files::while_no_port_opens(|| fs::write(draft, text)).and_then(|()| fs::rename(draft, path))
}

/// The first bytes of a file as a text.
pub(crate) fn read(file: &LockFile, limit: u64) -> Option<String> {
    or_model!(Call::Read(file.modelled()), text);
    let mut text = String::new();
    (&**file).take(limit).read_to_string(&mut text).ok()?;
    Some(text)
}

/// What is in a folder.
pub(crate) struct Found {
    /// `None` if it is no text.
    pub(crate) name: Option<String>,
    pub(crate) is_folder: bool,
}

/// What is in a folder; nothing if it cannot be read, because it is gone for example.
pub(crate) fn list(folder: &Path) -> Vec<Found> {
    or_model!(Call::List(model::text(folder)), found);
    entries(folder)
        .map(|entry| Found {
            name: entry.file_name().into_string().ok(),
            is_folder: entry.file_type().is_ok_and(|kind| kind.is_dir()),
        })
        .collect()
}

/// Removes a file.
pub(crate) fn remove_file(path: &Path) -> io::Result<()> {
    or_model!(Call::RemoveFile(model::text(path)), done);
    fs::remove_file(path)
}

/// Removes a file of a folder.
pub(crate) fn remove_in(folder: &LockFile, name: &str) -> io::Result<()> {
    or_model!(Call::RemoveIn(folder.modelled(), name.into()), done);
    Ok(unlinkat(&**folder, name, AtFlags::empty())?)
}

/// Removes a folder that is empty.
pub(crate) fn remove_folder(path: &Path) -> io::Result<()> {
    or_model!(Call::RemoveFolder(model::text(path)), done);
    fs::remove_dir(path)
}

/// Removes a folder with all that is in it.
pub(crate) fn remove_all(path: &Path) -> io::Result<()> {
    #[cfg(test)]
    if model::is_there() {
        return model::remove_all(path);
    }
    fs::remove_dir_all(path)
}

/// A random name that no other process chooses.
pub(crate) fn fresh_name(len: usize) -> String {
    #[cfg(test)]
    if let Some(name) = model::fresh_name(len) {
        return name;
    }
    random::name(len)
}

/// Lets others do something.
pub(crate) fn pause(length: Duration) {
    #[cfg(test)]
    if model::is_there() {
        return;
    }
    std::thread::sleep(length);
}

/// What is in a folder; empty if it cannot be read, because it is gone for example.
pub(crate) fn entries(folder: &Path) -> impl Iterator<Item = DirEntry> {
    fs::read_dir(folder).into_iter().flatten().flatten()
}

/// Whether two descriptors are of one file.
pub(crate) fn is_same(one: &LockFile, other: &LockFile) -> bool {
    #[cfg(test)]
    if one.modelled.is_some() {
        return model::is_same(one.modelled(), other.modelled());
    }
    is_one(one.metadata(), other.metadata())
}

/// Whether both are of one file.
pub(crate) fn is_one(one: io::Result<Metadata>, other: io::Result<Metadata>) -> bool {
    match (one, other) {
        (Ok(one), Ok(other)) => one.dev() == other.dev() && one.ino() == other.ino(),
        _ => false,
    }
}
