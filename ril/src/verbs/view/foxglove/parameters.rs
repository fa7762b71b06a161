//! [`Parameters`]: the DSP's ports for Foxglove clients, from a cache: clients ask for all every few seconds, and the bridge reads one after
//! the other over the serial line. [`Cache`] says what to ask next, and [`Parameters`] asks the bridges.

use std::collections::BTreeMap;

use ipc_types::code::Stage;
use ipc_types::payload::{ParameterRequest, RequestReport};
use ipc_types::{Client, MonotonicNs, RobotId};
use serde_json::Value;
use view::Server;

use super::ports::{Ask, Cache};
use super::services::COMMANDED;
use crate::config::RequestConfig;
use crate::render::messages::{FinalReport, Verb, ending};
use crate::request::{Exchange, Next, Outcome, Until};
use crate::robot::changes::Weight;
use crate::robot::freshness::Freshness;
use crate::robot::model::Process;
use crate::verbs::view::fleet::{Fleet, ShownRobot};

/// A robot's cache, and its bridge.
#[derive(Default)]
struct OfRobot {
    cache: Cache,
    client: Option<Client<ParameterRequest>>,
    /// The question that has no answer yet.
    asked: Option<(Ask, Exchange)>,
    /// The bridge that was asked.
    epoch_ns: Option<u64>,
}

/// See the module's documentation.
#[derive(Default)]
pub(super) struct Parameters {
    robots: BTreeMap<RobotId, OfRobot>,
}

impl Parameters {
    /// Takes answers, says what is known, and asks on.
    pub fn drain(
        &mut self,
        fleet: &mut Fleet,
        server: &mut Server,
        config: &RequestConfig,
        now: MonotonicNs,
    ) {
        for shown in fleet.iter_mut() {
            let robot = self.robots.entry(shown.robot.id).or_default();
            robot.take(shown, server, now);
            robot.follow(shown, server, now);
            robot.ask(shown, config, now);
        }
    }

    /// A client sets a parameter. What is not taken is answered with the value that is known.
    pub fn set(&mut self, name: &str, value: &Value, from: &str, server: &mut Server) {
        let wanted = self.robots.iter_mut().find_map(|(id, robot)| {
            let port = robot
                .cache
                .find(name.strip_prefix(&format!("/robot{id}/"))?)?;
            Some((*id, robot, port))
        });
        let Some((id, robot, port)) = wanted else {
            // Its bridge is gone.
            server.parameter(name, None);
            return;
        };
        let cache = &mut robot.cache;
        let taken = match value.as_f64() {
            _ if server.is_commanded(id.get()) => Err(COMMANDED),
            None => Err("it takes a number"),
            Some(value) => match cache.write(port, value, from) {
                true => Ok(()),
                false => Err("too many values wait to be written"),
            },
        };
        match taken {
            Ok(()) => tracing::info!(name, %value, from, "parameter to be set"),
            Err(why) => {
                tracing::info!(name, %value, from, "parameter not set: {why}");
                say(&id, cache, port, server);
            }
        }
    }
}

impl OfRobot {
    fn take(&mut self, shown: &mut ShownRobot, server: &mut Server, now: MonotonicNs) {
        let Some(client) = &mut self.client else {
            return;
        };
        let mut reports: Vec<RequestReport> = Vec::new();
        client.drain(|report| reports.push(*report));
        let Some((ask, exchange)) = &mut self.asked else {
            return;
        };
        for report in &reports {
            exchange.take(report, now);
        }
        let Next::Over(outcome) = exchange.next(now) else {
            return;
        };
        let end = match outcome {
            Outcome::Final(end) => Some(end),
            _ => None,
        };
        let said = match &end {
            Some(end) => self.cache.answer(ask, &end.report, now),
            None => {
                self.cache.no_answer(now);
                match ask {
                    Ask::Write { port, .. } => Some(*port),
                    _ => None,
                }
            }
        };
        if let Ask::Write { port, value, from } = ask {
            let name = self
                .cache
                .said(*port)
                .map_or_else(String::new, |(name, _)| name.to_owned());
            note(shown, &name, *value, from, end.as_ref(), now);
        }
        self.asked = None;
        if let Some(port) = said {
            say(&shown.robot.id, &self.cache, port, server);
        }
    }

    /// Forgets all that is known of a bridge that is gone: another one may have other ports, and their values are not known.
    fn follow(&mut self, shown: &ShownRobot, server: &mut Server, now: MonotonicNs) {
        let bridge = shown.robot.process(Process::Bridge, now);
        let is_gone = matches!(bridge, Freshness::Absent | Freshness::Gone(_));
        let state = shown.robot.state.as_ref().filter(|_| !is_gone);
        let epoch_ns = state.map(|state| state.epoch_ns);
        if self.asked.is_some() || self.epoch_ns == epoch_ns {
            return;
        }
        self.epoch_ns = epoch_ns;
        let former = std::mem::take(&mut self.cache);
        for name in former.names() {
            server.parameter(&format!("/robot{}/{name}", shown.robot.id), None);
        }
    }

    fn ask(&mut self, shown: &ShownRobot, config: &RequestConfig, now: MonotonicNs) {
        if self.epoch_ns.is_none() || self.asked.is_some() {
            return;
        }
        let Some(ask) = self.cache.next(now) else {
            return;
        };
        let Some(request) = self.cache.request(&ask, config.deadline_ms) else {
            return;
        };
        let mut exchange = Exchange::new([request.request_id], Until::Final, config.timeout());
        match self.send(shown, &request) {
            Ok(()) => exchange.sent(now),
            Err(error) => {
                tracing::debug!(robot = %shown.robot.id, error, "parameters cannot be asked for");
                self.cache.no_answer(now);
                return;
            }
        }
        self.asked = Some((ask, exchange));
    }

    fn send(&mut self, shown: &ShownRobot, request: &ParameterRequest) -> Result<(), String> {
        if self.client.is_none() {
            self.client = Some(
                shown
                    .ports
                    .ipc()
                    .client()
                    .map_err(|error| error.to_string())?,
            );
        }
        match &mut self.client {
            Some(client) => client
                .send(request)
                .map(drop)
                .map_err(|error| error.to_string()),
            None => Ok(()),
        }
    }
}

/// Says a value to clients. One that is not known is none.
fn say(robot: &RobotId, cache: &Cache, port: usize, server: &mut Server) {
    if let Some((name, value)) = cache.said(port) {
        server.parameter(&format!("/robot{robot}/{name}"), value);
    }
}

/// Writes into the log and the robot's journal what became of a value that a client has set.
fn note(
    shown: &mut ShownRobot,
    name: &str,
    value: f64,
    from: &str,
    end: Option<&FinalReport>,
    now: MonotonicNs,
) {
    let robot = shown.robot.id;
    let (weight, text) = match end {
        Some(end) if end.stage == Stage::Done => (Weight::Order, format!("{name} set to {value}")),
        Some(end) => (
            Weight::Warning,
            format!("{name}: {}", ending(Verb::SetParameter, end)),
        ),
        None => (
            Weight::Warning,
            format!("{name}: no answer in time; look whether it was set all the same"),
        ),
    };
    tracing::info!(%robot, from, "parameter: {text}");
    shown.robot.journal.add(now, weight, text);
}
