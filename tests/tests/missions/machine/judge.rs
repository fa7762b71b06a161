//! What must hold in the order machine, by what was truly ordered, what the reports said, and which waypoints went over
//! the wire:
//!
//! * no movement begins, and no waypoint of one goes, after a newer order was accepted; a hold, a landing and a stop
//!   count even when they are refused; and what is followed is what was accepted last;
//! * each request gets exactly one final report for each time that it was read, and is executed once at most: nothing
//!   of a path goes after its final report;
//! * nothing begins after its moment;
//! * a step is not accepted when something came between it and the step before;
//! * no path goes on without its sender, where its request says hold or land, for more than [`LOST_WITHIN_MS`] in which
//!   the bridge is awake.

use ipc_types::code::{Reason, SenderLost, Stage};
use ipc_types::payload::RequestReport;

use super::Failure;
use super::sequence::{Order, What};
use crate::missions::seeds::sums;

/// How long a path may go on when its sender is lost.
const LOST_WITHIN_MS: u64 = 300;

/// `begin_within_ms` of the bridge, and that of what ends movements.
const BEGIN_WITHIN_MS: u64 = 5000;
const STOP_WITHIN_MS: u64 = 30_000;

/// A pilot who has flown for so long, with a bridge that was awake and a line that was sound, has been seen.
const PILOT_SEEN_MS: u64 = 500;

sums! {
    /// What sequences had in them.
    pub struct Ran {
        pub sequences: u64,
        pub orders: u64,
        pub accepted: u64,
        pub began: u64,
        pub superseded: u64,
        pub too_late: u64,
        /// Paths that ended with their sender.
        pub lost: u64,
        /// Copies that were answered.
        pub copies: u64,
        /// Steps that were accepted.
        pub steps: u64,
        pub restarts: u64,
    }
    "{sequences} sequences, {orders} orders: {accepted} accepted, {began} paths begun; reports: {superseded} superseded, {too_late} \
     too late, {lost} sender lost; {copies} copies answered, {steps} steps accepted, {restarts} bridges killed; 0 violations"
}

/// An order, and what became of it.
#[derive(Clone, Debug, Default)]
pub struct Ordered {
    pub order: Order,
    pub ids: Vec<u64>,
    /// The request that its sender names as the step before.
    pub after: u64,
    /// When it was truly issued, and when its sender says so.
    pub true_ms: u64,
    pub issued_ms: u64,
    pub begin_by_ms: Option<u64>,
    /// The process whose end is its sender's; a station's is the relay's, which lives.
    pub process: Option<u32>,
    /// In which life of the bridge its last request was read, accepted, and ended; and when.
    pub read: Option<(u32, u64)>,
    pub accepted: Option<(u32, u64)>,
    pub ended: Option<(u32, u64)>,
    pub began_ms: Option<u64>,
    pub is_superseded: bool,
    /// When its sender was lost, and for how long the bridge stood still since.
    pub lost: Option<(u64, u64)>,
}

impl Default for Order {
    fn default() -> Order {
        Order {
            sender: 0,
            what: What::Hold,
            late_ms: 0,
            copy_ms: None,
            within_ms: None,
            is_step: false,
            lost: None,
            lease_ms: None,
        }
    }
}

impl Ordered {
    /// Until when it may begin. `None` where each waypoint has its time from its arrival.
    fn latest_ms(&self) -> Option<u64> {
        let within_ms = match self.order.what.ends_movements() {
            true => STOP_WITHIN_MS,
            false => BEGIN_WITHIN_MS,
        };
        let by_default = (self.ids.len() == 1).then_some(self.issued_ms + within_ms);
        self.begin_by_ms.or(by_default)
    }

    /// Since when it counts against older ones: what ends movements from its reading on, if it is no step, which may be
    /// refused for what came before.
    fn counted(&self) -> Option<(u32, u64)> {
        let is_absolute = self.order.what.ends_movements() && self.after == 0;
        if is_absolute {
            self.read
        } else {
            self.accepted
        }
    }

    /// From when on a step may follow it. What ends movements counts although it is refused, unless it was superseded
    /// itself.
    fn followed_from(&self) -> Option<(u32, u64)> {
        let is_read = !self.is_superseded && self.order.what.ends_movements();
        if is_read { self.read } else { self.accepted }
    }

    fn ends_with_its_sender(&self) -> bool {
        let is_path = matches!(self.order.what, What::Path(_));
        is_path && self.order.lost != Some(SenderLost::Continue)
    }
}

/// Requests that a life of the bridge read, and how often it was asked and answered.
#[derive(Debug)]
struct Asked {
    life: u32,
    order: usize,
    /// Its id for the sender.
    id: u64,
    /// Its id for the bridge.
    told_id: u64,
    times: u32,
    finals: u32,
    is_killed: bool,
}

/// Judges the order machine by orders, reports and what went over the wire.
#[derive(Debug, Default)]
pub struct Judge {
    pub now_ms: u64,
    pub failure: Option<String>,
    pub orders: Vec<Ordered>,
    asked: Vec<Asked>,
    life: u32,
    life_began_ms: u64,
    /// Spans in which the pilot flew.
    pilot: Vec<(u64, u64)>,
    last_trouble_ms: u64,
    last_stall_ms: u64,
    /// Processes that stand still: which, from when, and until when.
    hangs: Vec<(u32, u64, u64)>,
    log: Vec<String>,
    ran: Ran,
}

impl Judge {
    pub fn new(now_ms: u64) -> Judge {
        Judge {
            now_ms,
            life: 1,
            ran: Ran {
                sequences: 1,
                ..Ran::default()
            },
            ..Judge::default()
        }
    }

    pub fn note(&mut self, text: String) {
        self.log.push(format!("{:>8} ms  {text}", self.now_ms));
    }

    pub fn fail(&mut self, what: String) {
        self.note(format!("VIOLATION: {what}"));
        self.failure.get_or_insert(what);
    }

    pub fn ordered(&mut self, ordered: Ordered) {
        self.note(format!(
            "  is order {}, requests {:?}",
            self.orders.len(),
            ordered.ids
        ));
        self.orders.push(ordered);
        self.ran.orders += 1;
    }

    /// What the sender of the order means by the step before.
    pub fn step_before(&self, sender: usize, number: usize) -> u64 {
        let before = self.orders[..number].iter().rev();
        let mut own = before.filter(|ordered| ordered.order.sender == sender);
        own.next()
            .map_or(0, |ordered| ordered.ids[ordered.ids.len() - 1])
    }

    pub fn meant_after(&mut self, number: usize, after: u64) {
        self.orders[number].after = after;
    }

    pub fn process_ended(&mut self, process: u32, now_ms: u64) {
        for ordered in &mut self.orders {
            if ordered.process == Some(process) && ordered.ends_with_its_sender() {
                ordered.lost.get_or_insert((now_ms, 0));
            }
        }
    }

    pub fn process_hangs(&mut self, process: u32, from_ms: u64, until_ms: u64) {
        self.hangs.push((process, from_ms, until_ms));
    }

    /// The line or the DSP fails: what the bridge should do it may not be able to.
    pub fn trouble(&mut self, now_ms: u64) {
        self.last_trouble_ms = now_ms;
    }

    pub fn pilot_until(&mut self, from_ms: u64, until_ms: u64) {
        self.pilot.push((from_ms, until_ms));
    }

    pub fn stalled(&mut self, ms: u64) {
        self.last_stall_ms = self.now_ms;
        for (_, stalled_ms) in self
            .orders
            .iter_mut()
            .filter_map(|ordered| ordered.lost.as_mut())
        {
            *stalled_ms += ms;
        }
    }

    pub fn bridge_killed(&mut self) {
        self.ran.restarts += 1;
        for asked in self
            .asked
            .iter_mut()
            .filter(|asked| asked.life == self.life)
        {
            asked.is_killed = true;
        }
    }

    pub fn bridge_began(&mut self) {
        self.life += 1;
        self.life_began_ms = self.now_ms;
        self.note("the bridge begins again".to_owned());
    }

    /// The bridge reads a request.
    pub fn delivered(&mut self, order: usize, id: u64, told_id: u64) {
        let life = self.life;
        let asked = self
            .asked
            .iter_mut()
            .find(|asked| asked.life == life && asked.told_id == told_id);
        match asked {
            Some(asked) => asked.times += 1,
            None => self.asked.push(Asked {
                life,
                order,
                id,
                told_id,
                times: 1,
                finals: 0,
                is_killed: false,
            }),
        }
        let (life, now_ms) = (self.life, self.now_ms);
        let ordered = &mut self.orders[order];
        if ordered.ids.last() == Some(&id) {
            ordered.read.get_or_insert((life, now_ms));
        }
    }

    /// The sender of a path and how often it renews it, ms.
    pub fn leased(&self, path_id: u64) -> Option<(u32, u64)> {
        let ordered = self
            .orders
            .iter()
            .find(|ordered| ordered.ids[0] == path_id)?;
        // A station's lease is the relay's to renew, which lives.
        let process = ordered
            .process
            .unwrap_or(1000 + ordered.order.sender as u32);
        Some((process, ordered.order.lease_ms?.into()))
    }

    pub fn reported(&mut self, report: &RequestReport) {
        let (Some(stage), Some(reason)) = (report.stage(), report.reason()) else {
            return self.fail(format!("{report:?} is none"));
        };
        let (life, id) = (self.life, report.request_id);
        if stage != Stage::Progress {
            self.note(format!("{id}: {stage} {reason}"));
        }
        let asked = self
            .asked
            .iter_mut()
            .find(|asked| asked.life == life && asked.told_id == id);
        let Some(asked) = asked else { return };
        if stage.is_final() {
            asked.finals += 1;
            if asked.finals > asked.times {
                let text = format!(
                    "{} final reports for request {id}, which was asked {} times",
                    asked.finals, asked.times
                );
                return self.fail(text);
            }
            self.ran.copies += u64::from(asked.finals > 1);
        }
        let (order, is_last) = (
            asked.order,
            self.orders[asked.order].ids.last() == Some(&asked.id),
        );
        let is_about_a_copy = matches!(reason, Reason::StillOpen | Reason::NotRemembered);
        if !is_last || is_about_a_copy || asked.id != asked.told_id {
            return;
        }
        self.ran.superseded += u64::from(reason == Reason::Superseded);
        self.ran.too_late += u64::from(reason == Reason::TooLate);
        self.ran.lost += u64::from(reason == Reason::SenderLost);
        self.orders[order].is_superseded |= reason == Reason::Superseded;
        let is_new = self.orders[order].ended.is_none();
        let at = Some((life, self.now_ms));
        let is_taken = stage == Stage::Accepted || stage == Stage::Done;
        if is_taken && is_new && self.orders[order].accepted.is_none() {
            self.orders[order].accepted = at;
            self.ran.accepted += 1;
            self.judge_step(order);
        }
        if stage.is_final() && is_new {
            self.orders[order].ended = at;
        }
    }

    /// A step was accepted: nothing came between it and the step before.
    fn judge_step(&mut self, number: usize) {
        let step = &self.orders[number];
        let after = step.after;
        if after == 0 {
            return;
        }
        self.ran.steps += 1;
        let Some(before) = self
            .orders
            .iter()
            .position(|ordered| ordered.ids.last() == Some(&after))
        else {
            return;
        };
        let (life, now_ms) = (self.life, self.now_ms);
        let text = format!("order {number} is accepted as the step after order {before}");
        let since = self.orders[before].followed_from();
        let Some((_, since_ms)) = since.filter(|(other, _)| *other == life) else {
            return self.fail(format!("{text}, which this bridge did not accept"));
        };
        let between = self.orders.iter().enumerate().find(|(other, ordered)| {
            let is_between = ordered
                .accepted
                .is_some_and(|(of, at)| of == life && at > since_ms && at < now_ms);
            is_between && *other != number && *other != before
        });
        if let Some((other, _)) = between {
            return self.fail(format!("{text}, but order {other} came between"));
        }
        let is_calm = self.last_trouble_ms < since_ms && self.last_stall_ms < since_ms;
        let flew_before = self
            .pilot
            .iter()
            .any(|(from, until)| *from <= since_ms && *until >= since_ms);
        let flew = self.pilot.iter().any(|(from, until)| {
            let until = (*until).min(now_ms);
            *from >= since_ms && until >= from + PILOT_SEEN_MS
        });
        if is_calm && flew && !flew_before {
            self.fail(format!("{text}, but the pilot flew between"));
        }
    }

    /// The bridge sends a waypoint of an order; `is_first`: that of its begin.
    pub fn waypoint_sent(&mut self, number: usize, is_first: bool) {
        let (life, now_ms) = (self.life, self.now_ms);
        let Some(ordered) = self.orders.get(number).cloned() else {
            return self.fail(format!("a waypoint of no order: {number}"));
        };
        let text = format!("a waypoint of order {number} is sent");
        if let Some((of, _)) = ordered.ended.filter(|(of, _)| *of == life) {
            return self.fail(format!("{text} after its final report in life {of}"));
        }
        if is_first && ordered.began_ms.is_none() {
            self.note(format!("order {number} begins"));
            self.ran.began += 1;
            self.orders[number].began_ms = Some(now_ms);
            if ordered.latest_ms().is_some_and(|latest| now_ms > latest) {
                return self.fail(format!(
                    "order {number} begins after its moment, {:?} ms",
                    ordered.latest_ms()
                ));
            }
        }
        let newer = self.orders.iter().enumerate().find(|(_, other)| {
            let counts = other.counted();
            // At one wake-up the requests are read after the grant that a path goes on with.
            other.true_ms > ordered.true_ms
                && counts.is_some_and(|(of, at)| of == life && at < now_ms)
        });
        if let Some((other, _)) = newer {
            // A start changes nothing of a path that goes on.
            let is_start = self.orders[other].order.what == What::Start;
            let is_refused = self.orders[other].accepted.is_none();
            let goes_on = ordered.began_ms.is_some_and(|began| {
                let read = self.orders[other].read.map_or(0, |(_, at)| at);
                began < read && (is_start || is_refused)
            });
            if !goes_on {
                return self.fail(format!("{text} after the newer order {other}"));
            }
        }
        if let Some((lost_ms, stalled_ms)) = ordered.lost
            && now_ms > lost_ms + stalled_ms + LOST_WITHIN_MS
        {
            self.fail(format!(
                "{text} {} ms after its sender was lost",
                now_ms - lost_ms
            ));
        }
    }

    /// The bridge follows this path now.
    pub fn look(&mut self, follows: Option<u64>, is_awake: bool) {
        let now_ms = self.now_ms;
        for (process, from_ms, until_ms) in self.hangs.clone() {
            for ordered in &mut self.orders {
                let lease_ms = ordered.order.lease_ms.map(u64::from);
                let is_its = ordered.process == Some(process) && ordered.ends_with_its_sender();
                if let Some(lease_ms) = lease_ms.filter(|_| is_its) {
                    // It renewed up to when it hung, or ordered since.
                    let lost_ms =
                        ordered.accepted.map_or(from_ms, |(_, at)| at.max(from_ms)) + lease_ms;
                    if lost_ms < until_ms && lost_ms <= now_ms && ordered.accepted.is_some() {
                        ordered.lost.get_or_insert((lost_ms, 0));
                    }
                }
            }
        }
        let path = self
            .orders
            .iter()
            .position(|ordered| Some(ordered.ids[0]) == follows);
        let Some(number) = path else { return };
        self.judge_last(number);
        let Some((lost_ms, stalled_ms)) = self.orders[number].lost else {
            return;
        };
        if is_awake && now_ms > lost_ms + stalled_ms + LOST_WITHIN_MS {
            self.fail(format!(
                "order {number} is followed {} ms after its sender was lost",
                now_ms - lost_ms
            ));
        }
    }

    /// The path that is followed is what was accepted last; a start ends nothing.
    fn judge_last(&mut self, number: usize) {
        let life = self.life;
        let taken = |ordered: &Ordered| ordered.accepted.filter(|(of, _)| *of == life);
        let Some((_, since_ms)) = taken(&self.orders[number]) else {
            return;
        };
        let later = self.orders.iter().enumerate().find(|(other, ordered)| {
            let at_ms = taken(ordered).map_or(0, |(_, at)| at);
            *other != number
                && ordered.order.what != What::Start
                && at_ms > since_ms
                && at_ms < self.now_ms
        });
        if let Some((other, _)) = later {
            self.fail(format!(
                "order {number} is followed after order {other} was accepted"
            ));
        }
    }

    /// The bridge has ended in order: every request that this life read has its final reports.
    pub fn closed(&mut self) {
        let life = self.life;
        let open = self
            .asked
            .iter()
            .find(|asked| asked.life == life && !asked.is_killed && asked.finals != asked.times);
        if let Some(asked) = open {
            let text = format!(
                "{} final reports for request {}, which was asked {} times",
                asked.finals, asked.told_id, asked.times
            );
            self.fail(text);
        }
    }

    /// # Errors
    /// What was broken.
    pub fn verdict(self) -> Result<Ran, Failure> {
        match self.failure {
            None => Ok(self.ran),
            Some(what) => Err(Failure {
                what,
                log: self.log,
            }),
        }
    }
}
