//! [`Snapshot`]: the whole core as bytes, and a core from these bytes.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::{Kept, Status};

/// The version of the bytes. Another version of the core has another one.
const VERSION: u32 = 1;

/// The bytes are no snapshot of this version's core, or its estimator could not say what it knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("these bytes are no snapshot of a status of this version that can be gone on with")]
pub struct NotASnapshot;

/// Status and its configuration.
pub struct Snapshot {
    /// The configuration, but for the logs.
    pub config: Config,
    /// The core, without logs.
    pub status: Status,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    version: u32,
    config: String,
    kept: Kept,
}

impl Snapshot {
    /// The configuration as the text that a snapshot has, as `status.toml` has it.
    pub fn text_of(config: &Config) -> String {
        // Every value came from such a text.
        toml::to_string(config).unwrap_or_default()
    }

    /// The bytes of `status`; `text` is its configuration.
    pub fn take(status: &Status, text: &str) -> Vec<u8> {
        let saved = Saved {
            version: VERSION,
            config: text.to_owned(),
            kept: status.keep(),
        };
        // Writing into memory does not fail, and every type of the core can be written.
        postcard::to_allocvec(&saved).unwrap_or_default()
    }

    /// The core that these bytes are.
    ///
    /// # Errors
    /// They are no snapshot, or one of another version.
    pub fn restore(bytes: &[u8]) -> Result<Snapshot, NotASnapshot> {
        let (version, _) = postcard::take_from_bytes::<u32>(bytes).map_err(|_| NotASnapshot)?;
        if version != VERSION {
            return Err(NotASnapshot);
        }
        let (saved, rest) = postcard::take_from_bytes::<Saved>(bytes).map_err(|_| NotASnapshot)?;
        if !rest.is_empty() {
            return Err(NotASnapshot);
        }
        let config: Config =
            runtime::config::parse(&saved.config, "the journal").map_err(|_| NotASnapshot)?;
        let calibration = config.calibration.clone();
        let status = Status::from_kept(saved.kept, calibration, config.estimator.build());
        let status = status.ok_or(NotASnapshot)?;
        Ok(Snapshot { config, status })
    }

    /// The same core with another configuration: what it would do from here on.
    #[must_use]
    pub fn against(mut self, config: &Config) -> Snapshot {
        let calibration = config.calibration.clone();
        self.status
            .reconfigure(calibration, config.estimator.build());
        self.config = config.clone();
        self
    }
}
