//! The serial port, the link, and what the DSP reports over it.

use std::path::PathBuf;
use std::time::Duration;

use dsp_protocol::{Group, Profile, StatusMask};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

runtime::ranged! {
    fn baud_rate(u32) in 50..=4_000_000;
    fn milliseconds(u64) in 1..=600_000;
    fn pc_timeout_ms(u16) in 0..=60_000;
}

/// `[serial]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct SerialConfig {
    /// Path of the port (`puerto_serie`).
    pub port: PathBuf,
    /// Bits per second; 8N1.
    #[serde(deserialize_with = "baud_rate")]
    pub baud_rate: u32,
    /// Whether the port's driver is asked to hand on each byte at once. One that cannot stays as it is.
    pub low_latency: bool,
    /// First pause before a port that is gone is opened again; doubled up to `reopen_max_ms`.
    #[serde(deserialize_with = "milliseconds")]
    pub reopen_min_ms: u64,
    /// Longest pause before a port that is gone is opened again.
    #[serde(deserialize_with = "milliseconds")]
    pub reopen_max_ms: u64,
}

impl Default for SerialConfig {
    fn default() -> Self {
        SerialConfig {
            port: PathBuf::from("/dev/ttyS0"),
            baud_rate: 115_200,
            low_latency: true,
            reopen_min_ms: 20,
            reopen_max_ms: 100,
        }
    }
}

/// Bits of a byte on the line: 8N1.
pub(super) const BITS_PER_BYTE: u32 = 10;

impl SerialConfig {
    /// How long the line takes for a byte.
    pub fn byte_time(&self) -> Duration {
        Duration::from_secs(1) * BITS_PER_BYTE / self.baud_rate
    }

    /// Pause after `failures` failed openings in a row.
    pub fn reopen_pause(&self, failures: u32) -> Duration {
        back_off(self.reopen_min_ms, self.reopen_max_ms, failures)
    }
}

/// Attempts in all before a command is given up.
pub const ATTEMPTS: u32 = 3;

checked!(LinkConfig);

/// `[link]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(remote = "Self", deny_unknown_fields, default)]
pub struct LinkConfig {
    /// How messages are framed: the same as at the DSP.
    #[serde(deserialize_with = "profile", serialize_with = "name_of_profile")]
    pub profile: Profile,
    /// After how long without a message from the bridge the DSP stops by itself; 0 never, and then the port is not
    /// touched.
    #[serde(deserialize_with = "pc_timeout_ms")]
    pub pc_timeout_ms: u16,
    /// How long one attempt of a command waits for its acknowledgement.
    #[serde(deserialize_with = "milliseconds")]
    pub ack_timeout_ms: u64,
    /// After how long without a valid message the link is silent, and after how long an observation is not known any
    /// more: at least this, and three observed periods.
    #[serde(deserialize_with = "milliseconds")]
    pub silent_after_ms: u64,
    /// Longest time that the first command of a start-up waits for its acknowledgement, after a start-up that was not
    /// answered: that begins at `ack_timeout_ms` and doubles. A little less than the period of the published state,
    /// which then leaves in the same wake-up.
    #[serde(deserialize_with = "milliseconds")]
    pub start_up_retry_ms: u64,
}

impl Default for LinkConfig {
    fn default() -> Self {
        LinkConfig {
            profile: Profile::Classic,
            pc_timeout_ms: 2000,
            ack_timeout_ms: 200,
            silent_after_ms: 1000,
            start_up_retry_ms: 900,
        }
    }
}

impl LinkConfig {
    /// The DSP must not take a PC for gone that is still repeating its sign of life.
    fn check(&self) -> Result<(), String> {
        let shortest = (self.ack_timeout_ms * u64::from(ATTEMPTS)).saturating_mul(3) / 2;
        let timeout = u64::from(self.pc_timeout_ms);
        if timeout > 0 && timeout < shortest {
            return Err(format!(
                "pc_timeout_ms = {timeout} is too short for ack_timeout_ms = {}: 0, or at least {shortest}",
                self.ack_timeout_ms
            ));
        }
        Ok(())
    }

    /// How long one attempt waits for its acknowledgement.
    pub fn ack_timeout(&self) -> Duration {
        Duration::from_millis(self.ack_timeout_ms)
    }

    /// After how long without a message from the bridge the DSP stops by itself.
    pub fn pc_timeout(&self) -> Duration {
        Duration::from_millis(self.pc_timeout_ms.into())
    }

    /// After how long without a valid message the link is silent.
    pub fn silent_after(&self) -> Duration {
        Duration::from_millis(self.silent_after_ms)
    }

    /// How long the first command of a start-up waits for its acknowledgement after `failures` failed start-ups in a
    /// row.
    pub fn start_up_timeout(&self, failures: u32) -> Duration {
        let longest_ms = self.start_up_retry_ms.max(self.ack_timeout_ms);
        back_off(self.ack_timeout_ms, longest_ms, failures)
    }
}

fn profile<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Profile, D::Error> {
    let name = String::deserialize(deserializer)?;
    Profile::from_name(&name).ok_or_else(|| {
        let known = Profile::ALL.map(Profile::name).join(" or ");
        D::Error::custom(format_args!("unknown profile `{name}`: it is {known}"))
    })
}

fn name_of_profile<S: Serializer>(profile: &Profile, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(profile.name())
}

/// Which status samples are newer than the one before: see [`coherence`](crate::link::coherence).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CoherenceRule {
    /// Samples in order are sent at once.
    #[default]
    Immediate,
    /// The source's rule: a sample waits for its successor.
    Confirmed,
}

/// `[status]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct StatusConfig {
    /// Names of the groups that the DSP shall send (`mascara`).
    #[serde(deserialize_with = "groups", serialize_with = "names_of_groups")]
    pub groups: Vec<Group>,
    /// Which samples are published.
    pub coherence: CoherenceRule,
}

impl Default for StatusConfig {
    fn default() -> Self {
        StatusConfig {
            groups: Group::ALL.to_vec(),
            coherence: CoherenceRule::Immediate,
        }
    }
}

impl StatusConfig {
    /// The mask of the groups.
    pub fn mask(&self) -> StatusMask {
        self.groups.iter().copied().collect()
    }
}

fn groups<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Group>, D::Error> {
    Vec::<String>::deserialize(deserializer)?
        .iter()
        .map(|name| {
            Group::ALL
                .into_iter()
                .find(|group| group.name() == name)
                .ok_or_else(|| {
                    let known: Vec<_> = Group::ALL.iter().map(|group| group.name()).collect();
                    D::Error::custom(format_args!(
                        "unknown group `{name}`; the groups are {}",
                        known.join(", ")
                    ))
                })
        })
        .collect()
}

fn names_of_groups<S: Serializer>(groups: &[Group], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(groups.iter().map(|group| group.name()))
}

/// `min`, doubled for each failure after the first, never more than `max`.
fn back_off(min_ms: u64, max_ms: u64, failures: u32) -> Duration {
    let doubled = min_ms.saturating_mul(1 << failures.saturating_sub(1).min(32));
    Duration::from_millis(doubled.min(max_ms))
}
