//! Configuration of `ril run view`, `view.toml`.
//!
//! Every value has a default; the annotated example `gateways/view/view.toml` shows them all and is tested to parse to
//! them.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use operator::config::RequestConfig;
use runtime::config::{Fault, Loaded, load as load_file};
use runtime::exit::Failure;
use serde::Deserialize;

use crate::page::Role;

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "view.toml";

/// The annotated example.
pub const EXAMPLE: &str = include_str!("../view.toml");

/// The port where Foxglove looks first.
pub const DEFAULT_PORT: u16 = 8765;

/// Longest name of a token: it stands in each line of the log.
const MAX_NAME_BYTES: usize = 32;

/// Most tokens, and most addresses: each request is compared with all tokens, each wake asks all listeners.
pub const MAX_LIST: usize = 16;

/// All of `view.toml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewConfig {
    /// Port, on all addresses.
    #[serde(deserialize_with = "port")]
    pub port: u16,
    /// Addresses to listen at beside loopback.
    pub listen: Vec<IpAddr>,
    /// Whether other machines are served without TLS.
    pub insecure: bool,
    /// Names of this machine that a Host may be, beside those of loopback and the address at which it comes.
    pub names: Vec<String>,
    /// Origins that may connect, beside the view's own.
    pub origins: Vec<String>,
    /// What happens to a movement of a page when no page commands its robot any more.
    pub page_lost: PageLost,
    /// After how long, s.
    #[serde(deserialize_with = "lost_s")]
    pub page_lost_s: f64,
    /// Folder of imagery under the map; `None` for the grid alone.
    pub tiles: Option<PathBuf>,
    /// Whether their rows count from the south.
    pub tiles_tms: bool,
    /// File of the secret from which the tokens are made; `None` for that of the user's state folder.
    pub token_key: Option<PathBuf>,
    /// TLS.
    pub tls: Option<TlsConfig>,
    /// Names of tokens, and what they allow.
    pub tokens: BTreeMap<String, Role>,
    /// Orders.
    pub request: RequestConfig,
}

/// `page_lost`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PageLost {
    /// The movement goes on.
    Continue,
    /// The helicopter holds.
    Hold,
}

/// `[tls]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsConfig {
    /// File with the certificate, and behind it those that lead to the authority.
    pub certificate: PathBuf,
    /// File with its key.
    pub key: PathBuf,
}

runtime::ranged! {
    fn port(u16) in 1..=65_535;
    fn lost_s(f64) in 1.0..=3_600.0;
}

impl Default for ViewConfig {
    fn default() -> Self {
        ViewConfig {
            port: DEFAULT_PORT,
            listen: Vec::new(),
            insecure: false,
            names: Vec::new(),
            origins: Vec::new(),
            page_lost: PageLost::Continue,
            page_lost_s: 5.0,
            tiles: None,
            tiles_tms: false,
            token_key: None,
            tls: None,
            tokens: BTreeMap::new(),
            request: RequestConfig::default(),
        }
    }
}

/// Reads the configuration, and checks it as a whole.
///
/// # Errors
///
/// Exit code 78 when it is wrong.
pub fn load(explicit: Option<&Path>) -> Result<Loaded<ViewConfig>, Failure> {
    let loaded = load_file::<ViewConfig>(explicit, Path::new(DEFAULT_FILE))?;
    match loaded.value.check() {
        Ok(()) => Ok(loaded),
        Err(fault) => Err(loaded.refuse(&fault).into()),
    }
}

impl ViewConfig {
    /// What no single value shows.
    pub fn check(&self) -> Result<(), Fault> {
        if self.tls.is_some() && self.insecure {
            return Err(Fault::at(
                &["insecure"],
                "`[tls]` is there and `insecure = true`: take one of them out",
            ));
        }
        if self.tls.is_some() && !cfg!(feature = "tls") {
            return Err(Fault::at(
                &["tls"],
                "this build of ril has no TLS: build it with `--features tls`, as the Debian package is",
            ));
        }
        if self.is_open() && self.tls.is_none() && !self.insecure {
            return Err(Fault::at(
                &["listen"],
                "other machines would be served without TLS: add `[tls]` (`ril relay certify` makes certificates), or `insecure = true`",
            ));
        }
        if self.listen.len() > MAX_LIST || self.tokens.len() > MAX_LIST {
            let which: &'static [&'static str] = match self.listen.len() > MAX_LIST {
                true => &["listen"],
                false => &["tokens"],
            };
            return Err(Fault::at(which, format!("more than {MAX_LIST}")));
        }
        let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
        let is_name =
            |name: &str| (1..=MAX_NAME_BYTES).contains(&name.len()) && name.bytes().all(is_letter);
        match self.tokens.keys().find(|name| !is_name(name)) {
            Some(name) => Err(Fault::at(
                &["tokens"],
                format!(
                    "`{name}` is no name of a token: {MAX_NAME_BYTES} letters, digits, `-` and `_` at most"
                ),
            )),
            None => Ok(()),
        }
    }

    /// Whether other machines can connect.
    pub fn is_open(&self) -> bool {
        self.listen
            .iter()
            .any(|address| !address.to_canonical().is_loopback())
    }

    /// Where to listen: on loopback always, so that `ril view` opens the page.
    pub fn addresses(&self) -> Vec<SocketAddr> {
        let mut addresses = self.listen.clone();
        if !addresses.contains(&Ipv4Addr::UNSPECIFIED.into()) {
            addresses.insert(0, Ipv4Addr::LOCALHOST.into());
        }
        let mut seen = Vec::new();
        for address in addresses {
            if !seen.contains(&address) {
                seen.push(address);
            }
        }
        let with_port = |address| SocketAddr::new(address, self.port);
        seen.into_iter().map(with_port).collect()
    }

    /// After how long without a page that commands its movements end; `None` if they go on.
    pub fn page_lost(&self) -> Option<Duration> {
        let is_held = self.page_lost == PageLost::Hold;
        is_held.then(|| Duration::from_secs_f64(self.page_lost_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> ViewConfig {
        runtime::config::parse(text, "view.toml").unwrap()
    }

    #[test]
    fn the_annotated_example_is_the_defaults() {
        runtime::config::proof::assert_annotated::<ViewConfig>(EXAMPLE, &["tokens"]);
        for wrong in [
            "prot = 1",
            "port = 0",
            "[request]\ntimeout = 1",
            "listen = [\"robot.local\"]",
            "page_lost = \"land\"",
            "page_lost_s = 0",
            "[tls]\ncertificate = \"a\"",
            "[tokens]\nphone = \"all\"",
        ] {
            assert!(
                runtime::config::parse::<ViewConfig>(wrong, "view.toml").is_err(),
                "{wrong}"
            );
        }
        assert_eq!(ViewConfig::default().page_lost(), None);
        let held = read("page_lost = \"hold\"\npage_lost_s = 2.5");
        assert_eq!(held.page_lost(), Some(Duration::from_millis(2500)));
    }

    #[test]
    fn other_machines_need_tls_or_the_word_insecure() {
        const TLS: &str = "[tls]\ncertificate = \"a.pem\"\nkey = \"a-key.pem\"\n";
        let has_tls = cfg!(feature = "tls");
        for (text, is_right) in [
            ("listen = [\"127.0.0.1\", \"::1\", \"127.0.0.5\"]", true),
            ("listen = [\"0.0.0.0\"]", false),
            ("listen = [\"192.168.1.5\"]", false),
            ("listen = [\"::\"]", false),
            ("listen = [\"0.0.0.0\"]\ninsecure = true", true),
            ("insecure = true", true),
            (TLS, has_tls),
            (&format!("listen = [\"10.0.0.2\"]\n{TLS}"), has_tls),
            (&format!("insecure = true\n{TLS}"), false),
            ("[tokens]\nphone-1 = \"watch\"\nPad_2 = \"command\"", true),
            ("[tokens]\n\"a b\" = \"watch\"", false),
            ("[tokens]\n\"\" = \"watch\"", false),
        ] {
            assert_eq!(read(text).check().is_ok(), is_right, "{text}");
        }
    }

    #[test]
    fn loopback_is_always_listened_at() {
        for (listen, expected) in [
            ("[]", &["127.0.0.1:8765"][..]),
            ("[\"127.0.0.1\"]", &["127.0.0.1:8765"]),
            ("[\"0.0.0.0\"]", &["0.0.0.0:8765"]),
            (
                "[\"10.0.0.2\", \"::\", \"10.0.0.2\"]",
                &["127.0.0.1:8765", "10.0.0.2:8765", "[::]:8765"],
            ),
        ] {
            let addresses = read(&format!("listen = {listen}")).addresses();
            let texts: Vec<String> = addresses.iter().map(SocketAddr::to_string).collect();
            assert_eq!(texts, expected, "{listen}");
        }
    }
}
