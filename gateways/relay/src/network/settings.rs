//! [`zenoh_config`]: Zenoh's configuration, made of the relay's; [`share_one_thread`]: what Zenoh reads elsewhere.

use runtime::config::Fault;
use serde_json::{Value, json};
use zenoh::config::EndPoint;

use crate::access::access_control;
use crate::config::{Config, Side, Through};
use crate::random::fresh;

/// Longest message that is put together of fragments, bytes: the longest sample.
pub const MAX_MESSAGE_BYTES: usize = 2 * 1024 * 1024;

/// Bytes that are sent together at most. While a link takes nothing, messages collect in batches of this size, and what
/// is in them grows old: Zenoh's own 64 KiB are five seconds of a link of 100 kbit/s.
const BATCH_BYTES: u16 = 4352;

/// Batches of samples that may wait to be sent, for each priority: a burst of one sample of each of some topics. What
/// finds no room is dropped. 2 · 4,352 bytes are 0.7 s of a link of 100 kbit/s.
const SAMPLE_BATCHES: usize = 2;

/// Batches of samples that may wait in a router, where samples of many robots go to one station: as many as Zenoh
/// takes. With 20 robots at 50 samples a second of two topics, 16 batches are full when the router's sender does not
/// run for some tens of milliseconds.
const ROUTER_SAMPLE_BATCHES: usize = 16;

/// How long a sample that finds no room waits for it, µs, once in each congestion: a thread of Zenoh that does not run
/// for a moment on a busy machine is no slow link.
const WAIT_FOR_ROOM_US: u32 = 20_000;

/// How long a sample waits for room in a router, µs. The router's receiving thread would wait: one station that is
/// stalled must not hold up all robots.
const ROUTER_WAIT_FOR_ROOM_US: u32 = 1000;

/// Batches of other messages that may wait to be sent, the most that Zenoh takes: four of the longest requests, which
/// have 16 KiB, or 16 others, which have one batch at most. What finds no room is dropped, and sent or asked for again.
const MESSAGE_BATCHES: usize = 16;

/// How long the side that listens waits for the next message of one that connects, ms: one round trip of a slow link,
/// and three of its losses. Who says nothing for so long, within TLS or after it, loses his connection.
const HALF_OPEN_MS: u64 = 5000;

/// Connections that may be half open. One more is closed at once, because each takes a file of the process.
const MOST_HALF_OPEN: usize = 1000;

/// Longest pause between two attempts to connect, ms, unless `retry_ms` is longer. The pauses grow to it, because an
/// attempt that the other side refuses costs it a tenth of a second in which it accepts nobody else.
const LONGEST_RETRY_MS: u64 = 2000;

/// By how much the pauses grow at least and at most. Each process has a number of its own between them, so that
/// stations which have lost a link together do not all come back together.
const RETRY_GROWTH: [f64; 2] = [1.5, 2.0];

/// What `.cargo/config.toml` sets for Zenoh, which reads it when it is compiled; the reasons stand there.
const _: () = assert!(
    is(option_env!("TCP_LINGER_TIMEOUT"), "0")
        && is(option_env!("TLS_LINGER_TIMEOUT"), "0")
        && is(option_env!("TLS_ACCEPT_THROTTLE_TIME"), "1000")
        && is(option_env!("QUIC_ACCEPT_THROTTLE_TIME"), "1000"),
    "build the relay in its repository, or with the variables of its .cargo/config.toml"
);

const fn is(value: Option<&str>, expected: &str) -> bool {
    let (Some(value), expected) = (value, expected.as_bytes()) else {
        return false;
    };
    let value = value.as_bytes();
    let mut index = 0;
    while index < value.len() && index < expected.len() && value[index] == expected[index] {
        index += 1;
    }
    index == value.len() && index == expected.len()
}

/// What Zenoh reads about its threads when the first one of them is started.
const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// One thread does what five to six do by default.
const ONE_THREAD: &str =
    "(app: (handover: net), acc: (handover: net), tx: (handover: net), rx: (handover: net))";

/// Lets one thread of Zenoh wait for the sockets, receive and send. By default one thread waits and wakes another one
/// that receives, which makes each message later by a wake-up and costs a third of the processor time of a relay; only
/// a router has so much to do that several threads help. To be called first of all: it changes nothing when the process
/// has threads already, or when `ZENOH_RUNTIME` is set.
pub fn share_one_thread() {
    let is_alone = std::fs::read_dir("/proc/self/task").is_ok_and(|threads| threads.count() == 1);
    if is_alone && std::env::var_os(RUNTIME_VARIABLE).is_none() {
        // SAFETY: no other thread reads or writes the environment meanwhile, because there is none.
        #[allow(unsafe_code)]
        unsafe {
            std::env::set_var(RUNTIME_VARIABLE, ONE_THREAD);
        }
    }
}

/// Whether Zenoh takes the endpoints of `side`, of which it reads what is behind `?` and `#`, and all the rest.
///
/// # Errors
///
/// What it refuses, and what to do.
pub fn check(config: &Config, side: Side) -> Result<(), Fault> {
    for (endpoint, keys) in side.all_endpoints(config) {
        if endpoint.parse::<EndPoint>().is_err() {
            let reason = format!(
                "what is behind `?` or `#` in `{endpoint}` are no options: write them as name=value, divided by `;`, first \
                 those behind `?`, or take the sign out"
            );
            return Err(Fault::at(keys, reason).of(endpoint.as_str()));
        }
    }
    zenoh_config(config, side).map(drop).map_err(|error| {
        let reason = format!("the network refuses its configuration: {error}");
        Fault::at(&["network"], reason)
    })
}

/// Zenoh's configuration. Nothing that others on the network could use is on unless it was asked for.
pub(super) fn zenoh_config(config: &Config, side: Side) -> zenoh::Result<zenoh::Config> {
    let network = &config.network;
    let (listen, connect) = side.endpoints(config);
    let mode = match (side, network.through) {
        (Side::Router, _) => "router",
        (Side::Robot | Side::Station, Through::Peers) => "peer",
        (Side::Robot | Side::Station, Through::Router) => "client",
    };
    let (sample_batches, wait_us) = match side {
        Side::Robot | Side::Station => (SAMPLE_BATCHES, WAIT_FOR_ROOM_US),
        Side::Router => (ROUTER_SAMPLE_BATCHES, ROUTER_WAIT_FOR_ROOM_US),
    };
    let [least, most] = RETRY_GROWTH;
    let growth = least + (most - least) * (fresh() as f64 / u64::MAX as f64);
    let settings = json!({
        "mode": mode,
        "listen": { "endpoints": with_options(listen, &format!("tls_handshake_timeout_ms={HALF_OPEN_MS}")) },
        "connect": {
            "endpoints": with_options(&with_names(connect), ""),
            "timeout_ms": -1,
            "exit_on_failure": false,
            "retry": {
                "period_init_ms": network.retry_ms,
                "period_max_ms": network.retry_ms.max(LONGEST_RETRY_MS),
                "period_increase_factor": growth,
            },
        },
        "scouting": {
            "multicast": { "enabled": network.discovery, "address": network.multicast.to_string() },
            "gossip": { "enabled": network.discovery },
        },
        "adminspace": { "enabled": false },
        "transport": {
            "unicast": {
                "open_timeout": network.open_timeout_ms,
                "accept_timeout": HALF_OPEN_MS,
                "accept_pending": MOST_HALF_OPEN,
            },
            "link": {
                "tx": {
                    "lease": network.lease_ms,
                    "threads": 1,
                    "batch_size": BATCH_BYTES,
                    "queue": {
                        "congestion_control": { "drop": { "wait_before_drop": wait_us } },
                        "size": {
                            "control": 2,
                            "interactive_high": MESSAGE_BATCHES,
                            "interactive_low": sample_batches,
                            "real_time": sample_batches,
                            "data_high": sample_batches,
                            "data": sample_batches,
                            "data_low": sample_batches,
                            "background": sample_batches,
                        },
                    },
                },
                "rx": { "max_message_size": MAX_MESSAGE_BYTES },
                "tcp": { "so_sndbuf": network.send_buffer_bytes },
                "tls": tls(config),
            },
        },
    });
    let mut zenoh_config = zenoh::Config::from_json5(&settings.to_string())?;
    if let Some(rules) = access_control(config, side) {
        zenoh_config.insert_json5("access_control", &rules.to_string())?;
    }
    Ok(zenoh_config)
}

/// With certificates both sides show one, and the side that connects compares the name or address that it has connected
/// to with the certificate.
fn tls(config: &Config) -> Value {
    let mut settings = json!({ "so_sndbuf": config.network.send_buffer_bytes });
    if let Ok(Some(files)) = config.security.certificates() {
        settings["root_ca_certificate"] = json!(files.authority);
        settings["listen_certificate"] = json!(files.certificate);
        settings["listen_private_key"] = json!(files.key);
        settings["connect_certificate"] = json!(files.certificate);
        settings["connect_private_key"] = json!(files.key);
        settings["enable_mtls"] = json!(true);
        settings["verify_name_on_connect"] = json!(true);
        settings["close_link_on_expiration"] = json!(true);
    }
    settings
}

/// The endpoints to connect to, of which Zenoh takes what is in front of the last `:` for the name in the certificate:
/// the address of the sixth version of IP without its brackets.
fn with_names(endpoints: &[String]) -> Vec<String> {
    let with_name = |endpoint: &String| {
        let (protocol, rest) = endpoint.split_once('/')?;
        let address = rest
            .strip_prefix('[')
            .filter(|_| matches!(protocol, "tls" | "quic"))?;
        let (address, rest) = address.split_once("]:")?;
        Some(format!("{protocol}/{address}:{rest}"))
    };
    let of = |endpoint| with_name(endpoint).unwrap_or_else(|| endpoint.clone());
    endpoints.iter().map(of).collect()
}

/// QUIC carries samples as datagrams beside its stream, so that a lost one holds up none that follows. `of_tls` is an
/// option of endpoints of TLS, which is behind their own ones.
fn with_options(endpoints: &[String], of_tls: &str) -> Vec<String> {
    let with_options = |endpoint: &String| {
        if endpoint.starts_with("tls/") && !of_tls.is_empty() {
            let sign = if endpoint.contains('#') { ';' } else { '#' };
            return format!("{endpoint}{sign}{of_tls}");
        }
        if !endpoint.starts_with("quic/") || endpoint.contains('?') {
            return endpoint.clone();
        }
        // Options behind `#` come last.
        let place = endpoint.find('#').unwrap_or(endpoint.len());
        let (address, options) = endpoint.split_at(place);
        format!("{address}?mixed_rel=1{options}")
    };
    endpoints.iter().map(with_options).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_takes_the_rules_and_the_certificates() {
        let text = "[security]\nauthority = \"ca.pem\"\ncertificate = \"x.pem\"\nkey = \"x-key.pem\"\n\
                    robots = { robot-1 = 1 }\nrouters = [\"hub\"]\n[commands]\nstations = [\"gcs\"]\n[ros2]\nenabled = true\n";
        let config: Config = runtime::config::parse(text, "relay.toml").unwrap();
        for side in [Side::Robot, Side::Station, Side::Router] {
            let zenoh = zenoh_config(&config, side).unwrap();
            let read = |key| zenoh.get_json(key).unwrap();
            assert_eq!(read("access_control/enabled"), "true");
            assert_eq!(read("transport/link/tls/enable_mtls"), "true");
            assert_eq!(read("transport/link/tls/verify_name_on_connect"), "true");
        }
    }

    #[test]
    fn samples_are_datagrams_on_quic_whatever_its_other_options_are() {
        for (endpoint, expected) in [
            ("quic/10.0.0.2:1", "quic/10.0.0.2:1?mixed_rel=1"),
            (
                "quic/10.0.0.2:1#iface=eth0",
                "quic/10.0.0.2:1?mixed_rel=1#iface=eth0",
            ),
            ("quic/10.0.0.2:1?mixed_rel=0", "quic/10.0.0.2:1?mixed_rel=0"),
            ("tcp/10.0.0.2:1#iface=eth0", "tcp/10.0.0.2:1#iface=eth0"),
        ] {
            assert_eq!(with_options(&[endpoint.to_owned()], ""), [expected]);
            assert!(expected.parse::<EndPoint>().is_ok(), "{expected}");
        }
    }

    #[test]
    fn an_address_of_the_sixth_version_of_ip_is_compared_with_the_certificate() {
        for (endpoint, expected) in [
            ("tls/[2001:db8::1]:7447", "tls/2001:db8::1:7447"),
            (
                "quic/[::1]:7447?mixed_rel=1#iface=lo",
                "quic/::1:7447?mixed_rel=1#iface=lo",
            ),
            ("tcp/[::1]:7447", "tcp/[::1]:7447"),
            ("tls/10.0.0.2:7447", "tls/10.0.0.2:7447"),
            ("quic/robot-1.local:7447", "quic/robot-1.local:7447"),
        ] {
            assert_eq!(with_names(&[endpoint.to_owned()]), [expected]);
            assert!(expected.parse::<EndPoint>().is_ok(), "{expected}");
        }
        let text = "[station]\nconnect = [\"quic/[::1]:7447\"]\n";
        let config: Config = runtime::config::parse(text, "relay.toml").unwrap();
        let zenoh = zenoh_config(&config, Side::Station).unwrap();
        let endpoints = zenoh.get_json("connect/endpoints").unwrap();
        assert!(
            endpoints.contains("quic/::1:7447?mixed_rel=1"),
            "{endpoints}"
        );
    }

    #[test]
    fn half_a_handshake_holds_a_connection_for_five_seconds_at_most() {
        let text = "[robot]\nlisten = [\"tls/127.0.0.1:1\", \"tls/127.0.0.1:2#iface=lo\", \"tcp/127.0.0.1:3\"]\n";
        let config: Config = runtime::config::parse(text, "relay.toml").unwrap();
        let zenoh = zenoh_config(&config, Side::Robot).unwrap();
        let read = |key| zenoh.get_json(key).unwrap();
        assert_eq!(read("transport/unicast/accept_timeout"), "5000");
        assert_eq!(read("transport/unicast/accept_pending"), "1000");
        for expected in [
            "tls/127.0.0.1:1#tls_handshake_timeout_ms=5000",
            "tls/127.0.0.1:2#iface=lo;tls_handshake_timeout_ms=5000",
            "tcp/127.0.0.1:3\"",
        ] {
            assert!(read("listen/endpoints").contains(expected), "{expected}");
        }
    }

    #[test]
    fn the_pauses_between_attempts_to_connect_grow_and_those_of_two_stations_differ() {
        let growth = || {
            let zenoh = zenoh_config(&Config::default(), Side::Station).unwrap();
            let retry = zenoh.get_json("connect/retry").unwrap();
            let retry: Value = serde_json::from_str(&retry).unwrap();
            assert_eq!(retry["period_init_ms"], 100);
            assert_eq!(retry["period_max_ms"], 2000);
            retry["period_increase_factor"].as_f64().unwrap()
        };
        let [one, other] = [growth(), growth()];
        assert!((1.5..=2.0).contains(&one) && one != other, "{one} {other}");
    }
}
