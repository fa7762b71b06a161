//! `ril preflight`: gathers what the checks go by, and prints them. What `ril start` says before it starts.
//!
//! A thin shell around [`preflight`](crate::preflight), which judges. What the machine is like comes from the doctor.

use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bridge::BridgeConfig;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, ParameterRequest};
use ipc_types::{MonotonicNs, Request, Source, Topic, fresh_request_id};
use runtime::args::CommonArgs;
use runtime::config::load;
use runtime::exit::{ExitCode, Failure};
use rustix::fs::Access;
use status::log::config::LogConfig;

use super::conversation::{Conversation, Format};
use super::doctor;
use super::doctor::facts::{FileContent, FileFacts, Namespace};
use super::exchange::Until;
use super::latest::Latest;
use super::{Session, configuration, is_relayed, json_line};
use crate::cli::{DoctorArgs, PreflightArgs};
use crate::config::Config;
use crate::live::Size;
use crate::messages::Verb;
use crate::preflight::check::Verdict;
use crate::preflight::facts::{Clock, Facts, Live, LogPlace, Logs};
use crate::preflight::judge;
use crate::preflight::report::Report;

/// How long `ril start` waits for samples that it goes by: twice the period of the module's state. A start is not held up by what
/// is missing.
const START_TIMEOUT: Duration = Duration::from_millis(500);

/// What the time service of systemd makes when the clock is synchronized.
const SYNCHRONIZED: &str = "/run/systemd/timesync/synchronized";

/// `ril preflight`
///
/// # Errors
///
/// Code 8 when a check failed or could not be made, and with `--strict` when one warns.
pub fn preflight(args: &PreflightArgs) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
    let examined = DoctorArgs {
        bridge: args.bridge.clone(),
        status: args.status.clone(),
        port: args.port.clone(),
        ..doctor_args(&args.common)
    };
    // A domain that cannot be joined is one of the findings.
    let session = Session::join(&args.common).ok();
    let live = match &session {
        Some(session) => Live {
            answer: answer(session, timeout)?,
            ..live(session, timeout)?
        },
        None => Live::default(),
    };
    let report = report(&examined, live, &config);
    let mut out = io::stdout().lock();
    if args.json {
        json_line(&mut out, &report)?;
    } else {
        let width = match out.is_terminal() {
            true => Size::of(&out).columns,
            false => usize::MAX,
        };
        write!(out, "{}", report.text(width)).map_err(Failure::output)?;
    }
    match report.verdict() {
        Verdict::Pass => Ok(()),
        Verdict::Warn if !args.strict => Ok(()),
        Verdict::Warn | Verdict::Fail => Err(Failure::new(
            ExitCode::NotInOrder,
            format!("{}; each says what to do", report.summary()),
        )),
    }
}

/// Says on standard error what is not in order, before a start that goes on whatever it is.
pub(super) fn warn(session: &Session, common: &CommonArgs, config: &Config) -> Result<(), Failure> {
    // The start itself says that there is no bridge.
    if !session.is_provided(ModuleState::KEY)? {
        return Ok(());
    }
    let live = Live {
        // The start is a request, too, and says by itself when it gets no answer.
        answer: Some(Ok(())),
        ..live(session, START_TIMEOUT)?
    };
    for line in report(&doctor_args(common), live, config).warnings() {
        tracing::warn!("{line}");
    }
    Ok(())
}

/// What the doctor looks at by default.
fn doctor_args(common: &CommonArgs) -> DoctorArgs {
    DoctorArgs {
        common: common.clone(),
        bridge: None,
        status: None,
        sim: None,
        port: None,
        repair: false,
        json: false,
    }
}

/// Looks at the machine and judges all.
fn report(args: &DoctorArgs, live: Live, config: &Config) -> Report {
    // The samples were looked at just now; the doctor's looks may take seconds.
    let now = MonotonicNs::now();
    let (machine, bridge) = doctor::facts(args);
    let status_folder = machine.domain.as_ref().ok().and_then(|domain| {
        let robot = machine.robot;
        let providers = domain.providers.as_ref().ok()?;
        let status = providers
            .iter()
            .find(|one| one.robot.get() == robot && one.service.provider() == "status")?;
        (status.pids == Namespace::Ours)
            .then(|| PathBuf::from(format!("/proc/{}/cwd", status.by.pid)))
    });
    let facts = Facts {
        robot: machine.robot,
        now,
        bridge: bridge.filter(|_: &BridgeConfig| is_there(&machine.files, "bridge")),
        logs: match is_there(&machine.files, "status") {
            true => logs(args.status.clone(), status_folder),
            false => Logs::NoFile,
        },
        machine,
        live,
        clock: clock(),
    };
    Report::new(facts.robot, judge(&facts, &config.preflight))
}

/// Whether the configuration file of `command` is there, right or wrong.
fn is_there(files: &[FileFacts], command: &str) -> bool {
    let mut files = files.iter();
    files.any(|file| {
        file.command == Some(command) && !matches!(file.content, Ok(FileContent::Absent))
    })
}

/// Waits for the newest sample of each topic that is to be expected.
fn live(session: &Session, timeout: Duration) -> Result<Live, Failure> {
    let mut newest = Newest {
        state: Latest::open(&session.ipc)?,
        dsp: Latest::open(&session.ipc)?,
        hero: Latest::open(&session.ipc)?,
    };
    let give_up = MonotonicNs::now() + timeout;
    while !newest.is_complete(session)?
        && MonotonicNs::now() < give_up
        && !session.termination.requested()
    {
        session.wait(newest.ports(), Some(give_up))?;
        newest.drain();
    }
    let provider = session.provider(ModuleState::KEY)?;
    Ok(Live {
        state: newest.state.sample,
        dsp: newest.dsp.sample,
        hero: newest.hero.sample,
        answer: None,
        is_relayed: provider.is_some_and(|provider| is_relayed(ModuleState::KEY, &provider)),
    })
}

/// Asks the bridge for the description of its first port, which it gives without the DSP. It answers to that as it does to an
/// order.
fn answer(session: &Session, timeout: Duration) -> Result<Option<Result<(), String>>, Failure> {
    if !session.is_provided(ParameterRequest::KEY)? {
        return Ok(None);
    }
    let request = ParameterRequest::list(fresh_request_id(), 0);
    let answer = Conversation::open(session, Verb::ListParameters, timeout)
        .and_then(|mut bridge| bridge.hold(&[request], Until::Final, Format::Silent));
    Ok(Some(
        answer
            .map(drop)
            .map_err(|failure| failure.chain().join(": ")),
    ))
}

struct Newest {
    state: Latest<ModuleState>,
    dsp: Latest<DspTelemetry>,
    hero: Latest<HeroTelemetry>,
}

impl Newest {
    fn ports(&mut self) -> [&mut dyn Source; 3] {
        [
            &mut self.state.port,
            &mut self.dsp.port,
            &mut self.hero.port,
        ]
    }

    fn drain(&mut self) {
        self.state.drain();
        self.dsp.drain();
        self.hero.drain();
    }

    /// Whether everything is there that can be expected: nothing without a bridge, telemetry when it has published some, the
    /// robot's when there is a status.
    fn is_complete(&self, session: &Session) -> Result<bool, Failure> {
        let Some(state) = &self.state.sample else {
            return Ok(!session.is_provided(ModuleState::KEY)?);
        };
        if state.link.telemetry_published == 0 {
            return Ok(true);
        }
        Ok(self.dsp.sample.is_some()
            && (self.hero.sample.is_some() || !session.is_provided(HeroTelemetry::KEY)?))
    }
}

/// The folders of the logs in the configuration of status; `folder` is where its process began, if that is known.
fn logs(explicit: Option<PathBuf>, folder: Option<PathBuf>) -> Logs {
    let looked = doctor::look(move || {
        let default = Path::new(status::config::DEFAULT_FILE);
        let loaded = load::<status::config::Config>(explicit.as_deref(), default).ok()?;
        let logs = loaded.value.log.into_iter();
        let logs = logs.filter(|log| !log.groups.is_empty());
        Some(logs.map(|log| log_place(&log, folder.as_deref())).collect())
    });
    looked
        .ok()
        .flatten()
        .map_or(Logs::Unknown, Logs::Configured)
}

fn log_place(log: &LogConfig, folder: Option<&Path>) -> LogPlace {
    // Where the link to the process's folder cannot be read, the folder is taken for this one.
    let folder = folder.and_then(|folder| fs::read_link(folder).ok());
    let directory = match &folder {
        Some(folder) => folder.join(&log.directory),
        None => log.directory.clone(),
    };
    // A folder that is not there yet is made in the nearest one that is.
    let parents = directory.ancestors();
    let mut parents = parents.map(|path| match path.as_os_str().is_empty() {
        true => Path::new("."),
        false => path,
    });
    let present = parents.find(|path| path.exists()).unwrap_or(Path::new("."));
    let free = rustix::fs::statvfs(present);
    LogPlace {
        min_free_bytes: log.limits().min_free_bytes,
        free_bytes: free
            .map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize))
            .map_err(|error| error.to_string()),
        is_writable: rustix::fs::access(present, Access::WRITE_OK | Access::EXEC_OK).is_ok(),
        directory,
    }
}

fn clock() -> Clock {
    let unix_s = |time: SystemTime| {
        time.duration_since(UNIX_EPOCH)
            .map_or(0, |time| time.as_secs())
    };
    let program = std::env::current_exe().and_then(fs::metadata);
    let written = program.and_then(|metadata| metadata.modified());
    Clock {
        unix_s: unix_s(SystemTime::now()),
        not_before_unix_s: written.map_or(0, unix_s),
        is_synchronized: Path::new(SYNCHRONIZED).exists(),
    }
}
