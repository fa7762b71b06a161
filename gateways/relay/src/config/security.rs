//! `[security]`: certificates, and whose may do what.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::PathBuf;

use runtime::config::Fault;
use serde::Deserialize;

/// `[security]`: files in PEM, all or none, and whose certificates may do what.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SecurityConfig {
    /// Certificate of the authority that has signed those of all relays.
    pub authority: Option<PathBuf>,
    /// Certificate of this machine.
    pub certificate: Option<PathBuf>,
    /// Its private key.
    pub key: Option<PathBuf>,
    /// Robots, by the common names of their certificates.
    pub robots: BTreeMap<String, NonZeroU32>,
    /// Common names of the certificates of routers.
    pub routers: Vec<String>,
    /// Common names of the certificates of stations that may watch, beside those that may command.
    pub stations: Vec<String>,
    /// Whether requests are taken over connections that are not encrypted, from other machines.
    pub insecure: bool,
}

/// The files of [`SecurityConfig`] when all are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Certificates<'a> {
    /// Certificate of the authority.
    pub authority: &'a PathBuf,
    /// Certificate of this machine.
    pub certificate: &'a PathBuf,
    /// Its private key.
    pub key: &'a PathBuf,
}

impl SecurityConfig {
    /// The three files; nothing when security was not configured.
    ///
    /// # Errors
    ///
    /// When some of the three are missing: what is missing.
    pub fn certificates(&self) -> Result<Option<Certificates<'_>>, Fault> {
        match (&self.authority, &self.certificate, &self.key) {
            (None, None, None) => Ok(None),
            (Some(authority), Some(certificate), Some(key)) => Ok(Some(Certificates {
                authority,
                certificate,
                key,
            })),
            _ => Err(Fault::at(
                &["security"],
                "`[security]` needs all of `authority`, `certificate` and `key`, or none of them",
            )),
        }
    }
}
