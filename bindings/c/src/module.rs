//! [`OwnModule`]: a module in another language. The rules of start and stop, the state, the readiness and the signals
//! are those of [`module_kit`]; the program owns the loop, and [`OwnModule::wait`] is its one wait.

use std::os::fd::AsFd;
use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::module::{OUTSIDE_IDS, State};
use ipc_types::payload::{ModuleControl, RequestReport, SharedStruct};
use ipc_types::{
    Descriptor, DynamicPublisher, Ipc, MonotonicNs, Source, Ticket, Waiter, Wake, schema,
};
use module_kit::process::ROUND_PERIOD;
use module_kit::{Manager, StateSchedule};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::error::Error;
use crate::service::ServiceName;
use crate::serving::{Serving, ServingEvent};

/// Starts and stops that are looked at in one turn.
const ROUND: usize = 16;

/// Why a wait of a module ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A source of the program may have something.
    Ready,
    /// The time is over.
    TimedOut,
    /// A signal came that is none of those that end a process.
    Interrupted,
    /// A start was accepted.
    Started,
    /// A stop was accepted: whatever is under way must end before the next wait.
    Stopped,
    /// SIGINT, SIGTERM or SIGHUP asks the process to end.
    Ending,
}

/// A module of the robot that is not written in Rust.
pub struct OwnModule {
    id: u32,
    manager: Manager,
    control: Serving,
    state: DynamicPublisher,
    schedule: StateSchedule,
    /// The request of the last event, which is done when the program waits again.
    carried_out: Option<Ticket>,
    termination: Option<Termination>,
    supervisor: Notifier,
    watchdog: Option<Duration>,
    watchdog_due: MonotonicNs,
    is_ready: bool,
    waiter: Waiter,
}

impl OwnModule {
    /// Becomes the module `name` with the number `id`. With `termination` its signals end the loop; without, the
    /// program sees to its end.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for an id that no module outside the RIL can have, or a name that is none; kind
    /// [`Taken`](crate::error::ErrorKind::Taken) when the module runs already.
    pub fn open(
        ipc: &Ipc,
        name: &str,
        id: u32,
        termination: Option<Termination>,
    ) -> Result<OwnModule, Error> {
        if !OUTSIDE_IDS.contains(&id) {
            return Err(Error::Invalid(format!(
                "{id} is no id of a module: choose one from 1000 to 9999"
            )));
        }
        if name.contains('/') {
            return Err(Error::Invalid(format!(
                "`{name}` is no name of a module: use one word in lower snake case"
            )));
        }
        let (control, state) = (format!("{name}/control"), format!("{name}/state"));
        let control_schema = schema::text(ModuleControl::LAYOUT);
        let of = |key, schema| ServiceName {
            schema: Some(schema),
            ..ServiceName::of_key(key)
        };
        // The control first: of two processes of one module the second gets no further.
        let control = Serving::open_once(ipc, &of(&control, &control_schema))?;
        let state = of(&state, &schema::text(State::LAYOUT)).publisher(ipc, None)?;
        let now = MonotonicNs::now();
        let supervisor = Notifier::from_env();
        let watchdog = supervisor.watchdog_period();
        Ok(OwnModule {
            id,
            manager: Manager::new(now),
            control,
            state,
            schedule: StateSchedule::new(now),
            carried_out: None,
            termination,
            watchdog: watchdog.map(|period| period.min(ROUND_PERIOD)),
            watchdog_due: now,
            supervisor,
            is_ready: false,
            waiter: Waiter::new(),
        })
    }

    /// The rules: whether the module may work, and what it reports when work begins and ends.
    pub fn manager(&mut self) -> &mut Manager {
        &mut self.manager
    }

    /// Sleeps until one of `sources` may have something, an event of the module comes, or `timeout` has passed. The
    /// first call tells the supervisor that the module is ready. A start or stop is reported as done by the call that
    /// follows its event.
    ///
    /// # Errors
    ///
    /// When requests cannot be received, or the operating system cannot wait; the next call tries again.
    pub fn wait(
        &mut self,
        sources: &mut [&mut dyn Source],
        timeout: Duration,
    ) -> Result<Event, Error> {
        if let Some(ticket) = self.carried_out.take() {
            self.say(ticket, &RequestReport::new(Stage::Done, Reason::None));
        }
        if !std::mem::replace(&mut self.is_ready, true) {
            self.supervisor.ready();
            tracing::info!(id = self.id, "ready");
        }
        let deadline = MonotonicNs::now() + timeout;
        loop {
            if self.is_ending() {
                self.supervisor.stopping();
                return Ok(Event::Ending);
            }
            self.publish_state();
            if let Some(event) = self.take_control()? {
                return Ok(event);
            }
            // What did not have its turn is here already, so only a look at the sources comes in between.
            let until = match self.control.has_waiting() {
                true => MonotonicNs::now(),
                false => deadline,
            };
            match self.sleep(sources, until)? {
                Wake::Ready(ready) if ready.contains(true) => return Ok(Event::Ready),
                Wake::Interrupted if !self.is_ending() => return Ok(Event::Interrupted),
                _ if MonotonicNs::now() >= deadline => return Ok(Event::TimedOut),
                _ => {}
            }
        }
    }

    fn is_ending(&self) -> bool {
        self.termination.as_ref().is_some_and(|it| it.requested())
    }

    /// Reports to one client. What cannot be sent concerns nobody else.
    fn say(&mut self, ticket: Ticket, report: &RequestReport) {
        if let Err(error) = self.control.report(ticket, report) {
            tracing::debug!(%error, "a report was not sent");
        }
    }

    /// Carries out the next start or stop that is there; one that is refused is answered here. What clients send
    /// without a pause takes its turn with the rest: at most [`ROUND`] requests.
    fn take_control(&mut self) -> Result<Option<Event>, Error> {
        for _ in 0..ROUND {
            let ServingEvent::Request(ticket, request) = self.control.take(Duration::ZERO)? else {
                break;
            };
            let command = ModuleControl::from_bytes(&request).and_then(|request| request.command());
            let Some(command) = command else {
                let refused = RequestReport::new(Stage::Refused, Reason::InvalidRequest);
                self.say(ticket, &refused);
                continue;
            };
            tracing::info!(%command, "control");
            match self.manager.control(MonotonicNs::now(), command) {
                Err(refused) => self.say(ticket, &refused.report()),
                Ok(()) => {
                    self.carried_out = Some(ticket);
                    return Ok(Some(match command {
                        ControlCommand::Start => Event::Started,
                        _ => Event::Stopped,
                    }));
                }
            }
        }
        Ok(None)
    }

    fn publish_state(&mut self) {
        let now = MonotonicNs::now();
        if let Some(period) = self.watchdog.filter(|_| now >= self.watchdog_due) {
            self.watchdog_due = now + period;
            self.supervisor.watchdog();
        }
        let Some(state) = self.schedule.due(&mut self.manager, self.id, now) else {
            return;
        };
        let fill = |sample: &mut [u8]| sample.copy_from_slice(state.bytes());
        if let Err(error) = self.state.publish(fill) {
            tracing::warn!(%error, "the state was not published");
        }
    }

    /// The key `true` is that of the program's own sources.
    fn sleep(
        &mut self,
        sources: &mut [&mut dyn Source],
        deadline: MonotonicNs,
    ) -> Result<Wake<bool>, Error> {
        let mut until = deadline.min(self.schedule.next());
        if self.watchdog.is_some() {
            until = until.min(self.watchdog_due);
        }
        let mut signals = self
            .termination
            .as_ref()
            .map(|it| Descriptor::new(it.as_fd()));
        let mut all: Vec<(bool, &mut dyn Source)> = Vec::with_capacity(sources.len() + 3);
        all.push((false, &mut self.state));
        all.push((false, self.control.source()));
        if let Some(signals) = &mut signals {
            all.push((false, signals));
        }
        for source in sources {
            all.push((true, &mut **source));
        }
        Ok(self
            .waiter
            .wait(&mut all, Some(until.since(MonotonicNs::now())))?)
    }
}
