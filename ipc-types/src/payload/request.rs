//! Requests to the bridge and the reports that answer them (`ModuleControl`, `MovementData`).
//!
//! Each carries the moment when its order was issued and the moment until which it may begin, both on the robot's clock. The
//! bridge judges by them which of two orders is the newer one, whatever way they came; see `docs/ipc.md` section 4.

shared_struct! {
    /// Start or stop the module (`ModuleControl`). Service `module_control`.
    pub struct ModuleControl("hero.ModuleControl.v2") = 40 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
        /// the moment of sending.
        pub issued_ns: u64,
        /// Until when it may begin, same clock; 0 takes the bridge's default.
        pub begin_by_ns: u64,
        /// A [`ControlCommand`](crate::code::ControlCommand).
        pub command: u32,
        /// By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same.
        pub issued_within_ns: u32,
        /// By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own.
        pub origin: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

shared_struct! {
    /// A movement (`MovementData`). Service `movement`.
    ///
    /// A path is framed by the pair (`first`, `last`): (1,1) is a single waypoint, (1,0) opens a path, (0,0) continues
    /// it, (0,1) closes it. Nothing of a path goes to the DSP until it is closed.
    pub struct MovementData("hero.MovementData.v3") = 80 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// Chosen by the sender, the same in all waypoints of one path and in every report about it; 0 for take-off
        /// and landing.
        pub path_id: u64,
        /// When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
        /// the moment of sending. All waypoints of a path carry the moment of the path.
        pub issued_ns: u64,
        /// Until when it may begin, same clock; 0 takes the bridge's default.
        pub begin_by_ns: u64,
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
        /// By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same.
        pub issued_within_ns: u32,
        /// By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own.
        pub origin: u32,
        /// 1 when this is sent again because the outcome is unknown: it is then never executed twice, not even by
        /// another bridge than the one that was asked first.
        pub repeat: u16,
        /// 1 when this may replace a path that is under way, which then ends as `replaced`; 0 refuses it as `busy`.
        /// In a path the flag of the closing waypoint counts.
        pub preempt: u16,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

shared_struct! {
    /// One answer in the response stream of a request.
    pub struct RequestReport("hero.RequestReport.v2") = 136 {
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
        /// The safety rule that was broken, a [`SafetyRule`](crate::code::SafetyRule); 0 when none was.
        pub rule: u32,
        /// The waypoint, or the leg that leads to it, that the reason is about, counted from 1; 0 when there is none.
        pub waypoint: u32,
        /// The DSP error that the reason is about, as the DSP sent it; means something when `dsp_error_valid` is 1.
        pub dsp_error_code: u32,
        /// 1 when `dsp_error_code` is given.
        pub dsp_error_valid: u16,
        /// 1 when `value` is given.
        pub value_valid: u16,
        /// Rule broken: by how much, in the rule's unit. Take-off done: the height that was reached over the point of
        /// take-off, m. Parameter read or written: the value that the port has.
        pub value: f64,
        /// The port that a parameter request is about; all zero in other reports.
        pub port: PortInfo,
    }
}

shared_struct! {
    /// Reads, writes or lists the DSP's virtual ports (`docs/protocol.md` section 6). Service `parameters`.
    pub struct ParameterRequest("hero.ParameterRequest.v2") = 48 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
        /// the moment of sending.
        pub issued_ns: u64,
        /// Until when it may begin, same clock; 0 takes the bridge's default.
        pub begin_by_ns: u64,
        /// Write: the value. A 16-bit port takes whole numbers only.
        pub value: f64,
        /// Read, write: number of the port. List: which port of the list, counted from 0.
        pub port: u32,
        /// A [`ParameterOperation`](crate::code::ParameterOperation).
        pub operation: u32,
        /// By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same.
        pub issued_within_ns: u32,
        /// By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own.
        pub origin: u32,
    }
}

shared_struct! {
    /// A virtual port of the DSP.
    pub struct PortInfo("hero.PortInfo.v1") = 64 {
        /// Least value that may be written.
        pub min: f64,
        /// Greatest value that may be written.
        pub max: f64,
        /// Number of the port.
        pub number: u32,
        /// A [`PortKind`](crate::code::PortKind).
        pub kind: u32,
        /// Bit 0: may be written by request; bit 1: also while the helicopter flies.
        pub access: u32,
        /// Ports of the list.
        pub count: u32,
        /// Name in ASCII with its unit, filled up with zeros.
        pub name: [u8; 32],
    }
}
