//! [`ParameterRequests`]: the requests to read and write ports that are open.

use std::collections::VecDeque;

use dsp_protocol::Command;
use dsp_protocol::port::Port;
use ipc_types::code::Stage;
use serde::{Deserialize, Serialize};

use super::request::RequestHeader;

/// Parameter requests that may be open at once. One more is refused with `too-many-requests`.
pub const MAX_OPEN: usize = 8;

/// Requests to read and write ports.
#[derive(Debug, Serialize, Deserialize)]
pub struct ParameterRequests {
    /// The first one is with the DSP.
    pub(super) open: VecDeque<Job>,
}

/// A request to read or write a port.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Job {
    pub header: RequestHeader,
    #[serde(with = "super::port_number")]
    pub port: Port,
    /// The command that writes the port; `None` if it is only read.
    pub write: Option<Command>,
    /// The write was acknowledged, and the port is being read.
    pub is_written: bool,
}

impl ParameterRequests {
    /// None.
    pub fn new() -> Self {
        ParameterRequests {
            open: VecDeque::with_capacity(MAX_OPEN),
        }
    }

    /// The requests that have had no final report.
    pub fn open(&self) -> impl Iterator<Item = &RequestHeader> {
        self.open.iter().map(|job| &job.header)
    }
}

impl Default for ParameterRequests {
    fn default() -> Self {
        ParameterRequests::new()
    }
}

impl Job {
    /// A write that was sent may have been carried out.
    pub fn stage_of_failure(&self) -> Stage {
        if self.write.is_some() {
            Stage::Unknown
        } else {
            Stage::Aborted
        }
    }
}
