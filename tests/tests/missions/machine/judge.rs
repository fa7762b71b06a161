//! What must hold in the order machine, by what was truly ordered, what the reports said, and which waypoints went over
//! the wire:
//!
//! * no movement begins, and no waypoint of one goes, after a newer order was accepted; a hold, a landing and a stop
//!   count even when they are refused; and what is followed is what was accepted last;
//! * each request gets exactly one final report for each time that it was read, and is executed once at most: nothing
//!   of a path goes after its final report;
//! * nothing begins after its moment;
//! * a step is not accepted when something came between it and the step before, or the step before was not accepted;
//! * no path goes on without its sender, where its request says hold or land, or has a lease, for more than
//!   [`LOST_WITHIN_MS`] in which the bridge is awake; within that time the DSP is told to empty its path buffer, or to
//!   land;
//! * no path ends as *sender lost* whose own sender is not;
//! * no path goes on after the bridge stood still, or the machine slept, for [`STANDSTILL_MS`].

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

/// After so long a pause no path goes on: `pc_timeout_ms`, and a little, because the DSP counts from another moment.
const STANDSTILL_MS: u64 = 2100;

/// What the line was before may delay what the bridge sends for so long: three attempts of a command.
const RECOVERY_MS: u64 = 1000;

/// A sender renews its lease so often, as a part of it.
pub const RENEWALS: u64 = 3;

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
        pub take_offs: u64,
        pub restarts: u64,
        /// How often the machine was suspended.
        pub sleeps: u64,
    }
    "{sequences} sequences, {orders} orders: {accepted} accepted, {began} paths and {take_offs} take-offs begun; reports: {superseded} \
     superseded, {too_late} too late, {lost} sender lost; {copies} copies answered, {steps} steps accepted, {restarts} bridges killed, \
     {sleeps} suspensions; 0 violations"
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
    /// Its sender's process.
    pub process: u32,
    /// It came by the relay, which lives: a station's path ends with its lease alone.
    pub is_station: bool,
    /// In which life of the bridge its last request was read, accepted, and ended; and when.
    pub read: Option<(u32, u64)>,
    pub accepted: Option<(u32, u64)>,
    pub ended: Option<(u32, u64)>,
    /// When it was accepted, by the host's clock.
    pub accepted_host_ms: u64,
    pub began_ms: Option<u64>,
    pub is_superseded: bool,
    /// When its sender was lost, and for how long the bridge stood still since.
    pub lost: Option<(u64, u64)>,
}

impl Default for Order {
    fn default() -> Order {
        Order::at_once(0, What::Hold)
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

    /// Since when it counts against older ones: what ends movements from its reading on, unless it is a step that was
    /// outdated.
    fn counted(&self) -> Option<(u32, u64)> {
        match self.order.what.ends_movements() && !self.is_superseded {
            true => self.read,
            false => self.accepted,
        }
    }

    fn is_path(&self) -> bool {
        matches!(self.order.what, What::Path(_))
    }

    fn ends_with_its_process(&self) -> bool {
        self.is_path() && !self.is_station && self.order.lost != Some(SenderLost::Continue)
    }

    /// What its lease is, if it ends with that, ms.
    fn lease_ms(&self) -> Option<u64> {
        let lease_ms = self.order.lease_ms.filter(|_| self.is_path());
        lease_ms.map(u64::from)
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

/// A path that ended with its sender: since when, for how long the bridge stood still since, and whether the DSP has
/// been told.
#[derive(Debug)]
struct Loss {
    order: usize,
    at_ms: u64,
    stalled_ms: u64,
    lands: bool,
}

/// Judges one run of the order machine by what its senders and the DSP saw.
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
    /// When the bridge was last awake, and when it was before its last long pause.
    last_awake_ms: u64,
    paused_ms: u64,
    /// For how long the machine was suspended: the host's clock did not go on.
    slept_ms: u64,
    /// Processes that stand still or have ended: which, from when, and until when, by the host's clock.
    hangs: Vec<(u32, u64, u64)>,
    losses: Vec<Loss>,
    log: Vec<String>,
    ran: Ran,
}

impl Judge {
    pub fn new(now_ms: u64) -> Judge {
        Judge {
            now_ms,
            last_awake_ms: now_ms,
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

    fn host_ms(&self) -> u64 {
        self.now_ms - self.slept_ms
    }

    /// It ends, and renews nothing any more.
    pub fn process_ended(&mut self, process: u32) {
        let now_ms = self.now_ms;
        self.process_hangs(process, u64::MAX);
        for ordered in &mut self.orders {
            if ordered.process == process && ordered.ends_with_its_process() {
                ordered.lost.get_or_insert((now_ms, 0));
            }
        }
    }

    /// It stands still until this moment of the host's clock.
    pub fn process_hangs(&mut self, process: u32, until_ms: u64) {
        let from_ms = self.host_ms();
        let present = self
            .hangs
            .iter_mut()
            .find(|(other, _, until)| *other == process && *until >= from_ms);
        match present {
            Some((_, _, until)) => *until = until_ms.max(*until),
            None => self.hangs.push((process, from_ms, until_ms)),
        }
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
        for loss in &mut self.losses {
            loss.stalled_ms += ms;
        }
    }

    pub fn sleeps(&mut self) {
        self.ran.sleeps += 1;
    }

    /// The machine is suspended for so long.
    pub fn slept(&mut self, ms: u64) {
        self.slept_ms += ms;
        self.stalled(ms);
    }

    /// The bridge is awake, and has done nothing yet.
    pub fn awake(&mut self) {
        if self.now_ms >= self.last_awake_ms + STANDSTILL_MS {
            self.paused_ms = self.last_awake_ms;
        }
        // What failed while it stood still it finds out now.
        if self.last_trouble_ms > self.last_awake_ms {
            self.last_trouble_ms = self.now_ms;
        }
        self.last_awake_ms = self.now_ms;
    }

    pub fn bridge_killed(&mut self) {
        self.ran.restarts += 1;
        self.losses.clear();
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
        Some((ordered.process, ordered.lease_ms()?))
    }

    /// Whether the request was refused, or not read.
    pub fn is_refused(&self, id: u64) -> bool {
        let mut orders = self.orders.iter();
        let order = orders.find(|ordered| ordered.ids.last() == Some(&id));
        order.is_some_and(|ordered| ordered.accepted.is_none())
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
        // A stop that cannot reach the DSP is aborted, and was taken.
        let is_taken = !matches!(stage, Stage::Refused | Stage::Unknown);
        if is_taken && is_new && self.orders[order].accepted.is_none() {
            self.orders[order].accepted = at;
            self.orders[order].accepted_host_ms = self.host_ms();
            self.ran.accepted += 1;
            self.judge_step(order);
        }
        if stage.is_final() && is_new {
            self.orders[order].ended = at;
            if reason == Reason::SenderLost {
                self.ended_as_lost(order);
            }
        }
    }

    /// A path ended because its sender was lost.
    fn ended_as_lost(&mut self, number: usize) {
        let ordered = &self.orders[number];
        let host_ms = self.host_ms();
        let is_not_renewed = ordered.lease_ms().is_some_and(|lease_ms| {
            let between_ms = lease_ms / RENEWALS;
            self.hangs.iter().any(|(process, from_ms, until_ms)| {
                let since_ms = ordered
                    .accepted_host_ms
                    .max(from_ms.saturating_sub(between_ms));
                *process == ordered.process
                    && host_ms >= since_ms + lease_ms
                    && host_ms <= until_ms.saturating_add(between_ms)
            })
        });
        if ordered.lost.is_none() && !is_not_renewed {
            return self.fail(format!(
                "order {number} ends as sender lost, and its sender lives"
            ));
        }
        let lands = ordered.order.lost == Some(SenderLost::Land);
        if lands || ordered.began_ms.is_some() {
            let (at_ms, stalled_ms) = ordered.lost.unwrap_or((self.now_ms, 0));
            self.losses.push(Loss {
                order: number,
                at_ms,
                stalled_ms,
                lands,
            });
        }
    }

    /// The bridge tells the DSP to empty its path buffer, which a landing does, too.
    pub fn path_invalidated(&mut self, lands: bool) {
        self.losses.retain(|loss| loss.lands && !lands);
    }

    /// Who was lost long ago, and the DSP does not know.
    fn judge_losses(&mut self) {
        let (life, now_ms) = (self.life, self.now_ms);
        let calm_since = self.last_trouble_ms + RECOVERY_MS;
        let orders = &self.orders;
        // The line was bad, or somebody has ordered something else.
        self.losses.retain(|loss| {
            let is_newer = |ordered: &Ordered| {
                let accepted = ordered.accepted.filter(|(of, _)| *of == life);
                accepted.is_some_and(|(_, at)| at >= loss.at_ms)
            };
            loss.at_ms > calm_since && !(loss.lands && orders.iter().any(is_newer))
        });
        let late = self
            .losses
            .iter()
            .find(|loss| now_ms > loss.at_ms + loss.stalled_ms + LOST_WITHIN_MS);
        if let Some(Loss { order, lands, .. }) = late {
            let what = if *lands { "to land" } else { "to hover" };
            self.fail(format!(
                "the sender of order {order} was lost, and the DSP is not told {what}"
            ));
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
        let since = self.orders[before].accepted;
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

    /// The bridge sends a waypoint of an order, or the command to take off; `is_first`: that of its begin.
    pub fn sent(&mut self, number: usize, is_first: bool) {
        let (life, now_ms) = (self.life, self.now_ms);
        let Some(ordered) = self.orders.get(number).cloned() else {
            return self.fail(format!("something of no order is sent: {number}"));
        };
        let is_take_off = ordered.order.what == What::TakeOff;
        let text = match is_take_off {
            true => format!("the take-off of order {number} is sent"),
            false => format!("a waypoint of order {number} is sent"),
        };
        if let Some((of, _)) = ordered.ended.filter(|(of, _)| *of == life) {
            return self.fail(format!("{text} after its final report in life {of}"));
        }
        if is_first && ordered.began_ms.is_none() {
            self.note(format!("order {number} begins"));
            let count = match is_take_off {
                true => &mut self.ran.take_offs,
                false => &mut self.ran.began,
            };
            *count += 1;
            self.orders[number].began_ms = Some(now_ms);
        }
        if ordered
            .began_ms
            .is_some_and(|began_ms| began_ms <= self.paused_ms)
        {
            return self.fail(format!("{text}, and it began before a long pause"));
        }
        // A command that is not acknowledged is sent again only until then.
        if (is_take_off || is_first && ordered.began_ms.is_none())
            && ordered.latest_ms().is_some_and(|latest| now_ms > latest)
        {
            return self.fail(format!(
                "order {number} begins after its moment, {:?} ms",
                ordered.latest_ms()
            ));
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
        let (now_ms, host_ms) = (self.now_ms, self.host_ms());
        for (process, from_ms, until_ms) in self.hangs.iter().filter(|_| is_awake) {
            for ordered in &mut self.orders {
                // It renewed up to when it hung, or ordered since. A bridge that is awake has seen that it did not
                // since.
                let lost_ms = |lease_ms| ordered.accepted_host_ms.max(*from_ms) + lease_ms;
                let is_lost = (ordered.process == *process && ordered.accepted.is_some())
                    && ordered.lease_ms().map(lost_ms) < Some(host_ms)
                    && host_ms < *until_ms;
                if is_lost && ordered.lease_ms().is_some() {
                    ordered.lost.get_or_insert((now_ms, 0));
                }
            }
        }
        self.judge_losses();
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
