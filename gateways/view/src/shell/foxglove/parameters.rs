//! [`Parameters`]: the DSP's ports for Foxglove clients, from a cache: clients ask for all every few seconds, and the
//! bridge reads one after the other over the serial line. [`Cache`] says what to ask next, and [`Parameters`] asks the
//! bridges.
//!
//! | step | report | no answer |
//! |---|---|---|
//! | list port n | n + 1, or read all | list again later |
//! | read port n | n + 1, or rest; a port that cannot be read has no value | go on later |
//! | rest | | read all when it is over |
//!
//! A value that a client sets goes first.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use ipc_types::code::{PortKind, Stage};
use ipc_types::payload::{ParameterRequest, PortInfo, RequestReport};
use ipc_types::{Client, MonotonicNs, RobotId, fresh_request_id};
use operator::config::RequestConfig;
use operator::render::messages::details::{port_name, port_value};
use operator::render::messages::{FinalReport, Verb, ending};
use operator::request::{Exchange, Next, Outcome, Until, begin_by_ns, ports};
use operator::robot::changes::Weight;
use operator::robot::freshness::Freshness;
use operator::robot::model::Process;
use serde_json::Value;

use super::services::COMMANDED;
use crate::Server;
use crate::shell::fleet::{Fleet, ShownRobot};

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

/// The DSP's ports of each robot for Foxglove clients, from a cache.
#[derive(Default)]
pub(crate) struct Parameters {
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

    /// Forgets all that is known of a bridge that is gone: another one may have other ports, and their values are not
    /// known.
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
        let sent = ports::send(shown.ports.ipc(), &mut self.client, request);
        let sent = sent.map_err(|failure| failure.chain().join(": "))?;
        sent.map_err(|error| error.to_string())
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

/// Time between two readings of all ports, which another program may have written.
const REST: Duration = Duration::from_secs(30);

/// Time before a bridge is asked again that did not answer.
const RETRY: Duration = Duration::from_secs(5);

/// Most values of a robot that wait to be written: all that a client may set at a time. Further ones are refused.
const MAX_WRITES: usize = 16;

/// Most ports of a robot: a list that claims more is cut.
const MAX_PORTS: u32 = 64;

/// A question to the bridge.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Ask {
    /// Which port stands at this place of the list.
    List(u32),
    /// The value of the port at this place of the cache.
    Read(usize),
    /// A port is to get a value.
    Write {
        port: usize,
        value: f64,
        from: String,
    },
}

/// What is known of a port.
#[derive(Clone, Debug, PartialEq)]
struct PortValue {
    info: PortInfo,
    value: Option<f64>,
}

/// What is done while no parameter is to be set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum QueryStep {
    List(u32),
    Read(usize),
    #[default]
    Rest,
}

/// The ports of one DSP as they were last read, and what to ask next.
#[derive(Debug, Default)]
pub(crate) struct Cache {
    ports: Vec<PortValue>,
    step: QueryStep,
    /// No question to the bridge before this moment.
    due: MonotonicNs,
    writes: VecDeque<Ask>,
}

impl Cache {
    /// What to ask now.
    pub fn next(&mut self, now: MonotonicNs) -> Option<Ask> {
        if let Some(write) = self.writes.pop_front() {
            return Some(write);
        }
        if now < self.due {
            return None;
        }
        if self.step == QueryStep::Rest {
            self.step = match self.ports.is_empty() {
                true => QueryStep::List(0),
                false => QueryStep::Read(0),
            };
        }
        match self.step {
            QueryStep::List(index) => Some(Ask::List(index)),
            QueryStep::Read(port) => Some(Ask::Read(port)),
            QueryStep::Rest => None,
        }
    }

    /// Takes the final report about `ask`; returns the port whose value is to be sent.
    pub fn answer(&mut self, ask: &Ask, report: &RequestReport, now: MonotonicNs) -> Option<usize> {
        let is_done = report.stage() == Some(Stage::Done);
        match ask {
            Ask::List(_) if !is_done => {
                self.no_answer(now);
                None
            }
            Ask::List(index) => {
                self.ports.push(PortValue {
                    info: report.port,
                    value: None,
                });
                let next = index + 1;
                self.step = match next < report.port.count.min(MAX_PORTS) {
                    true => QueryStep::List(next),
                    false => QueryStep::Read(0),
                };
                None
            }
            Ask::Read(port) => {
                self.set(*port, report.value().filter(|_| is_done));
                self.step = QueryStep::Read(port + 1);
                if port + 1 == self.ports.len() {
                    (self.step, self.due) = (QueryStep::Rest, now + REST);
                }
                Some(*port)
            }
            Ask::Write { port, .. } => {
                if is_done {
                    self.set(*port, report.value());
                }
                Some(*port)
            }
        }
    }

    /// The bridge did not answer, or takes no questions.
    pub fn no_answer(&mut self, now: MonotonicNs) {
        self.due = now + RETRY;
        if let QueryStep::List(_) = self.step {
            *self = Cache {
                due: self.due,
                ..Cache::default()
            };
        }
    }

    fn set(&mut self, port: usize, value: Option<f64>) {
        if let Some(port) = self.ports.get_mut(port) {
            port.value = value;
        }
    }

    /// A value is to be written into a port. False if too many wait.
    pub fn write(&mut self, port: usize, value: f64, from: &str) -> bool {
        let has_room = self.writes.len() < MAX_WRITES;
        if has_room {
            let from = from.to_owned();
            self.writes.push_back(Ask::Write { port, value, from });
        }
        has_room
    }

    /// The names of all ports that have one.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.ports.iter().filter_map(|port| port_name(&port.info))
    }

    /// The port of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.ports
            .iter()
            .position(|port| port_name(&port.info) == Some(name))
    }

    /// A port's name, and its value for clients.
    pub fn said(&self, port: usize) -> Option<(&str, Option<Value>)> {
        let port = self.ports.get(port)?;
        let value = port.value.map(|value| match port.info.kind() {
            Some(PortKind::U16 | PortKind::I16) => Value::from(value as i64),
            _ => Value::from(port_value(&port.info, value)),
        });
        Some((port_name(&port.info)?, value))
    }

    /// The request of a question; `None` if it is about a port that is not known any more.
    pub fn request(&self, ask: &Ask, deadline_ms: u32) -> Option<ParameterRequest> {
        let id = fresh_request_id();
        let number = |port: &usize| u16::try_from(self.ports.get(*port)?.info.number).ok();
        let request = match ask {
            Ask::List(index) => ParameterRequest::list(id, *index),
            Ask::Read(port) => ParameterRequest::read(id, number(port)?),
            Ask::Write { port, value, .. } => ParameterRequest::write(id, number(port)?, *value),
        };
        Some(ParameterRequest {
            begin_by_ns: begin_by_ns(request.issued_ns, deadline_ms),
            ..request
        })
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::code::Reason;

    use super::*;

    fn at(s: u64) -> MonotonicNs {
        MonotonicNs(s * 1_000_000_000)
    }

    fn listed(number: u32, kind: PortKind, count: u32) -> RequestReport {
        RequestReport {
            port: PortInfo {
                number,
                kind: kind.code(),
                count,
                name: PortInfo::name_bytes(&format!("port_{number}")),
                ..PortInfo::default()
            },
            ..RequestReport::new(Stage::Done, Reason::None)
        }
    }

    fn valued(value: f64) -> RequestReport {
        RequestReport {
            value,
            value_valid: 1,
            ..RequestReport::new(Stage::Done, Reason::None)
        }
    }

    /// Two ports, of which the second cannot be read.
    fn filled() -> Cache {
        let mut cache = Cache::default();
        for (index, kind) in [PortKind::F32, PortKind::U16].into_iter().enumerate() {
            let ask = cache.next(at(0)).unwrap();
            assert_eq!(ask, Ask::List(index as u32));
            assert_eq!(
                cache.answer(&ask, &listed(7 + index as u32, kind, 2), at(0)),
                None
            );
        }
        let ask = cache.next(at(0)).unwrap();
        assert_eq!(
            (&ask, cache.answer(&ask, &valued(f64::from(0.1_f32)), at(0))),
            (&Ask::Read(0), Some(0))
        );
        let ask = cache.next(at(0)).unwrap();
        let refused = RequestReport::new(Stage::Refused, Reason::LinkDown);
        assert_eq!(
            (&ask, cache.answer(&ask, &refused, at(0))),
            (&Ask::Read(1), Some(1))
        );
        cache
    }

    #[test]
    fn all_ports_are_listed_and_read_one_after_the_other_and_again_later() {
        let mut cache = filled();
        assert_eq!(cache.said(0), Some(("port_7", Some(Value::from(0.1)))));
        assert_eq!(cache.said(1), Some(("port_8", None)));
        assert_eq!(cache.next(at(29)), None);
        assert_eq!(cache.next(at(30)), Some(Ask::Read(0)));
        // It does not answer: the value stays, and it is asked again.
        cache.no_answer(at(30));
        assert_eq!(
            (cache.next(at(34)), cache.next(at(35))),
            (None, Some(Ask::Read(0)))
        );
        cache.answer(&Ask::Read(1), &valued(3.0), at(36));
        assert_eq!(cache.said(1), Some(("port_8", Some(Value::from(3)))));
    }

    #[test]
    fn a_value_that_is_set_goes_first_and_a_refusal_leaves_the_known_one() {
        let mut cache = filled();
        let port = cache.find("port_7").unwrap();
        let write = Ask::Write {
            port,
            value: 4.0,
            from: "a client".to_owned(),
        };
        cache.writes.push_back(write.clone());
        assert_eq!(cache.next(at(1)), Some(write.clone()));
        let refused = RequestReport::new(Stage::Refused, Reason::LinkDown);
        assert_eq!(cache.answer(&write, &refused, at(1)), Some(0));
        assert_eq!(cache.said(0), Some(("port_7", Some(Value::from(0.1)))));
        assert_eq!(cache.answer(&write, &valued(4.0), at(1)), Some(0));
        assert_eq!(cache.said(0), Some(("port_7", Some(Value::from(4.0)))));
        assert_eq!(cache.find("yaw_gain"), None);
    }

    #[test]
    fn a_list_that_breaks_off_is_begun_anew() {
        let mut cache = Cache::default();
        let ask = cache.next(at(0)).unwrap();
        cache.answer(&ask, &listed(7, PortKind::F32, 3), at(0));
        assert_eq!(cache.next(at(0)), Some(Ask::List(1)));
        cache.no_answer(at(0));
        assert_eq!(
            (cache.next(at(4)), cache.next(at(5))),
            (None, Some(Ask::List(0)))
        );
        let refused = RequestReport::new(Stage::Refused, Reason::LinkDown);
        cache.answer(&Ask::List(0), &refused, at(5));
        assert_eq!(
            (cache.next(at(9)), cache.next(at(10))),
            (None, Some(Ask::List(0)))
        );
    }
}
