//! What the live processes of a robot run with. `RunningBridge`: the configuration of a live bridge, as its journal
//! says it. `file_of`, `command_of`: the file that a live process has read, and its command line.
//!
//! A file says what the next start will run with: it may have been changed since, or be another one than that of this
//! folder.

use std::ffi::OsStr;
use std::fmt;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bridge::BridgeConfig;
use bridge::journal::{Record, Snapshot};
use ipc_types::payload::BridgeJournal;
use ipc_types::{Ipc, MonotonicNs, OpenError, Provider, Source, Subscriber, Topic};
use module_kit::journal::{Entry, JournalReader};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::session::{Session, Topics};

/// Where a configuration of the bridge comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConfigOrigin {
    /// The live bridge says it.
    Running,
    /// A file: no bridge says what it runs with, or the operator named the file.
    File(PathBuf),
}

impl fmt::Display for ConfigOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ConfigOrigin::Running => f.write_str("the running configuration"),
            ConfigOrigin::File(path) => path.display().fmt(f),
        }
    }
}

/// The configuration of a live bridge. A bridge writes a snapshot, which has it, when a program subscribes to its
/// journal.
pub struct RunningBridge {
    port: Subscriber<BridgeJournal>,
    reader: JournalReader,
    /// When this program asked. What a subscriber gets first is the last piece of before, perhaps with the snapshot
    /// that another one has asked for.
    asked: MonotonicNs,
    config: Option<BridgeConfig>,
}

impl RunningBridge {
    /// Subscribes to the bridge's journal.
    ///
    /// # Errors
    ///
    /// See [`OpenError`].
    pub fn open(ipc: &Ipc) -> Result<RunningBridge, OpenError> {
        RunningBridge::open_with(|| ipc.subscriber())
    }

    fn open_with(
        subscribe: impl FnOnce() -> Result<Subscriber<BridgeJournal>, OpenError>,
    ) -> Result<RunningBridge, OpenError> {
        // Before subscribing, which asks: the bridge may answer before this process runs again, and answers once.
        let asked = MonotonicNs::now();
        Ok(RunningBridge {
            port: subscribe()?,
            reader: JournalReader::new(),
            asked,
            config: None,
        })
    }

    /// The configuration, if it has come.
    pub fn take(&mut self) -> Option<BridgeConfig> {
        self.config.take()
    }

    /// The configuration without the serial port, and with the fence that is in force; `None` if the bridge does not
    /// say it within `timeout`.
    pub fn wait(&mut self, timeout: Duration) -> Option<BridgeConfig> {
        let give_up = MonotonicNs::now() + timeout;
        loop {
            self.drain();
            let (config, left) = (self.config.take(), give_up.since(MonotonicNs::now()));
            if config.is_some() || left.is_zero() || self.port.wait(left).is_err() {
                return config;
            }
        }
    }
}

impl Topics for RunningBridge {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        vec![&mut self.port]
    }

    fn drain(&mut self) {
        let RunningBridge {
            port,
            reader,
            asked,
            config,
        } = self;
        let drained = port.drain(|piece| {
            reader.take(piece);
            while let Ok(Some(record)) = reader.next() {
                let record: Record<'_> = record;
                if let Entry::Snapshot(bytes) = record.entry
                    && record.at >= *asked
                {
                    *config = of_snapshot(bytes);
                }
            }
        });
        if let Err(error) = drained {
            tracing::debug!(%error, "the bridge's journal cannot be received");
        }
    }
}

/// The configuration in a snapshot of this version's bridge.
fn of_snapshot(bytes: &[u8]) -> Option<BridgeConfig> {
    let Snapshot { config, bridge } = Snapshot::restore(bytes).ok()?;
    Some(BridgeConfig {
        fence: bridge.fence().clone(),
        ..config
    })
}

/// The configuration of the live bridge of the session's robot; `None` if there is none, or it does not say it within
/// `timeout`.
pub fn bridge(session: &Session, timeout: Duration) -> Result<Option<BridgeConfig>, Failure> {
    if !session.is_provided(BridgeJournal::KEY)? {
        return Ok(None);
    }
    let mut running = RunningBridge::open(&session.ipc).or_fail(ExitCode::Internal)?;
    let give_up = MonotonicNs::now() + timeout;
    session.gather(&mut running, give_up, |running, _| {
        Ok(running.config.is_some())
    })?;
    Ok(running.config)
}

/// The file that the live process `name` reads, if `provider` is that process itself, on this machine, and may be
/// looked at. A relay provides the same services with a configuration of its own.
pub fn file_of(provider: &Provider, name: &str, default_file: &str) -> Option<PathBuf> {
    if !is_own(provider, name) {
        return None;
    }
    let cwd = fs::read_link(format!("/proc/{}/cwd", provider.pid)).ok()?;
    let environment = words_of(provider, "environ").unwrap_or_default();
    let file = named_file(&words_of(provider, "cmdline")?, &environment);
    Some(cwd.join(file.unwrap_or_else(|| PathBuf::from(default_file))))
}

/// The command line of a live process on this machine, whose words take precedence over its configuration.
pub fn command_of(provider: &Provider) -> Option<String> {
    let words = words_of(provider, "cmdline").filter(|_| provider.shares_pids())?;
    let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    Some(words.join(" ").trim_end().to_owned())
}

/// The words in the file `name` that the kernel has of a process: each ends with a zero.
fn words_of(provider: &Provider, name: &str) -> Option<Vec<PathBuf>> {
    let bytes = fs::read(format!("/proc/{}/{name}", provider.pid)).ok()?;
    let words = bytes.split(|byte| *byte == 0);
    Some(words.map(|word| OsStr::from_bytes(word).into()).collect())
}

/// Whether a provider is the process `name` itself, with a number that means something here.
fn is_own(provider: &Provider, name: &str) -> bool {
    provider.process == name && provider.shares_pids()
}

/// The configuration that a command line or an environment names.
fn named_file(args: &[PathBuf], environment: &[PathBuf]) -> Option<PathBuf> {
    let value = |word: &PathBuf, prefix: &str| {
        let bytes = word.as_os_str().as_bytes();
        let value = bytes.strip_prefix(prefix.as_bytes())?;
        Some(OsStr::from_bytes(value).into())
    };
    let behind = args
        .iter()
        .position(|word| word == Path::new("--config"))
        .and_then(|place| args.get(place + 1).cloned());
    behind
        .or_else(|| args.iter().find_map(|word| value(word, "--config=")))
        .or_else(|| {
            environment
                .iter()
                .find_map(|word| value(word, "RIL_CONFIG="))
        })
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use bridge::Input;
    use bridge::journal::Journaled;
    use ipc_types::{Domain, RobotId, Waiter};
    use module_kit::journal::JournalPort;

    use super::*;

    /// One thread is both, so the bridge answers while the asker subscribes.
    #[test]
    fn an_answer_that_comes_while_the_program_subscribes_is_taken() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let mut journal = JournalPort::<BridgeJournal>::open(&ipc).unwrap();
        let config = BridgeConfig::default();
        let mut bridge = Journaled::new(&config, JournalPort::<BridgeJournal>::writer());
        let running = RunningBridge::open_with(|| {
            let port = ipc.subscriber()?;
            let serve: &mut [((), &mut dyn Source)] = &mut [((), journal.source())];
            Waiter::new().wait(serve, Some(Duration::ZERO)).unwrap();
            journal.follow(bridge.writer());
            let now = MonotonicNs::now();
            bridge.apply(now, Input::Advance, &mut ());
            journal.finish(bridge.writer(), MonotonicNs::now());
            Ok(port)
        });
        let mut running = running.unwrap();
        running.drain();
        assert_eq!(running.take(), Some(config));
    }

    #[test]
    fn the_configuration_of_a_relay_or_of_another_namespace_is_not_taken_for_that_of_the_bridge() {
        let here = fs::metadata("/proc/self/ns/pid").unwrap().ino();
        for (process, pid_namespace, expected) in [
            ("bridge", here, true),
            ("relay", here, false),
            ("bridge", here + 1, false),
        ] {
            let provider = Provider {
                pid: 1,
                process: process.to_owned(),
                since_ns: 1,
                pid_namespace,
                time_namespace: 0,
            };
            assert_eq!(is_own(&provider, "bridge"), expected, "{provider:?}");
        }
    }

    #[test]
    fn the_command_line_names_the_configuration_before_the_environment() {
        let check = |args: &str, environment: &str, expected: Option<&str>| {
            let words = |text: &str| text.split(' ').map(PathBuf::from).collect::<Vec<_>>();
            let found = named_file(&words(args), &words(environment));
            assert_eq!(found, expected.map(PathBuf::from), "{args} {environment}");
        };
        check("ril run bridge --config a.toml", "A=b", Some("a.toml"));
        check("ril run bridge --config=a b", "RIL_CONFIG=c", Some("a"));
        check("ril run bridge", "A=b RIL_CONFIG=/c", Some("/c"));
        check("ril run bridge", "A=b", None);
        check("ril run bridge --config", "A=b", None);
    }
}
