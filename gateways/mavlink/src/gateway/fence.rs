//! The geofence of the bridge, for stations; and that of a station, for the bridge. What becomes of it when its items are there:
//!
//! | step | the file is written | it is not | the bridge has read it | it has not | the bridge says this fence | 4 s have passed |
//! |---|---|---|---|---|---|---|
//! | writing | → reloading | refused | – | – | – | taken back, refused |
//! | reloading | – | – | → watching | taken back, refused | – | taken back, refused |
//! | watching | – | – | – | – | accepted | taken back, refused |

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::BridgeOutline;

use super::Gateway;
use crate::areas::{FenceRefusal, StationFence};
use crate::event::{Event, Order, OrderKind, Task};
use crate::fence::{Upload, UploadStep};
use crate::message::MISSION_COUNT;
use crate::mission::store::Item;
use crate::number::{MISSION_TYPE_FENCE, MavSeverity, MissionResult};
use crate::received::MissionRequest;
use crate::stations::StationAddress;
use crate::wire::MessageWriter;

/// How long it may take from the last item until the bridge has the fence in force, which is tens of milliseconds as a rule. It is shorter
/// than the check of a transfer may be, so that the answer tells why.
const UPLOAD_LIMIT: Duration = Duration::from_secs(4);

impl Gateway {
    /// A piece of what the bridge holds has come.
    pub fn outline(&mut self, piece: &BridgeOutline) {
        self.fence.take(piece);
    }

    /// What a station asks about the geofence: it can read it, and change its own areas of it where that is allowed.
    pub(super) fn fence(
        &mut self,
        sender: StationAddress,
        is_station: bool,
        request: &MissionRequest,
        now: MonotonicNs,
    ) {
        let state = self.vehicle.last_state();
        match *request {
            MissionRequest::List => match self.fence.read_by(sender, state) {
                Some(count) => {
                    let message = MessageWriter::new(MISSION_COUNT).u16(count);
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
            MissionRequest::Ack(result) => {
                self.fence.forget(sender);
                if result != MissionResult::Accepted as u8 {
                    self.fence.transfer.cancel(sender);
                }
            }
            MissionRequest::Clear | MissionRequest::Count(_) if self.settings.accepts_fence => {
                let count = match *request {
                    MissionRequest::Count(count) => count,
                    _ => 0,
                };
                self.begin_fence(sender, is_station, count, now);
            }
            MissionRequest::Item(sequence, item) => {
                let output = self.fence.transfer.item(sender, sequence, item, now);
                self.transfer(MISSION_TYPE_FENCE, output, now);
            }
            MissionRequest::Clear => {
                let outline = self.fence.in_force(state);
                match outline.is_some_and(|outline| outline.areas.is_empty()) {
                    true => self.acknowledge_mission(
                        sender,
                        MissionResult::Accepted,
                        MISSION_TYPE_FENCE,
                    ),
                    false => {
                        let why = "the fence is never removed over MAVLink: edit bridge.toml, then `ril fence reload`";
                        self.refuse_fence(sender, MissionResult::Denied, why, now);
                    }
                }
            }
            MissionRequest::SetCurrent(_) | MissionRequest::FloatItem => {}
            MissionRequest::Count(_) => {
                let why = "a fence is not taken over MAVLink: set `[fence] accept`, or use `ril plan fly --fence`";
                self.refuse_fence(sender, MissionResult::Denied, why, now);
            }
        }
    }

    /// Why no other fence comes into force now: a path that is under way was judged by the one of now.
    fn not_now(&self) -> Option<(MissionResult, &'static str)> {
        let is_moving =
            self.missions.is_in_use() || self.pending.iter().any(|one| one.is_movement());
        match self.vehicle.now() {
            None => Some((MissionResult::Error, "the helicopter is not heard")),
            Some(known) if known.is_flying() || known.is_under_way() || is_moving => {
                Some((MissionResult::Denied, "not in flight: land first"))
            }
            Some(_) => None,
        }
    }

    fn begin_fence(
        &mut self,
        sender: StationAddress,
        is_station: bool,
        count: u16,
        now: MonotonicNs,
    ) {
        let not_permitted = self.not_permitted(sender, is_station);
        let not_permitted = not_permitted.map(|(_, why)| (MissionResult::Denied, why));
        if let Some((result, why)) = not_permitted.or_else(|| self.not_now()) {
            let why = format!("the fence was refused: {why}");
            return self.refuse_fence(sender, result, &why, now);
        }
        let output = self.fence.transfer.begin(sender, count, now);
        self.transfer(MISSION_TYPE_FENCE, Some(output), now);
    }

    /// All items of a station's fence are there.
    pub(super) fn put_fence(&mut self, from: StationAddress, items: &[Item], now: MonotonicNs) {
        let refused = |result, text: &str| FenceRefusal {
            result,
            text: text.to_owned(),
        };
        let refusal = if self.fence.upload.is_some() {
            Some(refused(
                MissionResult::Error,
                "the one before it is not in force yet",
            ))
        } else {
            self.not_now().map(|(result, why)| refused(result, why))
        };
        let fence = match refusal.map_or_else(|| StationFence::of(items), Err) {
            Ok(fence) => fence,
            Err(refusal) => return self.end_fence(from, Err(refusal), now),
        };
        if fence.has_return_point {
            let text = "the return point of the fence is not used: the helicopter stops there";
            self.tell(from, MavSeverity::Notice, text, now);
        }
        self.fence.upload = Some(Upload {
            from,
            items: fence.items,
            areas: fence.areas.len(),
            total: 0,
            step: UploadStep::Writing,
            until: now + UPLOAD_LIMIT,
        });
        self.ask(Task::PutFence(fence.areas));
    }

    /// A [`Task::PutFence`] was done: the file has so many areas. Or it was not, and the file is as before.
    pub fn fence_put(&mut self, put: Result<usize, FenceRefusal>, now: MonotonicNs) {
        let number = self.last_number + 1;
        let Some(upload) = self
            .fence
            .upload
            .as_mut()
            .filter(|one| one.step == UploadStep::Writing)
        else {
            return;
        };
        match put {
            Ok(total) => {
                (upload.total, upload.step) = (total, UploadStep::Reloading(number));
                self.reload_fence(now);
            }
            Err(refusal) => {
                let from = upload.from;
                self.fence.upload = None;
                self.end_fence(from, Err(refusal), now);
            }
        }
    }

    fn reload_fence(&mut self, now: MonotonicNs) {
        self.last_number += 1;
        self.orders.push_back(Order {
            number: self.last_number,
            kind: OrderKind::ReloadFence,
            issued: now,
            begin_by: Some(now + self.settings.answer_within),
            preempts: false,
        });
    }

    /// Whether a report was on the reload of a station's fence.
    pub(super) fn fence_report(
        &mut self,
        number: u64,
        (stage, reason): (Stage, Reason),
        words: &str,
        now: MonotonicNs,
    ) -> bool {
        let is_own = |one: &&mut Upload| one.step == UploadStep::Reloading(number);
        let Some(upload) = self.fence.upload.as_mut().filter(is_own) else {
            return false;
        };
        if stage == Stage::Done {
            upload.step = UploadStep::Watching;
            self.watch_fence(now);
        } else if stage.is_final() {
            let result = match reason {
                Reason::InvalidFence => MissionResult::Invalid,
                Reason::RelayNotPermitted => MissionResult::Denied,
                _ => MissionResult::Error,
            };
            self.take_back_fence(result, words, now);
        }
        true
    }

    /// Says that a station's fence is in force, when the bridge has said so.
    fn watch_fence(&mut self, now: MonotonicNs) {
        let in_force = self.fence.in_force(self.vehicle.last_state());
        let is_in = |one: &&Upload| {
            one.step == UploadStep::Watching && in_force.is_some_and(|outline| one.is_in(outline))
        };
        if self.fence.upload.as_ref().filter(is_in).is_some()
            && let Some(upload) = self.fence.upload.take()
        {
            self.end_fence(upload.from, Ok((upload.areas, upload.total)), now);
        }
    }

    /// The bridge did not take it: its file becomes what it was, and the bridge reads it again, since it may have read it in between.
    fn take_back_fence(&mut self, result: MissionResult, why: &str, now: MonotonicNs) {
        if let Some(upload) = self.fence.upload.take() {
            self.ask(Task::RestoreFence);
            let text = format!("{why}; the fence is as before");
            self.end_fence(upload.from, Err(FenceRefusal { result, text }), now);
        }
    }

    /// A [`Task::RestoreFence`] was done, or the reason why it was not.
    pub fn fence_restored(&mut self, restored: Result<(), String>, now: MonotonicNs) {
        match restored {
            Ok(()) => self.reload_fence(now),
            Err(why) => {
                let text = format!("the previous fence was not written again: {why}");
                self.say_to_all(MavSeverity::Error, &text, now);
            }
        }
    }

    fn end_fence(
        &mut self,
        from: StationAddress,
        end: Result<(usize, usize), FenceRefusal>,
        now: MonotonicNs,
    ) {
        let result = match end {
            Ok((areas, total)) => {
                let own = total - areas;
                let text = match areas {
                    0 => format!("no fence of a station is in force; areas of bridge.toml: {own}"),
                    _ => format!(
                        "the fence of {from} is in force; its areas: {areas}, of bridge.toml: {own}"
                    ),
                };
                self.note(Event::Commanded(text.clone()));
                self.say_to_all(MavSeverity::Notice, &text, now);
                MissionResult::Accepted
            }
            Err(refusal) => {
                let text = format!("the fence was refused: {}", refusal.text);
                self.note(Event::Warning(text.clone()));
                self.tell(from, MavSeverity::Error, &text, now);
                refusal.result
            }
        };
        let output = self.fence.transfer.checked(result);
        self.transfer(MISSION_TYPE_FENCE, output, now);
    }

    /// Does what is due about the fence.
    pub(super) fn advance_fence(&mut self, now: MonotonicNs) {
        self.watch_fence(now);
        if self
            .fence
            .upload
            .as_ref()
            .is_some_and(|upload| now >= upload.until)
        {
            let why = "the bridge does not say that it has it in force: does it read this file?";
            self.take_back_fence(MissionResult::Error, why, now);
        }
        let output = self.fence.transfer.advance(now);
        self.transfer(MISSION_TYPE_FENCE, output, now);
    }

    fn refuse_fence(
        &mut self,
        sender: StationAddress,
        result: MissionResult,
        why: &str,
        now: MonotonicNs,
    ) {
        self.acknowledge_mission(sender, result, MISSION_TYPE_FENCE);
        self.tell(sender, MavSeverity::Error, why, now);
    }
}
