//! [`Cache`]: what is known of a robot's ports, and what to ask its bridge next.
//!
//! | step | report | no answer |
//! |---|---|---|
//! | list port n | n + 1, or read all | list again later |
//! | read port n | n + 1, or rest; a port that cannot be read has no value | go on later |
//! | rest | | read all when it is over |
//!
//! A value that a client sets goes first.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::code::{PortKind, Stage};
use ipc_types::payload::{ParameterRequest, PortInfo, RequestReport};
use ipc_types::{MonotonicNs, fresh_request_id};
use serde_json::Value;

use crate::render::messages::details::{port_name, port_value};
use crate::request::begin_by_ns;

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
pub(super) enum Ask {
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

/// See the module's documentation.
#[derive(Debug, Default)]
pub(super) struct Cache {
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
