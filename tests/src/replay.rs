//! [`Replay`]: a recorded flight (MCAP) on the services of a test's robot, played as far as the test says.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use ipc_types::{Domain, Ipc, MonotonicNs, RobotId};
use recording::play::{PROCESS, PlayableFlight, PlayedServices, Player, Section};

/// In the place of a whole robot: its topics with what was recorded, in the same order. Requests are refused whenever
/// something is played.
///
/// It has no thread and waits for nothing: what is played is there when a call returns. Subscribers keep the newest
/// samples of each topic, 64 and more, so a consumer reads between two calls.
///
/// ```no_run
/// # use std::{path::Path, time::Duration};
/// # use ril_tests::{Replay, TestDomain};
/// # use ipc_types::payload::HeroTelemetry;
/// let domain = TestDomain::new();
/// let mut telemetry = domain.join("consumer").subscriber::<HeroTelemetry>().unwrap();
/// let mut flight = Replay::start(&domain, Path::new("flights/square.mcap"));
/// while flight.play(Duration::from_millis(500)) {
///     telemetry.drain(|sample| assert!(sample.geodetic.altitude_m < 120.0)).unwrap();
/// }
/// ```
pub struct Replay {
    player: Player,
    services: PlayedServices,
    /// How far it was played, since the first message.
    position: Duration,
}

impl Replay {
    /// Provides the services of robot 1 in `domain`. Nothing is published yet.
    ///
    /// # Panics
    ///
    /// When the file is no recording, or the services cannot be provided, with the reason.
    #[track_caller]
    pub fn start(domain: &Domain, file: &Path) -> Replay {
        Replay::start_for(domain, RobotId::DEFAULT, file)
    }

    /// Starts playing `file` as `robot`. The number of the robot that was recorded means nothing.
    ///
    /// # Panics
    ///
    /// As [`Replay::start`].
    #[track_caller]
    pub fn start_for(domain: &Domain, robot: RobotId, file: &Path) -> Replay {
        let flight = match PlayableFlight::open(file) {
            Ok(flight) => Arc::new(flight),
            Err(error) => panic!("{} cannot be played: {error}", file.display()),
        };
        let ipc = Ipc::join(domain, robot, PROCESS).expect("join the test's domain");
        let services = PlayedServices::open(&flight, &ipc).expect("services that can be provided");
        let player = Player::new(flight, Section::default(), MonotonicNs::now());
        let mut player = player.expect("a flight with messages");
        // Only the test lets time pass.
        player.toggle_pause(MonotonicNs::now());
        Replay {
            player,
            services,
            position: Duration::ZERO,
        }
    }

    /// Plays the next message, of whichever topic, and says where in the flight it is, since the first message; nothing
    /// at the end.
    ///
    /// # Panics
    ///
    /// When it cannot be published.
    #[track_caller]
    pub fn step(&mut self) -> Option<Duration> {
        let now = MonotonicNs::now();
        self.player.step(now);
        let due = self.player.next(now)?;
        self.services
            .publish(&due, now)
            .expect("a sample that can be published");
        self.services.service();
        self.position = self.player.position_of(due.index);
        Some(self.position)
    }

    /// Plays the next part of the flight, which lasts so long. False when there is nothing behind it.
    ///
    /// # Panics
    ///
    /// As [`Replay::step`].
    #[track_caller]
    pub fn play(&mut self, part: Duration) -> bool {
        let end = self.position + part;
        while self.player.next_position().is_some_and(|next| next <= end) {
            self.step();
        }
        self.position = end;
        self.player.next_position().is_some()
    }

    /// Refuses requests that have come, and gives late subscribers the latest samples.
    pub fn service(&mut self) {
        self.services.service();
    }
}
