//! [`Access`]: what a peer may do, by the names and the page that its request gives, where it is, and its token.
//!
//! A loopback port is open to every user of the machine and, by script, to every web page that a browser has open
//! there. Host ends the pages that a foreign name leads here (DNS rebinding), Origin all others; the token ends other
//! users.

use std::net::IpAddr;

use crate::event::{Peer, Settings, Token};
use crate::http::refusal::Refusal;
use crate::http::request::HttpRequest;
use crate::page::Role;

/// Names by which every machine may call itself.
const LOOPBACK_NAMES: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];

/// The origin of programs that show a page of their own from a file, such as Lichtblick. Browsers send "null" for
/// files.
const FILE_ORIGIN: &str = "file://";

/// What a viewer may do, and under which name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Permit {
    pub role: Role,
    /// Of its token; `None` if it has none.
    pub name: Option<String>,
}

/// What a peer may do, by the names and the page that its request gives, where it is, and its token.
#[derive(Debug)]
pub(crate) struct Access {
    names: Vec<String>,
    origins: Vec<String>,
    tokens: Vec<Token>,
}

impl Access {
    pub fn new(settings: &Settings) -> Access {
        Access {
            names: settings.names.clone(),
            origins: settings.origins.clone(),
            tokens: settings.tokens.clone(),
        }
    }

    /// Judges Host and Origin, before anything else of the request.
    pub fn enter(&self, request: &HttpRequest, peer: &Peer) -> Result<(), Refusal> {
        let name = name_of(&request.host).ok_or(Refusal::ForeignHost)?;
        let is = |known: &str| known.eq_ignore_ascii_case(name);
        let is_known = LOOPBACK_NAMES.into_iter().any(is)
            || is_address(name, peer)
            || self.names.iter().any(|known| is(known));
        if !is_known {
            return Err(Refusal::ForeignHost);
        }
        let Some(origin) = &request.origin else {
            return Ok(());
        };
        let scheme = if peer.is_encrypted { "https" } else { "http" };
        let own = format!("{scheme}://{}", request.host);
        // "null" is the origin of every sandboxed page, of any author.
        let is_listed = origin != "null" && self.origins.contains(origin);
        if origin.eq_ignore_ascii_case(&own) || is_listed {
            return Ok(());
        }
        match origin == FILE_ORIGIN && peer.is_loopback() {
            true => Ok(()),
            false => Err(Refusal::ForeignOrigin),
        }
    }

    /// What a viewer with this token may do; `None` if it may not even look.
    pub fn permit(&self, peer: &Peer, token: Option<&str>) -> Option<Permit> {
        let is_local = peer.is_loopback();
        let token = token.and_then(|given| self.find(given));
        let token = token.filter(|token| is_local || !token.is_local);
        let Some(token) = token else {
            let is_free = is_local && peer.is_own_user;
            return is_free.then_some(Permit {
                role: Role::Watch,
                name: None,
            });
        };
        // Over the network, a token that can be read on the way must not fly a helicopter.
        let is_safe = is_local || peer.is_encrypted;
        let may_order = is_safe && token.role == Role::Command;
        Some(Permit {
            role: if may_order {
                Role::Command
            } else {
                Role::Watch
            },
            name: Some(token.name.clone()),
        })
    }

    /// Compares with all tokens, in a time that does not depend on how much of one is right.
    fn find(&self, given: &str) -> Option<&Token> {
        let mut found = None;
        for token in &self.tokens {
            if is_same(token.secret.as_bytes(), given.as_bytes()) {
                found = Some(token);
            }
        }
        found
    }
}

/// Whether both are the same and not empty, in a time that depends on their lengths alone.
fn is_same(secret: &[u8], given: &[u8]) -> bool {
    if secret.is_empty() || secret.len() != given.len() {
        return false;
    }
    let pairs = secret.iter().zip(given);
    let difference = pairs.fold(0, |difference, (a, b)| difference | (a ^ b));
    std::hint::black_box(difference) == 0
}

/// Whether `name` is the address at which the peer has come: a page of a foreign name never calls this machine so.
fn is_address(name: &str, peer: &Peer) -> bool {
    let name = name.trim_start_matches('[').trim_end_matches(']');
    let address = name.parse().map(|address: IpAddr| address.to_canonical());
    address == Ok(peer.at.to_canonical())
}

/// The name in a Host, without its port; `None` if it has other characters than names and addresses do.
fn name_of(host: &str) -> Option<&str> {
    let (name, port) = match host.strip_prefix('[') {
        Some(address) => {
            let end = address.find(']')? + 2;
            host.split_at(end)
        }
        None => host.split_at(host.find(':').unwrap_or(host.len())),
    };
    let is_port = port.is_empty()
        || port
            .strip_prefix(':')
            .is_some_and(|port| port.parse::<u16>().is_ok());
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || b"-._:[]".contains(&byte);
    (is_port && !name.is_empty() && name.bytes().all(is_part)).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::request::Method;

    const SECRET: &str = "0123456789abcdef0123456789abcdef";
    const OWN: &str = "00112233445566778899aabbccddeeff";
    const WATCH: &str = "fedcba9876543210fedcba9876543210";

    fn access() -> Access {
        let token = |name: &str, role, secret: &str| Token {
            name: name.into(),
            role,
            secret: secret.into(),
            is_local: name == "own",
        };
        Access::new(&Settings {
            names: vec!["robot.local".into(), "192.168.1.5".into()],
            origins: vec!["https://studio.example".into(), "null".into()],
            tokens: vec![
                token("page", Role::Command, SECRET),
                token("phone", Role::Watch, WATCH),
                token("empty", Role::Command, ""),
                token("own", Role::Command, OWN),
            ],
            ..Settings::default()
        })
    }

    fn peer(address: &str, is_own_user: bool, is_encrypted: bool) -> Peer {
        Peer {
            address: address.parse().unwrap(),
            at: "10.0.0.9".parse().unwrap(),
            is_own_user,
            is_encrypted,
        }
    }

    fn request(host: &str, origin: Option<&str>) -> HttpRequest {
        HttpRequest {
            method: Method::Get,
            path: "/".into(),
            token: None,
            host: host.into(),
            origin: origin.map(str::to_owned),
            if_none_match: None,
            stays: true,
            upgrade: None,
        }
    }

    #[test]
    fn hosts_are_names_of_this_machine() {
        let local = peer("127.0.0.1:5", true, false);
        for (host, is_known) in [
            ("localhost:8765", true),
            ("LocalHost", true),
            ("127.0.0.1:1", true),
            ("[::1]:8765", true),
            ("[::1]", true),
            ("robot.local:8765", true),
            ("192.168.1.5", true),
            ("10.0.0.9:8765", true),
            ("10.0.0.8:8765", false),
            ("[::ffff:10.0.0.9]:8765", true),
            ("[::2]", false),
            ("evil.example", false),
            ("localhost.evil.example:8765", false),
            ("localhost:8765.evil.example", false),
            ("localhost:", false),
            ("localhost:99999", false),
            ("localhost;x", false),
            ("user@localhost", false),
            ("127.0.0.2", false),
            ("0.0.0.0:8765", false),
            ("::1", false),
            ("[::1", false),
            ("[::1]x", false),
            ("", false),
            (":8765", false),
        ] {
            let entered = access().enter(&request(host, None), &local);
            assert_eq!(entered == Ok(()), is_known, "{host}: {entered:?}");
            assert!(is_known || entered == Err(Refusal::ForeignHost), "{host}");
        }
    }

    #[test]
    fn origins_are_the_own_page_or_listed() {
        let (plain, tls) = (
            peer("127.0.0.1:5", true, false),
            peer("127.0.0.1:5", true, true),
        );
        let far = peer("10.0.0.1:5", false, false);
        let (trusted, foreign) = (Ok(()), Err(Refusal::ForeignOrigin));
        for (origin, peer, expected) in [
            (None, &far, trusted),
            (Some("http://localhost:8765"), &plain, trusted),
            (Some("http://LOCALHOST:8765"), &plain, trusted),
            (Some("https://localhost:8765"), &tls, trusted),
            (Some("https://localhost:8765"), &plain, foreign),
            (Some("http://localhost:8765"), &tls, foreign),
            (Some("http://localhost"), &plain, foreign),
            (Some("http://localhost:3000"), &plain, foreign),
            (Some("http://127.0.0.1:8765"), &plain, foreign),
            (Some("http://evil.example"), &plain, foreign),
            (Some("https://studio.example"), &plain, trusted),
            (Some("https://studio.example.evil"), &plain, foreign),
            (Some("null"), &plain, foreign),
            (Some(""), &plain, foreign),
            (Some("file://"), &plain, trusted),
            (Some("file://"), &far, foreign),
            (Some("file:///home"), &plain, foreign),
        ] {
            let entered = access().enter(&request("localhost:8765", origin), peer);
            assert_eq!(entered, expected, "{origin:?}");
        }
    }

    #[test]
    fn roles_follow_where_and_token() {
        let own = peer("127.0.0.1:5", true, false);
        let own_v6 = peer("[::ffff:127.0.0.1]:5", true, false);
        let other_user = peer("127.0.0.1:5", false, false);
        let far = peer("10.0.0.1:5", false, false);
        let far_tls = peer("10.0.0.1:5", false, true);
        // The users of another machine are not known.
        let far_own = peer("10.0.0.1:5", true, false);
        let (watch, command) = (Some(Role::Watch), Some(Role::Command));
        let all = [
            None,
            Some("wrong"),
            Some(""),
            Some(WATCH),
            Some(SECRET),
            Some(OWN),
        ];
        for (peer, expected) in [
            (&own, [watch, watch, watch, watch, command, command]),
            (&own_v6, [watch, watch, watch, watch, command, command]),
            (&other_user, [None, None, None, watch, command, command]),
            (&far, [None, None, None, watch, watch, None]),
            (&far_own, [None, None, None, watch, watch, None]),
            (&far_tls, [None, None, None, watch, command, None]),
        ] {
            for (token, expected) in all.into_iter().zip(expected) {
                let permit = access().permit(peer, token);
                assert_eq!(
                    permit.map(|permit| permit.role),
                    expected,
                    "{peer:?} {token:?}"
                );
            }
        }
        assert_eq!(
            access().permit(&far_tls, Some(SECRET)).unwrap().name,
            Some("page".into())
        );
    }

    #[test]
    fn secrets_are_the_same_as_a_whole_or_not() {
        for (secret, given, same) in [
            ("ab", "ab", true),
            ("ab", "aB", false),
            ("ab", "abc", false),
            ("ab", "a", false),
            ("", "", false),
        ] {
            assert_eq!(
                is_same(secret.as_bytes(), given.as_bytes()),
                same,
                "{secret} {given}"
            );
        }
    }
}
