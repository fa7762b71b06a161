//! Names of stations, and of certificates: they are parts of keys, and are shown to operators.

/// Longest name of a station, bytes: it is shown in a field of 32 that ends with a zero.
pub const MAX_NAME: usize = 31;

/// Whether this can be the name of a station.
///
/// # Errors
///
/// What is wrong with it.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(is_letter) {
        return Err(format!(
            "`{name}` is no name of a station: use 1 to {MAX_NAME} letters, digits, - and _"
        ));
    }
    Ok(())
}
