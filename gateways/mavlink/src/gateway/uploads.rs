//! How missions and fences come from stations, and how they go to them; and how a mission comes onto the disk.

use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;

use super::{Gateway, Origin};
use crate::commands::{CommandKey, Form, Subject};
use crate::event::{Event, Task};
use crate::fence;
use crate::message::{MISSION_ACK, MISSION_COUNT, MISSION_REQUEST_INT, MessageKind};
use crate::mission::OnDisk;
use crate::mission::store::Mission;
use crate::mission::transfer::{Output, Transfer};
use crate::number::{MISSION_TYPE_FENCE as FENCE, MavSeverity, MissionResult};
use crate::received::MissionRequest;
use crate::stations::StationAddress;
use crate::wire::MessageWriter;

/// MAV_MISSION_TYPE: missions, rally points, and all types at once, which can be cleared alone.
pub(super) const MISSION: u8 = 0;
const RALLY: u8 = 2;
const ALL: u8 = 255;

/// How long the disk has for a mission: shorter than the check of a transfer may take, so that the answer tells why. A
/// mission that it takes later is not in force, and is replaced there.
const SAVE_LIMIT: Duration = Duration::from_secs(4);

impl Gateway {
    /// A message about missions has come.
    pub(super) fn mission(&mut self, origin: Origin, request: &MissionRequest) {
        let Origin {
            sender,
            is_station,
            mission_type,
            now,
        } = origin;
        if *request == MissionRequest::FloatItem {
            return self.refuse_float_item(sender, mission_type, now);
        }
        if let MissionRequest::Part(kind) = *request {
            return self.refuse_part(sender, kind, mission_type, now);
        }
        if let MissionRequest::Item(_, item) = request
            && item.is_guided()
            && mission_type == MISSION
        {
            return self.guided_item(origin, item);
        }
        let is_fence = mission_type == FENCE;
        let is_clear_of_all = mission_type == ALL && *request == MissionRequest::Clear;
        if mission_type != MISSION && !is_fence && !is_clear_of_all {
            return self.other_type(sender, request, mission_type, now);
        }
        if self.is_mission_message_late(origin, request) {
            return;
        }
        match *request {
            MissionRequest::List if is_fence => {
                let outline = self.fence.in_force(self.vehicle.last_state());
                let items = outline.map(fence::items).unwrap_or_default();
                let count = u16::try_from(items.len()).ok();
                let Some(count) = count.filter(|_| outline.is_some()) else {
                    let why = "the fence is not known: the bridge has not said it";
                    return self.refuse_fence(sender, MissionResult::Error, why, now);
                };
                self.send_count(sender, FENCE, count, 0);
                self.fence.transfer.read_by(sender, items.into());
            }
            MissionRequest::List => {
                let mission = self.missions.mission.clone();
                self.send_count(sender, MISSION, mission.count(), mission.id());
                let items = Arc::clone(mission.items());
                self.missions.transfer.read_by(sender, items);
            }
            MissionRequest::Request(sequence) => {
                let (fence, missions) = (&self.fence, &self.missions);
                let read = match is_fence {
                    true => fence.transfer.read(sender).unwrap_or_default(),
                    false => missions
                        .transfer
                        .read(sender)
                        .unwrap_or(missions.mission.items()),
                };
                match read.get(usize::from(sequence)).copied() {
                    Some(item) => {
                        self.send(
                            sender.address,
                            &item.message(sequence, sender, mission_type),
                        );
                    }
                    None if is_fence => {
                        let why = "the fence has no such item: ask for its list anew";
                        self.refuse_fence(sender, MissionResult::InvalidSequence, why, now);
                    }
                    None => {
                        self.acknowledge_mission(sender, MissionResult::InvalidSequence, MISSION);
                    }
                }
            }
            MissionRequest::Ack(result) => {
                self.transfer_of(mission_type).ended_by(sender, result);
            }
            MissionRequest::Item(sequence, item) => {
                let transfer = self.transfer_of(mission_type);
                let output = transfer.item(sender, sequence, item, now);
                self.transfer(mission_type, output, now);
            }
            MissionRequest::SetCurrent(_) if is_fence => {}
            MissionRequest::Count(count) if is_fence => {
                self.change_fence(sender, is_station, Some(count), now);
            }
            MissionRequest::Clear if is_fence => {
                self.change_fence(sender, is_station, None, now);
            }
            MissionRequest::SetCurrent(sequence) => {
                if let Some((_, why)) = self.not_permitted(sender, is_station) {
                    self.acknowledge_mission(sender, MissionResult::Denied, MISSION);
                    return self.tell(sender, MavSeverity::Error, why, now);
                }
                let bits = [u32::from(sequence); 8];
                let key = CommandKey::new(sender, Form::CurrentItem, bits);
                self.set_current(key, sequence, now);
            }
            MissionRequest::FloatItem | MissionRequest::Part(_) => {}
            MissionRequest::Count(_) | MissionRequest::Clear => {
                let refused = match self.not_permitted(sender, is_station) {
                    Some((_, why)) => Some(why),
                    None if self.missions.is_in_use() => {
                        Some("the mission is flown: press Pause before another one is sent")
                    }
                    None => None,
                };
                if let Some(why) = refused {
                    self.acknowledge_mission(sender, MissionResult::Denied, mission_type);
                    return self.tell(sender, MavSeverity::Error, why, now);
                }
                let count = match *request {
                    MissionRequest::Count(count) => count,
                    _ => 0,
                };
                match self.missions.transfer.begin(sender, count, now) {
                    // The transfer of another station may be under way, which has its own type.
                    Output::Refused(to, result, why) => {
                        self.refuse_transfer(mission_type, (to, result, why), now);
                    }
                    output => {
                        self.missions.asked_type = mission_type;
                        // What waits for the rules of the bridge is not wanted any more.
                        self.missions.awaiting_rules = None;
                        self.transfer(MISSION, Some(output), now);
                    }
                }
            }
        }
    }

    /// Whether a message that changes something was sent before a newer one of its station, or has waited too long to
    /// be read.
    fn is_mission_message_late(&mut self, origin: Origin, request: &MissionRequest) -> bool {
        let Origin {
            sender,
            is_station,
            mission_type,
            now,
        } = origin;
        let subject = match request {
            MissionRequest::SetCurrent(_) => Subject::Motion,
            _ if mission_type == FENCE => Subject::Fence,
            _ => Subject::Mission,
        };
        let is_item = matches!(request, MissionRequest::Item(..));
        let changes = matches!(
            request,
            MissionRequest::Count(_) | MissionRequest::Clear | MissionRequest::SetCurrent(_)
        );
        if !(changes || is_item) || self.not_permitted(sender, is_station).is_some() {
            return false;
        }
        let is_outdated = self.commands.is_outdated(Some(sender), subject, self.frame);
        let why = if is_outdated {
            // Its station has had its answer, or waits for that to the newer one. An item is one of an earlier mission.
            "it was sent before a newer one, and is not carried out"
        } else if self.age_of_frame(now).is_some() {
            if changes && subject != Subject::Motion {
                self.acknowledge_mission(sender, MissionResult::Cancelled, mission_type);
            }
            "it came too long ago: repeat it"
        } else {
            self.commands
                .order(Some(sender), subject, false, self.frame);
            return false;
        };
        if changes {
            let what = match request {
                MissionRequest::Count(_) => "MISSION_COUNT",
                MissionRequest::Clear => "MISSION_CLEAR_ALL",
                _ => "MISSION_SET_CURRENT",
            };
            self.tell(sender, MavSeverity::Error, &format!("{what}: {why}"), now);
        }
        true
    }

    fn transfer_of(&mut self, mission_type: u8) -> &mut Transfer {
        match mission_type {
            FENCE => &mut self.fence.transfer,
            _ => &mut self.missions.transfer,
        }
    }

    /// Says how many items there are of a type, and what tells them from others.
    fn send_count(&mut self, to: StationAddress, mission_type: u8, count: u16, id: u32) {
        let message = MessageWriter::new(MISSION_COUNT).u16(count);
        let message = message.u8(to.system).u8(to.component);
        self.send(to.address, &message.u8(mission_type).u32(id));
    }

    /// A station has sent MISSION_ITEM, whose degrees are floats: it is told at once that this is not supported, and
    /// its transfer ends.
    fn refuse_float_item(&mut self, sender: StationAddress, mission_type: u8, now: MonotonicNs) {
        if matches!(mission_type, MISSION | FENCE) {
            self.transfer_of(mission_type).cancel(sender);
        }
        self.acknowledge_mission(sender, MissionResult::Unsupported, mission_type);
        let text =
            "MISSION_ITEM is not taken, since its places are too coarse: send MISSION_ITEM_INT";
        self.tell(sender, MavSeverity::Error, text, now);
    }

    /// A mission comes and goes as a whole.
    fn refuse_part(
        &mut self,
        sender: StationAddress,
        kind: MessageKind,
        mission_type: u8,
        now: MonotonicNs,
    ) {
        self.stations.count_refusal(sender);
        self.acknowledge_mission(sender, MissionResult::Unsupported, mission_type);
        let text = format!(
            "{} is not done, and the mission is as it was: send or read it as a whole, by MISSION_COUNT or MISSION_REQUEST_LIST",
            kind.name()
        );
        self.tell(sender, MavSeverity::Error, &text, now);
    }

    /// Rally points: there are none, and none is taken. Of other types there is nothing to be said.
    fn other_type(
        &mut self,
        sender: StationAddress,
        request: &MissionRequest,
        mission_type: u8,
        now: MonotonicNs,
    ) {
        let is_answer = matches!(request, MissionRequest::Ack(_));
        if mission_type != RALLY && !is_answer {
            self.acknowledge_mission(sender, MissionResult::Unsupported, mission_type);
            let text = format!("there is no type {mission_type} of a mission to be sent or read");
            return self.tell(sender, MavSeverity::Error, &text, now);
        }
        match request {
            MissionRequest::List => self.send_count(sender, mission_type, 0, 0),
            MissionRequest::Clear => {
                self.acknowledge_mission(sender, MissionResult::Accepted, mission_type);
            }
            MissionRequest::Count(_) => {
                self.acknowledge_mission(sender, MissionResult::Unsupported, mission_type);
                let text = "rally points are not taken over MAVLink";
                self.tell(sender, MavSeverity::Error, text, now);
            }
            MissionRequest::Request(_) => {
                self.acknowledge_mission(sender, MissionResult::InvalidSequence, mission_type);
            }
            MissionRequest::Item(..) => {
                self.acknowledge_mission(sender, MissionResult::Unsupported, mission_type);
            }
            _ => {}
        }
    }

    pub(super) fn acknowledge_mission(
        &mut self,
        to: StationAddress,
        result: MissionResult,
        mission_type: u8,
    ) {
        let id = match result {
            MissionResult::Accepted if mission_type == MISSION => self.missions.mission.id(),
            _ => 0,
        };
        let message = MessageWriter::new(MISSION_ACK)
            .u8(to.system)
            .u8(to.component);
        let message = message.u8(result as u8).u8(mission_type);
        self.send(to.address, &message.u32(id));
    }

    /// Does what the transfer of this type wants.
    pub(super) fn transfer(&mut self, mission_type: u8, output: Option<Output>, now: MonotonicNs) {
        let is_fence = mission_type == FENCE;
        let answered = match is_fence {
            true => FENCE,
            false => self.missions.asked_type,
        };
        match output {
            None => {}
            Some(Output::Request(to, sequence)) => {
                let message = MessageWriter::new(MISSION_REQUEST_INT).u16(sequence);
                let message = message.u8(to.system).u8(to.component);
                self.send(to.address, &message.u8(mission_type));
            }
            Some(Output::Ack(to, result)) => self.acknowledge_mission(to, result, answered),
            Some(Output::Refused(to, result, why)) => {
                self.refuse_transfer(answered, (to, result, why), now);
            }
            Some(Output::Late(to, sequence)) => {
                self.transfer(
                    mission_type,
                    Some(Output::Ack(to, MissionResult::Cancelled)),
                    now,
                );
                let what = if is_fence { "fence" } else { "mission" };
                let number = u32::from(sequence) + 1;
                let text = format!(
                    "the {what} did not come whole, and the previous one is in force: no MISSION_ITEM_INT came for item {number}"
                );
                self.tell(to, MavSeverity::Error, &text, now);
            }
            Some(Output::Check(from, items)) if is_fence => self.put_fence(from, &items, now),
            Some(Output::Check(from, items)) => {
                let mission = Mission::new(items);
                if mission.items().is_empty() {
                    return self.save(mission, now);
                }
                self.missions.awaiting_rules = Some((from, mission));
                self.ask(Task::Rules);
            }
        }
    }

    /// Says that a transfer of this type comes to nothing, and why.
    fn refuse_transfer(
        &mut self,
        mission_type: u8,
        (to, result, why): (StationAddress, MissionResult, &str),
        now: MonotonicNs,
    ) {
        self.acknowledge_mission(to, result, mission_type);
        let what = match mission_type {
            FENCE => "fence",
            _ => "mission",
        };
        let text = format!("the {what} was refused: {why}");
        self.tell(to, MavSeverity::Error, &text, now);
    }

    /// Puts a mission on the disk, so that it is in force.
    pub(super) fn save(&mut self, mission: Mission, now: MonotonicNs) {
        let missions = &mut self.missions;
        // One after the other: a late word of the disk would else be taken for one of the newer mission.
        if missions.on_disk == OnDisk::Writing || missions.is_in_use() {
            let output = missions.transfer.checked(MissionResult::Error);
            if let Some(Output::Ack(to, result)) = output {
                let why = "the previous one is flown, or is still on its way to the disk";
                self.refuse_transfer(self.missions.asked_type, (to, result, why), now);
            }
            return;
        }
        if missions.mission == mission && missions.on_disk == OnDisk::InForce {
            // The mission in force has come again: only its progress is forgotten.
            return self.end_saving(mission, Ok(()), now);
        }
        missions.saving = Some(now + SAVE_LIMIT);
        self.write_mission(mission);
    }

    fn write_mission(&mut self, mission: Mission) {
        self.missions.on_disk = OnDisk::Writing;
        self.ask(Task::Save(mission));
    }

    /// A [`Task::Save`] was done, or the reason why it was not. One that was given up, and has come onto the disk all
    /// the same, is replaced there by the one in force; so is one that failed, which may have come there up to its last
    /// step.
    pub fn saved(&mut self, mission: Mission, result: Result<(), String>, now: MonotonicNs) {
        self.moment = now;
        self.missions.on_disk = match result {
            Ok(()) => OnDisk::InForce,
            Err(_) => OnDisk::Unknown,
        };
        let is_awaited = self.missions.saving.take().is_some();
        if is_awaited {
            self.end_saving(mission.clone(), result.clone(), now);
        }
        if mission != self.missions.mission {
            self.write_mission(self.missions.mission.clone());
        } else if let (false, Err(why)) = (is_awaited, result) {
            let text = format!("the disk may have another mission than the one in force: {why}");
            self.say_to_all(MavSeverity::Error, &text, now);
        }
    }

    pub(super) fn end_saving(
        &mut self,
        mission: Mission,
        result: Result<(), String>,
        now: MonotonicNs,
    ) {
        let result = match result {
            Ok(()) => {
                let text = match mission.count() {
                    0 => "there is no mission".to_owned(),
                    count => format!("a mission of {count} items is in force"),
                };
                self.missions.set(mission);
                self.note(Event::Note(text.clone()));
                self.say_to_all(MavSeverity::Notice, &text, now);
                MissionResult::Accepted
            }
            Err(why) => {
                let text = format!("the mission was not kept: {why}");
                self.say_to_all(MavSeverity::Error, &text, now);
                MissionResult::Error
            }
        };
        let output = self.missions.transfer.checked(result);
        self.transfer(MISSION, output, now);
    }
}
