//! Makes the pictures that the README shows: of `ril watch` from a simulated flight of real processes, and of
//! `ril plan check`.
//!
//! ```sh
//! cargo run -p ril --example picture -- watch docs/watch.svg
//! cargo run -p ril --example picture -- plan docs/plan-check.svg
//! ```
//!
//! A helicopter takes off inside a geofence with a mast in it and flies a square. The picture is what `ril watch` draws
//! when it is on its way to the third corner. The processes are this program itself: with the first argument `be-ril`
//! it is `ril`.

mod svg;

use std::fs;
use std::process::ExitCode;

use ipc_types::outline::OutlineReader;
use ipc_types::payload::{BridgeOutline, HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, RobotId, StateOf, StatusModule, Subscriber, Waiter};
use operator::render::terminal::Key;
use operator::robot::chart::Chart;
use operator::robot::clock::WallClock;
use operator::robot::model::Process as Kind;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ril::verbs::watch::app::App;
use ril::verbs::watch::view::{self, Glyphs};
use ril_tests::watchdog::DEFAULT_LIMIT;
use ril_tests::{Process, Sandbox, TestDomain};

const BE_RIL: &str = "be-ril";

/// Size of the terminal.
const COLUMNS: u16 = 104;
const ROWS: u16 = 30;

/// Width of what `ril plan` prints.
const PLAN_COLUMNS: u16 = 80;

/// The corners of the square, each to be flown at 20 m over the simulator's ground.
const CORNERS: [[f64; 2]; 4] = [
    [37.41130, -6.00112],
    [37.41130, -6.00050],
    [37.41105, -6.00050],
    [37.41105, -6.00112],
];

/// The bridge's configuration: no flight of a machine that stalls ends early, and a fence.
const BRIDGE: &str = "\
[link]
pc_timeout_ms = 60000
[fence]
ceiling_m = 120.0
[[fence.area]]
name = \"field\"
kind = \"inclusion\"
polygon = [[37.41092, -6.00125], [37.41140, -6.00125], [37.41140, -6.00030], [37.41092, -6.00030]]
[[fence.area]]
name = \"mast\"
kind = \"exclusion\"
centre = [37.41118, -6.00080]
radius_m = 7.0
";

fn main() -> ExitCode {
    let mut args = std::env::args_os();
    let name = args.next();
    let first = args.next().unwrap_or_default();
    if first == BE_RIL {
        return ril::main(name.into_iter().chain(args));
    }
    let file = args.next();
    let (picture, file) = match (first.to_str(), file) {
        (Some("watch"), Some(file)) => (fly_and_draw(), file),
        (Some("plan"), Some(file)) => (check_and_draw(), file),
        _ => {
            eprintln!(
                "name picture and file: cargo run -p ril --example picture -- watch docs/watch.svg"
            );
            return ExitCode::from(2);
        }
    };
    if let Err(error) = fs::write(&file, picture) {
        eprintln!("{}: {error}", file.display());
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// A take-off, a leg through the exclusion area, a camera that the helicopter does not have, and a landing.
const PLAN: &str = "\
QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t37.41095\t-6.00110\t10\t1
1\t0\t3\t22\t0\t0\t0\t0\t37.41095\t-6.00110\t20\t1
2\t0\t3\t16\t0\t0\t0\t0\t37.41130\t-6.00112\t20\t1
3\t0\t3\t16\t0\t0\t0\t0\t37.41105\t-6.00050\t20\t1
4\t0\t2\t206\t25\t0\t0\t0\t0\t0\t0\t1
5\t0\t3\t21\t0\t0\t0\t0\t37.41105\t-6.00050\t0\t1
";

/// A folder with the configuration of the pictures, in which this program is `ril`.
fn sandbox() -> Sandbox {
    let this = std::env::current_exe().expect("a name");
    let ril = [this.as_os_str(), BE_RIL.as_ref()];
    let sandbox = Sandbox::new(ril, "picture", DEFAULT_LIMIT);
    sandbox.write("bridge.toml", BRIDGE);
    sandbox
}

/// What `ril plan check` says of a plan inside the geofence of the pictures.
fn check_and_draw() -> String {
    let sandbox = sandbox();
    sandbox.write("survey.waypoints", PLAN);
    let lines = sandbox.finish("plan check survey.waypoints").stdout;
    let height = u16::try_from(lines.len()).expect("a screen");
    let mut buffer = Buffer::empty(Rect::new(0, 0, PLAN_COLUMNS, height));
    for (row, line) in (0..).zip(&lines) {
        let colour = match line.split_whitespace().next() {
            Some("FORBIDS") => Color::Red,
            Some("warns") => Color::Yellow,
            _ => Color::Reset,
        };
        buffer.set_string(0, row, line, Style::new().fg(colour));
    }
    svg::svg(&buffer, "ril plan check survey.waypoints")
}

/// A flight, up to the picture.
fn fly_and_draw() -> String {
    let sandbox = sandbox();
    let sim = sandbox.start_ready("run sim --link dsp");
    let bridge = sandbox.start_ready("run bridge --port dsp");
    let status = sandbox.start_ready("run status");
    let mut screen = Watched::new(&sandbox.domain);
    let is_up = |state: &ModuleState| {
        state.link.state() == Some(ipc_types::code::LinkState::Up)
            && state.link.telemetry_published > 0
    };
    screen.until(is_up);
    let path: Vec<String> = CORNERS
        .iter()
        .map(|[lat, lon]| format!("{lat},{lon},30"))
        .collect();
    for order in ["start".to_owned(), "takeoff --altitude 20".to_owned()] {
        let mut process = sandbox.start(&order);
        screen.until_ended(&mut process);
    }
    let order = sandbox.start(&format!("goto {}", path.join(" ")));
    screen.until(|state| {
        state.movement.waypoints_reached == 2 && state.movement.distance_to_go_m < 58.0
    });
    let picture = svg::svg(&screen.drawn(), "ril watch");
    drop(screen);
    drop(order);
    for process in [status, bridge, sim] {
        process.end();
    }
    picture
}

/// What `ril watch` would show.
struct Watched {
    app: App,
    state: Subscriber<ModuleState>,
    hero: Subscriber<HeroTelemetry>,
    status: Subscriber<StateOf<StatusModule>>,
    outline: Subscriber<BridgeOutline>,
    reader: OutlineReader,
    newest: Option<ModuleState>,
}

impl Watched {
    fn new(domain: &TestDomain) -> Watched {
        let ipc = domain.join_as(RobotId::DEFAULT, "picture");
        let mut app = App::new(&[RobotId::DEFAULT], Chart::default());
        let now = MonotonicNs::now();
        // All of the fence.
        for _ in 0..2 {
            app.key(Key::Char('z'), now);
        }
        for process in [Kind::Bridge, Kind::Status] {
            app.robots_mut()[0].provider(process, true, now);
        }
        Watched {
            app,
            state: ipc.subscriber().expect("a port"),
            hero: ipc.subscriber().expect("a port"),
            status: ipc.subscriber().expect("a port"),
            outline: ipc.subscriber().expect("a port"),
            reader: OutlineReader::new(),
            newest: None,
        }
    }

    /// Takes what comes until a state is right.
    fn until(&mut self, is_right: impl Fn(&ModuleState) -> bool) {
        while !self.newest.as_ref().is_some_and(&is_right) {
            self.take();
        }
    }

    /// Takes what comes until a command has ended.
    fn until_ended(&mut self, process: &mut Process) {
        while process
            .lines()
            .iter()
            .all(|line| !line.text.contains(": done"))
        {
            self.take();
        }
        process.wait_exit();
    }

    fn take(&mut self) {
        let waiter = Waiter::new();
        let mut sources: [((), &mut dyn ipc_types::Source); 4] = [
            ((), &mut self.state),
            ((), &mut self.hero),
            ((), &mut self.status),
            ((), &mut self.outline),
        ];
        waiter.wait(&mut sources, None).expect("a wait");
        let now = MonotonicNs::now();
        let robot = &mut self.app.robots_mut()[0];
        self.status
            .drain(|status| robot.status(status, now))
            .expect("samples");
        let reader = &mut self.reader;
        self.outline
            .drain(|piece| {
                reader.take(piece);
            })
            .expect("samples");
        if let Some(held) = reader.outline() {
            robot.held(held);
        }
        let newest = &mut self.newest;
        self.state
            .drain(|state| {
                robot.state(state, now);
                *newest = Some(*state);
            })
            .expect("samples");
        self.hero
            .drain(|hero| robot.hero(hero, now))
            .expect("samples");
        self.app.judge(now);
    }

    fn drawn(&self) -> Buffer {
        let (clock, _) = WallClock::default().look(MonotonicNs::now());
        let mut buffer = Buffer::empty(Rect::new(0, 0, COLUMNS, ROWS));
        view::draw(&self.app, clock, Glyphs::Unicode, &mut buffer);
        buffer
    }
}
