//! `ril plan fly --fence`: the plan's own fence goes into the bridge's configuration, and the bridge reads it.
//!
//! [`fence_file`](crate::fence_file) says which areas make way for which.

use std::path::Path;
use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, ModuleState};
use ipc_types::{MonotonicNs, fresh_request_id};
use plans::model::FenceArea;
use runtime::exit::{ExitCode, Failure};

use crate::fence_file::{FenceChange, FenceFileError};
use crate::render::messages::Verb;
use crate::request::{Conversation, Format, Until};
use crate::session::{Latest, Session};

/// Puts the areas into `file`, and in force. When the bridge does not take them, the file is as before.
///
/// # Errors
///
/// Code 2 when there is nothing to put, or it would make the fence wider; 5 when the bridge refuses it or reads another file.
pub fn put(
    areas: &[FenceArea],
    file: &Path,
    session: &Session,
    timeout: Duration,
    format: Format,
) -> Result<(), Failure> {
    if areas.is_empty() {
        return Err(Failure::usage("--fence: the plan has no fence of its own"));
    }
    let change = FenceChange::put(file, areas).map_err(|error| match error {
        FenceFileError::Read { .. } => Failure::usage(error.to_string()),
        FenceFileError::Configuration(error) => error.into(),
        FenceFileError::Write { .. } => {
            Failure::usage(format!("--fence: {error}; the fence is as before"))
        }
        error => Failure::usage(format!("--fence: {error}")),
    })?;
    let count = change.areas as u32;
    let taken =
        reload(session, timeout, format).and_then(|()| await_areas(session, timeout, count, file));
    if taken.is_err() {
        change
            .take_back()
            .map_err(|error| Failure::usage(format!("--fence: {error}")))?;
        // The bridge may have read the file in between.
        let _ = reload(session, timeout, Format::Silent);
    }
    taken
}

fn reload(session: &Session, timeout: Duration, format: Format) -> Result<(), Failure> {
    let request = ModuleControl::new(fresh_request_id(), ControlCommand::ReloadFence);
    Conversation::<ModuleControl>::open(session, Verb::ReloadFence, timeout)?
        .follow(&[request], Until::Final, format)
        .map(drop)
}

/// The bridge publishes how many areas are in force: another number means that it has read another file.
fn await_areas(
    session: &Session,
    timeout: Duration,
    count: u32,
    file: &Path,
) -> Result<(), Failure> {
    let mut state = Latest::<ModuleState>::open(&session.ipc)?;
    let areas = |state: &Latest<ModuleState>| {
        let sample = state.sample.as_ref();
        sample.map(|state| state.safety.fence_areas)
    };
    let give_up = MonotonicNs::now() + timeout;
    let is_in_force = |state: &mut Latest<ModuleState>, _| Ok(areas(state) == Some(count));
    if session.gather(&mut state, give_up, is_in_force)? {
        return Ok(());
    }
    let text = format!(
        "--fence: the bridge has {} areas in force instead of {count}, so it does not read {}; it is as before. Name the file that the \
         bridge was started with: `--bridge FILE`",
        areas(&state).unwrap_or_default(),
        file.display()
    );
    Err(Failure::new(ExitCode::Refused, text))
}
