//! [`Encoder`]: records to bytes.

use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport, SharedStruct};
use module_kit::journal::bytes::{put_bytes, put_changes, put_number, put_signed};

use super::record::{Input, Kind};
use crate::flight::request::RequestKey;

/// Writes records. Times and samples are written as what has changed since the record before, so all records of a journal go
/// through one encoder, beginning with a snapshot.
#[derive(Clone, Debug, Default)]
pub struct Encoder {
    at: MonotonicNs,
    telemetry: DspTelemetry,
    state: ModuleState,
}

impl Encoder {
    /// Before the first snapshot.
    pub fn new() -> Encoder {
        Encoder::default()
    }

    /// Appends a snapshot. Whatever was written before is forgotten.
    pub fn snapshot(&mut self, at: MonotonicNs, snapshot: &[u8], out: &mut Vec<u8>) {
        *self = Encoder {
            at,
            ..Encoder::default()
        };
        out.push(Kind::Snapshot as u8);
        put_number(out, at.0);
        put_number(out, snapshot.len() as u64);
        put_changes(out, &vec![0; snapshot.len()], snapshot);
    }

    /// Appends an input.
    pub fn input(&mut self, at: MonotonicNs, input: &Input<'_>, out: &mut Vec<u8>) {
        out.push(input.kind() as u8);
        put_signed(out, at.0.wrapping_sub(self.at.0) as i64);
        self.at = at;
        match input {
            Input::Received(bytes) => out.extend_from_slice(bytes),
            Input::Control {
                key,
                sender,
                request,
            } => put_request(out, *key, *sender, request),
            Input::NewFence {
                key,
                sender,
                request,
                fence,
            } => {
                put_request(out, *key, *sender, request);
                match fence {
                    Ok(fence) => {
                        out.push(1);
                        // A fence comes from such a text, so it can be written as one.
                        put_bytes(out, toml::to_string(fence).unwrap_or_default().as_bytes());
                    }
                    Err(reason) => {
                        out.push(0);
                        put_number(out, reason.code().into());
                    }
                }
            }
            Input::Movement {
                key,
                sender,
                request,
            } => put_request(out, *key, *sender, request),
            Input::Parameter {
                key,
                sender,
                request,
            } => put_request(out, *key, *sender, request),
            Input::SenderGone(key) => put_key(out, *key),
            Input::Transmitted(count) => put_number(out, *count as u64),
            Input::PortOpened
            | Input::PortClosed
            | Input::Advance
            | Input::WindDown
            | Input::Close
            | Input::Transmit
            | Input::DiscardUnsent => {}
        }
    }

    /// Appends a telemetry sample; what its publisher counts is left out.
    pub fn telemetry(&mut self, sample: &DspTelemetry, out: &mut Vec<u8>) {
        let sample = DspTelemetry {
            sequence: 0,
            epoch_ns: 0,
            ..*sample
        };
        out.push(Kind::Telemetry as u8);
        put_changes(out, self.telemetry.bytes(), sample.bytes());
        self.telemetry = sample;
    }

    /// Appends a state; what its publisher counts is left out.
    pub fn state(&mut self, state: &ModuleState, out: &mut Vec<u8>) {
        let state = ModuleState {
            sequence: 0,
            epoch_ns: 0,
            published_ns: 0,
            ..*state
        };
        out.push(Kind::State as u8);
        put_changes(out, self.state.bytes(), state.bytes());
        self.state = state;
    }

    /// Appends a report.
    pub fn report(&mut self, to: RequestKey, report: &RequestReport, out: &mut Vec<u8>) {
        out.push(Kind::Report as u8);
        put_key(out, to);
        put_struct(out, report);
    }

    /// Appends bytes that the port took.
    pub fn sent(&mut self, bytes: &[u8], out: &mut Vec<u8>) {
        out.push(Kind::Sent as u8);
        out.extend_from_slice(bytes);
    }
}

fn put_key(out: &mut Vec<u8>, key: RequestKey) {
    let (service, ticket) = match key {
        RequestKey::Control(ticket) => (0, ticket),
        RequestKey::Movement(ticket) => (1, ticket),
        RequestKey::Parameter(ticket) => (2, ticket),
    };
    out.push(service);
    put_number(out, ticket);
}

fn put_request<R: SharedStruct>(
    out: &mut Vec<u8>,
    key: RequestKey,
    sender: Option<u32>,
    request: &R,
) {
    put_key(out, key);
    // No process has the id 0.
    put_number(out, sender.unwrap_or_default().into());
    put_struct(out, request);
}

fn put_struct<T: SharedStruct>(out: &mut Vec<u8>, value: &T) {
    put_changes(out, T::ZERO.bytes(), value.bytes());
}
