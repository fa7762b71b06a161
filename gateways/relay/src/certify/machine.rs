//! [`Machine`]: what gets a certificate, as the command line names it.

use std::net::IpAddr;
use std::str::FromStr;

use super::files::AUTHORITY;
use crate::config::{check_name, is_host_name};

/// A machine that gets a certificate, from `name` or `name=host,address`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Machine {
    /// Common name of its certificate.
    pub name: String,
    /// Names and addresses by which others connect to it.
    pub hosts: Vec<String>,
}

impl FromStr for Machine {
    type Err = String;

    fn from_str(text: &str) -> Result<Machine, String> {
        let (name, hosts) = match text.split_once('=') {
            Some((name, hosts)) => (name, hosts.split(',').map(str::to_owned).collect()),
            None => (text, Vec::new()),
        };
        check_name(name)?;
        if name == AUTHORITY || name.ends_with("-key") {
            return Err(format!(
                "`{name}` would mix the files up: choose another name"
            ));
        }
        for host in &hosts {
            check_host(host)?;
        }
        Ok(Machine {
            name: name.to_owned(),
            hosts,
        })
    }
}

fn check_host(host: &str) -> Result<(), String> {
    if is_host_name(host) || host.parse::<IpAddr>().is_ok() {
        return Ok(());
    }
    Err(format!(
        "`{host}` is neither the name of a host nor an address: write it as others connect to it, without port"
    ))
}
