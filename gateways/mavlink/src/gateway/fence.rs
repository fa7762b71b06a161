//! The geofence of the bridge, for stations; and that of a station, for the bridge. What becomes of it when its items
//! are there:
//!
//! | step | the file is written | it is not | the bridge has read it | it has not | the bridge says this fence | 4 s have passed |
//! |---|---|---|---|---|---|---|
//! | writing | → reloading | refused | – | – | – | refused; taken back when it is written after all |
//! | reloading | – | – | → watching | taken back, refused | – | taken back, refused |
//! | watching | – | – | – | – | accepted | taken back, refused |

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::BridgeOutline;

use super::Gateway;
use crate::event::{Event, Order, OrderKind, Task};
use crate::fence::{StationFence, Upload, UploadStep};
use crate::mission::store::Item;
use crate::number::{MISSION_TYPE_FENCE as FENCE, MavSeverity, MissionRefusal, MissionResult};
use crate::stations::StationAddress;

/// How long it may take from the last item until the bridge has the fence in force, which is tens of milliseconds as a
/// rule. It is shorter than the check of a transfer may be, so that the answer tells why.
const UPLOAD_LIMIT: Duration = Duration::from_secs(4);

impl Gateway {
    /// A piece of what the bridge holds has come.
    pub fn outline(&mut self, piece: &BridgeOutline) {
        self.fence.take(piece);
    }

    /// A station clears the geofence, or has another one of so many items: it can change its own areas where that is
    /// allowed.
    pub(super) fn change_fence(
        &mut self,
        sender: StationAddress,
        is_station: bool,
        count: Option<u16>,
        now: MonotonicNs,
    ) {
        if self.settings.accepts_fence {
            return self.begin_fence(sender, is_station, count.unwrap_or(0), now);
        }
        let outline = self.fence.in_force(self.vehicle.last_state());
        let is_empty = outline.is_some_and(|outline| outline.areas.is_empty());
        let why = match count {
            None if is_empty => {
                return self.acknowledge_mission(sender, MissionResult::Accepted, FENCE);
            }
            None => {
                "the fence is never removed over MAVLink: edit bridge.toml, then `ril fence reload`"
            }
            Some(_) => {
                "a fence is not taken over MAVLink: set `[fence] accept`, or use `ril plan fly --fence`"
            }
        };
        self.refuse_fence(sender, MissionResult::Denied, why, now);
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
        self.transfer(FENCE, Some(output), now);
    }

    /// All items of a station's fence are there.
    pub(super) fn put_fence(&mut self, from: StationAddress, items: &[Item], now: MonotonicNs) {
        let refused = |result, text: &str| MissionRefusal {
            result,
            text: text.to_owned(),
        };
        let refusal = if self.fence.upload.is_some() || self.fence.is_writing {
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
        if !fence.not_done.is_empty() {
            let text = format!("the fence: {} is not done", fence.not_done.join(", "));
            self.tell(from, MavSeverity::Notice, &text, now);
        }
        self.fence.upload = Some(Upload {
            from,
            items: fence.items,
            areas: fence.areas.len(),
            total: 0,
            step: UploadStep::Writing,
            until: now + UPLOAD_LIMIT,
        });
        self.fence.is_writing = true;
        self.ask(Task::PutFence(fence.areas));
    }

    /// A [`Task::PutFence`] was done: the file has so many areas. Or it was not, and the file is as before.
    pub fn fence_put(&mut self, put: Result<usize, MissionRefusal>, now: MonotonicNs) {
        self.fence.is_writing = false;
        let not_now = self.not_now();
        let number = self.last_number + 1;
        let Some(upload) = self
            .fence
            .upload
            .as_mut()
            .filter(|one| one.step == UploadStep::Writing)
        else {
            // Its station was told that it is not in force.
            if put.is_ok() {
                self.ask(Task::RestoreFence);
            }
            return;
        };
        if let (Ok(_), Some((result, why))) = (&put, not_now) {
            upload.step = UploadStep::Watching;
            return self.take_back_fence(result, why, now);
        }
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
            after: 0,
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

    /// The bridge did not take it: its file becomes what it was, and the bridge reads it again, since it may have read
    /// it in between.
    fn take_back_fence(&mut self, result: MissionResult, why: &str, now: MonotonicNs) {
        if let Some(upload) = self.fence.upload.take() {
            if upload.step != UploadStep::Writing {
                self.ask(Task::RestoreFence);
            }
            let text = format!("{why}; the fence is as before");
            self.end_fence(upload.from, Err(MissionRefusal { result, text }), now);
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
        end: Result<(usize, usize), MissionRefusal>,
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
        self.transfer(FENCE, output, now);
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
            let why = match self.fence.is_writing {
                true => "the disk does not take it",
                false => "the bridge does not say that it has it in force: does it read this file?",
            };
            self.take_back_fence(MissionResult::Error, why, now);
        }
        let output = self.fence.transfer.advance(now);
        self.transfer(FENCE, output, now);
    }

    pub(super) fn refuse_fence(
        &mut self,
        sender: StationAddress,
        result: MissionResult,
        why: &str,
        now: MonotonicNs,
    ) {
        self.acknowledge_mission(sender, result, FENCE);
        self.tell(sender, MavSeverity::Error, why, now);
    }
}
