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
    let may =
        |name: &str, flow: &str, message: &str, key: &str| allows(&rules, name, flow, message, key);
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
    let may =
        |name: &str, flow: &str, message: &str, key: &str| allows(&rules, name, flow, message, key);
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
        let text = format!("[robot]\nlisten = [\"{closed}\"]\n[commands]\nstations = [\"gcs\"]\n");
        assert_eq!(check(&open(&text), Side::Robot), Ok(None), "{closed}");
    }
}

#[test]
fn stations_and_routers_are_warned() {
    let text =
        "[station]\nconnect = [\"tcp/10.0.0.2:7447\"]\n[router]\nlisten = [\"tcp/0.0.0.0:7447\"]\n";
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
