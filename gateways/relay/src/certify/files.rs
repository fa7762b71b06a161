//! The folder with the certificates and keys: `<name>.pem` and `<name>-key.pem`. Nothing in it is ever overwritten.

use std::collections::BTreeSet;
use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rcgen::{Certificate, KeyPair};

use super::error::CertifyError;
use crate::config::check_name;

/// Name of the authority's files, which no machine can have.
pub(super) const AUTHORITY: &str = "ca";

/// Certificate and key of a name.
pub(super) fn files(folder: &Path, name: &str) -> [PathBuf; 2] {
    [
        folder.join(format!("{name}.pem")),
        folder.join(format!("{name}-key.pem")),
    ]
}

/// Makes the folder, which its owner alone can look into.
pub(super) fn make_folder(folder: &Path) -> Result<(), CertifyError> {
    let mut builder = DirBuilder::new();
    builder
        .recursive(true)
        .mode(0o700)
        .create(folder)
        .map_err(|error| file_error(folder, error))
}

/// The key first: a certificate without its key would be in the way.
pub(super) fn write_pair(
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
pub(super) fn all_names(folder: &Path) -> Result<BTreeSet<String>, CertifyError> {
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
