//! [`RealtimeConfig`]: what can be asked for.

use rustix::thread::CpuSet;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

/// `[realtime]`
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeConfig {
    /// All memory of the process is in RAM, and stays there.
    pub lock_memory: bool,
    /// The loop's priority among real-time threads (`SCHED_FIFO`); 0: it is an ordinary thread.
    #[serde(deserialize_with = "priority")]
    pub priority: u8,
    /// The processors on which the loop runs; empty: all.
    #[serde(deserialize_with = "processors")]
    pub processors: Vec<u16>,
    /// No processor of the machine sleeps deeply while the helicopter flies.
    pub low_latency_processor: bool,
}

crate::ranged! {
    fn priority(u8) in 0..=99;
}

fn processors<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u16>, D::Error> {
    let processors = Vec::<u16>::deserialize(deserializer)?;
    match processors
        .iter()
        .find(|it| usize::from(**it) >= CpuSet::MAX_CPU)
    {
        Some(number) => Err(D::Error::custom(format_args!(
            "{number} is out of range: processors have numbers from 0 to {}",
            CpuSet::MAX_CPU - 1
        ))),
        None => Ok(processors),
    }
}

impl RealtimeConfig {
    /// Whether anything is asked for at all.
    pub fn is_asked(&self) -> bool {
        *self != RealtimeConfig::default()
    }

    /// Whether anything is asked for the loop's thread.
    pub fn is_of_loop(&self) -> bool {
        self.lock_memory || self.priority > 0 || !self.processors.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::proof::assert_refused;

    #[test]
    fn what_no_system_has_is_refused_with_its_line() {
        assert_refused::<RealtimeConfig>(
            r#"
            priority = 100 #! must be from 0 to 99
            ---
            lock_memory = true
            processors = [0, 1024] #! 1024 is out of range: processors have numbers from 0 to 1023
            ---
            processor = [1] #! did you mean `processors`?
            "#,
        );
    }
}
