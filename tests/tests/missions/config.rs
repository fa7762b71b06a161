//! What a world is made of: both sides' configurations, and what the checkers may expect of the line.

use std::time::Duration;

use bridge::BridgeConfig;
use dsp_protocol::{Group, Profile};
use dsp_sim::faults::Script;
use dsp_sim::helicopter::wind::WindModel;
use dsp_sim::simulator::Setup;

use crate::missions::truth::Line;

/// What a world is made of.
#[derive(Clone)]
pub struct WorldConfig {
    pub bridge: BridgeConfig,
    pub simulator: Setup,
    /// Whether every message arrives: no noise, no reboot, no port that closes.
    pub is_sound: bool,
    /// Whether every waypoint is seen to be reached, on a line that is sound.
    pub is_dense: bool,
    /// Whether no byte is damaged.
    pub loses_only: bool,
    /// When the last fault of the simulator's script is over.
    pub faults_end: Duration,
    /// Whether a sample arrives at the moment at which it was measured, without noise: then it is compared to the
    /// truth.
    pub is_exact: bool,
    /// Whether the journals are written, and verified by replaying them.
    pub is_recorded: bool,
}

impl WorldConfig {
    /// The defaults of both sides, and a movement that lasts too long given up after a minute.
    pub fn new() -> WorldConfig {
        let mut bridge = BridgeConfig::default();
        bridge.movement.time_limit_s = 60.0;
        WorldConfig {
            bridge,
            simulator: Setup::default(),
            is_sound: true,
            is_dense: true,
            loses_only: false,
            faults_end: Duration::ZERO,
            is_exact: false,
            is_recorded: true,
        }
    }

    /// Moves the home, and leaves its altitude and heading.
    pub fn at(mut self, latitude_deg: f64, longitude_deg: f64) -> WorldConfig {
        let home = &mut self.simulator.model.home;
        (home.latitude_deg, home.longitude_deg) = (latitude_deg, longitude_deg);
        self
    }

    /// A seed for wind and noise.
    pub fn seed(mut self, seed: u64) -> WorldConfig {
        self.simulator.model.seed = seed;
        self
    }

    /// No wind, no noise, and a line that takes no time.
    pub fn exact(mut self) -> WorldConfig {
        self.simulator.model.noise_level = 0.0;
        self.simulator.baud = None;
        self.is_exact = true;
        self
    }

    /// A script of faults that is over at `end`.
    pub fn faults(mut self, script: Script, end: Duration) -> WorldConfig {
        self.simulator.faults = Some(script);
        self.faults_end = end;
        self.unsound()
    }

    /// A geofence: a circle around the home, and a ceiling above it.
    pub fn fence(mut self, radius_m: f64, ceiling_m: f64) -> WorldConfig {
        let home = self.simulator.model.home;
        let text = format!(
            "[fence]\nmargin_m = 0.0\nbraking_mps2 = 20.0\nreaction_s = 0.0\nceiling_m = {:.6}\n[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\n\
             centre = [{:.9}, {:.9}]\nradius_m = {radius_m:.6}\n",
            home.altitude_m + ceiling_m,
            home.latitude_deg,
            home.longitude_deg,
        );
        let parsed: BridgeConfig = runtime::config::parse(&text, "a test").expect("a geofence");
        self.bridge.fence = parsed.fence;
        self
    }

    /// Status comes so seldom that not every waypoint is seen to be reached.
    pub fn sparse(mut self) -> WorldConfig {
        self.is_dense = false;
        self
    }

    /// Sets the wind.
    pub fn wind(mut self, speed_mps: f64, from_deg: f64, gust_mps: f64) -> WorldConfig {
        self.simulator.model.wind = WindModel {
            speed_mps,
            from_deg,
            gust_mps,
        };
        self
    }

    /// Controller parameters, as a table of TOML.
    pub fn parameters(mut self, table: &str) -> WorldConfig {
        let text = format!("[parameters]\n{table}");
        let parsed: BridgeConfig =
            runtime::config::parse(&text, "a test").expect("parameters of the contract");
        self.bridge.parameters = parsed.parameters;
        self
    }

    /// All groups but these.
    pub fn without(mut self, groups: &[Group]) -> WorldConfig {
        self.bridge
            .status
            .groups
            .retain(|group| !groups.contains(group));
        self
    }

    /// Both ends speak the extended profile, with a CRC and numbers.
    pub fn extended(mut self) -> WorldConfig {
        self.bridge.link.profile = Profile::Extended;
        self.simulator.profile = Profile::Extended;
        self
    }

    /// What the line can make the bridge believe. Only in the extended profile damaged bytes are noticed for certain;
    /// scripts that only lose messages are taken for deceptive too, unless they say otherwise.
    pub fn line(&self) -> Line {
        let is_noticed = self.loses_only || self.simulator.profile == Profile::Extended;
        if self.is_sound {
            Line::Sound
        } else if is_noticed && self.simulator.firmware.has_waypoint_count {
            Line::Lossy
        } else {
            Line::Deceptive
        }
    }

    /// Messages get lost, but no byte is damaged.
    pub fn loses_only(mut self) -> WorldConfig {
        self.loses_only = true;
        self.unsound()
    }

    /// Messages will be lost.
    pub fn unsound(mut self) -> WorldConfig {
        self.is_sound = false;
        self
    }
}
