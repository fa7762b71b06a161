//! `ril plan check | show | fly`: plans of other programs.
//!
//! The crate `plans` reads and checks them. Here is what it is given: the file, the configurations, and what the robot says of
//! itself (`gather`); how the results are shown (`report`, `table`); and how a plan is flown, step by step (`fly`).

mod fence;
mod file;
mod fly;
mod gather;
mod journal;
mod path_watch;
mod report;
mod table;

use std::io::{self, Write};

use runtime::exit::Failure;

use super::{configuration, json_line};
use crate::cli::{
    PlanCheckArgs, PlanCommand, PlanFileArgs, PlanLookArgs, PlanShowArgs, RobotChoice,
};
use crate::words::columns;
pub(crate) use file::read_file;
use file::{read, write_plan};
use gather::{Known, gather};
use report::Report;

/// `ril plan …`
///
/// # Errors
///
/// Code 2 when the file is no plan, 8 when a finding forbids the flight; `fly` as all requests, and 3 when there is no bridge.
pub fn plan(command: &PlanCommand, choice: RobotChoice) -> Result<(), Failure> {
    match command {
        PlanCommand::Check(args) => check(args),
        PlanCommand::Show(args) => show(args),
        PlanCommand::Fly(args) => fly::fly(args, choice),
    }
}

fn check(args: &PlanCheckArgs) -> Result<(), Failure> {
    let Some(known) = look(&args.plan, &args.look)? else {
        return Ok(());
    };
    let report = Report::new(&args.plan.file, &known);
    let mut out = io::stdout().lock();
    if args.look.json {
        report.write_json(&mut out)?;
    } else {
        write!(out, "{}", report.text(columns())).map_err(Failure::output)?;
    }
    report.verdict()
}

fn show(args: &PlanShowArgs) -> Result<(), Failure> {
    let Some(known) = look(&args.plan, &args.look)? else {
        return Ok(());
    };
    let rows = table::rows(&known);
    let mut out = io::stdout().lock();
    if args.look.json {
        for row in &rows {
            json_line(&mut out, row)?;
        }
        json_line(&mut out, &Report::new(&args.plan.file, &known).summary())?;
    } else {
        write!(out, "{}", table::text(&rows)).map_err(Failure::output)?;
    }
    match &args.to {
        Some(to) => write_plan(&known.plan, to),
        None => Ok(()),
    }
}

/// What `check` and `show` know of the plan; `None` if only the configuration was to be checked.
fn look(plan: &PlanFileArgs, look: &PlanLookArgs) -> Result<Option<Known>, Failure> {
    let Some(config) = configuration(&look.common)? else {
        return Ok(None);
    };
    let file = read(plan)?;
    let timeout = look.timeout.unwrap_or_else(|| config.observe.timeout());
    let session = match look.offline {
        true => None,
        false => Some(super::Session::join(&look.common)?),
    };
    let known = gather(file, plan, &config.plan, session.as_ref(), timeout, false)?;
    Ok(Some(known))
}
