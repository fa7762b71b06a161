//! [`RequestLog`]: what the robot was asked for and how it ended, of the topic `requests` of a record. All waypoints of
//! a path are one request, and so are values of the DSP that one process reads one after the other, as `ril param list`
//! does.

use std::collections::BTreeMap;

use ipc_types::code::Stage;
use operator::robot::geo::Place;
use recording::RequestEvent;
use view::report::flight::{Outcome, RequestRow};

/// Most requests that are shown; further ones are counted.
const MAX_REQUESTS: usize = 300;

/// Most waypoints of all paths.
const MAX_WAYPOINTS: usize = 5000;

/// Most requests whose reports are awaited. What becomes of further ones is not taken.
const MAX_AWAITED: usize = 10_000;

/// A request, of whatever became known of it.
#[derive(Clone, Debug)]
struct OpenRow {
    at_ns: u64,
    sender: String,
    command: String,
    waypoints: u32,
    /// Values that were read.
    reads: u32,
    /// Requests of the path, or of the reads, that have no final report yet.
    pending: u32,
    /// Whether a request of the path was refused: then nothing of it was flown.
    is_refused: bool,
    ended_ns: Option<u64>,
    outcome: Outcome,
    reason: String,
}

/// What the robot was asked for, and how each request ended.
#[derive(Clone, Debug, Default)]
pub struct RequestLog {
    /// In the order of arrival.
    open: Vec<OpenRow>,
    /// The place in `open` of each path, and of each other request until its final report.
    places: BTreeMap<(bool, u64), usize>,
    /// Waypoints, each with the request that it belongs to, by its place in `open`.
    path: Vec<(usize, Place)>,
    left_out: u64,
}

impl RequestLog {
    /// Takes what a message says.
    pub fn take(&mut self, event: &RequestEvent<'_>) {
        let key = match event.path_id {
            0 => (false, event.request_id),
            path_id => (true, path_id),
        };
        match event.event {
            "request" => self.request(key, event),
            "report" => self.report(key, event),
            _ => {}
        }
    }

    fn request(&mut self, key: (bool, u64), event: &RequestEvent<'_>) {
        let is_waypoint = event.command == "goto";
        let [latitude_deg, longitude_deg, _] = event.position;
        let index = self.places.get(&key).copied().unwrap_or(self.open.len());
        if let Some(place) = Place::new(latitude_deg, longitude_deg)
            && is_waypoint
            && index < MAX_REQUESTS
            && self.path.len() < MAX_WAYPOINTS
        {
            self.path.push((index, place));
        }
        if let Some(open) = self
            .places
            .get(&key)
            .and_then(|place| self.open.get_mut(*place))
        {
            open.waypoints += u32::from(is_waypoint);
            open.pending += 1;
            return;
        }
        let sender = match (event.station, event.sender_pid) {
            ("", 0) => String::new(),
            ("", pid) => format!("process {pid}"),
            (station, _) => format!("station {station}"),
        };
        let is_read = event.service == "parameter" && event.command == "read";
        let index = self.open.len();
        if let Some(last) = self.open.last_mut()
            && is_read
            && last.reads > 0
            && last.sender == sender
        {
            last.reads += 1;
            if self.places.len() < MAX_AWAITED {
                last.pending += 1;
                self.places.insert(key, index - 1);
            }
            return;
        }
        if index >= MAX_REQUESTS || self.places.len() >= MAX_AWAITED {
            self.left_out += 1;
            return;
        }
        self.places.insert(key, index);
        self.open.push(OpenRow {
            at_ns: event.at_ns,
            sender,
            command: event.command.to_owned(),
            waypoints: u32::from(is_waypoint),
            reads: u32::from(is_read),
            pending: 1,
            is_refused: false,
            ended_ns: None,
            outcome: Outcome::Open,
            reason: String::new(),
        });
    }

    fn report(&mut self, key: (bool, u64), event: &RequestEvent<'_>) {
        let stage = Stage::ALL.iter().find(|stage| stage.name() == event.stage);
        let outcome = match stage {
            Some(Stage::Done) => Outcome::Done,
            Some(Stage::Refused) => Outcome::Refused,
            Some(Stage::Aborted) => Outcome::Aborted,
            Some(Stage::Unknown) => Outcome::Open,
            Some(Stage::Accepted | Stage::Progress) | None => return,
        };
        let (is_path, _) = key;
        let place = match is_path || outcome == Outcome::Open {
            true => self.places.get(&key).copied(),
            false => self.places.remove(&key),
        };
        let Some(open) = place.and_then(|place| self.open.get_mut(place)) else {
            return;
        };
        open.pending = open.pending.saturating_sub(1);
        open.is_refused |= outcome == Outcome::Refused;
        // Of a path, what went wrong with one waypoint is what became of the path.
        if open.outcome == Outcome::Open || outcome != Outcome::Done {
            open.outcome = outcome;
            event.reason.clone_into(&mut open.reason);
        }
        open.ended_ns = (open.pending == 0).then_some(event.at_ns);
    }

    /// The requests, with times that `at_s` makes of monotonic ones.
    pub fn finish(&self, at_s: impl Fn(u64) -> f64) -> Vec<RequestRow> {
        let request = |open: &OpenRow| RequestRow {
            from_s: at_s(open.at_ns),
            to_s: open.ended_ns.map(&at_s),
            name: match (open.waypoints, open.reads) {
                (0, 0 | 1) => open.command.clone(),
                (0, reads) => format!("{}, {reads} values", open.command),
                (1, _) => format!("{}, 1 waypoint", open.command),
                (waypoints, _) => format!("{}, {waypoints} waypoints", open.command),
            },
            sender: open.sender.clone(),
            outcome: open.outcome,
            reason: open.reason.clone(),
        };
        self.open.iter().map(request).collect()
    }

    /// The waypoints that were asked for, in order, without those of paths that were refused.
    pub fn path(&self) -> Vec<Place> {
        let is_taken = |index: usize| self.open.get(index).is_some_and(|open| !open.is_refused);
        let waypoints = self.path.iter();
        let taken = waypoints.filter(|(index, _)| is_taken(*index));
        taken.map(|(_, place)| *place).collect()
    }

    /// Requests that are not shown.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(
        at_ns: u64,
        id: u64,
        path: u64,
        event: &'static str,
        command: &'static str,
        stage: &'static str,
    ) -> RequestEvent<'static> {
        RequestEvent {
            at_ns,
            request_id: id,
            path_id: path,
            sender_pid: 812,
            event,
            service: "movement",
            command,
            stage,
            reason: if stage == "aborted" { "replaced" } else { "" },
            text: "",
            position: match command {
                "goto" => [37.0, -6.0, 20.0],
                _ => [f64::NAN; 3],
            },
            station: if command == "land" { "gcs" } else { "" },
        }
    }

    #[test]
    fn all_waypoints_of_a_path_are_one_request() {
        let mut requests = RequestLog::default();
        for event in [
            event(1, 1, 0, "request", "takeoff", ""),
            event(2, 1, 0, "report", "takeoff", "accepted"),
            event(3, 1, 0, "report", "takeoff", "done"),
            event(4, 2, 9, "request", "goto", ""),
            event(5, 3, 9, "request", "goto", ""),
            event(6, 2, 9, "report", "goto", "done"),
            event(7, 3, 9, "report", "goto", "aborted"),
            event(8, 4, 0, "request", "land", ""),
            event(9, 5, 0, "report", "stop", "done"),
        ] {
            requests.take(&event);
        }
        let shown: Vec<(String, f64, Option<f64>, Outcome, String)> = requests
            .finish(|ns| ns as f64)
            .into_iter()
            .map(|request| {
                (
                    request.name,
                    request.from_s,
                    request.to_s,
                    request.outcome,
                    request.reason,
                )
            })
            .collect();
        let expected = [
            ("takeoff", 1.0, Some(3.0), Outcome::Done, ""),
            (
                "goto, 2 waypoints",
                4.0,
                Some(7.0),
                Outcome::Aborted,
                "replaced",
            ),
            ("land", 8.0, None, Outcome::Open, ""),
        ]
        .map(|(name, from_s, to_s, outcome, reason)| {
            (name.to_owned(), from_s, to_s, outcome, reason.to_owned())
        });
        assert_eq!(shown, expected);
        assert_eq!(requests.path().len(), 2);
        let senders = requests.finish(|_| 0.0).into_iter();
        let senders: Vec<_> = senders.map(|request| request.sender).collect();
        assert_eq!(senders, ["process 812", "process 812", "station gcs"]);
    }

    #[test]
    fn waypoints_of_a_path_that_was_refused_are_no_plan_whatever_becomes_of_its_others() {
        for order in [["refused", "aborted"], ["aborted", "refused"]] {
            let mut requests = RequestLog::default();
            for event in [
                event(1, 1, 8, "request", "goto", ""),
                event(2, 2, 8, "request", "goto", ""),
                event(3, 1, 8, "report", "goto", order[0]),
                event(4, 2, 8, "report", "goto", order[1]),
                event(5, 3, 9, "request", "goto", ""),
                event(6, 3, 9, "report", "goto", "aborted"),
            ] {
                requests.take(&event);
            }
            assert_eq!(requests.path().len(), 1, "{order:?}");
        }
    }

    #[test]
    fn values_that_are_read_one_after_the_other_are_one_request() {
        let parameter = |at_ns, id, event_name, command, stage| RequestEvent {
            service: "parameter",
            ..event(at_ns, id, 0, event_name, command, stage)
        };
        let mut requests = RequestLog::default();
        for id in 1..=40 {
            let stage = if id == 7 { "refused" } else { "done" };
            requests.take(&parameter(id * 10, id, "request", "read", ""));
            requests.take(&parameter(id * 10 + 5, id, "report", "read", stage));
        }
        // An action of another sender ends the row, and so does another process.
        requests.take(&event(500, 50, 0, "request", "hold", ""));
        requests.take(&parameter(510, 51, "request", "read", ""));
        requests.take(&RequestEvent {
            sender_pid: 813,
            ..parameter(520, 52, "request", "read", "")
        });
        requests.take(&parameter(530, 53, "request", "write", ""));
        requests.take(&parameter(540, 54, "request", "write", ""));
        let rows = requests.finish(|ns| ns as f64);
        let names: Vec<_> = rows.iter().map(|row| row.name.as_str()).collect();
        assert_eq!(
            names,
            ["read, 40 values", "hold", "read", "read", "write", "write"]
        );
        let first = &rows[0];
        assert_eq!(
            (first.from_s, first.to_s, first.outcome),
            (10.0, Some(405.0), Outcome::Refused)
        );
        // Hours of them take no more memory, whether they are answered or not.
        for id in 100..50_000 {
            requests.take(&parameter(id, id, "request", "read", ""));
        }
        assert_eq!(requests.places.len(), MAX_AWAITED);
        assert!(requests.finish(|_| 0.0).len() <= 7);
    }

    #[test]
    fn a_flood_of_requests_is_bounded() {
        let mut requests = RequestLog::default();
        for id in 0..10_000 {
            requests.take(&event(id, id + 1, 0, "request", "hold", ""));
        }
        assert_eq!(requests.finish(|_| 0.0).len(), MAX_REQUESTS);
        assert_eq!(requests.left_out(), 10_000 - MAX_REQUESTS as u64);
    }
}
