//! [`access_control`]: which certificate may send and read what, as Zenoh's access rules. A pure function of the
//! configuration.
//!
//! | peer | from it | to it | subscriptions that it learns; that it declares |
//! |---|---|---|---|
//! | a robot's relay | its samples and answers | what stations ask and order | to what it sends; to what it reads |
//! | a station's relay | what it asks under its own name; orders, when it may command | samples, and answers to its own name | the same |
//! | a router | everything of `hero/` | the same | the same |
//!
//! Whatever no rule allows is denied: other certificates of the same authority, and connections without one.
//!
//! Zenoh looks at the peer at the other end of a connection. Behind a router stand many, and the router's rules alone
//! tell them apart; [`Side::Router`] therefore has these rules as well.

use runtime::config::Fault;
use serde_json::{Value, json};

use crate::config::{Config, Endpoint, Side};
use crate::names;

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
    /// Keys of samples that it subscribes to and reads.
    reads: Vec<String>,
    /// Keys of which it learns that this side has subscribed to them.
    learns: Vec<String>,
    /// Whether it shows itself as part of the ROS graph.
    publishes_ros: bool,
    /// Whether it looks at the ROS graph.
    reads_ros: bool,
}

/// The value of `access_control`. `None` without certificates, because a rule needs to know which peer is at the other
/// end.
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

/// Whether this side may start, and the warning for its operator.
///
/// # Errors
///
/// Why it must not: everyone on the network could order, or certificates are there and no peer may do anything.
pub fn check(config: &Config, side: Side) -> Result<Option<String>, Fault> {
    if let Some(rules) = access_control(config, side) {
        if rules["subjects"].as_array().is_none_or(Vec::is_empty) {
            return Err(Fault::at(
                &["security"],
                "certificates are configured, and no peer may do anything: name the certificates of robots and routers in \
                 `[security]`, those of stations in `[security]` or `[commands]`",
            ));
        }
        let mut endpoints = side.all_endpoints(config);
        let plain = endpoints.find(|(endpoint, _)| !is_encrypted(endpoint));
        return Ok(plain.map(|(endpoint, _)| {
            format!("nothing passes through `{endpoint}`: certificates are configured, and it shows none")
        }));
    }
    let Some(Door {
        shown,
        keys,
        endpoint,
    }) = open_door(config, side)
    else {
        return Ok(None);
    };
    match side {
        Side::Robot if config.commands.stations.is_empty() => Ok(Some(format!(
            "{shown} is not encrypted: everyone who reaches it can read the robot's telemetry"
        ))),
        Side::Robot if !config.security.insecure => {
            let reason = format!(
                "{shown} is not encrypted, so that everyone who reaches it could fly the robot: let `ril relay certify` make \
                 certificates and use tls/ or quic/, listen on this machine alone, or write `insecure = true` into `[security]`"
            );
            let fault = Fault::at(keys, reason);
            Err(match endpoint {
                Some(endpoint) => fault.of(endpoint),
                None => fault,
            })
        }
        Side::Robot => Ok(Some(format!(
            "INSECURE: {shown} is not encrypted: everyone who reaches it can FLY THE ROBOT"
        ))),
        Side::Station => Ok(Some(format!(
            "{shown} is not encrypted: everyone who reaches it can falsify what comes through it"
        ))),
        Side::Router => Ok(Some(format!(
            "{shown} is not encrypted: everyone who reaches it can read telemetry, and send requests to robots that take them"
        ))),
    }
}

/// A way in for everyone on the network.
struct Door<'a> {
    /// What the operator is shown of it.
    shown: String,
    /// Its place in the configuration.
    keys: &'static [&'static str],
    endpoint: Option<&'a str>,
}

/// The first way in that is neither encrypted nor of this machine alone.
fn open_door(config: &Config, side: Side) -> Option<Door<'_>> {
    if config.network.discovery {
        return Some(Door {
            shown: "what is found by `discovery`".to_owned(),
            keys: &["network", "discovery"],
            endpoint: None,
        });
    }
    let is_open = |text: &str| {
        let endpoint = Endpoint::parse(text);
        !endpoint.is_ok_and(|endpoint| endpoint.is_encrypted() || endpoint.is_on_this_machine())
    };
    let mut endpoints = side.all_endpoints(config);
    let (text, keys) = endpoints.find(|(text, _)| is_open(text))?;
    Some(Door {
        shown: format!("`{text}`"),
        keys,
        endpoint: Some(text.as_str()),
    })
}

fn is_encrypted(text: &str) -> bool {
    Endpoint::parse(text).is_ok_and(|endpoint| endpoint.is_encrypted())
}

fn robots(config: &Config) -> impl Iterator<Item = Peer> {
    config.security.robots.iter().map(|(name, number)| {
        let sends = vec![names::topics(number), names::tell(number, "*")];
        Peer {
            name: name.clone(),
            learns: sends.clone(),
            sends,
            reads: vec![names::ask(number, "*"), names::order(number, "*")],
            publishes_ros: true,
            reads_ros: false,
        }
    })
}

fn stations(config: &Config) -> impl Iterator<Item = Peer> {
    config.stations().map(|(name, may_command)| {
        let mut sends = vec![names::ask("*", name)];
        if may_command {
            sends.push(names::order("*", name));
        }
        Peer {
            name: name.clone(),
            sends,
            reads: vec![names::topics("*"), names::tell("*", name)],
            learns: vec![names::ask("*", "*"), names::order("*", "*")],
            publishes_ros: false,
            reads_ros: true,
        }
    })
}

fn routers(config: &Config) -> impl Iterator<Item = Peer> {
    config.security.routers.iter().map(|name| Peer {
        name: name.clone(),
        sends: vec![names::ALL.to_owned()],
        reads: vec![names::ALL.to_owned()],
        learns: vec![names::ALL.to_owned()],
        publishes_ros: true,
        reads_ros: true,
    })
}

impl Peer {
    /// `ros` is the ROS domain, if there is one.
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
            rule("subscribes", &[SUBSCRIPTIONS], "ingress", &self.reads),
            rule("learns", &[SUBSCRIPTIONS], "egress", &self.learns),
        ];
        if let Some(domain) = ros {
            let topics = [format!("{domain}/**")];
            let graph = [format!("@ros2_lv/{domain}/**")];
            let looks = ["liveliness_query", "declare_liveliness_subscriber"];
            if self.publishes_ros {
                rules.push(rule("ros sends", &[SAMPLES], "ingress", &topics));
                rules.push(rule("ros shows", &["liveliness_token"], "ingress", &graph));
                rules.push(rule("ros wants", &[SUBSCRIPTIONS], "egress", &topics));
                rules.push(rule("ros asks", &looks, "egress", &graph));
            }
            if self.reads_ros {
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
mod tests {
    use super::*;

    /// A configuration with certificates, two robots, a router, a station that commands and one that watches.
    fn config(more: &str) -> Config {
        let text = format!(
            "[security]\nauthority = \"ca.pem\"\ncertificate = \"x.pem\"\nkey = \"x-key.pem\"\n\
         robots = {{ robot-1 = 1, heli = 2 }}\nrouters = [\"hub\"]\nstations = [\"viewer\"]\n\
         [commands]\nstations = [\"gcs\"]\n{more}"
        );
        let config: Config = runtime::config::parse(&text, "relay.toml").unwrap();
        config.check().unwrap();
        config
    }

    fn names(value: &Value) -> Vec<&str> {
        let subjects = value["subjects"].as_array().unwrap();
        subjects
            .iter()
            .map(|subject| subject["id"].as_str().unwrap())
            .collect()
    }

    /// Whether the rules let this through. `*` in a rule stands for one part, `**` at its end for any number.
    fn allows(value: &Value, name: &str, flow: &str, message: &str, key: &str) -> bool {
        let policies = value["policies"].as_array().unwrap();
        let rules = value["rules"].as_array().unwrap();
        let has = |list: &Value, item: &str| {
            let mut list = list.as_array().unwrap().iter();
            list.any(|entry| entry.as_str() == Some(item))
        };
        let mut own = policies
            .iter()
            .filter(|policy| has(&policy["subjects"], name))
            .flat_map(|policy| policy["rules"].as_array().unwrap())
            .flat_map(|id| rules.iter().filter(move |rule| rule["id"] == *id));
        own.any(|rule| {
            let mut patterns = rule["key_exprs"].as_array().unwrap().iter();
            has(&rule["flows"], flow)
                && has(&rule["messages"], message)
                && patterns.any(|pattern| includes(pattern.as_str().unwrap(), key))
        })
    }

    fn includes(pattern: &str, key: &str) -> bool {
        let (mut patterns, mut parts) = (pattern.split('/'), key.split('/'));
        loop {
            match (patterns.next(), parts.next()) {
                (Some("**"), _) => return true,
                (Some("*"), Some(part)) if part != "**" => {}
                (Some(pattern), Some(part)) if pattern == part => {}
                (None, None) => return true,
                _ => return false,
            }
        }
    }

    #[test]
    fn without_certificates_there_are_no_rules_because_no_peer_is_known() {
        let config = Config::default();
        for side in [Side::Robot, Side::Station, Side::Router] {
            assert_eq!(access_control(&config, side), None);
        }
    }

    #[test]
    fn each_side_knows_those_that_can_be_at_the_other_end() {
        let config = config("");
        let of = |side| access_control(&config, side).unwrap();
        assert_eq!(names(&of(Side::Robot)), ["gcs", "viewer", "hub"]);
        assert_eq!(names(&of(Side::Station)), ["heli", "robot-1", "hub"]);
        assert_eq!(
            names(&of(Side::Router)),
            ["heli", "robot-1", "gcs", "viewer", "hub"]
        );
        for side in [Side::Robot, Side::Station, Side::Router] {
            assert_eq!(of(side)["default_permission"], "deny");
        }
    }

    #[test]
    fn a_station_asks_and_orders_under_its_own_name_and_reads_its_own_answers() {
        let rules = access_control(&config(""), Side::Robot).unwrap();
        let may = |name: &str, flow: &str, message: &str, key: &str| {
            allows(&rules, name, flow, message, key)
        };
        for name in ["gcs", "viewer"] {
            let other = if name == "gcs" { "viewer" } else { "gcs" };
            let key = |kind: &str, name: &str| format!("hero/1/{kind}/{name}");
            assert!(may(name, "ingress", "put", &key("ask", name)));
            assert!(!may(name, "ingress", "put", &key("ask", other)));
            assert!(!may(name, "ingress", "put", &key("ask", "*")));
            assert!(!may(name, "ingress", "put", &key("order", other)));
            assert!(!may(name, "ingress", "put", &key("order", "**")));
            assert!(!may(name, "ingress", "put", &key("tell", name)));
            assert!(!may(name, "ingress", "put", &key("topic", "a")));
            for (flow, message) in [("egress", "put"), ("ingress", "declare_subscriber")] {
                assert!(may(name, flow, message, &key("tell", name)));
                assert!(!may(name, flow, message, &key("tell", other)));
                assert!(!may(name, flow, message, &key("tell", "*")));
                assert!(may(name, flow, message, "hero/1/topic/a/b"));
                assert!(!may(name, flow, message, &key("ask", other)));
                assert!(!may(name, flow, message, "hero/**"));
            }
        }
        assert!(may("gcs", "ingress", "put", "hero/1/order/gcs"));
        assert!(!may("viewer", "ingress", "put", "hero/1/order/viewer"));
        assert!(!may("stranger", "ingress", "put", "hero/1/ask/stranger"));
        assert!(!may("robot-1", "ingress", "put", "hero/1/topic/a"));
    }

    #[test]
    fn a_robot_sends_its_own_samples_and_answers_and_nothing_of_another() {
        for side in [Side::Station, Side::Router] {
            let rules = access_control(&config(""), side).unwrap();
            let sends = |name: &str, key: &str| allows(&rules, name, "ingress", "put", key);
            assert!(sends("robot-1", "hero/1/topic/hero_telemetry"));
            assert!(sends("robot-1", "hero/1/tell/gcs"));
            assert!(!sends("robot-1", "hero/2/topic/hero_telemetry"));
            assert!(!sends("robot-1", "hero/*/topic/hero_telemetry"));
            assert!(!sends("robot-1", "hero/1/order/gcs"));
            assert!(sends("heli", "hero/2/topic/hero_telemetry"));
            assert!(!allows(&rules, "heli", "egress", "put", "hero/1/order/gcs"));
            assert!(allows(&rules, "heli", "egress", "put", "hero/2/order/gcs"));
        }
    }

    #[test]
    fn no_rule_allows_queries_deletions_or_liveliness_without_ros() {
        let text = access_control(&config(""), Side::Router)
            .unwrap()
            .to_string();
        for message in ["query", "reply", "delete", "liveliness"] {
            assert!(!text.contains(message), "{message}");
        }
    }

    #[test]
    fn with_ros_robots_publish_in_its_domain_and_stations_read_it() {
        let rules = access_control(
            &config("[ros2]\nenabled = true\ndomain_id = 7\n"),
            Side::Router,
        )
        .unwrap();
        let may = |name: &str, flow: &str, message: &str, key: &str| {
            allows(&rules, name, flow, message, key)
        };
        assert!(may("heli", "ingress", "put", "7/heli/imu"));
        assert!(!may("heli", "ingress", "put", "8/heli/imu"));
        assert!(!may("gcs", "ingress", "put", "7/heli/imu"));
        assert!(may("gcs", "egress", "put", "7/heli/imu"));
        assert!(may(
            "viewer",
            "ingress",
            "declare_liveliness_subscriber",
            "@ros2_lv/7/**"
        ));
    }

    /// A configuration without certificates.
    fn open(text: &str) -> Config {
        let config: Config = runtime::config::parse(text, "relay.toml").unwrap();
        config.check().unwrap();
        config
    }

    #[test]
    fn the_defaults_are_reached_from_this_machine_alone() {
        for side in [Side::Robot, Side::Station, Side::Router] {
            assert_eq!(check(&Config::default(), side), Ok(None));
        }
    }

    #[test]
    fn orders_through_an_open_door_take_a_key_in_the_configuration() {
        for door in [
            "[robot]\nlisten = [\"tcp/0.0.0.0:7447\"]\n",
            "[robot]\nlisten = [\"udp/[::]:7447\"]\n",
            "[robot]\nlisten = [\"tcp/127.0.0.1:7447\", \"tcp/192.168.1.2:7447#iface=eth0\"]\n",
            "[robot]\nconnect = [\"tcp/hub:7447\"]\n",
            "[network]\ndiscovery = true\n",
        ] {
            let warning = check(&open(door), Side::Robot).unwrap().unwrap();
            assert!(warning.contains("read the robot's telemetry"), "{warning}");
            let commands = format!("{door}[commands]\nstations = [\"gcs\"]\n");
            let error = check(&open(&commands), Side::Robot).unwrap_err();
            assert!(error.reason().contains("insecure = true"), "{error}");
            let known = format!("{commands}[security]\ninsecure = true\n");
            let warning = check(&open(&known), Side::Robot).unwrap().unwrap();
            assert!(warning.contains("INSECURE"), "{warning}");
        }
        for closed in [
            "tcp/localhost:1",
            "tcp/127.0.0.9:1",
            "tcp/[::1]:1",
            "udp/[::ffff:127.0.0.1]:1",
        ] {
            let text =
                format!("[robot]\nlisten = [\"{closed}\"]\n[commands]\nstations = [\"gcs\"]\n");
            assert_eq!(check(&open(&text), Side::Robot), Ok(None), "{closed}");
        }
    }

    #[test]
    fn stations_and_routers_are_warned() {
        let text = "[station]\nconnect = [\"tcp/10.0.0.2:7447\"]\n[router]\nlisten = [\"tcp/0.0.0.0:7447\"]\n";
        for side in [Side::Station, Side::Router] {
            assert!(check(&open(text), side).unwrap().is_some());
        }
    }

    #[test]
    fn with_certificates_someone_must_be_admitted_and_plain_endpoints_are_said_to_be_dead() {
        let text = "[security]\nauthority = \"a\"\ncertificate = \"b\"\nkey = \"c\"\n";
        let error = check(&open(text), Side::Robot).unwrap_err();
        assert!(error.reason().contains("no peer"), "{error}");
        let warning = check(&config(""), Side::Robot).unwrap().unwrap();
        assert!(warning.contains("nothing passes"), "{warning}");
        let encrypted = config("[robot]\nlisten = [\"tls/0.0.0.0:7447\", \"quic/0.0.0.0:7447\"]\n");
        assert_eq!(check(&encrypted, Side::Robot), Ok(None));
    }
}
