//! [`Discovery`]: which services of the robot are new. What has not changed is not read again.

use std::collections::BTreeMap;

use crate::dynamic::{Announced, ServiceFacts, announced};
use crate::ipc::Ipc;
use crate::schema::LoadError;
use crate::service::Pattern;

/// What is known of the robot's services.
#[derive(Debug, Default)]
pub struct Discovery {
    /// By key the generation of each service about which nothing is left to be done. It has those alone that are
    /// announced now.
    settled: BTreeMap<String, String>,
    schemas_read: u64,
}

impl Discovery {
    /// Hands on each service with a live provider whose generation was not settled before. `take` says whether it is
    /// settled now; else it comes again with the next look.
    pub fn look(&mut self, ipc: &Ipc, mut take: impl FnMut(Pattern, ServiceFacts) -> bool) {
        let mut former = std::mem::take(&mut self.settled);
        for service in announced(ipc.domain(), ipc.robot()) {
            let settled = former.remove(&service.key);
            if settled.as_ref() == Some(&service.generation) || self.settle(&service, &mut take) {
                self.settled.insert(service.key, service.generation);
            }
        }
    }

    fn settle(
        &mut self,
        service: &Announced,
        take: &mut impl FnMut(Pattern, ServiceFacts) -> bool,
    ) -> bool {
        // The next provider begins another generation.
        if service.provider().is_none() {
            return false;
        }
        self.schemas_read += 1;
        match service.read() {
            Ok(Some((pattern, facts))) => take(pattern, facts),
            Ok(None) => true,
            Err(error @ LoadError::Invalid { .. }) => {
                crate::log::warn!(key = service.key, %error, "a service cannot be used");
                true
            }
            // Its provider began another generation meanwhile.
            Err(_) => false,
        }
    }

    /// How many schemas were read so far.
    pub fn schemas_read(&self) -> u64 {
        self.schemas_read
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::payload::{DspTelemetry, HeroTelemetry, MovementData};
    use crate::{Domain, DynamicPublisher, RobotId};

    const SCHEMA: &str = "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\n";

    fn joined() -> Ipc {
        Ipc::join(&Domain::isolated(), RobotId::DEFAULT, "test").unwrap()
    }

    /// The keys that a look brings, of which all are settled.
    fn look(discovery: &mut Discovery, ipc: &Ipc) -> Vec<String> {
        let mut keys = Vec::new();
        discovery.look(ipc, |_, facts| {
            keys.push(facts.key);
            true
        });
        keys
    }

    #[test]
    fn each_schema_is_read_once_in_each_generation_however_often_it_is_looked() {
        let ipc = joined();
        let mut discovery = Discovery::default();
        let mut dsp = ipc.publisher::<DspTelemetry>().unwrap();
        let hero = ipc.publisher::<HeroTelemetry>().unwrap();
        let server = ipc.server::<MovementData>().unwrap();
        let all = ["dsp_telemetry", "hero_telemetry", "movement"];
        assert_eq!(look(&mut discovery, &ipc), all);
        for _ in 0..100 {
            assert_eq!(look(&mut discovery, &ipc), Vec::<String>::new());
        }
        assert_eq!(discovery.schemas_read(), 3);
        dsp.wear_out();
        dsp.service();
        assert_eq!(look(&mut discovery, &ipc), ["dsp_telemetry"]);
        drop((hero, server));
        for _ in 0..100 {
            assert_eq!(look(&mut discovery, &ipc), Vec::<String>::new());
        }
        assert_eq!(discovery.schemas_read(), 4);
        let _hero = ipc.publisher::<HeroTelemetry>().unwrap();
        assert_eq!(look(&mut discovery, &ipc), ["hero_telemetry"]);
        assert_eq!((discovery.schemas_read(), discovery.settled.len()), (5, 2));
    }

    #[test]
    fn what_could_not_be_taken_comes_again_and_how_it_is_carried_is_said() {
        let ipc = joined();
        let mut discovery = Discovery::default();
        let _topic = DynamicPublisher::open(&ipc, "a/a", SCHEMA).unwrap();
        let _server = ipc.server::<MovementData>().unwrap();
        let mut seen = Vec::new();
        for _ in 0..2 {
            discovery.look(&ipc, |pattern, facts| {
                let is_topic = pattern == Pattern::PublishSubscribe;
                seen.push((facts.key, is_topic));
                !is_topic
            });
        }
        let seen: Vec<_> = seen.iter().map(|(key, is)| (key.as_str(), *is)).collect();
        assert_eq!(seen, [("a/a", true), ("movement", false), ("a/a", true)]);
    }
}
