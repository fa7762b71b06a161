//! [`Side`]: which side a relay is on, and what the file says about its endpoints.

use super::file::Config;

/// Which side a relay is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Beside the robot.
    Robot,
    /// At a ground station.
    Station,
    /// Between robots and stations.
    Router,
}

impl Side {
    /// All sides.
    pub const ALL: [Side; 3] = [Side::Robot, Side::Station, Side::Router];

    /// Endpoints where this side listens, and those it connects to.
    pub fn endpoints(self, config: &Config) -> (&[String], &[String]) {
        match self {
            Side::Robot => (&config.robot.listen, &config.robot.connect),
            Side::Station => (&config.station.listen, &config.station.connect),
            Side::Router => (&config.router.listen, &config.router.connect),
        }
    }

    /// The keys of the same, those where it listens first.
    pub const fn keys(self) -> [&'static [&'static str]; 2] {
        match self {
            Side::Robot => [&["robot", "listen"], &["robot", "connect"]],
            Side::Station => [&["station", "listen"], &["station", "connect"]],
            Side::Router => [&["router", "listen"], &["router", "connect"]],
        }
    }
}
