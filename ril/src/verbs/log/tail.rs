//! `ril log tail`: the last rows of a log, and those that come.
//!
//! It sleeps until the kernel says that the file was written to, or that its folder has a new file: nothing polls. Rows
//! come in portions, as status hands them to the system. A partial row that a full disk left, and that status cuts off
//! again, spoils the row after it here; the file is whole.

use std::collections::VecDeque;
use std::io::{self, BufWriter, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};

use operator::render::json_line;
use operator::session::configuration;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::inotify;
use rustix::io::Errno;
use status::log::groups::LogGroups;

use super::files::{LogFile, MAX_NAMED, folder_of, last_rows, newest, successor, unreadable};
use super::options::LogTailArgs;
use super::recording::{LogEntry, Recording, Row};
use super::row::{Chosen, JsonRow, UtcSource, UtcTimes};

/// The columns that are shown when none is chosen: with the time they fit into 80 characters.
const USUAL: [&str; 3] = ["flying", "altitude_m", "battery_mv"];

/// Room for events of the kernel; what they say is not read, only that there are some.
const EVENT_BYTES: usize = 4096;

/// `ril log tail`
///
/// # Errors
///
/// As all of `ril log`.
pub(super) fn tail(args: &LogTailArgs) -> Result<(), Failure> {
    configuration(&args.place.common)?;
    let path = match &args.file {
        Some(path) => path.clone(),
        None => newest(&args.place)?,
    };
    if !args.follow {
        // A log that is followed may have no first line yet.
        LogFile::open(&path, LogGroups::ALL)?.begin()?;
    }
    if !args.follow {
        return Tail::open(args, path)?.print().map(drop);
    }
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let watch = Watch::new(&path)?;
    let mut tail = Tail::open(args, path)?;
    let mut woken = Woken { has_new_file: true };
    while !termination.requested() {
        tail.refresh()?;
        tail.print()?;
        let next = match woken.has_new_file {
            true => successor(&tail.path)?,
            false => None,
        };
        if let Some(next) = next {
            // Its writer has closed the file: what it wrote last is there.
            tail.refresh()?;
            tail.print()?;
            watch.rows_of(&next)?;
            tail = Tail::after(tail, next)?;
        } else {
            woken = watch.wait(&termination)?;
        }
    }
    Ok(())
}

/// The rows of one file as they are printed.
struct Tail<'a> {
    args: &'a LogTailArgs,
    path: PathBuf,
    recording: Box<dyn Recording>,
    /// How many of the first rows are kept back until the last ones of them are known; `None` if they were printed.
    begin_with: Option<usize>,
    /// `None` before the first line is there.
    shown: Option<(Chosen, UtcTimes)>,
    damaged: u64,
}

impl<'a> Tail<'a> {
    /// The end of the log at `path`.
    fn open(args: &'a LogTailArgs, path: PathBuf) -> Result<Tail<'a>, Failure> {
        Ok(Tail {
            recording: last_rows(&path, args.rows)?,
            args,
            path,
            begin_with: Some(args.rows as usize),
            shown: None,
            damaged: 0,
        })
    }

    /// The log that follows `former`, from its beginning.
    fn after(former: Tail<'a>, path: PathBuf) -> Result<Tail<'a>, Failure> {
        Ok(Tail {
            recording: LogFile::open(&path, LogGroups::ALL)?.recording,
            path,
            begin_with: None,
            shown: None,
            damaged: 0,
            args: former.args,
        })
    }

    /// Looks for what was written.
    fn refresh(&mut self) -> Result<(), Failure> {
        let refreshed = self.recording.refresh();
        refreshed.map_err(|error| unreadable(&self.path.display().to_string(), error))
    }

    /// Prints what is there.
    fn print(&mut self) -> Result<(), Failure> {
        let name = self.path.display().to_string();
        let begun = self.recording.begin();
        if !begun.map_err(|error| unreadable(&name, error))? {
            // The file was only just created: all of its rows are new.
            self.begin_with = None;
            return Ok(());
        }
        if self.shown.is_none() {
            self.shown = Some(self.choose(&name)?);
        }
        let Some((chosen, times)) = &mut self.shown else {
            return Ok(());
        };
        let mut out = BufWriter::new(io::stdout().lock());
        let mut kept: VecDeque<String> = VecDeque::new();
        loop {
            let entry = self.recording.next();
            match entry.map_err(|error| unreadable(&name, error))? {
                None => break,
                Some(LogEntry::Damaged(damage)) => {
                    self.damaged += 1;
                    // The end of a file was read: lines have other numbers than in the whole.
                    if self.damaged <= MAX_NAMED {
                        tracing::warn!("{name}: a line is no row: {}", damage.reason);
                    }
                }
                Some(LogEntry::Row(row)) => {
                    let line = line(chosen, times, &row, self.args.json)?;
                    kept.push_back(line);
                    match self.begin_with {
                        Some(rows) if kept.len() > rows => drop(kept.pop_front()),
                        Some(_) => {}
                        None => {
                            for line in kept.drain(..) {
                                out.write_all(line.as_bytes()).map_err(Failure::output)?;
                            }
                        }
                    }
                }
            }
        }
        self.begin_with = None;
        for line in kept {
            out.write_all(line.as_bytes()).map_err(Failure::output)?;
        }
        out.flush().map_err(Failure::output)
    }

    /// Which columns are shown, and where times come from.
    fn choose(&self, name: &str) -> Result<(Chosen, UtcTimes), Failure> {
        let columns = self.recording.columns();
        let fields = &self.args.fields;
        let chosen = if !fields.is_empty() {
            Chosen::named(columns, fields)
                .map_err(|reason| Failure::usage(format!("{name}: {reason}")))?
        } else if self.args.json {
            Chosen::all(columns)
        } else {
            Chosen::present(columns, &USUAL)
        };
        // The first row that is read is not the first of the file: only a column says when it was.
        let source = match UtcSource::of(columns, None) {
            UtcSource::Column => UtcSource::Column,
            _ => UtcSource::Nowhere,
        };
        Ok((chosen, UtcTimes::new(source)))
    }
}

/// A row as it is printed.
fn line(
    chosen: &Chosen,
    times: &mut UtcTimes,
    row: &Row<'_>,
    as_json: bool,
) -> Result<String, Failure> {
    let time = times.of(row);
    if !as_json {
        return Ok(chosen.line(time, row) + "\n");
    }
    let mut line = Vec::new();
    json_line(&mut line, &JsonRow { chosen, time, row })?;
    Ok(String::from_utf8_lossy(&line).into_owned())
}

/// Why a process that follows a log woke up.
struct Woken {
    /// Whether the folder has another file.
    has_new_file: bool,
}

/// What wakes a process that follows a log.
struct Watch {
    /// Writes to the file.
    rows: OwnedFd,
    /// Files that come into its folder.
    files: OwnedFd,
}

impl Watch {
    fn new(path: &Path) -> Result<Watch, Failure> {
        let flags = inotify::CreateFlags::CLOEXEC | inotify::CreateFlags::NONBLOCK;
        let watch = Watch {
            rows: inotify::init(flags).or_fail(ExitCode::Internal)?,
            files: inotify::init(flags).or_fail(ExitCode::Internal)?,
        };
        let created = inotify::WatchFlags::CREATE | inotify::WatchFlags::MOVED_TO;
        inotify::add_watch(&watch.files, folder_of(path), created).or_fail(ExitCode::Internal)?;
        watch.rows_of(path)?;
        Ok(watch)
    }

    /// Watches the writes to the file at `path`, too.
    fn rows_of(&self, path: &Path) -> Result<(), Failure> {
        let flags = inotify::WatchFlags::MODIFY;
        inotify::add_watch(&self.rows, path, flags).or_fail(ExitCode::Internal)?;
        Ok(())
    }

    /// Sleeps until something happened, a signal among it.
    fn wait(&self, termination: &Termination) -> Result<Woken, Failure> {
        let mut wakers = [
            PollFd::from_borrowed_fd(termination.as_fd(), PollFlags::IN),
            PollFd::new(&self.rows, PollFlags::IN),
            PollFd::new(&self.files, PollFlags::IN),
        ];
        match poll(&mut wakers, None) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(error) => return Err(error).or_fail(ExitCode::Internal),
        }
        let has_new_file = wakers[2].revents().contains(PollFlags::IN);
        for events in [&self.rows, &self.files] {
            let mut bytes = [0; EVENT_BYTES];
            // Until there are none: neither the descriptor nor the kernel's queue keeps any.
            while rustix::io::read(events, &mut bytes).is_ok() {}
        }
        Ok(Woken { has_new_file })
    }
}
