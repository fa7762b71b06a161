//! A model of the servers on the robot: what `docs/ipc.md` section 4 promises, and a count of what was executed.

use std::collections::{BTreeMap, VecDeque};

use fastrand::Rng;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

use super::{MS, SECOND};
use crate::orders::message::{Order, request_id};
use crate::orders::robot::{NotSent, Traits};

/// Final reports that are remembered, as the bridge does.
const REMEMBERED: usize = 256;
/// Requests of one client that one service has open.
const OUTSTANDING: usize = 8;

/// Services: 0 is the bridge's `movement`, 1 its `module_control`, 2 a module's own, which forgets requests whose
/// client is gone.
pub(super) const SERVICES: u64 = 3;

pub(super) fn traits_of(order: &Order) -> Traits {
    Traits {
        is_repeatable: order.service == 0,
        ends_movement: Kind::of(&order.request) == Kind::Quick,
    }
}

/// What a request does; the byte behind its id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Done at once.
    Quick,
    /// Accepted, and done within half a second.
    Short,
    /// Accepted, progress each second, and a final report after some.
    Movement,
    /// Refused as not started.
    NotStarted,
    /// Refused as busy, because of another movement.
    Busy,
}

impl Kind {
    pub(super) fn random(random: &mut Rng) -> Kind {
        match random.u64(..100) {
            0..30 => Kind::Quick,
            30..70 => Kind::Short,
            70..92 => Kind::Movement,
            92..99 => Kind::NotStarted,
            _ => Kind::Busy,
        }
    }

    fn of(request: &[u8]) -> Kind {
        let kinds = [
            Kind::Quick,
            Kind::Short,
            Kind::Movement,
            Kind::NotStarted,
            Kind::Busy,
        ];
        kinds[usize::from(request[8])]
    }
}

struct Open {
    service: u64,
    /// The robot side that asked still waits.
    is_attached: bool,
    progress_left: u64,
    is_movement: bool,
}

/// What happens at the model later on.
pub(super) struct Step {
    pub(super) at: u64,
    pub(super) instance: u32,
    pub(super) request_id: u64,
}

#[derive(Default)]
pub(super) struct Bridge {
    pub(super) instance: u32,
    pub(super) is_up: bool,
    completed: VecDeque<RequestReport>,
    open: BTreeMap<u64, Open>,
    /// How often each request was executed, in all instances.
    pub(super) executions: BTreeMap<u64, u32>,
    /// The true end of each request, if the instance that executed or refused it came to it.
    pub(super) ends: BTreeMap<u64, (u32, u32)>,
    /// To the robot side, in order.
    pub(super) reports: Vec<(u64, RequestReport)>,
    pub(super) steps: Vec<Step>,
}

fn report(request_id: u64, stage: Stage, reason: Reason) -> RequestReport {
    RequestReport {
        request_id,
        ..RequestReport::new(stage, reason)
    }
}

impl Bridge {
    pub(super) fn start(&mut self) {
        self.is_up = true;
        self.instance += 1;
    }

    /// It is killed: nothing is remembered, and the client's port reports what was open.
    pub(super) fn kill(&mut self) {
        self.is_up = false;
        self.completed.clear();
        for (id, open) in std::mem::take(&mut self.open) {
            if open.is_attached {
                let gone = report(id, Stage::Unknown, Reason::BridgeGone);
                self.reports.push((open.service, gone));
            }
        }
    }

    pub(super) fn send(
        &mut self,
        service: u64,
        request: &[u8],
        is_repeat: bool,
        now: u64,
        random: &mut Rng,
    ) -> Result<(), NotSent> {
        if !self.is_up {
            return Err(NotSent::NoServer);
        }
        let of_client = |open: &&Open| open.service == service && open.is_attached;
        if self.open.values().filter(of_client).count() >= OUTSTANDING {
            return Err(NotSent::Full);
        }
        let id = request_id(request);
        let known = self
            .completed
            .iter()
            .rfind(|report| report.request_id == id);
        if let Some(known) = known {
            self.reports.push((service, *known));
        } else if self.open.contains_key(&id) {
            self.reports
                .push((service, report(id, Stage::Refused, Reason::StillOpen)));
        } else if is_repeat {
            let unknown = report(id, Stage::Unknown, Reason::NotRemembered);
            self.reports.push((service, unknown));
        } else {
            self.execute(service, request, now, random);
        }
        Ok(())
    }

    fn execute(&mut self, service: u64, request: &[u8], now: u64, random: &mut Rng) {
        let id = request_id(request);
        let kind = Kind::of(request);
        let refusal = match kind {
            Kind::NotStarted => Some(Reason::NotStarted),
            Kind::Busy => Some(Reason::Busy),
            _ => None,
        };
        if let Some(reason) = refusal {
            self.end(service, id, Stage::Refused, reason, true);
            return;
        }
        *self.executions.entry(id).or_default() += 1;
        if kind == Kind::Quick {
            self.end(service, id, Stage::Done, Reason::None, true);
            return;
        }
        self.reports
            .push((service, report(id, Stage::Accepted, Reason::None)));
        let is_movement = kind == Kind::Movement;
        let open = Open {
            service,
            is_attached: true,
            progress_left: if is_movement { 1 + random.u64(..10) } else { 0 },
            is_movement,
        };
        self.open.insert(id, open);
        let pause = if is_movement { SECOND } else { 500 * MS };
        self.later(id, now + random.u64(..pause));
    }

    pub(super) fn step(&mut self, step: &Step, random: &mut Rng) {
        let id = step.request_id;
        if step.instance != self.instance {
            return;
        }
        let Some(open) = self.open.get_mut(&id) else {
            return;
        };
        let (service, is_attached) = (open.service, open.is_attached);
        if open.progress_left > 0 {
            open.progress_left -= 1;
            if is_attached {
                self.reports
                    .push((service, report(id, Stage::Progress, Reason::None)));
            }
            self.later(id, step.at + SECOND);
            return;
        }
        let is_aborted = open.is_movement && random.f64() < 0.1;
        self.open.remove(&id);
        let (stage, reason) = if is_aborted {
            (Stage::Aborted, Reason::Replaced)
        } else {
            (Stage::Done, Reason::None)
        };
        self.end(service, id, stage, reason, is_attached);
    }

    /// The robot side drops the pending request of this id, or of all.
    pub(super) fn client_gone(&mut self, which: Option<u64>) {
        self.open.retain(|id, open| {
            let is_meant = which.is_none_or(|which| which == *id);
            open.is_attached &= !is_meant;
            !is_meant || open.service != 2
        });
    }

    fn end(&mut self, service: u64, id: u64, stage: Stage, reason: Reason, is_attached: bool) {
        let report = report(id, stage, reason);
        self.ends.insert(id, (stage.code(), reason.code()));
        if self.completed.len() == REMEMBERED {
            self.completed.pop_front();
        }
        self.completed.push_back(report);
        if is_attached {
            self.reports.push((service, report));
        }
    }

    fn later(&mut self, request_id: u64, at: u64) {
        let instance = self.instance;
        self.steps.push(Step {
            at,
            instance,
            request_id,
        });
    }
}
