//! The operator's commands, each a thin shell around a pure value, and what they share.

pub(crate) mod conversation;
pub mod exchange;
pub(crate) mod json;
pub(crate) mod latest;
pub mod param;
pub mod plan;
mod position;
pub mod request;
pub(crate) mod resulting;
pub(crate) mod robot;
pub mod robots;
pub mod sample_age;
pub mod shell;

use std::os::fd::AsFd;
use std::path::Path;
use std::time::Duration;

use ipc_types::service::{ServiceId, own};
use ipc_types::{
    Descriptor, Domain, Ipc, Module, MonotonicNs, Provider, RelayModule, RobotId, SchedulingRole,
    Source, Waiter, request_slice,
};
use runtime::args::CommonArgs;
use runtime::duration::Shown;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;

use crate::config::{Config, DEFAULT_FILE};
pub(crate) use json::json_line;

/// Begins logging and reads the configuration. Nothing comes out when it was only to be checked; it is printed then.
pub(crate) fn configuration(common: &CommonArgs) -> Result<Option<Config>, Failure> {
    runtime::logging::init(common.verbosity())?;
    if common.check_config {
        resulting::print("ril", &resulting::of_commands(common)?)?;
        return Ok(None);
    }
    let loaded =
        runtime::config::load::<Config>(common.config.as_deref(), Path::new(DEFAULT_FILE))?;
    tracing::debug!(file = ?loaded.file, config = ?loaded.value, "configuration");
    Ok(Some(loaded.value))
}

/// The command's part in the robot's shared memory, and its one wait.
pub(crate) struct Session {
    pub(crate) ipc: Ipc,
    waiter: Waiter,
    pub(crate) termination: Termination,
}

impl Session {
    /// Takes part. Signals no longer end the process by themselves from here on.
    pub(crate) fn join(common: &CommonArgs) -> Result<Session, Failure> {
        let termination = Termination::install().or_fail(ExitCode::Internal)?;
        let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
        let ipc =
            Ipc::join(&domain, RobotId::from(common.robot), "ril").or_fail(ExitCode::Internal)?;
        request_slice(SchedulingRole::Consumer);
        Ok(Session {
            ipc,
            waiter: Waiter::new(),
            termination,
        })
    }

    /// Sleeps until a source has something, a signal comes or it is `until`; nothing stands for no limit.
    pub(crate) fn wait<'a>(
        &self,
        others: impl IntoIterator<Item = &'a mut dyn Source>,
        until: Option<MonotonicNs>,
    ) -> Result<(), Failure> {
        let mut signals = Descriptor::new(self.termination.as_fd());
        let mut sources: Vec<((), &mut dyn Source)> = vec![((), &mut signals)];
        for other in others {
            sources.push(((), other));
        }
        let timeout = until.map(|until| until.since(MonotonicNs::now()));
        self.waiter
            .wait(&mut sources, timeout)
            .or_fail(ExitCode::Internal)?;
        Ok(())
    }

    /// The live process that provides the service `key`.
    pub(crate) fn provider(&self, key: &str) -> Result<Option<Provider>, Failure> {
        self.ipc.provider(key).or_fail(ExitCode::Internal)
    }

    /// Whether a live process provides the service `key`.
    pub(crate) fn is_provided(&self, key: &str) -> Result<bool, Failure> {
        Ok(self.provider(key)?.is_some())
    }

    /// The failure that nothing of the topic `key` came in time: no process provides it, or its provider publishes nothing.
    pub(crate) fn nothing_came(&self, key: &str, timeout: Duration) -> Result<Failure, Failure> {
        let robot = self.ipc.robot();
        let timeout = Shown(timeout);
        let Some(provider) = self.provider(key)? else {
            return Ok(absent(key, robot));
        };
        let (running, next_step) = match process_of(key) {
            _ if is_relayed(key, &provider) => (
                "the relay".to_owned(),
                format!("`ril relay status --robot {robot}` shows its link to the robot"),
            ),
            Some(process) => (
                format!("`ril run {process}`"),
                format!("`ril status --robot {robot}` shows the link to the DSP"),
            ),
            None => (
                "its module".to_owned(),
                "wait longer with --timeout".to_owned(),
            ),
        };
        let text = format!(
            "nothing came from {key} of robot {robot} in {timeout}, although {running} is running"
        );
        Ok(Failure::new(ExitCode::Timeout, text).with_next_step(next_step))
    }
}

/// The failure that no process provides the service `key`; other robots that are alive are named.
pub(crate) fn absent(key: &str, robot: RobotId) -> Failure {
    let start = match process_of(key) {
        Some(process) => format!("start `ril run {process} --robot {robot}`"),
        None => "start the module that provides it".to_owned(),
    };
    let text = format!(
        "no process provides {key} of robot {robot}{}{}",
        robot::others_alive(robot),
        robot::other_domains()
    );
    Failure::new(ExitCode::ServiceAbsent, text).with_next_step(format!("{start} and try again"))
}

/// Whether the service `key`, which `provider` provides, comes from another machine. The relay's own topics do not.
pub(crate) fn is_relayed(key: &str, provider: &Provider) -> bool {
    let is_own = key.split('/').next() == Some(RelayModule::NAME);
    provider.process == RelayModule::NAME && !is_own
}

/// The process that provides the service `key`; nothing when that is a module outside the RIL.
pub(crate) fn process_of(key: &str) -> Option<&'static str> {
    own(key).map(ServiceId::provider)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_relay_provides_comes_from_another_machine_but_for_its_own_topics() {
        let provider = |process: &str| Provider {
            pid: 7,
            process: process.to_owned(),
            since_ns: 1,
            pid_namespace: 4,
            time_namespace: 5,
        };
        for (key, process, expected) in [
            ("hero_telemetry", "relay", true),
            ("battery_watch/state", "relay", true),
            ("hero_telemetry", "status", false),
            ("relay/link", "relay", false),
            ("relay/state", "relay", false),
        ] {
            assert_eq!(
                is_relayed(key, &provider(process)),
                expected,
                "{key} of {process}"
            );
        }
    }

    #[test]
    fn a_missing_process_is_named_with_how_to_start_it() {
        for (key, process) in [
            ("hero_telemetry", "ril run status --robot 7"),
            ("dsp_telemetry", "ril run bridge --robot 7"),
            ("movement", "ril run bridge --robot 7"),
        ] {
            let failure = absent(key, RobotId::new(7).unwrap());
            assert_eq!(failure.code(), ExitCode::ServiceAbsent);
            assert!(failure.next_step().contains(process), "{failure:?}");
        }
    }
}
