//! Configuration of `ril run view`, `view.toml`.
//!
//! Every value has a default; the annotated example `ril/view.toml` shows them all and is tested to parse to them.

use serde::Deserialize;

use crate::config::RequestConfig;

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "view.toml";

/// The annotated example.
pub(super) const EXAMPLE: &str = include_str!("../../../view.toml");

/// The port where Foxglove looks first.
pub const DEFAULT_PORT: u16 = 8765;

/// All of `view.toml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewConfig {
    /// Port on loopback.
    #[serde(deserialize_with = "port")]
    pub port: u16,
    /// Names of this machine that a Host may be, beside those of loopback.
    pub names: Vec<String>,
    /// Origins that may connect, beside the view's own.
    pub origins: Vec<String>,
    /// What others than pages may order.
    pub commands: CommandsConfig,
    /// Orders.
    pub request: RequestConfig,
}

/// `[commands]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommandsConfig {
    /// Whether Foxglove clients have services and parameters.
    pub foxglove: bool,
}

runtime::ranged! {
    fn port(u16) in 1..=65_535;
}

impl Default for ViewConfig {
    fn default() -> Self {
        ViewConfig {
            port: DEFAULT_PORT,
            names: Vec::new(),
            origins: Vec::new(),
            commands: CommandsConfig::default(),
            request: RequestConfig::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_annotated_example_is_the_defaults() {
        let read: ViewConfig = runtime::config::parse(EXAMPLE, "view.toml").unwrap();
        assert_eq!(read, ViewConfig::default());
        for wrong in ["prot = 1", "port = 0", "[request]\ntimeout = 1"] {
            assert!(
                runtime::config::parse::<ViewConfig>(wrong, "view.toml").is_err(),
                "{wrong}"
            );
        }
    }
}
