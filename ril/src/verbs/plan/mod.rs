//! `ril plan check | show | fly`: plans of other programs.
//!
//! The crate `plans` reads and checks them. Here is what it is given: the file, the configurations, and what the robot
//! says of itself (`gather`); how the results are shown (`report`); and how a plan is flown, step by step (`fly`).

mod fly;
mod gather;

pub mod options;
mod progress;
mod report;

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use gather::{KnownPlan, gather, read};
use operator::render::json_line;
use operator::render::words::columns;
use operator::session::{Session, configuration};
use options::{PlanCheckArgs, PlanCommand, PlanFileArgs, PlanLookArgs, PlanShowArgs};
use plans::Plan;
use plans::write::to_qgc_plan;
use report::PlanReport;
use runtime::exit::{ExitCode, Failure};
use runtime::plain::{plain, plain_path};

/// `ril plan …`
///
/// # Errors
///
/// Code 2 when the file is no plan, 8 when a finding forbids the flight; `fly` as all requests, and 3 when there is no
/// bridge.
pub fn plan(command: &PlanCommand) -> Result<(), Failure> {
    match command {
        PlanCommand::Check(args) => check(args),
        PlanCommand::Show(args) => show(args),
        PlanCommand::Fly(args) => fly::fly(args),
    }
}

fn check(args: &PlanCheckArgs) -> Result<(), Failure> {
    let known = look(&args.plan, &args.look)?;
    let report = PlanReport::new(&args.plan.file, &known);
    let mut out = io::stdout().lock();
    if args.look.json {
        report.write_json(&mut out)?;
    } else {
        out.write_all(plain(&report.text(columns())).as_bytes())
            .map_err(Failure::output)?;
    }
    report.verdict()
}

fn show(args: &PlanShowArgs) -> Result<(), Failure> {
    let known = look(&args.plan, &args.look)?;
    let rows = report::rows(&known);
    let mut out = io::stdout().lock();
    if args.look.json {
        for row in &rows {
            json_line(&mut out, row)?;
        }
        json_line(
            &mut out,
            &PlanReport::new(&args.plan.file, &known).summary(),
        )?;
    } else {
        out.write_all(plain(&report::table(&rows)).as_bytes())
            .map_err(Failure::output)?;
    }
    match &args.to {
        Some(to) => write_plan(&known.plan, to),
        None => Ok(()),
    }
}

/// What `check` and `show` know of the plan.
fn look(plan: &PlanFileArgs, look: &PlanLookArgs) -> Result<KnownPlan, Failure> {
    let config = configuration(&look.common)?;
    let file = read(plan)?;
    let timeout = look.timeout.unwrap_or_else(|| config.observe.timeout());
    let session = match look.offline {
        true => None,
        false => Some(Session::join(&look.common)?),
    };
    gather(file, plan, &config.plan, session.as_ref(), timeout, false)
}

/// Writes a plan into a file that does not exist yet.
fn write_plan(plan: &Plan, to: &Path) -> Result<(), Failure> {
    let name = plain_path(to);
    let text = to_qgc_plan(plan).map_err(|error| {
        Failure::new(
            ExitCode::NotInOrder,
            format!("{name} was not written: {error}"),
        )
    })?;
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(to)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => Failure::usage(format!("{name} exists already"))
                .with_next_step("remove it, or name another file with --to"),
            _ => Failure::usage(format!("{name} was not written: {error}")),
        })
}
