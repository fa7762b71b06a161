//! Finds and opens the files of logs.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use operator::render::words::count;
use recording::read::RecordFile;
use runtime::config::load;
use runtime::exit::{ExitCode, Failure, OrFail};
use status::group::GroupSet;
use status::log::config::LogConfig;
use status::log::file_name::{FileKind, Series, Stamp, recognize};
use status::log::groups::LogGroups;
use status::log::read::{LogReader, MAX_LINE_BYTES};

use super::options::LogPlaceArgs;
use super::recording::{LogEntry, LogFormat, LogReadError, McapReader, Recording};

/// Most damaged lines that are named: the first ones show what happened, the number of all how bad it is.
pub(super) const MAX_NAMED: u64 = 5;

/// A file whose name is that of a log.
pub(super) struct FoundLog {
    /// Where.
    pub path: PathBuf,
    /// Of which robot and log.
    pub series: Series,
    /// When it was created.
    pub stamp: Stamp,
    /// Its length.
    pub size_bytes: u64,
}

impl FoundLog {
    /// The robot.
    pub fn robot(&self) -> u32 {
        self.series.robot().get()
    }

    /// When the file was created, s since 1970.
    pub fn created_unix_s(&self) -> u64 {
        self.stamp.at.unix_s().unwrap_or(0)
    }

    /// From the first row to the last, s, of a record from the first message to the last; `None` if there is none.
    /// Reads the two ends of the file only, but for a record that was cut off.
    pub fn duration_s(&self) -> Result<Option<f64>, Failure> {
        if self.series.kind() == FileKind::Mcap {
            let file = RecordFile::open(&self.path).or_fail_usage(&self.path)?;
            let summary = recording::read::summary_of(&file)
                .map_err(|error| Failure::usage(error).context(self.path.display().to_string()))?;
            let span = summary.first_ns.zip(summary.last_ns);
            return Ok(span.map(|(first, last)| last.saturating_sub(first) as f64 / 1e9));
        }
        let mut file = LogFile::open(&self.path, OF_SAMPLES)?;
        let name = file.name();
        let Some(first) =
            next_row(file.recording.as_mut()).map_err(|error| unreadable(&name, error))?
        else {
            return Ok(None);
        };
        let mut end = last_rows(&self.path, 1)?;
        let mut last = first;
        while let Some(row) = next_row(end.as_mut()).map_err(|error| unreadable(&name, error))? {
            last = row;
        }
        Ok(Some(last.saturating_sub(first) as f64 / 1e9))
    }
}

/// When the next row was received, ns; damaged lines are passed over.
fn next_row(recording: &mut dyn Recording) -> Result<Option<u64>, LogReadError> {
    loop {
        match recording.next()? {
            Some(LogEntry::Row(row)) => return Ok(Some(row.sample.received_ns)),
            Some(LogEntry::Damaged(_)) => {}
            None => return Ok(None),
        }
    }
}

/// The folders in which logs are looked for.
pub(super) fn folders(place: &LogPlaceArgs) -> Result<Vec<PathBuf>, Failure> {
    if !place.dir.is_empty() {
        return Ok(place.dir.clone());
    }
    let default = Path::new(status::config::DEFAULT_FILE);
    let loaded = load::<status::config::Config>(place.status.as_deref(), default)?;
    let logs = loaded.value.log.into_iter();
    let mut folders: Vec<PathBuf> = logs.map(|log| log.directory).collect();
    folders.sort();
    folders.dedup();
    if folders.is_empty() {
        folders.push(LogConfig::default().directory);
    }
    Ok(folders)
}

/// The folders as messages name them.
pub(super) fn names(folders: &[PathBuf]) -> String {
    let names: Vec<String> = folders
        .iter()
        .map(|folder| folder.display().to_string())
        .collect();
    names.join(", ")
}

/// The files of logs in `folders`, the oldest first. A folder that is not there has none.
///
/// # Errors
///
/// Code 2 when a folder cannot be read.
pub(super) fn find(folders: &[PathBuf]) -> Result<Vec<FoundLog>, Failure> {
    let mut found = Vec::new();
    for folder in folders {
        let entries = match fs::read_dir(folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            entries => entries.or_fail_usage(folder)?,
        };
        for entry in entries.flatten() {
            let name = entry.file_name();
            let Some((series, stamp)) = name.to_str().and_then(recognize) else {
                continue;
            };
            // A file that was just removed is none.
            let Ok(metadata) = entry.metadata() else {
                continue;
            };
            if metadata.is_file() {
                found.push(FoundLog {
                    path: entry.path(),
                    series,
                    stamp,
                    size_bytes: metadata.len(),
                });
            }
        }
    }
    found.sort_by(|one, other| (one.stamp, &one.path).cmp(&(other.stamp, &other.path)));
    Ok(found)
}

/// The file of the same log in the same folder that follows the one at `path`; `None` if there is none (yet).
pub(super) fn successor(path: &Path) -> Result<Option<PathBuf>, Failure> {
    let Some((series, stamp)) = path.file_name().and_then(|name| recognize(name.to_str()?)) else {
        return Ok(None);
    };
    let folder = folder_of(path);
    let mut later = find(&[folder])?;
    // The format of the names may have been changed since; those of a log and of a record lie side by side.
    let is_later = |file: &FoundLog| {
        let log = |series: &Series| (series.robot(), series.name().to_owned(), series.kind());
        log(&file.series) == log(&series) && file.stamp > stamp
    };
    later.retain(is_later);
    Ok(later.into_iter().next().map(|file| file.path))
}

/// The folder that a file lies in.
pub(super) fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The columns of a record's rows where samples are looked at, and not their text: each column takes its time. The
/// DSP's errors are in every record, and not in every log.
pub(super) const OF_SAMPLES: LogGroups = LogGroups {
    telemetry: GroupSet(0),
    dsp_errors: true,
};

/// A file of a log that is open.
pub(super) struct LogFile {
    path: PathBuf,
    /// How it is written.
    pub format: LogFormat,
    /// What is in it.
    pub recording: Box<dyn Recording>,
}

impl LogFile {
    /// Opens the file at `path`. The rows of a record have the columns of these groups, those of a log of status all
    /// that it has.
    ///
    /// # Errors
    ///
    /// Code 2 when it is no regular file, or cannot be read.
    pub fn open(path: &Path, groups: LogGroups) -> Result<LogFile, Failure> {
        let mut input = BufReader::new(open(path)?);
        let beginning = input.fill_buf().or_fail_usage(path)?;
        let format = LogFormat::of(path, beginning);
        let recording: Box<dyn Recording> = match format {
            LogFormat::Tsv => Box::new(LogReader::new(input)),
            LogFormat::Mcap => Box::new(McapReader::open(path, groups).or_fail_usage(path)?),
        };
        Ok(LogFile {
            path: path.to_owned(),
            format,
            recording,
        })
    }

    /// Reads what stands before the first row.
    ///
    /// # Errors
    ///
    /// Code 2 when the file is no log, or nothing of one.
    pub fn begin(&mut self) -> Result<(), Failure> {
        let name = self.name();
        match self.recording.begin() {
            Ok(true) => Ok(()),
            Ok(false) => Err(Failure::usage(format!(
                "{name}: it has no first line with the names of columns; nothing was written to it yet, or it was cut off"
            ))),
            Err(error) => Err(unreadable(&name, error)),
        }
    }

    /// Gives each row and each damaged line to `take`, with the number of damaged lines so far.
    ///
    /// # Errors
    ///
    /// What `take` fails with.
    pub fn read(
        &mut self,
        mut take: impl FnMut(LogEntry<'_>, u64) -> Result<(), Failure>,
    ) -> Result<LogEnd, Failure> {
        let mut damaged = 0;
        let trouble = loop {
            match self.recording.next() {
                Ok(Some(entry)) => {
                    damaged += u64::from(matches!(entry, LogEntry::Damaged(_)));
                    take(entry, damaged)?;
                }
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        Ok(LogEnd {
            name: self.name(),
            trouble,
            damaged,
            unfinished_bytes: self.recording.unfinished_bytes(),
        })
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path, for messages.
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// The robot, as the file's name says.
    pub fn robot(&self) -> Option<u32> {
        self.recognized().map(|(series, _)| series.robot().get())
    }

    /// When the file was created, s since 1970, as its name says.
    pub fn created_unix_s(&self) -> Option<u64> {
        self.recognized().and_then(|(_, stamp)| stamp.at.unix_s())
    }

    fn recognized(&self) -> Option<(Series, Stamp)> {
        recognize(self.path.file_name()?.to_str()?)
    }
}

/// Opens a regular file: a pipe or a device would keep this process waiting.
pub(super) fn open(path: &Path) -> Result<File, Failure> {
    let metadata = fs::metadata(path).or_fail_usage(path);
    let metadata = metadata
        .map_err(|absent| absent.with_next_step("`ril log list` shows which files there are"))?;
    if !metadata.is_file() {
        let name = path.display();
        return Err(Failure::usage(format!("{name}: it is no regular file")));
    }
    File::open(path).or_fail_usage(path)
}

/// A reader of the end of the log at `path`: of at least `rows` rows, if it has so many. It goes on when the file
/// grows. The numbers of its lines mean nothing.
pub(super) fn last_rows(path: &Path, rows: u32) -> Result<Box<dyn Recording>, Failure> {
    let mut file = open(path)?;
    let header = first_line(&mut file, path)?;
    match LogFormat::of(path, &header) {
        LogFormat::Tsv => {
            let rest = from_a_line(file, header.len() as u64, rows, path)?;
            let input = io::Cursor::new(header).chain(rest);
            Ok(Box::new(LogReader::new(input)))
        }
        LogFormat::Mcap => {
            let reader = McapReader::open(path, LogGroups::ALL).or_fail_usage(path)?;
            let last = reader.last(rows as usize);
            let last = last.map_err(|error| unreadable(&path.display().to_string(), error))?;
            Ok(Box::new(last))
        }
    }
}

/// The first line of a file with its end, or as much of it as a line of a log can have.
fn first_line(file: &mut File, path: &Path) -> Result<Vec<u8>, Failure> {
    let mut line = Vec::new();
    let mut beginning = BufReader::new(file.take(MAX_LINE_BYTES as u64 + 1));
    beginning.read_until(b'\n', &mut line).or_fail_usage(path)?;
    Ok(line)
}

/// The end of a file of lines, from the beginning of a line on: at least `rows` of them, and none before `first`.
fn from_a_line(
    mut file: File,
    first: u64,
    rows: u32,
    path: &Path,
) -> Result<BufReader<File>, Failure> {
    let length = file.metadata().or_fail_usage(path)?.len();
    // The reader passes over a line that is longer; it is no row.
    let room = (u64::from(rows) + 2) * (MAX_LINE_BYTES as u64);
    let start = length.saturating_sub(room).max(first);
    file.seek(SeekFrom::Start(start)).or_fail_usage(path)?;
    let mut rest = BufReader::new(file);
    if start > first {
        // From the middle of a line to its end.
        let mut cut = Vec::new();
        (&mut rest)
            .take(MAX_LINE_BYTES as u64 + 1)
            .read_until(b'\n', &mut cut)
            .or_fail_usage(path)?;
    }
    Ok(rest)
}

/// The failure that the file `name` cannot be read.
pub(super) fn unreadable(name: &str, error: LogReadError) -> Failure {
    Failure::usage(error).context(name.to_owned())
}

/// What goes wrong with a path that the operator named is a usage error.
pub(super) trait OrFailUsage<T> {
    /// The value, or a usage error that names `path`.
    fn or_fail_usage(self, path: &Path) -> Result<T, Failure>;
}

impl<T> OrFailUsage<T> for io::Result<T> {
    fn or_fail_usage(self, path: &Path) -> Result<T, Failure> {
        self.or_fail(ExitCode::Usage)
            .map_err(|failure| failure.context(path.display().to_string()))
    }
}

/// The file that is meant: the one that was named, or that of the robot's last flight.
pub(super) fn chosen_file(
    named: Option<&PathBuf>,
    place: &LogPlaceArgs,
    groups: LogGroups,
) -> Result<LogFile, Failure> {
    match named {
        Some(path) => LogFile::open(path, groups),
        None => LogFile::open(&last_flight(place, None)?, groups),
    }
}

/// Most files, beginning with the newest, in which a flight is looked for.
const MAX_LOOKED_AT: usize = 20;

/// The newest file of the robot, of this kind if one is given, in which it flew: a log may go on after the landing in a
/// file of its own. The newest one if none of the last ones has a flight.
pub(super) fn last_flight(
    place: &LogPlaceArgs,
    kind: Option<FileKind>,
) -> Result<PathBuf, Failure> {
    let files = of_robot(place, kind)?;
    let flown = files
        .iter()
        .rev()
        .take(MAX_LOOKED_AT)
        .find(|path| has_flown(path));
    Ok(flown.unwrap_or(&files[files.len() - 1]).clone())
}

/// Whether a sample in the file is of the air.
fn has_flown(path: &Path) -> bool {
    let Ok(mut file) = LogFile::open(path, OF_SAMPLES) else {
        return false;
    };
    if file.begin().is_err() {
        return false;
    }
    loop {
        match file.recording.next() {
            Ok(Some(LogEntry::Row(row))) if row.sample.is_flying() => return true,
            Ok(Some(_)) => {}
            Ok(None) | Err(_) => return false,
        }
    }
}

/// The newest file of the robot.
pub(super) fn newest(place: &LogPlaceArgs) -> Result<PathBuf, Failure> {
    let files = of_robot(place, None)?;
    Ok(files[files.len() - 1].clone())
}

/// The files of the robot, of this kind if one is given, the oldest first; at least one.
fn of_robot(place: &LogPlaceArgs, kind: Option<FileKind>) -> Result<Vec<PathBuf>, Failure> {
    let robot = place.common.robot().get();
    let folders = folders(place)?;
    let mut found = find(&folders)?;
    found
        .retain(|file| file.robot() == robot && kind.is_none_or(|kind| file.series.kind() == kind));
    if found.is_empty() {
        let names = names(&folders);
        let what = match kind {
            Some(FileKind::Mcap) => "record",
            _ => "log",
        };
        return Err(Failure::usage(format!(
            "no {what} of robot {robot} in {names}: name a file, or the folder with --dir"
        )));
    }
    Ok(found.into_iter().map(|file| file.path).collect())
}

/// A file that was read as far as it could.
pub(super) struct LogEnd {
    name: String,
    /// Why it could not be read to its end.
    trouble: Option<LogReadError>,
    damaged: u64,
    /// Bytes that the file ends with and that are no row.
    pub unfinished_bytes: usize,
}

impl LogEnd {
    /// How a command ends that has read the file.
    pub fn verdict(self) -> Result<(), Failure> {
        let LogEnd { name, damaged, .. } = self;
        if let Some(error) = self.trouble {
            return Err(unreadable(&name, error));
        }
        let lines = count(damaged, "damaged line");
        let bytes = format!(
            "ends with {} of a row that is cut off",
            count(self.unfinished_bytes as u64, "byte")
        );
        let text = match (damaged, self.unfinished_bytes) {
            (0, 0) => return Ok(()),
            (0, _) => format!("{name} {bytes}"),
            (_, 0) => format!("{name} has {lines}"),
            _ => format!("{name} has {lines} and {bytes}"),
        };
        let text = format!("{text}: everything else was read");
        Err(Failure::new(ExitCode::NotInOrder, text))
    }
}
