//! [`Request`]: what processes ask the bridge for, whatever its service.

use ipc_types::MonotonicNs;
use ipc_types::payload::{ModuleControl, MovementData, ParameterRequest, SharedStruct};

use crate::plant::Plant;

/// A request to the bridge.
#[derive(Clone, Copy, Debug)]
pub enum Request {
    Movement(MovementData),
    Control(ModuleControl),
    Parameter(ParameterRequest),
}

/// When an order was issued, by whose clock, until when it may begin, and after which.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stamp {
    pub issued: MonotonicNs,
    pub begin_by: Option<MonotonicNs>,
    pub after: u64,
}

impl Request {
    pub fn id(&self) -> u64 {
        match self {
            Request::Movement(data) => data.request_id,
            Request::Control(data) => data.request_id,
            Request::Parameter(data) => data.request_id,
        }
    }

    pub fn movement(&self) -> Option<MovementData> {
        match self {
            Request::Movement(data) => Some(*data),
            Request::Control(_) | Request::Parameter(_) => None,
        }
    }

    /// Which service of the relay's orders takes it.
    pub fn service(&self) -> u64 {
        match self {
            Request::Movement(_) => 0,
            Request::Control(_) => 1,
            Request::Parameter(_) => 2,
        }
    }

    pub fn bytes(&self) -> Vec<u8> {
        match self {
            Request::Movement(data) => data.bytes().to_vec(),
            Request::Control(data) => data.bytes().to_vec(),
            Request::Parameter(data) => data.bytes().to_vec(),
        }
    }

    pub fn read(service: u64, bytes: &[u8]) -> Option<Request> {
        match service {
            0 => MovementData::from_bytes(bytes).map(Request::Movement),
            1 => ModuleControl::from_bytes(bytes).map(Request::Control),
            _ => ParameterRequest::from_bytes(bytes).map(Request::Parameter),
        }
    }

    pub fn stamped(self, stamp: Stamp) -> Request {
        let (issued_ns, after) = (stamp.issued.0, stamp.after);
        let begin_by_ns = stamp.begin_by.unwrap_or_default().0;
        match self {
            Request::Movement(data) => Request::Movement(MovementData {
                issued_ns,
                begin_by_ns,
                after,
                ..data
            }),
            Request::Control(data) => Request::Control(ModuleControl {
                issued_ns,
                begin_by_ns,
                after,
                ..data
            }),
            Request::Parameter(data) => Request::Parameter(ParameterRequest {
                issued_ns,
                begin_by_ns,
                after,
                ..data
            }),
        }
    }

    /// A copy of it, which says that it is one; `None` where the request has no field for that.
    pub fn copy(self, plant: Plant) -> Option<Request> {
        match (self, plant) {
            (Request::Parameter(data), Plant::ParameterCopies) => {
                Some(Request::Parameter(ParameterRequest {
                    request_id: data.request_id + COPY,
                    ..data
                }))
            }
            (Request::Control(_) | Request::Parameter(_), _) => None,
            (Request::Movement(data), Plant::CopyIsNew) => Some(Request::Movement(MovementData {
                request_id: data.request_id + COPY,
                path_id: data.path_id + u64::from(data.path_id > 0) * COPY,
                ..data
            })),
            (Request::Movement(data), _) => {
                Some(Request::Movement(MovementData { repeat: 1, ..data }))
            }
        }
    }
}

/// By how much the id of a copy is higher that a planted fault takes for an order of its own.
pub const COPY: u64 = 1_000_000;
