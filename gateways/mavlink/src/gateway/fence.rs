//! The geofence of the bridge, for stations.

use ipc_types::MonotonicNs;
use ipc_types::payload::BridgeOutline;

use super::Gateway;
use crate::message::{MISSION_ACK, MISSION_COUNT};
use crate::number::{MISSION_TYPE_FENCE, MissionResult, Severity};
use crate::received::MissionRequest;
use crate::stations::Sender;
use crate::wire::Message;

impl Gateway {
    /// A piece of what the bridge holds has come.
    pub fn outline(&mut self, piece: &BridgeOutline) {
        self.fence.take(piece);
    }

    /// What a station asks about the geofence: it can read it, and not change it.
    pub(super) fn fence(&mut self, sender: Sender, request: &MissionRequest, now: MonotonicNs) {
        let state = self.vehicle.last_state();
        match *request {
            MissionRequest::List => match self.fence.read_by(sender, state) {
                Some(count) => {
                    let message = Message::new(MISSION_COUNT).u16(count);
                    let message = message.u8(sender.system).u8(sender.component);
                    self.send(sender.address, &message.u8(MISSION_TYPE_FENCE));
                }
                None => {
                    let why = "the fence is not known: the bridge has not said it";
                    self.refuse_fence(sender, MissionResult::Error, why, now);
                }
            },
            MissionRequest::Request(sequence) => match self.fence.item(sender, sequence) {
                Some(item) => self.send(sender.address, &item.message(sequence, sender)),
                None => {
                    let why = "the fence has no such item: ask for its list anew";
                    self.refuse_fence(sender, MissionResult::InvalidSequence, why, now);
                }
            },
            MissionRequest::Ack(_) => self.fence.forget(sender),
            MissionRequest::Clear => {
                let outline = self.fence.in_force(state);
                match outline.is_some_and(|outline| outline.areas.is_empty()) {
                    true => self.acknowledge_fence(sender, MissionResult::Accepted),
                    false => {
                        let why = "the fence is never removed over MAVLink: edit bridge.toml, then `ril fence reload`";
                        self.refuse_fence(sender, MissionResult::Denied, why, now);
                    }
                }
            }
            // Items that were not asked for.
            MissionRequest::Item(..) | MissionRequest::SetCurrent(_) => {}
            MissionRequest::Count(_) => {
                let why =
                    "a fence is not taken over MAVLink: `ril plan fly --fence` adds that of a plan";
                self.refuse_fence(sender, MissionResult::Denied, why, now);
            }
        }
    }

    fn acknowledge_fence(&mut self, sender: Sender, result: MissionResult) {
        let message = Message::new(MISSION_ACK);
        let message = message.u8(sender.system).u8(sender.component);
        let message = message.u8(result as u8).u8(MISSION_TYPE_FENCE);
        self.send(sender.address, &message);
    }

    fn refuse_fence(&mut self, sender: Sender, result: MissionResult, why: &str, now: MonotonicNs) {
        self.acknowledge_fence(sender, result);
        self.say(&[sender.address], Severity::Error, why, now);
    }
}
