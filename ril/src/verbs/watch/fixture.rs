//! The screen of robots in flight, for its tests.

use ipc_types::RobotId;
use ipc_types::outline::Outline;
use operator::robot::chart::Chart;
use operator::robot::clock::Clocks;
use operator::robot::fixture::{at, fly, outline};

use super::app::App;

/// The clock at `ms`; the flight begins at 12:00:00.
pub fn clock(ms: u64) -> Clocks {
    Clocks {
        now: at(ms),
        zero_unix_ns: 1_800_014_400_000_000_000 - at(0).0,
    }
}

/// So many robots, of which the first has flown.
pub fn app(robots: u32) -> App {
    let robots: Vec<RobotId> = (1..=robots).filter_map(RobotId::new).collect();
    let mut app = App::new(&robots, Chart::from(&outline()));
    for robot in app.robots_mut() {
        robot.held(&Outline {
            path: Vec::new(),
            ..outline()
        });
    }
    fly(&mut app.robots_mut()[0]);
    app
}
