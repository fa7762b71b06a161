//! `ril watch`: the loop around pure values, into which samples, keys and the time go and out of which comes a screen.
//! One wait for the terminal, signals, ports and the next moment at which the screen changes.
//!
//! * [`model`]: one robot, fed with samples by its ports, as for the page of `ril view`;
//! * [`app`]: all robots, which of them is selected, and what a key does: orders are confirmed by a word;
//! * [`view`]: draws all of that into a buffer;
//! * `terminal`: the shell.

pub mod app;
#[cfg(test)]
mod fixture;
mod terminal;
pub mod view;

use std::io::{self, IsTerminal};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use clap::{ArgAction, Args};
use ipc_types::{Descriptor, Domain, MonotonicNs, RobotId, Source, Waiter, allow_many_files};
use operator::config::RequestConfig;
use operator::options::EXIT_CODES;
use operator::render::note;
use operator::render::terminal::read_keys;
use operator::request::ports::{self, RobotPorts};
use operator::robot::clock::{Clocks, WallClock};
use operator::robot::{chart, model};
use operator::session::{alive, configuration};
use ratatui::buffer::Buffer;
use runtime::args::{CommonArgs, SettingsArgs, robot};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;
use terminal::Terminal;

use self::app::{App, KeyAction, MAX_ROBOTS};
use self::view::Glyphs;

/// `ril watch`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct WatchArgs {
    /// Which robot; can be given up to 64 times, or as 1,2,5 [default: all robots that are alive, or robot 1]
    #[arg(long = "robot", value_name = "N", env = "RIL_ROBOT", value_delimiter = ',', value_parser = robot)]
    pub robots: Vec<NonZeroU32>,

    /// Draw the geofence of this configuration of the bridge [default: the one in force, and the path that is flown;
    /// without a live bridge that of bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Draw the path of this plan on the map while no path is flown; a file as for `ril plan`
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,

    /// Do not ring the terminal's bell when an alarm begins
    #[arg(long)]
    pub no_bell: bool,

    /// Draw with ASCII characters only
    #[arg(long)]
    pub ascii: bool,

    /// Configuration file; it must exist when it is named here
    #[arg(long, value_name = "FILE", env = "RIL_CONFIG")]
    pub config: Option<PathBuf>,

    /// Say more: -v debug, -vv trace; only when standard error is not the terminal
    #[arg(short, long, action = ArgAction::Count)]
    pub verbose: u8,

    /// Say less: -q warnings, -qq errors, -qqq nothing
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "verbose")]
    pub quiet: u8,

    /// Check the configuration and end: exit code 0, or 78 with file, line and reason
    #[arg(long)]
    pub check_config: bool,
}

impl WatchArgs {
    /// What every process takes. `is_quiet` says that a log would be written across the screen.
    pub fn common(&self, is_quiet: bool) -> CommonArgs {
        /// How many `-q` silence the log.
        const NOTHING: u8 = 3;
        CommonArgs {
            robot: self.robots.first().copied(),
            settings: SettingsArgs {
                config: self.config.clone(),
                verbose: if is_quiet { 0 } else { self.verbose },
                quiet: if is_quiet { NOTHING } else { self.quiet },
                check_config: self.check_config,
            },
        }
    }
}

/// Shortest time between two drawings: what the eye can follow, and what a slow line carries. In that time samples wake
/// nothing.
const REDRAW_PERIOD: Duration = Duration::from_millis(100);

/// The clock is drawn each second: a wait that took longer than this was of a process that stood still. Keys may have
/// come long before.
const STALL: Duration = Duration::from_millis(1400);

/// What a wake-up of the terminal is called.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Woken {
    Keys,
    Other,
}

/// `ril watch`
///
/// # Errors
///
/// Code 2 when standard input or output is no terminal, or one that cannot be drawn on; 78 when the configuration is
/// wrong.
pub fn watch(args: &WatchArgs) -> Result<(), Failure> {
    let common = args.common(io::stderr().is_terminal());
    let config = configuration(&common)?;
    terminal::refuse_others()?;
    let chart = chart::of_files(args.bridge.as_deref(), args.plan.as_deref())?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let robots = robots(args, &domain)?;
    allow_many_files();
    let mut ports = Vec::new();
    for robot in &robots {
        ports.push(RobotPorts::open(&domain, *robot, args.bridge.is_none())?);
    }
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let terminal = Terminal::enter().or_fail_with(
        ExitCode::Internal,
        "the terminal cannot be taken: try `ril status --watch`",
    )?;
    let screen = Screen {
        app: App::new(&robots, chart),
        ports,
        terminal,
        termination,
        waiter: Waiter::new(),
        requests: config.request,
        glyphs: if args.ascii || is_console() {
            Glyphs::Ascii
        } else {
            Glyphs::Unicode
        },
        has_bell: !args.no_bell,
        is_changed: true,
        next_drawing: MonotonicNs(0),
        shown_second: 0,
        waits_since: MonotonicNs::now(),
        wall_clock: WallClock::default(),
    };
    screen.run()
}

/// Linux's own console has few characters.
fn is_console() -> bool {
    std::env::var_os("TERM").is_some_and(|term| term == "linux")
}

/// The robots that are named, or else those that are alive.
fn robots(args: &WatchArgs, domain: &Domain) -> Result<Vec<RobotId>, Failure> {
    let mut robots: Vec<RobotId> = Vec::new();
    let named = args.robots.iter().copied().map(RobotId::from);
    for robot in named {
        if !robots.contains(&robot) {
            robots.push(robot);
        }
    }
    if robots.is_empty() {
        robots = alive(domain).or_fail(ExitCode::Internal)?;
        if robots.len() > MAX_ROBOTS {
            let alive = robots.len();
            note(format_args!(
                "{alive} robots are alive, of which the first {MAX_ROBOTS} are watched: name others with --robot"
            ));
            robots.truncate(MAX_ROBOTS);
        }
    }
    if robots.len() > MAX_ROBOTS {
        let text = format!(
            "{} robots are named, and a screen has {MAX_ROBOTS}",
            robots.len()
        );
        return Err(Failure::usage(text));
    }
    if robots.is_empty() {
        robots.push(RobotId::DEFAULT);
    }
    Ok(robots)
}

/// Everything that the loop has.
struct Screen {
    app: App,
    /// At the places of the app's robots.
    ports: Vec<RobotPorts>,
    terminal: Terminal,
    termination: Termination,
    waiter: Waiter,
    requests: RequestConfig,
    glyphs: Glyphs,
    has_bell: bool,
    /// Whether there is something that is not drawn yet.
    is_changed: bool,
    next_drawing: MonotonicNs,
    /// The second of the clock that is drawn.
    shown_second: u64,
    /// When the last wait began: the keys that had come before were read.
    waits_since: MonotonicNs,
    wall_clock: WallClock,
}

impl Screen {
    /// Until a key, a signal or the end of the terminal.
    fn run(mut self) -> Result<(), Failure> {
        let mut has_keys = false;
        while !self.termination.requested() && !self.terminal.is_gone() {
            if has_keys && !self.take_keys()? {
                break;
            }
            self.take_samples();
            let now = MonotonicNs::now();
            self.app.judge(now);
            self.ring();
            if self.terminal.take_resize() {
                self.is_changed = true;
                self.next_drawing = now;
            }
            let (clock, _) = self.wall_clock.look(now);
            self.is_changed |= clock.unix_s(now) != self.shown_second;
            if self.is_changed && now >= self.next_drawing {
                self.draw(clock);
            }
            has_keys = self.wait(clock)?;
        }
        Ok(())
    }

    /// Does what the keys that came ask for; says whether to go on.
    fn take_keys(&mut self) -> Result<bool, Failure> {
        let Some(keys) = read_keys() else {
            return Ok(false);
        };
        let now = MonotonicNs::now();
        let has_stalled = now.since(self.waits_since) > STALL;
        let pressed = if has_stalled { self.waits_since } else { now };
        for key in keys {
            self.is_changed = true;
            let now = MonotonicNs::now();
            match self.app.key(key, now) {
                KeyAction::None => {}
                KeyAction::Quit => return Ok(false),
                KeyAction::Redraw => self.terminal.forget(),
                // What was typed with it is dropped: it is not the shell's, and not meant for the screen of later.
                KeyAction::Suspend if self.terminal.suspend() => break,
                KeyAction::Suspend => {}
                KeyAction::Send(index, order) => {
                    let robot = &mut self.app.robots_mut()[index];
                    // What is not sent is in the journal.
                    let sent = &mut self.ports[index];
                    let _ = sent.send(order.into(), pressed, &self.requests, robot, now)?;
                }
            }
        }
        Ok(true)
    }

    /// Takes everything that is there, and looks for processes that are overdue.
    fn take_samples(&mut self) {
        let now = MonotonicNs::now();
        for (ports, robot) in self.ports.iter_mut().zip(self.app.robots_mut()) {
            self.is_changed |= ports.drain(robot, now);
            self.is_changed |= ports.look(robot, now);
        }
    }

    fn ring(&mut self) {
        if self.app.take_bells() > 0 && self.has_bell {
            self.terminal.ring();
        }
    }

    fn draw(&mut self, clock: Clocks) {
        let mut buffer = Buffer::empty(self.terminal.area());
        view::draw(&self.app, clock, self.glyphs, &mut buffer);
        // A terminal that has not taken the last picture gets the next one later.
        if self.terminal.show(buffer) {
            self.is_changed = false;
            self.shown_second = clock.unix_s(clock.now);
        }
        self.next_drawing = clock.now + REDRAW_PERIOD;
    }

    /// Sleeps until something comes or the screen changes; says whether keys came.
    fn wait(&mut self, clock: Clocks) -> Result<bool, Failure> {
        let now = clock.now;
        let until = self.wake_at(clock);
        self.waits_since = MonotonicNs::now();
        let is_drawing_due = self.is_changed;
        let selected = self.app.selected;
        let mut signals = Descriptor::new(std::os::fd::AsFd::as_fd(&self.termination));
        let (mut keys, mut resizes) = self.terminal.sources();
        let mut sources: Vec<(Woken, &mut dyn Source)> = vec![
            (Woken::Other, &mut signals),
            (Woken::Keys, &mut keys),
            (Woken::Other, &mut resizes),
        ];
        for (index, ports) in self.ports.iter_mut().enumerate() {
            let detail = match (is_drawing_due, index == selected) {
                // What comes until the next drawing is drawn with it, and need not wake.
                (true, _) => ports::Wakers::Orders,
                (false, true) => ports::Wakers::All,
                (false, false) => ports::Wakers::State,
            };
            for port in ports.sources(
                detail,
                self.app.robots[index].process(model::Process::Status, now),
            ) {
                sources.push((Woken::Other, port));
            }
        }
        let timeout = until.since(MonotonicNs::now());
        let woken = self
            .waiter
            .wait_for_any(&mut sources, Some(timeout))
            .or_fail(ExitCode::Internal)?;
        Ok(woken.contains(&Woken::Keys))
    }

    /// When the screen changes although nothing comes.
    fn wake_at(&self, clock: Clocks) -> MonotonicNs {
        let now = clock.now;
        let drawing = self.is_changed.then_some(self.next_drawing);
        let orders = self.ports.iter().filter_map(RobotPorts::next);
        let second_ns = 1_000_000_000;
        let passed_ns = clock.unix_ns(now) % second_ns;
        let second = now + Duration::from_nanos(second_ns - passed_ns);
        let app = self.app.next(now);
        drawing
            .into_iter()
            .chain(orders)
            .chain(app)
            .fold(second, MonotonicNs::min)
    }
}
