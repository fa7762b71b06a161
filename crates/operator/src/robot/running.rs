//! What the live processes of a robot run with. `RunningBridge`: the configuration of a live bridge, as it publishes
//! it. `file_of`, `command_of`: the file that a live process has read, and its command line.
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
use ipc_types::configuration::{BridgeConfiguration, ConfigurationReader};
use ipc_types::{Ipc, MonotonicNs, OpenError, Provider, Source, Subscriber, Topic};
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

/// The configuration of a live bridge, as it publishes it to each program that comes.
pub struct RunningBridge {
    port: Subscriber<BridgeConfiguration>,
    reader: ConfigurationReader,
    config: Option<BridgeConfig>,
}

impl RunningBridge {
    /// Subscribes to the bridge's configuration.
    ///
    /// # Errors
    ///
    /// See [`OpenError`].
    pub fn open(ipc: &Ipc) -> Result<RunningBridge, OpenError> {
        Ok(RunningBridge {
            port: ipc.subscriber()?,
            reader: ConfigurationReader::new(),
            config: None,
        })
    }

    /// The configuration, if one has come since the last call.
    pub fn take(&mut self) -> Option<BridgeConfig> {
        self.config.take()
    }

    /// The configuration with the fence that is in force; `None` if the bridge does not publish it within `timeout`.
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
        let (reader, config) = (&mut self.reader, &mut self.config);
        let drained = self.port.drain(|piece| {
            if reader.take(piece) {
                *config = reader.text().and_then(of_text);
            }
        });
        if let Err(error) = drained {
            tracing::debug!(%error, "the bridge's configuration cannot be received");
        }
    }
}

/// The configuration that a bridge publishes; `None` of one of another version, which has other settings.
fn of_text(text: &str) -> Option<BridgeConfig> {
    let config = runtime::config::parse(text, BridgeConfiguration::KEY);
    config
        .inspect_err(|error| tracing::debug!(%error, "the bridge's configuration is not known"))
        .ok()
}

/// The configuration of the live bridge of the session's robot; `None` if there is none, or it does not publish it
/// within `timeout`.
pub fn bridge(session: &Session, timeout: Duration) -> Result<Option<BridgeConfig>, Failure> {
    if !session.is_provided(BridgeConfiguration::KEY)? {
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

/// The value of a variable in an environment; an empty one is not set.
fn value_in(environment: &[PathBuf], variable: &str) -> Option<PathBuf> {
    let value = |word: &PathBuf| {
        let rest = word
            .as_os_str()
            .as_bytes()
            .strip_prefix(variable.as_bytes())?;
        let value = rest.strip_prefix(b"=").filter(|value| !value.is_empty())?;
        Some(OsStr::from_bytes(value).into())
    };
    environment.iter().find_map(value)
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
        .or_else(|| value_in(environment, "RIL_CONFIG"))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use ipc_types::configuration::{ConfigurationText, OfBridge};
    use ipc_types::{Domain, RobotId, Waiter};
    use module_kit::configuration::ConfigurationPort;

    use super::*;

    /// One thread is both, so the bridge publishes while the other one subscribes.
    #[test]
    fn each_one_that_comes_gets_the_configuration_and_what_it_becomes() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let mut config = BridgeConfig::default();
        config.serial.port = "/tmp/dsp".into();
        let text = |config: &BridgeConfig| ConfigurationText::new(config.to_toml());
        let mut bridge = ConfigurationPort::<OfBridge>::open(&ipc, text(&config)).unwrap();
        let mut now = MonotonicNs::now();
        let mut publish = |bridge: &mut ConfigurationPort<OfBridge>| {
            let serve: &mut [((), &mut dyn Source)] = &mut [((), bridge.source())];
            Waiter::new().wait(serve, Some(Duration::ZERO)).unwrap();
            now = now + Duration::from_millis(20);
            bridge.publish(now);
        };
        let mut first = RunningBridge::open(&ipc).unwrap();
        publish(&mut bridge);
        let mut second = RunningBridge::open(&ipc).unwrap();
        publish(&mut bridge);
        let take = |running: &mut RunningBridge| {
            running.drain();
            running.take()
        };
        assert_eq!(take(&mut first).as_ref(), Some(&config));
        assert_eq!(take(&mut second).as_ref(), Some(&config));
        config.safety.supply_for_s = 7.0;
        bridge.replace(text(&config));
        publish(&mut bridge);
        assert_eq!(take(&mut first), Some(config));
        publish(&mut bridge);
        assert_eq!(take(&mut first), None, "nothing is new");
        bridge.replace(ConfigurationText::new("[radar]\n".to_owned()));
        publish(&mut bridge);
        assert_eq!(take(&mut first), None, "of another version");
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
        check("ril run bridge", "RIL_CONFIG= RIL_CONFIGS=c", None);
        check("ril run bridge --config", "A=b", None);
    }
}
