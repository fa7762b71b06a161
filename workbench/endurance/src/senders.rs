//! Who has ordered a path is killed or stopped at a random moment of it, from the start of its process on: does the
//! helicopter hover, and is no other order touched?
//!
//! | what happens | what must follow |
//! |---|---|
//! | the sender is killed | the helicopter hovers |
//! | it is stopped, and has a lease | the helicopter hovers when the lease ends |
//! | it is stopped, and has none | its path goes on |
//! | it is killed while another sender's path takes the place of its own | the other path goes on |
//!
//! The senders are `ril goto`, programs in C, C++ and Python, and a module of module-kit, which is this program again.

use std::ffi::OsString;
use std::process::Command;
use std::time::Duration;

use fastrand::Rng;
use ipc_types::code::{DspPathState, Functionality};
use ipc_types::payload::{ModuleState, MovementData, WaypointPosition};
use ipc_types::{
    Client, Domain, Ipc, Module as _, MonotonicNs, OpenError, RobotId, fresh_request_id, module,
};
use measure::{Outcome, Times};
use module_kit::{Manager, Sources, Work, run_with};
use ril_tests::Process;
use ril_tests::languages::skip;
use ril_tests::process::{Finished, Signal, WAIT_LIMIT};
use ril_tests::senders::{LANGUAGES, path_sender};
use runtime::exit::Failure;
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::listener::Listener;
use crate::site::{Site, pass};

/// Longest time from the loss, or from the end of the lease, to the hover.
const HOVERS_WITHIN: Duration = Duration::from_secs(1);

/// Lease of those that are stopped with one: the shortest.
const LEASE_MS: u32 = 500;

/// A sender is lost within this part of the time until its path is flown, as the first start took it, and then of
/// [`FLOWN`].
const UNTIL_FLOWN: f64 = 1.2;
const FLOWN: Duration = Duration::from_millis(400);

/// For so long a state must stay before it counts.
const STAYS: Duration = Duration::from_millis(150);

/// Where paths end, by turns, so that none does: degrees, 1.5 km and more from the start.
const AWAY: [f64; 2] = [37.4290, 37.3930];
const LONGITUDE_DEG: f64 = -6.0010;
const ALTITUDE_M: f64 = 25.0;

/// The word with which this program is the module.
pub const AS_MODULE: &str = "as-module";

/// What happens to a sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LossKind {
    Killed,
    StoppedWithLease,
    Stopped,
    Replaced,
}

/// A program that orders a path.
struct PathProgram {
    name: &'static str,
    /// The beginning of its command line, behind which latitude and lease come; none if it is `ril goto`.
    words: Vec<OsString>,
    /// From its start to its path, as the first one took it.
    until_flown: Duration,
    lost: u32,
}

struct Trials<'a> {
    site: &'a Site,
    chance: Rng,
    programs: Vec<PathProgram>,
    states: Listener<ModuleState>,
    /// The newest state.
    state: ModuleState,
    turn: usize,
    lost: u32,
    in_flight: u32,
    untouched: u32,
    hovers: Times,
    faults: Vec<String>,
}

/// Loses senders as planned.
pub fn run(site: &Site) {
    let chain = site.start_flight();
    let states = Listener::start(&site.domain, RobotId::DEFAULT, |state: &ModuleState| *state);
    let mut trials = Trials {
        site,
        chance: site.chance(0),
        programs: programs(site),
        state: states.next().kept,
        states,
        turn: 0,
        lost: 0,
        in_flight: 0,
        untouched: 0,
        hovers: Times::default(),
        faults: Vec::new(),
    };
    (0..trials.programs.len()).for_each(|index| trials.measure_start(index));
    while trials.lost < site.plan.count(1000) && site.goes_on() {
        trials.lose_one();
    }
    let outcome = trials.end();
    site.end(chain, true);
    site.show(outcome);
}

/// What this machine can start. The short form runs in another program, which is no module.
fn programs(site: &Site) -> Vec<PathProgram> {
    let mut programs = vec![("ril", vec![])];
    if !site.plan.is_short {
        let this = std::env::current_exe().expect("this program has a path");
        programs.push(("module-kit", vec![this.into(), AS_MODULE.into()]));
    }
    for language in LANGUAGES {
        match path_sender(language, site.folder()) {
            Ok(words) => programs.push((language, words)),
            Err(why) => skip(language, &why),
        }
    }
    let program = |(name, words)| PathProgram {
        name,
        words,
        until_flown: Duration::ZERO,
        lost: 0,
    };
    programs.into_iter().map(program).collect()
}

impl Trials<'_> {
    /// Starts a sender, which orders a path to the other end. None of them takes another path's place.
    fn start(&mut self, index: usize, lease_ms: u32) -> Process {
        let Some((word, more)) = self.programs[index].words.split_first() else {
            return match lease_ms {
                0 => self.goto(""),
                ms => self.goto(&format!("--lease {ms}ms")),
            };
        };
        let mut command = Command::new(word);
        command.args(more);
        command.args([self.far_away().to_string(), lease_ms.to_string()]);
        self.site.spawn(command)
    }

    fn goto(&mut self, options: &str) -> Process {
        let latitude = self.far_away();
        let to = format!("{latitude},{LONGITUDE_DEG},{ALTITUDE_M}");
        self.site.start(&format!("goto {to} {options}"))
    }

    fn far_away(&mut self) -> f64 {
        self.turn += 1;
        AWAY[self.turn % AWAY.len()]
    }

    /// How long a program takes until its path is flown.
    fn measure_start(&mut self, index: usize) {
        let started = MonotonicNs::now();
        let sender = self.start(index, 0);
        let flown = self.until_stays(started, follows);
        self.programs[index].until_flown = flown.since(started);
        end(sender);
        self.until_stays(started, hovers);
    }

    /// Loses a sender at a random moment, and looks what follows. In the end the helicopter hovers.
    fn lose_one(&mut self) {
        use LossKind::{Killed, Replaced, Stopped, StoppedWithLease};
        let fate = self
            .chance
            .choice([Killed, StoppedWithLease, Stopped, Replaced]);
        let fate = fate.expect("there are some");
        let index = self.chance.usize(..self.programs.len());
        let lease_ms = match fate {
            StoppedWithLease => LEASE_MS,
            _ => 0,
        };
        let begin = MonotonicNs::now();
        let sender = self.start(index, lease_ms);
        let until_flown = self.programs[index].until_flown.mul_f64(UNTIL_FLOWN);
        pass(&mut self.chance, until_flown + FLOWN);
        let newer = (fate == Replaced).then(|| {
            // What was ordered last holds: the other order must be the later one.
            self.until_stays(begin, follows);
            let newer = self.goto("--preempt");
            pass(
                &mut self.chance,
                self.programs[0].until_flown.mul_f64(UNTIL_FLOWN),
            );
            newer
        });
        self.take_states(MonotonicNs::now());
        let (flown, path) = (follows(&self.state), self.state.movement.path_id);
        self.lost += 1;
        self.programs[index].lost += 1;
        self.in_flight += u32::from(flown);
        let what = format!("{} of {}, {fate:?}", self.lost, self.programs[index].name);
        let lost = MonotonicNs::now();
        if fate == StoppedWithLease || fate == Stopped {
            sender.signal(Signal::STOP);
        }
        if fate == StoppedWithLease {
            self.must_hover(lost, lease_ms, &what);
        }
        if fate == Stopped && flown {
            self.must_fly_on(path, &what);
        }
        let killed = MonotonicNs::now();
        let finished = end(sender);
        if let Some(mut newer) = newer {
            newer.wait_for_text("goto: progress");
            self.take_states(MonotonicNs::now() + STAYS);
            self.must_fly_on(self.state.movement.path_id, &what);
            let killed = MonotonicNs::now();
            end(newer);
            self.must_hover(killed, 0, &what);
        } else if let Some(code) = finished.code()
            && fate != StoppedWithLease
        {
            self.faults.push(format!(
                "{what}: it ended with {code}: {:?}",
                finished.stderr
            ));
        }
        if fate == Killed || fate == Stopped {
            self.must_hover(killed, 0, &what);
        }
    }

    /// The helicopter hovers in time after the loss, and goes on to.
    fn must_hover(&mut self, lost: MonotonicNs, lease_ms: u32, what: &str) {
        let due = lost + Duration::from_millis(lease_ms.into());
        let took = self.until_stays(lost, hovers).since(due);
        self.hovers.push(took);
        if took > HOVERS_WITHIN && !self.site.plan.is_short {
            self.faults
                .push(format!("{what}: it hovers after {took:?}"));
        }
    }

    /// The path is flown, and goes on.
    fn must_fly_on(&mut self, path_id: u64, what: &str) {
        self.untouched += 1;
        self.take_states(MonotonicNs::now() + STAYS);
        if !follows(&self.state) || self.state.movement.path_id != path_id {
            self.faults.push(format!(
                "{what}: path {path_id} does not go on: {:?}",
                self.state
            ));
        }
    }

    /// Takes the states that come until then.
    fn take_states(&mut self, until: MonotonicNs) {
        if let Some(newest) = self.states.until(until).last() {
            self.state = newest.kept;
        }
    }

    /// Waits until the state is right and stays so. Gives since when it was, but not before `begin`.
    fn until_stays(
        &mut self,
        begin: MonotonicNs,
        is_right: fn(&ModuleState) -> bool,
    ) -> MonotonicNs {
        self.take_states(MonotonicNs::now());
        let end = MonotonicNs::now() + WAIT_LIMIT;
        loop {
            while !is_right(&self.state) {
                assert!(MonotonicNs::now() < end, "never: {:?}", self.state);
                self.state = self.states.next().kept;
            }
            let since = MonotonicNs(self.state.published_ns).max(begin);
            let heard = self.states.until(MonotonicNs::now() + STAYS);
            let stays = heard.iter().all(|heard| is_right(&heard.kept));
            if let Some(newest) = heard.last() {
                self.state = newest.kept;
            }
            if stays {
                return since;
            }
        }
    }

    fn end(self) -> Outcome {
        self.states.end();
        let mut outcome = Outcome::default();
        outcome.cell("senders lost", self.lost);
        for program in &self.programs {
            outcome.cell(program.name, program.lost);
        }
        outcome.cell("in flight", self.in_flight);
        outcome.cell("paths that must go on", self.untouched);
        outcome.cell("until the hover", &self.hovers);
        outcome.none("exceptions", self.faults.len());
        outcome.require(self.faults.is_empty(), self.faults.join("\n"));
        outcome
    }
}

/// `kill -9`, also of a process that is stopped.
fn end(mut process: Process) -> Finished {
    process.signal(Signal::KILL);
    process.wait_exit()
}

fn follows(state: &ModuleState) -> bool {
    state.functionality() == Some(Functionality::FollowingPath)
}

fn hovers(state: &ModuleState) -> bool {
    let is_at_rest = state.functionality() == Some(Functionality::AtRest);
    is_at_rest && state.link.dsp_path() == Some(DspPathState::Empty)
}

/// A module that orders a path when it begins: latitude and lease are its configuration.
struct PathModule {
    movement: Client<MovementData>,
}

module!(PathModule, "path_module", 1009);

impl Work for PathModule {
    type Config = (f64, u32);

    fn open((latitude_deg, lease_ms): (f64, u32), ipc: &Ipc) -> Result<PathModule, OpenError> {
        let mut movement = ipc.client()?;
        let position = WaypointPosition {
            latitude_deg,
            longitude_deg: LONGITUDE_DEG,
            altitude_m: ALTITUDE_M,
        };
        let id = fresh_request_id();
        let path = MovementData::waypoint(id, id, position, true, true);
        let path = MovementData { lease_ms, ..path };
        movement.send(&path).expect("a bridge");
        Ok(PathModule { movement })
    }

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.movement);
    }

    fn step(&mut self, _: MonotonicNs, _: &mut Manager) {
        self.movement.drain(|_| {});
    }
}

/// The module's process, whose last two words are latitude and lease.
///
/// # Errors
///
/// Why it cannot run.
pub fn be_module(words: &[String]) -> Result<(), Failure> {
    let [.., latitude, lease_ms] = words else {
        return Err(Failure::internal("it needs a latitude and a lease"));
    };
    let path = latitude
        .parse()
        .ok()
        .zip(lease_ms.parse().ok())
        .expect("numbers");
    let domain = Domain::from_environment().expect("a domain");
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, PathModule::NAME).expect("shared memory");
    let termination = Termination::install().expect("signals");
    run_with::<PathModule>(path, &ipc, &termination, &Notifier::from_env())
}
