//! `ril relay`: starts the program `ril-relay` in its place, and shows how the links of a relay are.
//!
//! The relay is a program of its own, because its network library takes longer to build than all of the rest.
//! `LinkWatch` tells other commands whether what they show comes from another machine.

use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process;
use std::time::Duration;

use ipc_types::payload::{RelayLink, RelayStations};
use ipc_types::{MonotonicNs, Source};
use runtime::duration::Shown;
use runtime::exit::{ExitCode, Failure};

use super::latest::Latest;
use super::relay_report::RelayReport;
use super::{Session, configuration, is_relayed, json_line, robot};
use crate::cli::{RelayArgs, RelayCommand, RelayStatusArgs};

/// The relay's program.
const PROGRAM: &str = "ril-relay";

/// `ril relay`
///
/// # Errors
///
/// Code 1 when the program cannot be started; of `ril relay status` those of [`status()`]. It does not return when the program
/// was started: this process is then the relay.
pub fn relay(args: &RelayArgs) -> Result<(), Failure> {
    match &args.command {
        Some(RelayCommand::Status(args)) => status(args),
        None => {
            let program = program_beside(std::env::current_exe().ok().as_deref());
            let error = process::Command::new(&program).args(&args.args).exec();
            Err(Failure::internal(not_started(&program, &error)))
        }
    }
}

/// The relay's program beside this one; without it a bare name, for which the operating system looks in PATH.
fn program_beside(this: Option<&Path>) -> PathBuf {
    let beside = this.map(|this| this.with_file_name(PROGRAM));
    beside
        .filter(|path| path.is_file())
        .unwrap_or_else(|| PROGRAM.into())
}

fn not_started(program: &Path, error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound {
        format!(
            "there is no `{PROGRAM}`, neither beside `ril` nor in PATH: it is a program of its own, `cargo install --path gateways/relay` \
             builds and installs it"
        )
    } else {
        format!("{} cannot be started: {error}", program.display())
    }
}

/// `ril relay status`
///
/// # Errors
///
/// Code 3 when there is no relay, 4 when it publishes nothing, 6 when the link to the robot is not up, or on a robot's machine
/// no station is.
pub fn status(args: &RelayStatusArgs) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
    let session = Session::join(&args.common)?;
    let mut newest = Newest::open(&session)?;
    let give_up = MonotonicNs::now() + timeout;
    while !newest.is_complete() && MonotonicNs::now() < give_up {
        if session.termination.requested() {
            return Ok(());
        }
        session.wait(newest.ports(), Some(give_up))?;
        newest.drain();
    }
    let (link, stations) = newest.samples();
    if link.is_none() && stations.is_none() {
        let text = format!(
            "nothing came from the relay of robot {} in {}, although it is running",
            session.ipc.robot(),
            Shown(timeout)
        );
        return Err(Failure::new(ExitCode::Timeout, text).with_next_step(
            "`ril doctor` shows whether it is stopped; is the machine overloaded?",
        ));
    }
    let report = RelayReport::new(session.ipc.robot(), link, stations, MonotonicNs::now());
    let mut out = io::stdout().lock();
    if args.json {
        json_line(&mut out, &report)?;
    } else {
        write!(out, "{report}").map_err(Failure::output)?;
    }
    match report.exit_code() {
        ExitCode::Ok => Ok(()),
        code => Err(Failure::new(code, report.trouble())),
    }
}

/// The newest samples of the topics that the relay here provides.
struct Newest {
    link: Option<Latest<RelayLink>>,
    stations: Option<Latest<RelayStations>>,
}

impl Newest {
    fn open(session: &Session) -> Result<Newest, Failure> {
        let newest = Newest {
            link: Latest::open_if_provided(session)?,
            stations: Latest::open_if_provided(session)?,
        };
        if newest.link.is_none() && newest.stations.is_none() {
            let robot = session.ipc.robot();
            let text = format!(
                "no relay of robot {robot} is running here{}{}",
                robot::others_alive(robot),
                robot::other_domains()
            );
            return Err(Failure::new(ExitCode::ServiceAbsent, text)
                .with_next_step("start `ril relay` and try again"));
        }
        Ok(newest)
    }

    fn ports(&mut self) -> impl Iterator<Item = &mut dyn Source> {
        let link = self.link.as_mut().map(|link| &mut link.port as _);
        let stations = self.stations.as_mut();
        link.into_iter()
            .chain(stations.map(|stations| &mut stations.port as _))
    }

    fn drain(&mut self) {
        self.link.as_mut().map(Latest::drain);
        self.stations.as_mut().map(Latest::drain);
    }

    fn samples(&self) -> (Option<&RelayLink>, Option<&RelayStations>) {
        let link = self.link.as_ref().and_then(|link| link.sample.as_ref());
        let stations = self.stations.as_ref();
        (link, stations.and_then(|stations| stations.sample.as_ref()))
    }

    fn is_complete(&self) -> bool {
        let (link, stations) = self.samples();
        link.is_some() == self.link.is_some() && stations.is_some() == self.stations.is_some()
    }
}

/// Whether a topic comes from another machine, and how the link to that machine is.
#[derive(Default)]
pub(super) struct LinkWatch {
    /// Nothing as long as the topic was not seen to come from the relay.
    link: Option<Latest<RelayLink>>,
    is_relayed: bool,
}

impl LinkWatch {
    /// Looks which process provides the topic `key`. While none does, the last answer holds.
    pub fn look(&mut self, session: &Session, key: &str) -> Result<(), Failure> {
        if let Some(provider) = session.provider(key)? {
            self.is_relayed = is_relayed(key, &provider);
        }
        if self.is_relayed && self.link.is_none() {
            self.link = Latest::open_if_provided(session)?;
        }
        Ok(())
    }

    /// Whether the topic comes from another machine.
    pub fn is_relayed(&self) -> bool {
        self.is_relayed
    }

    /// The port to wait for, as long as the link's sample is missing that can be expected.
    pub fn port(&mut self) -> Option<&mut dyn Source> {
        let link = self.link.as_mut().filter(|_| self.is_relayed)?;
        Some(&mut link.port)
    }

    /// Takes what came.
    pub fn drain(&mut self) {
        if let Some(link) = &mut self.link {
            link.drain();
        }
    }

    /// Whether the link's sample is still to come.
    pub fn is_missing(&self) -> bool {
        let link = self.link.as_ref().filter(|_| self.is_relayed);
        link.is_some_and(|link| link.sample.is_none())
    }

    /// The newest sample of the link; nothing when the topic is of this machine, or when none came.
    pub fn newest(&self) -> Option<&RelayLink> {
        let link = self.link.as_ref().filter(|_| self.is_relayed)?;
        link.sample.as_ref()
    }

    /// Waits for the link's sample, at most so long.
    pub fn wait(&mut self, session: &Session, timeout: Duration) -> Result<(), Failure> {
        let give_up = MonotonicNs::now() + timeout;
        self.drain();
        while self.is_missing() && MonotonicNs::now() < give_up && !session.termination.requested()
        {
            session.wait(self.port(), Some(give_up))?;
            self.drain();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_program_beside_it_is_looked_for_in_path() {
        let nowhere = Path::new("/nowhere/ril");
        assert_eq!(program_beside(Some(nowhere)), Path::new(PROGRAM));
        assert_eq!(program_beside(None), Path::new(PROGRAM));
    }

    #[test]
    fn a_missing_program_is_named_with_how_it_is_built() {
        let missing = not_started(Path::new(PROGRAM), &io::ErrorKind::NotFound.into());
        assert!(
            missing.contains("`cargo install --path gateways/relay`"),
            "{missing}"
        );
        let forbidden = not_started(
            Path::new("/opt/ril-relay"),
            &io::ErrorKind::PermissionDenied.into(),
        );
        assert!(
            forbidden.starts_with("/opt/ril-relay cannot be started: "),
            "{forbidden}"
        );
    }
}
