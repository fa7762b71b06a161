//! No state is a dead end: whatever the helicopter and its module do, and whatever became of a mission or a goto, each
//! means of a station (pause, mission, arm, goto, land, return) does what it says or says what stands against it, and
//! so it is after each of them.

use ipc_types::code::{Functionality, ModuleStatus, Reason, Stage};
use mavlink_gateway::message::MISSION_ITEM_INT;
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{Order, OrderKind, Settings};

use crate::common::{HERE, QGC, World, acks, count, long, reposition, texts};

const ACCEPTED: u8 = 0;

/// What a station can press.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Means {
    Pause,
    Mission,
    Arm,
    GoTo,
    Land,
    Return,
}

const ALL: [Means; 6] = [
    Means::Pause,
    Means::Mission,
    Means::Arm,
    Means::GoTo,
    Means::Land,
    Means::Return,
];

impl Means {
    fn message(self) -> (u16, MessageWriter) {
        let with = |param: f32| [param, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        match self {
            Means::Pause => (193, long(193, with(0.0))),
            Means::Mission => (300, long(300, with(0.0))),
            Means::Arm => (400, long(400, with(1.0))),
            Means::GoTo => (192, reposition(6, 374_200_000, -60_010_000, 30.0)),
            Means::Land => (21, long(21, with(0.0))),
            Means::Return => (20, long(20, with(0.0))),
        }
    }
}

/// A gateway, and a bridge that does at once whatever it can.
struct Flight {
    world: World,
    /// The path that is flown, if it is of this gateway.
    under_way: Option<Order>,
}

impl Flight {
    fn begin(is_flying: bool) -> Flight {
        let mut world = match is_flying {
            true => World::flying(),
            false => World::new(Settings::default()),
        };
        world.heartbeat(QGC);
        // A take-off, and two waypoints.
        world.receive(QGC, &QGC.frame(&count(3, 0)));
        for sequence in 0..3 {
            let north = if sequence == 0 {
                0
            } else {
                1_000 * i32::from(sequence)
            };
            let place = |degrees: f64| {
                if sequence == 0 {
                    0
                } else {
                    (degrees * 1e7) as i32
                }
            };
            let item = [0.0, 0.0, 0.0, f32::NAN]
                .into_iter()
                .fold(MessageWriter::new(MISSION_ITEM_INT), MessageWriter::f32);
            let item = item.i32(place(HERE.0) + north).i32(place(HERE.1)).f32(20.0);
            let command = if sequence == 0 { 22 } else { 16 };
            let item = item.u16(sequence).u16(command);
            let item = item.u8(1).u8(1).u8(6).u8(0).u8(1).u8(0);
            world.receive(QGC, &QGC.frame(&item));
        }
        world.serve("");
        let under_way = None;
        let mut flight = Flight { world, under_way };
        flight.settle();
        flight
    }

    /// Later than any copy of a command, and than a text is said only once, with a station that is there.
    fn settle(&mut self) {
        for _ in 0..7 {
            self.world.heartbeat(QGC);
            (0..9).for_each(|_| self.world.tick(100));
            self.world.sent();
        }
    }

    fn is_flying(&self) -> bool {
        self.world.telemetry.flying == 1
    }

    fn set_module(&mut self, status: ModuleStatus, is_blocked: bool) {
        self.world.state.status = status.code();
        self.world.state.blocked = is_blocked.into();
        self.world.tick(20);
    }

    fn set_doing(&mut self, doing: Functionality) {
        self.world.state.functionality = doing.code();
        self.world.tick(20);
    }

    /// Presses it; what the bridge was asked for, whether that was accepted, and what was said.
    fn press(&mut self, means: Means, does_paths: bool) -> (Vec<OrderKind>, bool, String) {
        self.settle();
        let (command, message) = means.message();
        self.world.receive(QGC, &QGC.frame(&message));
        let mut kinds = Vec::new();
        for _ in 0..8 {
            self.world.serve("");
            for order in self.world.orders() {
                kinds.push(order.kind);
                self.carry_out(order, does_paths);
            }
        }
        let sent = self.world.sent();
        let said: Vec<String> = texts(&sent).into_iter().map(|(_, text)| text).collect();
        let answers = acks(&sent).into_iter().filter(|ack| ack.0 == command);
        let answers: Vec<u8> = answers.map(|ack| ack.1).collect();
        assert_eq!(answers.len(), 1, "{means:?}: {answers:?}, {said:?}");
        (kinds, answers[0] == ACCEPTED, said.join("; "))
    }

    fn carry_out(&mut self, order: Order, does_paths: bool) {
        let (is_flying, is_blocked) = (self.is_flying(), self.world.state.blocked == 1);
        let is_path = matches!(order.kind, OrderKind::GoTo(_) | OrderKind::Path);
        let is_take_off = matches!(order.kind, OrderKind::TakeOff(_));
        let refusal = match order.kind {
            OrderKind::Start => None,
            _ if is_blocked && (is_path || is_take_off) => Some(Reason::NotStarted),
            OrderKind::TakeOff(_) if is_flying => Some(Reason::AlreadyFlying),
            OrderKind::TakeOff(_) => None,
            _ if !is_flying => Some(Reason::NotFlying),
            _ => None,
        };
        if let Some(reason) = refusal {
            return self.world.report(&order, Stage::Refused, reason);
        }
        if order.kind != OrderKind::Start
            && let Some(path) = self.under_way.take()
        {
            self.world.report(&path, Stage::Aborted, Reason::Replaced);
        }
        self.world.report(&order, Stage::Accepted, Reason::None);
        if is_path && !does_paths {
            self.under_way = Some(order);
            return self.set_doing(Functionality::FollowingPath);
        }
        match order.kind {
            OrderKind::Start => self.set_module(ModuleStatus::Running, false),
            OrderKind::TakeOff(_) | OrderKind::Land => {
                let is_up = order.kind != OrderKind::Land;
                self.world.telemetry.flying = is_up.into();
                let height_m = if is_up { 20.0 } else { 0.0 };
                self.world.telemetry.geodetic.altitude_m = HERE.2 + height_m;
            }
            _ => {}
        }
        self.world.report(&order, Stage::Done, Reason::None);
        self.set_doing(Functionality::AtRest);
    }

    /// What the press becomes. On the ground only what begins a flight is known beforehand.
    fn expected(&self, means: Means) -> Option<Vec<&'static str>> {
        let start = ["start"];
        let start = &start[..self.world.state.blocked as usize];
        let then = |kinds: &[&'static str]| Some([start, kinds].concat());
        let kind = self.under_way.map(|order| order.kind);
        match (means, self.is_flying()) {
            (Means::Arm, _) => then(&[]),
            (Means::Mission, false) => then(&["take-off", "path"]),
            // On the ground it is held already.
            (Means::Pause, _) => Some(vec!["hold"]),
            (_, false) => None,
            (Means::Land, _) => Some(vec!["land"]),
            // It is flown already.
            (Means::Mission, _) if kind == Some(OrderKind::Path) => Some(Vec::new()),
            (Means::Mission, _) => then(&["path"]),
            (Means::GoTo, _) => then(&["goto"]),
            (Means::Return, _) => then(&["goto", "land"]),
        }
    }

    /// Presses it, and judges what comes of it.
    fn judge(&mut self, means: Means, what: &str) {
        let what = format!("{what}, {means:?}");
        let expected = self.expected(means);
        let (kinds, is_accepted, said) = self.press(means, true);
        let names: Vec<&str> = kinds.iter().map(|kind| name_of(*kind)).collect();
        let what = format!("{what}: {names:?}, accepted: {is_accepted}, {said}");
        match expected {
            // A mission that was paused in the air does not begin on the ground: the station chooses its first item.
            _ if means == Means::Mission && !is_accepted && !self.is_flying() => {
                assert!(said.contains("mission was refused"), "{what}");
                let first = long(224, [0.0; 7]);
                self.settle();
                self.world.receive(QGC, &QGC.frame(&first));
                assert_eq!(acks(&self.world.sent()), [(224, ACCEPTED, 0)], "{what}");
                let (_, is_accepted, said) = self.press(means, true);
                assert!(is_accepted && self.is_flying(), "{what}; then {said}");
            }
            Some(expected) => {
                assert!(is_accepted && names == expected, "{what}, not {expected:?}");
            }
            None => assert!(!is_accepted && !said.is_empty(), "{what}"),
        }
    }
}

fn name_of(kind: OrderKind) -> &'static str {
    match kind {
        OrderKind::Start => "start",
        OrderKind::Stop => "stop",
        OrderKind::TakeOff(_) => "take-off",
        OrderKind::Land => "land",
        OrderKind::Hold => "hold",
        OrderKind::GoTo(_) => "goto",
        OrderKind::Path => "path",
        _ => "another",
    }
}

/// Brings a flight into a state.
type Coming = fn(&mut Flight);

/// How the helicopter came to where it is.
const STATES: [(&str, Coming); 8] = [
    ("standing", |_| ()),
    ("hovering", |_| ()),
    ("a mission is flown", |flight| {
        flight.press(Means::Mission, false);
    }),
    ("a mission is paused", |flight| {
        flight.press(Means::Mission, false);
        flight.press(Means::Pause, false);
    }),
    ("a mission was aborted", |flight| {
        flight.press(Means::Mission, false);
        abort(flight);
    }),
    ("a goto is flown", |flight| {
        flight.press(Means::GoTo, false);
    }),
    ("a goto was aborted", |flight| {
        flight.press(Means::GoTo, false);
        abort(flight);
    }),
    ("another program's path is flown", |flight| {
        flight.set_doing(Functionality::FollowingPath);
    }),
];

/// The path under way ends with a fatal error of the DSP, and the module with it.
fn abort(flight: &mut Flight) {
    let path = flight.under_way.take().expect("a path");
    flight
        .world
        .report(&path, Stage::Aborted, Reason::DspFatalError);
    flight.set_module(ModuleStatus::Aborted, true);
    flight.set_doing(Functionality::AtRest);
}

#[test]
fn a_station_gets_out_of_every_state_by_its_own_means() {
    let modules = [
        (ModuleStatus::Running, false),
        (ModuleStatus::WaitingDataToStart, true),
        (ModuleStatus::Ended, true),
        (ModuleStatus::Aborted, true),
    ];
    for (state, come_to) in STATES {
        for module in modules {
            let begin = || {
                let mut flight = Flight::begin(state != "standing");
                come_to(&mut flight);
                let is_free = flight.world.state.functionality == Functionality::AtRest.code();
                if is_free {
                    flight.set_module(module.0, module.1);
                }
                (flight, is_free)
            };
            // While something is flown the module runs.
            if !begin().1 && module != modules[0] {
                continue;
            }
            for first in ALL {
                for second in ALL {
                    let (mut flight, _) = begin();
                    let what = format!("{state}, module {module:?}");
                    flight.judge(first, &what);
                    flight.judge(second, &format!("{what}, {first:?}, then"));
                }
            }
        }
    }
}
