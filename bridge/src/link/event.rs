//! What happens on the link, and what commands are for.

use dsp_protocol::{Command, DspErrorCode, Status, StatusMask};
use ipc_types::MonotonicNs;

use super::line::Sent;
use serde::{Deserialize, Serialize};

use super::commands::AckData;
use super::session::StartupStep;

/// What a command is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Purpose {
    /// A step of the start-up sequence.
    StartUp(StartupStep),
    /// Is the DSP there, and does it still have our mask?
    Probe,
    /// A status is overdue or has another mask: does the DSP still have ours?
    StatusProbe {
        /// The mask of the status that came instead; `None` if none comes.
        instead: Option<StatusMask>,
    },
    /// The DSP has our mask, and is asked again to send status.
    ReactivateStatus,
    /// The DSP's mask changed without a reboot: it is written again.
    RewriteMask,
    /// Shows the DSP that the PC is there while the path buffer may hold something.
    KeepAlive,
    /// Empties the DSP's path buffer, because what it holds is not known.
    EmptyPath,
    /// For the flight.
    Flight(FlightCommand),
}

/// What a command of the flight does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FlightCommand {
    /// Writes the take-off altitude.
    WriteTakeOffAltitude,
    /// Reads the take-off altitude back: the DSP may have rebooted since.
    ReadTakeOffAltitude,
    /// Begins the take-off.
    TakeOff,
    /// Begins the landing.
    Land,
    /// Reads the port of the take-off or landing: it is 1 as long as that lasts.
    ReadMovement,
    /// Empties the DSP's error queue.
    ClearErrors,
    /// Reads how many waypoints the DSP took.
    CountWaypoints,
    /// Carries out a step of the parameter request under way.
    Parameter,
}

/// One status message, and when it came.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatusSample {
    /// The message without its implausible groups.
    pub status: Status,
    /// When its last byte was read.
    pub received: MonotonicNs,
    /// When that left the DSP.
    pub sent: Sent,
}

/// What happened on the link.
#[derive(Clone, Copy, Debug, PartialEq)]
// A sample is most of what comes, fifty times a second; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum LinkEvent {
    /// The start-up sequence is done: the DSP takes commands.
    Ready,
    /// The DSP has rebooted; the start-up sequence runs again.
    Rebooted,
    /// The DSP cannot be reached any more.
    Lost,
    /// A status sample in its place in time.
    Sample(StatusSample),
    /// One waypoint may be sent: the newest flow control of a read was a 1, and is not too old.
    Grant,
    /// The DSP's path buffer is known to be empty.
    PathEmptied,
    /// The DSP did not acknowledge that it empties its path buffer; the link goes on trying.
    PathNotEmptied,
    /// A command of the flight arrived at the DSP.
    Delivered(FlightCommand, AckData),
    /// A command of the flight was not acknowledged: an ack error.
    Undelivered(FlightCommand),
    /// The DSP may have taken the PC for gone and dropped the path, or the bridge stood still for that long.
    PathDropped,
    /// The DSP reports an error; `starting` while start-up is not done, when errors are to be expected.
    DspError {
        /// The error.
        code: DspErrorCode,
        /// Start-up is not done.
        starting: bool,
    },
    /// The DSP has another value than the one that was written at start-up: it refused the parameter.
    ParameterRefused {
        /// What was written.
        written: Command,
        /// What the DSP has.
        found: AckData,
    },
    /// The DSP has our mask and sends other groups all the same; they are taken as they come.
    OddStatus {
        /// The groups that it sends.
        groups: StatusMask,
    },
}
