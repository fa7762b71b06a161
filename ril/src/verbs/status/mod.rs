//! `ril status`: the newest state and telemetry, each with its age, once or as they change.

pub mod report;

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, SystemTime};

use clap::Args;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayStations};
use ipc_types::{MonotonicNs, Source, StateOf, StatusModule, Topic};
use operator::options::SampleArgs;
use operator::render::terminal::{Block, Size};
use operator::render::words::time_of_day;
use operator::render::{json_line, print};
use operator::robot::absence::{absent, nothing_came};
use operator::robot::controller::own_session;
use operator::robot::freshness::is_present;
use operator::robot::pilot::PilotView;
use operator::robot::relay_link::{LinkReport, LinkWatch};
use operator::session::{Latest, Session, Topics};
use runtime::exit::{ExitCode, Failure};

use self::report::text::fitted;
use self::report::{Samples, StateReport, is_module_old};

/// `ril status`
#[derive(Args, Clone, Debug)]
pub struct StatusArgs {
    /// What every command takes that shows samples.
    #[command(flatten)]
    pub samples: SampleArgs,

    /// Go on until a signal: on a terminal show all anew in its place, elsewhere print a line at every change
    #[arg(long)]
    pub watch: bool,
}

/// Shortest time between two looks of `--watch` at what came: what the eye can follow.
const WATCH_PERIOD: Duration = Duration::from_millis(200);

/// How often `--watch` looks when nothing comes: ages go on, and a process may have ended.
const IDLE_PERIOD: Duration = Duration::from_secs(1);

/// `ril status`
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it says nothing or what it says is old, 6 when the link to the DSP, or the
/// relay's to the robot, is not up. What there is has been shown then.
pub fn status(args: &StatusArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(&args.samples)?;
    let mut newest = Newest::open(&session)?;
    if args.watch {
        return watch(args, &session, &mut newest);
    }
    let give_up = MonotonicNs::now() + timeout;
    let is_complete = |newest: &mut Newest, now| newest.is_complete(&session, now);
    if !session.gather(&mut newest, give_up, is_complete)? && session.termination.requested() {
        return Ok(());
    }
    if newest.samples(&session)?.is_empty() {
        return Err(nothing_came(&session, ModuleState::KEY, timeout)?);
    }
    let report = newest.report(&session)?;
    let is_drawn = !args.samples.json && io::stdout().is_terminal();
    match is_drawn {
        true => {
            let text = fitted(&report.to_string(), Size::of(io::stdout()));
            (io::stdout().lock().write_all(text.as_bytes())).map_err(Failure::output)?;
        }
        false => print(&report, args.samples.json)?,
    }
    match report.trouble() {
        None => Ok(()),
        // It names other robots that may be meant.
        Some((ExitCode::ServiceAbsent, _)) => Err(absent(&session, ModuleState::KEY)),
        Some((code, text)) => Err(Failure::new(code, text)),
    }
}

/// Shows the report until a signal: on a terminal in its place, elsewhere a line whenever the situation is another.
fn watch(args: &StatusArgs, session: &Session, newest: &mut Newest) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let is_live = !args.samples.json && out.is_terminal();
    let mut block = Block::default();
    let mut before = None;
    while !session.termination.requested() {
        newest.drain();
        newest.relay.look(session, ModuleState::KEY)?;
        let report = newest.report(session)?;
        let situation = report.situation();
        if is_live {
            let size = Size::of(io::stdout());
            let text = fitted(&report.to_string(), size);
            block
                .show(&mut out, size, text.lines())
                .map_err(Failure::output)?;
        } else if before.as_ref() != Some(&situation) {
            if args.samples.json {
                json_line(&mut out, &report)?;
            } else {
                let since_1970 = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
                let time = time_of_day(since_1970.as_secs());
                writeln!(out, "{time}Z  {}", report.line()).map_err(Failure::output)?;
            }
            out.flush().map_err(Failure::output)?;
        }
        before = Some(situation);
        let now = MonotonicNs::now();
        // What comes meanwhile is shown together.
        session.wait([], Some(now + WATCH_PERIOD))?;
        if !session.termination.requested() {
            session.wait(newest.ports(), Some(now + IDLE_PERIOD))?;
        }
    }
    Ok(())
}

/// The newest sample of each service.
struct Newest {
    state: Latest<ModuleState>,
    dsp: Latest<DspTelemetry>,
    hero: Latest<HeroTelemetry>,
    status: Latest<StateOf<StatusModule>>,
    stations: Latest<RelayStations>,
    relay: LinkWatch,
}

impl Newest {
    fn open(session: &Session) -> Result<Newest, Failure> {
        Ok(Newest {
            state: Latest::open(&session.ipc)?,
            dsp: Latest::open(&session.ipc)?,
            hero: Latest::open(&session.ipc)?,
            status: Latest::open(&session.ipc)?,
            stations: Latest::open(&session.ipc)?,
            relay: LinkWatch::default(),
        })
    }

    fn samples(&self, session: &Session) -> Result<Samples, Failure> {
        Ok(Samples {
            state: self.state.sample,
            dsp: self.dsp.sample,
            hero: self.hero.sample,
            status: self.status.sample.as_deref().copied(),
            stations: self.stations.sample,
            own_session: own_session(),
            has_bridge: session.is_provided(ModuleState::KEY)?,
            has_status: session.is_provided(StateOf::<StatusModule>::KEY)?,
        })
    }

    fn report(&self, session: &Session) -> Result<StateReport, Failure> {
        let now = MonotonicNs::now();
        let report = StateReport::new(session.ipc.robot(), self.samples(session)?, now);
        Ok(match self.relay.is_relayed() {
            true => report.relayed(self.relay.newest().map(|link| LinkReport::new(link, now))),
            false => report,
        })
    }

    /// Whether everything is there that can be expected, and new: the bridge's state and telemetry only if there is a
    /// bridge, telemetry only over a link that is up and has brought some, telemetry in SI units and the state of
    /// status only if a process provides them, and the link only if the robot is on another machine.
    fn is_complete(&mut self, session: &Session, now: MonotonicNs) -> Result<bool, Failure> {
        self.relay.look(session, ModuleState::KEY)?;
        if self.relay.is_missing() {
            return Ok(false);
        }
        let status = self.status.sample.as_deref();
        let is_heard = status.is_some_and(|status| !is_module_old(status, now));
        if !is_heard && session.is_provided(StateOf::<StatusModule>::KEY)? {
            return Ok(false);
        }
        let Some(state) = &self.state.sample else {
            return Ok(false);
        };
        if !session.is_provided(ModuleState::KEY)? {
            return Ok(true);
        }
        if !is_present(state.published(), now) {
            return Ok(false);
        }
        let is_up = state.link.state() == Some(ipc_types::code::LinkState::Up);
        if state.link.telemetry_published == 0 {
            return Ok(true);
        }
        let (hero, dsp) = (self.hero.sample.as_ref(), self.dsp.sample.as_ref());
        if dsp.is_none() || (hero.is_none() && session.is_provided(HeroTelemetry::KEY)?) {
            return Ok(false);
        }
        let received = PilotView::of(hero, dsp).received;
        Ok(!is_up || received.is_some_and(|at| is_present(at, now)))
    }
}

impl Topics for Newest {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        let mut ports = self.relay.ports();
        ports.extend(self.state.ports());
        ports.extend(self.dsp.ports());
        ports.extend(self.hero.ports());
        ports.extend(self.status.ports());
        ports.extend(self.stations.ports());
        ports
    }

    fn drain(&mut self) {
        self.relay.drain();
        self.state.drain();
        self.dsp.drain();
        self.hero.drain();
        self.status.drain();
        self.stations.drain();
    }
}
