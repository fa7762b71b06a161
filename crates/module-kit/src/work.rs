//! [`Work`]: what the author of a module writes, and [`RunningModule`], the process around it.

use std::ffi::OsString;
use std::fmt::Debug;

use clap::{Args, Command, FromArgMatches};
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::module::is_own_name;
use ipc_types::payload::RequestReport;
use ipc_types::{
    ControlOf, Ipc, Module, MonotonicNs, OpenError, Publisher, StateOf, WaitError, Wake,
};
use runtime::args::CommonArgs;
use runtime::environment::without_empty_variables;
use runtime::exit::{self, ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use serde::de::DeserializeOwned;

use crate::manager::{Manager, StateSchedule};
use crate::process::{self, Process, SetUp, Sources};
use crate::requests::Requests;

/// The work of a module: its ports, and what it does with what comes through them.
///
/// The kit does the rest: command line, configuration, logging, signals, readiness and watchdog, the loop with its one
/// wait, the topic `<module>/state` and the requests of `<module>/control`.
pub trait Work: Module + Sized {
    /// What stands in `<module>.toml`, every value with a default.
    type Config: DeserializeOwned + Default + Debug;

    /// Opens the module's ports.
    ///
    /// # Errors
    /// See [`OpenError`]; another process may publish or serve the same.
    fn open(config: Self::Config, ipc: &Ipc) -> Result<Self, OpenError>;

    /// Adds every port of the module to what it waits for.
    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>);

    /// Called after every wake, whatever it was for: takes everything that has come through the ports, and does what is
    /// due. Must not block.
    ///
    /// A module that is not [started](Manager::is_started) may receive and publish; it commands nothing.
    fn step(&mut self, now: MonotonicNs, manager: &mut Manager);

    /// A start was accepted.
    fn started(&mut self, _now: MonotonicNs, _manager: &mut Manager) {}

    /// A stop was accepted: whatever is under way must end. It is not called when the process ends; the ports are
    /// dropped then, and with them requests that are open.
    fn stopped(&mut self, _now: MonotonicNs) {}

    /// When the module wants to be woken at the latest.
    fn deadline(&self) -> Option<MonotonicNs> {
        None
    }
}

/// The body of a module's `main`.
///
/// ```no_run
/// # use ipc_types::{Ipc, MonotonicNs, OpenError};
/// # use module_kit::{Manager, Sources, Work};
/// struct Idle;
/// ipc_types::module!(Idle, "idle", 1000);
///
/// impl Work for Idle {
///     type Config = module_kit::NoConfig;
///     fn open(_: Self::Config, _: &Ipc) -> Result<Idle, OpenError> {
///         Ok(Idle)
///     }
///     fn sources<'a>(&'a mut self, _: &mut Sources<'a>) {}
///     fn step(&mut self, _: MonotonicNs, _: &mut Manager) {}
/// }
///
/// fn main() -> std::process::ExitCode {
///     module_kit::main::<Idle>()
/// }
/// ```
pub fn main<W: Work>() -> std::process::ExitCode {
    match options(W::NAME, std::env::args_os()) {
        Ok(args) => exit::main_with(|| run::<W>(&args)),
        Err(error) => exit::usage(&error).into(),
    }
}

/// The options that every module takes, from the words of its command line, the program first.
///
/// # Errors
/// What there is to print, and how to end: a usage error, or the help that was asked for.
pub fn options(
    name: &'static str,
    words: impl IntoIterator<Item = OsString>,
) -> Result<CommonArgs, clap::Error> {
    let command = without_empty_variables(CommonArgs::augment_args(Command::new(name)));
    CommonArgs::from_arg_matches(&command.try_get_matches_from(words)?)
}

/// Runs a module in the foreground until SIGINT or SIGTERM, for a program with options of its own.
///
/// # Errors
/// Exit code 78 when the configuration is wrong, 1 when shared memory cannot be used or the module runs already.
pub fn run<W: Work>(args: &CommonArgs) -> Result<(), Failure> {
    let file = format!("{}.toml", W::NAME);
    let Some(set_up) = SetUp::<W::Config>::begin(args, &file)? else {
        return Ok(());
    };
    let ipc = set_up.join(W::NAME)?;
    let SetUp {
        config,
        termination,
        supervisor,
        ..
    } = set_up;
    run_with::<W>(config, &ipc, &termination, &supervisor)
}

/// Runs a module without a process of its own, as a test has it: `termination` may be requested by hand.
///
/// # Errors
/// Exit code 1 when a service cannot be opened, the operating system cannot wait, or the module has the name of one of
/// the RIL's own.
pub fn run_with<W: Work>(
    config: W::Config,
    ipc: &Ipc,
    termination: &Termination,
    supervisor: &Notifier,
) -> Result<(), Failure> {
    check_name(W::NAME)?;
    let mut running = RunningModule::<W>::open(config, ipc)
        .or_fail_with(ExitCode::Internal, format!("{} cannot start", W::NAME))?;
    tracing::info!(module = W::NAME, robot = %ipc.robot(), "ready");
    process::run(&mut running, termination, supervisor).or_fail(ExitCode::Internal)?;
    tracing::info!(module = W::NAME, "ended");
    Ok(())
}

/// Whether a module can have this name, for one that [`module!`](ipc_types::module!) has not looked at.
fn check_name(name: &str) -> Result<(), Failure> {
    match is_own_name(name) {
        true => Err(Failure::internal(format!(
            "`{name}` is the name of one of the RIL's own modules, which no other can have: choose another name for this one"
        ))),
        false => Ok(()),
    }
}

/// A module with its state, its control and its manager.
struct RunningModule<W: Work> {
    work: W,
    manager: Manager,
    state: Publisher<StateOf<W>>,
    control: Requests<ControlOf<W>>,
    schedule: StateSchedule,
}

impl<W: Work> RunningModule<W> {
    fn open(config: W::Config, ipc: &Ipc) -> Result<RunningModule<W>, OpenError> {
        // The control first: of two processes of one module the second gets no further.
        let control = Requests::open(ipc)?;
        let now = MonotonicNs::now();
        Ok(RunningModule {
            control,
            state: ipc.publisher()?,
            work: W::open(config, ipc)?,
            manager: Manager::new(now),
            schedule: StateSchedule::new(now),
        })
    }

    fn publish_state(&mut self, now: MonotonicNs) {
        let Some(state) = self.schedule.due(&mut self.manager, W::ID, now) else {
            return;
        };
        if let Err(error) = self.state.publish(|sample| *sample = StateOf::new(state)) {
            tracing::warn!(%error, "the state was not published");
        }
    }
}

impl<W: Work> Process for RunningModule<W> {
    type Error = WaitError;
    type Key = ();

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.state);
        sources.port(self.control.source());
        self.work.sources(sources);
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        let now = MonotonicNs::now();
        let (work, manager) = (&mut self.work, &mut self.manager);
        self.control.serve(|request| {
            let Some(command) = request.command() else {
                return RequestReport::new(Stage::Refused, Reason::InvalidRequest);
            };
            tracing::info!(%command, request_id = request.request_id, "control");
            if let Err(refused) = manager.control(now, command) {
                return refused.report();
            }
            match command {
                ControlCommand::Start => work.started(now, manager),
                _ => work.stopped(now),
            }
            RequestReport::new(Stage::Done, Reason::None)
        });
        self.work.step(now, &mut self.manager);
        self.publish_state(now);
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let next_state = self.schedule.next();
        let work = self.work.deadline();
        Some(work.map_or(next_state, |work| work.min(next_state)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::sync::mpsc;
    use std::thread;
    use std::time::Duration;

    use crate::OnStop;
    use ipc_types::code::ModuleStatus;
    use ipc_types::{Domain, RobotId, fresh_request_id};

    #[test]
    fn a_module_with_the_name_of_one_of_the_ril_s_own_is_refused() {
        for name in ["bridge", "status", "relay"] {
            let error = check_name(name).unwrap_err();
            assert_eq!(error.code(), ExitCode::Internal);
            let text = error.chain().join("\n");
            assert!(text.contains(&format!("`{name}` is the name of")), "{text}");
        }
        assert!(check_name("battery_watch").is_ok());
    }

    #[test]
    fn a_module_reads_its_configuration_before_anything_else() {
        let words = ["sweep", "--config", "/nonexistent/sweep.toml"].map(OsString::from);
        let refused = run::<Sweep>(&options("sweep", words).unwrap()).unwrap_err();
        assert_eq!(refused.code(), ExitCode::Configuration);
    }

    /// Notes what it is called for; begins work when it is started.
    struct Sweep {
        calls: mpsc::Sender<&'static str>,
        due: Option<MonotonicNs>,
        /// Whether it was asked for its ports.
        is_asked: bool,
    }

    ipc_types::module!(Sweep, "sweep", 1000);

    thread_local! {
        /// Where the module that is opened on this thread notes its calls.
        static CALLS: RefCell<Option<mpsc::Sender<&'static str>>> = const { RefCell::new(None) };
    }

    impl Work for Sweep {
        type Config = crate::NoConfig;

        fn open(_: Self::Config, _: &Ipc) -> Result<Sweep, OpenError> {
            let calls = CALLS.take().unwrap();
            Ok(Sweep {
                calls,
                due: None,
                is_asked: false,
            })
        }

        fn sources<'a>(&'a mut self, _: &mut Sources<'a>) {
            self.is_asked = true;
        }

        fn step(&mut self, now: MonotonicNs, manager: &mut Manager) {
            if self.due.take_if(|due| now >= *due).is_some() {
                manager.done(now);
                self.calls.send("due").unwrap();
            }
        }

        fn started(&mut self, now: MonotonicNs, manager: &mut Manager) {
            assert!(manager.begin(now, 3, "sweeping", OnStop::Aborts));
            self.due = Some(now + Duration::from_millis(1));
            self.calls.send("started").unwrap();
        }

        fn stopped(&mut self, _: MonotonicNs) {
            assert!(self.is_asked);
            self.calls.send("stopped").unwrap();
        }

        fn deadline(&self) -> Option<MonotonicNs> {
            self.due
        }
    }

    #[test]
    fn a_module_is_woken_for_its_state_or_sooner_for_its_work() {
        let ipc = Ipc::join(&Domain::isolated(), RobotId::DEFAULT, "sweep").unwrap();
        CALLS.set(Some(mpsc::channel().0));
        let mut running = RunningModule::<Sweep>::open(crate::NoConfig {}, &ipc).unwrap();
        let next = running.schedule.next();
        for due in [None, Some(next), Some(next + Duration::from_secs(1))] {
            running.work.due = due;
            assert_eq!(running.deadline(), Some(next));
        }
        running.work.due = Some(MonotonicNs(7));
        assert_eq!(running.deadline(), Some(MonotonicNs(7)));
    }

    #[test]
    fn a_module_is_started_and_stopped_by_request_woken_in_time_and_says_how_it_is() {
        let domain = Domain::isolated();
        let (termination, end) = Termination::by_hand().unwrap();
        let (sender, calls) = mpsc::channel();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let mut states = ipc.subscriber::<StateOf<Sweep>>().unwrap();
        let limit = Duration::from_secs(60);
        thread::scope(|scope| {
            let module = scope.spawn(|| {
                let ipc = Ipc::join(&domain, RobotId::DEFAULT, "sweep").unwrap();
                CALLS.set(Some(sender));
                run_with::<Sweep>(
                    crate::NoConfig {},
                    &ipc,
                    &termination,
                    &Notifier::from_env(),
                )
            });
            let mut next = || states.recv_timeout(limit).unwrap().expect("a state");
            let mut seen = vec![next().status()];
            let mut client = ipc.client::<ControlOf<Sweep>>().unwrap();
            let mut ask = |command: u32| {
                let mut request =
                    ControlOf::<Sweep>::command(fresh_request_id(), ControlCommand::Start);
                request.command = command;
                let mut handle = client.request(&request).unwrap();
                let report = handle.result_timeout(limit).unwrap().unwrap();
                (report.stage().unwrap(), report.reason().unwrap())
            };
            let done = (Stage::Done, Reason::None);
            assert_eq!(ask(99), (Stage::Refused, Reason::InvalidRequest));
            assert_eq!(ask(ControlCommand::Start.code()), done);
            for call in ["started", "due"] {
                assert_eq!(calls.recv_timeout(limit), Ok(call));
            }
            assert_eq!(ask(ControlCommand::TakeControl.code()).0, Stage::Refused);
            assert_eq!(ask(ControlCommand::Stop.code()), done);
            assert_eq!(calls.recv_timeout(limit), Ok("stopped"));
            // Work that has ended, before the stop.
            while seen.last() != Some(&Some(ModuleStatus::Ended)) {
                let state = next();
                assert_eq!(state.module_id, Sweep::ID);
                seen.push(state.status());
            }
            assert_eq!(seen[0], Some(ModuleStatus::WaitingDataToStart));
            end.request();
            module.join().unwrap().unwrap();
            assert!(calls.try_recv().is_err(), "nothing else was called");
        });
    }
}
