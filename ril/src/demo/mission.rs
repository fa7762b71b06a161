//! The demonstration's operator: which requests it sends, in which order. A pure value; it is given what became of each
//! request and says what to ask next.

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{
    DspGeographic, ModuleControl, MovementData, RequestReport, WaypointPosition,
};

/// Height of the take-off, m.
const TAKE_OFF_M: f64 = 5.0;

/// The first path: a square with one corner at the start, so that it ends where it began. East, north and up of the
/// place of take-off, m.
const FIRST_PATH_M: [[f64; 3]; 4] = [
    [0.0, 8.0, 6.0],
    [8.0, 8.0, 7.0],
    [8.0, 0.0, 6.0],
    [0.0, 0.0, 5.0],
];

/// The second path.
const SECOND_PATH_M: [[f64; 3]; 2] = [[-4.0, 3.0, 5.0], [-3.0, -2.0, 4.0]];

/// A point of a path, WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Latitude, degrees.
    pub latitude_deg: f64,
    /// Longitude, degrees.
    pub longitude_deg: f64,
    /// Altitude, m.
    pub altitude_m: f64,
}

/// One order of the operator.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Start the module.
    Start,
    /// Take off.
    TakeOff,
    /// Fly a path.
    Path(Vec<Point>),
    /// Land.
    Land,
    /// Stop the module.
    Stop,
}

impl Order {
    /// How the order is called on the screen.
    pub fn name(&self) -> String {
        match self {
            Order::Start => "start".to_owned(),
            Order::TakeOff => format!("take off to {TAKE_OFF_M} m"),
            Order::Path(points) => format!("fly {} waypoints", points.len()),
            Order::Land => "land".to_owned(),
            Order::Stop => "stop".to_owned(),
        }
    }
}

/// A request to send.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// To the module's control.
    Control(ModuleControl),
    /// To its movements.
    Movement(MovementData),
}

/// How an order ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Which order.
    pub order: Order,
    /// The final report.
    pub stage: Stage,
    /// Its reason.
    pub reason: Reason,
}

/// The mission: what has been asked, what is open, what is left.
#[derive(Debug)]
pub struct Mission {
    orders: std::vec::IntoIter<Order>,
    current: Option<Order>,
    /// Requests of the current order without a final report.
    open: Vec<u64>,
    /// The last request of the current order: its final report is that of the order.
    closing: u64,
    ended: Vec<Outcome>,
    failed: bool,
}

impl Mission {
    /// The whole demonstration around the place where the helicopter stands.
    pub fn new(home: &DspGeographic) -> Mission {
        let path = |offsets: &[[f64; 3]]| {
            Order::Path(offsets.iter().map(|offset| point(home, *offset)).collect())
        };
        let orders = vec![
            Order::Start,
            Order::TakeOff,
            path(&FIRST_PATH_M),
            path(&SECOND_PATH_M),
            Order::Land,
            Order::Stop,
        ];
        Mission {
            orders: orders.into_iter(),
            current: None,
            open: Vec::new(),
            closing: 0,
            ended: Vec::new(),
            failed: false,
        }
    }

    /// The requests of the next order, if the one before has ended well; `next_id` gives each its id.
    pub fn next_requests(&mut self, mut next_id: impl FnMut() -> u64) -> Vec<Request> {
        if !self.open.is_empty() || self.failed {
            return Vec::new();
        }
        self.current = self.orders.next();
        let requests = match &self.current {
            None => Vec::new(),
            Some(Order::Start) => vec![Request::Control(ModuleControl::new(
                next_id(),
                ControlCommand::Start,
            ))],
            Some(Order::Stop) => vec![Request::Control(ModuleControl::new(
                next_id(),
                ControlCommand::Stop,
            ))],
            Some(Order::TakeOff) => vec![Request::Movement(MovementData::take_off(
                next_id(),
                TAKE_OFF_M,
            ))],
            Some(Order::Land) => vec![Request::Movement(MovementData::land(next_id()))],
            Some(Order::Path(points)) => path_requests(points, next_id),
        };
        self.open = requests.iter().map(request_id).collect();
        self.closing = self.open.last().copied().unwrap_or_default();
        requests
    }

    /// Takes a report; returns the outcome of the order that it ends.
    pub fn report(&mut self, report: &RequestReport) -> Option<&Outcome> {
        let stage = Stage::from_code(report.stage)?;
        if !stage.is_final() || !self.open.contains(&report.request_id) {
            return None;
        }
        self.open.retain(|id| *id != report.request_id);
        let reason = Reason::from_code(report.reason).unwrap_or(Reason::None);
        self.failed |= stage != Stage::Done;
        if !self.failed && report.request_id != self.closing {
            return None;
        }
        let order = self.current.take()?;
        self.ended.push(Outcome {
            order,
            stage,
            reason,
        });
        self.ended.last()
    }

    /// Whether there is nothing left to do or to wait for.
    pub fn is_over(&self) -> bool {
        self.failed || (self.open.is_empty() && self.current.is_none() && self.orders.len() == 0)
    }

    /// How the orders ended so far.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.ended
    }

    /// The order under way.
    pub fn current(&self) -> Option<&Order> {
        self.current.as_ref()
    }

    /// All waypoints of the mission, in order.
    pub fn waypoints(home: &DspGeographic) -> Vec<Point> {
        FIRST_PATH_M
            .iter()
            .chain(&SECOND_PATH_M)
            .map(|offset| point(home, *offset))
            .collect()
    }

    /// Number of orders of a whole mission.
    pub const ORDERS: usize = 6;
}

fn path_requests(points: &[Point], mut next_id: impl FnMut() -> u64) -> Vec<Request> {
    let path_id = next_id();
    let position = |point: &Point| WaypointPosition {
        latitude_deg: point.latitude_deg,
        longitude_deg: point.longitude_deg,
        altitude_m: point.altitude_m,
    };
    let positions: Vec<_> = points.iter().map(position).collect();
    MovementData::path(path_id, &positions, next_id)
        .map(Request::Movement)
        .collect()
}

fn request_id(request: &Request) -> u64 {
    match request {
        Request::Control(control) => control.request_id,
        Request::Movement(movement) => movement.request_id,
    }
}

/// The point east, north and up of `home`, m. Good for the few metres of the demonstration.
fn point(home: &DspGeographic, [east_m, north_m, up_m]: [f64; 3]) -> Point {
    const METRES_PER_DEGREE: f64 = 111_194.93;
    Point {
        latitude_deg: home.latitude_deg + north_m / METRES_PER_DEGREE,
        longitude_deg: home.longitude_deg
            + east_m / (METRES_PER_DEGREE * home.latitude_deg.to_radians().cos()),
        altitude_m: home.altitude_m + up_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOME: DspGeographic = DspGeographic {
        latitude_deg: 37.0,
        longitude_deg: -6.0,
        altitude_m: 10.0,
    };

    fn final_report(request_id: u64, stage: Stage) -> RequestReport {
        RequestReport {
            request_id,
            stage: stage.code(),
            ..RequestReport::default()
        }
    }

    #[test]
    fn each_order_waits_for_the_final_report_of_the_one_before() {
        let (mut mission, mut id) = (Mission::new(&HOME), 0);
        let mut next = || {
            id += 1;
            id
        };
        let mut orders = 0;
        while !mission.is_over() {
            let requests = mission.next_requests(&mut next);
            assert!(
                mission.next_requests(&mut next).is_empty(),
                "one order at a time"
            );
            for (index, request) in requests.iter().enumerate() {
                assert_eq!(
                    mission.report(&final_report(999, Stage::Done)),
                    None,
                    "a stranger's report"
                );
                let ended = mission.report(&final_report(request_id(request), Stage::Done));
                assert_eq!(ended.is_some(), index + 1 == requests.len());
            }
            orders += usize::from(!requests.is_empty());
            if orders > Mission::ORDERS {
                break;
            }
            // The call after the last order finds nothing left.
            if requests.is_empty() {
                break;
            }
        }
        assert_eq!(orders, Mission::ORDERS);
        assert_eq!(mission.outcomes().len(), Mission::ORDERS);
        assert!(mission.is_over());
    }

    #[test]
    fn a_refusal_ends_the_mission() {
        let mut mission = Mission::new(&HOME);
        mission.next_requests(|| 5);
        let outcome = mission.report(&final_report(5, Stage::Refused)).unwrap();
        assert_eq!(
            (&outcome.order, outcome.stage),
            (&Order::Start, Stage::Refused)
        );
        assert!(mission.is_over());
        assert!(mission.next_requests(|| 6).is_empty());
    }

    #[test]
    fn the_first_path_ends_where_the_take_off_did() {
        let points = Mission::waypoints(&HOME);
        assert!(points.len() >= 6);
        assert_eq!(points[3].latitude_deg, HOME.latitude_deg);
        assert_eq!(points[3].altitude_m, HOME.altitude_m + TAKE_OFF_M);
    }
}
