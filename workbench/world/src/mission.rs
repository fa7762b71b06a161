//! Missions of MAVLink: how a station sends one, what the gateway's disk keeps, and what must hold of what is flown:
//!
//! * a station is told that its mission is accepted when it is on the disk, and so is none after it was cleared;
//! * what is flown are the places of one mission, one after the other, each after its hover; a mission that goes on
//!   does so with the item that was not reached, over restarts of the gateway too;
//! * a step names the step before, so that none goes after something newer was accepted; the first one is as old as
//!   its command;
//! * the item that is announced is the one that is flown, and one that is called reached was.

use std::ops::RangeInclusive;

use ipc_types::payload::WaypointPosition;
use mavlink_gateway::message::{
    MISSION_ACK, MISSION_CLEAR_ALL, MISSION_COUNT, MISSION_CURRENT, MISSION_ITEM_INT,
    MISSION_ITEM_REACHED, MISSION_REQUEST_INT,
};
use mavlink_gateway::wire::{MavFrame, MessageWriter};
use mavlink_gateway::{Item, KeptProgress, Mission};

use crate::life::TICK_MS;
use crate::robot::Robot;
use crate::script::Dice;

/// A station says again so often what has no answer, so many times at most.
const AGAIN_MS: u64 = 900;
const TIMES: u32 = 4;
/// It gives an upload up of which it has heard nothing for so long. The gateway answers within ten seconds.
const GIVE_UP_MS: u64 = 12_000;
/// MAV_MISSION_RESULT and MISSION_STATE.
const ACCEPTED: u8 = 0;
const ACTIVE: u8 = 3;

/// A place of a mission, degrees, and how long is hovered there.
#[derive(Clone, Copy, Debug)]
struct Place {
    degrees: [f64; 2],
    hover_ms: u64,
}

/// A mission that a station sends, or that it clears.
pub struct Upload {
    mission: Mission,
    items: Vec<MessageWriter>,
    next_ms: u64,
    times: u32,
    /// Nothing of it was asked for, and it has no answer.
    is_new: bool,
    is_open: bool,
    /// When something of it was said or heard last.
    active_ms: u64,
}

impl Upload {
    /// Of these places, east and north of home, with hovers.
    pub fn new(places: &[(f64, f64, u64)], robot: &Robot, missions: &mut Missions) -> Upload {
        let mut items = Vec::new();
        let mut known = Vec::new();
        for (index, (east, north, hover_ms)) in places.iter().enumerate() {
            let at = robot.waypoint(0, 0, (*east, *north));
            let integer = |degrees: f64| (degrees * 1e7).round() as i32;
            let (x, y) = (integer(at.latitude_deg), integer(at.longitude_deg));
            let message = MessageWriter::new(MISSION_ITEM_INT).f32(*hover_ms as f32 / 1e3);
            let message = message.f32(0.0).f32(0.0).f32(f32::NAN).i32(x).i32(y);
            let message = message.f32(15.0).u16(index as u16).u16(16);
            items.push(message.u8(1).u8(1).u8(6).u8(0).u8(1).u8(0));
            known.push(Place {
                degrees: [f64::from(x) * 1e-7, f64::from(y) * 1e-7],
                hover_ms: *hover_ms,
            });
        }
        let mission = Mission::new(items.iter().map(|item| Item::of(item.payload())).collect());
        missions.known.push((mission.clone(), known));
        Upload {
            mission,
            items,
            next_ms: robot.now_ms,
            times: 0,
            is_new: true,
            is_open: true,
            active_ms: robot.now_ms,
        }
    }

    /// Whether the station waits for its end, and begins no other one: nothing in its messages tells two apart.
    pub fn is_busy(&self, now_ms: u64) -> bool {
        self.is_open && now_ms < self.active_ms + GIVE_UP_MS
    }

    /// What a station says of it now.
    pub fn say(&mut self, now_ms: u64) -> Option<MessageWriter> {
        let is_due = self.is_open && self.is_new && self.next_ms <= now_ms && self.times < TIMES;
        if !is_due {
            return None;
        }
        (self.next_ms, self.active_ms) = (now_ms + AGAIN_MS, now_ms);
        self.times += 1;
        Some(match self.items.len() {
            0 => MessageWriter::new(MISSION_CLEAR_ALL).u8(1).u8(1).u8(0),
            count => MessageWriter::new(MISSION_COUNT)
                .u16(count as u16)
                .u8(1)
                .u8(1)
                .u8(0),
        })
    }

    /// What a station answers.
    pub fn answer(&mut self, frame: &MavFrame<'_>, now_ms: u64) -> Option<MessageWriter> {
        match frame.kind {
            MISSION_REQUEST_INT if self.is_open => {
                (self.is_new, self.active_ms) = (false, now_ms);
                self.items.get(usize::from(frame.payload.u16(0))).cloned()
            }
            MISSION_ACK => {
                self.is_open = false;
                None
            }
            _ => None,
        }
    }
}

/// A path of a mission as it is flown.
struct Flight {
    /// Which of the known ones.
    mission: usize,
    items: RangeInclusive<usize>,
    /// The order of the judge, and its last request.
    order: usize,
    request: u64,
    /// The station whose command it was.
    starter: usize,
    begun_ms: u64,
}

/// What a gateway's disk keeps of missions, and what is flown of them.
#[derive(Default)]
pub struct Missions {
    known: Vec<(Mission, Vec<Place>)>,
    /// What was on the disk, one after the other; the last one is.
    kept: Vec<Mission>,
    progress: Option<String>,
    /// The progress that the gateway before has left.
    left: Option<String>,
    /// When each mission that waits for the disk is there.
    saving: Option<(u64, Mission)>,
    waiting: Option<Mission>,
    saved: Vec<Mission>,
    pub slow_until: u64,
    /// The last one is under way, or was.
    flights: Vec<Flight>,
    /// Starts of the module and take-offs with which a mission may begin: whose command each was, and its request.
    begun: Vec<(usize, u64)>,
    /// A mission was accepted since, maybe the same: it begins with the first item.
    is_renewed: bool,
    restarted_ms: u64,
}

impl Missions {
    /// The gateway was killed: what was not on the disk is lost.
    pub fn dies(&mut self, now_ms: u64) {
        (self.saving, self.waiting) = (None, None);
        self.saved.clear();
        self.restarted_ms = now_ms;
        self.left = self.progress.clone();
    }

    /// What is on the disk.
    pub fn kept(&self) -> (Mission, Option<KeptProgress>) {
        let mission = self.kept.last().map(Mission::encode);
        let mission = mission.and_then(|bytes| Mission::decode(&bytes).ok());
        let progress = self.progress.as_ref();
        let progress = progress.and_then(|text| KeptProgress::decode(text.as_bytes()).ok());
        (mission.unwrap_or_default(), progress)
    }

    pub fn save(&mut self, mission: Mission, now_ms: u64, dice: &mut Dice) {
        self.waiting = Some(mission);
        self.go_on(now_ms, dice);
    }

    fn go_on(&mut self, now_ms: u64, dice: &mut Dice) {
        if self.saving.is_none()
            && let Some(mission) = self.waiting.take()
        {
            let at_ms = now_ms.max(self.slow_until) + dice.count(1, 150);
            self.saving = Some((at_ms, mission));
        }
    }

    pub fn keep_progress(&mut self, progress: KeptProgress) {
        self.progress = Some(progress.encode());
    }

    /// The disk, which does not stand still with the gateway.
    pub fn write(&mut self, now_ms: u64, dice: &mut Dice) {
        if let Some((_, mission)) = self.saving.take_if(|(at_ms, _)| *at_ms <= now_ms) {
            self.kept.push(mission.clone());
            self.saved.push(mission);
        }
        self.go_on(now_ms, dice);
    }

    /// What the disk has taken since the last call.
    pub fn take_saved(&mut self) -> Vec<Mission> {
        std::mem::take(&mut self.saved)
    }

    /// Which items of which mission a path is: of the one that was flown last, or of the newest. Missions may end
    /// alike.
    fn find(&self, path: &[WaypointPosition]) -> Option<(usize, RangeInclusive<usize>)> {
        let is_there = |(place, at): (&Place, &WaypointPosition)| {
            let [latitude_deg, longitude_deg] = place.degrees;
            (latitude_deg - at.latitude_deg).abs() < 5e-8
                && (longitude_deg - at.longitude_deg).abs() < 5e-8
        };
        let flown = self.flights.last().map(|it| it.mission);
        let mut numbers = flown.into_iter().chain((0..self.known.len()).rev());
        numbers.find_map(|number| {
            let mut parts = self.known[number].1.windows(path.len());
            let first = parts.position(|part| part.iter().zip(path).all(is_there))?;
            Some((number, first..=first + path.len() - 1))
        })
    }

    /// The module is started, or it takes off, as a step of a mission before its first path: by the command of this
    /// station, or after the step before.
    pub fn starts(&mut self, starter: Option<usize>, after: u64, request: u64) {
        let begun = self.begun.iter().find(|(_, before)| *before == after);
        if let Some(starter) = starter.or(begun.map(|(starter, _)| *starter)) {
            self.begun.push((starter, request));
        }
    }

    /// A path is ordered as this order of the judge. Gives what its step follows, and whose command it is. `starter`:
    /// the station that has commanded it at the moment of its issue, if one has.
    pub fn flies(
        &mut self,
        path: &[WaypointPosition],
        (order, request): (usize, u64),
        (after, starter): (u64, Option<usize>),
        robot: &mut Robot,
    ) -> Option<(u64, usize)> {
        let Some((mission, items)) = self.find(path) else {
            robot.judge.fail("a path is flown of no mission".to_owned());
            return None;
        };
        let first = *items.start();
        let begun = std::mem::take(&mut self.begun);
        let begun = begun.into_iter().find(|(_, request)| *request == after);
        let started = starter.map(|starter| (starter, 0)).or(begun);
        let judged = match (self.flights.last(), started) {
            (None, None) => Err("a mission is flown that nobody has started".to_owned()),
            (None, Some(_)) => Ok(()),
            (Some(before), Some(_)) => self.judge_start(before, (mission, first), robot),
            (Some(before), None) => self.judge_next(before, (mission, first), robot),
        };
        if let Err(what) = judged {
            robot.judge.fail(what);
        }
        self.is_renewed = false;
        let before = self.flights.last().map(|it| (it.starter, it.request));
        let (starter, meant) = started.or(before)?;
        self.flights.push(Flight {
            mission,
            items,
            order,
            request,
            starter,
            begun_ms: robot.now_ms,
        });
        robot.judge.ran.mission_paths += 1;
        Some((meant, starter))
    }

    /// A step follows another one.
    fn judge_next(
        &self,
        before: &Flight,
        (mission, item): (usize, usize),
        robot: &Robot,
    ) -> Result<(), String> {
        let last = *before.items.end();
        if before.mission != mission || item != last + 1 {
            return Err(format!(
                "item {item} of a mission is flown after item {last}"
            ));
        }
        let Some(done_ms) = robot.judge.done_ms(before.order) else {
            return Err(format!("item {item} is flown, and the one before was not"));
        };
        let hover_ms = self.known[mission].1[last].hover_ms;
        match robot.now_ms + 2 * TICK_MS < done_ms + hover_ms {
            true => Err(format!(
                "item {item} is flown without a hover of {hover_ms} ms"
            )),
            false => Ok(()),
        }
    }

    /// A mission is started: one that was interrupted goes on with what was not reached.
    fn judge_start(
        &self,
        before: &Flight,
        (mission, item): (usize, usize),
        robot: &Robot,
    ) -> Result<(), String> {
        let is_same = self.known[before.mission].0 == self.known[mission].0;
        let is_last = *before.items.end() + 1 == self.known[mission].1.len();
        let is_over = is_last && robot.judge.done_ms(before.order).is_some();
        if !is_same || self.is_renewed || item == 0 && is_over {
            return Ok(());
        }
        let least = match self.restarted_ms > before.begun_ms {
            true => self.kept_item(mission),
            false => *before.items.start(),
        };
        match item < least || item > before.items.end() + 1 {
            true => Err(format!(
                "a mission goes on with item {item}, and {:?} were flown",
                before.items
            )),
            false => Ok(()),
        }
    }

    /// With which item a mission is to go on after a restart, as it is on the disk.
    fn kept_item(&self, mission: usize) -> usize {
        let words = self.left.iter().flat_map(|text| text.split_whitespace());
        let numbers: Vec<usize> = words.filter_map(|word| word.parse().ok()).collect();
        match numbers[..] {
            [_, id, next] if id == self.known[mission].0.id() as usize => next.max(1) - 1,
            _ => 0,
        }
    }

    /// The gateway sends something about missions to a station with this upload.
    pub fn judge_sent(&mut self, frame: &MavFrame<'_>, upload: Option<&Upload>, robot: &mut Robot) {
        let item = usize::from(frame.payload.u16(0));
        let what = match frame.kind {
            MISSION_ACK if frame.payload.u8(2) == ACCEPTED => {
                self.is_renewed = true;
                robot.judge.ran.missions += 1;
                let id = frame.payload.u32(4);
                let is_kept = self.kept.iter().any(|mission| mission.id() == id);
                // The station's next upload is on its way to the gateway, which answers the one before.
                let crosses = |upload: &Upload| upload.is_new && !upload.items.is_empty();
                let is_of = |upload: &Upload| upload.mission.id() == id || crosses(upload);
                match (
                    is_kept || id == 0 && self.kept.is_empty(),
                    upload.is_some_and(is_of),
                ) {
                    (true, true) => return,
                    (false, _) => {
                        "a mission is said to be accepted that is not on the disk".to_owned()
                    }
                    _ => {
                        "a mission is said to be accepted that its station did not send".to_owned()
                    }
                }
            }
            MISSION_CURRENT if frame.payload.u8(4) == ACTIVE => {
                let flights = self.flights.last();
                let flight = flights.filter(|it| robot.judge.is_under_way(it.order));
                match flight.filter(|it| !it.items.contains(&item)) {
                    Some(it) => format!("item {item} is announced, and {:?} are flown", it.items),
                    None => return,
                }
            }
            MISSION_ITEM_REACHED => {
                let mut flights = self.flights.iter().rev();
                let is_reached = |it: &Flight| {
                    let is_end = item == *it.items.end();
                    it.items.contains(&item) && (!is_end || robot.judge.done_ms(it.order).is_some())
                };
                match flights.any(is_reached) {
                    true => return,
                    false => format!("item {item} is called reached, and was not"),
                }
            }
            _ => return,
        };
        robot.judge.fail(what);
    }
}
