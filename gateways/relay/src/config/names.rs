//! Names and addresses, as relay.toml and the command line have them: the name of a station or of a certificate, which
//! is a part of keys and is shown to operators, and an [`Endpoint`] of the network,
//! `protocol/host:port?options#options`. The options are Zenoh's, which reads them itself.

use std::net::IpAddr;

/// Protocols of an endpoint, and whether they are encrypted.
const PROTOCOLS: [(&str, bool); 4] = [
    ("tcp", false),
    ("udp", false),
    ("tls", true),
    ("quic", true),
];

/// Longest endpoint, bytes: Zenoh takes no longer one.
const MAX_LEN: usize = 255;

/// Longest name of a host in DNS, bytes.
const MAX_HOST: usize = 253;

/// Longest name of a station, bytes: it is shown in a field of 32 that ends with a zero.
pub const MAX_NAME: usize = 31;

/// Whether this can be the name of a station.
///
/// # Errors
///
/// What is wrong with it.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(is_letter) {
        return Err(format!(
            "`{name}` is no name of a station: use 1 to {MAX_NAME} letters, digits, - and _"
        ));
    }
    Ok(())
}

/// An endpoint, taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Endpoint<'a> {
    /// A name or an address; one of IPv6 without brackets.
    host: &'a str,
    /// `None` if the host is a name.
    address: Option<IpAddr>,
    is_encrypted: bool,
}

impl<'a> Endpoint<'a> {
    /// Takes an endpoint apart.
    ///
    /// # Errors
    ///
    /// What is wrong with it, and what to write instead.
    pub fn parse(text: &'a str) -> Result<Endpoint<'a>, String> {
        let none = |what: &str| {
            format!(
                "`{text}` is no endpoint, {what}: write tcp/, udp/, tls/ or quic/, then address and port, such as tcp/10.0.0.2:7447"
            )
        };
        if text.len() > MAX_LEN {
            return Err(none("it has more than 255 bytes"));
        }
        let (protocol, rest) = text
            .split_once('/')
            .ok_or_else(|| none("it has no protocol"))?;
        let known = PROTOCOLS.iter().find(|(name, _)| *name == protocol);
        let (_, is_encrypted) = known.ok_or_else(|| none("its protocol is none of four"))?;
        let host_and_port = rest.split(['?', '#']).next().unwrap_or_default();
        let (host, port) = host_and_port
            .rsplit_once(':')
            .ok_or_else(|| none("it has no port"))?;
        if port.parse::<u16>().is_err() {
            return Err(none("its port is no number up to 65535"));
        }
        let (host, address) =
            host_of(host).ok_or_else(|| none("its host is neither a name nor an address"))?;
        Ok(Endpoint {
            host,
            address,
            is_encrypted: *is_encrypted,
        })
    }

    /// Whether what goes through it is encrypted.
    pub fn is_encrypted(&self) -> bool {
        self.is_encrypted
    }

    /// Whether it is reached from this machine alone.
    pub fn is_on_this_machine(&self) -> bool {
        self.host == "localhost"
            || self
                .address
                .is_some_and(|address| address.to_canonical().is_loopback())
    }

    /// Whether it is a multicast group.
    pub fn is_multicast(&self) -> bool {
        self.address.is_some_and(|address| address.is_multicast())
    }
}

/// The host without the brackets of an address of IPv6, and the address if it is one.
fn host_of(host: &str) -> Option<(&str, Option<IpAddr>)> {
    if let Some(host) = host.strip_prefix('[') {
        let host = host.strip_suffix(']')?;
        let address: IpAddr = host.parse().ok()?;
        return address.is_ipv6().then_some((host, Some(address)));
    }
    if let Ok(address) = host.parse::<IpAddr>() {
        // Without brackets, its last part would be taken for the port.
        return address.is_ipv4().then_some((host, Some(address)));
    }
    is_host_name(host).then_some((host, None))
}

/// Whether this can be the name of a host. What looks like an address of IPv4 is none.
pub fn is_host_name(host: &str) -> bool {
    let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let has_letter = host
        .bytes()
        .any(|byte| !byte.is_ascii_digit() && byte != b'.');
    !host.is_empty() && host.len() <= MAX_HOST && has_letter && host.bytes().all(is_letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endpoint_is_a_protocol_a_host_and_a_port() {
        for (text, is_encrypted, is_on_this_machine) in [
            ("tcp/10.0.0.2:7447", false, false),
            ("udp/[::]:7447", false, false),
            ("tls/heli.example:1", true, false),
            ("quic/robot-1:65535?rel=0", true, false),
            ("tcp/192.168.1.2:7447#iface=eth0", false, false),
            ("tcp/localhost:1", false, true),
            ("tcp/127.0.0.9:1", false, true),
            ("udp/[::ffff:127.0.0.1]:1", false, true),
        ] {
            let endpoint = Endpoint::parse(text).unwrap();
            assert_eq!(endpoint.is_encrypted(), is_encrypted, "{text}");
            assert_eq!(endpoint.is_on_this_machine(), is_on_this_machine, "{text}");
            assert!(!endpoint.is_multicast(), "{text}");
        }
        assert!(Endpoint::parse("udp/224.0.0.9:1").unwrap().is_multicast());
        assert!(Endpoint::parse("udp/[ff02::1]:1").unwrap().is_multicast());
    }

    #[test]
    fn what_is_no_endpoint_is_refused_with_what_is_wrong() {
        let long = format!("tcp/{}:1", "a".repeat(MAX_LEN));
        for (text, excerpt) in [
            ("", "no protocol"),
            ("7447", "no protocol"),
            ("10.0.0.2:7447", "no protocol"),
            ("http/10.0.0.2:80", "none of four"),
            ("TCP/10.0.0.2:80", "none of four"),
            ("tcp/10.0.0.2", "no port"),
            ("tcp/10.0.0.2:", "up to 65535"),
            ("tcp/10.0.0.2:65536", "up to 65535"),
            ("tcp/10.0.0.2:-1", "up to 65535"),
            ("tcp/10.0.0.2:http", "up to 65535"),
            ("tcp/:7447", "neither a name nor an address"),
            ("tcp/10.0.0.256:7447", "neither a name nor an address"),
            ("tcp/10.0.2:7447", "neither a name nor an address"),
            ("tcp/::1:7447", "neither a name nor an address"),
            ("tcp/[::1:7447", "neither a name nor an address"),
            ("tcp/[10.0.0.2]:7447", "neither a name nor an address"),
            ("tcp/a b:7447", "neither a name nor an address"),
            ("tcp/a/b:7447", "neither a name nor an address"),
            ("tcp/*:7447", "neither a name nor an address"),
            (&long, "255 bytes"),
        ] {
            let error = Endpoint::parse(text).unwrap_err();
            assert!(error.contains(excerpt), "{error}");
            assert!(error.contains("such as tcp/10.0.0.2:7447"), "{error}");
        }
    }
}
