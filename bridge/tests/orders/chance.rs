//! Random orders of several senders to a bridge, over ways that lose, delay, double and reorder them, with clocks that
//! are not known exactly and a bridge that stands still at times. At the end the helicopter does what was ordered last.

use bridge::{BridgeConfig, Input};
use dsp_protocol::{Downlink, FlowControl, StatusMask};
use fastrand::Rng;
use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, Reason, Stage};
use ipc_types::payload::{MovementData, RequestReport};

use crate::rig::{Rig, go_to, north};

/// What the sequences had in them.
#[derive(Debug, Default)]
pub struct Seen {
    /// The helicopter flew the path that was ordered last, or hovered or landed as was ordered last.
    pub as_ordered: u64,
    /// The last order was not carried out, and its sender was told a reason that holds.
    pub refused: u64,
    /// Paths that began.
    pub began: u64,
    /// Reports with these reasons.
    pub superseded: u64,
    /// See `superseded`.
    pub too_late: u64,
}

const MS: u64 = 1_000_000;
/// One step of time.
const STEP_MS: u32 = 20;
/// What a station's clock is known to at worst.
const MOST_UNCERTAIN_MS: u64 = 400;
/// `begin_within_ms` of the bridge.
const BEGIN_WITHIN_MS: u64 = 1000;
/// The last order is issued before.
const ORDERS_MS: u64 = 2000;
/// The last message arrives before, and the bridge stands still no longer.
const TROUBLE_MS: u64 = 4000;
/// Then everything has ended or goes on.
const END_MS: u64 = 6000;

#[derive(Clone, Copy, Debug, PartialEq)]
enum What {
    Path,
    Hold,
    Land,
}

/// An order, and what became of it.
#[derive(Debug)]
struct Order {
    what: What,
    /// What its sender says. The orders stand in the order in which they were truly issued.
    requests: Vec<MovementData>,
    begin_by: MonotonicNs,
    /// When the bridge had read all of it.
    read: Option<MonotonicNs>,
    /// When its first waypoint was at the DSP.
    began: Option<MonotonicNs>,
}

impl Order {
    fn at(&self) -> u64 {
        self.requests[0].issued_ns
    }

    fn latest(&self) -> u64 {
        self.at() + u64::from(self.requests[0].issued_within_ns)
    }

    /// By default the waypoints that continue a path have their time from their arrival.
    fn has_time_by_arrival(&self) -> bool {
        self.requests.len() > 1 && self.requests[0].begin_by_ns == 0
    }

    fn ends_movements(&self) -> bool {
        self.what != What::Path
    }
}

/// A request on its way: when it arrives, of which order, and which of its requests.
type Message = (MonotonicNs, usize, usize);

struct Sequence {
    rig: Rig,
    orders: Vec<Order>,
    messages: Vec<Message>,
    /// From when to when the bridge stands still.
    stalls: Vec<[MonotonicNs; 2]>,
    /// From when to when the DSP grants nothing.
    pauses: Vec<[MonotonicNs; 2]>,
    line: Vec<u8>,
    waypoints: usize,
}

fn is_in(spans: &[[MonotonicNs; 2]], now: MonotonicNs) -> bool {
    spans.iter().any(|[from, to]| (*from..*to).contains(&now))
}

/// Plays sequences with the seeds from `first`.
///
/// # Panics
/// The helicopter did something else than what was ordered last.
pub fn play(first: u64, count: u64) -> Seen {
    let mut seen = Seen::default();
    for seed in first..first + count {
        let mut sequence = Sequence::new(&mut Rng::with_seed(seed));
        sequence.run(seed);
        sequence.judge(seed, &mut seen);
    }
    seen
}

impl Sequence {
    fn new(random: &mut Rng) -> Sequence {
        let mut config = BridgeConfig::default();
        config.movement.begin_within_ms = BEGIN_WITHIN_MS;
        let mut rig = Rig::up(&config);
        rig.control(ipc_types::code::ControlCommand::Start);
        rig.lift_off();
        // So that no order may have been issued before the start.
        rig.run(MOST_UNCERTAIN_MS as u32);
        let begin = rig.now;
        let after = |ms: u64| MonotonicNs(begin.0 + ms * MS);
        let mut span = |longest_ms: u64| {
            let from = random.u64(..TROUBLE_MS - longest_ms);
            [after(from), after(from + random.u64(..longest_ms))]
        };
        let spans = [span(1500), span(1500), span(1500), span(1500)];
        let stalls = spans[..random.u64(..3) as usize].to_vec();
        let pauses = spans[2..2 + random.u64(..3) as usize].to_vec();

        // Senders on the robot have its clock; each station's has an error of its own.
        let senders: Vec<(u32, u64, u64)> = (0..1 + random.u64(..4))
            .map(|number| match random.u64(..2) {
                0 => (0, 0, 0),
                _ => {
                    let within = random.u64(..MOST_UNCERTAIN_MS * MS);
                    (number as u32 + 1, within, random.u64(..within + 1))
                }
            })
            .collect();
        let mut times: Vec<u64> = (0..2 + random.u64(..6))
            .map(|_| random.u64(..ORDERS_MS * MS))
            .collect();
        times.sort_unstable();
        let is_bad = random.u64(..3) > 0;
        let (mut orders, mut messages) = (vec![], vec![]);
        for (number, time) in times.into_iter().enumerate() {
            let issued = MonotonicNs(begin.0 + time);
            let (origin, within, error) = senders[random.usize(..senders.len())];
            let what = match random.u64(..8) {
                0 => What::Land,
                1 | 2 => What::Hold,
                _ => What::Path,
            };
            let begin_by_ns = match random.u64(..3) {
                0 => issued.0 + random.u64(..3000 * MS),
                _ => 0,
            };
            let moments = |request_id: u64, data: MovementData| MovementData {
                request_id,
                issued_ns: issued.0 - error,
                issued_within_ns: within as u32,
                begin_by_ns,
                origin,
                ..data.preempting()
            };
            let id = 1000 + 10 * number as u64;
            let requests: Vec<MovementData> = match what {
                What::Hold => vec![moments(id, MovementData::hold(0))],
                What::Land => vec![moments(id, MovementData::land(0))],
                What::Path => {
                    let count = 1 + random.u64(..3);
                    let waypoint = |index: u64| MovementData {
                        path_id: id,
                        first: u16::from(index == 0),
                        last: u16::from(index + 1 == count),
                        ..go_to(north((number as u64 * 4 + index + 1) as i32))
                    };
                    (0..count)
                        .map(|index| moments(id + index, waypoint(index)))
                        .collect()
                }
            };
            // Its requests arrive one after the other, as their sender waits for answers; those of two orders in any
            // order.
            let mut arrives = issued;
            for index in 0..requests.len() {
                let delay_ms = match is_bad && random.u64(..3) == 0 {
                    true => random.u64(..1800),
                    false => random.u64(..30),
                };
                arrives = MonotonicNs(arrives.0 + delay_ms * MS);
                if is_bad && random.u64(..10) == 0 {
                    break;
                }
                messages.push((arrives, number, index));
                if is_bad && random.u64(..6) == 0 {
                    let again = MonotonicNs(arrives.0 + random.u64(..1500) * MS);
                    messages.push((again, number, index));
                }
            }
            let within = match what {
                What::Path => BEGIN_WITHIN_MS,
                _ => 30_000,
            };
            let by_default = MonotonicNs(issued.0 - error + within * MS);
            orders.push(Order {
                what,
                begin_by: match begin_by_ns {
                    0 => by_default,
                    ns => MonotonicNs(ns),
                },
                requests,
                read: None,
                began: None,
            });
        }
        messages.sort_unstable();
        let waypoints = rig.dsp.waypoints.len();
        Sequence {
            rig,
            orders,
            messages,
            stalls,
            pauses,
            line: vec![],
            waypoints,
        }
    }

    fn run(&mut self, seed: u64) {
        let end = MonotonicNs(self.rig.now.0 + END_MS * MS);
        while self.rig.now < end {
            self.rig.now = MonotonicNs(self.rig.now.0 + u64::from(STEP_MS) * MS);
            self.rig.dsp.time_ms += STEP_MS;
            self.say();
            if !is_in(&self.stalls, self.rig.now) {
                self.wake();
            }
            self.look(seed);
        }
    }

    /// What the DSP says waits in the line.
    fn say(&mut self) {
        let dsp = &mut self.rig.dsp;
        if dsp.time_ms.is_multiple_of(100) {
            let mut status = dsp.status;
            status.time_ms = Some(dsp.time_ms);
            status.withdraw(StatusMask(!dsp.mask));
            let frame = dsp.frame(&Downlink::Status(status), None);
            self.line.extend_from_slice(frame.as_bytes());
        }
        if dsp.time_ms.is_multiple_of(60) && !is_in(&self.pauses, self.rig.now) {
            let frame = dsp.frame(&Downlink::FlowControl(FlowControl::Send), None);
            self.line.extend_from_slice(frame.as_bytes());
        }
    }

    /// One wake-up of the bridge: all that has come meanwhile, what the DSP says first, as the shell hands it on.
    fn wake(&mut self) {
        let (rig, line) = (&mut self.rig, std::mem::take(&mut self.line));
        rig.apply(Input::Received(&line));
        while let Some((_, number, index)) = self
            .messages
            .first()
            .copied()
            .filter(|(arrives, ..)| *arrives <= rig.now)
        {
            self.messages.remove(0);
            let order = &mut self.orders[number];
            let data = &order.requests[index];
            rig.ask_movement(*data);
            if index + 1 == order.requests.len() {
                order.read.get_or_insert(rig.now);
            }
        }
        rig.apply(Input::Advance);
        rig.exchange();
    }

    /// Which paths have begun: none late, and none after an order that was issued later.
    fn look(&mut self, seed: u64) {
        let now = self.rig.now;
        let new: Vec<usize> = self.rig.dsp.waypoints[self.waypoints..]
            .iter()
            .filter_map(|waypoint| {
                let is_first = |order: &Order| {
                    let first = &order.requests[0];
                    order.what == What::Path && first.latitude_deg == waypoint.latitude_deg
                };
                self.orders.iter().position(is_first)
            })
            .collect();
        self.waypoints = self.rig.dsp.waypoints.len();
        for number in new {
            let order = &self.orders[number];
            assert_eq!(order.began, None, "seed {seed}: begun twice: {order:?}");
            let is_late = now > order.begin_by && !order.has_time_by_arrival();
            assert!(!is_late, "seed {seed}: begun at {now:?}, late: {order:?}");
            let later = self.orders[number + 1..].iter().find(|later| {
                let counts = later.ends_movements() || self.was_accepted(later);
                // At one wake-up the requests are read after the grant that the path began with.
                counts && later.read.is_some_and(|read| read < now)
            });
            assert!(later.is_none(), "seed {seed}: {order:?} after {later:?}");
            self.orders[number].began = Some(now);
        }
    }

    fn reports(&self, order: &Order) -> impl Iterator<Item = &RequestReport> {
        let ids =
            order.requests[0].request_id..=order.requests[order.requests.len() - 1].request_id;
        self.rig.out.reports.iter().filter(move |report| {
            ids.contains(&report.request_id) && report.reason() != Some(Reason::StillOpen)
        })
    }

    fn was_accepted(&self, order: &Order) -> bool {
        let closing = order.requests.last().map(|request| request.request_id);
        self.reports(order).any(|report| {
            report.stage() == Some(Stage::Accepted) && Some(report.request_id) == closing
        })
    }

    fn judge(&self, seed: u64, seen: &mut Seen) {
        seen.began += self
            .orders
            .iter()
            .filter(|order| order.began.is_some())
            .count() as u64;
        let said = |reason| {
            let reports = self.rig.out.reports.iter();
            reports
                .filter(|report| report.reason() == Some(reason))
                .count() as u64
        };
        seen.superseded += said(Reason::Superseded);
        seen.too_late += said(Reason::TooLate);
        let in_time = |order: &Order| {
            let is_early = order.read.is_some_and(|read| read <= order.begin_by);
            is_early || order.has_time_by_arrival() && self.was_accepted(order)
        };
        let Some(number) = self.orders.iter().rposition(in_time) else {
            return;
        };
        let last = &self.orders[number];
        let context = || {
            let (last, orders, reports) = (last, &self.orders, &self.rig.out.reports);
            format!("seed {seed}: last {last:?}, all {orders:?}, said {reports:?}")
        };
        let state = self.rig.bridge.state();
        let follows = state.functionality() == Some(Functionality::FollowingPath);
        if last.ends_movements() {
            assert!(!follows, "a path goes on; {}", context());
            seen.as_ordered += 1;
            return;
        }
        if follows && state.movement.path_id == last.requests[0].path_id {
            seen.as_ordered += 1;
            return;
        }
        // What came first counts: the rest follows from it.
        let end = self.reports(last).find(|report| {
            let stage = report.stage().expect("a stage");
            let is_end = stage.is_final() && stage != Stage::Done;
            is_end && report.reason() != Some(Reason::PathBroken)
        });
        let Some(end) = end else {
            panic!("no final report; {}", context());
        };
        let ended_meanwhile = self
            .orders
            .iter()
            .any(|order| order.ends_movements() && order.read.is_some());
        let is_true = match end.reason().expect("a reason") {
            Reason::TooLate => end.reported_ns > last.begin_by.0 || !self.stalls.is_empty(),
            // Orders by several clocks were given within what these are known to; or a later order came, and too late
            // to be carried out, or only the first part of it.
            Reason::Superseded => {
                let earlier = &self.orders[..number];
                let is_other = |order: &Order| order.requests[0].origin != last.requests[0].origin;
                let is_in_doubt = earlier.iter().any(|order| order.latest() > last.at());
                is_in_doubt && earlier.iter().any(is_other) || number + 1 < self.orders.len()
            }
            // By a hold or a landing, which count whenever they come; nothing replaces a landing.
            Reason::Replaced | Reason::Busy | Reason::NotFlying => ended_meanwhile,
            // While it was assembled, also by the first waypoint of a later path, the rest of which was late or lost.
            Reason::PathReplaced | Reason::PathWithoutHead => {
                ended_meanwhile || number + 1 < self.orders.len()
            }
            // The bridge stood still for longer than the DSP waits for it.
            Reason::CommunicationFatalError
            | Reason::NotStarted
            | Reason::LinkDown
            | Reason::NoPosition
            | Reason::LinkLost => !self.stalls.is_empty(),
            _ => false,
        };
        assert!(is_true, "{end:?}; {}", context());
        seen.refused += 1;
    }
}
