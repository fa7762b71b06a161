//! `ril replay`: the loop around the pure values of [`recording::play`]. One wait for keys, signals, requests, late
//! subscribers and the next message's moment.

mod journals;
pub mod options;
mod terminal;
mod verify;

use std::fmt;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::sync::Arc;

use ipc_types::domain::ROOT_VARIABLE;
use ipc_types::{
    Descriptor, Domain, DynamicError, Ipc, MonotonicNs, OpenError, RobotId, SchedulingRole, Source,
    Waiter, request_slice,
};
use operator::render::{json_line, note};
use operator::session::configuration;
use recording::play::{
    PROCESS, PlayableFlight, PlayedContent, PlayedServices, Player, Section, ServicesError,
};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;
use serde::Serialize;

use self::journals::kept_flight;
use self::options::ReplayArgs;
use self::terminal::{PlayerKey, ReplayKeys, ReplayScreen, ReplayedRequest};

/// Name of the layout of the JSON object at the end.
const SCHEMA: &str = "ril.Replay.v1";

/// Sources of the wait beside the services: signals and keys.
const OTHER_SOURCES: usize = 2;

/// What a wake-up is called.
#[derive(Clone, Copy, PartialEq, Eq)]
enum WakeKey {
    Keys,
    Other,
}

/// `ril replay FILE`, and with `--verify` or `--keep` what is in their files.
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has nothing in the section; 5 when the robot lives; 78 when
/// the configuration or `RIL_IPC_ROOT` is wrong.
pub fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    configuration(&args.common)?;
    if args.verifies() {
        return verify::verify(args);
    }
    if let Some(folder) = &args.keep {
        return verify::keep(args, folder);
    }
    if kept_flight(&args.file)?.is_some() {
        let text = format!(
            "{} is a kept flight: it has inputs, and no samples to play",
            args.file.display()
        );
        return Err(Failure::usage(text).with_next_step("drive the code with it: `--verify`"));
    }
    let flight = Arc::new(open(&args.file)?);
    let robot = args.common.robot.map_or(flight.robot(), RobotId::from);
    let section = Section {
        speed: args.speed,
        from: args.from,
        to: args.to,
        is_looped: args.is_looped,
    };
    // Before anything is provided: a section without messages is a usage error.
    let player = player(&flight, section)?;
    let domain = replay_domain()?;
    refuse_living(&domain, robot)?;
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let ipc = Ipc::join(&domain, robot, PROCESS).or_fail(ExitCode::Internal)?;
    let services =
        PlayedServices::open(&flight, &ipc).map_err(|error| not_provided(error, robot))?;
    request_slice(SchedulingRole::Provider);
    say_begin(&args.common, &flight, &services, &domain, robot);
    let mut replay = ReplayLoop {
        // The flight begins now that consumers can find it.
        player: Player::new(Arc::clone(player.flight()), section, MonotonicNs::now())
            .or_fail(ExitCode::Usage)?,
        services,
        termination,
        terminal: ReplayKeys::enter(),
        screen: ReplayScreen::new(args.json),
        waiter: Waiter::new(),
        summary: ReplaySummary {
            schema: SCHEMA,
            robot: robot.get(),
            ..ReplaySummary::default()
        },
    };
    replay.run()?;
    replay.end(args)
}

/// Reads the recording.
fn open(file: &Path) -> Result<PlayableFlight, Failure> {
    PlayableFlight::open(file).map_err(|error| {
        let text = format!("{} cannot be played: {error}", file.display());
        Failure::usage(text).with_next_step("name a recording that `ril record` has made")
    })
}

fn player(flight: &Arc<PlayableFlight>, section: Section) -> Result<Player, Failure> {
    Player::new(Arc::clone(flight), section, MonotonicNs(0)).map_err(|error| {
        Failure::usage(error).with_next_step("choose another time with --from and --to")
    })
}

/// Everything that the loop has.
struct ReplayLoop {
    player: Player,
    services: PlayedServices,
    termination: Termination,
    terminal: Option<ReplayKeys>,
    screen: ReplayScreen,
    waiter: Waiter,
    summary: ReplaySummary,
}

impl ReplayLoop {
    /// Until the end, a key or a signal.
    fn run(&mut self) -> Result<(), Failure> {
        let mut has_keys = false;
        while !self.termination.requested() {
            if has_keys && !self.take_keys() {
                break;
            }
            self.play()?;
            self.summary.refused_requests += self.services.service() as u64;
            self.screen
                .show(&self.player, MonotonicNs::now())
                .map_err(Failure::output)?;
            if self.player.is_ended() {
                break;
            }
            has_keys = self.wait()?;
        }
        self.screen.clear().map_err(Failure::output)
    }

    /// Does what the keys that came ask for; says whether to go on.
    fn take_keys(&mut self) -> bool {
        let Some(terminal) = &mut self.terminal else {
            return true;
        };
        let Some(player_keys) = terminal.read() else {
            // The terminal is gone: the replay goes on without keys.
            self.terminal = None;
            return true;
        };
        let now = MonotonicNs::now();
        for player_key in player_keys {
            match player_key {
                PlayerKey::Pause => self.player.toggle_pause(now),
                PlayerKey::Step => self.player.step(now),
                PlayerKey::Quit => return false,
            }
            self.screen.change();
        }
        true
    }

    /// Publishes what is due, and prints requests as they pass.
    fn play(&mut self) -> Result<(), Failure> {
        let now = MonotonicNs::now();
        while let Some(due) = self.player.next(now) {
            if let Some(PlayedContent::Request(message)) = self.player.flight().content(due.index) {
                let at = self.player.position_of(due.index);
                if let Some(request) = ReplayedRequest::read(message, at) {
                    self.summary.requests += 1;
                    self.screen.print(&request).map_err(Failure::output)?;
                }
                continue;
            }
            match self.services.publish(&due, MonotonicNs::now()) {
                Ok(is_published) => self.summary.samples += u64::from(is_published),
                Err(error) => tracing::warn!(%error, "a sample is missing in the replay"),
            }
        }
        self.summary.laps = self.player.laps();
        Ok(())
    }

    /// Sleeps until something comes or is due; says whether keys came.
    fn wait(&mut self) -> Result<bool, Failure> {
        let timeout = self
            .player
            .deadline()
            .map(|at| at.since(MonotonicNs::now()));
        let mut signals = Descriptor::new(self.termination.as_fd());
        let mut keys = self.terminal.as_ref().map(ReplayKeys::source);
        let mut sources: Vec<(WakeKey, &mut dyn Source)> = vec![(WakeKey::Other, &mut signals)];
        if let Some(keys) = &mut keys {
            sources.push((WakeKey::Keys, keys));
        }
        for source in self.services.sources(OTHER_SOURCES) {
            sources.push((WakeKey::Other, source));
        }
        let wake = self
            .waiter
            .wait(&mut sources, timeout)
            .or_fail(ExitCode::Internal)?;
        Ok(wake.has(WakeKey::Keys))
    }

    fn end(self, args: &ReplayArgs) -> Result<(), Failure> {
        // Gives the terminal back before anything is printed.
        drop(self.terminal);
        if args.json {
            let mut out = io::stdout().lock();
            json_line(&mut out, &self.summary)?;
            out.flush().map_err(Failure::output)?;
        }
        say(&args.common, &self.summary.to_string());
        Ok(())
    }
}

/// What was played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
struct ReplaySummary {
    schema: &'static str,
    robot: u32,
    /// Samples that were published.
    samples: u64,
    /// Recorded requests and reports that passed.
    requests: u64,
    /// Requests of live clients, all of which were refused.
    refused_requests: u64,
    /// How often the section was begun again.
    laps: u64,
}

impl fmt::Display for ReplaySummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} samples published, {} recorded requests and reports passed",
            self.samples, self.requests
        )?;
        match self.refused_requests {
            0 => Ok(()),
            refused => write!(f, "; {refused} requests were refused"),
        }
    }
}

/// Says on standard error what is played, where, and what is left out.
fn say_begin(
    args: &CommonArgs,
    flight: &PlayableFlight,
    services: &PlayedServices,
    domain: &Domain,
    robot: RobotId,
) {
    for left_out in flight.left_out().iter().chain(services.left_out()) {
        tracing::warn!(
            topic = left_out.topic,
            reason = left_out.reason,
            "not played"
        );
    }
    if let Some(error) = flight.errors().first() {
        let count = flight.errors().len();
        tracing::warn!(%error, count, "the file is damaged; what is whole is played");
    }
    let root = domain.root().display();
    let watch = format!("RIL_IPC_ROOT={root} ril watch --robot {robot}");
    say(
        args,
        &format!("robot {robot} is played in {root}; watch it with `{watch}`"),
    );
}

/// Says something to people on standard error, unless they want less.
fn say(args: &CommonArgs, text: &str) {
    if args.settings.quiet == 0 {
        note(text);
    }
}

/// The domain that `RIL_IPC_ROOT` names; else one for replays alone.
fn replay_domain() -> Result<Domain, Failure> {
    if std::env::var_os(ROOT_VARIABLE).is_some() {
        return Domain::from_environment().or_fail(ExitCode::Configuration);
    }
    let uid = rustix::process::geteuid().as_raw();
    Domain::new(Path::new(&format!("/dev/shm/hr{uid}"))).or_fail(ExitCode::Internal)
}

/// Refuses a robot of which any service has a live provider.
fn refuse_living(domain: &Domain, robot: RobotId) -> Result<(), Failure> {
    let mut services = domain.topics(robot);
    services.extend(domain.request_services(robot));
    let living = services.into_iter().find_map(|service| {
        let provider = service.provider?;
        Some((service.key, provider.process, provider.pid))
    });
    match living {
        None => Ok(()),
        Some((key, process, pid)) => {
            let text = format!(
                "robot {robot} lives in {}: `{process}` (process {pid}) provides {key}; nothing is played onto it",
                domain.root().display()
            );
            Err(lives(text, robot))
        }
    }
}

/// The services cannot be provided.
fn not_provided(error: ServicesError, robot: RobotId) -> Failure {
    match error {
        ServicesError::Topic(DynamicError::Open(error @ OpenError::AlreadyProvided { .. }))
        | ServicesError::Requests(error @ OpenError::AlreadyProvided { .. }) => {
            lives(error.to_string(), robot)
        }
        error => Failure::internal(error),
    }
}

fn lives(text: String, robot: RobotId) -> Failure {
    let other = robot.get().wrapping_add(1).max(1);
    Failure::new(ExitCode::Refused, text).with_next_step(format!(
        "play it as another robot with --robot {other}, or unset RIL_IPC_ROOT: then it has shared memory of its own"
    ))
}
