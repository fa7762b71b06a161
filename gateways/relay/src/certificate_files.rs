//! Whether the files of `[security]` can be used, before the network is opened with them: it would only say that one of
//! them is wrong.

use std::fmt::Display;
use std::fs;
use std::path::Path;

use rcgen::{KeyPair, PublicKeyData};
use runtime::config::Fault;
use time::OffsetDateTime;
use x509_parser::pem::Pem;

use crate::config::SecurityConfig;

/// Longest file, bytes: a hundred times a chain of certificates. A longer one is surely something else.
const MAX_BYTES: u64 = 1 << 20;

/// Label of a certificate in PEM.
const CERTIFICATE: &str = "CERTIFICATE";

/// Labels of a private key in PEM.
const KEYS: [&str; 3] = ["PRIVATE KEY", "EC PRIVATE KEY", "RSA PRIVATE KEY"];

/// What a certificate says.
pub struct CertificateFacts {
    /// The key that belongs to it, in DER.
    pub public_key: Vec<u8>,
    /// Whether it may sign others.
    pub is_authority: bool,
    /// When it ends.
    pub until: OffsetDateTime,
}

/// Whether the three files, if there are any, can be read, have what they must, and the key is that of the certificate.
///
/// # Errors
///
/// Which file is wrong, and what to do.
pub fn check(security: &SecurityConfig) -> Result<(), Fault> {
    let Some(files) = security.certificates()? else {
        return Ok(());
    };
    certificate(files.authority).map_err(|reason| Fault::at(&["security", "authority"], reason))?;
    let facts = certificate(files.certificate)
        .map_err(|reason| Fault::at(&["security", "certificate"], reason))?;
    key(files.key, files.certificate, &facts.public_key)
        .map_err(|reason| Fault::at(&["security", "key"], reason))
}

/// What the first certificate of a file says.
///
/// # Errors
///
/// What is wrong with the file, and what to do.
pub fn certificate(path: &Path) -> Result<CertificateFacts, String> {
    let blocks = blocks(path)?;
    let block = blocks.iter().find(|block| block.label == CERTIFICATE);
    let block = block.ok_or_else(|| {
        wrong(
            path,
            "has no certificate: name a file in PEM with `BEGIN CERTIFICATE`",
        )
    })?;
    let certificate = block.parse_x509().map_err(|error| damaged(path, &error))?;
    Ok(CertificateFacts {
        public_key: certificate.public_key().raw.to_vec(),
        is_authority: certificate.is_ca(),
        until: certificate.validity().not_after.to_datetime(),
    })
}

/// Whether the file has a key, and that of `public_key`, as far as its kind can be compared.
///
/// # Errors
///
/// What is wrong with the file, and what to do.
pub fn key(path: &Path, certificate: &Path, public_key: &[u8]) -> Result<(), String> {
    let blocks = blocks(path)?;
    let block = blocks
        .iter()
        .find(|block| KEYS.contains(&block.label.as_str()));
    let Some(block) = block else {
        let is_encrypted = blocks
            .iter()
            .any(|block| block.label == "ENCRYPTED PRIVATE KEY");
        return Err(match is_encrypted {
            true => wrong(
                path,
                "is encrypted with a password, for which the relay cannot ask: store the key without one",
            ),
            false => wrong(
                path,
                "has no private key: name a file in PEM with `BEGIN PRIVATE KEY`",
            ),
        });
    };
    // The two older forms are read by the network alone.
    if block.label != KEYS[0] {
        return Ok(());
    }
    let key =
        KeyPair::try_from(block.contents.as_slice()).map_err(|error| damaged(path, &error))?;
    if key.subject_public_key_info() == public_key {
        return Ok(());
    }
    Err(wrong(
        path,
        &format!(
            "is not the key of {}: name the two that were made together",
            certificate.display()
        ),
    ))
}

/// The blocks of a file in PEM.
fn blocks(path: &Path) -> Result<Vec<Pem>, String> {
    let unreadable = |error: std::io::Error| {
        wrong(
            path,
            &format!(
                "cannot be read ({error}): give its path from the folder in which the relay runs, and let its user read it"
            ),
        )
    };
    let facts = fs::metadata(path).map_err(unreadable)?;
    if !facts.is_file() || facts.len() > MAX_BYTES {
        return Err(wrong(path, "is no file in PEM: name one"));
    }
    let bytes = fs::read(path).map_err(unreadable)?;
    Pem::iter_from_buffer(&bytes)
        .collect::<Result<_, _>>()
        .map_err(|error| damaged(path, &error))
}

fn damaged(path: &Path, error: &dyn Display) -> String {
    wrong(path, &format!("is damaged ({error}): make or copy it anew"))
}

fn wrong(path: &Path, what: &str) -> String {
    format!("{} {what}", path.display())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::certify::{CertifyArgs, certify};

    /// A folder with the files of two machines, and their `[security]`.
    fn made() -> (tempfile::TempDir, SecurityConfig) {
        let folder = tempfile::tempdir().unwrap();
        let args = CertifyArgs {
            folder: folder.path().join("pki"),
            machines: ["robot-1", "gcs"].map(|name| name.parse().unwrap()).into(),
            days: 10,
            authority_days: 10,
        };
        certify(&args, std::time::SystemTime::now().into()).unwrap();
        let path = |name: &str| Some(args.folder.join(name));
        let security = SecurityConfig {
            authority: path("ca.pem"),
            certificate: path("robot-1.pem"),
            key: path("robot-1-key.pem"),
            ..SecurityConfig::default()
        };
        (folder, security)
    }

    #[test]
    fn files_that_were_made_together_are_right_and_none_are_needed() {
        let (_folder, security) = made();
        assert_eq!(check(&security), Ok(()));
        assert_eq!(check(&SecurityConfig::default()), Ok(()));
    }

    #[test]
    fn a_file_that_is_missing_damaged_or_another_is_named_with_what_to_do() {
        let (folder, right) = made();
        let write = |name: &str, text: &str| -> Option<PathBuf> {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            Some(path)
        };
        let key = fs::read_to_string(right.key.as_ref().unwrap()).unwrap();
        let encrypted = key.replace("PRIVATE KEY", "ENCRYPTED PRIVATE KEY");
        let authority = |authority| SecurityConfig {
            authority,
            ..right.clone()
        };
        let certificate = |certificate| SecurityConfig {
            certificate,
            ..right.clone()
        };
        let key = |key| SecurityConfig {
            key,
            ..right.clone()
        };
        let pki = |name: &str| Some(folder.path().join("pki").join(name));
        for (security, excerpt) in [
            (authority(pki("absent.pem")), "cannot be read"),
            (authority(Some(folder.path().into())), "is no file in PEM"),
            (authority(write("empty.pem", "")), "has no certificate"),
            (authority(right.key.clone()), "has no certificate"),
            (
                certificate(write(
                    "cut.pem",
                    "-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n",
                )),
                "is damaged",
            ),
            (certificate(pki("gcs.pem")), "is not the key of"),
            (key(pki("gcs-key.pem")), "is not the key of"),
            (key(right.certificate.clone()), "has no private key"),
            (key(write("encrypted.pem", &encrypted)), "with a password"),
            (
                key(write(
                    "cut-key.pem",
                    "-----BEGIN PRIVATE KEY-----\nMIIB\n-----END PRIVATE KEY-----\n",
                )),
                "is damaged",
            ),
        ] {
            let fault = check(&security).unwrap_err();
            assert!(fault.reason().contains(excerpt), "{fault}");
        }
    }
}
