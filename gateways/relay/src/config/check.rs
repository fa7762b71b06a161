//! What no single value of relay.toml shows: a pure function of the whole.

use std::collections::{BTreeMap, BTreeSet};

use runtime::config::Fault;

use super::endpoint::Endpoint;
use super::file::Config;
use super::name::check_name;
use super::network::Through;
use super::side::Side;
use super::topics::check_pattern;

impl Config {
    /// Whether everything fits together, of all sides: one file may lie on all machines.
    ///
    /// # Errors
    ///
    /// What is wrong, where, and what to do about it.
    pub fn check(&self) -> Result<(), Fault> {
        let is_secured = self.security.certificates()?.is_some();
        if is_secured && self.security.insecure {
            return Err(Fault::at(
                &["security", "insecure"],
                "`[security]` has certificates and `insecure = true`: take one of them out",
            ));
        }
        self.check_names()?;
        self.check_roles()?;
        self.check_endpoints(is_secured)?;
        self.check_topics()
    }

    /// Whether `side` can take part in the network.
    ///
    /// # Errors
    ///
    /// As [`Config::check`].
    pub fn check_side(&self, side: Side) -> Result<(), Fault> {
        let (_, connect) = side.endpoints(self);
        let goes_through = side != Side::Router && self.network.through == Through::Router;
        if goes_through && connect.is_empty() && !self.network.discovery {
            let [_, keys] = side.keys();
            return Err(Fault::at(
                &["network", "through"],
                format!(
                    "this side goes through routers, and `{}` names none: add the endpoint of a router, or take `discovery = true`",
                    keys.join(".")
                ),
            ));
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), Fault> {
        if let Some(name) = &self.station.name {
            check_name(name)
                .map_err(|reason| Fault::at(&["station", "name"], reason).of(name.as_str()))?;
        }
        let lists: [(_, &'static [&'static str]); 3] = [
            (&self.commands.stations, &["commands", "stations"]),
            (&self.security.stations, &["security", "stations"]),
            (&self.security.routers, &["security", "routers"]),
        ];
        for (names, keys) in lists {
            let mut seen = BTreeSet::new();
            for name in names {
                check_name(name).map_err(|reason| Fault::at(keys, reason).of(name.as_str()))?;
                if !seen.insert(name) {
                    let reason = format!("`{name}` is named twice: take one out");
                    return Err(Fault::at(keys, reason).of(name.as_str()));
                }
            }
        }
        for name in self.security.robots.keys() {
            let keys = &["security", "robots"];
            check_name(name).map_err(|reason| Fault::at(keys, reason).of(name.as_str()))?;
        }
        Ok(())
    }

    /// A certificate is that of a robot, a router or a station.
    fn check_roles(&self) -> Result<(), Fault> {
        let security = &self.security;
        let mut roles = BTreeMap::new();
        for name in security.robots.keys() {
            roles.insert(name, "a robot");
        }
        let lists: [(_, _, &'static [&'static str]); 3] = [
            (&security.routers, "a router", &["security", "routers"]),
            (&security.stations, "a station", &["security", "stations"]),
            (
                &self.commands.stations,
                "a station",
                &["commands", "stations"],
            ),
        ];
        for (names, role, keys) in lists {
            for name in names {
                let former = roles.insert(name, role);
                if let Some(former) = former.filter(|former| *former != role) {
                    let reason = format!(
                        "the certificate `{name}` is that of {former} and of {role}: give each its own name"
                    );
                    return Err(Fault::at(keys, reason).of(name.as_str()));
                }
            }
        }
        Ok(())
    }

    fn check_endpoints(&self, is_secured: bool) -> Result<(), Fault> {
        for side in Side::ALL {
            let (listen, connect) = side.endpoints(self);
            for (endpoints, keys) in [listen, connect].into_iter().zip(side.keys()) {
                for endpoint in endpoints {
                    check_endpoint(endpoint, is_secured)
                        .map_err(|reason| Fault::at(keys, reason).of(endpoint.as_str()))?;
                }
            }
        }
        let group = self.network.multicast;
        if !group.ip().is_multicast() {
            let reason = format!(
                "`{group}` is no group: write one such as 224.0.0.224:7446, or leave it out"
            );
            return Err(Fault::at(&["network", "multicast"], reason));
        }
        Ok(())
    }

    fn check_topics(&self) -> Result<(), Fault> {
        let topics = &self.topics;
        let rules: Vec<&String> = topics.rules.iter().map(|rule| &rule.key).collect();
        let lists: [(Vec<&String>, &'static [&'static str]); 3] = [
            (topics.include.iter().collect(), &["topics", "include"]),
            (topics.exclude.iter().collect(), &["topics", "exclude"]),
            (rules, &["topics", "rules"]),
        ];
        for (patterns, keys) in lists {
            for pattern in patterns {
                check_pattern(pattern)
                    .map_err(|reason| Fault::at(keys, reason).of(pattern.as_str()))?;
            }
        }
        Ok(())
    }
}

fn check_endpoint(text: &str, is_secured: bool) -> Result<(), String> {
    let endpoint = Endpoint::parse(text)?;
    if is_secured && endpoint.is_multicast() {
        return Err(format!(
            "`{text}` is a group, in which certificates mean nothing: take it out, or do without certificates"
        ));
    }
    if endpoint.is_encrypted() && !is_secured {
        return Err(format!(
            "`{text}` is encrypted, which takes certificates: name them in `[security]`, or let `ril relay certify` make them"
        ));
    }
    Ok(())
}
