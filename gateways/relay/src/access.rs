//! [`access_control`]: which certificate may send and read what, as Zenoh's access rules. A pure function of the configuration.
//!
//! | peer | from it | to it | told to it, and by it |
//! |---|---|---|---|
//! | a robot's relay | its samples and answers | what stations ask and order | that it has them, that it wants them |
//! | a station's relay | what it asks under its own name; orders, when it may command | samples, and answers to its own name | the same |
//! | a router | everything of `hero/` | the same | the same |
//!
//! Whatever no rule allows is denied: other certificates of the same authority, and connections without one.
//!
//! Zenoh looks at the peer at the other end of a connection. Behind a router stand many, and the router's rules alone tell them
//! apart; [`Side::Router`] therefore has these rules as well.

use runtime::config::Fault;
use serde_json::{Value, json};

pub use crate::config::Side;
use crate::config::{Config, Endpoint};

/// Kinds of messages that our relays never send, so that no rule allows them: `delete`, `query`, `reply` and the rest.
/// These are sent.
const SAMPLES: &str = "put";
const SUBSCRIPTIONS: &str = "declare_subscriber";

/// What a peer of one name may do.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Peer {
    /// Common name of its certificate.
    name: String,
    /// Keys of samples that it sends.
    sends: Vec<String>,
    /// Keys of samples that it reads.
    reads: Vec<String>,
    /// Keys that it may subscribe to.
    subscribes: Vec<String>,
    /// Keys that it is told this side has subscribed to.
    learns: Vec<String>,
    /// Whether it may show itself as part of the ROS graph, and look at it.
    ros: Ros,
}

/// A peer's part in the ROS graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ros {
    Publishes,
    Reads,
    Both,
}

/// The value of `access_control`; nothing without certificates, because a rule needs to know who is at the other end.
pub fn access_control(config: &Config, side: Side) -> Option<Value> {
    config.security.authority.as_ref()?;
    let mut peers = Vec::new();
    if side != Side::Robot {
        peers.extend(robots(config));
    }
    if side != Side::Station {
        peers.extend(stations(config));
    }
    peers.extend(routers(config));
    let ros = config.ros2.enabled.then_some(config.ros2.domain_id);
    let (mut rules, mut subjects, mut policies) = (Vec::new(), Vec::new(), Vec::new());
    for peer in peers {
        let of_peer = peer.rules(ros);
        let ids: Vec<&Value> = of_peer.iter().map(|rule| &rule["id"]).collect();
        policies.push(json!({ "rules": ids, "subjects": [peer.name] }));
        subjects.push(json!({ "id": peer.name, "cert_common_names": [peer.name] }));
        rules.extend(of_peer);
    }
    Some(json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }))
}

/// Whether this side may start, and what its operator must be told.
///
/// # Errors
///
/// Why it must not: strangers could order, or certificates are there and no peer may do anything.
pub fn check(config: &Config, side: Side) -> Result<Option<String>, Fault> {
    if let Some(rules) = access_control(config, side) {
        if rules["subjects"].as_array().is_none_or(Vec::is_empty) {
            return Err(Fault::at(
                &["security"],
                "certificates are configured, and no peer may do anything: name the certificates of robots and routers in \
                 `[security]`, those of stations in `[security]` or `[commands]`",
            ));
        }
        let plain = endpoints(config, side).find(|endpoint| !is_encrypted(endpoint));
        return Ok(plain.map(|endpoint| {
            format!("nothing passes through `{endpoint}`: certificates are configured, and it shows none")
        }));
    }
    let Some(door) = open_door(config, side) else {
        return Ok(None);
    };
    let open = match door {
        Door::Discovery => "what is found by `discovery`".to_owned(),
        Door::Endpoint { text, .. } => format!("`{text}`"),
    };
    match side {
        Side::Robot if config.commands.stations.is_empty() => Ok(Some(format!(
            "{open} is not encrypted: everyone who reaches it can read the robot's telemetry"
        ))),
        Side::Robot if !config.security.insecure => Err(door.fault(format!(
            "{open} is not encrypted, so that everyone who reaches it could fly the robot: let `ril relay certify` make \
             certificates and use tls/ or quic/, listen on this machine alone, or write `insecure = true` into `[security]`"
        ))),
        Side::Robot => Ok(Some(format!(
            "INSECURE: {open} is not encrypted: everyone who reaches it can FLY THE ROBOT"
        ))),
        Side::Station => Ok(Some(format!(
            "{open} is not encrypted: what comes through it may be a stranger's"
        ))),
        Side::Router => Ok(Some(format!(
            "{open} is not encrypted: everyone who reaches it can read telemetry, and send requests to robots that take them"
        ))),
    }
}

/// What strangers on the network could use.
enum Door<'a> {
    Discovery,
    Endpoint {
        text: &'a str,
        keys: &'static [&'static str],
    },
}

impl Door<'_> {
    fn fault(&self, reason: String) -> Fault {
        match self {
            Door::Discovery => Fault::at(&["network", "discovery"], reason),
            Door::Endpoint { text, keys } => Fault::at(keys, reason).of(*text),
        }
    }
}

/// The first one, if there is any.
fn open_door(config: &Config, side: Side) -> Option<Door<'_>> {
    if config.network.discovery {
        return Some(Door::Discovery);
    }
    let (listen, connect) = side.endpoints(config);
    let lists = [listen, connect].into_iter().zip(side.keys());
    let mut endpoints = lists.flat_map(|(list, keys)| list.iter().map(move |text| (text, keys)));
    let is_open = |text: &str| {
        let endpoint = Endpoint::parse(text);
        !endpoint.is_ok_and(|endpoint| endpoint.is_encrypted() || endpoint.is_on_this_machine())
    };
    let (text, keys) = endpoints.find(|(text, _)| is_open(text))?;
    Some(Door::Endpoint { text, keys })
}

fn endpoints(config: &Config, side: Side) -> impl Iterator<Item = &String> {
    let (listen, connect) = side.endpoints(config);
    listen.iter().chain(connect)
}

fn is_encrypted(text: &str) -> bool {
    Endpoint::parse(text).is_ok_and(|endpoint| endpoint.is_encrypted())
}

fn robots(config: &Config) -> impl Iterator<Item = Peer> {
    let peer = |(name, number): (&String, &std::num::NonZeroU32)| Peer {
        name: name.clone(),
        sends: keys(number, &["topic/**", "tell/*"]),
        reads: keys(number, &["ask/*", "order/*"]),
        subscribes: keys(number, &["ask/*", "order/*"]),
        learns: keys(number, &["topic/**", "tell/*"]),
        ros: Ros::Publishes,
    };
    config.security.robots.iter().map(peer)
}

fn stations(config: &Config) -> impl Iterator<Item = Peer> {
    let commanding = &config.commands.stations;
    let watching = config.security.stations.iter();
    let watching = watching.filter(|name| !commanding.contains(name));
    commanding.iter().chain(watching).map(|name| {
        let (ask, order) = (format!("ask/{name}"), format!("order/{name}"));
        let tell = format!("tell/{name}");
        let sends = match commanding.contains(name) {
            true => keys(&"*", &[&ask, &order]),
            false => keys(&"*", &[&ask]),
        };
        Peer {
            name: name.clone(),
            sends,
            reads: keys(&"*", &["topic/**", &tell]),
            subscribes: keys(&"*", &["topic/**", &tell]),
            learns: keys(&"*", &["ask/*", "order/*"]),
            ros: Ros::Reads,
        }
    })
}

fn routers(config: &Config) -> impl Iterator<Item = Peer> {
    config.security.routers.iter().map(|name| {
        let all = vec!["hero/**".to_owned()];
        Peer {
            name: name.clone(),
            sends: all.clone(),
            reads: all.clone(),
            subscribes: all.clone(),
            learns: all,
            ros: Ros::Both,
        }
    })
}

fn keys(robot: &impl std::fmt::Display, parts: &[&str]) -> Vec<String> {
    parts
        .iter()
        .map(|part| format!("hero/{robot}/{part}"))
        .collect()
}

impl Peer {
    /// `ros` is the ROS domain, when there is one.
    fn rules(&self, ros: Option<u32>) -> Vec<Value> {
        let rule = |what: &str, messages: &[&str], flow: &str, keys: &[String]| {
            json!({
                "id": format!("{} {what}", self.name),
                "permission": "allow",
                "messages": messages,
                "flows": [flow],
                "key_exprs": keys,
            })
        };
        let mut rules = vec![
            rule("sends", &[SAMPLES], "ingress", &self.sends),
            rule("reads", &[SAMPLES], "egress", &self.reads),
            rule("subscribes", &[SUBSCRIPTIONS], "ingress", &self.subscribes),
            rule("learns", &[SUBSCRIPTIONS], "egress", &self.learns),
        ];
        if let Some(domain) = ros {
            let topics = [format!("{domain}/**")];
            let graph = [format!("@ros2_lv/{domain}/**")];
            let looks = ["liveliness_query", "declare_liveliness_subscriber"];
            if self.ros != Ros::Reads {
                rules.push(rule("ros sends", &[SAMPLES], "ingress", &topics));
                rules.push(rule("ros shows", &["liveliness_token"], "ingress", &graph));
                rules.push(rule("ros wants", &[SUBSCRIPTIONS], "egress", &topics));
                rules.push(rule("ros asks", &looks, "egress", &graph));
            }
            if self.ros != Ros::Publishes {
                rules.push(rule("ros reads", &[SAMPLES], "egress", &topics));
                rules.push(rule("ros sees", &["liveliness_token"], "egress", &graph));
                rules.push(rule("ros subscribes", &[SUBSCRIPTIONS], "ingress", &topics));
                rules.push(rule("ros looks", &looks, "ingress", &graph));
            }
        }
        rules
    }
}

#[cfg(test)]
mod tests;
