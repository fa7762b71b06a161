//! `ril plan check | show | fly`: plans of other programs.
//!
//! The crate `plans` reads and checks them. Here is what it is given: the file, the configurations, and what the robot says of
//! itself (`gather`); how the results are shown (`report`, `table`); and how a plan is flown, step by step (`fly`).

mod fence;
mod fly;
mod gather;
mod journal;
mod path_watch;
mod report;
mod table;
mod text;

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::Path;

use plans::Plan;
use plans::limits::MAX_FILE_BYTES;
use plans::model::StatedAltitudes;
use plans::write::to_qgc_plan;
use runtime::exit::{ExitCode, Failure};

use super::{configuration, json_line};
use crate::cli::{
    PlanCheckArgs, PlanCommand, PlanFileArgs, PlanLookArgs, PlanShowArgs, RobotChoice,
};
use gather::{Known, gather};
use report::Report;
use text::columns;

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

/// What `check` and `show` know of the plan; nothing when only the configuration was to be checked.
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

/// Reads the file of a plan.
///
/// # Errors
///
/// Code 2 when the file cannot be read, or is no plan.
pub(super) fn read_file(file: &Path) -> Result<Plan, Failure> {
    let name = file.display();
    let mut bytes = Vec::new();
    // One byte more than allowed tells a file that is too long.
    File::open(file)
        .and_then(|file| {
            let limit = MAX_FILE_BYTES as u64 + 1;
            file.take(limit).read_to_end(&mut bytes)
        })
        .map_err(|error| Failure::usage(format!("{name}: cannot be read: {error}")))?;
    plans::read(file, &bytes).map_err(|error| Failure::usage(format!("{name}: {error}")))
}

/// Reads a plan, and says of it what the command line says.
fn read(args: &PlanFileArgs) -> Result<Plan, Failure> {
    let name = args.file.display();
    let mut plan = read_file(&args.file)?;
    if args.from as usize > plan.items.len().max(1) {
        return Err(Failure::usage(format!(
            "--from {}: {name} has {} items; `ril plan show {name}` lists them",
            args.from,
            plan.items.len()
        )));
    }
    plan.state_altitudes(&StatedAltitudes {
        reference: args.altitude_is.map(|name| name.reference()),
        missing: args.altitude,
    });
    Ok(plan)
}

/// Writes a plan into a file that does not exist yet.
fn write_plan(plan: &Plan, to: &Path) -> Result<(), Failure> {
    let name = to.display();
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
        .map_err(|error| {
            Failure::usage(format!("{name} was not written: {error}; name a new file"))
        })
}
