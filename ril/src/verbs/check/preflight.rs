//! `ril preflight`: whether a robot is ready to take off, and what `ril start` says of that before it starts.
//!
//! What the machine is like comes from the doctor and is not judged a second time. [`judge`] is pure: the same facts
//! give the same findings. [`PreflightLimits`] is `[preflight]` of `ril.toml`.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, ParameterRequest};
use ipc_types::{MonotonicNs, Request, Topic, fresh_request_id};
use operator::config::{Config, PreflightLimits};
use operator::render::finding::lines;
use operator::render::messages::Verb;
use operator::render::print_as;
use operator::render::words::{count, wrap};
use operator::request::{Conversation, Format, Until};
use operator::robot::domain::{Looking, Namespace};
use operator::robot::running::ConfigOrigin;
use operator::session::{Latest, Session, configuration, is_relayed};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure};
use runtime::finding::{Finding, Severity};
use serde::{Serialize, Serializer};

use super::facts::{Live, Logs, PreflightFacts};
use super::helicopter::GROUND;
use super::services::process;
use super::{HEADING, gather, helicopter, machine, robot, width};
use super::{MachineArgs, PreflightArgs};

/// How long `ril start` waits for samples that it goes by: twice the period of the module's state. A start is not held
/// up by what is missing.
const START_TIMEOUT: Duration = Duration::from_millis(500);

/// How long it waits for what the machine is like: a disk that hangs does not hold up a start either.
const MACHINE_TIMEOUT: Duration = Duration::from_secs(1);

/// `ril preflight`
///
/// # Errors
///
/// Code 8 when a check failed or could not be made, and with `--strict` when one warns.
pub fn preflight(args: &PreflightArgs) -> Result<(), Failure> {
    let common = &args.machine.common;
    let config = configuration(common)?;
    let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
    // A domain that cannot be joined is one of the findings.
    let session = Session::join(common).ok();
    let live = match &session {
        Some(session) => Live {
            answer: answer(session, timeout)?,
            ..live(session, timeout)?
        },
        None => Live::default(),
    };
    let report = report(&args.machine, live, &config);
    print_as(args.json, &report, report.text(width(&io::stdout())))?;
    let is_ready = match report.worst() {
        Severity::Note => true,
        Severity::Warning => !args.strict,
        Severity::Error => false,
    };
    if is_ready {
        return Ok(());
    }
    let text = format!("{}; each says what to do", report.summary());
    Err(Failure::new(ExitCode::NotInOrder, text))
}

/// Says on standard error what is not in order, before a start that goes on whatever it is.
pub(crate) fn warn(session: &Session, common: &CommonArgs, config: &Config) -> Result<(), Failure> {
    // The start itself says that there is no bridge.
    if !session.is_provided(ModuleState::KEY)? {
        return Ok(());
    }
    let live = Live {
        // The start is a request, too, and says by itself when it gets no answer.
        answer: Some(Ok(())),
        ..live(session, START_TIMEOUT)?
    };
    let machine = MachineArgs {
        common: common.clone(),
        bridge: None,
        status: None,
        port: None,
    };
    let config = config.clone();
    let looking = Looking::start(move || report(&machine, live, &config));
    match looking.end(MACHINE_TIMEOUT) {
        Ok(report) => (report.warnings().iter()).for_each(|line| tracing::warn!("{line}")),
        Err(trouble) => tracing::warn!(
            "whether the robot is ready is not known: a look at this machine {trouble}; is a disk gone?"
        ),
    }
    Ok(())
}

/// Looks at the machine and judges all.
fn report(args: &MachineArgs, live: Live, config: &Config) -> PreflightReport {
    // The samples were looked at just now; the looks at the machine may take seconds.
    let now = MonotonicNs::now();
    let (machine, bridge) = gather::machine(args, None, false);
    let status = machine.domain.as_ref().ok();
    let status = status.and_then(|domain| process(domain, machine.robot, "status"));
    let status_folder = status
        .filter(|status| status.pids == Namespace::Ours)
        .map(|status| PathBuf::from(format!("/proc/{}/cwd", status.by.pid)));
    let mut files = machine.files.iter();
    let status_file = files.find(|file| file.command == Some("status"));
    let status_file = status_file.filter(|file| !file.is_absent());
    let (bridge, bridge_origin) = bridge.unzip();
    let facts = PreflightFacts {
        robot: machine.robot,
        now,
        bridge,
        bridge_origin: bridge_origin.unwrap_or(ConfigOrigin::Running),
        logs: match status_file {
            Some(file) => gather::logs(file.path.clone(), status_folder),
            None => Logs::NoFile,
        },
        machine,
        live,
    };
    PreflightReport::new(facts.robot, judge(&facts, &config.preflight))
}

/// Waits for the newest sample of each topic that is to be expected.
fn live(session: &Session, timeout: Duration) -> Result<Live, Failure> {
    let state = Latest::<ModuleState>::open(&session.ipc)?;
    let dsp = Latest::<DspTelemetry>::open(&session.ipc)?;
    let hero = Latest::<HeroTelemetry>::open(&session.ipc)?;
    let mut newest = (state, (dsp, hero));
    let give_up = MonotonicNs::now() + timeout;
    // Nothing is to be expected without a bridge; telemetry when it has published some, the robot's when there is a
    // status.
    session.gather(&mut newest, give_up, |(state, (dsp, hero)), _| {
        let Some(state) = &state.sample else {
            return Ok(!session.is_provided(ModuleState::KEY)?);
        };
        let is_silent = state.link.telemetry_published == 0;
        Ok(is_silent
            || dsp.sample.is_some()
                && (hero.sample.is_some() || !session.is_provided(HeroTelemetry::KEY)?))
    })?;
    let (state, (dsp, hero)) = newest;
    let provider = session.provider(ModuleState::KEY)?;
    Ok(Live {
        state: state.sample,
        dsp: dsp.sample,
        hero: hero.sample,
        answer: None,
        is_relayed: provider.is_some_and(|provider| is_relayed(ModuleState::KEY, &provider)),
    })
}

/// Asks the bridge for the description of its first port, which it gives without the DSP. It answers to that as it does
/// to an order.
fn answer(session: &Session, timeout: Duration) -> Result<Option<Result<(), String>>, Failure> {
    if !session.is_provided(ParameterRequest::KEY)? {
        return Ok(None);
    }
    let request = ParameterRequest::list(fresh_request_id(), 0);
    let answer = Conversation::open(session, Verb::ListParameters, timeout)
        .and_then(|mut bridge| bridge.follow(&[request], Until::Final, Format::Silent));
    Ok(Some(
        answer
            .map(drop)
            .map_err(|failure| failure.chain().join(": ")),
    ))
}

/// What the facts mean, in the order in which an operator sets things right: processes, link, helicopter, rules,
/// machine.
pub fn judge(facts: &PreflightFacts, limits: &PreflightLimits) -> Vec<Finding> {
    let mut checks = robot::judge(facts, limits);
    checks.extend(helicopter::judge(facts, limits));
    checks.extend(machine::judge(facts, limits));
    let does_without = |check: &Finding| limits.may_be_unchecked.iter().any(|id| id == check.id);
    checks
        .into_iter()
        .map(|check| match does_without(&check) {
            true => check.may_be_unchecked(),
            false => check,
        })
        .collect()
}

/// What the preflight found, as text for people and as JSON for programs.
#[derive(Clone, Debug, Serialize)]
pub struct PreflightReport {
    schema: &'static str,
    robot: u32,
    verdict: &'static str,
    failed: usize,
    warned: usize,
    passed: usize,
    /// Checks that could not be made, whatever they count as.
    unchecked: usize,
    #[serde(serialize_with = "objects")]
    checks: Vec<Finding>,
}

/// A check for programs.
#[derive(Serialize)]
struct CheckObject<'a> {
    id: &'a str,
    /// `None` if the check could not be made, and the operator does not do without it.
    verdict: Option<&'static str>,
    checked: bool,
    value: &'a str,
    limit: Option<&'a str>,
    next_step: Option<&'a str>,
}

fn objects<S: Serializer>(checks: &[Finding], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(checks.iter().map(|check| CheckObject {
        id: check.id,
        verdict: (!check.is_unmade()).then(|| verdict(check.severity)),
        checked: check.is_checked,
        value: &check.text,
        limit: check.limit.as_deref(),
        next_step: check.next_step.as_deref(),
    }))
}

fn verdict(severity: Severity) -> &'static str {
    match severity {
        Severity::Note => "pass",
        Severity::Warning => "warn",
        Severity::Error => "fail",
    }
}

/// The worst of `checks`. What was not checked is not ready.
pub fn worst(checks: &[Finding]) -> Severity {
    let worst = checks.iter().map(|check| check.severity).max();
    worst.unwrap_or(Severity::Error)
}

impl PreflightReport {
    /// A report of `checks`.
    pub fn new(robot: u32, checks: Vec<Finding>) -> PreflightReport {
        let number = |is_counted: fn(&Finding) -> bool| {
            checks.iter().filter(|check| is_counted(check)).count()
        };
        PreflightReport {
            schema: "ril.Preflight.v1",
            robot,
            verdict: verdict(worst(&checks)),
            failed: number(Finding::has_failed),
            warned: number(|check| check.severity == Severity::Warning),
            passed: number(|check| check.severity == Severity::Note),
            unchecked: number(|check| !check.is_checked),
            checks,
        }
    }

    /// The worst of all.
    pub fn worst(&self) -> Severity {
        worst(&self.checks)
    }

    /// The names of the checks that are `wanted`, separated by commas.
    fn ids(&self, wanted: fn(&Finding) -> bool) -> String {
        let checks = self.checks.iter().filter(|check| wanted(check));
        checks.map(|check| check.id).collect::<Vec<_>>().join(", ")
    }

    /// All of it in a few words.
    pub fn summary(&self) -> String {
        let warnings = count(self.warned, "warning");
        let text = format!("{} failed, {warnings}, {} passed", self.failed, self.passed);
        match self.unchecked {
            0 => text,
            number => {
                let ids = self.ids(|check| !check.is_checked);
                format!("{text}, {number} not checked: {ids}")
            }
        }
    }

    /// A line for each check, one for what to do where it did not pass, and a summary; no line is longer than `columns`
    /// if its words allow it.
    pub fn text(&self, columns: usize) -> String {
        let mut text = format!("robot {}\n", self.robot);
        for check in &self.checks {
            text += &lines(check, check.id, HEADING, columns);
        }
        let is_up = |check: &Finding| check.id == GROUND && check.severity == Severity::Warning;
        let readiness = match self.worst() {
            Severity::Note | Severity::Warning if self.checks.iter().any(is_up) => "in the air",
            Severity::Note => "ready to take off",
            Severity::Warning => "ready to take off, with warnings",
            Severity::Error => "NOT ready to take off",
        };
        text + &wrap(&format!("{readiness}: "), &self.summary(), columns)
    }

    /// What a command that starts something says of the checks on standard error: each failure, and the names of the
    /// warnings.
    pub fn warnings(&self) -> Vec<String> {
        let failed = self.checks.iter().filter(|check| check.has_failed());
        let mut lines: Vec<String> = failed
            .map(|check| format!("not ready to take off: {}: {}", check.id, check.text))
            .collect();
        for (text, ids) in [
            (
                "not ready to take off, not checked",
                self.ids(Finding::is_unmade),
            ),
            (
                "warnings",
                self.ids(|check| check.severity == Severity::Warning),
            ),
        ] {
            if !ids.is_empty() {
                lines.push(format!("{text}: {ids}"));
            }
        }
        // The last line says where to read on.
        if let Some(last) = lines.last_mut() {
            *last += "; `ril preflight` says what to do";
        }
        lines
    }
}
