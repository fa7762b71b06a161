//! `ril status`: the newest state and telemetry, each with its age, once.

use std::io::{self, Write};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, ReceiveError, Source, StateOf, StatusModule, Subscriber, Topic};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::relay::LinkWatch;
use super::relay_report::LinkReport;
use super::sample_age::Sample;
use super::state_report::StateReport;
use super::{Session, configuration, json_line};
use crate::cli::StateArgs;
use crate::measure::Measured;

/// `ril status`
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it publishes nothing.
pub fn state(args: &StateArgs) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
    let session = Session::join(&args.common)?;
    let mut newest = Newest::open(&session)?;
    let give_up = MonotonicNs::now() + timeout;
    while !newest.is_complete(&session)? && MonotonicNs::now() < give_up {
        if session.termination.requested() {
            return Ok(());
        }
        session.wait(newest.ports(), Some(give_up))?;
        newest.drain();
    }
    let Some(state) = &newest.state.sample else {
        return Err(session.nothing_came(ModuleState::KEY, timeout)?);
    };
    let now = MonotonicNs::now();
    let robot = session.ipc.robot().get();
    let report = StateReport::new(
        robot,
        state,
        newest.dsp.shown(now),
        newest.hero.shown(now),
        newest.status.sample.as_deref(),
        now,
    );
    let report = match newest.relay.is_relayed() {
        true => report.relayed(newest.relay.newest().map(|link| LinkReport::new(link, now))),
        false => report,
    };
    let mut out = io::stdout().lock();
    if args.json {
        json_line(&mut out, &report)
    } else {
        write!(out, "{report}").map_err(Failure::output)
    }
}

/// The newest sample of each service.
struct Newest {
    state: Latest<ModuleState>,
    dsp: Latest<DspTelemetry>,
    hero: Latest<HeroTelemetry>,
    status: Latest<StateOf<StatusModule>>,
    relay: LinkWatch,
}

/// The newest sample of one service.
struct Latest<T: Topic> {
    port: Subscriber<T>,
    sample: Option<T>,
}

impl<T: Topic> Latest<T> {
    fn open(session: &Session) -> Result<Latest<T>, Failure> {
        Ok(Latest {
            port: session.ipc.subscriber().or_fail(ExitCode::Internal)?,
            sample: None,
        })
    }

    fn drain(&mut self) -> Result<(), ReceiveError> {
        if let Some(sample) = self.port.latest()? {
            self.sample = Some(sample);
        }
        Ok(())
    }
}

impl<T: Measured> Latest<T> {
    fn shown(&self, now: MonotonicNs) -> Option<Sample> {
        let sample = self.sample.as_ref()?;
        Some(Sample::new(sample.sequence(), sample.stamps().sent, now))
    }
}

impl Newest {
    fn open(session: &Session) -> Result<Newest, Failure> {
        Ok(Newest {
            state: Latest::open(session)?,
            dsp: Latest::open(session)?,
            hero: Latest::open(session)?,
            status: Latest::open(session)?,
            relay: LinkWatch::default(),
        })
    }

    fn ports(&mut self) -> impl Iterator<Item = &mut dyn Source> {
        let ports: [&mut dyn Source; 4] = [
            &mut self.state.port,
            &mut self.dsp.port,
            &mut self.hero.port,
            &mut self.status.port,
        ];
        ports.into_iter().chain(self.relay.port())
    }

    fn drain(&mut self) {
        self.relay.drain();
        let results = [
            self.state.drain(),
            self.dsp.drain(),
            self.hero.drain(),
            self.status.drain(),
        ];
        for error in results.into_iter().filter_map(Result::err) {
            tracing::warn!(%error, "samples could not be received");
        }
    }

    /// Whether everything is there that can be expected: telemetry only if the bridge has published some, telemetry in SI
    /// units and the state of status only if a process provides them, and the link only if the robot is on another machine.
    fn is_complete(&mut self, session: &Session) -> Result<bool, Failure> {
        self.relay.look(session, ModuleState::KEY)?;
        let Some(state) = &self.state.sample else {
            return Ok(false);
        };
        if self.relay.is_missing() {
            return Ok(false);
        }
        if self.status.sample.is_none() && session.is_provided(StateOf::<StatusModule>::KEY)? {
            return Ok(false);
        }
        if state.link.telemetry_published == 0 {
            return Ok(true);
        }
        if self.dsp.sample.is_none() {
            return Ok(false);
        }
        Ok(self.hero.sample.is_some() || !session.is_provided(HeroTelemetry::KEY)?)
    }
}
