//! [`read_key`]: the key of signatures, from its file.

use std::fs;
use std::path::Path;

use operator::user_files::secret_fault;
use runtime::exit::Failure;

use crate::SigningKey;
use crate::config::wrong;

/// Fewest characters of a passphrase: who has recorded a frame can try passphrases as fast as a machine can.
const MIN_PASSPHRASE: usize = 16;

/// The key in this file: 64 hexadecimal digits, or a passphrase.
///
/// # Errors
///
/// Exit code 78 when there is none, others may read it, or it is too short.
pub fn read_key(path: &Path) -> Result<SigningKey, Failure> {
    let unusable = |why: &str| {
        let path = path.display();
        wrong(format!(
            "the key of signatures {path} cannot be used: {why}"
        ))
        .with_next_step(format!(
            "put a passphrase that your stations have, too, into {path}, and `chmod 600` it"
        ))
    };
    if let Some(fault) = secret_fault(path) {
        return Err(unusable(&fault));
    }
    let text = fs::read_to_string(path).map_err(|error| unusable(&error.to_string()))?;
    let text = text.trim_end_matches(['\r', '\n']);
    match text.chars().count() < MIN_PASSPHRASE {
        true => {
            let why = format!("it has fewer than {MIN_PASSPHRASE} characters");
            Err(unusable(&why))
        }
        false => Ok(SigningKey::of(text)),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use runtime::exit::ExitCode;

    use super::*;

    #[test]
    fn a_key_is_a_file_that_its_owner_alone_reads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mavlink.key");
        assert!(read_key(&path).is_err(), "it is not there");
        let write = |text: &str, mode| {
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            read_key(&path)
        };
        let passphrase = "correct horse battery";
        assert_eq!(
            write(&format!("{passphrase}\n"), 0o600).ok(),
            Some(SigningKey::of(passphrase))
        );
        assert!(write("too short\n", 0o600).is_err());
        let refused = write(passphrase, 0o644).unwrap_err();
        assert_eq!(refused.code(), ExitCode::Configuration);
    }
}
