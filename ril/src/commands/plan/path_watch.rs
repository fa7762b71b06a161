//! Which waypoints of a path have been reached, while it is flown.

use std::io::{self, Write};

use ipc_types::payload::ModuleState;
use ipc_types::{Source, Subscriber};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::super::conversation::Companion;
use super::super::{Session, json_line};
use super::journal::Journal;
use crate::words::distance;

/// Tells which waypoints of a path have been reached, from the bridge's published state.
pub struct PathWatch<'a> {
    states: Subscriber<ModuleState>,
    path_id: u64,
    journal: &'a mut Journal,
    json: bool,
}

impl<'a> PathWatch<'a> {
    /// Watches the path with this id.
    ///
    /// # Errors
    ///
    /// When the bridge's state cannot be subscribed to.
    pub fn open(
        session: &Session,
        path_id: u64,
        journal: &'a mut Journal,
        json: bool,
    ) -> Result<PathWatch<'a>, Failure> {
        Ok(PathWatch {
            states: session.ipc.subscriber().or_fail(ExitCode::Internal)?,
            path_id,
            journal,
            json,
        })
    }

    /// So many waypoints were reached; the rest is so long.
    ///
    /// # Errors
    ///
    /// When standard output cannot be written.
    pub fn reached(&mut self, count: usize, to_go_m: Option<f64>) -> Result<(), Failure> {
        let items = self.journal.reached(count);
        let mut out = io::stdout().lock();
        if self.json {
            return match items.is_empty() {
                true => Ok(()),
                false => json_line(&mut out, &self.journal.event("reached")),
            };
        }
        for item in items {
            let to_go = to_go_m.map_or(String::new(), |metres| {
                format!(", {} to go", distance(metres))
            });
            writeln!(out, "plan: item {item} reached{to_go}").map_err(Failure::output)?;
        }
        Ok(())
    }
}

impl Companion for PathWatch<'_> {
    fn source(&mut self) -> &mut dyn Source {
        &mut self.states
    }

    fn look(&mut self) -> Result<(), Failure> {
        let mut newest = None;
        let path_id = self.path_id;
        self.states
            .drain(|state| {
                if state.movement.path_id == path_id {
                    newest = Some(state.movement);
                }
            })
            .or_fail(ExitCode::Internal)?;
        let Some(movement) = newest else {
            return Ok(());
        };
        let to_go_m =
            (movement.distance_valid == 1).then_some(f64::from(movement.distance_to_go_m));
        self.reached(movement.waypoints_reached as usize, to_go_m)
    }
}
