//! [`Snapshot`]: the whole core as bytes, and a core from these bytes.

use serde::{Deserialize, Serialize};

use crate::config::BridgeConfig;
use crate::core::Bridge;
use crate::safety::fence::Fence;
use crate::snapshot::NotASnapshot;

/// The version of the bytes. Another version of the core has another one.
const VERSION: u32 = 2;

/// A bridge and its configuration.
///
/// The core is told by what it has seen; what the configuration says stands beside it as a text. A trajectory generator that was
/// given to [`Bridge::with_trajectory`] is not in it: a core from a snapshot has the one that its configuration chooses.
#[derive(Debug)]
pub struct Snapshot {
    /// The configuration, but for the port.
    pub config: BridgeConfig,
    /// The core.
    pub bridge: Bridge,
}

#[derive(Serialize)]
struct Saved<'a> {
    version: u32,
    config: &'a str,
    fence: Option<&'a str>,
    bridge: &'a Bridge,
}

#[derive(Deserialize)]
struct Loaded {
    version: u32,
    config: String,
    fence: Option<String>,
    bridge: Bridge,
}

impl Snapshot {
    /// The configuration as the text that a snapshot has, as `bridge.toml` has it.
    pub fn text_of(config: &BridgeConfig) -> String {
        // Every value came from such a text.
        toml::to_string(config).unwrap_or_default()
    }

    /// The bytes of `bridge`; `config` is what it was made with, and `text` the same as a text.
    pub fn take(bridge: &Bridge, config: &BridgeConfig, text: &str) -> Vec<u8> {
        let fence = (*bridge.fence() != config.fence)
            .then(|| toml::to_string(bridge.fence()).unwrap_or_default());
        let saved = Saved {
            version: VERSION,
            config: text,
            fence: fence.as_deref(),
            bridge,
        };
        // Writing into memory does not fail, and every type of the core can be written.
        postcard::to_allocvec(&saved).unwrap_or_default()
    }

    /// The bridge that these bytes are.
    ///
    /// # Errors
    /// They are no snapshot, or one of another version.
    pub fn restore(bytes: &[u8]) -> Result<Snapshot, NotASnapshot> {
        let (version, _) = postcard::take_from_bytes::<u32>(bytes).map_err(|_| NotASnapshot)?;
        if version != VERSION {
            return Err(NotASnapshot);
        }
        let (loaded, rest) =
            postcard::take_from_bytes::<Loaded>(bytes).map_err(|_| NotASnapshot)?;
        if !rest.is_empty() || loaded.version != VERSION {
            return Err(NotASnapshot);
        }
        let config: BridgeConfig =
            runtime::config::parse(&loaded.config, "the journal").map_err(|_| NotASnapshot)?;
        let fence: Fence = match loaded.fence {
            Some(text) => runtime::config::parse(&text, "the journal").map_err(|_| NotASnapshot)?,
            None => config.fence.clone(),
        };
        let mut bridge = loaded.bridge;
        bridge.configure(&config, fence)?;
        Ok(Snapshot { config, bridge })
    }

    /// The same bridge with another configuration: what it would do from here on. Parameters and a geofence that were set at run
    /// time stay.
    ///
    /// # Errors
    /// Never for a snapshot that was restored.
    pub fn against(mut self, config: &BridgeConfig) -> Result<Snapshot, NotASnapshot> {
        let fence = match *self.bridge.fence() == self.config.fence {
            true => config.fence.clone(),
            false => self.bridge.fence().clone(),
        };
        self.bridge
            .replace_parameters(&self.config.parameters, &config.parameters);
        self.bridge.configure(config, fence)?;
        self.config = config.clone();
        Ok(self)
    }
}
