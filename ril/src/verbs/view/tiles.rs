//! [`Tiles`]: imagery under the page's map, from a folder `{zoom}/{x}/{y}.png` (or `.jpg`, `.jpeg`, `.webp`). A thread of its own reads the
//! files, so a slow disk delays neither values nor orders.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread;

use runtime::exit::{ExitCode, Failure, OrFail};
use view::page::TileRange;
use view::{ConnectionId, Tile, TileRequest};

/// Tiles that wait for the disk, and tiles that wait to be taken. A map asks for some dozens; a further tile is answered as missing, and
/// the page asks again.
const MAX_WAITING: usize = 64;

/// Largest file, bytes: a tile of 512 pixels each way without compression. A larger one is missing.
const MAX_TILE_BYTES: u64 = 1 << 20;

/// Kinds of files, in the order in which they are looked for.
const ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "webp"];

/// A tile that was looked for: its bytes, `None` if it is missing.
type FoundTile = (ConnectionId, TileRequest, Option<Vec<u8>>);

/// See the module's documentation.
pub(super) struct Tiles {
    wanted: SyncSender<(ConnectionId, TileRequest)>,
    found: Receiver<FoundTile>,
    /// Has bytes when something was found.
    wakes: UnixStream,
}

impl Tiles {
    /// Opens a folder, and says which zooms it has.
    ///
    /// # Errors
    ///
    /// Code 2 when the folder cannot be read or has no tiles.
    pub fn open(folder: &Path) -> Result<(Tiles, TileRange), Failure> {
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
        let range = TileRange {
            min_zoom: *min_zoom,
            max_zoom: *max_zoom,
        };
        let tiles = Tiles::start(folder.to_owned()).or_fail(ExitCode::Internal)?;
        Ok((tiles, range))
    }

    fn start(folder: PathBuf) -> io::Result<Tiles> {
        let (wanted, asked) = sync_channel::<(ConnectionId, TileRequest)>(MAX_WAITING);
        let (answers, found) = sync_channel(MAX_WAITING);
        let (wakes, mut wake) = UnixStream::pair()?;
        wakes.set_nonblocking(true)?;
        wake.set_nonblocking(true)?;
        thread::Builder::new()
            .name("tiles".to_owned())
            .spawn(move || {
                while let Ok((connection, request)) = asked.recv() {
                    let image = read(&folder, request.tile);
                    if answers.send((connection, request, image)).is_err() {
                        break;
                    }
                    // When the kernel takes no further byte, enough wait to wake the process.
                    let _ = wake.write(&[1]);
                }
            })?;
        Ok(Tiles {
            wanted,
            found,
            wakes,
        })
    }

    /// Asks for a tile. False if too many wait.
    pub fn ask(&self, connection: ConnectionId, request: TileRequest) -> bool {
        match self.wanted.try_send((connection, request)) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        }
    }

    /// The tiles that were found, and those that are missing.
    pub fn found(&mut self) -> impl Iterator<Item = FoundTile> {
        let mut bytes = [0; MAX_WAITING];
        while matches!(self.wakes.read(&mut bytes), Ok(1..)) {}
        self.found.try_iter()
    }

    /// Is readable when something was found.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.wakes.as_fd()
    }
}

fn read(folder: &Path, tile: Tile) -> Option<Vec<u8>> {
    let column = folder.join(tile.zoom.to_string()).join(tile.x.to_string());
    ENDINGS.into_iter().find_map(|ending| {
        let path = column.join(format!("{}.{ending}", tile.y));
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
