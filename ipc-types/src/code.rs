//! Numbers in shared memory that stand for something: typed enums with a checked way back.
//!
//! A payload holds plain integers, because any bit pattern may lie in shared memory. Each enum here converts with
//! `From` into its number and with `from_code` out of it; an unknown number is `None`, never undefined behaviour.

/// Defines a `u32` code with names for people and tools.
macro_rules! codes {
    (
        $(#[$meta:meta])*
        pub enum $name:ident {
            $( $(#[$variant_meta:meta])* $variant:ident = $code:literal => $text:literal, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name {
            $( $(#[$variant_meta])* $variant = $code, )+
        }

        impl $name {
            /// All values, in the order of their numbers.
            pub const ALL: [$name; [$( $code, )+].len()] = [$( $name::$variant, )+];

            /// The value with this number, or `None` if the number is not one of the contract.
            pub const fn from_code(code: u32) -> Option<$name> {
                match code {
                    $( $code => Some($name::$variant), )+
                    _ => None,
                }
            }

            /// The number in shared memory.
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// The name that tools print.
            pub const fn name(self) -> &'static str {
                match self {
                    $( $name::$variant => $text, )+
                }
            }
        }

        impl From<$name> for u32 {
            fn from(value: $name) -> u32 {
                value.code()
            }
        }

        /// A code is written as its number.
        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_u32(self.code())
            }
        }

        /// From its number; one that is not of the contract is refused.
        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let code = u32::deserialize(deserializer)?;
                let unknown = || serde::de::Error::custom(format_args!("unknown number {code}"));
                $name::from_code(code).ok_or_else(unknown)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }
    };
}

codes! {
    /// One group of values in a telemetry sample; its number is that of its bit in `valid_groups` of `DspTelemetry` and
    /// `HeroTelemetry`.
    ///
    /// They are those of the DSP's status mask (`docs/protocol.md` section 4.1), named the same.
    #[derive(PartialOrd, Ord)]
    pub enum TelemetryGroup {
        /// Time since the DSP's boot.
        Time = 0 => "time",
        /// Latitude, longitude, altitude.
        Geographic = 1 => "geographic",
        /// Flat position around the first valid GPS fix.
        Xy = 2 => "xy",
        /// GPS velocity.
        GpsVelocity = 3 => "gps_velocity",
        /// GPS quality.
        GpsQuality = 4 => "gps_quality",
        /// IMU attitude.
        Attitude = 5 => "attitude",
        /// IMU acceleration.
        Acceleration = 6 => "acceleration",
        /// IMU angular rate.
        AngularRate = 7 => "angular_rate",
        /// Pilot's PWM signals.
        PilotPwm = 8 => "pilot_pwm",
        /// Sonar.
        Sonar = 9 => "sonar",
        /// Battery, fuel, auto/manual switch.
        Supply = 10 => "supply",
        /// Pan and tilt.
        PanTilt = 11 => "pan_tilt",
        /// Main rotor speed.
        RotorSpeed = 12 => "rotor_speed",
        /// Barometric altimeter.
        Barometer = 13 => "barometer",
        /// Actuation of the servos.
        Actuation = 14 => "actuation",
        /// Controller references.
        References = 15 => "references",
    }
}

impl TelemetryGroup {
    /// The bits of the groups that a GPS with a fix has measured.
    pub const OF_A_FIX: u16 = TelemetryGroup::Geographic.bit()
        | TelemetryGroup::Xy.bit()
        | TelemetryGroup::GpsVelocity.bit();

    /// The group's bit in `valid_groups`.
    pub const fn bit(self) -> u16 {
        1 << self.code()
    }

    /// The group with this name, or `None`.
    pub fn from_name(name: &str) -> Option<TelemetryGroup> {
        TelemetryGroup::ALL
            .into_iter()
            .find(|group| group.name() == name)
    }

    /// The groups whose bits are set in `mask`, in the order of their bits.
    pub fn in_mask(mask: u16) -> impl Iterator<Item = TelemetryGroup> {
        TelemetryGroup::ALL
            .into_iter()
            .filter(move |group| mask & group.bit() != 0)
    }
}

codes! {
    /// What a control request asks of the module (`ModuleControl`).
    pub enum ControlCommand {
        /// `START_MODULE`
        Start = 1 => "start",
        /// `STOP_MODULE`
        Stop = 2 => "stop",
        /// Read the geofence of the configuration again; a path under way is checked against it. Not of the source.
        ReloadFence = 3 => "reload-fence",
        /// Take control of the bridge, or ask its holder for it. Not of the source, as the two that follow.
        TakeControl = 4 => "take-control",
        /// Release control of the bridge, or do not ask for it any more.
        ReleaseControl = 5 => "release-control",
        /// Hand control of the bridge over to who has asked for it.
        PassControl = 6 => "pass-control",
    }
}

codes! {
    /// What a movement request asks for (`type_of_request`).
    pub enum MovementKind {
        /// One waypoint of a path (`RS_GOTO_WP`).
        GoToWaypoint = 1 => "goto",
        /// Take off to an altitude (`RS_TAKE_OFF`).
        TakeOff = 2 => "takeoff",
        /// Land on the spot (`RS_LAND`).
        Land = 3 => "land",
        /// Stop on the spot and stay started; ends a path that is under way. Not of the source.
        Hold = 4 => "hold",
    }
}

codes! {
    /// Which module a state is of.
    pub enum ModuleId {
        /// The bridge (`HERO_BRIDGE_MODULE_ID`).
        HeroBridge = 1 => "hero-bridge",
        /// Status. The source has no id for it.
        HeroStatus = 2 => "hero-status",
        /// The relay to other machines. Not of the source.
        HeroRelay = 3 => "hero-relay",
    }
}

codes! {
    /// State of a module (`ModuleState`).
    pub enum ModuleStatus {
        /// Never started (`MODULE_WAITING_DATA_TO_START`).
        WaitingDataToStart = 1 => "waiting-data-to-start",
        /// Started; takes movements or executes one (`MODULE_RUNNING`).
        Running = 2 => "running",
        /// The last movement has ended, or the module was stopped at rest (`MODULE_ENDED`).
        Ended = 3 => "ended",
        /// A stop or an error ended the functionality early (`MODULE_ABORTED`).
        Aborted = 4 => "aborted",
    }
}

codes! {
    /// What the module's functionality, the following of movements, is doing.
    pub enum Functionality {
        /// No movement; a new one is taken if the module is not blocked.
        AtRest = 1 => "at-rest",
        /// A path is being received; nothing of it has gone to the DSP.
        ReceivingPath = 2 => "receiving-path",
        /// A take-off is under way (`unable2abort`).
        TakingOff = 3 => "taking-off",
        /// A path is being flown.
        FollowingPath = 4 => "following-path",
        /// A landing is under way (`unable2abort`).
        Landing = 5 => "landing",
        /// A stop is being carried out.
        Stopping = 6 => "stopping",
        /// The helicopter is commanded to hover where it is; the module stays started.
        Holding = 7 => "holding",
    }
}

codes! {
    /// State of the line to the DSP.
    pub enum LinkState {
        /// The port is open; the DSP has not yet answered the start-up sequence.
        Connecting = 1 => "connecting",
        /// Start-up is done and messages arrive.
        Up = 2 => "up",
        /// The port is open, but no valid message came for the configured time.
        Silent = 3 => "silent",
        /// There is no port.
        Gone = 4 => "gone",
    }
}

codes! {
    /// State of a relay's link between two machines.
    pub enum RelayLinkState {
        /// No message of the robot has come yet.
        Connecting = 1 => "connecting",
        /// Messages of the robot come.
        Up = 2 => "up",
        /// Messages came before, but none for the configured time.
        Down = 3 => "down",
    }
}

codes! {
    /// Whether the gateway to MAVLink hears the helicopter, and why not: then it sends no telemetry.
    pub enum MavlinkVehicle {
        /// Telemetry goes to the stations.
        Heard = 1 => "heard",
        /// No state of the bridge comes.
        NoState = 2 => "no-state",
        /// The bridge's line to the DSP is not up.
        LinkDown = 3 => "link-down",
        /// No telemetry in SI units comes.
        NoTelemetry = 4 => "no-telemetry",
    }
}

codes! {
    /// What the DSP's path buffer may hold.
    pub enum DspPathState {
        /// Not known: it may hold waypoints of a movement that has ended. The bridge empties it before anything else.
        Unknown = 1 => "unknown",
        /// Nothing: the DSP has acknowledged that it was emptied.
        Empty = 2 => "empty",
        /// Waypoints of the path under way.
        Ours = 3 => "ours",
    }
}

codes! {
    /// What a piece of the bridge's outline describes.
    pub enum OutlineKind {
        /// The fence as a whole: its limits, how many areas it has, and how many waypoints the path.
        Fence = 1 => "fence",
        /// An area of the fence, or a part of one.
        Area = 2 => "area",
        /// Waypoints of the path under way.
        Path = 3 => "path",
    }
}

codes! {
    /// The pilot's switch.
    pub enum PilotSwitch {
        /// The DSP does not send it, or it is not fresh.
        Unknown = 0 => "unknown",
        /// The pilot flies.
        Manual = 1 => "manual",
        /// The DSP flies.
        Auto = 2 => "auto",
    }
}

codes! {
    /// A rule of flight safety; its unit is that of the amount by which it was broken.
    pub enum SafetyRule {
        /// The pilot's switch is on manual.
        PilotSwitch = 1 => "pilot-switch",
        /// Outside every inclusion area of the geofence, m.
        FenceInclusion = 2 => "fence-inclusion",
        /// In an exclusion area of the geofence, m.
        FenceExclusion = 3 => "fence-exclusion",
        /// Below the floor of the geofence, m.
        FenceFloor = 4 => "fence-floor",
        /// Above the ceiling of the geofence, m.
        FenceCeiling = 5 => "fence-ceiling",
        /// Battery voltage, V.
        Battery = 6 => "battery",
        /// Fuel, %.
        Fuel = 7 => "fuel",
        /// The link was lost in flight, s.
        LinkLoss = 8 => "link-loss",
        /// A leg that the geofence cannot judge: too long, too near to a pole, or no number; 0 m.
        FenceUnjudgeable = 9 => "fence-unjudgeable",
        /// The position was lost in flight, s.
        PositionLost = 10 => "position-lost",
        /// Too near to the geofence to stop before it, m.
        FenceAhead = 11 => "fence-ahead",
        /// A waypoint below the ground of the take-off, m.
        BelowTakeOff = 12 => "below-take-off",
    }
}

codes! {
    /// What the bridge does when a safety rule is violated, from mild to severe.
    pub enum SafetyAction {
        /// It is shown and logged.
        Warn = 1 => "warn",
        /// New movements are refused, but for landing and hold.
        Refuse = 2 => "refuse",
        /// A path under way is ended; the helicopter hovers.
        Hold = 3 => "hold",
        /// A path under way is ended and the helicopter is commanded to land.
        Land = 4 => "land",
    }
}

codes! {
    /// What a parameter request asks for.
    pub enum ParameterOperation {
        /// The value of a port.
        Read = 1 => "read",
        /// Write a port; the value that the DSP then has is reported.
        Write = 2 => "write",
        /// The description of a port of the list.
        List = 3 => "list",
    }
}

codes! {
    /// How the value of a port is coded.
    pub enum PortKind {
        /// 16 bits, unsigned.
        U16 = 1 => "u16",
        /// 16 bits, two's complement.
        I16 = 2 => "i16",
        /// 32 bits, IEEE 754.
        F32 = 3 => "f32",
    }
}

codes! {
    /// What the bridge does when the process that ordered a movement ends.
    pub enum SenderLost {
        /// The movement goes on.
        Continue = 1 => "continue",
        /// The helicopter hovers where it is.
        Hold = 2 => "hold",
        /// The helicopter lands.
        Land = 3 => "land",
    }
}

codes! {
    /// What came between a step of a command and the step before, so that the bridge did not take it.
    pub enum CameBetween {
        /// A request to start the module.
        Start = 1 => "start",
        /// A request to stop the module.
        Stop = 2 => "stop",
        /// A take-off.
        TakeOff = 3 => "takeoff",
        /// A path.
        GoTo = 4 => "goto",
        /// A landing.
        Land = 5 => "land",
        /// A hold.
        Hold = 6 => "hold",
        /// A safety rule that ends a movement or lands.
        SafetyRule = 7 => "safety-rule",
        /// The pilot's switch went to manual.
        Pilot = 8 => "pilot",
        /// The link to the DSP was lost.
        LinkLost = 9 => "link-lost",
        /// The DSP rebooted.
        DspRebooted = 10 => "dsp-rebooted",
        /// The bridge began: it does not know the step before.
        BridgeBegan = 11 => "bridge-began",
        /// The sender of the step before was lost, and the bridge ended its path.
        SenderLost = 12 => "sender-lost",
    }
}

codes! {
    /// How far a request has come. `Accepted` and `Progress` may be followed by more; the others are final reports.
    pub enum Stage {
        /// Taken; more will follow.
        Accepted = 1 => "accepted",
        /// Something went on: sent to the DSP, or waypoints reached.
        Progress = 2 => "progress",
        /// Final: done.
        Done = 16 => "done",
        /// Final: refused, nothing was done.
        Refused = 17 => "refused",
        /// Final: begun and ended early.
        Aborted = 18 => "aborted",
        /// Final: what became of it cannot be known.
        Unknown = 19 => "unknown",
    }
}

impl Stage {
    /// Whether no further report follows.
    pub const fn is_final(self) -> bool {
        self.code() >= Stage::Done.code()
    }
}

codes! {
    /// Why a report says what it says.
    pub enum Reason {
        /// Nothing special.
        None = 0 => "none",
        /// The request holds a number that the contract does not have.
        InvalidRequest = 1 => "invalid-request",
        /// A coordinate, altitude or deadline that is not finite.
        NotFinite = 2 => "not-finite",
        /// A coordinate or altitude outside its range.
        OutOfRange = 3 => "out-of-range",
        /// The waypoint is farther away than the configuration allows.
        TooFar = 4 => "too-far",
        /// The module has not been started, or was stopped.
        NotStarted = 5 => "not-started",
        /// Start while running (`MODULE_RUNNING_TO_RESTART_STOP_IT_BEFORE`).
        AlreadyRunning = 6 => "already-running",
        /// Stop during take-off or landing (`ERROR_IMPOSSIBLE_TO_STOP_MODULE`).
        UnableToAbort = 7 => "unable-to-abort",
        /// Another movement or stop is under way.
        Busy = 8 => "busy",
        /// The DSP cannot be reached.
        LinkDown = 9 => "link-down",
        /// The helicopter is on the ground.
        NotFlying = 10 => "not-flying",
        /// The helicopter is in the air already.
        AlreadyFlying = 11 => "already-flying",
        /// The position is not known or not transmitted, so that the arrival could not be seen.
        NoPosition = 12 => "no-position",
        /// A waypoint that continues or closes a path that was never opened.
        PathWithoutHead = 13 => "path-without-head",
        /// A new path was begun before this one was closed.
        PathReplaced = 14 => "path-replaced",
        /// More waypoints than a path can have.
        PathTooLong = 15 => "path-too-long",
        /// Another waypoint of the same path was refused, or its sender vanished.
        PathBroken = 16 => "path-broken",
        /// A bounded table is full; try again later.
        TooManyRequests = 17 => "too-many-requests",
        /// The moment until which it may begin has passed.
        TooLate = 18 => "too-late",
        /// The movement took longer than the configuration allows.
        MovementTimeout = 19 => "movement-timeout",
        /// The module was stopped.
        Stopped = 20 => "stopped",
        /// The DSP reported an error that ends the functionality.
        DspFatalError = 21 => "dsp-fatal-error",
        /// A command was not acknowledged, or the line is broken.
        CommunicationFatalError = 22 => "communication-fatal-error",
        /// The DSP rebooted.
        DspRebooted = 23 => "dsp-rebooted",
        /// The bridge is ending.
        BridgeEnding = 24 => "bridge-ending",
        /// The bridge vanished; reported by the client's port, never by the bridge.
        BridgeGone = 25 => "bridge-gone",
        /// Waypoints did not reach the DSP although they were sent repeatedly.
        DeliveryFailed = 26 => "delivery-failed",
        /// A repetition of a request that this bridge does not know: the one before may have carried it out.
        NotRemembered = 27 => "not-remembered",
        /// The DSP got the order and does not carry it out.
        RefusedByDsp = 28 => "refused-by-dsp",
        /// Another movement pre-empted this one.
        Replaced = 29 => "replaced",
        /// The pilot's switch is on manual.
        PilotHasControl = 30 => "pilot-has-control",
        /// The geofence forbids it.
        FenceBreach = 31 => "fence-breach",
        /// Battery or fuel is below its limit.
        SupplyLow = 32 => "supply-low",
        /// The link to the DSP was lost in flight.
        LinkLost = 33 => "link-lost",
        /// The port does not exist, or may not be written by request.
        NoSuchPort = 34 => "no-such-port",
        /// The port may not be written while the helicopter flies.
        NotInFlight = 35 => "not-in-flight",
        /// The geofence in the configuration is not valid; the one in force stays.
        InvalidFence = 36 => "invalid-fence",
        /// The relay's link to the robot was down: the request was not sent. Reported by the relay, never by the
        /// bridge.
        RelayLinkDown = 37 => "relay-link-down",
        /// The relay's link to the robot was lost before the outcome came. Reported by the relay, never by the bridge.
        RelayLinkLost = 38 => "relay-link-lost",
        /// The robot's relay does not let this station command: the request was not sent. Reported by the relay, never
        /// by the bridge.
        RelayNotPermitted = 39 => "relay-not-permitted",
        /// A request with this id is open: it goes on, and this one was not carried out.
        StillOpen = 40 => "still-open",
        /// As many other stations as the robot's relay takes requests from are active: the request was not sent.
        /// Reported by the relay, never by the bridge.
        RelayTooManyStations = 41 => "relay-too-many-stations",
        /// This is a recorded flight that is played, and no robot: nothing is carried out. Reported by the replay,
        /// never by the bridge.
        Replayed = 42 => "replayed",
        /// A later order was taken, or came, before this one began.
        Superseded = 43 => "superseded",
        /// The module that serves the request vanished; reported by the client's port, never by the module.
        ModuleGone = 44 => "module-gone",
        /// Another sender has control of the bridge.
        NotInControl = 45 => "not-in-control",
        /// The file with the geofence was not read in time; the one in force stays.
        FenceUnread = 46 => "fence-unread",
        /// The sender's clock is not the bridge's, so when its order was issued is not known.
        ClockDiffers = 47 => "clock-differs",
        /// The process that ordered the path ended, gave it up, or did not renew its lease.
        SenderLost = 48 => "sender-lost",
        /// Two robots answer under the robot's number: the request was not sent. Reported by the relay, never by the
        /// bridge.
        RelayTwoRobots = 49 => "relay-two-robots",
    }
}

codes! {
    /// Error codes of the Inter Modular Interface: general 0–99, UAV 100–200, DSP errors + 200 in 201–500.
    pub enum ImiError {
        /// `NO_ERROR_IMI`
        None = 0 => "no-error",
        /// `MODULE_RUNNING_TO_RESTART_STOP_IT_BEFORE`
        ModuleRunningToRestartStopItBefore = 1 => "module-running-to-restart-stop-it-before",
        /// `ERROR_IMPOSSIBLE_TO_STOP_MODULE`
        ImpossibleToStopModule = 2 => "impossible-to-stop-module",
        /// `HERO_DSP_FATAL_ERROR`
        HeroDspFatalError = 100 => "hero-dsp-fatal-error",
        /// `COMMUNICATION_FATAL_ERROR`
        CommunicationFatalError = 101 => "communication-fatal-error",
        /// A movement did not begin or end in its time; the source has no such limit.
        MovementTimeout = 102 => "movement-timeout",
    }
}

/// Added to a DSP error code to make it an IMI error code (201 … 500).
pub const IMI_DSP_OFFSET: u32 = 200;

/// A number of the Inter Modular Interface as it lies in shared memory: named, a DSP error, or unknown.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
pub struct ImiCode(pub u32);

impl ImiCode {
    /// The error of this name, if it has one.
    pub const fn named(self) -> Option<ImiError> {
        ImiError::from_code(self.0)
    }

    /// The DSP's own error code, if it is a DSP error.
    pub const fn dsp_code(self) -> Option<u32> {
        match self.0 {
            201..=500 => Some(self.0 - IMI_DSP_OFFSET),
            _ => None,
        }
    }

    /// Whether it stands for no error.
    pub const fn is_none(self) -> bool {
        self.0 == ImiError::None.code()
    }
}

impl From<ImiError> for ImiCode {
    fn from(error: ImiError) -> ImiCode {
        ImiCode(error.code())
    }
}

impl std::fmt::Display for ImiCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.named(), self.dsp_code()) {
            (Some(error), _) => error.fmt(f),
            (None, Some(code)) => f.pad(&format!("dsp-error-{code}")),
            (None, None) => f.pad(&format!("imi-error-{}", self.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_as_themselves_and_unknown_ones_as_nothing() {
        for reason in Reason::ALL {
            assert_eq!(Reason::from_code(reason.code()), Some(reason));
        }
        for stage in Stage::ALL {
            assert_eq!(Stage::from_code(stage.code()), Some(stage));
        }
        assert_eq!(Stage::from_code(0), None);
        assert_eq!(Reason::from_code(u32::MAX), None);
    }

    #[test]
    fn the_final_reports_are_done_refused_aborted_unknown() {
        let finals: Vec<_> = Stage::ALL.iter().filter(|stage| stage.is_final()).collect();
        assert_eq!(
            finals,
            [
                &Stage::Done,
                &Stage::Refused,
                &Stage::Aborted,
                &Stage::Unknown
            ]
        );
    }

    #[test]
    fn an_imi_code_is_named_or_a_dsp_error_or_unknown() {
        let cases = [
            (0, "no-error"),
            (101, "communication-fatal-error"),
            (200, "imi-error-200"),
            (201, "dsp-error-1"),
            (500, "dsp-error-300"),
            (501, "imi-error-501"),
        ];
        for (code, text) in cases {
            assert_eq!(ImiCode(code).to_string(), text);
        }
    }

    #[test]
    fn each_group_has_its_own_bit_and_name() {
        let mut mask = 0_u16;
        for (index, group) in TelemetryGroup::ALL.into_iter().enumerate() {
            assert_eq!(group.bit(), 1 << index);
            assert_eq!(TelemetryGroup::from_name(group.name()), Some(group));
            mask |= group.bit();
        }
        assert_eq!(mask, u16::MAX);
        assert_eq!(TelemetryGroup::from_name("position"), None);
    }

    #[test]
    fn a_mask_gives_its_groups_in_order() {
        let groups: Vec<_> = TelemetryGroup::in_mask(0b1000_0000_0000_0011).collect();
        assert_eq!(
            groups,
            [
                TelemetryGroup::Time,
                TelemetryGroup::Geographic,
                TelemetryGroup::References
            ]
        );
    }
}
