//! JSON, as plans of QGroundControl and GeoJSON have it.

use serde::de::DeserializeOwned;

use super::items::clean_reason;
use crate::error::ReadError;

/// Parses JSON; a mistake is reported with its line.
pub(super) fn json<T: DeserializeOwned>(text: &str) -> Result<T, ReadError> {
    serde_json::from_str(text).map_err(|error| {
        // The message ends with the place, which the error has by itself.
        let message = error.to_string();
        let reason = clean_reason(message.split(" at line ").next().unwrap_or_default());
        match error.line() {
            0 => ReadError::file(reason),
            line => ReadError::line(line, reason),
        }
    })
}
