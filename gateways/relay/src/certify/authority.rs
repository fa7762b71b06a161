//! [`Authority`]: what signs the certificates of the machines, made once and loaded ever after.

use std::fs;
use std::path::Path;

use rcgen::{
    BasicConstraints, Certificate, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

use super::error::CertifyError;
use super::files::{AUTHORITY, files, make_folder, write_pair};
use super::machine::Machine;

/// Common name of the authority.
const AUTHORITY_NAME: &str = "HERO relay authority";

/// A certificate holds from a day before it was made, because clocks of machines in the field differ.
const BEFORE: Duration = Duration::DAY;

/// What signs the certificates of the machines.
pub(super) struct Authority {
    issuer: Issuer<'static, KeyPair>,
    /// When its certificate ends.
    pub(super) until: OffsetDateTime,
}

impl Authority {
    /// The one in the folder, or a new one.
    /// It holds for so many days if it is made now.
    pub(super) fn open(
        folder: &Path,
        days: u32,
        now: OffsetDateTime,
    ) -> Result<Authority, CertifyError> {
        let [certificate, key] = files(folder, AUTHORITY);
        match (certificate.exists(), key.exists()) {
            (false, false) => Authority::make(folder, days, now),
            _ => Authority::load(folder, now),
        }
    }

    fn make(folder: &Path, days: u32, now: OffsetDateTime) -> Result<Authority, CertifyError> {
        make_folder(folder)?;
        let key = KeyPair::generate()?;
        let mut params = Authority::params();
        params.not_before = now - BEFORE;
        params.not_after = now + Duration::days(days.into());
        let certificate = params.self_signed(&key)?;
        write_pair(folder, AUTHORITY, &certificate, &key)?;
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
    pub(super) fn sign(
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
