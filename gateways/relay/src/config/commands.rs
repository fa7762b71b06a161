//! `[commands]`: which requests are taken, from whom, and what follows when a station is lost.

use std::time::Duration;

use serde::Deserialize;

runtime::ranged! {
    fn deadline_ms(u32) in 100..=86_400_000;
    fn seconds(f64) in 0.5..=86_400.0;
}

/// `[commands]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommandsConfig {
    /// Names of the stations that may command.
    pub stations: Vec<String>,
    /// Deadline of a request that says neither when it was issued nor until when it may begin, ms.
    #[serde(deserialize_with = "deadline_ms")]
    pub deadline_ms: u32,
    /// After how long without any word about it a request ends as unknown, s.
    #[serde(deserialize_with = "seconds")]
    pub unknown_after_s: f64,
    /// What happens to a movement when the station that ordered it is lost.
    pub link_loss: LinkLoss,
    /// When a station counts as lost, s.
    #[serde(deserialize_with = "seconds")]
    pub link_loss_s: f64,
}

impl Default for CommandsConfig {
    fn default() -> Self {
        CommandsConfig {
            stations: Vec::new(),
            deadline_ms: 5000,
            unknown_after_s: 60.0,
            link_loss: LinkLoss::Continue,
            link_loss_s: 10.0,
        }
    }
}

impl CommandsConfig {
    /// Deadline of a request that says neither when it was issued nor until when it may begin.
    pub fn deadline(&self) -> Duration {
        Duration::from_millis(self.deadline_ms.into())
    }

    /// After how long without any word about it a request ends as unknown.
    pub fn unknown_after(&self) -> Duration {
        Duration::from_secs_f64(self.unknown_after_s)
    }

    /// After how long a station that is silent counts as lost; nothing when this changes nothing.
    pub fn lost_after(&self) -> Option<Duration> {
        match self.link_loss {
            LinkLoss::Continue => None,
            LinkLoss::Hold | LinkLoss::Land => Some(Duration::from_secs_f64(self.link_loss_s)),
        }
    }
}

/// What happens to a movement when the station that ordered it is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LinkLoss {
    /// It goes on to its end, as when a program on the robot dies that ordered it.
    Continue,
    /// The helicopter hovers.
    Hold,
    /// It lands.
    Land,
}
