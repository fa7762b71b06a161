//! The truth: what a movement means for the helicopter, compared with what was said about its end.

use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::helicopter::{Helicopter, Phase};
use ipc_types::code::MovementKind;
use ipc_types::payload::MovementData;

/// Half the edge of the box in which a waypoint counts as reached, m: the bridge's tolerance of 10⁻⁵ degrees of
/// latitude, and noise.
const BOX_M: f64 = 1.12 + 0.2;

/// How far the helicopter may go on after it was in the last box, m.
const BRAKING_M: f64 = 2.0;

/// What a line can make the bridge believe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Every message arrives.
    Sound,
    /// Messages get lost, and are noticed to be.
    Lossy,
    /// A damaged message may be taken for good, which the sum of the classic profile lets through once in 128 times; or
    /// a lost waypoint goes unnoticed, because the DSP does not count them.
    Deceptive,
}

/// A movement that was accepted.
pub enum Movement {
    /// To this height above the home, m.
    TakeOff { height_m: f64 },
    /// To the ground.
    Land,
    /// On the spot.
    Hold,
    /// Along these points of the flat world, of which so many were reached in order.
    Path {
        waypoints: Vec<Vector>,
        reached: usize,
    },
}

impl Movement {
    /// What `request` begins, if it is accepted; `path` is what it closes.
    pub fn of(
        request: &MovementData,
        path: Option<&[Waypoint]>,
        helicopter: &Helicopter,
    ) -> Option<Movement> {
        match request.kind()? {
            MovementKind::TakeOff => Some(Movement::TakeOff {
                height_m: helicopter.body().position_m.z + request.altitude_m,
            }),
            MovementKind::Land => Some(Movement::Land),
            MovementKind::Hold => Some(Movement::Hold),
            MovementKind::GoToWaypoint => {
                let to_flat = |waypoint: &Waypoint| {
                    helicopter.world().to_flat(Geographic {
                        latitude_deg: waypoint.latitude_deg,
                        longitude_deg: waypoint.longitude_deg,
                        altitude_m: waypoint.altitude_m,
                    })
                };
                Some(Movement::Path {
                    waypoints: path?.iter().map(to_flat).collect(),
                    reached: 0,
                })
            }
        }
    }

    /// Looks where the helicopter is.
    pub fn follow(&mut self, helicopter: &Helicopter) {
        if let Movement::Path { waypoints, reached } = self {
            let position_m = helicopter.body().position_m;
            while let Some(waypoint) = waypoints.get(*reached)
                && is_within(position_m - *waypoint, BOX_M)
            {
                *reached += 1;
            }
        }
    }

    /// Asserts what `Done` means: the helicopter flies at the altitude; it stands with its rotor stopped; or it truly
    /// was in the boxes of all waypoints, in order, and is in the last one now.
    ///
    /// What of that holds depends on the line.
    pub fn assert_done(&self, helicopter: &Helicopter, line: Line) {
        let position_m = helicopter.body().position_m;
        match self {
            Movement::TakeOff { height_m } => {
                let error_m = (position_m.z - height_m).abs();
                assert!(
                    error_m <= BOX_M || line == Line::Deceptive,
                    "taken off, but {error_m} m from the altitude"
                );
                assert!(helicopter.is_flying(), "taken off, but stands");
            }
            Movement::Land => {
                assert!(!helicopter.is_flying(), "landed, but flies");
                assert!(
                    helicopter.phase() == Phase::OnGround || line == Line::Deceptive,
                    "landed, but the rotor has not stopped"
                );
            }
            // What the DSP holds is checked for every movement.
            Movement::Hold => {}
            Movement::Path { waypoints, reached } => {
                assert!(
                    *reached == waypoints.len() || line == Line::Deceptive,
                    "the helicopter was not at waypoint {reached} of {waypoints:?}"
                );
                let last = waypoints.last().expect("a path has waypoints");
                let away_m = position_m - *last;
                // Until the end is acknowledged on a line that loses messages, the helicopter brakes.
                let slack_m = if line == Line::Sound { 0.0 } else { BRAKING_M };
                assert!(
                    is_within(away_m, BOX_M + slack_m) || line == Line::Deceptive,
                    "the helicopter is {away_m:?} away from the last of {waypoints:?}"
                );
            }
        }
    }
}

fn is_within(away_m: Vector, most_m: f64) -> bool {
    [away_m.x, away_m.y, away_m.z]
        .iter()
        .all(|metres| metres.abs() <= most_m)
}
