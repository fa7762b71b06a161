//! Files of plans: read, and written.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;

use plans::Plan;
use plans::limits::MAX_FILE_BYTES;
use plans::model::StatedAltitudes;
use plans::write::to_qgc_plan;
use runtime::exit::{ExitCode, Failure};

use crate::cli::PlanFileArgs;

/// Reads the file of a plan.
///
/// # Errors
///
/// Code 2 when the file cannot be read, or is no plan.
pub(crate) fn read_file(file: &Path) -> Result<Plan, Failure> {
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
pub(super) fn read(args: &PlanFileArgs) -> Result<Plan, Failure> {
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
pub(super) fn write_plan(plan: &Plan, to: &Path) -> Result<(), Failure> {
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
