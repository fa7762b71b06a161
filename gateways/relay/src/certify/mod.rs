//! `ril relay certify`: certificates for the machines of robots, routers and stations, and the authority that signs them.
//!
//! The folder has `ca.pem` and `ca-key.pem` of the authority, and `<name>.pem` and `<name>-key.pem` of each machine. Nothing in it
//! is ever overwritten. Keys are files that their owner alone can read. The common name of a certificate is the name of its
//! machine, by which the [access rules](crate::access) know it; it serves both ends of a connection, over TLS and over QUIC.

mod authority;
mod error;
mod files;
mod machine;
mod next_steps;

use std::collections::BTreeSet;
use std::path::PathBuf;

use time::OffsetDateTime;

use authority::Authority;
pub use error::CertifyError;
use files::{AUTHORITY, all_names, files, write_pair};
pub use machine::Machine;
use next_steps::next_steps;

/// What is to be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// Where the files are.
    pub folder: PathBuf,
    /// Which machines.
    pub machines: Vec<Machine>,
    /// For how many days the machines' certificates hold.
    pub days: u32,
    /// For how many days the authority holds, if it is made now.
    pub authority_days: u32,
}

/// Makes the certificates. Returns what its user has to do with them.
///
/// # Errors
///
/// See [`CertifyError`]. Nothing has been made of a machine about which there is an error, and of those after it.
pub fn certify(order: &Order, now: OffsetDateTime) -> Result<String, CertifyError> {
    let mut names = BTreeSet::new();
    for machine in &order.machines {
        if !names.insert(&machine.name) {
            return Err(CertifyError::Twice(machine.name.clone()));
        }
        for path in files(&order.folder, &machine.name) {
            if path.symlink_metadata().is_ok() {
                return Err(CertifyError::Exists(path));
            }
        }
    }
    let authority = Authority::open(&order.folder, order.authority_days, now)?;
    for machine in &order.machines {
        let (certificate, key) = authority.sign(machine, now, order.days)?;
        write_pair(&order.folder, &machine.name, &certificate, &key)?;
    }
    let [_, authority_key] = files(&order.folder, AUTHORITY);
    Ok(next_steps(
        &order.machines,
        &all_names(&order.folder)?,
        &authority_key,
        authority.until.date(),
    ))
}

#[cfg(test)]
mod tests;
