//! `TokenKey`: the secret from which tokens are made, in a file that its owner alone can read.
//!
//! view.toml has the names of tokens and what they allow, and no secret: a token is a hash of the key and of its name.
//! So the server and `ril view --invite` agree on it without speaking with each other, and a file that is read by
//! others gives nothing away.

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use data_encoding::HEXLOWER;
use operator::user_files::{secret_fault, state_folder};
use runtime::durable;
use runtime::exit::{ExitCode, Failure};
use sha2::{Digest, Sha256};

use crate::config::ViewConfig;

/// Random bits of the key, in bytes.
const KEY_BYTES: usize = 32;

/// Bits of a token, in bytes.
const TOKEN_BYTES: usize = 16;

/// The secret from which tokens are made. It outlives the server, so that a page which is open goes on when the server
/// was started again.
pub(crate) struct TokenKey(String);

impl TokenKey {
    /// Reads the key, or makes one if there is none.
    ///
    /// # Errors
    ///
    /// Code 8 when others may read the file, it is another user's, or it has no key.
    pub fn open(path: &Path) -> Result<TokenKey, Failure> {
        if !path.exists() {
            make(path).map_err(|error| {
                unusable(path, &error.to_string()).with_next_step(
                    "name a file in a folder that this user may write by `token_key` of view.toml",
                )
            })?;
        }
        if let Some(fault) = secret_fault(path) {
            return Err(unusable(path, &fault));
        }
        let text = fs::read_to_string(path).map_err(|error| unusable(path, &error.to_string()))?;
        let key = text.trim_end();
        match key.len() == 2 * KEY_BYTES && key.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            true => Ok(TokenKey(key.to_owned())),
            false => Err(unusable(path, "it has no key")),
        }
    }

    /// The token of `ril view` itself, of this port and domain. It is that of no name, because no key begins with such
    /// words; and a page of a simulation does not order a robot that is shown at the same port later.
    pub fn own_token(&self, port: u16, domain: &Path) -> String {
        let mut hash = Sha256::new();
        hash.update(format!("ril view {port} "));
        hash.update(domain.as_os_str().as_bytes());
        hash.update(&self.0);
        HEXLOWER.encode(&hash.finalize()[..TOKEN_BYTES])
    }

    /// The token of this name.
    pub fn token(&self, name: &str) -> String {
        let hash = Sha256::digest(format!("{}{name}", self.0));
        HEXLOWER.encode(&hash[..TOKEN_BYTES])
    }
}

/// Where the key of this configuration is.
///
/// # Errors
///
/// Code 78 when it has no path and this user has no home.
pub fn path(config: &ViewConfig) -> Result<PathBuf, Failure> {
    if let Some(path) = &config.token_key {
        return Ok(path.clone());
    }
    state_folder()
        .map(|folder| folder.join("view.key"))
        .ok_or_else(|| {
            let text = "this user has no home for the key of tokens";
            Failure::new(ExitCode::Configuration, text)
                .with_next_step("name a file by `token_key` of view.toml")
        })
}

/// 128 random bits as 32 hexadecimal digits.
pub(crate) fn random_hex() -> io::Result<String> {
    random::<TOKEN_BYTES>().map(|bytes| HEXLOWER.encode(&bytes))
}

fn random<const N: usize>() -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    let mut file = fs::File::open("/dev/urandom")?;
    io::Read::read_exact(&mut file, &mut bytes)?;
    Ok(bytes)
}

/// Makes the file at once with its key, so that another process that makes it too reads the same one.
fn make(path: &Path) -> io::Result<()> {
    let folder = durable::folder_of(path);
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(folder)?;
    let made = path.with_extension(format!("{}.new", std::process::id()));
    let mut file = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(&made)?;
    writeln!(file, "{}", HEXLOWER.encode(&random::<KEY_BYTES>()?))?;
    file.sync_all()?;
    let linked = fs::hard_link(&made, path);
    fs::remove_file(&made)?;
    match linked {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(()),
        linked => linked.and_then(|()| durable::sync_folder(folder)),
    }
}

fn unusable(path: &Path, why: &str) -> Failure {
    let text = format!(
        "the key of tokens, {}, cannot be used: {why}",
        path.display()
    );
    Failure::new(ExitCode::NotInOrder, text)
        .with_next_step("`chmod 600` it, or remove it: the next start makes another one, and all tokens are new then")
}
