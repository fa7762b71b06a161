//! Requests to the bridge and the reports that answer them (`ModuleControl`, `MovementData`).

use iceoryx2::prelude::ZeroCopySend;

shared_struct! {
    /// Start or stop the module (`ModuleControl`). Service `module_control`.
    pub struct ModuleControl("hero.ModuleControl.v1") = 16 {
        /// Chosen by the sender, not 0, never used before by anybody; every report repeats it.
        pub request_id: u64,
        /// A [`ControlCommand`](crate::code::ControlCommand).
        pub command: u32,
        /// Within how many ms the request must have reached the DSP; 0 takes the bridge's default.
        pub deadline_ms: u32,
    }
}

shared_struct! {
    /// A movement (`MovementData`). Service `movement`.
    ///
    /// A path is framed by the pair (`first`, `last`): (1,1) is a single waypoint, (1,0) opens a path, (0,0) continues
    /// it, (0,1) closes it. Nothing of a path goes to the DSP until it is closed.
    pub struct MovementData("hero.MovementData.v1") = 56 {
        /// Chosen by the sender, not 0, never used before by anybody; every report repeats it.
        pub request_id: u64,
        /// Chosen by the sender, the same in all waypoints of one path and in every report about it; 0 for take-off
        /// and landing.
        pub path_id: u64,
        /// Latitude of the waypoint, degrees, north positive. Go-to only.
        pub latitude_deg: f64,
        /// Longitude of the waypoint, degrees, east positive. Go-to only.
        pub longitude_deg: f64,
        /// Go-to: altitude of the waypoint, m, same zero as telemetry. Take-off: height over the point of take-off, m.
        pub altitude_m: f64,
        /// A [`MovementKind`](crate::code::MovementKind) (`type_of_request`).
        pub kind: u32,
        /// 1 when this waypoint opens a path (`first_waypoint_data`). Go-to only.
        pub first: u16,
        /// 1 when this waypoint closes the path (`last_waypoint_data`). Go-to only.
        pub last: u16,
        /// Within how many ms the movement must have begun on the DSP; 0 takes the bridge's default.
        pub deadline_ms: u32,
        /// 1 when this is sent again because the outcome is unknown: it is then never executed twice, not even by
        /// another bridge than the one that was asked first.
        pub repeat: u32,
    }
}

shared_struct! {
    /// One answer in the response stream of a request.
    pub struct RequestReport("hero.RequestReport.v1") = 48 {
        /// The request's id.
        pub request_id: u64,
        /// The request's path, 0 when it has none.
        pub path_id: u64,
        /// When this was said, host monotonic ns.
        pub reported_ns: u64,
        /// A [`Stage`](crate::code::Stage).
        pub stage: u32,
        /// A [`Reason`](crate::code::Reason).
        pub reason: u32,
        /// IMI error code, 0 when there is none.
        pub imi_error: u32,
        /// Waypoints of the path so far.
        pub waypoints_total: u32,
        /// Waypoints sent to the DSP.
        pub waypoints_sent: u32,
        /// Waypoints that the helicopter was seen to reach, in order.
        pub waypoints_reached: u32,
    }
}
