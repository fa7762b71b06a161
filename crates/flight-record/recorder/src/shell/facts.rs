//! [`FactsOfRobot`]: what the files say of the flight, as far as they can be had: when the recording begins, and again
//! when a process comes or goes.

use std::collections::BTreeMap;
use std::fs;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;

use ipc_types::{Ipc, Provider, RobotId, ServiceId};
use operator::robot::running::{command_of, file_of};
use recording::{Anchor, Attachment, FlightInfo};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::helper::{Helper, HelperGone};

use crate::cli::RecordArgs;

/// A process whose configuration is recorded.
struct Configured {
    /// The process' name.
    name: &'static str,
    /// A service that it provides.
    service: ServiceId,
    /// The file that it reads when none is named.
    default_file: &'static str,
}

const CONFIGURED: [Configured; 2] = [
    Configured {
        name: "bridge",
        service: ServiceId::DspTelemetry,
        default_file: bridge::cli::DEFAULT_CONFIG_FILE,
    },
    Configured {
        name: "status",
        service: ServiceId::HeroTelemetry,
        default_file: status::config::DEFAULT_FILE,
    },
];

/// What is known of a robot, its processes and this machine.
pub(crate) struct FactsOfRobot {
    ipc: Ipc,
    /// When the recording began.
    start: Anchor,
    /// Configurations that were named, by process.
    named: BTreeMap<&'static str, PathBuf>,
    facts: RecordFacts,
    /// Looks at processes: reads a disk.
    thread: Helper<Vec<ProcessLook>, Vec<FoundFacts>>,
    /// Whether it has something to do.
    is_looking: bool,
    /// Whether a process came meanwhile.
    is_due: bool,
}

impl FactsOfRobot {
    /// Of the robot of `ipc`, with what `args` name.
    ///
    /// # Errors
    ///
    /// Code 78 when a configuration that was named cannot be read; 1 when the system grants no thread.
    pub fn gather(ipc: Ipc, args: &RecordArgs, start: Anchor) -> Result<FactsOfRobot, Failure> {
        let look = |looks: Vec<ProcessLook>| looks.into_iter().map(ProcessLook::take).collect();
        let thread = Helper::start("facts", 1, look);
        let named = [("bridge", &args.bridge), ("status", &args.status)];
        let named = named.into_iter();
        let mut robot = FactsOfRobot {
            ipc,
            start,
            named: named
                .filter_map(|(name, file)| Some((name, file.clone()?)))
                .collect(),
            facts: RecordFacts {
                host: text_of("/proc/sys/kernel/hostname"),
                boot_id: text_of("/proc/sys/kernel/random/boot_id"),
                ..RecordFacts::default()
            },
            thread: thread.or_fail(ExitCode::Internal)?,
            is_looking: false,
            is_due: false,
        };
        for process in &CONFIGURED {
            let found = robot.look(process).take();
            robot.add(found)?;
        }
        Ok(robot)
    }

    /// Has the processes looked at, one of which has come. What is known of one that went stays.
    pub fn look_again(&mut self) {
        self.is_due = self.is_looking;
        let looks = self.new_looks();
        if !self.is_looking && !looks.is_empty() {
            self.is_looking = self.thread.give(looks).is_ok();
        }
    }

    /// Takes what the looks have found, and says whether there is something new. Never waits.
    ///
    /// # Errors
    ///
    /// The thread is gone.
    pub fn take_found(&mut self) -> Result<bool, HelperGone> {
        // Asked at each wake of the loop, so it costs no system call while nothing is looked at.
        if !self.is_looking {
            return Ok(false);
        }
        let Some(found) = self.thread.take()? else {
            return Ok(false);
        };
        self.is_looking = false;
        for found in found {
            if let Err(failure) = self.add(found) {
                let reason = failure.chain().join(": ");
                tracing::warn!(reason, "the configuration is not recorded");
            }
        }
        if self.is_due {
            self.look_again();
        }
        Ok(true)
    }

    fn new_looks(&self) -> Vec<ProcessLook> {
        let looks = CONFIGURED.iter().map(|process| self.look(process));
        let is_new = |look: &ProcessLook| {
            let provider = look.provider.as_ref();
            provider.is_some_and(|provider| {
                self.facts.processes.get(&provider.process) != Some(&provider.pid)
            })
        };
        looks.filter(is_new).collect()
    }

    fn look(&self, process: &'static Configured) -> ProcessLook {
        let provider = self.ipc.provider(process.service.key());
        ProcessLook {
            process,
            provider: provider.ok().flatten(),
            named: self.named.get(process.name).cloned(),
        }
    }

    /// Adds what a look has found.
    ///
    /// # Errors
    ///
    /// Code 78 when the configuration was named and cannot be read; the rest is added.
    fn add(&mut self, found: FoundFacts) -> Result<(), Failure> {
        self.facts.processes.extend(found.process);
        self.facts.commands.extend(found.command);
        self.facts.files.extend(found.file?);
        Ok(())
    }

    /// What each file says of the flight, with these layouts by topic, and with files that say what the processes run
    /// with.
    pub fn flight_info(
        &self,
        layouts: BTreeMap<String, String>,
        running: &BTreeMap<String, Vec<u8>>,
    ) -> FlightInfo {
        let mut facts = RecordFacts {
            layouts,
            ..self.facts.clone()
        };
        facts.files.extend(running.clone());
        facts.flight_info(self.ipc.robot(), self.start)
    }
}

/// Readable when looks are over.
impl AsFd for FactsOfRobot {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }
}

/// What a look has found, each by its name.
struct FoundFacts {
    process: Option<(String, u32)>,
    command: Option<(String, String)>,
    file: Result<Option<(String, Vec<u8>)>, Failure>,
}

/// A look at a process and at its configuration. It reads a disk, and what the kernel says of the process: it may take
/// as long as those like.
struct ProcessLook {
    process: &'static Configured,
    provider: Option<Provider>,
    named: Option<PathBuf>,
}

impl ProcessLook {
    /// Looks.
    fn take(self) -> FoundFacts {
        let name = self.provider.as_ref().map(|one| one.process.clone());
        FoundFacts {
            process: name.clone().zip(self.provider.as_ref().map(|one| one.pid)),
            command: name.zip(self.provider.as_ref().and_then(command_of)),
            file: self.file(),
        }
    }

    /// The configuration, by the name that it has in the record.
    fn file(&self) -> Result<Option<(String, Vec<u8>)>, Failure> {
        let Configured {
            name, default_file, ..
        } = self.process;
        let provider = self.provider.as_ref();
        let running = provider.and_then(|provider| file_of(provider, name, default_file));
        let is_running = running.is_some();
        let file = self.named.clone().or(running);
        let file = file.unwrap_or_else(|| PathBuf::from(default_file));
        match fs::read(&file) {
            Ok(text) => Ok(Some((format!("{name}.toml"), text))),
            Err(error) if self.named.is_some() => Err(error)
                .or_fail(ExitCode::Configuration)
                .map_err(|failure| failure.context(file.display().to_string())),
            // It runs with what is built in, if it runs.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && !is_running => Ok(None),
            Err(error) => {
                tracing::warn!(file = %file.display(), %error, "the configuration is not recorded");
                Ok(None)
            }
        }
    }
}

/// The text of a file of the kernel's; empty when it cannot be read.
fn text_of(file: &str) -> String {
    let text = fs::read_to_string(file).unwrap_or_default();
    text.trim().to_owned()
}

/// Name of the record with versions, robot, machine and the clocks at the start.
pub const FLIGHT: &str = "ril.flight";

/// Name of the record with the layout of each topic that was there when the record was written, by topic: type and
/// hash.
pub const LAYOUTS: &str = "ril.layouts";

/// What is known of the robot at a moment.
#[derive(Clone, Debug, Default)]
pub struct RecordFacts {
    /// Name of the machine.
    pub host: String,
    /// The machine's boot: monotonic times of two recordings can be compared only within one.
    pub boot_id: String,
    /// Live processes of the robot, by name: process id.
    pub processes: BTreeMap<String, u32>,
    /// Their command lines.
    pub commands: BTreeMap<String, String>,
    /// Layout and hash by topic.
    pub layouts: BTreeMap<String, String>,
    /// Files that are recorded along, by name.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl RecordFacts {
    /// What the recorder writes into each file.
    pub fn flight_info(self, robot: RobotId, start: Anchor) -> FlightInfo {
        let mut flight: BTreeMap<String, String> = [
            ("robot", robot.to_string()),
            ("ril_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("host", self.host),
            ("boot_id", self.boot_id),
            ("start_monotonic_ns", start.monotonic.0.to_string()),
            ("start_unix_ns", start.unix_ns.to_string()),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into();
        for (process, pid) in self.processes {
            flight.insert(format!("pid.{process}"), pid.to_string());
        }
        for (process, command) in self.commands {
            flight.insert(format!("command.{process}"), command);
        }
        let attachment = |(name, data): (String, Vec<u8>)| Attachment {
            media_type: "application/toml".to_owned(),
            name,
            data,
        };
        FlightInfo {
            robot,
            metadata: vec![
                (FLIGHT.to_owned(), flight),
                (LAYOUTS.to_owned(), self.layouts),
            ],
            attachments: self.files.into_iter().map(attachment).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::MonotonicNs;

    use super::*;

    #[test]
    fn a_file_says_which_robot_machine_and_version_it_is_of() {
        let facts = RecordFacts {
            host: "field".to_owned(),
            processes: [("bridge".to_owned(), 812)].into(),
            files: [("bridge.toml".to_owned(), b"x = 1".to_vec())].into(),
            ..RecordFacts::default()
        };
        let start = Anchor {
            monotonic: MonotonicNs(5),
            unix_ns: 7,
        };
        let info = facts.flight_info(RobotId::new(3).unwrap(), start);
        let (name, flight) = &info.metadata[0];
        assert_eq!(name, FLIGHT);
        for (key, expected) in [
            ("robot", "3"),
            ("ril_version", env!("CARGO_PKG_VERSION")),
            ("host", "field"),
            ("start_monotonic_ns", "5"),
            ("start_unix_ns", "7"),
            ("pid.bridge", "812"),
        ] {
            assert_eq!(flight.get(key).map(String::as_str), Some(expected), "{key}");
        }
        assert_eq!(info.attachments[0].name, "bridge.toml");
        assert_eq!(info.attachments[0].data, b"x = 1");
    }
}
