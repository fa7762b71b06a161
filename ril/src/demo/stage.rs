//! What the demonstration's one wait serves: processes, ports, signals, and the screen.

use std::io;
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData, RequestReport,
};
use ipc_types::{
    Client, Descriptor, Ipc, MonotonicNs, Source, Subscriber, Waiter, fresh_request_id,
};
use runtime::duration::Shown;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;

use super::children::{Process, Readiness};
use super::mission::{Mission, Request};
use super::screen::Screen;
use super::watch::{Counts, Watch};

/// The whole demonstration ends within this, or something hangs. A flight takes less than 20 s; machines stall.
const TIME_LIMIT: Duration = Duration::from_secs(120);

/// Longest wait between two looks at the time limit.
const LONGEST_WAIT: Duration = Duration::from_millis(200);

/// Everything that the demonstration's one wait serves.
pub(super) struct Stage<'a> {
    termination: &'a Termination,
    readiness: &'a Readiness,
    waiter: Waiter,
    processes: Vec<Process>,
    ready: usize,
    control: Client<ModuleControl>,
    movement: Client<MovementData>,
    dsp: Subscriber<DspTelemetry>,
    hero: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
    /// What a consumer saw.
    pub watch: Watch,
    /// What the operator asks; nothing before the robot is up.
    mission: Option<Mission>,
    began: Option<Instant>,
    deadline: Instant,
}

impl<'a> Stage<'a> {
    /// Takes part in the robot that the processes will be.
    pub fn new(
        ipc: &Ipc,
        termination: &'a Termination,
        readiness: &'a Readiness,
    ) -> Result<Stage<'a>, Failure> {
        Ok(Stage {
            termination,
            readiness,
            waiter: Waiter::new(),
            processes: Vec::new(),
            ready: 0,
            control: ipc.client().map_err(Failure::internal)?,
            movement: ipc.client().map_err(Failure::internal)?,
            dsp: ipc.subscriber().map_err(Failure::internal)?,
            hero: ipc.subscriber().map_err(Failure::internal)?,
            state: ipc.subscriber().map_err(Failure::internal)?,
            watch: Watch::default(),
            mission: None,
            began: None,
            deadline: Instant::now() + TIME_LIMIT,
        })
    }

    /// From now on `mission` is asked for; `began` is when its time began.
    pub fn begin(&mut self, mission: Mission, began: Instant) {
        self.mission = Some(mission);
        self.began = Some(began);
    }

    /// What the operator asks.
    pub fn mission(&self) -> Option<&Mission> {
        self.mission.as_ref()
    }

    /// The same, to keep.
    pub fn take_mission(&mut self) -> Option<Mission> {
        self.mission.take()
    }

    /// Waits until a process is ready that was just started.
    pub fn await_ready(&mut self, name: &str, started: io::Result<Process>) -> Result<(), Failure> {
        let process = started.or_fail_with(
            ExitCode::Internal,
            format!("the process {name} cannot be started"),
        )?;
        self.processes.push(process);
        let expected = self.processes.len();
        self.wait_until(&mut Screen::new(true), |stage| stage.ready == expected)
    }

    /// Whether the bridge says that the DSP answers.
    pub fn link_is_up(&self) -> bool {
        let state = self.watch.last_state().and_then(|state| state.link.state());
        state == Some(ipc_types::code::LinkState::Up)
    }

    /// The samples that were lost.
    pub fn counts(&self) -> Counts {
        Counts {
            dsp: self.dsp.losses(),
            hero: self.hero.losses(),
            state: self.state.losses(),
        }
    }

    /// Serves everything until `done`. Ends early when a process does, a signal comes, or time runs out.
    pub fn wait_until(
        &mut self,
        screen: &mut Screen,
        done: impl Fn(&Stage<'_>) -> bool,
    ) -> Result<(), Failure> {
        loop {
            self.drain(screen)?;
            if done(self) {
                return Ok(());
            }
            if self.termination.requested() {
                let text = "interrupted; nothing is left running";
                return Err(match self.termination.signal() {
                    Some(signal) => Failure::interrupted(signal, text),
                    None => Failure::internal(text),
                });
            }
            if let Some(process) = self
                .processes
                .iter_mut()
                .find_map(|process| process.has_ended().then_some(process))
            {
                let (name, code) = (process.name(), process.end());
                return Err(Failure::internal(format!(
                    "the process {name} ended by itself with code {code:?}; its last words:\n{}",
                    process.last_words()
                )));
            }
            if Instant::now() >= self.deadline {
                return Err(Failure::new(
                    ExitCode::Timeout,
                    format!("the demonstration took more than {}", Shown(TIME_LIMIT)),
                ));
            }
            self.sleep()?;
        }
    }

    /// Takes everything that came, asks for what is next, and shows it.
    fn drain(&mut self, screen: &mut Screen) -> Result<(), Failure> {
        self.ready += self.readiness.drain();
        self.drain_telemetry()?;
        let mut reports: Vec<RequestReport> = Vec::new();
        self.control.drain(|report| reports.push(*report));
        self.movement.drain(|report| reports.push(*report));
        if let (Some(mission), Some(began)) = (&mut self.mission, self.began) {
            for report in &reports {
                if let Some(outcome) = mission.report(report) {
                    screen
                        .outcome(outcome, began.elapsed())
                        .map_err(Failure::output)?;
                }
            }
            for request in mission.next_requests(fresh_request_id) {
                match request {
                    Request::Control(control) => self.control.send(&control),
                    Request::Movement(movement) => self.movement.send(&movement),
                }
                .map_err(Failure::internal)?;
            }
        }
        let counts = self.counts();
        screen
            .draw(self.mission.as_ref(), &self.watch, &counts)
            .map_err(Failure::output)
    }

    fn drain_telemetry(&mut self) -> Result<(), Failure> {
        let watch = &mut self.watch;
        self.dsp
            .drain(|sample| watch.dsp(sample))
            .map_err(Failure::internal)?;
        self.hero
            .drain(|sample| watch.hero(sample, MonotonicNs::now()))
            .map_err(Failure::internal)?;
        self.state
            .drain(|state| watch.state(state))
            .map_err(Failure::internal)?;
        Ok(())
    }

    fn sleep(&mut self) -> Result<(), Failure> {
        let mut signals = Descriptor::new(self.termination.as_fd());
        let mut readiness = Descriptor::new(self.readiness.as_fd());
        let processes = self.processes.iter();
        let mut processes: Vec<_> = processes
            .map(|process| Descriptor::new(process.as_fd()))
            .collect();
        let ports: [&mut dyn Source; 7] = [
            &mut signals,
            &mut readiness,
            &mut self.control,
            &mut self.movement,
            &mut self.dsp,
            &mut self.hero,
            &mut self.state,
        ];
        let processes = processes
            .iter_mut()
            .map(|process| process as &mut dyn Source);
        let mut sources: Vec<_> = ports
            .into_iter()
            .chain(processes)
            .map(|source| ((), source))
            .collect();
        self.waiter
            .wait(&mut sources, Some(LONGEST_WAIT))
            .map_err(Failure::internal)?;
        Ok(())
    }

    /// Ends the processes in the order of the data, so that nothing that was said is lost: what the bridge published
    /// last is translated, logged, recorded and seen here before status and the recorder end.
    pub fn end_processes(&mut self) -> Result<Vec<(&'static str, Option<i32>)>, Failure> {
        let mut exits = Vec::new();
        for name in ["bridge", "status", "sim", "record"] {
            if let Some(process) = self
                .processes
                .iter_mut()
                .find(|process| process.name() == name)
            {
                exits.push((name, process.end()));
            }
            self.drain_telemetry()?;
        }
        self.processes.clear();
        Ok(exits)
    }
}

impl Drop for Stage<'_> {
    /// After an error too: bridge first, the simulator last.
    fn drop(&mut self) {
        while let Some(process) = self.processes.pop() {
            drop(process);
        }
    }
}
