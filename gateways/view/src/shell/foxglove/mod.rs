//! [`Foxglove`]: what Foxglove and Lichtblick get of the robots, and what they order.
//!
//! * [`channels`]: the topics of processes; [`derived`]: those that are made here, of `geojson` among others;
//! * [`services`]: orders; [`parameters`]: the DSP's.

mod channels;
mod derived;
mod geojson;
mod parameters;
mod services;

use ipc_types::MonotonicNs;
use operator::config::RequestConfig;
use operator::robot::clock::Clocks;
use serde_json::Value;

use self::channels::Channels;
use self::derived::Derived;
use self::parameters::Parameters;
pub(crate) use self::services::ServiceCall;
use self::services::Services;
use super::fleet::Fleet;
use super::orders::Orders;
use crate::{Server, page};

/// What Foxglove clients get of the robots, and what they order.
pub(crate) struct Foxglove {
    channels: Channels,
    derived: Derived,
    /// `None` if clients order nothing.
    commands: Option<Commands>,
    requests: RequestConfig,
}

struct Commands {
    services: Services,
    parameters: Parameters,
}

impl Foxglove {
    pub fn new(has_commands: bool, requests: RequestConfig) -> Foxglove {
        Foxglove {
            channels: Channels::default(),
            derived: Derived::default(),
            commands: has_commands.then(|| Commands {
                services: Services::default(),
                parameters: Parameters::default(),
            }),
            requests,
        }
    }

    /// Sends what has come of all robots.
    pub fn drain(&mut self, fleet: &mut Fleet, server: &mut Server, clock: Clocks) {
        for shown in fleet.iter_mut() {
            self.channels.drain(shown.ports.ipc(), server, clock);
            self.derived.drain(shown, server, clock);
        }
        if let Some(commands) = &mut self.commands {
            commands.services.offer(fleet.ids(), server);
            if server.wants_parameters() {
                commands
                    .parameters
                    .drain(fleet, server, &self.requests, clock.now);
            }
        }
    }

    /// A client calls a service.
    pub fn call(
        &mut self,
        call: ServiceCall,
        (fleet, orders): (&mut Fleet, &mut Orders),
        server: &mut Server,
        now: MonotonicNs,
    ) {
        if let Some(commands) = &mut self.commands {
            commands
                .services
                .call(call, (fleet, orders), server, &self.requests, now);
        }
    }

    /// The report of an order: the first one about a call is its answer.
    pub fn report(&mut self, report: &page::OrderReport, request_id: u64, server: &mut Server) {
        if let Some(commands) = &mut self.commands {
            commands.services.report(report, request_id, server);
        }
    }

    /// A client sets a parameter.
    pub fn set(&mut self, name: &str, value: &Value, from: &str, server: &mut Server) {
        if let Some(commands) = &mut self.commands {
            commands.parameters.set(name, value, from, server);
        }
    }
}
