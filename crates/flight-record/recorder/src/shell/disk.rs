//! [`Disk`]: the thread that carries out the recorder's actions, and may wait for its disk as long as that takes. It
//! decides nothing: one action leads in, and how it went comes out.

#[cfg(test)]
mod tests;

use std::fs::{File, Permissions};
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::{FileExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread;

use ipc_types::{SchedulingRole, request_slice};
use recording::{DiskError, DiskErrorKind, FileAction, Part};
use runtime::durable;
use rustix::event::{EventfdFlags, eventfd};
use status::log::config::LogLimits;
use status::log::file_name::Series;
use status::log::retention::Retention;
use status::log::store::{FileStore, LogFile, Store};

/// The thread, as the rest of the process sees it.
pub(crate) struct Disk {
    /// Room for the one action that can be outstanding, so that handing it over never waits.
    actions: SyncSender<FileAction>,
    outcomes: Receiver<ActionResult>,
    is_busy: bool,
    woken: Arc<OwnedFd>,
}

/// The thread of the disk has ended by itself: it panicked.
#[derive(Debug, thiserror::Error)]
#[error("the thread that writes to the disk has failed")]
pub(crate) struct DiskGone;

impl Disk {
    /// Starts the thread.
    ///
    /// # Errors
    ///
    /// When the system grants no thread or no descriptor.
    pub fn start(place: RecordFolder) -> io::Result<Disk> {
        let (actions, orders) = sync_channel::<FileAction>(1);
        let (ended, outcomes) = sync_channel(1);
        let flags = EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK;
        let woken = Arc::new(eventfd(0, flags)?);
        let waker = Arc::clone(&woken);
        let mut worker = Worker::new(place, FileStore);
        let body = move || {
            request_slice(SchedulingRole::Background);
            for action in orders {
                let outcome = worker.perform(action);
                if ended.send(outcome).is_err() {
                    return;
                }
                // It only fails when the count is at its end: then the process is awake.
                let _ = rustix::io::write(&waker, &1_u64.to_ne_bytes());
            }
        };
        thread::Builder::new().name("disk".to_owned()).spawn(body)?;
        Ok(Disk {
            actions,
            outcomes,
            is_busy: false,
            woken,
        })
    }

    /// Whether an action is outstanding.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Hands an action over; must not be called while one is outstanding.
    ///
    /// # Errors
    ///
    /// The thread is gone.
    pub fn perform(&mut self, action: FileAction) -> Result<(), DiskGone> {
        self.is_busy = true;
        self.actions.send(action).map_err(|_| DiskGone)
    }

    /// How the outstanding action went, once it is done. Never waits.
    ///
    /// # Errors
    ///
    /// The thread is gone.
    pub fn outcome(&mut self) -> Result<Option<ActionResult>, DiskGone> {
        let mut count = [0; 8];
        // It has nothing most of the time, and that is no error.
        let _ = rustix::io::read(&self.woken, &mut count);
        match self.outcomes.try_recv() {
            Ok(outcome) => {
                self.is_busy = false;
                Ok(Some(outcome))
            }
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(DiskGone),
        }
    }
}

/// Readable when an action is done.
impl AsFd for Disk {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.woken.as_fd()
    }
}

/// A file of a recording. A test puts another one in the place of the system's.
trait RecordFile: LogFile {
    /// Puts all `bytes` at the offset `at`.
    ///
    /// # Errors
    ///
    /// Some of them may be there.
    fn write_at(&mut self, bytes: &[u8], at: u64) -> io::Result<()>;

    /// Takes the permissions away that go beyond [`MODE`]: whatever the umask is, a record is not for everybody.
    ///
    /// # Errors
    ///
    /// They are as before.
    fn restrict(&mut self) -> io::Result<()>;

    /// Its length on the disk.
    ///
    /// # Errors
    ///
    /// The system does not say.
    fn len(&self) -> io::Result<u64>;
}

/// Who may read and write a record at most: its owner, and its group may read.
pub(crate) const MODE: u32 = 0o640;

impl RecordFile for File {
    fn write_at(&mut self, bytes: &[u8], at: u64) -> io::Result<()> {
        self.write_all_at(bytes, at)
    }

    fn restrict(&mut self) -> io::Result<()> {
        let mode = self.metadata()?.mode() & 0o777;
        match mode & !MODE {
            0 => Ok(()),
            _ => self.set_permissions(Permissions::from_mode(mode & MODE)),
        }
    }

    fn len(&self) -> io::Result<u64> {
        Ok(self.metadata()?.len())
    }
}

/// What the thread has.
struct Worker<S: Store> {
    place: RecordFolder,
    store: S,
    retention: Retention,
    file: Option<CurrentFile<S::File>>,
    is_pausing: bool,
    notes: Vec<Note>,
}

struct CurrentFile<F> {
    path: PathBuf,
    file: F,
    /// Its length.
    bytes: u64,
}

impl<S: Store<File: RecordFile>> Worker<S> {
    /// Files at `place` in `store`.
    fn new(place: RecordFolder, store: S) -> Worker<S> {
        Worker {
            retention: Retention::new(place.series.clone()),
            place,
            store,
            file: None,
            is_pausing: false,
            notes: Vec::new(),
        }
    }

    /// Carries out an action.
    fn perform(&mut self, action: FileAction) -> ActionResult {
        let result = self.act(action);
        ActionResult {
            result,
            notes: std::mem::take(&mut self.notes),
        }
    }

    fn act(&mut self, action: FileAction) -> Result<(), DiskError> {
        if let FileAction::Close { is_whole, messages } = action {
            self.close(is_whole, messages);
            return Ok(());
        }
        if let FileAction::Open { .. } = action {
            let folder = self.place.folder.clone();
            let prepared = self.store.prepare(&folder);
            prepared.map_err(|error| failed(&folder, &error))?;
            self.check_free_space()?;
            return self.open(&folder).map_err(|error| failed(&folder, &error));
        }
        if let FileAction::Write { .. } = action {
            self.check_free_space()?;
        }
        let Some(open) = &mut self.file else {
            return Err(DiskError {
                kind: DiskErrorKind::Failed,
                text: "no file is open".to_owned(),
            });
        };
        open.act(action).map_err(|error| failed(&open.path, &error))
    }

    /// Whether the disk has as much room as must be left.
    fn check_free_space(&mut self) -> Result<(), DiskError> {
        let needed = self.place.limits.needed_bytes(self.is_pausing);
        let folder = &self.place.folder;
        // If the system does not say, writing will show.
        let free = match needed {
            0 => None,
            _ => self.store.free_bytes(folder).ok(),
        };
        self.is_pausing = free.is_some_and(|free| free < needed);
        match (self.is_pausing, free) {
            (true, Some(free)) => Err(DiskError {
                kind: DiskErrorKind::LowSpace,
                text: format!(
                    "{} MiB are free where {} lies, and {} MiB are left to other programs (--min-free)",
                    free >> 20,
                    folder.display(),
                    self.place.limits.min_free_bytes >> 20,
                ),
            }),
            _ => Ok(()),
        }
    }

    fn open(&mut self, folder: &Path) -> io::Result<()> {
        let LogLimits {
            max_file_bytes,
            max_total_bytes,
            ..
        } = self.place.limits;
        let (retention, store) = (&mut self.retention, &mut self.store);
        let room = retention.make_room(store, folder, max_file_bytes, max_total_bytes);
        for (file, bytes) in room.removed {
            self.notes.push(Note::Removed { file, bytes });
        }
        if let Some(error) = room.error {
            return Err(error);
        }
        write_layout(folder, &self.place.layout);
        let series = &self.place.series;
        let stem = series.stem(self.store.clock().utc());
        let (path, mut file) = self.store.create(folder, &stem, series.kind())?;
        self.retention.created(&path);
        // Some file systems have no permissions.
        let _ = file.restrict();
        self.notes.push(Note::Opened(path.clone()));
        self.file = Some(CurrentFile {
            path,
            file,
            bytes: 0,
        });
        Ok(())
    }

    fn close(&mut self, is_whole: bool, messages: u64) {
        let Some(CurrentFile {
            path, file, bytes, ..
        }) = self.file.take()
        else {
            return;
        };
        drop(file);
        // A disk that refuses even that keeps a file without messages, which counts like others when room is made.
        if messages == 0 && self.store.remove(&path).is_ok() {
            self.notes.push(Note::NothingCame(path));
        } else {
            self.notes.push(Note::Closed(ClosedFile {
                path,
                is_whole,
                messages,
                bytes,
            }));
        }
    }
}

impl<F: RecordFile> CurrentFile<F> {
    /// What is written behind a cut cannot be read without what was before.
    fn check_length(&self) -> io::Result<()> {
        match self.file.len()? < self.bytes {
            true => Err(io::Error::other("another program has cut the file")),
            false => Ok(()),
        }
    }

    fn act(&mut self, action: FileAction) -> io::Result<()> {
        match action {
            FileAction::Write { parts } => {
                self.check_length()?;
                for Part { at, bytes } in parts {
                    self.file.write_at(&bytes, at)?;
                    self.bytes = self.bytes.max(at.saturating_add(bytes.len() as u64));
                }
            }
            FileAction::Truncate { len } => {
                self.file.truncate(len)?;
                self.bytes = len;
            }
            FileAction::Sync => {
                self.check_length()?;
                self.file.sync()?;
            }
            FileAction::Open { .. } | FileAction::Close { .. } => {}
        }
        Ok(())
    }
}

/// Writes the layout of viewers if there is none, as a whole: half of one would stay. A recording without it is as
/// good, so that an error is no failure.
fn write_layout(folder: &Path, layout: &ViewerLayout) {
    let path = folder.join(&layout.name);
    if path.exists() {
        return;
    }
    let written = durable::replace(&path, layout.text.as_bytes());
    if let Err(error) = written.and_then(|()| File::open(&path)?.restrict()) {
        tracing::debug!(%error, file = layout.name, "the layout for viewers is not written");
    }
}

/// The answer that something about `file` failed.
fn failed(file: &Path, error: &io::Error) -> DiskError {
    DiskError {
        kind: DiskErrorKind::Failed,
        text: format!("{}: {error}", file.display()),
    }
}

/// What the thread did, in its order, for the operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Note {
    /// A file was created.
    Opened(PathBuf),
    /// An old file was removed to make room for the next.
    Removed {
        /// The file.
        file: PathBuf,
        /// How long it was, bytes.
        bytes: u64,
    },
    /// A file was closed.
    Closed(ClosedFile),
    /// A file without a message was closed, and removed.
    NothingCame(PathBuf),
}

/// A file to which nothing will be written any more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ClosedFile {
    /// Where it is.
    pub path: PathBuf,
    /// Whether it is complete.
    pub is_whole: bool,
    /// Messages in it, the recording's own events not counted.
    pub messages: u64,
    /// How long it is.
    pub bytes: u64,
}

/// How an action went.
pub(crate) struct ActionResult {
    /// The answer for the recorder.
    pub result: Result<(), DiskError>,
    /// What the operator should know.
    pub notes: Vec<Note>,
}

/// Where the files go, and how much they may take.
#[derive(Clone, Debug)]
pub(crate) struct RecordFolder {
    /// The folder.
    pub folder: PathBuf,
    /// Which files in it are the recording's.
    pub series: Series,
    /// How much they may take.
    pub limits: LogLimits,
    /// What viewers show the files with.
    pub layout: ViewerLayout,
}

/// A file beside the recordings that Foxglove and Lichtblick import.
#[derive(Clone, Debug)]
pub(crate) struct ViewerLayout {
    /// Its name.
    pub name: String,
    /// What it has.
    pub text: String,
}
