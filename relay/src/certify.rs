//! `ril relay certify`: certificates for the machines of robots, routers and stations, and the authority that signs them.
//!
//! The folder has `ca.pem` and `ca-key.pem` of the authority, and `<name>.pem` and `<name>-key.pem` of each machine. Nothing in it
//! is ever overwritten. Keys are files that their owner alone can read. The common name of a certificate is the name of its
//! machine, by which the [access rules](crate::access) know it; it serves both ends of a connection, over TLS and over QUIC.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::num::NonZeroU32;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use rcgen::{
    BasicConstraints, Certificate, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use runtime::exit::{ExitCode, Failure};
use time::{Duration, OffsetDateTime};

use crate::config::check_name;

/// Name of the authority's files, which no machine can have.
const AUTHORITY: &str = "ca";

/// Common name of the authority.
const AUTHORITY_NAME: &str = "HERO relay authority";

/// A certificate holds from a day before it was made, because clocks of machines in the field differ.
const BEFORE: Duration = Duration::DAY;

/// Longest name of a host in DNS, bytes.
const MAX_HOST: usize = 253;

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
    let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let is_name = !host.is_empty() && host.len() <= MAX_HOST && host.bytes().all(is_letter);
    if is_name || host.parse::<IpAddr>().is_ok() {
        return Ok(());
    }
    Err(format!(
        "`{host}` is neither the name of a host nor an address: write it as others connect to it, without port"
    ))
}

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

/// Certificates that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum CertifyError {
    /// A machine is named twice.
    #[error("`{0}` is named twice")]
    Twice(String),
    /// A file is there already.
    #[error("{} is there already, and is not overwritten: move it away first, or choose another name", .0.display())]
    Exists(PathBuf),
    /// The files of the authority cannot be used.
    #[error("the authority in {} cannot be used: {reason}", folder.display())]
    Authority {
        /// Where it is.
        folder: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file cannot be written or read.
    #[error("{}: {error}", path.display())]
    File {
        /// Which one.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The library refuses.
    #[error("a certificate cannot be made: {0}")]
    Library(#[from] rcgen::Error),
}

impl From<CertifyError> for Failure {
    fn from(error: CertifyError) -> Failure {
        let code = match error {
            CertifyError::Twice(_) => ExitCode::Usage,
            CertifyError::Exists(_) => ExitCode::Refused,
            CertifyError::Authority { .. } => ExitCode::NotInOrder,
            CertifyError::File { .. } | CertifyError::Library(_) => ExitCode::Internal,
        };
        Failure::new(code, error)
    }
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
    let authority = Authority::open(order, now)?;
    for machine in &order.machines {
        let (certificate, key) = authority.sign(machine, now, order.days)?;
        write_pair(&order.folder, &machine.name, &certificate, &key)?;
    }
    Ok(next_steps(order, &authority, &all_names(&order.folder)?))
}

/// Certificate and key of a name.
fn files(folder: &Path, name: &str) -> [PathBuf; 2] {
    [
        folder.join(format!("{name}.pem")),
        folder.join(format!("{name}-key.pem")),
    ]
}

/// What signs the certificates of the machines.
struct Authority {
    issuer: Issuer<'static, KeyPair>,
    until: OffsetDateTime,
}

impl Authority {
    /// The one in the folder, or a new one.
    fn open(order: &Order, now: OffsetDateTime) -> Result<Authority, CertifyError> {
        let [certificate, key] = files(&order.folder, AUTHORITY);
        match (certificate.exists(), key.exists()) {
            (false, false) => Authority::make(order, now),
            _ => Authority::load(&order.folder, now),
        }
    }

    fn make(order: &Order, now: OffsetDateTime) -> Result<Authority, CertifyError> {
        let mut folder = DirBuilder::new();
        folder
            .recursive(true)
            .mode(0o700)
            .create(&order.folder)
            .map_err(|error| file_error(&order.folder, error))?;
        let key = KeyPair::generate()?;
        let mut params = Authority::params();
        params.not_before = now - BEFORE;
        params.not_after = now + Duration::days(order.authority_days.into());
        let certificate = params.self_signed(&key)?;
        write_pair(&order.folder, AUTHORITY, &certificate, &key)?;
        Ok(Authority {
            until: params.not_after,
            issuer: Issuer::new(params, key),
        })
    }

    fn load(folder: &Path, now: OffsetDateTime) -> Result<Authority, CertifyError> {
        let refuse = |reason: String| CertifyError::Authority {
            folder: folder.to_owned(),
            reason,
        };
        let [certificate, key] = files(folder, AUTHORITY);
        let read = |path: &Path| {
            fs::read_to_string(path).map_err(|error| refuse(format!("{}: {error}", path.display())))
        };
        let (certificate, key) = (read(&certificate)?, read(&key)?);
        let key = KeyPair::from_pem(&key)
            .map_err(|error| refuse(format!("its key cannot be read ({error})")))?;
        let (until, public_key) = facts(&certificate).map_err(refuse)?;
        if public_key != rcgen::PublicKeyData::subject_public_key_info(&key) {
            return Err(refuse("its key belongs to another certificate".to_owned()));
        }
        if until <= now {
            return Err(refuse(format!(
                "its certificate has ended on {}",
                until.date()
            )));
        }
        Ok(Authority {
            until,
            issuer: Issuer::new(Authority::params(), key),
        })
    }

    /// What all authorities that are made here have in common.
    fn params() -> CertificateParams {
        let mut params = CertificateParams::default();
        params.distinguished_name = rcgen::DistinguishedName::new();
        params
            .distinguished_name
            .push(DnType::CommonName, AUTHORITY_NAME);
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        params
    }

    /// Certificate and key of a machine. The certificate does not outlive the authority.
    fn sign(
        &self,
        machine: &Machine,
        now: OffsetDateTime,
        days: u32,
    ) -> Result<(Certificate, KeyPair), CertifyError> {
        let key = KeyPair::generate()?;
        let names = [&[machine.name.clone()][..], &machine.hosts].concat();
        let mut params = CertificateParams::new(names)?;
        params.distinguished_name = rcgen::DistinguishedName::new();
        params
            .distinguished_name
            .push(DnType::CommonName, &machine.name);
        params.is_ca = IsCa::ExplicitNoCa;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![
            ExtendedKeyUsagePurpose::ServerAuth,
            ExtendedKeyUsagePurpose::ClientAuth,
        ];
        params.use_authority_key_identifier_extension = true;
        params.not_before = now - BEFORE;
        params.not_after = (now + Duration::days(days.into())).min(self.until);
        let certificate = params.signed_by(&key, &self.issuer)?;
        Ok((certificate, key))
    }
}

/// When an authority's certificate ends, and its public key.
fn facts(pem: &str) -> Result<(OffsetDateTime, Vec<u8>), String> {
    let unreadable =
        |error: &dyn std::fmt::Display| format!("its certificate cannot be read ({error})");
    let (_, pem) =
        x509_parser::pem::parse_x509_pem(pem.as_bytes()).map_err(|error| unreadable(&error))?;
    let certificate = pem.parse_x509().map_err(|error| unreadable(&error))?;
    if !certificate.is_ca() {
        return Err("its certificate is not that of an authority".to_owned());
    }
    // The names of others would have to be written as they are: they sign with their own tools.
    if certificate.subject().to_string() != format!("CN={AUTHORITY_NAME}") {
        return Err(
            "`ril relay certify` has not made it: sign the machines' certificates with the tools of that authority".to_owned(),
        );
    }
    Ok((
        certificate.validity().not_after.to_datetime(),
        certificate.public_key().raw.to_vec(),
    ))
}

/// The key first: a certificate without its key would be in the way.
fn write_pair(
    folder: &Path,
    name: &str,
    certificate: &Certificate,
    key: &KeyPair,
) -> Result<(), CertifyError> {
    let [certificate_file, key_file] = files(folder, name);
    write_new(&key_file, &key.serialize_pem(), 0o600)?;
    write_new(&certificate_file, &certificate.pem(), 0o644).inspect_err(|_| {
        let _ = fs::remove_file(&key_file);
    })
}

fn write_new(path: &Path, text: &str, mode: u32) -> Result<(), CertifyError> {
    let mut options = OpenOptions::new();
    let mut file = match options.write(true).create_new(true).mode(mode).open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            return Err(CertifyError::Exists(path.to_owned()));
        }
        Err(error) => return Err(file_error(path, error)),
    };
    file.write_all(text.as_bytes()).map_err(|error| {
        // Half a file would be in the way of the next attempt.
        let _ = fs::remove_file(path);
        file_error(path, error)
    })
}

fn file_error(path: &Path, error: io::Error) -> CertifyError {
    CertifyError::File {
        path: path.to_owned(),
        error,
    }
}

/// The machines that have certificates in the folder.
fn all_names(folder: &Path) -> Result<BTreeSet<String>, CertifyError> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(|error| file_error(folder, error))? {
        let entry = entry.map_err(|error| file_error(folder, error))?;
        let file = entry.file_name();
        let name = file.to_str().and_then(|file| file.strip_suffix("-key.pem"));
        if let Some(name) = name.filter(|name| *name != AUTHORITY && check_name(name).is_ok()) {
            names.insert(name.to_owned());
        }
    }
    Ok(names)
}

/// The number of a robot that is called `robot-<number>`.
fn robot_number(name: &str) -> Option<NonZeroU32> {
    name.strip_prefix("robot-")?.parse().ok()
}

fn is_router(name: &str) -> bool {
    name.starts_with("router")
}

/// Lines for `relay.toml`, with comments that say the rest.
fn next_steps(order: &Order, authority: &Authority, names: &BTreeSet<String>) -> String {
    let list = |names: Vec<String>| names.join(", ");
    let (robots, others): (Vec<&String>, Vec<&String>) =
        names.iter().partition(|name| robot_number(name).is_some());
    let (routers, stations): (Vec<&String>, Vec<&String>) =
        others.into_iter().partition(|name| is_router(name));
    let robots = robots
        .iter()
        .filter_map(|name| Some(format!("{name} = {}", robot_number(name)?)));
    let quoted = |names: Vec<&String>| list(names.iter().map(|name| format!("{name:?}")).collect());
    let common = format!(
        "robots = {{ {} }}\nrouters = [{}]\nstations = [{}]\n",
        list(robots.collect()),
        quoted(routers),
        quoted(stations),
    )
    .replace("{  }", "{}");
    let mut text = format!(
        "# The authority holds until {}. Keep {} secret: it signs whatever it is asked to.\n\
         # A name `robot-<number>` is taken for that robot, `router…` for a router, any other for a station.\n\
         # A station that may command is named in `[commands]` too: commands.stations = [\"…\"]\n",
        authority.until.date(),
        files(&order.folder, AUTHORITY)[1].display(),
    );
    for machine in &order.machines {
        let name = &machine.name;
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n# For `{name}`, onto which ca.pem, {name}.pem and {name}-key.pem are copied; the paths are those on that machine.\n\
             [security]\nauthority = \"ca.pem\"\ncertificate = \"{name}.pem\"\nkey = \"{name}-key.pem\"\n{common}"
        );
        if machine.hosts.is_empty() {
            let _ = writeln!(
                text,
                "# Others can connect to it as `{name}` alone; for addresses: {name}=10.0.0.2,host.example"
            );
        }
    }
    text
}

#[cfg(test)]
mod tests;
