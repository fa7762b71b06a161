//! `ril relay certify`: certificates for the machines of robots, routers and stations, and the authority that signs
//! them.
//!
//! The folder has `ca.pem` and `ca-key.pem` of the authority, and `<name>.pem` and `<name>-key.pem` of each machine.
//! Nothing in it is ever overwritten. Keys are files that their owner alone can read. The common name of a certificate
//! is the name of its machine, by which the [access rules](crate::access) know it; it serves both ends of a connection,
//! over TLS and over QUIC.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::num::NonZeroU32;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use runtime::exit::{ExitCode, Failure, OrFail};
use time::{Date, Duration, OffsetDateTime};

use crate::certificate_files;
use crate::config::{check_name, is_host_name};

/// Name of the authority's files, which no machine can have.
const AUTHORITY: &str = "ca";

/// Common name of the authority.
const AUTHORITY_NAME: &str = "HERO relay authority";

/// A certificate holds from a day before it was made, because clocks of machines in the field differ.
const BEFORE: Duration = Duration::DAY;

/// Options of `certify`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "It prints the lines for relay.toml. Exit codes: 0 all was made, 2 a name cannot be used, \
    5 a file is there already, 8 the authority cannot be used, 1 anything else."
)]
pub struct CertifyArgs {
    /// Where the files are; an authority is made there (ca.pem, ca-key.pem) if there is none
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,

    /// Names of machines, each with the host names and addresses by which others connect to it:
    /// robot-1=10.0.0.2,robot.local
    #[arg(value_name = "NAME[=HOST,…]", required = true)]
    pub machines: Vec<Machine>,

    /// For how many days the certificates hold; never longer than the authority
    #[arg(long, value_name = "DAYS", default_value_t = 730, value_parser = clap::value_parser!(u32).range(1..=36_500))]
    pub days: u32,

    /// For how many days the authority holds, if it is made now
    #[arg(long, value_name = "DAYS", default_value_t = 3650, value_parser = clap::value_parser!(u32).range(1..=36_500))]
    pub authority_days: u32,
}

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
        let is_host = |host: &&String| is_host_name(host) || host.parse::<IpAddr>().is_ok();
        match hosts.iter().find(|host| !is_host(host)) {
            None => Ok(Machine {
                name: name.to_owned(),
                hosts,
            }),
            Some(host) => Err(format!(
                "`{host}` is neither the name of a host nor an address: write it as others connect to it, without port"
            )),
        }
    }
}

/// Makes the certificates. Returns what their user has to do with them.
///
/// # Errors
///
/// A machine is named twice (exit code 2), a file is there already (5), the authority cannot be used (8), or a file
/// cannot be written. Nothing has been made of a machine about which there is an error, and of those after it.
pub fn certify(args: &CertifyArgs, now: OffsetDateTime) -> Result<String, Failure> {
    let mut names = BTreeSet::new();
    for machine in &args.machines {
        if !names.insert(&machine.name) {
            let reason = format!("`{}` is named twice", machine.name);
            return Err(Failure::new(ExitCode::Usage, reason));
        }
        for path in files(&args.folder, &machine.name) {
            if path.symlink_metadata().is_ok() {
                return Err(exists(&path));
            }
        }
    }
    let (authority, until) = authority(&args.folder, args.authority_days, now)?;
    for machine in &args.machines {
        let names = [&[machine.name.clone()][..], &machine.hosts].concat();
        let mut params = CertificateParams::new(names).map_err(Failure::internal)?;
        params.distinguished_name = named(&machine.name);
        params.is_ca = IsCa::ExplicitNoCa;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![
            ExtendedKeyUsagePurpose::ServerAuth,
            ExtendedKeyUsagePurpose::ClientAuth,
        ];
        params.use_authority_key_identifier_extension = true;
        params.not_before = now - BEFORE;
        params.not_after = (now + Duration::days(args.days.into())).min(until);
        let key = KeyPair::generate().map_err(Failure::internal)?;
        let certificate = params.signed_by(&key, &authority);
        let certificate = certificate.map_err(Failure::internal)?.pem();
        write_pair(&args.folder, &machine.name, &certificate, &key)?;
    }
    let all = all_names(&args.folder).map_err(Failure::internal)?;
    Ok(next_steps(args, &all, until.date()))
}

fn named(common_name: &str) -> DistinguishedName {
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, common_name);
    name
}

/// The authority in the folder, or a new one that holds for so many days, and when it ends.
fn authority(
    folder: &Path,
    days: u32,
    now: OffsetDateTime,
) -> Result<(Issuer<'static, KeyPair>, OffsetDateTime), Failure> {
    let [certificate, key] = files(folder, AUTHORITY);
    if certificate.exists() || key.exists() {
        return load_authority(&certificate, &key, now).map_err(|reason| {
            let folder = folder.display();
            let reason = format!("the authority in {folder} cannot be used: {reason}");
            Failure::new(ExitCode::NotInOrder, reason)
        });
    }
    let mut builder = DirBuilder::new();
    let made = builder.recursive(true).mode(0o700).create(folder);
    made.or_fail_with(
        ExitCode::Internal,
        format!("the folder {} cannot be made", folder.display()),
    )
    .map_err(|failure| failure.with_next_step("name one that this user may write"))?;
    let mut params = CertificateParams::default();
    params.distinguished_name = named(AUTHORITY_NAME);
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    params.not_before = now - BEFORE;
    params.not_after = now + Duration::days(days.into());
    let until = params.not_after;
    let key = KeyPair::generate().map_err(Failure::internal)?;
    let certificate = params.self_signed(&key).map_err(Failure::internal)?;
    write_pair(folder, AUTHORITY, &certificate.pem(), &key)?;
    Ok((Issuer::new(params, key), until))
}

fn load_authority(
    certificate: &Path,
    key: &Path,
    now: OffsetDateTime,
) -> Result<(Issuer<'static, KeyPair>, OffsetDateTime), String> {
    let facts = certificate_files::certificate(certificate)?;
    certificate_files::key(key, certificate, &facts.public_key)?;
    if !facts.is_authority {
        return Err("its certificate is not that of an authority".to_owned());
    }
    if facts.until <= now {
        return Err(format!(
            "its certificate has ended on {}",
            facts.until.date()
        ));
    }
    let read = |path: &Path| fs::read_to_string(path).map_err(|error| error.to_string());
    let (certificate, key) = (read(certificate)?, read(key)?);
    let issuer =
        KeyPair::from_pem(&key).and_then(|key| Issuer::from_ca_cert_pem(&certificate, key));
    let issuer = issuer.map_err(|error| error.to_string())?;
    Ok((issuer, facts.until))
}

/// Certificate and key of a name.
fn files(folder: &Path, name: &str) -> [PathBuf; 2] {
    [
        folder.join(format!("{name}.pem")),
        folder.join(format!("{name}-key.pem")),
    ]
}

/// The key first: a certificate without its key would be in the way.
fn write_pair(folder: &Path, name: &str, certificate: &str, key: &KeyPair) -> Result<(), Failure> {
    let [certificate_file, key_file] = files(folder, name);
    write_new(&key_file, &key.serialize_pem(), 0o600)?;
    write_new(&certificate_file, certificate, 0o644).inspect_err(|_| {
        let _ = fs::remove_file(&key_file);
    })
}

fn write_new(path: &Path, text: &str, mode: u32) -> Result<(), Failure> {
    let mut options = OpenOptions::new();
    let opened = options.write(true).create_new(true).mode(mode).open(path);
    let written = opened.and_then(|mut file| {
        file.write_all(text.as_bytes()).inspect_err(|_| {
            // Half a file would be in the way of the next attempt.
            let _ = fs::remove_file(path);
        })
    });
    match written {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(exists(path)),
        written => written.or_fail_with(ExitCode::Internal, path.display().to_string()),
    }
}

fn exists(path: &Path) -> Failure {
    let reason = format!(
        "{} is there already, and is not overwritten: move it away first, or choose another name",
        path.display()
    );
    Failure::new(ExitCode::Refused, reason)
}

/// The machines that have certificates in the folder.
fn all_names(folder: &Path) -> io::Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder)? {
        let file = entry?.file_name();
        let name = file.to_str().and_then(|file| file.strip_suffix("-key.pem"));
        if let Some(name) = name.filter(|name| *name != AUTHORITY && check_name(name).is_ok()) {
            names.insert(name.to_owned());
        }
    }
    Ok(names)
}

/// What the user has to do with the certificates: lines for relay.toml, with comments that say the rest. `names` are
/// those of all machines that have certificates, and `until` the day on which the authority ends.
fn next_steps(args: &CertifyArgs, names: &BTreeSet<String>, until: Date) -> String {
    let (mut robots, mut routers, mut stations) = (Vec::new(), Vec::new(), Vec::new());
    for name in names {
        let number = name.strip_prefix("robot-").map(str::parse::<NonZeroU32>);
        match number {
            Some(Ok(number)) => robots.push(format!("{name} = {number}")),
            _ if name.starts_with("router") => routers.push(name),
            _ => stations.push(name),
        }
    }
    let robots = robots.join(", ");
    let [_, authority_key] = files(&args.folder, AUTHORITY);
    let mut text = format!(
        "# The authority holds until {until}. Keep {} secret: it signs whatever it is asked to.\n\
         # A name `robot-<number>` is taken for that robot, `router…` for a router, any other for a station.\n\
         # A station that may command is named in `[commands]` too: commands.stations = [\"…\"]\n",
        authority_key.display(),
    );
    for Machine { name, hosts } in &args.machines {
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n# For `{name}`, onto which ca.pem, {name}.pem and {name}-key.pem are copied; the paths are those on that machine.\n\
             [security]\nauthority = \"ca.pem\"\ncertificate = \"{name}.pem\"\nkey = \"{name}-key.pem\"\n\
             robots = {{ {robots} }}\nrouters = {routers:?}\nstations = {stations:?}\n"
        );
        if hosts.is_empty() {
            let _ = writeln!(
                text,
                "# Others can connect to it as `{name}` alone; for addresses: {name}=10.0.0.2,host.example"
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::config::Config;

    const DAY_S: i64 = 86_400;

    fn now() -> OffsetDateTime {
        OffsetDateTime::from_unix_timestamp(1_800_000_000).unwrap()
    }

    fn args(folder: &Path, machines: &[&str]) -> CertifyArgs {
        CertifyArgs {
            folder: folder.join("pki"),
            machines: machines.iter().map(|text| text.parse().unwrap()).collect(),
            days: 730,
            authority_days: 3650,
        }
    }

    fn code(result: Result<String, Failure>) -> ExitCode {
        result.unwrap_err().code()
    }

    /// Text of a certificate's fields.
    fn shown(path: &Path) -> (String, Vec<String>, i64, String) {
        let text = fs::read_to_string(path).unwrap();
        let (_, pem) = x509_parser::pem::parse_x509_pem(text.as_bytes()).unwrap();
        let certificate = pem.parse_x509().unwrap();
        let sans = certificate.subject_alternative_name().unwrap();
        let sans = sans.map_or(Vec::new(), |sans| {
            sans.value
                .general_names
                .iter()
                .map(ToString::to_string)
                .collect()
        });
        (
            certificate.subject().to_string(),
            sans,
            certificate.validity().not_after.timestamp(),
            certificate.issuer().to_string(),
        )
    }

    #[test]
    fn an_authority_is_made_once_and_signs_all_that_come_later() {
        let folder = tempfile::tempdir().unwrap();
        let first = args(folder.path(), &["robot-1=10.0.0.2,heli.example", "gcs"]);
        let _ = certify(&first, now()).unwrap();
        let pki = &first.folder;
        let authority = fs::read(pki.join("ca.pem")).unwrap();
        let second = args(folder.path(), &["router"]);
        let _ = certify(&second, now() + Duration::days(400)).unwrap();
        assert_eq!(fs::read(pki.join("ca.pem")).unwrap(), authority);
        let (name, sans, until_s, issuer) = shown(&pki.join("robot-1.pem"));
        assert_eq!(name, "CN=robot-1");
        assert_eq!(sans.len(), 3, "{sans:?}");
        assert_eq!(until_s, now().unix_timestamp() + 730 * DAY_S);
        assert_eq!(issuer, "CN=HERO relay authority");
        assert_eq!(shown(&pki.join("router.pem")).3, issuer);
        for (file, mode) in [("ca-key.pem", 0o600), ("gcs-key.pem", 0o600)] {
            let metadata = fs::metadata(pki.join(file)).unwrap();
            assert_eq!(metadata.permissions().mode() & 0o777, mode, "{file}");
        }
    }

    #[test]
    fn a_certificate_ends_with_its_authority() {
        let folder = tempfile::tempdir().unwrap();
        let first = args(folder.path(), &["robot-1"]);
        let _ = certify(&first, now()).unwrap();
        let late = now() + Duration::days(3600);
        let _ = certify(&args(folder.path(), &["gcs"]), late).unwrap();
        let (_, _, until_s, _) = shown(&first.folder.join("gcs.pem"));
        assert_eq!(until_s, now().unix_timestamp() + 3650 * DAY_S);
        let dead = now() + Duration::days(3651);
        let result = certify(&args(folder.path(), &["late"]), dead);
        assert_eq!(code(result), ExitCode::NotInOrder);
    }

    #[test]
    fn nothing_is_overwritten_and_nothing_is_made_beside_what_is_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let _ = certify(&args(folder.path(), &["gcs"]), now()).unwrap();
        let pki = folder.path().join("pki");
        let before = fs::read(pki.join("gcs.pem")).unwrap();
        for machines in [&["robot-1", "gcs"][..], &["gcs"]] {
            assert_eq!(
                code(certify(&args(folder.path(), machines), now())),
                ExitCode::Refused
            );
        }
        assert_eq!(fs::read(pki.join("gcs.pem")).unwrap(), before);
        assert!(!pki.join("robot-1.pem").exists());
        // What is left of a former attempt is in the way as well.
        fs::remove_file(pki.join("gcs.pem")).unwrap();
        assert_eq!(
            code(certify(&args(folder.path(), &["gcs"]), now())),
            ExitCode::Refused
        );
        let twice = certify(&args(folder.path(), &["a", "a"]), now());
        assert_eq!(code(twice), ExitCode::Usage);
    }

    #[test]
    fn an_authority_that_cannot_be_used_is_named_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        let _ = certify(&args(folder.path(), &[]), now()).unwrap();
        let _ = certify(&args(other.path(), &["gcs"]), now()).unwrap();
        let (pki, others) = (folder.path().join("pki"), other.path().join("pki"));
        let attempt = || certify(&args(folder.path(), &["robot-1"]), now());
        for (file, text) in [
            ("ca-key.pem", fs::read(others.join("ca-key.pem")).unwrap()),
            ("ca-key.pem", b"garbage".to_vec()),
            ("ca.pem", fs::read(others.join("gcs.pem")).unwrap()),
            ("ca.pem", b"garbage".to_vec()),
        ] {
            let right = fs::read(pki.join(file)).unwrap();
            fs::write(pki.join(file), &text).unwrap();
            assert_eq!(code(attempt()), ExitCode::NotInOrder, "{file}");
            assert_eq!(fs::read(pki.join(file)).unwrap(), text);
            fs::write(pki.join(file), right).unwrap();
        }
        fs::remove_file(pki.join("ca-key.pem")).unwrap();
        assert_eq!(code(attempt()), ExitCode::NotInOrder);
        assert!(!pki.join("robot-1.pem").exists());
    }

    #[test]
    fn an_authority_of_another_make_signs_as_well() {
        let folder = tempfile::tempdir().unwrap();
        let args = args(folder.path(), &["gcs"]);
        let mut params = CertificateParams::default();
        params.distinguished_name = named("Acme");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().unwrap();
        let certificate = params.self_signed(&key).unwrap().pem();
        fs::create_dir(&args.folder).unwrap();
        write_pair(&args.folder, AUTHORITY, &certificate, &key).unwrap();
        certify(&args, now()).unwrap();
        assert_eq!(shown(&args.folder.join("gcs.pem")).3, "CN=Acme");
    }

    #[test]
    fn names_that_are_none_are_refused() {
        for text in [
            "",
            "a/b",
            "../x",
            "ca",
            "robot-1-key",
            "*",
            "a=",
            "a=b c",
            "a=10.0.0.2:7447",
            "a=*.b",
        ] {
            assert!(text.parse::<Machine>().is_err(), "{text}");
        }
        let machine: Machine = "robot-1=10.0.0.2,::1,heli.local".parse().unwrap();
        assert_eq!(machine.hosts, ["10.0.0.2", "::1", "heli.local"]);
    }

    #[test]
    fn what_is_printed_is_a_configuration_for_each_machine() {
        let folder = tempfile::tempdir().unwrap();
        let _ = certify(&args(folder.path(), &["robot-7", "router-1"]), now()).unwrap();
        let text = certify(&args(folder.path(), &["gcs"]), now()).unwrap();
        let config: Config = runtime::config::parse(&text, "relay.toml").unwrap();
        config.check().unwrap();
        assert_eq!(config.security.robots["robot-7"].get(), 7);
        assert_eq!(config.security.routers, ["router-1"]);
        assert_eq!(config.security.stations, ["gcs"]);
    }
}
