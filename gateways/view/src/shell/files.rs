//! [`Files`]: what the server reads from a disk, in a thread of its own, so that a slow disk delays neither values nor
//! orders: imagery under the page's map, from a folder `{zoom}/{x}/{y}.png` (or `.jpg`, `.jpeg`, `.webp`), and the
//! report of the recording that is played.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread;

use runtime::exit::{ExitCode, Failure, OrFail};

use crate::page::TileRange;
use crate::{ConnectionId, FileRequest, Tile, Wanted};

/// Files that wait for the disk, and files that wait to be taken. A map asks for some dozens of tiles; a further one is
/// answered as missing, and the page asks again.
const MAX_WAITING: usize = 64;

/// Largest tile, bytes: one of 512 pixels each way without compression. A larger one is missing.
const MAX_TILE_BYTES: u64 = 1 << 20;

/// Kinds of tiles, in the order in which they are looked for.
const ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "webp"];

/// Makes the report of the recording that is played.
pub(crate) type Report = Box<dyn Fn() -> Result<String, Failure> + Send>;

/// What was looked for: its bytes, `None` if it is missing.
type Found = (ConnectionId, FileRequest, Option<Vec<u8>>);

/// A folder of tiles.
#[derive(Clone, Debug)]
pub(crate) struct TileFolder {
    folder: PathBuf,
    /// Whether rows count from the south.
    is_tms: bool,
    /// The zooms that it has.
    pub range: TileRange,
}

/// Reads from a disk in a thread of its own: imagery, and the report of the recording.
pub(crate) struct Files {
    wanted: SyncSender<(ConnectionId, FileRequest)>,
    found: Receiver<Found>,
    /// Has bytes when something was found.
    wakes: UnixStream,
}

impl TileFolder {
    /// Looks which zooms a folder has.
    ///
    /// # Errors
    ///
    /// Code 2 when the folder cannot be read or has no tiles.
    pub fn open(folder: &Path, is_tms: bool) -> Result<TileFolder, Failure> {
        let unusable = |why: &str| {
            let text = format!("{} has no tiles: {why}", folder.display());
            Failure::usage(text).with_next_step(
                "name a folder with files {zoom}/{x}/{y}.png, as QGIS (\"Generate XYZ tiles\") and `gdal2tiles.py --xyz` write them",
            )
        };
        let entries = fs::read_dir(folder).map_err(|error| unusable(&error.to_string()))?;
        let names = entries
            .flatten()
            .filter_map(|entry| entry.file_name().into_string().ok());
        let zooms: Vec<u8> = names
            .filter_map(|name| name.parse().ok().filter(|zoom| *zoom <= Tile::MAX_ZOOM))
            .collect();
        let (Some(min_zoom), Some(max_zoom)) = (zooms.iter().min(), zooms.iter().max()) else {
            return Err(unusable("no folder in it is named by a zoom from 0 to 23"));
        };
        Ok(TileFolder {
            folder: folder.to_owned(),
            is_tms,
            range: TileRange {
                min_zoom: *min_zoom,
                max_zoom: *max_zoom,
            },
        })
    }

    fn read(&self, tile: Tile) -> Option<Vec<u8>> {
        let row = match self.is_tms {
            true => (1_u32 << tile.zoom).checked_sub(1 + tile.y)?,
            false => tile.y,
        };
        let column = self
            .folder
            .join(tile.zoom.to_string())
            .join(tile.x.to_string());
        ENDINGS.into_iter().find_map(|ending| {
            let path = column.join(format!("{row}.{ending}"));
            // Before it is opened: a pipe in its place would stop the thread.
            let metadata = fs::metadata(&path).ok()?;
            if !metadata.is_file() || metadata.len() > MAX_TILE_BYTES {
                return None;
            }
            let mut image = Vec::new();
            File::open(path)
                .ok()?
                .take(MAX_TILE_BYTES)
                .read_to_end(&mut image)
                .ok()?;
            Some(image)
        })
    }
}

impl Files {
    /// Starts the thread for a folder of tiles and a report; `None` if there is neither. A report is made anew for each
    /// request: a browser asks once for a window.
    ///
    /// # Errors
    ///
    /// Code 1 when the operating system gives no thread.
    pub fn start(
        tiles: Option<TileFolder>,
        report: Option<Report>,
    ) -> Result<Option<Files>, Failure> {
        if tiles.is_none() && report.is_none() {
            return Ok(None);
        }
        let read = move |wanted| match wanted {
            Wanted::Tile(tile) => tiles.as_ref()?.read(tile),
            // It is made, not read.
            Wanted::Metrics => None,
            Wanted::Report => report.as_ref()?()
                .inspect_err(
                    |failure| tracing::warn!(chain = ?failure.chain(), "there is no report"),
                )
                .ok()
                .map(String::into_bytes),
        };
        Files::run(read).or_fail(ExitCode::Internal).map(Some)
    }

    fn run(read: impl Fn(Wanted) -> Option<Vec<u8>> + Send + 'static) -> io::Result<Files> {
        let (wanted, asked) = sync_channel::<(ConnectionId, FileRequest)>(MAX_WAITING);
        let (answers, found) = sync_channel(MAX_WAITING);
        let (wakes, mut wake) = UnixStream::pair()?;
        wakes.set_nonblocking(true)?;
        wake.set_nonblocking(true)?;
        thread::Builder::new()
            .name("files".to_owned())
            .spawn(move || {
                while let Ok((connection, request)) = asked.recv() {
                    let bytes = read(request.wanted);
                    if answers.send((connection, request, bytes)).is_err() {
                        break;
                    }
                    // When the kernel takes no further byte, enough wait to wake the process.
                    let _ = wake.write(&[1]);
                }
            })?;
        Ok(Files {
            wanted,
            found,
            wakes,
        })
    }

    /// Asks for a file. False if too many wait.
    pub fn ask(&self, connection: ConnectionId, request: FileRequest) -> bool {
        match self.wanted.try_send((connection, request)) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        }
    }

    /// The files that were read, and those that are missing.
    pub fn found(&mut self) -> impl Iterator<Item = Found> {
        let mut bytes = [0; MAX_WAITING];
        while matches!(self.wakes.read(&mut bytes), Ok(1..)) {}
        self.found.try_iter()
    }

    /// Is readable when something was found.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.wakes.as_fd()
    }
}
