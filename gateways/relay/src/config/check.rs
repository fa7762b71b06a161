//! What no single value of relay.toml shows: a pure function of the whole.

use std::collections::{BTreeMap, BTreeSet};

use runtime::config::Fault;

use super::names::{Endpoint, check_name};
use super::topics::check_pattern;
use super::{Config, Side, Through};

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

    /// Whether every name is one, stands once in its list, and is that of a robot, a router or a station alone.
    fn check_names(&self) -> Result<(), Fault> {
        let (security, commands) = (&self.security, &self.commands);
        let lists: [(&'static [&'static str], _, Vec<&String>); 5] = [
            (&["station", "name"], "", self.station.name.iter().collect()),
            (
                &["security", "robots"],
                "a robot",
                security.robots.keys().collect(),
            ),
            (
                &["security", "routers"],
                "a router",
                security.routers.iter().collect(),
            ),
            (
                &["security", "stations"],
                "a station",
                security.stations.iter().collect(),
            ),
            (
                &["commands", "stations"],
                "a station",
                commands.stations.iter().collect(),
            ),
        ];
        let mut roles = BTreeMap::new();
        for (keys, role, names) in lists {
            let mut seen = BTreeSet::new();
            for name in names {
                let fault = |reason: String| Fault::at(keys, reason).of(name.as_str());
                check_name(name).map_err(fault)?;
                if !seen.insert(name) {
                    return Err(fault(format!("`{name}` is named twice: take one out")));
                }
                let former = match role {
                    // A station's own name has the role that the lists give it.
                    "" => None,
                    _ => roles.insert(name, role).filter(|former| *former != role),
                };
                if let Some(former) = former {
                    return Err(fault(format!(
                        "the certificate `{name}` is that of {former} and of {role}: give each its own name"
                    )));
                }
            }
        }
        Ok(())
    }

    fn check_endpoints(&self, is_secured: bool) -> Result<(), Fault> {
        for side in Side::ALL {
            for (endpoint, keys) in side.all_endpoints(self) {
                check_endpoint(endpoint, is_secured)
                    .map_err(|reason| Fault::at(keys, reason).of(endpoint.as_str()))?;
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
