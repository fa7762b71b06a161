//! What must hold of the orders to one robot, by what was truly ordered, what the reports said, and which waypoints
//! went over the wire:
//!
//! * no movement begins, and no waypoint of one goes, after a newer order was accepted; a hold, a landing and a stop
//!   count even when they are refused; and what is followed is what was accepted last;
//! * each request gets exactly one final report for each time that it was read, and is executed once at most: nothing
//!   of a path goes after its final report; a client at a station gets one final report for each time that it asked,
//!   which is what the bridge said, if it says how a movement ended;
//! * nothing begins after its moment;
//! * a step is not accepted when something came between it and the step before, or the step before was not accepted;
//! * no path goes on without its sender, where its request says hold or land, or has a lease, for more than
//!   [`LOST_WITHIN_MS`] in which the bridge is awake; within that time the DSP is told to empty its path buffer, or
//!   to land; none of a station goes on that is silent for longer than `link_loss` lets it, or whose client is gone;
//! * no path ends as *sender lost* whose own sender is not;
//! * a port is written by orders that were accepted, within their moment, and not after their end; what is said of it
//!   is what it was;
//! * no path goes on after the bridge stood still, or the machine slept, for [`STANDSTILL_MS`].

use std::collections::BTreeMap;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, SenderLost, Stage};
use ipc_types::payload::RequestReport;

use crate::life::{EPOCH_MS, MS};
use crate::missions::seeds::sums;
use crate::request::COPY;
use crate::script::{LINK_LOSS_MS, LinkLoss, Order, STATION_LOST_MS, What, station_of};

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

/// A path whose client at a station is gone may go on for so long while the link between them is good.
const GONE_WITHIN_MS: u64 = 3_000;

/// What an order at a station is known to, and what a trouble lasts behind its end, at most.
const BEFORE_MS: u64 = 2_500;

/// What is told of the port was read within so long.
const READ_WITHIN_MS: u64 = 6_000;

/// A pilot who has flown for so long, with a bridge that was awake and a line that was sound, has been seen.
const PILOT_SEEN_MS: u64 = 500;

sums! {
    /// What runs had in them.
    pub struct Ran {
        pub runs: u64,
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
        /// How often a robot's machine was suspended.
        pub sleeps: u64,
        /// Final reports that came to clients at stations.
        pub at_stations: u64,
        /// Samples that came to stations.
        pub samples: u64,
        /// Answers that stations of MAVLink got to their commands.
        pub acks: u64,
        /// Ports that were read and written.
        pub parameters: u64,
        /// Missions that stations were told are accepted, and paths of missions.
        pub missions: u64,
        pub mission_paths: u64,
        /// Paths of plans.
        pub plan_paths: u64,
        /// What was pressed on pages, and of how much they know the end.
        pub presses: u64,
        pub page_ends: u64,
        /// Holds because no page commanded any more.
        pub page_holds: u64,
        /// Pictures that pages showed as of now.
        pub drawn: u64,
    }
    "{runs} runs, {orders} orders: {accepted} accepted, {began} paths and {take_offs} take-offs begun; reports: {superseded} \
     superseded, {too_late} too late, {lost} sender lost; {copies} copies answered, {steps} steps accepted, {restarts} bridges killed, \
     {sleeps} suspensions; {at_stations} reports and {samples} samples at stations, {acks} answers over MAVLink, {missions} missions, {mission_paths} paths of them, {plan_paths} paths of plans; \
     {parameters} ports read or written; {presses} presses on pages, {page_ends} of them answered, {page_holds} holds without a page, {drawn} looks; 0 violations"
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
    /// For how long the robot's machine had slept then.
    pub slept_ms: u64,
    pub issued_ms: u64,
    pub begin_by_ms: Option<u64>,
    /// The process on the robot's machine that asks the bridge: the sender's, or the relay; 0 for none yet.
    pub process: u32,
    /// The station whose relay it takes.
    pub station: Option<usize>,
    /// The station could not know what the robot's clock shows.
    pub is_vague: bool,
    /// The client was said to be gone, or was told that nothing is known: the path may end for want of it.
    pub may_be_lost: bool,
    /// When its client at the station was gone.
    pub client_gone_ms: Option<u64>,
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
        Order::at_once(0, 0, What::Hold)
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
        if self.order.what.is_parameter() {
            return None;
        }
        match self.order.what.ends_movements() && !self.is_superseded {
            true => self.read,
            false => self.accepted,
        }
    }

    fn is_path(&self) -> bool {
        matches!(self.order.what, What::Path(_))
    }

    fn ends_with_its_process(&self) -> bool {
        self.is_path() && self.order.lost != Some(SenderLost::Continue)
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
    /// Times whose asker has given up.
    excused: u32,
    is_killed: bool,
}

/// A request of a program at a station: how often it was asked and answered.
#[derive(Debug, Default)]
struct AtStation {
    asked: u32,
    finals: u32,
    /// Times whose asker, or whose relay, is gone.
    gone: u32,
    has_begun: bool,
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
    /// When a rule of safety may have held last.
    last_breach_ms: u64,
    /// When the bridge was last awake, and when it was before its last long pause.
    last_awake_ms: u64,
    paused_ms: u64,
    /// The machine's suspensions, in which the host's clock did not go on: when it was awake last, and how long each
    /// lasted.
    sleeps: Vec<(u64, u64)>,
    /// Processes that stand still or have ended: which, from when, and until when, by the host's clock.
    hangs: Vec<(u32, u64, u64)>,
    losses: Vec<Loss>,
    /// The order whose path is followed.
    follows: Option<usize>,
    /// Values of the port that writes have, and which order each is.
    writes: Vec<(f64, usize)>,
    /// The values that the DSP's port had, and since when, the last one last.
    values: Vec<(u64, f64)>,
    /// The last write of this life of the bridge that was done.
    last_write: Option<usize>,
    /// Which robot it is.
    robot: usize,
    clients: BTreeMap<u64, AtStation>,
    /// How the bridge said that a request ended.
    ends: Vec<(u64, u32, u32)>,
    /// When the robot's relay or gateway heard each station last, or the relay stood still.
    heard: BTreeMap<usize, u64>,
    /// When the gateway was not awake last.
    gateway_pause_ms: u64,
    /// When each station's link was bad last.
    bad_links: BTreeMap<usize, u64>,
    pub link_loss: LinkLoss,
    pub log: Vec<(u64, String)>,
    pub ran: Ran,
}

/// Whether a value of the port is this one: on its way it is a number of 32 bits.
pub fn is_same_value(one: f64, other: f64) -> bool {
    (one - other).abs() < 1e-4
}

impl Judge {
    pub fn new(robot: usize, now_ms: u64) -> Judge {
        Judge {
            robot,
            now_ms,
            last_awake_ms: now_ms,
            life: 1,
            ran: Ran {
                runs: 0,
                ..Ran::default()
            },
            ..Judge::default()
        }
    }

    pub fn note(&mut self, text: String) {
        let robot = self.robot;
        self.log
            .push((self.now_ms, format!("robot {robot}: {text}")));
    }

    pub fn fail(&mut self, what: String) {
        self.note(format!("VIOLATION: {what}"));
        self.failure.get_or_insert(what);
    }

    pub fn ordered(&mut self, mut ordered: Ordered) {
        ordered.slept_ms = self.slept_at(ordered.true_ms);
        self.note(format!(
            "  is order {}, requests {:?}",
            self.orders.len(),
            ordered.ids
        ));
        self.orders.push(ordered);
        self.ran.orders += 1;
    }

    /// The robot's relay orders something by itself. Gives its number.
    pub fn own_order(&mut self, id: u64, lands: bool) -> usize {
        let what = if lands { What::Land } else { What::Hold };
        self.ordered(Ordered {
            order: Order::at_once(usize::MAX, self.robot, what),
            ids: vec![id],
            true_ms: self.now_ms,
            issued_ms: self.now_ms,
            ..Ordered::default()
        });
        self.orders.len() - 1
    }

    /// Which order this request is of.
    pub fn order_of(&self, id: u64) -> Option<usize> {
        let id = id % COPY;
        let mut orders = self.orders.iter();
        orders.position(|ordered| ordered.ids.contains(&id))
    }

    /// The bridge that lives has accepted this order, and has not said that it has ended.
    pub fn goes_on(&self, number: usize) -> bool {
        let ordered = &self.orders[number];
        ordered.accepted.is_some_and(|(life, _)| life == self.life) && ordered.ended.is_none()
    }

    /// Its process has ordered something newer, which the bridge has not answered yet.
    pub fn is_overtaken(&self, number: usize) -> bool {
        let process = self.orders[number].process;
        let is_asked = |it: &Ordered| it.accepted.is_none() && it.ended.is_none();
        let mut newer = self.orders[number + 1..].iter();
        newer.any(|it| it.process == process && is_asked(it))
    }

    /// The relay asks the bridge for this order.
    pub fn carried_by(&mut self, number: usize, process: u32) {
        self.orders[number].process = process;
    }

    /// The client of a request is gone, or told that nothing is known of it.
    pub fn may_be_lost(&mut self, id: u64) {
        if let Some(number) = self.order_of(id) {
            self.orders[number].may_be_lost = true;
        }
    }

    /// The bridge is told that the asker of a request is gone.
    pub fn given_up(&mut self, id: u64) {
        let (life, now_ms) = (self.life, self.now_ms);
        let mut asked = self.asked.iter_mut();
        if let Some(asked) = asked.find(|asked| asked.life == life && asked.told_id == id) {
            asked.excused += 1;
        }
        let Some(number) = self.order_of(id) else {
            return;
        };
        let ordered = &mut self.orders[number];
        ordered.may_be_lost = true;
        if ordered.ends_with_its_process() && ordered.ids.last() == Some(&id) {
            ordered.lost.get_or_insert((now_ms, 0));
        }
    }

    /// A program at a station asks.
    pub fn client_asks(&mut self, id: u64) {
        self.clients.entry(id).or_default().asked += 1;
    }

    /// The station's relay has ended, and with it its side of a request: `link_loss` says what becomes of a path.
    pub fn relay_gone(&mut self, id: u64) {
        match self.link_loss {
            LinkLoss::Continue => self.nobody_waits(id),
            _ => self.client_gone(id),
        }
    }

    fn nobody_waits(&mut self, id: u64) {
        self.may_be_lost(id);
        self.clients.entry(id).or_default().gone += 1;
    }

    /// Nobody waits for a report about this request any more.
    pub fn client_gone(&mut self, id: u64) {
        self.nobody_waits(id);
        let now_ms = self.now_ms;
        if let Some(number) = self.order_of(id) {
            self.orders[number].client_gone_ms.get_or_insert(now_ms);
        }
    }

    /// A program at a station is told something.
    pub fn client_reported(&mut self, id: u64, report: &RequestReport) {
        let (Some(stage), Some(reason)) = (report.stage(), report.reason()) else {
            return self.fail(format!("{report:?} is none"));
        };
        if stage != Stage::Progress {
            self.note(format!("the client of {id} is told: {stage} {reason}"));
        }
        if reason == Reason::RelayLinkLost {
            self.may_be_lost(id);
        }
        let ends = (id, report.stage, report.reason);
        let is_true = self.ends.contains(&ends);
        let has_begun = (self.order_of(id)).is_some_and(|it| self.orders[it].began_ms.is_some());
        let client = self.clients.entry(id).or_default();
        if !stage.is_final() {
            let is_first = !std::mem::replace(&mut client.has_begun, true);
            if is_first && stage == Stage::Progress {
                self.fail(format!(
                    "the client of {id} has progress before it is accepted"
                ));
            }
            return;
        }
        client.finals += 1;
        self.ran.at_stations += 1;
        let (finals, asked) = (client.finals, client.asked);
        if finals + client.gone > asked {
            return self.fail(format!(
                "the client of {id} has {finals} final reports, and asked {asked} times"
            ));
        }
        if matches!(stage, Stage::Done | Stage::Aborted) && !is_true {
            return self.fail(format!(
                "the client of {id} is told {stage} {reason}, which nobody said"
            ));
        }
        if stage == Stage::Refused && asked == 1 && has_begun {
            self.fail(format!(
                "request {id} was carried out, and its client told {stage} {reason}"
            ));
        }
    }

    /// Everything has come to its end: every client has its reports.
    pub fn all_told(&mut self) {
        let open = self
            .clients
            .iter()
            .find(|(_, client)| client.finals + client.gone < client.asked);
        if let Some((id, client)) = open {
            let text = format!(
                "the client of {id} asked {} times, and has {} final reports",
                client.asked, client.finals
            );
            self.fail(text);
        }
    }

    /// Whether a client waits for a report.
    pub fn has_waiting(&self) -> bool {
        let mut clients = self.clients.values();
        clients.any(|client| client.finals + client.gone < client.asked)
    }

    /// The robot's relay has heard a station.
    pub fn station_heard(&mut self, station: usize) {
        self.heard.insert(station, self.now_ms);
    }

    /// The robot's relay is not awake.
    pub fn relay_pauses(&mut self) {
        let of_relay = self.heard.range_mut(..station_of(0));
        of_relay.for_each(|(_, heard)| *heard = self.now_ms);
    }

    /// The robot's gateway to MAVLink is not awake.
    pub fn gateway_pauses(&mut self) {
        self.gateway_pause_ms = self.now_ms;
    }

    /// Not every message between them passes, or one of them stands still.
    pub fn link_is_bad(&mut self, station: usize) {
        self.bad_links.insert(station, self.now_ms);
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
        self.now_ms - self.slept_at(self.now_ms)
    }

    /// When the host's clock truly showed this.
    pub fn true_ms_of(&self, host: MonotonicNs) -> u64 {
        let now_ns = (EPOCH_MS + self.host_ms()) * MS;
        let age_ms = now_ns.saturating_sub(host.0) / MS;
        let mut at_ms = self.host_ms().saturating_sub(age_ms);
        for (awake_ms, slept_ms) in &self.sleeps {
            if at_ms > *awake_ms {
                at_ms += slept_ms;
            }
        }
        at_ms
    }

    /// For how long the machine had slept at a moment.
    fn slept_at(&self, at_ms: u64) -> u64 {
        let sleeps = self.sleeps.iter().filter(|(awake_ms, _)| *awake_ms < at_ms);
        sleeps.map(|(_, slept_ms)| slept_ms).sum()
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

    /// A rule of safety may hold, or end what it has held.
    pub fn breach(&mut self, until_ms: u64) {
        self.last_breach_ms = self.last_breach_ms.max(until_ms);
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
        match self.sleeps.last_mut() {
            Some((awake_ms, slept_ms)) if *awake_ms + *slept_ms + ms == self.now_ms => {
                *slept_ms += ms;
            }
            _ => self.sleeps.push((self.now_ms - ms, ms)),
        }
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
        self.last_write = None;
        for asked in self
            .asked
            .iter_mut()
            .filter(|asked| asked.life == self.life)
        {
            asked.is_killed = true;
        }
    }

    /// An order writes this value.
    pub fn writes(&mut self, order: usize, value: f64) {
        self.writes.push((value, order));
    }

    /// The bridge writes the port. Which of the orders with this value it writes cannot be seen: one at least may be
    /// written now.
    pub fn written(&mut self, value: f64) {
        let of_value = self
            .writes
            .iter()
            .filter(|(it, _)| is_same_value(*it, value));
        // That of the configuration has no order.
        let faults: Vec<_> = of_value
            .map(|(_, order)| self.write_fault(*order))
            .collect();
        if let Some(Some(what)) = faults.last()
            && faults.iter().all(Option::is_some)
        {
            self.fail(what.clone());
        }
    }

    /// What is wrong with the write of this order now.
    fn write_fault(&self, number: usize) -> Option<String> {
        let ordered = &self.orders[number];
        let text = format!("the write of order {number} is sent");
        let is_of_life = ordered.accepted.is_some_and(|(of, _)| of == self.life);
        let ended = ordered.ended.filter(|(of, _)| *of == self.life);
        let latest_ms = ordered.latest_ms().map(|latest| latest - ordered.slept_ms);
        if !is_of_life {
            Some(format!("{text}, which was not accepted"))
        } else if ended.is_some_and(|(_, at_ms)| at_ms < self.now_ms)
            && self.last_write != Some(number)
        {
            // After a boot of the DSP the last one is written again. What is sent at the moment of the report may have
            // been sent before it.
            Some(format!("{text} after its final report"))
        } else if ended.is_none()
            && !ordered.is_vague
            && latest_ms.is_some_and(|latest_ms| self.host_ms() > latest_ms)
        {
            Some(format!("{text} after its moment, {latest_ms:?} ms"))
        } else {
            None
        }
    }

    /// The DSP's port has this value.
    pub fn has_value(&mut self, value: f64) {
        if self.values.last().is_none_or(|(_, last)| *last != value) {
            self.values.push((self.now_ms, value));
        }
    }

    /// What is said of the port was its value of late.
    pub fn judge_value(&mut self, value: f64) {
        let since_ms = self.now_ms.saturating_sub(READ_WITHIN_MS);
        let before = self.values.iter().rposition(|(at_ms, _)| *at_ms < since_ms);
        let mut values = self.values[before.unwrap_or(0)..].iter();
        let is_known = values.any(|(_, it)| is_same_value(*it, value));
        let is_calm = self.last_trouble_ms + READ_WITHIN_MS < self.now_ms;
        if is_calm && !is_known {
            self.fail(format!("the port is said to be {value}, which it was not"));
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
                excused: 0,
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
            let between = report.in_between();
            let between = between.map_or(String::new(), |what| format!(", before it came {what}"));
            self.note(format!("{id}: {stage} {reason}{between}"));
        }
        if stage == Stage::Done && report.port.number != 0 {
            self.ran.parameters += 1;
            self.judge_value(report.value);
        }
        let asked = self
            .asked
            .iter_mut()
            .find(|asked| asked.life == life && asked.told_id == id);
        let Some(asked) = asked else { return };
        if stage.is_final() {
            let end = (id, report.stage, report.reason);
            if !self.ends.contains(&end) {
                self.ends.push(end);
            }
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
        if reason == Reason::NotRemembered {
            // A copy of what never came asks what became of it, and orders nothing.
            let read = Some((life, self.now_ms));
            let ordered = &mut self.orders[order];
            ordered.read = ordered.read.filter(|_| ordered.read != read);
        }
        if !is_last || is_about_a_copy || asked.id != asked.told_id {
            return;
        }
        self.ran.superseded += u64::from(reason == Reason::Superseded);
        self.ran.too_late += u64::from(reason == Reason::TooLate);
        self.ran.lost += u64::from(reason == Reason::SenderLost);
        self.orders[order].is_superseded |= reason == Reason::Superseded;
        if reason == Reason::Superseded && self.orders[order].accepted.is_none() {
            self.judge_superseded(order);
        }
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
            if stage == Stage::Done && self.orders[order].order.what == What::Write {
                self.last_write = Some(order);
            }
            match reason {
                Reason::SenderLost => self.ended_as_lost(order),
                // A rule has held, which outdates what was ordered before.
                Reason::FenceBreach if stage == Stage::Aborted => self.breach(self.now_ms),
                _ => {}
            }
        }
    }

    /// An order was refused because it is outdated: something newer was read, or happened.
    fn judge_superseded(&mut self, number: usize) {
        let ordered = &self.orders[number];
        if ordered.after != 0 || ordered.is_vague {
            return;
        }
        let (life, true_ms) = (self.life, ordered.true_ms);
        let since_ms = true_ms.saturating_sub(BEFORE_MS);
        let pilot_ms = self.pilot.iter().map(|(_, until)| *until).max();
        let last_ms = (self.last_trouble_ms.max(self.last_stall_ms))
            .max(self.life_began_ms)
            .max(pilot_ms.unwrap_or(0))
            .max(self.last_breach_ms);
        let is_near = |other: &Ordered| {
            let is_known = ordered.station.is_none() && other.station.is_none();
            let within_ms = if is_known { 0 } else { BEFORE_MS };
            other.true_ms + within_ms >= true_ms
        };
        let mut others = self.asked.iter();
        let is_outdated = others.any(|asked| {
            let other = &self.orders[asked.order];
            let counts = asked.order != number && !other.order.what.is_parameter();
            asked.life == life && counts && is_near(other)
        });
        if !is_outdated && last_ms < since_ms {
            self.fail(format!("order {number} is superseded by nothing"));
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
        if ordered.lost.is_none() && !is_not_renewed && !ordered.may_be_lost {
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
            let counts = !ordered.order.what.is_parameter();
            is_between && counts && *other != number && *other != before
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
            && !ordered.is_vague
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
                && !(ordered.is_vague || other.is_vague)
                && counts.is_some_and(|(of, at)| of == life && at < now_ms)
        });
        if let Some((other, _)) = newer {
            // A start changes nothing of a path that goes on.
            let is_start = self.orders[other].order.what == What::Start;
            let is_refused = self.orders[other].accepted.is_none();
            let goes_on = ordered.began_ms.is_some_and(|began| {
                let read = self.orders[other].read.map_or(0, |(_, at)| at);
                began <= read && (is_start || is_refused)
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
        self.follows = (self.orders.iter()).position(|ordered| Some(ordered.ids[0]) == follows);
        let Some(number) = self.follows else { return };
        self.judge_last(number);
        self.judge_station(number);
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

    /// The path that is followed is that of a station which is there.
    fn judge_station(&mut self, number: usize) {
        let ordered = &self.orders[number];
        let Some(station) = ordered.station else {
            return;
        };
        let now_ms = self.now_ms;
        let calm_since = (self.last_trouble_ms.max(self.last_stall_ms) + RECOVERY_MS)
            .max(self.life_began_ms + RECOVERY_MS);
        let heard_ms = self.heard.get(&station).copied().unwrap_or(now_ms);
        let since_ms = heard_ms.max(calm_since);
        let lost_ms = match station < station_of(0) {
            true => since_ms + LINK_LOSS_MS,
            false => (since_ms + STATION_LOST_MS).max(self.gateway_pause_ms),
        };
        let limit_ms = lost_ms + LOST_WITHIN_MS;
        if self.link_loss != LinkLoss::Continue && now_ms > limit_ms && !ordered.may_be_lost {
            let silent_ms = now_ms - heard_ms;
            return self.fail(format!(
                "order {number} is followed, and its station is silent for {silent_ms} ms"
            ));
        }
        let bad_ms = self.bad_links.get(&station).copied().unwrap_or(0);
        let gone_ms = ordered
            .client_gone_ms
            .filter(|_| ordered.ends_with_its_process());
        if let Some(gone_ms) = gone_ms
            && ordered.ids.len() == 1
            && now_ms > gone_ms.max(bad_ms).max(calm_since) + GONE_WITHIN_MS
        {
            self.fail(format!(
                "order {number} is followed {} ms after its client was gone",
                now_ms - gone_ms
            ));
        }
    }

    /// Whether a path is followed that this process has ordered.
    pub fn follows_of(&self, process: u32) -> bool {
        let mut follows = self.follows.iter();
        follows.any(|number| self.orders[*number].process == process)
    }

    /// Nothing keeps the bridge from what it should do.
    pub fn is_calm(&self) -> bool {
        let since_ms = (self.last_trouble_ms.max(self.last_stall_ms)).max(self.life_began_ms);
        self.now_ms > since_ms + RECOVERY_MS && self.now_ms <= self.last_awake_ms + RECOVERY_MS
    }

    /// Whether a path was accepted between two moments of the host's clock.
    pub fn was_overtaken(&self, since_ms: u64, until_ms: u64) -> bool {
        let mut orders = self.orders.iter().filter(|ordered| ordered.is_path());
        orders.any(|ordered| {
            let accepted = ordered.accepted.filter(|(life, _)| *life == self.life);
            let at_ms = ordered.accepted_host_ms;
            accepted.is_some() && at_ms > since_ms && at_ms < until_ms
        })
    }

    /// When an order was done, if it was.
    pub fn done_ms(&self, number: usize) -> Option<u64> {
        let is_done = self.has_ended(number, Stage::Done, None);
        let ended = self.orders[number].ended.filter(|_| is_done);
        ended.map(|(_, at_ms)| at_ms)
    }

    /// Whether it was accepted, and has not ended.
    pub fn is_under_way(&self, number: usize) -> bool {
        let ordered = &self.orders[number];
        let accepted = ordered.accepted.filter(|(life, _)| *life == self.life);
        accepted.is_some() && ordered.ended.is_none()
    }

    /// Whether the bridge has said that an order ended so.
    pub fn has_ended(&self, number: usize, stage: Stage, reason: Option<Reason>) -> bool {
        let ids = &self.orders[number].ids;
        let mut ends = self.ends.iter().filter(|(id, ..)| ids.contains(id));
        ends.any(|(_, of_stage, of_reason)| {
            *of_stage == stage.code() && reason.is_none_or(|reason| *of_reason == reason.code())
        })
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
                && !ordered.order.what.is_parameter()
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
        let open = self.asked.iter().find(|asked| {
            let is_open = asked.finals + asked.excused < asked.times;
            asked.life == life && !asked.is_killed && is_open
        });
        if let Some(asked) = open {
            let text = format!(
                "{} final reports for request {}, which was asked {} times",
                asked.finals, asked.told_id, asked.times
            );
            self.fail(text);
        }
    }
}
