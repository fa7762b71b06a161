//! Random numbers that cannot be guessed, for tokens.

use std::fs::File;
use std::io::{self, Read};

/// 128 random bits of the kernel.
pub(super) fn random() -> io::Result<[u8; 16]> {
    let mut bytes = [0; 16];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// 128 random bits as 32 hexadecimal digits.
pub(super) fn random_hex() -> io::Result<String> {
    let bytes = random()?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
