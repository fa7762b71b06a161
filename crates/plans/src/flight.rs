//! From a plan to what the helicopter does: take-offs, paths, hovers and landings, in order.
//!
//! What the helicopter offers: a vertical take-off to a height, paths of waypoints with telemetry altitudes, a
//! cruise speed, hovering, and landing on the spot. An item that needs anything else is a finding, never left out in
//! silence.

use bridge::flight::assembly::MAX_WAYPOINTS;
use bridge::geodesy::distance_m;
use dsp_protocol::Waypoint;

use crate::finding::Findings;
use crate::model::{Action, Altitude, Item, OtherKind, Plan, Position};
use crate::site::{Site, Start};
pub use crate::steps::{Flight, Leg, PathPoint, Step, ground_m, quantised};
use runtime::finding::{Finding, Severity};

/// A place of a take-off, a hover or a landing this close to where the helicopter is needs no leg, m: the box in which
/// a waypoint counts as reached.
const SAME_PLACE_M: f64 = 1.1;

/// The least height of a take-off that is made up where the plan has none, m: what the DSP takes.
const LEAST_TAKE_OFF_M: f64 = 0.5;

/// The longest hover between two movements, s: a day. No battery or tank lasts as long, so a longer one is a mistake.
const LONGEST_HOVER_S: f64 = 86_400.0;

impl Flight {
    /// What `plan` becomes at `site`.
    pub fn new(plan: &Plan, site: &Site) -> Flight {
        let (here, is_flying) = match site.start {
            Start::Ground(at) => (at, false),
            Start::Flying(at) => (at, true),
        };
        let mut builder = FlightBuilder {
            site,
            here,
            is_flying,
            has_landed: false,
            path: Vec::new(),
            path_start: here,
            flight: Flight {
                steps: Vec::new(),
                legs: Vec::new(),
                stays: Vec::new(),
                findings: Findings::default(),
            },
        };
        builder.build(plan);
        builder.flight
    }
}

struct FlightBuilder<'a> {
    site: &'a Site,
    here: Waypoint,
    is_flying: bool,
    has_landed: bool,
    path: Vec<PathPoint>,
    path_start: Waypoint,
    flight: Flight,
}

impl FlightBuilder<'_> {
    fn build(&mut self, plan: &Plan) {
        self.left_out(plan);
        let (skipped, items) = plan
            .items
            .split_at((self.site.from.max(1) as usize - 1).min(plan.items.len()));
        self.speed_so_far(skipped);
        let mut items = items.iter();
        for item in items.by_ref() {
            if self.site.take_off_m.is_some() && !self.has_landed && !self.is_flying {
                self.take_off_in_front(item);
            }
            self.item(item);
            if let Action::Hold {
                duration_s: None, ..
            } = item.action
            {
                break;
            }
        }
        self.finish_path();
        for item in items {
            self.find(
                Finding::new(
                    Severity::Warning,
                    "not-reached",
                    "comes after an item that hovers for ever, where the flight ends",
                )
                .with_next_step("`ril plan fly --from ITEM` flies on from there")
                .about(item.number),
            );
        }
    }

    fn left_out(&mut self, plan: &Plan) {
        for part in &plan.left_out {
            let finding = match part.kind {
                OtherKind::Payload => Finding::new(Severity::Warning, "not-used", &part.what),
                OtherKind::Flight => Finding::new(Severity::Error, "not-possible", &part.what)
                    .with_next_step("take it out of the file, or say in the file what it is"),
            };
            self.find(finding);
        }
    }

    /// A flight that begins in the middle has the speed that the items before ask for.
    fn speed_so_far(&mut self, skipped: &[Item]) {
        let last = skipped.iter().rev().find_map(|item| match item.action {
            Action::Speed { speed_mps } => Some((item.number, speed_mps)),
            _ => None,
        });
        if let Some((item, speed_mps)) = last {
            self.flight.steps.push(Step::Speed { item, speed_mps });
        }
    }

    fn item(&mut self, item: &Item) {
        for ignored in &item.ignored {
            let text = format!("asks for {}, which is not done", ignored.text);
            self.find(Finding::new(Severity::Warning, "not-done", text).about(item.number));
        }
        match &item.action {
            Action::TakeOff { position, altitude } => self.take_off(item, *position, *altitude),
            Action::Waypoint {
                position,
                altitude,
                hold_s,
            } => {
                self.go_to(item, *position, *altitude);
                self.wait(item, Some(*hold_s));
            }
            Action::Hold {
                position,
                altitude,
                duration_s,
            } => self.hold(item, *position, *altitude, *duration_s),
            Action::Speed { speed_mps } => {
                self.finish_path();
                self.flight.steps.push(Step::Speed {
                    item: item.number,
                    speed_mps: *speed_mps,
                });
            }
            Action::ReturnToLaunch => self.return_to_launch(item),
            Action::Land { position } => self.land(item, *position),
            Action::Other { name, kind } => self.other(item, name, *kind),
        }
    }

    fn other(&mut self, item: &Item, name: &str, kind: OtherKind) {
        let finding = match kind {
            OtherKind::Payload => {
                Finding::new(Severity::Warning, "not-done", format!("{name} is not done"))
            }
            OtherKind::Flight => Finding::new(
                Severity::Error,
                "not-possible",
                format!("the helicopter cannot do {name}"),
            )
            .with_next_step("take the item out of the plan"),
        };
        self.find(finding.about(item.number));
    }

    /// The take-off of `--takeoff`, unless the plan begins with one, or with something that needs none.
    fn take_off_in_front(&mut self, item: &Item) {
        let Some(height_m) = self.site.take_off_m else {
            return;
        };
        if matches!(
            item.action,
            Action::Waypoint { .. }
                | Action::Hold { .. }
                | Action::ReturnToLaunch
                | Action::Land { .. }
        ) {
            self.climb(None, height_m);
        }
    }

    fn climb(&mut self, item: Option<u32>, height_m: f64) {
        self.flight.steps.push(Step::TakeOff { item, height_m });
        self.here = Waypoint {
            altitude_m: self.here.altitude_m + height_m,
            ..self.here
        };
        self.is_flying = true;
    }

    fn take_off(&mut self, item: &Item, position: Option<Position>, altitude: Altitude) {
        if self.is_flying {
            self.find(
                Finding::new(
                    Severity::Error,
                    "already-flying",
                    "takes off, but the helicopter is in the air then",
                )
                .with_next_step(format!(
                    "begin with the next item: `--from {}`",
                    item.number + 1
                ))
                .about(item.number),
            );
            return;
        }
        let Some(altitude_m) = self.resolve(item, altitude) else {
            // What is behind it does not lack a take-off.
            self.is_flying = true;
            return;
        };
        if self.has_landed {
            self.find(
                Finding::new(
                    Severity::Warning,
                    "second-take-off",
                    "takes off again: the ground there is taken to be as high as home",
                )
                .about(item.number),
            );
        }
        self.climb(Some(item.number), altitude_m - self.here.altitude_m);
        if let Some(position) = position {
            let there = at(position, altitude_m);
            if ground_m(&self.here, &there) > SAME_PLACE_M {
                self.fly_to(item, there);
            }
        }
    }

    fn go_to(&mut self, item: &Item, position: Position, altitude: Altitude) {
        let Some(altitude_m) = self.resolve(item, altitude) else {
            return;
        };
        let there = at(position, altitude_m);
        self.must_fly(item, &there);
        self.fly_to(item, there);
    }

    fn hold(
        &mut self,
        item: &Item,
        position: Option<Position>,
        altitude: Option<Altitude>,
        duration_s: Option<f64>,
    ) {
        let altitude_m = match altitude {
            Some(altitude) => match self.resolve(item, altitude) {
                Some(altitude_m) => altitude_m,
                None => return,
            },
            None => self.here.altitude_m,
        };
        let there = match position {
            Some(position) => at(position, altitude_m),
            None => Waypoint {
                altitude_m,
                ..self.here
            },
        };
        self.must_fly(item, &there);
        if distance_m(&self.here, &there) > SAME_PLACE_M {
            self.fly_to(item, there);
        }
        self.flight.stays.push(item.number);
        self.wait(item, duration_s);
    }

    /// Straight home at the present altitude, then down.
    fn return_to_launch(&mut self, item: &Item) {
        let there = Waypoint {
            altitude_m: self.here.altitude_m,
            ..self.site.home
        };
        self.must_fly(item, &there);
        self.find(
            Finding::new(
                Severity::Warning,
                "return",
                "returns home in a straight line, as high as the item before it, and lands",
            )
            .about(item.number),
        );
        if ground_m(&self.here, &there) > SAME_PLACE_M {
            self.fly_to(item, there);
        }
        self.touch_down(item);
    }

    fn land(&mut self, item: &Item, position: Option<Position>) {
        let here = self.here;
        self.must_fly(item, &here);
        if let Some(position) = position {
            let there = at(position, self.here.altitude_m);
            if ground_m(&self.here, &there) > SAME_PLACE_M {
                self.fly_to(item, there);
            }
        }
        self.touch_down(item);
    }

    fn touch_down(&mut self, item: &Item) {
        self.finish_path();
        self.flight.steps.push(Step::Land { item: item.number });
        self.is_flying = false;
        self.has_landed = true;
        self.here.altitude_m = self.site.home.altitude_m;
    }

    /// A hover between two paths; for ever is only the end of the path.
    fn wait(&mut self, item: &Item, duration_s: Option<f64>) {
        if duration_s.is_some_and(|duration_s| duration_s > LONGEST_HOVER_S) {
            let text = format!("hovers for longer than {LONGEST_HOVER_S} s");
            let finding = Finding::new(Severity::Error, "hold", text)
                .with_next_step("correct its time, in s");
            self.find(finding.about(item.number));
        }
        match duration_s {
            Some(duration_s) if duration_s > 0.0 => {
                self.finish_path();
                self.flight.steps.push(Step::Wait {
                    item: item.number,
                    duration_s,
                });
            }
            _ => {}
        }
    }

    /// What is flown must be in the air. Where the plan forgets the take-off, the legs are judged as if it were above
    /// home, as high as the first place.
    fn must_fly(&mut self, item: &Item, there: &Waypoint) {
        if self.is_flying {
            return;
        }
        let finding = if self.has_landed {
            Finding::new(
                Severity::Error,
                "not-flying",
                "needs the air, but follows a landing",
            )
            .with_next_step("put a take-off in front of it")
        } else if self.site.is_for_flight {
            Finding::new(
                Severity::Error,
                "not-flying",
                "needs the air, but the helicopter stands on the ground",
            )
            .with_next_step("let it take off first: `--takeoff 20m`")
        } else {
            Finding::new(
                Severity::Warning,
                "not-flying",
                "needs the air, and the plan has no take-off before it",
            )
            .with_next_step("fly it with `--takeoff 20m`, or from the air")
        };
        self.find(finding.about(item.number));
        let least_m = self.site.home.altitude_m + LEAST_TAKE_OFF_M;
        self.here.altitude_m = there.altitude_m.max(least_m);
        self.is_flying = true;
    }

    fn fly_to(&mut self, item: &Item, to: Waypoint) {
        if self.path.len() == MAX_WAYPOINTS {
            self.find(
                Finding::new(Severity::Warning,
                    "path-divided",
                    format!("is waypoint {} of a path, of which the bridge takes {MAX_WAYPOINTS}: the helicopter stops before it", MAX_WAYPOINTS + 1),
                )
                .about(item.number),
            );
            self.finish_path();
        }
        if self.path.is_empty() {
            self.path_start = self.here;
        }
        let to = quantised(to);
        self.flight.legs.push(Leg {
            number: self.flight.legs.len() as u32 + 1,
            item: item.number,
            step: self.flight.steps.len(),
            from: self.here,
            to,
            path_start: self.path_start,
        });
        self.path.push(PathPoint {
            item: item.number,
            waypoint: to,
        });
        self.here = to;
    }

    fn finish_path(&mut self) {
        if !self.path.is_empty() {
            let path = std::mem::take(&mut self.path);
            self.flight.steps.push(Step::Path(path));
        }
    }

    /// The telemetry altitude, m; `None`, and a finding, if it is not known.
    fn resolve(&mut self, item: &Item, altitude: Altitude) -> Option<f64> {
        self.site
            .altitude_m(altitude)
            .map_err(|finding| self.find(finding.about(item.number)))
            .ok()
    }

    fn find(&mut self, finding: Finding) {
        self.flight.findings.push(finding);
    }
}

fn at(position: Position, altitude_m: f64) -> Waypoint {
    Waypoint {
        latitude_deg: position.latitude_deg,
        longitude_deg: position.longitude_deg,
        altitude_m,
    }
}
