//! The module against stand-ins for bridge and status and, where `ril` is at hand, in the real chain.

use std::thread;
use std::time::Duration;

use battery_watch::{BatteryWatch, Cells, Config, LANDING, NOT_LANDED, SetLimit};
use ipc_types::code::{ControlCommand, ModuleStatus, Reason, Stage};
use ipc_types::module::State;
use ipc_types::payload::{HeroSupply, HeroTelemetry, MovementData, RequestReport};
use ipc_types::{
    Client, ControlOf, Ipc, MonotonicNs, Request, StateOf, Subscriber, fresh_request_id,
};
use module_kit::runtime::notify::Notifier;
use module_kit::runtime::signal::Termination;
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{
    Answer, Process, Received, Sandbox, Script, StandInBridge, StandInStatus, TestDomain,
    UnreadOutput, sandbox,
};

/// The module as a process, and an operator beside it.
struct Rig {
    status: StandInStatus,
    bridge: StandInBridge,
    operator: Operator,
    module: Process,
    /// Last: it asserts that the others have left nothing.
    domain: TestDomain,
}

struct Operator {
    control: Client<ControlOf<BatteryWatch>>,
    limits: Client<SetLimit>,
    movement: Client<MovementData>,
    states: Subscriber<StateOf<BatteryWatch>>,
    cells: Subscriber<Cells>,
}

impl Operator {
    fn join(ipc: &Ipc) -> Operator {
        Operator {
            control: ipc.client().unwrap(),
            limits: ipc.client().unwrap(),
            movement: ipc.client().unwrap(),
            states: ipc.subscriber().unwrap(),
            cells: ipc.subscriber().unwrap(),
        }
    }

    fn control(&mut self, command: ControlCommand) -> RequestReport {
        let request = ControlOf::command(fresh_request_id(), command);
        ask(&mut self.control, &request)
    }

    /// Waits for a state such as `wanted` says.
    fn wait_for_state(&mut self, wanted: impl Fn(&State) -> bool) -> State {
        let mut found = None;
        while found.is_none() {
            assert_ne!(
                self.states.wait(WAIT_LIMIT).unwrap(),
                ipc_types::Wake::TimedOut
            );
            self.states
                .drain(|state| found = found.or(Some(**state).filter(&wanted)))
                .unwrap();
        }
        found.unwrap()
    }

    /// Waits for the cells of a sample.
    fn wait_for_cells(&mut self, wanted: impl Fn(&Cells) -> bool) -> Cells {
        let mut found = None;
        while found.is_none() {
            assert_ne!(
                self.cells.wait(WAIT_LIMIT).unwrap(),
                ipc_types::Wake::TimedOut
            );
            self.cells
                .drain(|cells| found = found.or(Some(*cells).filter(&wanted)))
                .unwrap();
        }
        found.unwrap()
    }
}

/// Sends a request and gives the final report.
fn ask<R: Request>(client: &mut Client<R>, request: &R) -> RequestReport {
    let mut handle = client.request(request).unwrap();
    handle.result_timeout(WAIT_LIMIT).unwrap().unwrap()
}

fn answer(report: &RequestReport) -> (Option<Stage>, Option<Reason>, u32) {
    (report.stage(), report.reason(), report.imi_error)
}

const DONE: (Option<Stage>, Option<Reason>, u32) = (Some(Stage::Done), Some(Reason::None), 0);

fn refused(reason: Reason, error: u32) -> (Option<Stage>, Option<Reason>, u32) {
    (Some(Stage::Refused), Some(reason), error)
}

impl Rig {
    fn new() -> Rig {
        let domain = TestDomain::new();
        let status = StandInStatus::start(&domain);
        let bridge = StandInBridge::start(&domain);
        let module = module(&domain);
        let operator = Operator::join(&domain.join("operator"));
        Rig {
            status,
            bridge,
            operator,
            module,
            domain,
        }
    }

    /// Publishes six seconds of a flight with this voltage of the battery, and waits until the module has seen all.
    fn fly(&mut self, battery_v: f32) -> Cells {
        let flight = Script::at(37.4, -5.9, 10.0)
            .every_ms(500)
            .take_off(12.0)
            .hero();
        let mut received = MonotonicNs::now();
        for sample in flight.iter().filter(|sample| sample.is_flying()) {
            received = received + Duration::from_millis(500);
            self.status.publish(&HeroTelemetry {
                received_ns: received.0,
                supply: HeroSupply {
                    battery_v,
                    ..sample.supply
                },
                ..*sample
            });
        }
        self.operator
            .wait_for_cells(|cells| cells.received_ns == received.0)
    }

    /// Asserts that the bridge has got nothing since the last look: its next request is that of the operator.
    fn assert_bridge_was_left_alone(&mut self) {
        let hold = MovementData::hold(fresh_request_id());
        ask(&mut self.operator.movement, &hold);
        assert_eq!(self.bridge.next_request(), Received::Movement(hold));
    }

    fn end(mut self) {
        self.module.signal(Signal::TERM);
        self.module.exits(0);
    }
}

fn module(domain: &TestDomain) -> Process {
    let mut module = Process::start::<&str>(domain, env!("CARGO_BIN_EXE_battery-watch"), []);
    module.wait_for_text("ready");
    module
}

#[test]
fn a_battery_that_stays_low_is_landed_once_and_that_cannot_be_stopped() {
    let mut rig = Rig::new();
    assert_eq!(answer(&rig.operator.control(ControlCommand::Start)), DONE);
    rig.bridge.answer_next(Answer::under_way());
    let cells = rig.fly(18.0);
    assert_eq!((cells.mean_v, cells.limit_v, cells.cells), (3.0, 3.5, 6));
    assert!(cells.below_s >= 3.0, "{cells:?}");
    let Received::Movement(land) = rig.bridge.next_request() else {
        panic!("no movement");
    };
    let expected = MovementData {
        issued_ns: land.issued_ns,
        ..MovementData::land(land.request_id).preempting()
    };
    assert_eq!(land, expected);

    let state = rig
        .operator
        .wait_for_state(|state| state.functionality == LANDING);
    assert_eq!((state.module_id, state.doing()), (1001, Some("landing")));
    assert_eq!(
        (state.status(), state.unable_to_abort),
        (Some(ModuleStatus::Running), 1)
    );
    let stopped = rig.operator.control(ControlCommand::Stop);
    assert_eq!(answer(&stopped), refused(Reason::UnableToAbort, 2));
    let restarted = rig.operator.control(ControlCommand::Start);
    assert_eq!(answer(&restarted), refused(Reason::AlreadyRunning, 1));

    let done = RequestReport::new(Stage::Done, Reason::None);
    rig.bridge.report(land.request_id, &done).unwrap();
    rig.operator
        .wait_for_state(|state| state.status() == Some(ModuleStatus::Ended));
    rig.assert_bridge_was_left_alone();
    rig.end();
}

#[test]
fn a_module_whose_log_nobody_reads_starts_works_and_ends() {
    let sandbox = Sandbox::of(env!("CARGO_BIN_EXE_battery-watch"));
    let log = UnreadOutput::full(&sandbox);
    let status = StandInStatus::start(&sandbox.domain);
    let bridge = StandInBridge::start(&sandbox.domain);
    let module = log.start(&sandbox, "");
    let operator = Operator::join(&sandbox.domain.join("operator"));
    let mut rig = Rig {
        status,
        bridge,
        operator,
        module,
        // That of the sandbox is asserted to be empty after this one.
        domain: TestDomain::new(),
    };
    assert_eq!(answer(&rig.operator.control(ControlCommand::Start)), DONE);
    rig.operator
        .wait_for_state(|state| state.status() == Some(ModuleStatus::Running));
    rig.fly(25.0);
    rig.end();
}

#[test]
fn without_a_start_and_after_a_stop_nothing_is_commanded() {
    let mut rig = Rig::new();
    let state = rig.operator.wait_for_state(|_| true);
    assert_eq!(state.status(), Some(ModuleStatus::WaitingDataToStart));
    rig.fly(18.0);
    rig.assert_bridge_was_left_alone();
    rig.fly(25.0);
    assert_eq!(answer(&rig.operator.control(ControlCommand::Start)), DONE);
    assert_eq!(answer(&rig.operator.control(ControlCommand::Stop)), DONE);
    rig.fly(18.0);
    rig.assert_bridge_was_left_alone();
    let state = rig
        .operator
        .wait_for_state(|state| state.status() == Some(ModuleStatus::Ended));
    assert!(state.is_blocked());
    rig.end();
}

#[test]
fn a_landing_that_is_refused_aborts_the_module_until_the_next_start() {
    let mut rig = Rig::new();
    assert_eq!(answer(&rig.operator.control(ControlCommand::Start)), DONE);
    rig.bridge.answer_next(Answer::refuse(Reason::Busy));
    rig.fly(18.0);
    let state = rig.operator.wait_for_state(|state| state.error != 0);
    assert_eq!(
        (state.status(), state.error),
        (Some(ModuleStatus::Aborted), NOT_LANDED)
    );
    assert!(matches!(rig.bridge.next_request(), Received::Movement(_)));
    rig.assert_bridge_was_left_alone();
    assert_eq!(answer(&rig.operator.control(ControlCommand::Start)), DONE);
    rig.end();
}

#[test]
fn the_limit_is_set_by_request_and_each_request_counts_once() {
    let mut rig = Rig::new();
    let set = |rig: &mut Rig, request_id, limit_v| {
        answer(&ask(
            &mut rig.operator.limits,
            &SetLimit {
                request_id,
                limit_v,
            },
        ))
    };
    assert_eq!(set(&mut rig, 7, 2.9), DONE);
    assert_eq!(set(&mut rig, 8, 9.0), refused(Reason::OutOfRange, 0));
    assert_eq!(set(&mut rig, 9, 3.2), DONE);
    assert_eq!(set(&mut rig, 7, 2.9), DONE);
    assert_eq!(rig.fly(20.0).limit_v, 3.2);
    rig.end();
}

#[test]
fn a_second_one_of_the_same_robot_is_refused_by_name() {
    let rig = Rig::new();
    let mut second = Process::start::<&str>(&rig.domain, env!("CARGO_BIN_EXE_battery-watch"), []);
    let finished = second.exits(1);
    let errors = finished.stderr.join("\n");
    assert!(
        errors.contains("already provided by `battery_watch`"),
        "{errors}"
    );
    rig.end();
}

#[test]
fn the_whole_module_runs_in_a_thread_of_the_test() {
    let domain = TestDomain::new();
    let status = StandInStatus::start(&domain);
    let mut operator = Operator::join(&domain.join("operator"));
    let (termination, request) = Termination::by_hand().unwrap();
    let ipc = domain.join("battery_watch");
    let module = thread::spawn(move || {
        let supervisor = Notifier::from_env();
        module_kit::run_with::<BatteryWatch>(Config::default(), &ipc, &termination, &supervisor)
    });
    operator.wait_for_state(|_| true);
    assert_eq!(answer(&operator.control(ControlCommand::Start)), DONE);
    status.publish(&Script::at(37.4, -5.9, 10.0).stand(0.1).hero()[0]);
    operator.wait_for_cells(|cells| cells.cells == 6);
    request.request();
    module.join().unwrap().unwrap();
}

#[test]
fn in_the_real_chain_ril_sees_the_topic_and_the_helicopter_lands() {
    let Some(ril) = sandbox::installed_or_skip() else {
        return;
    };
    let sandbox = Sandbox::of(ril);
    let robot = sandbox.start_robot(1, 1);
    let mut module = module(&sandbox.domain);
    let mut operator = Operator::join(&sandbox.domain.join("operator"));
    operator.wait_for_cells(|_| true);
    let run = |command: &str| sandbox.run(command, 0).stdout.join("\n");
    let topics = run("topic list");
    assert!(topics.contains("battery_watch/cells") && topics.contains("battery_watch/state"));
    let info = run("topic info battery_watch/cells");
    let field = info.lines().find(|line| line.contains("mean_v"));
    assert!(field.is_some_and(|line| line.contains("[V]")), "{info}");
    let echo = run("topic echo battery_watch/cells --count 1 --json");
    assert!(echo.contains("\"cells\":6"));

    run("start");
    run("takeoff --altitude 4");
    run("start --module battery_watch");
    sandbox.run("start --module battery_watch", 5);
    let set = SetLimit {
        request_id: fresh_request_id(),
        limit_v: 4.2,
    };
    assert_eq!(answer(&ask(&mut operator.limits, &set)), DONE);
    operator.wait_for_state(|state| state.functionality == LANDING);
    operator.wait_for_state(|state| state.status() == Some(ModuleStatus::Ended));
    let mut telemetry = sandbox
        .domain
        .join("witness")
        .subscriber::<HeroTelemetry>()
        .unwrap();
    telemetry.wait(WAIT_LIMIT).unwrap();
    assert!(!telemetry.latest().unwrap().unwrap().is_flying());
    run("stop --module battery_watch");
    module.signal(Signal::TERM);
    module.exits(0);
    sandbox.run("stop --module battery_watch", 3);
    robot.end();
}
