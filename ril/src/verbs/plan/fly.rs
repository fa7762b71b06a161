//! `ril plan fly`: checks a plan, then does its steps one after the other, each followed to its final report.

use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, ModuleState, MovementData, RequestReport};
use ipc_types::{MonotonicNs, Source, Subscriber, Topic, fresh_request_id};
use operator::fence_file::{FenceChange, FenceFileError};
use operator::options::SenderArgs;
use operator::render::messages::Verb;
use operator::render::words::{columns, distance, duration};
use operator::render::{Weight, json_line, json_text, tell};
use operator::request::cruise::CruiseSpeed;
use operator::request::{Companion, Conversation, Format, Steps, Until};
use operator::robot::running::file_of;
use operator::session::{Latest, OrderContext, Session, Unread};
use plans::executor::Executor;
use plans::flight::{PathPoint, Step};
use plans::model::FenceArea;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::output::{standard_error, standard_output};

use super::gather::{KnownPlan, gather, read};
use super::options::PlanFlyArgs;
use super::progress::{StepEvent, resume};
use super::report::PlanReport;

/// `ril plan fly`
///
/// # Errors
///
/// Code 8 when a finding forbids the flight; otherwise that of the request that ended it early.
pub fn fly(args: &PlanFlyArgs) -> Result<(), Failure> {
    let ask = &args.ask;
    let asked = OrderContext::with(ask, Unread::Refused)?;
    let steps = Steps::of(&asked);
    let OrderContext {
        session,
        config,
        timeout,
        deadline_ms,
        issued: _,
    } = asked;
    let plan = read(&args.plan)?;
    let known = gather(
        plan,
        &args.plan,
        &config.plan,
        Some(&session),
        timeout,
        true,
    )?;
    let report = PlanReport::new(&args.plan.file, &known);
    if ask.json {
        report.write_json(&mut standard_output())?;
    } else {
        standard_error().print(report.findings(columns()));
    }
    report.verdict()?;
    if args.fence {
        put_fence(args, &known, &session, timeout)?;
    }
    let before_mps = known
        .robot
        .as_ref()
        .and_then(|robot| robot.cruise_speed_mps);
    let format = Flyer::format(ask.json);
    let mut flyer = Flyer {
        session: &session,
        known: &known,
        executor: Executor::new(known.flight.steps.clone(), args.plan.from),
        timeout,
        steps,
        json: ask.json,
        sender: args.sender,
        speed: CruiseSpeed::new(&session, (timeout, deadline_ms), format, before_mps),
    };
    let result = flyer.fly();
    flyer.speed.restore();
    result.map_err(explain_closed_output).map_err(|failure| {
        flyer.executor.fail(failure.chain().join(": "));
        let executor = &flyer.executor;
        match executor.next_item().zip(resume(executor, args, &known.site.home)) {
            Some((item, command)) => failure.context(format!(
                "the plan ended early, before the end of item {item}; the helicopter is where that left it. Once the cause is gone, go \
                 on with `{command}`"
            )),
            None => failure,
        }
    })
}

/// Where output is all that a command is for, it ends quietly when its reader has gone. This one is for more.
fn explain_closed_output(failure: Failure) -> Failure {
    match failure.chain().is_empty() {
        false => failure,
        true => Failure::new(
            ExitCode::OutcomeUnknown,
            "standard output was closed: nothing else is sent, and the bridge does with the path what `sender_lost` says: by default the \
             helicopter hovers",
        ),
    }
}

/// `--fence`: the plan's own fence goes into the bridge's configuration, and the bridge reads it.
/// [`fence_file`](operator::fence_file) says which areas make way for which.
fn put_fence(
    args: &PlanFlyArgs,
    known: &KnownPlan,
    session: &Session,
    timeout: Duration,
) -> Result<(), Failure> {
    let default = bridge::cli::DEFAULT_CONFIG_FILE;
    let provider = session.provider(ModuleState::KEY)?;
    let of_process = || file_of(&provider?, "bridge", default);
    let file = args.plan.bridge.clone().or_else(of_process);
    let file = file.unwrap_or_else(|| PathBuf::from(default));
    if !file.exists() {
        return Err(Failure::usage(
            "--fence: the bridge's configuration is not known; name it with `--bridge FILE`",
        ));
    }
    put_areas(
        &known.plan.fence,
        &file,
        session,
        timeout,
        Format::of(args.ask.json),
    )
}

/// Puts the areas into `file`, and in force. When the bridge does not take them, the file is as before.
///
/// # Errors
///
/// Code 2 when there is nothing to put, or it would make the fence wider; 5 when the bridge refuses it or reads another
/// file.
fn put_areas(
    areas: &[FenceArea],
    file: &Path,
    session: &Session,
    timeout: Duration,
    format: Format,
) -> Result<(), Failure> {
    if areas.is_empty() {
        return Err(Failure::usage("--fence: the plan has no fence of its own"));
    }
    let change = FenceChange::put(file, areas).map_err(|error| match error {
        FenceFileError::Read { .. } => Failure::usage(error.to_string()),
        FenceFileError::Configuration(error) => error.into(),
        FenceFileError::Write { .. } => {
            Failure::usage(format!("--fence: {error}; the fence is as before"))
        }
        error => Failure::usage(format!("--fence: {error}")),
    })?;
    let count = change.areas as u32;
    let taken =
        reload(session, timeout, format).and_then(|()| await_areas(session, timeout, count, file));
    if taken.is_err() {
        change
            .take_back()
            .map_err(|error| Failure::usage(format!("--fence: {error}")))?;
        // The bridge may have read the file in between.
        let _ = reload(session, timeout, Format::Silent);
    }
    taken
}

fn reload(session: &Session, timeout: Duration, format: Format) -> Result<(), Failure> {
    let request = ModuleControl::new(fresh_request_id(), ControlCommand::ReloadFence);
    Conversation::<ModuleControl>::open(session, Verb::ReloadFence, timeout)?
        .follow(&[request], Until::Final, format)
        .map(drop)
}

/// The bridge publishes how many areas are in force: another number means that it has read another file.
fn await_areas(
    session: &Session,
    timeout: Duration,
    count: u32,
    file: &Path,
) -> Result<(), Failure> {
    let mut state = Latest::<ModuleState>::open(&session.ipc)?;
    let areas = |state: &Latest<ModuleState>| {
        let sample = state.sample.as_ref();
        sample.map(|state| state.safety.fence_areas)
    };
    let give_up = MonotonicNs::now() + timeout;
    let is_in_force = |state: &mut Latest<ModuleState>, _| Ok(areas(state) == Some(count));
    if session.gather(&mut state, give_up, is_in_force)? {
        return Ok(());
    }
    let text = format!(
        "--fence: the bridge has {} areas in force instead of {count}, so it does not read {}; it is as before. Name the file that the \
         bridge was started with: `--bridge FILE`",
        areas(&state).unwrap_or_default(),
        file.display()
    );
    Err(Failure::new(ExitCode::Refused, text))
}

struct Flyer<'a> {
    session: &'a Session,
    known: &'a KnownPlan,
    executor: Executor,
    timeout: Duration,
    steps: Steps,
    json: bool,
    sender: SenderArgs,
    speed: CruiseSpeed<'a>,
}

impl Flyer<'_> {
    /// Does one step after the other.
    fn fly(&mut self) -> Result<(), Failure> {
        self.executor.begin();
        while let Some(step) = self.executor.poll(MonotonicNs::now()).cloned() {
            self.announce("begin", &describe(&step))?;
            match &step {
                Step::TakeOff { height_m, .. } => {
                    let request = MovementData::take_off(fresh_request_id(), *height_m);
                    let report = self.movement(Verb::TakeOff, vec![request])?;
                    let height_m = report.and_then(|report| report.value());
                    if let Some(height_m) = height_m.filter(|height_m| height_m.is_finite()) {
                        self.print(&format!("{height_m:.1} m above take-off"))?;
                    }
                }
                Step::Path(points) => self.path(points)?,
                Step::Wait { .. } => self.hover()?,
                Step::Speed { speed_mps, .. } => self.speed.set(*speed_mps, self.steps.before())?,
                Step::Land { .. } => {
                    let request = MovementData::land(fresh_request_id());
                    self.movement(Verb::Land, vec![request])?;
                }
            }
            if !matches!(step, Step::Wait { .. }) {
                self.executor.step_done();
            }
        }
        let is_down = matches!(self.known.flight.steps.last(), Some(Step::Land { .. }));
        self.announce(
            "done",
            match is_down {
                true => "done; the helicopter has landed",
                false => "done; the helicopter hovers",
            },
        )
    }

    fn movement(
        &mut self,
        verb: Verb,
        requests: Vec<MovementData>,
    ) -> Result<Option<RequestReport>, Failure> {
        let requests = self.steps.next(requests);
        let report = Conversation::<MovementData>::open(self.session, verb, self.timeout)?.follow(
            &requests,
            Until::Final,
            Flyer::format(self.json),
        )?;
        self.steps.done(&requests);
        Ok(report)
    }

    fn path(&mut self, points: &[PathPoint]) -> Result<(), Failure> {
        let waypoints: Vec<_> = points.iter().map(PathPoint::position).collect();
        let path_id = fresh_request_id();
        let requests = MovementData::path(path_id, &waypoints, fresh_request_id);
        let requests = requests.map(|request| self.sender.complete(request));
        let requests: Vec<_> = self.steps.next(requests);
        let format = Flyer::format(self.json);
        let mut watch = PathWatch::open(self.session, path_id, &mut self.executor, self.json)?;
        let report = Conversation::open(self.session, Verb::GoTo, self.timeout)?
            .without_sender(self.sender.action())
            .beside(&mut watch)
            .follow(&requests, Until::Final, format)?;
        let reached = report.map_or(0, |report| report.waypoints_reached);
        watch.reached(reached as usize, None)?;
        self.steps.done(&requests);
        Ok(())
    }

    /// Hovering is what the helicopter does between two movements.
    fn hover(&mut self) -> Result<(), Failure> {
        while let Some(end) = self.executor.deadline() {
            if self.session.termination.requested() {
                let text = "interrupted while the helicopter hovers, which it goes on doing";
                return Err(Failure::new(ExitCode::OutcomeUnknown, text));
            }
            self.session.wait([], Some(end))?;
            self.executor.advance(MonotonicNs::now());
        }
        Ok(())
    }

    /// In text the steps are printed, not the reports about each waypoint.
    fn format(json: bool) -> Format {
        match json {
            true => Format::Json,
            false => Format::Silent,
        }
    }

    fn announce(&self, event: &'static str, text: &str) -> Result<(), Failure> {
        match self.json {
            true => json_line(
                &mut standard_output(),
                &StepEvent::of(&self.executor, event),
            ),
            false => self.print(text),
        }
    }

    fn print(&self, text: &str) -> Result<(), Failure> {
        match self.json {
            true => Ok(()),
            false => tell(Weight::Result, format!("plan: {text}\n")),
        }
    }
}

fn describe(step: &Step) -> String {
    match step {
        Step::TakeOff { height_m, .. } => format!("take-off to {height_m:.1} m"),
        Step::Path(points) => match (points.first(), points.last()) {
            (Some(first), Some(last)) if points.len() > 1 => format!(
                "path of {} waypoints, items {} to {}",
                points.len(),
                first.item,
                last.item
            ),
            (Some(first), _) => format!("path to item {}", first.item),
            (None, _) => "path".to_owned(),
        },
        Step::Wait { item, duration_s } => {
            format!("hover for {}, item {item}", duration(*duration_s))
        }
        Step::Speed { item, speed_mps } => format!("cruise at {speed_mps} m/s, item {item}"),
        Step::Land { item } => format!("landing, item {item}"),
    }
}

/// Watches which waypoints of a path have been reached, in the bridge's published state, while it is flown.
struct PathWatch<'a> {
    states: Subscriber<ModuleState>,
    path_id: u64,
    executor: &'a mut Executor,
    json: bool,
}

impl<'a> PathWatch<'a> {
    /// Watches the path with this id.
    fn open(
        session: &Session,
        path_id: u64,
        executor: &'a mut Executor,
        json: bool,
    ) -> Result<PathWatch<'a>, Failure> {
        Ok(PathWatch {
            states: session.ipc.subscriber().or_fail(ExitCode::Internal)?,
            path_id,
            executor,
            json,
        })
    }

    /// So many waypoints were reached; the rest is so long.
    fn reached(&mut self, count: usize, to_go_m: Option<f64>) -> Result<(), Failure> {
        let items = self.executor.reached(count);
        if self.json {
            let event = StepEvent::of(self.executor, "reached");
            return match items.is_empty() {
                true => Ok(()),
                false => tell(Weight::Progress, json_text(&event)?),
            };
        }
        for item in items {
            let to_go = to_go_m.map_or(String::new(), |metres| {
                format!(", {} to go", distance(metres))
            });
            tell(
                Weight::Progress,
                format!("plan: item {item} reached{to_go}\n"),
            )?;
        }
        Ok(())
    }
}

impl Companion for PathWatch<'_> {
    fn source(&mut self) -> &mut dyn Source {
        &mut self.states
    }

    fn look(&mut self) -> Result<(), Failure> {
        let mut newest = None;
        let path_id = self.path_id;
        let drained = self.states.drain(|state| {
            if state.movement.path_id == path_id {
                newest = Some(state.movement);
            }
        });
        // A publisher that goes just now is no reason to end: what follows the order says how it ends.
        if let Err(error) = drained {
            tracing::debug!(%error, "samples could not be received");
        }
        let Some(movement) = newest else {
            return Ok(());
        };
        let to_go_m =
            (movement.distance_valid == 1).then_some(f64::from(movement.distance_to_go_m));
        self.reached(movement.waypoints_reached as usize, to_go_m)
    }
}
