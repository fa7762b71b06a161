//! Missions: their steps, how they pause and end; `starts` beside it: how they begin; `uploads`: how they come. The
//! order of their steps is that of `ril plan fly`.

use std::time::Duration;

use bridge::BridgeConfig;
use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{RequestReport, WaypointPosition};
use plans::executor::Progress;
use plans::flight::{PathPoint, Step};

use super::Gateway;
use super::orders::MAX_ORDERS;
use super::pending::Pending;
use super::uploads::MISSION;
use crate::commands::Subject;
use crate::event::{Event, OrderKind, Task};
use crate::message::MISSION_ITEM_REACHED;
use crate::mission::check::{Conditions, check_mission};
use crate::mission::store::Mission;
use crate::mission::{KeptProgress, Run, Starting};
use crate::number::{MavResult, MavSeverity};
use crate::verdict::CommandAck;
use crate::wire::MessageWriter;

/// How often the progress of a mission is kept at most.
const PROGRESS_PERIOD: Duration = Duration::from_secs(1);

impl Gateway {
    /// The mission that was in force before a restart. Nothing of it is flown.
    pub fn restore(&mut self, mission: Mission) {
        self.missions.set(mission);
    }

    /// How far that mission was before the restart: the next start goes on from there.
    pub fn restore_progress(&mut self, progress: KeptProgress) {
        self.missions.restore_progress(progress);
        if let Some(text) = self.missions.interrupted() {
            self.note(Event::Note(text));
        }
    }

    /// How far the mission is, if that is to be kept for the next start.
    pub fn poll_progress(&mut self, now: MonotonicNs) -> Option<KeptProgress> {
        if self.deadline_of_progress().is_none_or(|at| now < at) {
            return None;
        }
        let progress = self.missions.progress();
        self.missions.kept = (progress, Some(now));
        Some(progress)
    }

    /// When the progress of the mission is to be kept.
    pub(super) fn deadline_of_progress(&self) -> Option<MonotonicNs> {
        let (kept, at) = self.missions.kept;
        let next = at.map_or(self.moment, |at| at + PROGRESS_PERIOD);
        (self.missions.progress() != kept).then_some(next)
    }

    /// The answer to [`Task::Rules`]: the configuration of the bridge; `None` if it is not known.
    pub fn rules(&mut self, rules: Option<&BridgeConfig>, now: MonotonicNs) {
        if let Some((from, mission)) = self.missions.awaiting_rules.take()
            && self.missions.transfer.is_checking()
        {
            let conditions = self.conditions(rules, None);
            match check_mission(&mission, 1, &conditions) {
                Ok(checked) => {
                    for remark in checked.remarks {
                        self.tell(from, MavSeverity::Notice, &remark, now);
                    }
                    self.save(mission, now);
                }
                Err(refusal) => {
                    let text = format!("the mission was refused: {}", refusal.text);
                    self.tell(from, MavSeverity::Error, &text, now);
                    let output = self.missions.transfer.checked(refusal.result);
                    self.transfer(MISSION, output, now);
                }
            }
        }
        if let Some(starting) = self.missions.starting.take() {
            self.begin_mission(starting, rules, now);
        }
    }

    pub(super) fn conditions<'a>(
        &'a self,
        rules: Option<&'a BridgeConfig>,
        here: Option<(WaypointPosition, bool)>,
    ) -> Conditions<'a> {
        Conditions {
            settings: &self.settings,
            rules,
            home: &self.home,
            here,
        }
    }

    /// Orders the next step when it is time for it.
    pub(super) fn drive_mission(&mut self, now: MonotonicNs) {
        let Some(run) = &mut self.missions.run else {
            return;
        };
        run.executor.advance(now);
        // A hold or a landing that a station has just commanded is waited for: it may end the mission.
        let is_stopping = |one: &Pending| one.kind.is_stop() && !one.is_mission && !one.is_answered;
        let is_blocked =
            self.pending.iter().any(is_stopping) || self.pending.len() + 1 >= MAX_ORDERS;
        if run.order.is_none()
            && !is_blocked
            && let Some(step) = run.executor.poll(now)
        {
            let (kind, path) = match step {
                Step::TakeOff { height_m, .. } => (Some(OrderKind::TakeOff(*height_m)), Vec::new()),
                Step::Path(points) => {
                    let path = points.iter().map(PathPoint::position).collect();
                    (Some(OrderKind::Path), path)
                }
                Step::Speed { speed_mps, .. } => (Some(OrderKind::Speed(*speed_mps)), Vec::new()),
                Step::Land { .. } => (Some(OrderKind::Land), Vec::new()),
                Step::Wait { .. } => (None, Vec::new()),
            };
            match kind {
                Some(kind) => self.send_step(kind, path, now),
                None => {
                    let (key, was_answered) = (run.key, run.is_answered);
                    run.is_answered = true;
                    if !was_answered {
                        self.settle(&key, CommandAck::plain(MavResult::Accepted), now);
                    }
                }
            }
        }
        self.follow_mission(now);
    }

    pub(super) fn send_step(
        &mut self,
        kind: OrderKind,
        path: Vec<WaypointPosition>,
        issued: MonotonicNs,
    ) {
        let Some(run) = &mut self.missions.run else {
            return;
        };
        let (key, is_answered, after) = (run.key, run.is_answered, run.before);
        run.is_answered = true;
        // What answers the command is as old as it.
        let issued = if is_answered { issued } else { run.issued };
        if matches!(kind, OrderKind::Speed(_)) {
            self.commands.order(None, Subject::Speed, false, self.frame);
        }
        self.send_order(Pending {
            number: 0,
            request_id: 0,
            kind,
            key,
            then: None,
            is_return: false,
            is_mission: true,
            path,
            issued,
            answer_by: issued,
            is_answered,
            is_accepted: is_answered,
            after,
        });
        let number = self.last_number;
        if let Some(run) = &mut self.missions.run {
            run.order = Some(number);
        }
    }

    /// The waypoints of an order of the kind [`OrderKind::Path`].
    pub fn path(&self, number: u64) -> &[WaypointPosition] {
        let order = self.pending.iter().find(|one| one.number == number);
        order.map_or(&[], |order| &order.path)
    }

    /// The bridge has reported on a step of the mission. Its first answer is that to the command that has begun the
    /// mission.
    pub(super) fn mission_report(
        &mut self,
        pending: &Pending,
        report: &RequestReport,
        (stage, reason): (Stage, Reason),
        words: &str,
        now: MonotonicNs,
    ) {
        let run = self.missions.run.as_mut();
        let Some(run) = run.filter(|run| run.order == Some(pending.number)) else {
            // A step that another one has replaced.
            return;
        };
        run.executor.reached(report.waypoints_reached as usize);
        if stage.is_final() {
            run.order = None;
            // A speed in front of all steps is no order that the bridge knows a step by: what follows is the first one.
            let is_in_front = run.before == 0 && matches!(pending.kind, OrderKind::Speed(_));
            if stage == Stage::Done && !is_in_front {
                run.before = report.request_id;
            }
            match (stage, reason) {
                (Stage::Done, _) | (Stage::Refused, Reason::AlreadyRunning) => {
                    if pending.kind != OrderKind::Start {
                        run.executor.step_done();
                    }
                }
                (Stage::Aborted, Reason::Replaced | Reason::Stopped | Reason::PilotHasControl) => {
                    run.executor.pause();
                }
                (_, Reason::Superseded) => {
                    let between = report.in_between();
                    let between = between.map(|what| format!("before it came {what}"));
                    run.executor.fail(between.as_deref().unwrap_or(words));
                }
                _ => run.executor.fail(words),
            }
        }
        self.follow_mission(now);
    }

    /// A step has no answer of the bridge: what becomes of it is not known.
    pub(super) fn mission_unanswered(&mut self, now: MonotonicNs) {
        if let Some(run) = &mut self.missions.run {
            run.executor.fail("no answer of the bridge");
        }
        self.follow_mission(now);
    }

    /// Somebody else moves the helicopter.
    pub(super) fn pause_mission(&mut self, now: MonotonicNs) {
        if let Some(run) = &mut self.missions.run {
            run.executor.pause();
        }
        self.follow_mission(now);
    }

    /// A hold, a landing or a stop is commanded: nothing begins that has not begun.
    pub(super) fn cancel_start_of_mission(&mut self, now: MonotonicNs) {
        self.missions.primed = None;
        if let Some(starting) = self.missions.starting.take() {
            self.settle(&starting.key, CommandAck::plain(MavResult::Cancelled), now);
        }
        let order = self.missions.run.as_ref().and_then(|run| run.order);
        let waits = |one: &&mut Pending| {
            Some(one.number) == order && one.is_mission && one.kind == OrderKind::Start
        };
        let Some(start) = self.pending.iter_mut().find(waits) else {
            return;
        };
        let unanswered = (!start.is_answered).then_some(start.key);
        start.is_answered = true;
        if let Some(key) = unanswered {
            self.settle(&key, CommandAck::plain(MavResult::Cancelled), now);
        }
        self.pause_mission(now);
    }

    /// The state of the bridge is another one: a hover between two movements is none of its, so it does not end it.
    pub(super) fn look_at_mission(&mut self, now: MonotonicNs) {
        let Some(known) = self.vehicle.now() else {
            return;
        };
        let is_out = known.is_manual() || !known.is_started();
        let hovers = |run: &Run| run.executor.is_running() && run.order.is_none();
        if is_out && self.missions.run.as_ref().is_some_and(hovers) {
            self.pause_mission(now);
        }
    }

    /// Tells stations how far the mission is.
    fn follow_mission(&mut self, now: MonotonicNs) {
        let Some(run) = &mut self.missions.run else {
            return;
        };
        let reached = run.take_reached();
        let next = run.executor.next_item().unwrap_or(1);
        let (severity, text) = match run.executor.progress() {
            Progress::Ready | Progress::Step => (MavSeverity::Info, None),
            Progress::Done => (MavSeverity::Info, Some("mission done".to_owned())),
            Progress::Paused => {
                let text = format!("mission paused: item {next} is the next one");
                (MavSeverity::Notice, Some(text))
            }
            Progress::Failed(reason) => {
                let text = format!("mission stopped at item {next}: {reason}");
                (MavSeverity::Error, Some(text))
            }
        };
        let told = text.is_some().then_some(next);
        let before = std::mem::replace(&mut run.told, told);
        let is_first = before.is_none();
        let (key, is_done) = (run.key, *run.executor.progress() == Progress::Done);
        // Once: a station may choose another item afterwards.
        if told.is_some() && told != before {
            self.missions.next = next;
        }
        if text.is_some() && is_first && !is_done {
            // A copy of the start that comes late must not be told that the mission goes on.
            let answer = CommandAck {
                result: MavResult::Cancelled,
                reason: Reason::Replaced,
            };
            self.commands.amend(&key, answer, now);
        }
        for address in self.stations.addresses() {
            for sequence in reached.clone() {
                let message = MessageWriter::new(MISSION_ITEM_REACHED).u16(sequence as u16);
                self.send(address, &message);
            }
        }
        if let Some(text) = text.filter(|_| is_first) {
            self.say_to_all(severity, &text, now);
        }
    }

    /// Does what is due about missions.
    pub(super) fn advance_missions(&mut self, now: MonotonicNs) {
        let output = self.missions.transfer.advance(now);
        self.transfer(MISSION, output, now);
        if self
            .missions
            .saving
            .take_if(|until| now >= *until)
            .is_some()
        {
            let why = "the disk does not take it; the previous one is in force".to_owned();
            self.end_saving(Mission::default(), Err(why), now);
        }
        self.missions.primed = self.missions.primed.filter(|(_, until)| now < *until);
        let is_late = |starting: &mut Starting| now >= starting.until;
        if let Some(late) = self.missions.starting.take_if(is_late) {
            let why = "the rules of the bridge did not come in time";
            self.refuse_for_now(&late.key, Reason::None, why, now);
        }
        self.drive_mission(now);
    }

    pub(super) fn ask(&mut self, task: Task) {
        // Few kinds, each at most once: a mission that waits for the rules and a start wait for the same.
        if !self.tasks.contains(&task) {
            self.tasks.push_back(task);
        }
    }

    /// What the program around it is to do next.
    pub fn poll_task(&mut self) -> Option<Task> {
        self.tasks.pop_front()
    }
}
