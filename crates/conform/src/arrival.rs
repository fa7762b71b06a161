//! What comes from the DSP, and messages of both directions in words.

use std::time::Duration;

use dsp_protocol::{
    Command, DecodeError, Downlink, DspErrorCode, FlowControl, Sequence, Status, Uplink,
};

/// What came from the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// When its last byte was seen.
    pub at: Duration,
    /// A message, or bytes that were rejected.
    pub event: Result<Downlink, DecodeError>,
    /// Its number in the extended profile.
    pub sequence: Option<Sequence>,
    /// Of an acknowledgement in the extended profile: the number of the command.
    pub acknowledges: Option<Sequence>,
}

impl Arrival {
    /// The acknowledgement; `None` if it is none.
    pub fn ack(&self) -> Option<Downlink> {
        self.event.ok().filter(is_ack)
    }

    /// The status; `None` if it is none.
    pub fn status(&self) -> Option<Status> {
        match self.event {
            Ok(Downlink::Status(status)) => Some(status),
            _ => None,
        }
    }

    /// The flow control; `None` if it is none.
    pub fn flow(&self) -> Option<FlowControl> {
        match self.event {
            Ok(Downlink::FlowControl(flow)) => Some(flow),
            _ => None,
        }
    }

    /// The code of an error of the link; `None` if it is none, or an error of the DSP's own hardware.
    pub fn link_error(&self) -> Option<u16> {
        match self.event {
            Ok(Downlink::Error(DspErrorCode(code @ (15 | 30 | 100 | 102)))) => Some(code),
            _ => None,
        }
    }
}

fn is_ack(message: &Downlink) -> bool {
    matches!(
        message,
        Downlink::Ack { .. } | Downlink::Ack16 { .. } | Downlink::Ack32 { .. }
    )
}

/// A command in words.
pub fn describe_command(command: &Command) -> String {
    match command {
        Command::Read16 { port } => format!("read {port}"),
        Command::Write16 { port, value } => format!("write {port}: {value}"),
        Command::Read32 { port } => format!("read {port} (32 bits)"),
        Command::Write32 { port, value } => format!("write {port}: {value} (32 bits)"),
        Command::ClearErrors => "clear errors".to_owned(),
        Command::ActivateStatus => "activate status transmission".to_owned(),
        Command::InvalidatePath => "invalidate path".to_owned(),
        Command::Following { on: true } => "following on".to_owned(),
        Command::Following { on: false } => "following off".to_owned(),
    }
}

/// A message in words.
pub fn describe_uplink(message: &Uplink) -> String {
    match message {
        Uplink::Command(command) => describe_command(command),
        Uplink::Waypoint(waypoint) => format!(
            "waypoint {} {} {}",
            waypoint.latitude_deg, waypoint.longitude_deg, waypoint.altitude_m
        ),
    }
}

/// A message in words.
pub fn describe_downlink(message: &Downlink) -> String {
    match message {
        Downlink::Status(status) => {
            let time = match status.time_ms {
                Some(time) => format!("time {time} ms, "),
                None => String::new(),
            };
            format!(
                "status: mask 0x{:04X}, {time}flag {}",
                status.mask().0,
                u8::from(status.flying)
            )
        }
        Downlink::FlowControl(FlowControl::Send) => "flow control 1".to_owned(),
        Downlink::FlowControl(FlowControl::Stop) => "flow control 0".to_owned(),
        Downlink::Ack { command } => format!("command {command} is acknowledged"),
        Downlink::Ack16 { command, value } => format!("command {command}: {value}"),
        Downlink::Ack32 { command, value } => format!("command {command}: {value}"),
        Downlink::Error(code) => code.to_string(),
    }
}
