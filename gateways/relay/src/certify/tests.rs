use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use runtime::exit::{ExitCode, Failure};
use time::Duration;

use super::*;
use crate::config::Config;

const DAY_S: i64 = 86_400;

fn now() -> OffsetDateTime {
    OffsetDateTime::from_unix_timestamp(1_800_000_000).unwrap()
}

fn order(folder: &Path, machines: &[&str]) -> Order {
    Order {
        folder: folder.join("pki"),
        machines: machines.iter().map(|text| text.parse().unwrap()).collect(),
        days: 730,
        authority_days: 3650,
    }
}

fn code(result: Result<String, CertifyError>) -> ExitCode {
    Failure::from(result.unwrap_err()).code()
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
    let first = order(folder.path(), &["robot-1=10.0.0.2,heli.example", "gcs"]);
    let _ = certify(&first, now()).unwrap();
    let pki = &first.folder;
    let authority = fs::read(pki.join("ca.pem")).unwrap();
    let second = order(folder.path(), &["router"]);
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
    let first = order(folder.path(), &["robot-1"]);
    let _ = certify(&first, now()).unwrap();
    let late = now() + Duration::days(3600);
    let _ = certify(&order(folder.path(), &["gcs"]), late).unwrap();
    let (_, _, until_s, _) = shown(&first.folder.join("gcs.pem"));
    assert_eq!(until_s, now().unix_timestamp() + 3650 * DAY_S);
    let dead = now() + Duration::days(3651);
    let result = certify(&order(folder.path(), &["late"]), dead);
    assert_eq!(code(result), ExitCode::NotInOrder);
}

#[test]
fn nothing_is_overwritten_and_nothing_is_made_beside_what_is_in_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let _ = certify(&order(folder.path(), &["gcs"]), now()).unwrap();
    let pki = folder.path().join("pki");
    let before = fs::read(pki.join("gcs.pem")).unwrap();
    for machines in [&["robot-1", "gcs"][..], &["gcs"]] {
        assert_eq!(
            code(certify(&order(folder.path(), machines), now())),
            ExitCode::Refused
        );
    }
    assert_eq!(fs::read(pki.join("gcs.pem")).unwrap(), before);
    assert!(!pki.join("robot-1.pem").exists());
    // What is left of a former attempt is in the way as well.
    fs::remove_file(pki.join("gcs.pem")).unwrap();
    assert_eq!(
        code(certify(&order(folder.path(), &["gcs"]), now())),
        ExitCode::Refused
    );
    let twice = certify(&order(folder.path(), &["a", "a"]), now());
    assert_eq!(code(twice), ExitCode::Usage);
}

#[test]
fn an_authority_that_cannot_be_used_is_named_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let other = tempfile::tempdir().unwrap();
    let _ = certify(&order(folder.path(), &[]), now()).unwrap();
    let _ = certify(&order(other.path(), &["gcs"]), now()).unwrap();
    let (pki, others) = (folder.path().join("pki"), other.path().join("pki"));
    let attempt = || certify(&order(folder.path(), &["robot-1"]), now());
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
    let _ = certify(&order(folder.path(), &["robot-7", "router-1"]), now()).unwrap();
    let text = certify(&order(folder.path(), &["gcs"]), now()).unwrap();
    let config: Config = runtime::config::parse(&text, "relay.toml").unwrap();
    config.check().unwrap();
    assert_eq!(config.security.robots["robot-7"].get(), 7);
    assert_eq!(config.security.routers, ["router-1"]);
    assert_eq!(config.security.stations, ["gcs"]);
}
