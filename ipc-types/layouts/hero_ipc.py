"""Structs and numbers of the HERO RIL in shared memory. docs/ipc.md says what they mean."""

from __future__ import annotations

import ctypes
import enum
from typing import TYPE_CHECKING, Any, Generic, Iterator, Type, TypeVar

if TYPE_CHECKING:
    # To `mypy` and editors a `ctypes.Structure` has every attribute, so that a misspelt field would pass.
    _T = TypeVar("_T")
    _S = TypeVar("_S", bound="Struct")

    class Array(Generic[_T]):
        def __getitem__(self, index: int) -> _T: ...
        def __setitem__(self, index: int, value: _T) -> None: ...
        def __len__(self) -> int: ...
        def __iter__(self) -> Iterator[_T]: ...
        def __buffer__(self, flags: int) -> memoryview: ...

    class Struct:
        @classmethod
        def from_buffer_copy(cls: Type[_S], source: Any, offset: int = ...) -> _S: ...
        @staticmethod
        def type_name() -> str: ...
        def __buffer__(self, flags: int) -> memoryview: ...

else:
    Struct = ctypes.Structure

# What follows is made by ipc-types/tests/layout.rs: do not edit.

#: By service: the values of its attributes `layout` and `layout_hash`.
LAYOUTS = {
    "dsp_telemetry": ("hero.DspTelemetry.v3", "8c6956c8fcb0b385"),
    "hero_telemetry": ("hero.HeroTelemetry.v3", "9ec168c2cd0beb87"),
    "module_state": ("hero.ModuleState.v7", "d2fde892c5344b3d"),
    "module_control": ("hero.ModuleControl.v3/hero.RequestReport.v3", "cf3c38b4e2124ac6"),
    "movement": ("hero.MovementData.v4/hero.RequestReport.v3", "20f642fd866688b5"),
    "parameters": ("hero.ParameterRequest.v3/hero.RequestReport.v3", "8f60139dda1a192e"),
    "relay/link": ("hero.RelayLink.v3", "59df1188187319fb"),
    "relay/stations": ("hero.RelayStations.v4", "4f5b96e435f46e26"),
    "mavlink/stations": ("hero.MavlinkStations.v1", "c608520ae195721a"),
    "bridge/outline": ("hero.BridgeOutline.v1", "ddd0ecd9990358d4"),
    "bridge/configuration": ("hero.ConfigurationPiece.v1", "b00776c1f2b0df0a"),
    "status/configuration": ("hero.ConfigurationPiece.v1", "b00776c1f2b0df0a"),
    "bridge/journal": ("hero.BridgeJournal.v1", "a0a172067737e627"),
    "status/journal": ("hero.StatusJournal.v1", "394f9e703707f1ff"),
}


class ControlCommand(enum.IntEnum):
    START = 1
    STOP = 2
    RELOAD_FENCE = 3
    TAKE_CONTROL = 4
    RELEASE_CONTROL = 5
    PASS_CONTROL = 6


class MovementKind(enum.IntEnum):
    GOTO = 1
    TAKEOFF = 2
    LAND = 3
    HOLD = 4


class ModuleId(enum.IntEnum):
    HERO_BRIDGE = 1
    HERO_STATUS = 2
    HERO_RELAY = 3


class ModuleStatus(enum.IntEnum):
    WAITING_DATA_TO_START = 1
    RUNNING = 2
    ENDED = 3
    ABORTED = 4


class Functionality(enum.IntEnum):
    AT_REST = 1
    RECEIVING_PATH = 2
    TAKING_OFF = 3
    FOLLOWING_PATH = 4
    LANDING = 5
    STOPPING = 6
    HOLDING = 7


class LinkState(enum.IntEnum):
    CONNECTING = 1
    UP = 2
    SILENT = 3
    GONE = 4


class RelayLinkState(enum.IntEnum):
    CONNECTING = 1
    UP = 2
    DOWN = 3


class MavlinkVehicle(enum.IntEnum):
    HEARD = 1
    NO_STATE = 2
    LINK_DOWN = 3
    NO_TELEMETRY = 4


class DspPathState(enum.IntEnum):
    UNKNOWN = 1
    EMPTY = 2
    OURS = 3


class OutlineKind(enum.IntEnum):
    FENCE = 1
    AREA = 2
    PATH = 3


class PilotSwitch(enum.IntEnum):
    UNKNOWN = 0
    MANUAL = 1
    AUTO = 2


class SafetyRule(enum.IntEnum):
    PILOT_SWITCH = 1
    FENCE_INCLUSION = 2
    FENCE_EXCLUSION = 3
    FENCE_FLOOR = 4
    FENCE_CEILING = 5
    BATTERY = 6
    FUEL = 7
    LINK_LOSS = 8
    FENCE_UNJUDGEABLE = 9
    POSITION_LOST = 10
    FENCE_AHEAD = 11
    BELOW_TAKE_OFF = 12


class SafetyAction(enum.IntEnum):
    WARN = 1
    REFUSE = 2
    HOLD = 3
    LAND = 4


class ParameterOperation(enum.IntEnum):
    READ = 1
    WRITE = 2
    LIST = 3


class PortKind(enum.IntEnum):
    U16 = 1
    I16 = 2
    F32 = 3


class SenderLost(enum.IntEnum):
    CONTINUE = 1
    HOLD = 2
    LAND = 3


class CameBetween(enum.IntEnum):
    START = 1
    STOP = 2
    TAKEOFF = 3
    GOTO = 4
    LAND = 5
    HOLD = 6
    SAFETY_RULE = 7
    PILOT = 8
    LINK_LOST = 9
    DSP_REBOOTED = 10
    BRIDGE_BEGAN = 11
    SENDER_LOST = 12


class Stage(enum.IntEnum):
    ACCEPTED = 1
    PROGRESS = 2
    DONE = 16
    REFUSED = 17
    ABORTED = 18
    UNKNOWN = 19


class Reason(enum.IntEnum):
    NONE = 0
    INVALID_REQUEST = 1
    NOT_FINITE = 2
    OUT_OF_RANGE = 3
    TOO_FAR = 4
    NOT_STARTED = 5
    ALREADY_RUNNING = 6
    UNABLE_TO_ABORT = 7
    BUSY = 8
    LINK_DOWN = 9
    NOT_FLYING = 10
    ALREADY_FLYING = 11
    NO_POSITION = 12
    PATH_WITHOUT_HEAD = 13
    PATH_REPLACED = 14
    PATH_TOO_LONG = 15
    PATH_BROKEN = 16
    TOO_MANY_REQUESTS = 17
    TOO_LATE = 18
    MOVEMENT_TIMEOUT = 19
    STOPPED = 20
    DSP_FATAL_ERROR = 21
    COMMUNICATION_FATAL_ERROR = 22
    DSP_REBOOTED = 23
    BRIDGE_ENDING = 24
    BRIDGE_GONE = 25
    DELIVERY_FAILED = 26
    NOT_REMEMBERED = 27
    REFUSED_BY_DSP = 28
    REPLACED = 29
    PILOT_HAS_CONTROL = 30
    FENCE_BREACH = 31
    SUPPLY_LOW = 32
    LINK_LOST = 33
    NO_SUCH_PORT = 34
    NOT_IN_FLIGHT = 35
    INVALID_FENCE = 36
    RELAY_LINK_DOWN = 37
    RELAY_LINK_LOST = 38
    RELAY_NOT_PERMITTED = 39
    STILL_OPEN = 40
    RELAY_TOO_MANY_STATIONS = 41
    REPLAYED = 42
    SUPERSEDED = 43
    MODULE_GONE = 44
    NOT_IN_CONTROL = 45
    FENCE_UNREAD = 46
    CLOCK_DIFFERS = 47
    SENDER_LOST = 48
    RELAY_TWO_ROBOTS = 49


class ImiError(enum.IntEnum):
    NO_ERROR = 0
    MODULE_RUNNING_TO_RESTART_STOP_IT_BEFORE = 1
    IMPOSSIBLE_TO_STOP_MODULE = 2
    HERO_DSP_FATAL_ERROR = 100
    COMMUNICATION_FATAL_ERROR = 101
    MOVEMENT_TIMEOUT = 102


class TelemetryGroup(enum.IntFlag):
    TIME = 1
    GEOGRAPHIC = 2
    XY = 4
    GPS_VELOCITY = 8
    GPS_QUALITY = 16
    ATTITUDE = 32
    ACCELERATION = 64
    ANGULAR_RATE = 128
    PILOT_PWM = 256
    SONAR = 512
    SUPPLY = 1024
    PAN_TILT = 2048
    ROTOR_SPEED = 4096
    BAROMETER = 8192
    ACTUATION = 16384
    REFERENCES = 32768


class Event(enum.IntEnum):
    DATA = 1
    ARRIVED = 2
    LEFT = 3
    DIED = 4


class DspGeographic(Struct):
    """Geographic position, WGS 84."""

    latitude_deg: float
    """Latitude, degrees, north positive. [deg]"""
    longitude_deg: float
    """Longitude, degrees, east positive. [deg]"""
    altitude_m: float
    """Altitude, metres, up positive. [m]"""

    if TYPE_CHECKING:
        def __init__(self, latitude_deg: float = ..., longitude_deg: float = ..., altitude_m: float = ...) -> None: ...
    else:
        _fields_ = [
            ("latitude_deg", ctypes.c_double),
            ("longitude_deg", ctypes.c_double),
            ("altitude_m", ctypes.c_double),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspGeographic.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspGeographic) == 24
    assert DspGeographic.latitude_deg.offset == 0
    assert DspGeographic.longitude_deg.offset == 8
    assert DspGeographic.altitude_m.offset == 16


class DspXy(Struct):
    """The DSP's flat position; the origin is its first valid GPS fix."""

    x_m: float
    """East of the origin, metres. [m]"""
    y_m: float
    """North of the origin, metres. [m]"""

    if TYPE_CHECKING:
        def __init__(self, x_m: float = ..., y_m: float = ...) -> None: ...
    else:
        _fields_ = [
            ("x_m", ctypes.c_double),
            ("y_m", ctypes.c_double),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspXy.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspXy) == 16
    assert DspXy.x_m.offset == 0
    assert DspXy.y_m.offset == 8


class DspGpsVelocity(Struct):
    """GPS velocity."""

    horizontal_speed_mps: float
    """Speed over ground, m/s. [m/s]"""
    vertical_speed_mps: float
    """Climb speed, m/s, up positive. [m/s]"""
    heading_deg: float
    """Course over ground, degrees clockwise from true north, 0 … 360. [deg]"""

    if TYPE_CHECKING:
        def __init__(self, horizontal_speed_mps: float = ..., vertical_speed_mps: float = ..., heading_deg: float = ...) -> None: ...
    else:
        _fields_ = [
            ("horizontal_speed_mps", ctypes.c_float),
            ("vertical_speed_mps", ctypes.c_float),
            ("heading_deg", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspGpsVelocity.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspGpsVelocity) == 12
    assert DspGpsVelocity.horizontal_speed_mps.offset == 0
    assert DspGpsVelocity.vertical_speed_mps.offset == 4
    assert DspGpsVelocity.heading_deg.offset == 8


class DspAttitude(Struct):
    """IMU attitude of the body (x forward, y right, z down)."""

    pitch_deg: float
    """Nose up positive, degrees. [deg]"""
    roll_deg: float
    """Right side down positive, degrees. [deg]"""
    yaw_deg: float
    """Clockwise from true north, degrees, −180 … 180. [deg]"""

    if TYPE_CHECKING:
        def __init__(self, pitch_deg: float = ..., roll_deg: float = ..., yaw_deg: float = ...) -> None: ...
    else:
        _fields_ = [
            ("pitch_deg", ctypes.c_float),
            ("roll_deg", ctypes.c_float),
            ("yaw_deg", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspAttitude.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspAttitude) == 12
    assert DspAttitude.pitch_deg.offset == 0
    assert DspAttitude.roll_deg.offset == 4
    assert DspAttitude.yaw_deg.offset == 8


class DspAcceleration(Struct):
    """IMU specific force in body axes."""

    x_mps2: float
    """Forward, m/s². [m/s²]"""
    y_mps2: float
    """Right, m/s². [m/s²]"""
    z_mps2: float
    """Down, m/s²; about −9.81 at rest. [m/s²]"""

    if TYPE_CHECKING:
        def __init__(self, x_mps2: float = ..., y_mps2: float = ..., z_mps2: float = ...) -> None: ...
    else:
        _fields_ = [
            ("x_mps2", ctypes.c_float),
            ("y_mps2", ctypes.c_float),
            ("z_mps2", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspAcceleration.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspAcceleration) == 12
    assert DspAcceleration.x_mps2.offset == 0
    assert DspAcceleration.y_mps2.offset == 4
    assert DspAcceleration.z_mps2.offset == 8


class DspAngularRate(Struct):
    """IMU angular rate in body axes."""

    x_radps: float
    """About the forward axis, 1/s. [rad/s]"""
    y_radps: float
    """About the right axis, 1/s. [rad/s]"""
    z_radps: float
    """About the down axis, 1/s. [rad/s]"""

    if TYPE_CHECKING:
        def __init__(self, x_radps: float = ..., y_radps: float = ..., z_radps: float = ...) -> None: ...
    else:
        _fields_ = [
            ("x_radps", ctypes.c_float),
            ("y_radps", ctypes.c_float),
            ("z_radps", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspAngularRate.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspAngularRate) == 12
    assert DspAngularRate.x_radps.offset == 0
    assert DspAngularRate.y_radps.offset == 4
    assert DspAngularRate.z_radps.offset == 8


class DspServoPulses(Struct):
    """Pulse widths of the five servo channels, µs."""

    collective_us: int
    """Collective pitch, µs. [µs]"""
    roll_us: int
    """Lateral cyclic, µs. [µs]"""
    pitch_us: int
    """Longitudinal cyclic, µs. [µs]"""
    tail_us: int
    """Tail rotor, µs. [µs]"""
    throttle_us: int
    """Throttle, µs. [µs]"""

    if TYPE_CHECKING:
        def __init__(self, collective_us: int = ..., roll_us: int = ..., pitch_us: int = ..., tail_us: int = ..., throttle_us: int = ...) -> None: ...
    else:
        _fields_ = [
            ("collective_us", ctypes.c_uint32),
            ("roll_us", ctypes.c_uint32),
            ("pitch_us", ctypes.c_uint32),
            ("tail_us", ctypes.c_uint32),
            ("throttle_us", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspServoPulses.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspServoPulses) == 20
    assert DspServoPulses.collective_us.offset == 0
    assert DspServoPulses.roll_us.offset == 4
    assert DspServoPulses.pitch_us.offset == 8
    assert DspServoPulses.tail_us.offset == 12
    assert DspServoPulses.throttle_us.offset == 16


class DspSupply(Struct):
    """Battery, fuel, switch."""

    battery_mv: int
    """Battery, millivolts. [mV]"""
    fuel_percent: int
    """Fuel, percent. [%]"""
    auto_switch: int
    """0 manual, 1 auto."""

    if TYPE_CHECKING:
        def __init__(self, battery_mv: int = ..., fuel_percent: int = ..., auto_switch: int = ...) -> None: ...
    else:
        _fields_ = [
            ("battery_mv", ctypes.c_uint32),
            ("fuel_percent", ctypes.c_uint32),
            ("auto_switch", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspSupply.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspSupply) == 12
    assert DspSupply.battery_mv.offset == 0
    assert DspSupply.fuel_percent.offset == 4
    assert DspSupply.auto_switch.offset == 8


class DspPanTilt(Struct):
    """Pan and tilt potentiometers, raw ADC."""

    pan_adc: int
    """Pan, raw ADC."""
    tilt_adc: int
    """Tilt, raw ADC."""

    if TYPE_CHECKING:
        def __init__(self, pan_adc: int = ..., tilt_adc: int = ...) -> None: ...
    else:
        _fields_ = [
            ("pan_adc", ctypes.c_uint32),
            ("tilt_adc", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspPanTilt.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspPanTilt) == 8
    assert DspPanTilt.pan_adc.offset == 0
    assert DspPanTilt.tilt_adc.offset == 4


class DspReferences(Struct):
    """References of the DSP's controllers."""

    x_speed_mps: float
    """Speed to the east, m/s. [m/s]"""
    y_speed_mps: float
    """Speed to the north, m/s. [m/s]"""
    altitude_m: float
    """Altitude, metres. [m]"""
    pitch_deg: float
    """Pitch, degrees. [deg]"""
    roll_deg: float
    """Roll, degrees. [deg]"""
    yaw_deg: float
    """Yaw, degrees. [deg]"""
    reserved: int
    """Always zero; keeps the size of the sample a multiple of eight."""

    if TYPE_CHECKING:
        def __init__(self, x_speed_mps: float = ..., y_speed_mps: float = ..., altitude_m: float = ..., pitch_deg: float = ..., roll_deg: float = ..., yaw_deg: float = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("x_speed_mps", ctypes.c_float),
            ("y_speed_mps", ctypes.c_float),
            ("altitude_m", ctypes.c_float),
            ("pitch_deg", ctypes.c_float),
            ("roll_deg", ctypes.c_float),
            ("yaw_deg", ctypes.c_float),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspReferences.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspReferences) == 28
    assert DspReferences.x_speed_mps.offset == 0
    assert DspReferences.y_speed_mps.offset == 4
    assert DspReferences.altitude_m.offset == 8
    assert DspReferences.pitch_deg.offset == 12
    assert DspReferences.roll_deg.offset == 16
    assert DspReferences.yaw_deg.offset == 20
    assert DspReferences.reserved.offset == 24


class DspTelemetry(Struct):
    """One status message of the DSP, in its own units. Service `dsp_telemetry`, written by the bridge.
    
    A group's values mean something only when its bit is set in `valid_groups`; the others are zero. These are the
    DSP's: groups 1 to 3 mean nothing either while group 4 says that the GPS has no fix. `HeroTelemetry` has that in
    its `valid_groups`."""

    sequence: int
    """Counts the samples of this publisher from 1; a gap is a loss."""
    epoch_ns: int
    """When the publishing process began, host monotonic ns: another value means another publisher. [ns]"""
    received_ns: int
    """When the last byte of the message was read, host monotonic ns. [ns]"""
    sent_ns: int
    """When the last byte of the message left the DSP, at the latest, host monotonic ns: by the speed of the line,
    what was read with it behind it left the DSP after it. 0 when nobody knows. [ns]"""
    sent_uncertainty_s: float
    """By how much earlier it may have left, s: for so long the serial adapter keeps bytes back at most. That a
    bridge was held up is not in it. [s]"""
    dsp_time_ms: int
    """Milliseconds since the DSP's boot (group 0, `tiempo_local`). [ms]"""
    valid_groups: int
    """Bit *k* is set when the DSP sent group *k* of the status mask, and its values are plausible."""
    flying: int
    """1 when the helicopter is in the air (`heli_volando`), else 0."""
    gps_quality: int
    """NMEA fix quality, 0 … 8 (group 4, `qos_GPS`)."""
    dsp_boots: int
    """How often the DSP was seen to boot since `epoch_ns`."""
    dsp_errors: int
    """DSP errors received since `epoch_ns`."""
    last_dsp_error_code: int
    """Code of the last DSP error as the DSP sent it, 0 … 65535; means something when `dsp_errors` is not 0."""
    rotor_rpm: int
    """Main rotor, rpm (group 12). [rpm]"""
    geographic: DspGeographic
    """Geographic position (group 1)."""
    xy: DspXy
    """XY position (group 2)."""
    gps_velocity: DspGpsVelocity
    """GPS velocity (group 3)."""
    attitude: DspAttitude
    """IMU attitude (group 5)."""
    acceleration: DspAcceleration
    """IMU acceleration (group 6)."""
    angular_rate: DspAngularRate
    """IMU angular rate (group 7)."""
    pilot_pwm: DspServoPulses
    """Pilot's PWM signals (group 8)."""
    actuation: DspServoPulses
    """Actuation of the servos (group 14)."""
    sonar_adc: int
    """Sonar, raw ADC (group 9)."""
    barometer_adc: int
    """Barometric altimeter, raw ADC (group 13)."""
    supply: DspSupply
    """Battery, fuel, switch (group 10)."""
    pan_tilt: DspPanTilt
    """Pan and tilt potentiometers (group 11)."""
    references: DspReferences
    """Controller references (group 15)."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., received_ns: int = ..., sent_ns: int = ..., sent_uncertainty_s: float = ..., dsp_time_ms: int = ..., valid_groups: int = ..., flying: int = ..., gps_quality: int = ..., dsp_boots: int = ..., dsp_errors: int = ..., last_dsp_error_code: int = ..., rotor_rpm: int = ..., geographic: DspGeographic = ..., xy: DspXy = ..., gps_velocity: DspGpsVelocity = ..., attitude: DspAttitude = ..., acceleration: DspAcceleration = ..., angular_rate: DspAngularRate = ..., pilot_pwm: DspServoPulses = ..., actuation: DspServoPulses = ..., sonar_adc: int = ..., barometer_adc: int = ..., supply: DspSupply = ..., pan_tilt: DspPanTilt = ..., references: DspReferences = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("received_ns", ctypes.c_uint64),
            ("sent_ns", ctypes.c_uint64),
            ("sent_uncertainty_s", ctypes.c_double),
            ("dsp_time_ms", ctypes.c_uint32),
            ("valid_groups", ctypes.c_uint16),
            ("flying", ctypes.c_uint8),
            ("gps_quality", ctypes.c_uint8),
            ("dsp_boots", ctypes.c_uint32),
            ("dsp_errors", ctypes.c_uint32),
            ("last_dsp_error_code", ctypes.c_uint32),
            ("rotor_rpm", ctypes.c_uint32),
            ("geographic", DspGeographic),
            ("xy", DspXy),
            ("gps_velocity", DspGpsVelocity),
            ("attitude", DspAttitude),
            ("acceleration", DspAcceleration),
            ("angular_rate", DspAngularRate),
            ("pilot_pwm", DspServoPulses),
            ("actuation", DspServoPulses),
            ("sonar_adc", ctypes.c_uint32),
            ("barometer_adc", ctypes.c_uint32),
            ("supply", DspSupply),
            ("pan_tilt", DspPanTilt),
            ("references", DspReferences),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspTelemetry.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspTelemetry) == 248
    assert DspTelemetry.sequence.offset == 0
    assert DspTelemetry.epoch_ns.offset == 8
    assert DspTelemetry.received_ns.offset == 16
    assert DspTelemetry.sent_ns.offset == 24
    assert DspTelemetry.sent_uncertainty_s.offset == 32
    assert DspTelemetry.dsp_time_ms.offset == 40
    assert DspTelemetry.valid_groups.offset == 44
    assert DspTelemetry.flying.offset == 46
    assert DspTelemetry.gps_quality.offset == 47
    assert DspTelemetry.dsp_boots.offset == 48
    assert DspTelemetry.dsp_errors.offset == 52
    assert DspTelemetry.last_dsp_error_code.offset == 56
    assert DspTelemetry.rotor_rpm.offset == 60
    assert DspTelemetry.geographic.offset == 64
    assert DspTelemetry.xy.offset == 88
    assert DspTelemetry.gps_velocity.offset == 104
    assert DspTelemetry.attitude.offset == 116
    assert DspTelemetry.acceleration.offset == 128
    assert DspTelemetry.angular_rate.offset == 140
    assert DspTelemetry.pilot_pwm.offset == 152
    assert DspTelemetry.actuation.offset == 172
    assert DspTelemetry.sonar_adc.offset == 192
    assert DspTelemetry.barometer_adc.offset == 196
    assert DspTelemetry.supply.offset == 200
    assert DspTelemetry.pan_tilt.offset == 212
    assert DspTelemetry.references.offset == 220


class HeroGeodetic(Struct):
    """WGS 84 position."""

    latitude_rad: float
    """Latitude, rad, north positive. [rad]"""
    longitude_rad: float
    """Longitude, rad, east positive. [rad]"""
    altitude_m: float
    """Altitude, m, up positive. [m]"""

    if TYPE_CHECKING:
        def __init__(self, latitude_rad: float = ..., longitude_rad: float = ..., altitude_m: float = ...) -> None: ...
    else:
        _fields_ = [
            ("latitude_rad", ctypes.c_double),
            ("longitude_rad", ctypes.c_double),
            ("altitude_m", ctypes.c_double),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroGeodetic.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroGeodetic) == 24
    assert HeroGeodetic.latitude_rad.offset == 0
    assert HeroGeodetic.longitude_rad.offset == 8
    assert HeroGeodetic.altitude_m.offset == 16


class HeroLocal(Struct):
    """Position in the plane that touches the Earth at the DSP's first valid GPS fix."""

    east_m: float
    """East, m. [m]"""
    north_m: float
    """North, m. [m]"""

    if TYPE_CHECKING:
        def __init__(self, east_m: float = ..., north_m: float = ...) -> None: ...
    else:
        _fields_ = [
            ("east_m", ctypes.c_double),
            ("north_m", ctypes.c_double),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroLocal.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroLocal) == 16
    assert HeroLocal.east_m.offset == 0
    assert HeroLocal.north_m.offset == 8


class HeroVelocity(Struct):
    """Velocity over ground."""

    north_mps: float
    """To the north, m/s. [m/s]"""
    east_mps: float
    """To the east, m/s. [m/s]"""
    up_mps: float
    """Upwards, m/s. [m/s]"""
    ground_speed_mps: float
    """Horizontal speed, m/s. [m/s]"""
    course_rad: float
    """Course over ground, rad clockwise from true north, −π … π. [rad]"""

    if TYPE_CHECKING:
        def __init__(self, north_mps: float = ..., east_mps: float = ..., up_mps: float = ..., ground_speed_mps: float = ..., course_rad: float = ...) -> None: ...
    else:
        _fields_ = [
            ("north_mps", ctypes.c_float),
            ("east_mps", ctypes.c_float),
            ("up_mps", ctypes.c_float),
            ("ground_speed_mps", ctypes.c_float),
            ("course_rad", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroVelocity.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroVelocity) == 20
    assert HeroVelocity.north_mps.offset == 0
    assert HeroVelocity.east_mps.offset == 4
    assert HeroVelocity.up_mps.offset == 8
    assert HeroVelocity.ground_speed_mps.offset == 12
    assert HeroVelocity.course_rad.offset == 16


class HeroAttitude(Struct):
    """Attitude: roll, pitch, yaw of the body (forward, right, down) against north, east, down."""

    roll_rad: float
    """Right side down positive, rad. [rad]"""
    pitch_rad: float
    """Nose up positive, rad. [rad]"""
    yaw_rad: float
    """Clockwise from true north, rad, −π … π. [rad]"""

    if TYPE_CHECKING:
        def __init__(self, roll_rad: float = ..., pitch_rad: float = ..., yaw_rad: float = ...) -> None: ...
    else:
        _fields_ = [
            ("roll_rad", ctypes.c_float),
            ("pitch_rad", ctypes.c_float),
            ("yaw_rad", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroAttitude.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroAttitude) == 12
    assert HeroAttitude.roll_rad.offset == 0
    assert HeroAttitude.pitch_rad.offset == 4
    assert HeroAttitude.yaw_rad.offset == 8


class HeroAcceleration(Struct):
    """Specific force along the body's axes."""

    forward_mps2: float
    """Forward, m/s². [m/s²]"""
    right_mps2: float
    """Right, m/s². [m/s²]"""
    down_mps2: float
    """Down, m/s²; about −9.81 at rest. [m/s²]"""

    if TYPE_CHECKING:
        def __init__(self, forward_mps2: float = ..., right_mps2: float = ..., down_mps2: float = ...) -> None: ...
    else:
        _fields_ = [
            ("forward_mps2", ctypes.c_float),
            ("right_mps2", ctypes.c_float),
            ("down_mps2", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroAcceleration.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroAcceleration) == 12
    assert HeroAcceleration.forward_mps2.offset == 0
    assert HeroAcceleration.right_mps2.offset == 4
    assert HeroAcceleration.down_mps2.offset == 8


class HeroAngularRate(Struct):
    """Angular rate about the body's axes."""

    forward_radps: float
    """About the forward axis, rad/s. [rad/s]"""
    right_radps: float
    """About the right axis, rad/s. [rad/s]"""
    down_radps: float
    """About the down axis, rad/s. [rad/s]"""

    if TYPE_CHECKING:
        def __init__(self, forward_radps: float = ..., right_radps: float = ..., down_radps: float = ...) -> None: ...
    else:
        _fields_ = [
            ("forward_radps", ctypes.c_float),
            ("right_radps", ctypes.c_float),
            ("down_radps", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroAngularRate.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroAngularRate) == 12
    assert HeroAngularRate.forward_radps.offset == 0
    assert HeroAngularRate.right_radps.offset == 4
    assert HeroAngularRate.down_radps.offset == 8


class HeroServos(Struct):
    """Five servo channels, −1 … 1 at the ends of the travel."""

    collective: float
    """Collective pitch."""
    roll: float
    """Lateral cyclic."""
    pitch: float
    """Longitudinal cyclic."""
    tail: float
    """Tail rotor."""
    throttle: float
    """Throttle."""

    if TYPE_CHECKING:
        def __init__(self, collective: float = ..., roll: float = ..., pitch: float = ..., tail: float = ..., throttle: float = ...) -> None: ...
    else:
        _fields_ = [
            ("collective", ctypes.c_float),
            ("roll", ctypes.c_float),
            ("pitch", ctypes.c_float),
            ("tail", ctypes.c_float),
            ("throttle", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroServos.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroServos) == 20
    assert HeroServos.collective.offset == 0
    assert HeroServos.roll.offset == 4
    assert HeroServos.pitch.offset == 8
    assert HeroServos.tail.offset == 12
    assert HeroServos.throttle.offset == 16


class HeroSupply(Struct):
    """Battery, fuel, switch."""

    battery_v: float
    """Battery, volts. [V]"""
    fuel_fraction: float
    """Fuel, 0 … 1."""
    auto_switch: int
    """0 manual, 1 auto."""

    if TYPE_CHECKING:
        def __init__(self, battery_v: float = ..., fuel_fraction: float = ..., auto_switch: int = ...) -> None: ...
    else:
        _fields_ = [
            ("battery_v", ctypes.c_float),
            ("fuel_fraction", ctypes.c_float),
            ("auto_switch", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroSupply.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroSupply) == 12
    assert HeroSupply.battery_v.offset == 0
    assert HeroSupply.fuel_fraction.offset == 4
    assert HeroSupply.auto_switch.offset == 8


class HeroReferences(Struct):
    """References of the DSP's controllers."""

    north_mps: float
    """Velocity to the north, m/s. [m/s]"""
    east_mps: float
    """Velocity to the east, m/s. [m/s]"""
    altitude_m: float
    """Altitude, m. [m]"""
    roll_rad: float
    """Roll, rad. [rad]"""
    pitch_rad: float
    """Pitch, rad. [rad]"""
    yaw_rad: float
    """Yaw, rad. [rad]"""

    if TYPE_CHECKING:
        def __init__(self, north_mps: float = ..., east_mps: float = ..., altitude_m: float = ..., roll_rad: float = ..., pitch_rad: float = ..., yaw_rad: float = ...) -> None: ...
    else:
        _fields_ = [
            ("north_mps", ctypes.c_float),
            ("east_mps", ctypes.c_float),
            ("altitude_m", ctypes.c_float),
            ("roll_rad", ctypes.c_float),
            ("pitch_rad", ctypes.c_float),
            ("yaw_rad", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroReferences.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroReferences) == 24
    assert HeroReferences.north_mps.offset == 0
    assert HeroReferences.east_mps.offset == 4
    assert HeroReferences.altitude_m.offset == 8
    assert HeroReferences.roll_rad.offset == 12
    assert HeroReferences.pitch_rad.offset == 16
    assert HeroReferences.yaw_rad.offset == 20


class HeroEstimate(Struct):
    """Output of the estimator of status. The values mean something when `valid` is 1; else all are zero."""

    altitude_m: float
    """Altitude, m, same zero as the GPS altitude. [m]"""
    altitude_variance_m2: float
    """Variance of `altitude_m`, m². [m²]"""
    vertical_speed_mps: float
    """Climb speed, m/s, up positive. [m/s]"""
    inputs: int
    """Sensors that contributed to this sample: bit 0 GPS, bit 1 barometer, bit 2 sonar."""
    valid: int
    """1 when the values mean something."""

    if TYPE_CHECKING:
        def __init__(self, altitude_m: float = ..., altitude_variance_m2: float = ..., vertical_speed_mps: float = ..., inputs: int = ..., valid: int = ...) -> None: ...
    else:
        _fields_ = [
            ("altitude_m", ctypes.c_double),
            ("altitude_variance_m2", ctypes.c_double),
            ("vertical_speed_mps", ctypes.c_double),
            ("inputs", ctypes.c_uint32),
            ("valid", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroEstimate.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroEstimate) == 32
    assert HeroEstimate.altitude_m.offset == 0
    assert HeroEstimate.altitude_variance_m2.offset == 8
    assert HeroEstimate.vertical_speed_mps.offset == 16
    assert HeroEstimate.inputs.offset == 24
    assert HeroEstimate.valid.offset == 28


class HeroTelemetry(Struct):
    """The state of the helicopter in SI units, angles in radians, axes named. Service `hero_telemetry`, written by
    status.
    
    A group's values mean something only when its bit is set in `valid_groups`, which has the bits of the DSP's
    status mask; the others are zero. While the GPS has no fix, groups 1 to 3 are not valid: there is no position
    and no velocity."""

    sequence: int
    """Counts the samples of this publisher from 1; a gap is a loss."""
    epoch_ns: int
    """When the publishing process began, host monotonic ns. [ns]"""
    source_sequence: int
    """`sequence` of the DspTelemetry that this was made of."""
    source_epoch_ns: int
    """`epoch_ns` of the DspTelemetry that this was made of. [ns]"""
    received_ns: int
    """When the bridge read the message's last byte, host monotonic ns. [ns]"""
    sent_ns: int
    """When the last byte of the message left the DSP, at the latest, host monotonic ns: by the speed of the line,
    what was read with it behind it left the DSP after it. 0 when nobody knows. [ns]"""
    sent_uncertainty_s: float
    """By how much earlier it may have left, s: for so long the serial adapter keeps bytes back at most. That a
    bridge was held up is not in it. [s]"""
    published_ns: int
    """When status published this, host monotonic ns. [ns]"""
    dsp_time_s: float
    """Time since the DSP's boot, s (group 0). [s]"""
    valid_groups: int
    """Bit *k* is set when group *k* of the status mask is valid."""
    flying: int
    """1 when the helicopter is in the air, else 0."""
    dsp_boots: int
    """How often the DSP was seen to boot since `source_epoch_ns`."""
    dsp_errors: int
    """DSP errors received since `source_epoch_ns`."""
    last_dsp_error_code: int
    """Code of the last DSP error as the DSP sent it, 0 … 65535; means something when `dsp_errors` is not 0."""
    gps_quality: int
    """NMEA fix quality, 0 … 8 (group 4)."""
    geodetic: HeroGeodetic
    """WGS 84 position (group 1)."""
    local: HeroLocal
    """Position in the local east-north plane (group 2)."""
    velocity: HeroVelocity
    """Velocity over ground (group 3)."""
    attitude: HeroAttitude
    """Attitude of the body (forward, right, down) against north, east, down (group 5)."""
    acceleration: HeroAcceleration
    """Specific force along the body's axes (group 6)."""
    angular_rate: HeroAngularRate
    """Angular rate about the body's axes (group 7)."""
    pilot: HeroServos
    """Pilot's sticks, −1 … 1 at the ends of the servo's travel (group 8)."""
    actuation: HeroServos
    """Actuation of the servos, −1 … 1 at the ends of the servo's travel (group 14)."""
    sonar_height_m: float
    """Height over ground by sonar, m (group 9). [m]"""
    barometer_altitude_m: float
    """Barometric altitude, m (group 13). [m]"""
    supply: HeroSupply
    """Battery, fuel, switch (group 10)."""
    pan_rad: float
    """Camera's pan, rad, right positive (group 11). [rad]"""
    tilt_rad: float
    """Camera's tilt, rad, up positive (group 11). [rad]"""
    rotor_radps: float
    """Main rotor, rad/s (group 12). [rad/s]"""
    references: HeroReferences
    """Controller references (group 15)."""
    estimate: HeroEstimate
    """What the estimator of status makes of several sensors; it is off by default."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., source_sequence: int = ..., source_epoch_ns: int = ..., received_ns: int = ..., sent_ns: int = ..., sent_uncertainty_s: float = ..., published_ns: int = ..., dsp_time_s: float = ..., valid_groups: int = ..., flying: int = ..., dsp_boots: int = ..., dsp_errors: int = ..., last_dsp_error_code: int = ..., gps_quality: int = ..., geodetic: HeroGeodetic = ..., local: HeroLocal = ..., velocity: HeroVelocity = ..., attitude: HeroAttitude = ..., acceleration: HeroAcceleration = ..., angular_rate: HeroAngularRate = ..., pilot: HeroServos = ..., actuation: HeroServos = ..., sonar_height_m: float = ..., barometer_altitude_m: float = ..., supply: HeroSupply = ..., pan_rad: float = ..., tilt_rad: float = ..., rotor_radps: float = ..., references: HeroReferences = ..., estimate: HeroEstimate = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("source_sequence", ctypes.c_uint64),
            ("source_epoch_ns", ctypes.c_uint64),
            ("received_ns", ctypes.c_uint64),
            ("sent_ns", ctypes.c_uint64),
            ("sent_uncertainty_s", ctypes.c_double),
            ("published_ns", ctypes.c_uint64),
            ("dsp_time_s", ctypes.c_double),
            ("valid_groups", ctypes.c_uint32),
            ("flying", ctypes.c_uint32),
            ("dsp_boots", ctypes.c_uint32),
            ("dsp_errors", ctypes.c_uint32),
            ("last_dsp_error_code", ctypes.c_uint32),
            ("gps_quality", ctypes.c_uint32),
            ("geodetic", HeroGeodetic),
            ("local", HeroLocal),
            ("velocity", HeroVelocity),
            ("attitude", HeroAttitude),
            ("acceleration", HeroAcceleration),
            ("angular_rate", HeroAngularRate),
            ("pilot", HeroServos),
            ("actuation", HeroServos),
            ("sonar_height_m", ctypes.c_float),
            ("barometer_altitude_m", ctypes.c_float),
            ("supply", HeroSupply),
            ("pan_rad", ctypes.c_float),
            ("tilt_rad", ctypes.c_float),
            ("rotor_radps", ctypes.c_float),
            ("references", HeroReferences),
            ("estimate", HeroEstimate),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroTelemetry.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(HeroTelemetry) == 320
    assert HeroTelemetry.sequence.offset == 0
    assert HeroTelemetry.epoch_ns.offset == 8
    assert HeroTelemetry.source_sequence.offset == 16
    assert HeroTelemetry.source_epoch_ns.offset == 24
    assert HeroTelemetry.received_ns.offset == 32
    assert HeroTelemetry.sent_ns.offset == 40
    assert HeroTelemetry.sent_uncertainty_s.offset == 48
    assert HeroTelemetry.published_ns.offset == 56
    assert HeroTelemetry.dsp_time_s.offset == 64
    assert HeroTelemetry.valid_groups.offset == 72
    assert HeroTelemetry.flying.offset == 76
    assert HeroTelemetry.dsp_boots.offset == 80
    assert HeroTelemetry.dsp_errors.offset == 84
    assert HeroTelemetry.last_dsp_error_code.offset == 88
    assert HeroTelemetry.gps_quality.offset == 92
    assert HeroTelemetry.geodetic.offset == 96
    assert HeroTelemetry.local.offset == 120
    assert HeroTelemetry.velocity.offset == 136
    assert HeroTelemetry.attitude.offset == 156
    assert HeroTelemetry.acceleration.offset == 168
    assert HeroTelemetry.angular_rate.offset == 180
    assert HeroTelemetry.pilot.offset == 192
    assert HeroTelemetry.actuation.offset == 212
    assert HeroTelemetry.sonar_height_m.offset == 232
    assert HeroTelemetry.barometer_altitude_m.offset == 236
    assert HeroTelemetry.supply.offset == 240
    assert HeroTelemetry.pan_rad.offset == 252
    assert HeroTelemetry.tilt_rad.offset == 256
    assert HeroTelemetry.rotor_radps.offset == 260
    assert HeroTelemetry.references.offset == 264
    assert HeroTelemetry.estimate.offset == 288


class MovementState(Struct):
    """Progress of a movement."""

    request_id: int
    """Request that began or closed it."""
    path_id: int
    """Its path, 0 for take-off and landing."""
    kind: int
    """A MovementKind, 0 before the first movement."""
    waypoints_total: int
    """Waypoints of the path."""
    waypoints_sent: int
    """Waypoints sent to the DSP."""
    waypoints_reached: int
    """Waypoints that the helicopter was seen to reach, in order."""
    distance_to_go_m: float
    """Horizontal distance to the last waypoint, m; meaningful when `distance_valid` is 1. [m]"""
    distance_valid: int
    """1 when `distance_to_go_m` is known."""

    if TYPE_CHECKING:
        def __init__(self, request_id: int = ..., path_id: int = ..., kind: int = ..., waypoints_total: int = ..., waypoints_sent: int = ..., waypoints_reached: int = ..., distance_to_go_m: float = ..., distance_valid: int = ...) -> None: ...
    else:
        _fields_ = [
            ("request_id", ctypes.c_uint64),
            ("path_id", ctypes.c_uint64),
            ("kind", ctypes.c_uint32),
            ("waypoints_total", ctypes.c_uint32),
            ("waypoints_sent", ctypes.c_uint32),
            ("waypoints_reached", ctypes.c_uint32),
            ("distance_to_go_m", ctypes.c_float),
            ("distance_valid", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.MovementState.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(MovementState) == 40
    assert MovementState.request_id.offset == 0
    assert MovementState.path_id.offset == 8
    assert MovementState.kind.offset == 16
    assert MovementState.waypoints_total.offset == 20
    assert MovementState.waypoints_sent.offset == 24
    assert MovementState.waypoints_reached.offset == 28
    assert MovementState.distance_to_go_m.offset == 32
    assert MovementState.distance_valid.offset == 36


class MovementEnd(Struct):
    """How a movement ended: what its final report says, for those who did not order it."""

    ended_ns: int
    """When it ended, 0 when no movement has ended. [ns]"""
    request_id: int
    """Request that began or closed it; 0 when a safety rule ordered it."""
    kind: int
    """A MovementKind, 0 when no movement has ended."""
    stage: int
    """A Stage: done, aborted or unknown."""
    reason: int
    """A Reason."""
    waypoints_reached: int
    """Waypoints that the helicopter was seen to reach."""

    if TYPE_CHECKING:
        def __init__(self, ended_ns: int = ..., request_id: int = ..., kind: int = ..., stage: int = ..., reason: int = ..., waypoints_reached: int = ...) -> None: ...
    else:
        _fields_ = [
            ("ended_ns", ctypes.c_uint64),
            ("request_id", ctypes.c_uint64),
            ("kind", ctypes.c_uint32),
            ("stage", ctypes.c_uint32),
            ("reason", ctypes.c_uint32),
            ("waypoints_reached", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.MovementEnd.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(MovementEnd) == 32
    assert MovementEnd.ended_ns.offset == 0
    assert MovementEnd.request_id.offset == 8
    assert MovementEnd.kind.offset == 16
    assert MovementEnd.stage.offset == 20
    assert MovementEnd.reason.offset == 24
    assert MovementEnd.waypoints_reached.offset == 28


class LinkHealth(Struct):
    """The line to the DSP."""

    last_message_ns: int
    """When the last valid message came. [ns]"""
    last_telemetry_ns: int
    """When the last status message was published. [ns]"""
    state_since_ns: int
    """Since when `state` holds. [ns]"""
    bytes_received: int
    """Bytes received."""
    messages_received: int
    """Valid messages received."""
    state: int
    """A LinkState."""
    port_openings: int
    """How often the port was opened."""
    dsp_boots: int
    """How often the DSP was seen to boot."""
    commands_acknowledged: int
    """Commands acknowledged."""
    commands_repeated: int
    """Commands sent again after a timeout."""
    commands_failed: int
    """Commands given up after the last attempt."""
    acks_unmatched: int
    """Acknowledgements that matched no outstanding command."""
    waypoints_sent: int
    """Waypoints sent."""
    waypoints_repeated: int
    """Waypoints sent again because the DSP had not taken them."""
    delivery_verified: int
    """1 when the DSP counts the waypoints that it takes, 0 when it does not or has not been asked yet."""
    telemetry_published: int
    """Telemetry samples published."""
    telemetry_incoherent: int
    """Status samples that coherence in time dropped."""
    dsp_path: int
    """What the DSP's path buffer may hold, a DspPathState."""
    pc_timeout_supported: int
    """1 when the DSP stops by itself when the bridge is gone (`pc_timeout_ms`), 0 when it does not or was not asked yet."""

    if TYPE_CHECKING:
        def __init__(self, last_message_ns: int = ..., last_telemetry_ns: int = ..., state_since_ns: int = ..., bytes_received: int = ..., messages_received: int = ..., state: int = ..., port_openings: int = ..., dsp_boots: int = ..., commands_acknowledged: int = ..., commands_repeated: int = ..., commands_failed: int = ..., acks_unmatched: int = ..., waypoints_sent: int = ..., waypoints_repeated: int = ..., delivery_verified: int = ..., telemetry_published: int = ..., telemetry_incoherent: int = ..., dsp_path: int = ..., pc_timeout_supported: int = ...) -> None: ...
    else:
        _fields_ = [
            ("last_message_ns", ctypes.c_uint64),
            ("last_telemetry_ns", ctypes.c_uint64),
            ("state_since_ns", ctypes.c_uint64),
            ("bytes_received", ctypes.c_uint64),
            ("messages_received", ctypes.c_uint64),
            ("state", ctypes.c_uint32),
            ("port_openings", ctypes.c_uint32),
            ("dsp_boots", ctypes.c_uint32),
            ("commands_acknowledged", ctypes.c_uint32),
            ("commands_repeated", ctypes.c_uint32),
            ("commands_failed", ctypes.c_uint32),
            ("acks_unmatched", ctypes.c_uint32),
            ("waypoints_sent", ctypes.c_uint32),
            ("waypoints_repeated", ctypes.c_uint32),
            ("delivery_verified", ctypes.c_uint32),
            ("telemetry_published", ctypes.c_uint32),
            ("telemetry_incoherent", ctypes.c_uint32),
            ("dsp_path", ctypes.c_uint32),
            ("pc_timeout_supported", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.LinkHealth.v2"


if not TYPE_CHECKING:
    assert ctypes.sizeof(LinkHealth) == 96
    assert LinkHealth.last_message_ns.offset == 0
    assert LinkHealth.last_telemetry_ns.offset == 8
    assert LinkHealth.state_since_ns.offset == 16
    assert LinkHealth.bytes_received.offset == 24
    assert LinkHealth.messages_received.offset == 32
    assert LinkHealth.state.offset == 40
    assert LinkHealth.port_openings.offset == 44
    assert LinkHealth.dsp_boots.offset == 48
    assert LinkHealth.commands_acknowledged.offset == 52
    assert LinkHealth.commands_repeated.offset == 56
    assert LinkHealth.commands_failed.offset == 60
    assert LinkHealth.acks_unmatched.offset == 64
    assert LinkHealth.waypoints_sent.offset == 68
    assert LinkHealth.waypoints_repeated.offset == 72
    assert LinkHealth.delivery_verified.offset == 76
    assert LinkHealth.telemetry_published.offset == 80
    assert LinkHealth.telemetry_incoherent.offset == 84
    assert LinkHealth.dsp_path.offset == 88
    assert LinkHealth.pc_timeout_supported.offset == 92


class RefusedCounters(Struct):
    """Bytes and values that were discarded, by reason."""

    stray: int
    """Runs of bytes without a header."""
    unknown_header: int
    """Unknown headers."""
    truncated: int
    """Messages cut short by the next header."""
    checksum: int
    """Wrong checksums."""
    padding: int
    """Unused bits that were not zero."""
    value: int
    """Impossible field values."""
    implausible_groups: int
    """Groups whose validity was withdrawn because a value was implausible."""
    implausible_mask: int
    """The groups withdrawn so far, as bits of the status mask."""
    requests: int
    """Requests refused."""
    transmit_overflows: int
    """Bytes for the DSP that the line did not take in time."""
    other_profile: int
    """Headers of the other profile: both ends must be configured alike."""
    missed_messages: int
    """Messages of the DSP that were missed, by its sequence numbers; extended profile only."""

    if TYPE_CHECKING:
        def __init__(self, stray: int = ..., unknown_header: int = ..., truncated: int = ..., checksum: int = ..., padding: int = ..., value: int = ..., implausible_groups: int = ..., implausible_mask: int = ..., requests: int = ..., transmit_overflows: int = ..., other_profile: int = ..., missed_messages: int = ...) -> None: ...
    else:
        _fields_ = [
            ("stray", ctypes.c_uint32),
            ("unknown_header", ctypes.c_uint32),
            ("truncated", ctypes.c_uint32),
            ("checksum", ctypes.c_uint32),
            ("padding", ctypes.c_uint32),
            ("value", ctypes.c_uint32),
            ("implausible_groups", ctypes.c_uint32),
            ("implausible_mask", ctypes.c_uint32),
            ("requests", ctypes.c_uint32),
            ("transmit_overflows", ctypes.c_uint32),
            ("other_profile", ctypes.c_uint32),
            ("missed_messages", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.RefusedCounters.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(RefusedCounters) == 48
    assert RefusedCounters.stray.offset == 0
    assert RefusedCounters.unknown_header.offset == 4
    assert RefusedCounters.truncated.offset == 8
    assert RefusedCounters.checksum.offset == 12
    assert RefusedCounters.padding.offset == 16
    assert RefusedCounters.value.offset == 20
    assert RefusedCounters.implausible_groups.offset == 24
    assert RefusedCounters.implausible_mask.offset == 28
    assert RefusedCounters.requests.offset == 32
    assert RefusedCounters.transmit_overflows.offset == 36
    assert RefusedCounters.other_profile.offset == 40
    assert RefusedCounters.missed_messages.offset == 44


class DspErrorCounters(Struct):
    """DSP errors received since the bridge began."""

    total: int
    """All errors."""
    unknown: int
    """Errors with a code that the documentation does not have."""
    last_code: int
    """Code of the last error as the DSP sent it, 0 … 65535; means something when `total` is not 0."""
    escalated: int
    """Errors that ended the functionality."""
    known: Array[int]
    """By documented code, ascending: 1 … 15, 18, 20, 21, 22, 30, 40, 45, 46, 100, 102, 300."""

    if TYPE_CHECKING:
        def __init__(self, total: int = ..., unknown: int = ..., last_code: int = ..., escalated: int = ..., known: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("total", ctypes.c_uint32),
            ("unknown", ctypes.c_uint32),
            ("last_code", ctypes.c_uint32),
            ("escalated", ctypes.c_uint32),
            ("known", ctypes.c_uint32 * 26),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspErrorCounters.v2"


if not TYPE_CHECKING:
    assert ctypes.sizeof(DspErrorCounters) == 120
    assert DspErrorCounters.total.offset == 0
    assert DspErrorCounters.unknown.offset == 4
    assert DspErrorCounters.last_code.offset == 8
    assert DspErrorCounters.escalated.offset == 12
    assert DspErrorCounters.known.offset == 16


class SafetyState(Struct):
    """The safety rules of the bridge as they stand now."""

    amount: float
    """By how much the limit of `rule` is exceeded, in the unit of the rule
    (SafetyRule); means something when `rule` is not 0."""
    rule: int
    """The most severe rule that is violated now, a SafetyRule; 0 when none is."""
    action: int
    """What the bridge does about it, a SafetyAction; 0 when no rule is violated."""
    pilot_switch: int
    """The pilot's switch, a PilotSwitch."""
    fence_areas: int
    """Areas of the geofence in force."""
    interventions: int
    """Movements refused or ended by a safety rule since `epoch_ns`."""
    reserved: int
    """1 when all that is published of this robot is a recorded flight that `ril replay` plays; zero from a bridge. It was
    spare before, so its name and the layout stay."""

    if TYPE_CHECKING:
        def __init__(self, amount: float = ..., rule: int = ..., action: int = ..., pilot_switch: int = ..., fence_areas: int = ..., interventions: int = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("amount", ctypes.c_double),
            ("rule", ctypes.c_uint32),
            ("action", ctypes.c_uint32),
            ("pilot_switch", ctypes.c_uint32),
            ("fence_areas", ctypes.c_uint32),
            ("interventions", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.SafetyState.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(SafetyState) == 32
    assert SafetyState.amount.offset == 0
    assert SafetyState.rule.offset == 8
    assert SafetyState.action.offset == 12
    assert SafetyState.pilot_switch.offset == 16
    assert SafetyState.fence_areas.offset == 20
    assert SafetyState.interventions.offset == 24
    assert SafetyState.reserved.offset == 28


class ControlSender(Struct):
    """A sender of requests: a station, or a session of processes on the robot's machine."""

    origin: int
    """The station's number, as in `RelayStation`; 0 on the robot's machine."""
    session: int
    """Number of the session, that of its first process; 0 when it is not known."""
    process: int
    """The process that sent last; 0 when it is not known."""

    if TYPE_CHECKING:
        def __init__(self, origin: int = ..., session: int = ..., process: int = ...) -> None: ...
    else:
        _fields_ = [
            ("origin", ctypes.c_uint32),
            ("session", ctypes.c_uint32),
            ("process", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.ControlSender.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(ControlSender) == 12
    assert ControlSender.origin.offset == 0
    assert ControlSender.session.offset == 4
    assert ControlSender.process.offset == 8


class ControlState(Struct):
    """Who commands the bridge (`docs/safety.md`, *Control*)."""

    since_ns: int
    """Since when the holder has control; means something when `held` is 1. [ns]"""
    last_order_ns: int
    """When the holder's last movement was taken, 0 when none was. [ns]"""
    holder: ControlSender
    """Who has control; means something when `held` is 1."""
    asker: ControlSender
    """Who asks the holder for it; means something when `asked` is 1."""
    held: int
    """1 when a sender has control."""
    asked: int
    """1 when another sender asks for it."""
    exclusive: int
    """1 when movements and writes of other senders are refused (`[control] exclusive` of bridge.toml)."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""

    if TYPE_CHECKING:
        def __init__(self, since_ns: int = ..., last_order_ns: int = ..., holder: ControlSender = ..., asker: ControlSender = ..., held: int = ..., asked: int = ..., exclusive: int = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("since_ns", ctypes.c_uint64),
            ("last_order_ns", ctypes.c_uint64),
            ("holder", ControlSender),
            ("asker", ControlSender),
            ("held", ctypes.c_uint32),
            ("asked", ctypes.c_uint32),
            ("exclusive", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.ControlState.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(ControlState) == 56
    assert ControlState.since_ns.offset == 0
    assert ControlState.last_order_ns.offset == 8
    assert ControlState.holder.offset == 16
    assert ControlState.asker.offset == 28
    assert ControlState.held.offset == 40
    assert ControlState.asked.offset == 44
    assert ControlState.exclusive.offset == 48
    assert ControlState.reserved.offset == 52


class LastMinute(Struct):
    """Figures of the line to the DSP over the last 60 to 70 seconds, or since the bridge began."""

    duration_s: int
    """Seconds that these figures are of. [s]"""
    messages: int
    """Valid messages received."""
    rejected: int
    """Pieces and messages rejected or missed, without the two that each opening of the port and each boot of the DSP may cut."""
    commands_repeated: int
    """Commands sent again after a timeout."""
    commands_failed: int
    """Commands given up after the last attempt."""

    if TYPE_CHECKING:
        def __init__(self, duration_s: int = ..., messages: int = ..., rejected: int = ..., commands_repeated: int = ..., commands_failed: int = ...) -> None: ...
    else:
        _fields_ = [
            ("duration_s", ctypes.c_uint32),
            ("messages", ctypes.c_uint32),
            ("rejected", ctypes.c_uint32),
            ("commands_repeated", ctypes.c_uint32),
            ("commands_failed", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.LastMinute.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(LastMinute) == 20
    assert LastMinute.duration_s.offset == 0
    assert LastMinute.messages.offset == 4
    assert LastMinute.rejected.offset == 8
    assert LastMinute.commands_repeated.offset == 12
    assert LastMinute.commands_failed.offset == 16


class ModuleState(Struct):
    """State of a module. Service `module_state`, written by the bridge at every change and at least once a second.
    
    Times are host monotonic nanoseconds; 0 stands for 'never', which the counter beside it says as well."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    module_id: int
    """A ModuleId."""
    status: int
    """A ModuleStatus."""
    imi_error: int
    """IMI error code: general 0–99, UAV 100–200, DSP 201–500."""
    blocked: int
    """1 when no movement is taken until the next start."""
    functionality: int
    """A Functionality."""
    unable_to_abort: int
    """1 when the movement under way cannot be aborted (`unable2abort`)."""
    movement: MovementState
    """The movement under way, or the last one; all zero before the first."""
    last_end: MovementEnd
    """How the movement that ended last did so; all zero before the first end."""
    link: LinkHealth
    """The line to the DSP."""
    refused: RefusedCounters
    """What was discarded and why."""
    dsp_errors: DspErrorCounters
    """DSP errors by code."""
    safety: SafetyState
    """The rules of flight safety that the bridge enforces."""
    home_latitude_deg: float
    """Home: where the helicopter stands, and in the air where it took off. Latitude, degrees; meaningful when `ground_valid` is 1. [deg]"""
    home_longitude_deg: float
    """Longitude of home, degrees; meaningful when `ground_valid` is 1. [deg]"""
    ground_altitude_m: float
    """Telemetry altitude of home, m: of the ground on which the helicopter stood last. Meaningful when `ground_valid` is 1. [m]"""
    outline: int
    """Number of the outline that holds: `number` of the pieces of the topic `bridge/outline`. To be compared for equality only."""
    control: ControlState
    """Who commands."""
    ground_valid: int
    """1 when the bridge has seen the helicopter on the ground."""
    last_minute: LastMinute
    """How the line was of late."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., module_id: int = ..., status: int = ..., imi_error: int = ..., blocked: int = ..., functionality: int = ..., unable_to_abort: int = ..., movement: MovementState = ..., last_end: MovementEnd = ..., link: LinkHealth = ..., refused: RefusedCounters = ..., dsp_errors: DspErrorCounters = ..., safety: SafetyState = ..., home_latitude_deg: float = ..., home_longitude_deg: float = ..., ground_altitude_m: float = ..., outline: int = ..., control: ControlState = ..., ground_valid: int = ..., last_minute: LastMinute = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("module_id", ctypes.c_uint32),
            ("status", ctypes.c_uint32),
            ("imi_error", ctypes.c_uint32),
            ("blocked", ctypes.c_uint32),
            ("functionality", ctypes.c_uint32),
            ("unable_to_abort", ctypes.c_uint32),
            ("movement", MovementState),
            ("last_end", MovementEnd),
            ("link", LinkHealth),
            ("refused", RefusedCounters),
            ("dsp_errors", DspErrorCounters),
            ("safety", SafetyState),
            ("home_latitude_deg", ctypes.c_double),
            ("home_longitude_deg", ctypes.c_double),
            ("ground_altitude_m", ctypes.c_double),
            ("outline", ctypes.c_uint64),
            ("control", ControlState),
            ("ground_valid", ctypes.c_uint32),
            ("last_minute", LastMinute),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.ModuleState.v7"


if not TYPE_CHECKING:
    assert ctypes.sizeof(ModuleState) == 528
    assert ModuleState.sequence.offset == 0
    assert ModuleState.epoch_ns.offset == 8
    assert ModuleState.published_ns.offset == 16
    assert ModuleState.module_id.offset == 24
    assert ModuleState.status.offset == 28
    assert ModuleState.imi_error.offset == 32
    assert ModuleState.blocked.offset == 36
    assert ModuleState.functionality.offset == 40
    assert ModuleState.unable_to_abort.offset == 44
    assert ModuleState.movement.offset == 48
    assert ModuleState.last_end.offset == 88
    assert ModuleState.link.offset == 120
    assert ModuleState.refused.offset == 216
    assert ModuleState.dsp_errors.offset == 264
    assert ModuleState.safety.offset == 384
    assert ModuleState.home_latitude_deg.offset == 416
    assert ModuleState.home_longitude_deg.offset == 424
    assert ModuleState.ground_altitude_m.offset == 432
    assert ModuleState.outline.offset == 440
    assert ModuleState.control.offset == 448
    assert ModuleState.ground_valid.offset == 504
    assert ModuleState.last_minute.offset == 508


class ModuleControl(Struct):
    """Start or stop the module (`ModuleControl`). Service `module_control`."""

    request_id: int
    """Chosen by the sender, not 0, never used before by any sender; every report repeats it."""
    issued_ns: int
    """When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
    the moment of sending. [ns]"""
    begin_by_ns: int
    """Until when it may begin, same clock; 0 takes the bridge's default. [ns]"""
    after: int
    """The request that was the step before of the same command: this one is taken only if nothing came between the two. 0 if it
    follows no other."""
    command: int
    """A ControlCommand."""
    issued_within_ns: int
    """By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same. [ns]"""
    origin: int
    """By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""

    if TYPE_CHECKING:
        def __init__(self, request_id: int = ..., issued_ns: int = ..., begin_by_ns: int = ..., after: int = ..., command: int = ..., issued_within_ns: int = ..., origin: int = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("request_id", ctypes.c_uint64),
            ("issued_ns", ctypes.c_uint64),
            ("begin_by_ns", ctypes.c_uint64),
            ("after", ctypes.c_uint64),
            ("command", ctypes.c_uint32),
            ("issued_within_ns", ctypes.c_uint32),
            ("origin", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.ModuleControl.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(ModuleControl) == 48
    assert ModuleControl.request_id.offset == 0
    assert ModuleControl.issued_ns.offset == 8
    assert ModuleControl.begin_by_ns.offset == 16
    assert ModuleControl.after.offset == 24
    assert ModuleControl.command.offset == 32
    assert ModuleControl.issued_within_ns.offset == 36
    assert ModuleControl.origin.offset == 40
    assert ModuleControl.reserved.offset == 44


class MovementData(Struct):
    """A movement (`MovementData`). Service `movement`.
    
    A path is framed by the pair (`first`, `last`): (1,1) is a single waypoint, (1,0) opens a path, (0,0) continues
    it, (0,1) closes it. Nothing of a path goes to the DSP until it is closed."""

    request_id: int
    """Chosen by the sender, not 0, never used before by any sender; every report repeats it."""
    path_id: int
    """Chosen by the sender, the same in all waypoints of one path and in every report about it; 0 for take-off
    and landing."""
    issued_ns: int
    """When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
    the moment of sending. All waypoints of a path carry the moment of the path. [ns]"""
    begin_by_ns: int
    """Until when it may begin, same clock; 0 takes the bridge's default. [ns]"""
    after: int
    """The request that was the step before of the same command: this one is taken only if nothing came between the two. 0 if it
    follows no other."""
    latitude_deg: float
    """Latitude of the waypoint, degrees, north positive. Go-to only. [deg]"""
    longitude_deg: float
    """Longitude of the waypoint, degrees, east positive. Go-to only. [deg]"""
    altitude_m: float
    """Go-to: altitude of the waypoint, m, same zero as telemetry. Take-off: height over the point of take-off, m. [m]"""
    kind: int
    """A MovementKind (`type_of_request`)."""
    first: int
    """1 when this waypoint opens a path (`first_waypoint_data`). Go-to only."""
    last: int
    """1 when this waypoint closes the path (`last_waypoint_data`). Go-to only."""
    issued_within_ns: int
    """By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same. [ns]"""
    origin: int
    """By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own."""
    repeat: int
    """1 when this is sent again because the outcome is unknown: it is then never executed twice, not even by
    another bridge than the one that was asked first."""
    preempt: int
    """1 when this may replace a path that is under way, which then ends as `replaced`; 0 refuses it as `busy`.
    In a path each waypoint needs it."""
    lease_ms: int
    """The sender renews the order at least this often, ms; not renewed in time, the bridge holds. 0 if it is not renewed. [ms]"""
    sender_lost: int
    """What the bridge does when the process that ordered ends, a SenderLost; 0 takes the bridge's
    default."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""

    if TYPE_CHECKING:
        def __init__(self, request_id: int = ..., path_id: int = ..., issued_ns: int = ..., begin_by_ns: int = ..., after: int = ..., latitude_deg: float = ..., longitude_deg: float = ..., altitude_m: float = ..., kind: int = ..., first: int = ..., last: int = ..., issued_within_ns: int = ..., origin: int = ..., repeat: int = ..., preempt: int = ..., lease_ms: int = ..., sender_lost: int = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("request_id", ctypes.c_uint64),
            ("path_id", ctypes.c_uint64),
            ("issued_ns", ctypes.c_uint64),
            ("begin_by_ns", ctypes.c_uint64),
            ("after", ctypes.c_uint64),
            ("latitude_deg", ctypes.c_double),
            ("longitude_deg", ctypes.c_double),
            ("altitude_m", ctypes.c_double),
            ("kind", ctypes.c_uint32),
            ("first", ctypes.c_uint16),
            ("last", ctypes.c_uint16),
            ("issued_within_ns", ctypes.c_uint32),
            ("origin", ctypes.c_uint32),
            ("repeat", ctypes.c_uint16),
            ("preempt", ctypes.c_uint16),
            ("lease_ms", ctypes.c_uint32),
            ("sender_lost", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.MovementData.v4"


if not TYPE_CHECKING:
    assert ctypes.sizeof(MovementData) == 96
    assert MovementData.request_id.offset == 0
    assert MovementData.path_id.offset == 8
    assert MovementData.issued_ns.offset == 16
    assert MovementData.begin_by_ns.offset == 24
    assert MovementData.after.offset == 32
    assert MovementData.latitude_deg.offset == 40
    assert MovementData.longitude_deg.offset == 48
    assert MovementData.altitude_m.offset == 56
    assert MovementData.kind.offset == 64
    assert MovementData.first.offset == 68
    assert MovementData.last.offset == 70
    assert MovementData.issued_within_ns.offset == 72
    assert MovementData.origin.offset == 76
    assert MovementData.repeat.offset == 80
    assert MovementData.preempt.offset == 82
    assert MovementData.lease_ms.offset == 84
    assert MovementData.sender_lost.offset == 88
    assert MovementData.reserved.offset == 92


class ParameterRequest(Struct):
    """Reads, writes or lists the DSP's virtual ports (`docs/protocol.md` section 6). Service `parameters`."""

    request_id: int
    """Chosen by the sender, not 0, never used before by any sender; every report repeats it."""
    issued_ns: int
    """When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
    the moment of sending. [ns]"""
    begin_by_ns: int
    """Until when it may begin, same clock; 0 takes the bridge's default. [ns]"""
    after: int
    """The request that was the step before of the same command: this one is taken only if nothing came between the two. 0 if it
    follows no other."""
    value: float
    """Write: the value. A 16-bit port takes whole numbers only."""
    port: int
    """Read, write: number of the port. List: which port of the list, counted from 0."""
    operation: int
    """A ParameterOperation."""
    issued_within_ns: int
    """By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same. [ns]"""
    origin: int
    """By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own."""

    if TYPE_CHECKING:
        def __init__(self, request_id: int = ..., issued_ns: int = ..., begin_by_ns: int = ..., after: int = ..., value: float = ..., port: int = ..., operation: int = ..., issued_within_ns: int = ..., origin: int = ...) -> None: ...
    else:
        _fields_ = [
            ("request_id", ctypes.c_uint64),
            ("issued_ns", ctypes.c_uint64),
            ("begin_by_ns", ctypes.c_uint64),
            ("after", ctypes.c_uint64),
            ("value", ctypes.c_double),
            ("port", ctypes.c_uint32),
            ("operation", ctypes.c_uint32),
            ("issued_within_ns", ctypes.c_uint32),
            ("origin", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.ParameterRequest.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(ParameterRequest) == 56
    assert ParameterRequest.request_id.offset == 0
    assert ParameterRequest.issued_ns.offset == 8
    assert ParameterRequest.begin_by_ns.offset == 16
    assert ParameterRequest.after.offset == 24
    assert ParameterRequest.value.offset == 32
    assert ParameterRequest.port.offset == 40
    assert ParameterRequest.operation.offset == 44
    assert ParameterRequest.issued_within_ns.offset == 48
    assert ParameterRequest.origin.offset == 52


class PortInfo(Struct):
    """A virtual port of the DSP."""

    min: float
    """Least value that may be written."""
    max: float
    """Greatest value that may be written."""
    number: int
    """Number of the port."""
    kind: int
    """A PortKind."""
    access: int
    """Bit 0: may be written by request; bit 1: also while the helicopter flies."""
    count: int
    """Ports of the list."""
    name: Array[int]
    """Name in ASCII with its unit, filled up with zeros."""

    if TYPE_CHECKING:
        def __init__(self, min: float = ..., max: float = ..., number: int = ..., kind: int = ..., access: int = ..., count: int = ..., name: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("min", ctypes.c_double),
            ("max", ctypes.c_double),
            ("number", ctypes.c_uint32),
            ("kind", ctypes.c_uint32),
            ("access", ctypes.c_uint32),
            ("count", ctypes.c_uint32),
            ("name", ctypes.c_uint8 * 32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.PortInfo.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(PortInfo) == 64
    assert PortInfo.min.offset == 0
    assert PortInfo.max.offset == 8
    assert PortInfo.number.offset == 16
    assert PortInfo.kind.offset == 20
    assert PortInfo.access.offset == 24
    assert PortInfo.count.offset == 28
    assert PortInfo.name.offset == 32


class RequestReport(Struct):
    """One answer in the response stream of a request."""

    request_id: int
    """The request's id."""
    path_id: int
    """The request's path, 0 when it has none."""
    reported_ns: int
    """When this was said, host monotonic ns. [ns]"""
    stage: int
    """A Stage."""
    reason: int
    """A Reason."""
    imi_error: int
    """IMI error code, 0 when there is none."""
    waypoints_total: int
    """Waypoints of the path so far."""
    waypoints_sent: int
    """Waypoints sent to the DSP."""
    waypoints_reached: int
    """Waypoints that the helicopter was seen to reach, in order."""
    rule: int
    """The safety rule that was broken, a SafetyRule; 0 when none was."""
    waypoint: int
    """The waypoint, or the leg that leads to it, that the reason is about, counted from 1; 0 when there is none."""
    dsp_error_code: int
    """The DSP error that the reason is about, as the DSP sent it; means something when `dsp_error_valid` is 1."""
    dsp_error_valid: int
    """1 when `dsp_error_code` is given."""
    value_valid: int
    """1 when `value` is given."""
    value: float
    """Rule broken: by how much, in the rule's unit. Take-off done: the height that was reached over the point of
    take-off, m. Parameter read or written: the value that the port has."""
    port: PortInfo
    """The port that a parameter request is about. When an area of the geofence was broken: its name, and nothing else. All zero in
    other reports."""
    between_request_id: int
    """Superseded: the id of the request that came between; 0 when no request did."""
    between_sender: ControlSender
    """Superseded: who sent the request that came between; all zero when no request did."""
    between: int
    """Superseded: what came between, a CameBetween; 0 in other reports. When it is a safety rule,
    `rule` says which."""

    if TYPE_CHECKING:
        def __init__(self, request_id: int = ..., path_id: int = ..., reported_ns: int = ..., stage: int = ..., reason: int = ..., imi_error: int = ..., waypoints_total: int = ..., waypoints_sent: int = ..., waypoints_reached: int = ..., rule: int = ..., waypoint: int = ..., dsp_error_code: int = ..., dsp_error_valid: int = ..., value_valid: int = ..., value: float = ..., port: PortInfo = ..., between_request_id: int = ..., between_sender: ControlSender = ..., between: int = ...) -> None: ...
    else:
        _fields_ = [
            ("request_id", ctypes.c_uint64),
            ("path_id", ctypes.c_uint64),
            ("reported_ns", ctypes.c_uint64),
            ("stage", ctypes.c_uint32),
            ("reason", ctypes.c_uint32),
            ("imi_error", ctypes.c_uint32),
            ("waypoints_total", ctypes.c_uint32),
            ("waypoints_sent", ctypes.c_uint32),
            ("waypoints_reached", ctypes.c_uint32),
            ("rule", ctypes.c_uint32),
            ("waypoint", ctypes.c_uint32),
            ("dsp_error_code", ctypes.c_uint32),
            ("dsp_error_valid", ctypes.c_uint16),
            ("value_valid", ctypes.c_uint16),
            ("value", ctypes.c_double),
            ("port", PortInfo),
            ("between_request_id", ctypes.c_uint64),
            ("between_sender", ControlSender),
            ("between", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.RequestReport.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(RequestReport) == 160
    assert RequestReport.request_id.offset == 0
    assert RequestReport.path_id.offset == 8
    assert RequestReport.reported_ns.offset == 16
    assert RequestReport.stage.offset == 24
    assert RequestReport.reason.offset == 28
    assert RequestReport.imi_error.offset == 32
    assert RequestReport.waypoints_total.offset == 36
    assert RequestReport.waypoints_sent.offset == 40
    assert RequestReport.waypoints_reached.offset == 44
    assert RequestReport.rule.offset == 48
    assert RequestReport.waypoint.offset == 52
    assert RequestReport.dsp_error_code.offset == 56
    assert RequestReport.dsp_error_valid.offset == 60
    assert RequestReport.value_valid.offset == 62
    assert RequestReport.value.offset == 64
    assert RequestReport.port.offset == 72
    assert RequestReport.between_request_id.offset == 136
    assert RequestReport.between_sender.offset == 144
    assert RequestReport.between.offset == 156


class RelayLink(Struct):
    """The link between this machine and a robot on another machine. Topic `relay/link`, published on the station's machine by
    the relay that provides the robot's services there; at every change and at least once a second.
    
    Times are host monotonic nanoseconds of this machine; 0 stands for 'never'. Counts begin with the relay's process."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    since_ns: int
    """Since when `state` holds. [ns]"""
    last_heard_ns: int
    """When the last message of the robot came, 0 before the first. [ns]"""
    clock_offset_ns: int
    """The robot's monotonic clock minus this machine's; means something when `clock_valid` is 1. [ns]"""
    clock_uncertainty_s: float
    """How far `clock_offset_ns` may be from the truth, to either side, s; means something when `clock_valid` is 1. [s]"""
    round_trip_s: float
    """Of the quickest exchange among the recent ones, from this machine to the robot and back, s; means something when
    `clock_valid` is 1. [s]"""
    open_timeout_s: float
    """How long the relay's attempt to connect may take, s: at least ten round trips of the link. [s]"""
    samples_received: int
    """Samples that came from the robot."""
    samples_lost_on_air: int
    """Samples that the robot's relay sent and that did not come."""
    samples_lost_in_relay: int
    """Samples that the robot's processes published and that the robot's relay did not read in time."""
    samples_left_out: int
    """Samples that were left out on purpose: by the rate of their topic, or because a newer one was there."""
    bytes_received: int
    """Bytes received from the robot, without those of the network's own headers."""
    bytes_sent: int
    """Bytes sent to the robot, without those of the network's own headers."""
    orders_sent: int
    """Requests sent to the robot."""
    orders_repeated: int
    """Messages about requests that were sent again because no answer came in time."""
    orders_unknown: int
    """Requests whose outcome the relay had to report as unknown."""
    state: int
    """A RelayLinkState."""
    robot: int
    """The robot's number on its own machine."""
    clock_drift_ppb: int
    """By how much the robot's clock is faster than this machine's, parts per billion; means something when `clock_valid`
    is 1. [ppb]"""
    clock_valid: int
    """1 when offset, uncertainty, round trip and drift of the clock are known; they are not before the first exchange."""
    clock_resets: int
    """How often the robot's clock was seen to jump: a reboot, a suspend, a step. The offset was then measured anew."""
    outages: int
    """How often the link went from up to down."""
    orders_open: int
    """Requests that were sent and have no final report yet."""
    refusal: int
    """Why the robot takes no requests from this station: a Reason, relay-not-permitted, relay-too-many-stations or
    relay-two-robots; 0 when it takes them, when this station is configured to send none, and before the first answer."""
    link: Array[int]
    """The endpoint of the link such as `tcp/10.0.0.2:7447`, several divided by spaces; ASCII, filled up with zeros."""
    station: Array[int]
    """The name of this station, ASCII, filled up with zeros."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., since_ns: int = ..., last_heard_ns: int = ..., clock_offset_ns: int = ..., clock_uncertainty_s: float = ..., round_trip_s: float = ..., open_timeout_s: float = ..., samples_received: int = ..., samples_lost_on_air: int = ..., samples_lost_in_relay: int = ..., samples_left_out: int = ..., bytes_received: int = ..., bytes_sent: int = ..., orders_sent: int = ..., orders_repeated: int = ..., orders_unknown: int = ..., state: int = ..., robot: int = ..., clock_drift_ppb: int = ..., clock_valid: int = ..., clock_resets: int = ..., outages: int = ..., orders_open: int = ..., refusal: int = ..., link: Any = ..., station: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("since_ns", ctypes.c_uint64),
            ("last_heard_ns", ctypes.c_uint64),
            ("clock_offset_ns", ctypes.c_int64),
            ("clock_uncertainty_s", ctypes.c_double),
            ("round_trip_s", ctypes.c_double),
            ("open_timeout_s", ctypes.c_double),
            ("samples_received", ctypes.c_uint64),
            ("samples_lost_on_air", ctypes.c_uint64),
            ("samples_lost_in_relay", ctypes.c_uint64),
            ("samples_left_out", ctypes.c_uint64),
            ("bytes_received", ctypes.c_uint64),
            ("bytes_sent", ctypes.c_uint64),
            ("orders_sent", ctypes.c_uint64),
            ("orders_repeated", ctypes.c_uint64),
            ("orders_unknown", ctypes.c_uint64),
            ("state", ctypes.c_uint32),
            ("robot", ctypes.c_uint32),
            ("clock_drift_ppb", ctypes.c_int32),
            ("clock_valid", ctypes.c_uint32),
            ("clock_resets", ctypes.c_uint32),
            ("outages", ctypes.c_uint32),
            ("orders_open", ctypes.c_uint32),
            ("refusal", ctypes.c_uint32),
            ("link", ctypes.c_uint8 * 64),
            ("station", ctypes.c_uint8 * 32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.RelayLink.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(RelayLink) == 272
    assert RelayLink.sequence.offset == 0
    assert RelayLink.epoch_ns.offset == 8
    assert RelayLink.published_ns.offset == 16
    assert RelayLink.since_ns.offset == 24
    assert RelayLink.last_heard_ns.offset == 32
    assert RelayLink.clock_offset_ns.offset == 40
    assert RelayLink.clock_uncertainty_s.offset == 48
    assert RelayLink.round_trip_s.offset == 56
    assert RelayLink.open_timeout_s.offset == 64
    assert RelayLink.samples_received.offset == 72
    assert RelayLink.samples_lost_on_air.offset == 80
    assert RelayLink.samples_lost_in_relay.offset == 88
    assert RelayLink.samples_left_out.offset == 96
    assert RelayLink.bytes_received.offset == 104
    assert RelayLink.bytes_sent.offset == 112
    assert RelayLink.orders_sent.offset == 120
    assert RelayLink.orders_repeated.offset == 128
    assert RelayLink.orders_unknown.offset == 136
    assert RelayLink.state.offset == 144
    assert RelayLink.robot.offset == 148
    assert RelayLink.clock_drift_ppb.offset == 152
    assert RelayLink.clock_valid.offset == 156
    assert RelayLink.clock_resets.offset == 160
    assert RelayLink.outages.offset == 164
    assert RelayLink.orders_open.offset == 168
    assert RelayLink.refusal.offset == 172
    assert RelayLink.link.offset == 176
    assert RelayLink.station.offset == 240


class RelayStation(Struct):
    """A station as the robot's relay knows it. Counts are of this life of the station."""

    name: Array[int]
    """The station's name, ASCII, filled up with zeros."""
    last_heard_ns: int
    """When the last message of the station came. [ns]"""
    since_ns: int
    """Since when `is_up` holds. [ns]"""
    last_order_ns: int
    """When the last request of the station was taken: the station with the latest one commands now. [ns]"""
    orders_executed: int
    """Requests of the station that were handed to the robot's processes."""
    orders_refused: int
    """Requests of the station that the relay refused."""
    samples_sent: int
    """Samples sent to the station."""
    may_command: int
    """1 when the robot's configuration lets the station send requests."""
    is_up: int
    """1 when messages of the station come, 0 when none has come for the configured time."""
    orders_open: int
    """Requests of the station that have no final report yet."""
    refusal: int
    """Why the relay takes no requests from the station: a Reason, relay-not-permitted or relay-too-many-stations;
    0 when it takes them."""
    origin: int
    """The `origin` that the relay writes into the requests of this life of the station."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""

    if TYPE_CHECKING:
        def __init__(self, name: Any = ..., last_heard_ns: int = ..., since_ns: int = ..., last_order_ns: int = ..., orders_executed: int = ..., orders_refused: int = ..., samples_sent: int = ..., may_command: int = ..., is_up: int = ..., orders_open: int = ..., refusal: int = ..., origin: int = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("name", ctypes.c_uint8 * 32),
            ("last_heard_ns", ctypes.c_uint64),
            ("since_ns", ctypes.c_uint64),
            ("last_order_ns", ctypes.c_uint64),
            ("orders_executed", ctypes.c_uint64),
            ("orders_refused", ctypes.c_uint64),
            ("samples_sent", ctypes.c_uint64),
            ("may_command", ctypes.c_uint32),
            ("is_up", ctypes.c_uint32),
            ("orders_open", ctypes.c_uint32),
            ("refusal", ctypes.c_uint32),
            ("origin", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.RelayStation.v3"


if not TYPE_CHECKING:
    assert ctypes.sizeof(RelayStation) == 104
    assert RelayStation.name.offset == 0
    assert RelayStation.last_heard_ns.offset == 32
    assert RelayStation.since_ns.offset == 40
    assert RelayStation.last_order_ns.offset == 48
    assert RelayStation.orders_executed.offset == 56
    assert RelayStation.orders_refused.offset == 64
    assert RelayStation.samples_sent.offset == 72
    assert RelayStation.may_command.offset == 80
    assert RelayStation.is_up.offset == 84
    assert RelayStation.orders_open.offset == 88
    assert RelayStation.refusal.offset == 92
    assert RelayStation.origin.offset == 96
    assert RelayStation.reserved.offset == 100


class RelayStations(Struct):
    """The stations that a robot is relayed to. Topic `relay/stations`, published on the robot's machine by its relay; at every
    change and at least once a second. It is relayed: every station shows who commands.
    
    Times are host monotonic nanoseconds; 0 stands for 'never'."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    stations: Array[RelayStation]
    """The stations, the first `count` of which mean something; the others are all zero."""
    count: int
    """How many stations there are, 0 … 16."""
    samples_bytes_per_s: int
    """Bytes of samples a second that go out at most, because the links to the stations carry no more or it is not known yet what
    they carry; 0 when all go out. [s]"""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., stations: Any = ..., count: int = ..., samples_bytes_per_s: int = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("stations", RelayStation * 16),
            ("count", ctypes.c_uint32),
            ("samples_bytes_per_s", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.RelayStations.v4"


if not TYPE_CHECKING:
    assert ctypes.sizeof(RelayStations) == 1696
    assert RelayStations.sequence.offset == 0
    assert RelayStations.epoch_ns.offset == 8
    assert RelayStations.published_ns.offset == 16
    assert RelayStations.stations.offset == 24
    assert RelayStations.count.offset == 1688
    assert RelayStations.samples_bytes_per_s.offset == 1692


class MavlinkStation(Struct):
    """A ground station or script as the gateway knows it."""

    address: Array[int]
    """Its address, such as `127.0.0.1:14550`, ASCII, filled up with zeros."""
    last_heard_ns: int
    """When its last frame came. [ns]"""
    since_ns: int
    """Since when it is there. [ns]"""
    last_command_ns: int
    """When its last command was taken. [ns]"""
    commands: int
    """Its commands that became orders."""
    refused: int
    """Its commands that were answered with a refusal."""
    system: int
    """Its number, 1 … 255: a claim."""
    component: int
    """The number of its program."""
    may_command: int
    """1 when its commands are taken."""
    is_lost: int
    """1 when nothing came of it for the configured time."""
    has_movement: int
    """1 when the movement under way is one that it has ordered."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""

    if TYPE_CHECKING:
        def __init__(self, address: Any = ..., last_heard_ns: int = ..., since_ns: int = ..., last_command_ns: int = ..., commands: int = ..., refused: int = ..., system: int = ..., component: int = ..., may_command: int = ..., is_lost: int = ..., has_movement: int = ..., reserved: int = ...) -> None: ...
    else:
        _fields_ = [
            ("address", ctypes.c_uint8 * 48),
            ("last_heard_ns", ctypes.c_uint64),
            ("since_ns", ctypes.c_uint64),
            ("last_command_ns", ctypes.c_uint64),
            ("commands", ctypes.c_uint64),
            ("refused", ctypes.c_uint64),
            ("system", ctypes.c_uint32),
            ("component", ctypes.c_uint32),
            ("may_command", ctypes.c_uint32),
            ("is_lost", ctypes.c_uint32),
            ("has_movement", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.MavlinkStation.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(MavlinkStation) == 112
    assert MavlinkStation.address.offset == 0
    assert MavlinkStation.last_heard_ns.offset == 48
    assert MavlinkStation.since_ns.offset == 56
    assert MavlinkStation.last_command_ns.offset == 64
    assert MavlinkStation.commands.offset == 72
    assert MavlinkStation.refused.offset == 80
    assert MavlinkStation.system.offset == 88
    assert MavlinkStation.component.offset == 92
    assert MavlinkStation.may_command.offset == 96
    assert MavlinkStation.is_lost.offset == 100
    assert MavlinkStation.has_movement.offset == 104
    assert MavlinkStation.reserved.offset == 108


class MavlinkStations(Struct):
    """The ground stations and scripts that are connected over MAVLink, and what was not taken of them. Topic `mavlink/stations`,
    published by the gateway on its machine; at every change and at least once a second. It is not relayed.
    
    Times are host monotonic nanoseconds; 0 stands for 'never'. Counts begin with the gateway's process."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    since_ns: int
    """Since when `vehicle` holds. [ns]"""
    frames_read: int
    """Frames that were read."""
    datagrams_sent: int
    """Datagrams sent to stations."""
    refused_unreadable: int
    """Datagrams whose rest was dropped because it is no frame."""
    refused_unknown: int
    """Frames of messages that are not read here."""
    refused_checksum: int
    """Frames with a wrong checksum."""
    refused_unsigned: int
    """Frames without a signature, where one is asked for."""
    refused_signature: int
    """Frames with a signature of another key."""
    refused_replayed: int
    """Signed frames that are not newer than one that came before."""
    refused_full: int
    """Heartbeats of stations for which there is no room."""
    stations: Array[MavlinkStation]
    """The stations, the first `count` of which mean something; the others are all zero."""
    count: int
    """How many stations there are, 0 … 8."""
    vehicle: int
    """A MavlinkVehicle: whether telemetry is sent, and why not."""
    system: int
    """The vehicle's number, 1 … 250."""
    is_signed: int
    """1 when frames without a signature are not taken."""
    datagrams_dropped: int
    """Datagrams that were not sent because the socket was full."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., since_ns: int = ..., frames_read: int = ..., datagrams_sent: int = ..., refused_unreadable: int = ..., refused_unknown: int = ..., refused_checksum: int = ..., refused_unsigned: int = ..., refused_signature: int = ..., refused_replayed: int = ..., refused_full: int = ..., stations: Any = ..., count: int = ..., vehicle: int = ..., system: int = ..., is_signed: int = ..., datagrams_dropped: int = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("since_ns", ctypes.c_uint64),
            ("frames_read", ctypes.c_uint64),
            ("datagrams_sent", ctypes.c_uint64),
            ("refused_unreadable", ctypes.c_uint64),
            ("refused_unknown", ctypes.c_uint64),
            ("refused_checksum", ctypes.c_uint64),
            ("refused_unsigned", ctypes.c_uint64),
            ("refused_signature", ctypes.c_uint64),
            ("refused_replayed", ctypes.c_uint64),
            ("refused_full", ctypes.c_uint64),
            ("stations", MavlinkStation * 8),
            ("count", ctypes.c_uint32),
            ("vehicle", ctypes.c_uint32),
            ("system", ctypes.c_uint32),
            ("is_signed", ctypes.c_uint32),
            ("datagrams_dropped", ctypes.c_uint64),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.MavlinkStations.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(MavlinkStations) == 1024
    assert MavlinkStations.sequence.offset == 0
    assert MavlinkStations.epoch_ns.offset == 8
    assert MavlinkStations.published_ns.offset == 16
    assert MavlinkStations.since_ns.offset == 24
    assert MavlinkStations.frames_read.offset == 32
    assert MavlinkStations.datagrams_sent.offset == 40
    assert MavlinkStations.refused_unreadable.offset == 48
    assert MavlinkStations.refused_unknown.offset == 56
    assert MavlinkStations.refused_checksum.offset == 64
    assert MavlinkStations.refused_unsigned.offset == 72
    assert MavlinkStations.refused_signature.offset == 80
    assert MavlinkStations.refused_replayed.offset == 88
    assert MavlinkStations.refused_full.offset == 96
    assert MavlinkStations.stations.offset == 104
    assert MavlinkStations.count.offset == 1000
    assert MavlinkStations.vehicle.offset == 1004
    assert MavlinkStations.system.offset == 1008
    assert MavlinkStations.is_signed.offset == 1012
    assert MavlinkStations.datagrams_dropped.offset == 1016


class OutlinePoint(Struct):
    """A place of an outline."""

    latitude_deg: float
    """Latitude, degrees, north positive. [deg]"""
    longitude_deg: float
    """Longitude, degrees, east positive. [deg]"""
    altitude_m: float
    """Telemetry altitude of a waypoint, m; 0 for the points of an area. [m]"""

    if TYPE_CHECKING:
        def __init__(self, latitude_deg: float = ..., longitude_deg: float = ..., altitude_m: float = ...) -> None: ...
    else:
        _fields_ = [
            ("latitude_deg", ctypes.c_double),
            ("longitude_deg", ctypes.c_double),
            ("altitude_m", ctypes.c_double),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.OutlinePoint.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(OutlinePoint) == 24
    assert OutlinePoint.latitude_deg.offset == 0
    assert OutlinePoint.longitude_deg.offset == 8
    assert OutlinePoint.altitude_m.offset == 16


class BridgeOutline(Struct):
    """A piece of the geofence in force and of the path that the bridge holds. Topic `bridge/outline`: all pieces at each change,
    when a subscriber has come, and now and then.
    
    The pieces of one `number` together are the outline. `ModuleState` repeats the number of the one that holds."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    number: int
    """Which outline: another number with every change of fence or path, also after a restart. To be compared for equality only."""
    piece: int
    """Which piece this is, from 0."""
    pieces: int
    """Pieces of this outline."""
    kind: int
    """What it describes, an OutlineKind."""
    area: int
    """Area: which one of the fence, from 0. Fence: how many areas there are."""
    first: int
    """Area and path: the first point of this piece among all of the area or path, from 0."""
    count: int
    """Points in this piece."""
    total: int
    """Points of the whole area or path. Fence: waypoints of the path, 0 when the bridge holds none."""
    inclusion: int
    """Area: 1 when the helicopter must stay inside, 0 when it must stay outside."""
    floor_m: float
    """Fence and area: it begins at this telemetry altitude, m; meaningful when `floor_valid` is 1. [m]"""
    ceiling_m: float
    """Fence and area: it ends at this telemetry altitude, m; meaningful when `ceiling_valid` is 1. [m]"""
    radius_m: float
    """Area: radius of a circle, whose only point is its centre, m; 0 for a polygon. [m]"""
    floor_valid: int
    """1 when there is a floor."""
    ceiling_valid: int
    """1 when there is a ceiling."""
    name: Array[int]
    """Name of the area in ASCII, filled up with zeros; a letter that is not ASCII is `?`."""
    points: Array[OutlinePoint]
    """The points: corners in order, of which the last is joined with the first; the centre of a circle; or waypoints in order."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., number: int = ..., piece: int = ..., pieces: int = ..., kind: int = ..., area: int = ..., first: int = ..., count: int = ..., total: int = ..., inclusion: int = ..., floor_m: float = ..., ceiling_m: float = ..., radius_m: float = ..., floor_valid: int = ..., ceiling_valid: int = ..., name: Any = ..., points: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("number", ctypes.c_uint64),
            ("piece", ctypes.c_uint32),
            ("pieces", ctypes.c_uint32),
            ("kind", ctypes.c_uint32),
            ("area", ctypes.c_uint32),
            ("first", ctypes.c_uint32),
            ("count", ctypes.c_uint32),
            ("total", ctypes.c_uint32),
            ("inclusion", ctypes.c_uint32),
            ("floor_m", ctypes.c_double),
            ("ceiling_m", ctypes.c_double),
            ("radius_m", ctypes.c_double),
            ("floor_valid", ctypes.c_uint32),
            ("ceiling_valid", ctypes.c_uint32),
            ("name", ctypes.c_uint8 * 64),
            ("points", OutlinePoint * 32),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.BridgeOutline.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(BridgeOutline) == 928
    assert BridgeOutline.sequence.offset == 0
    assert BridgeOutline.epoch_ns.offset == 8
    assert BridgeOutline.published_ns.offset == 16
    assert BridgeOutline.number.offset == 24
    assert BridgeOutline.piece.offset == 32
    assert BridgeOutline.pieces.offset == 36
    assert BridgeOutline.kind.offset == 40
    assert BridgeOutline.area.offset == 44
    assert BridgeOutline.first.offset == 48
    assert BridgeOutline.count.offset == 52
    assert BridgeOutline.total.offset == 56
    assert BridgeOutline.inclusion.offset == 60
    assert BridgeOutline.floor_m.offset == 64
    assert BridgeOutline.ceiling_m.offset == 72
    assert BridgeOutline.radius_m.offset == 80
    assert BridgeOutline.floor_valid.offset == 88
    assert BridgeOutline.ceiling_valid.offset == 92
    assert BridgeOutline.name.offset == 96
    assert BridgeOutline.points.offset == 160


class ConfigurationPiece(Struct):
    """A piece of the configuration that a process runs with, as the text of its file. Topics `bridge/configuration` and
    `status/configuration`: all pieces when a subscriber has come, at each change, and now and then.
    
    The bytes of all pieces of one `epoch_ns` and `revision`, one after the other, are the text, TOML in UTF-8. It has every value, be it
    of the file, the command line or built in; a comment behind a value says which."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    hash: int
    """64-bit FNV-1a of all bytes of the text."""
    revision: int
    """Counts the configurations of this process from 1: one more with each change."""
    piece: int
    """Which piece this is, from 0."""
    pieces: int
    """Pieces of the text."""
    total: int
    """Bytes of the whole text."""
    length: int
    """Bytes of `data` that mean something."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""
    data: Array[int]
    """The bytes, filled up with zeros."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., hash: int = ..., revision: int = ..., piece: int = ..., pieces: int = ..., total: int = ..., length: int = ..., reserved: int = ..., data: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("hash", ctypes.c_uint64),
            ("revision", ctypes.c_uint32),
            ("piece", ctypes.c_uint32),
            ("pieces", ctypes.c_uint32),
            ("total", ctypes.c_uint32),
            ("length", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
            ("data", ctypes.c_uint8 * 968),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.ConfigurationPiece.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(ConfigurationPiece) == 1024
    assert ConfigurationPiece.sequence.offset == 0
    assert ConfigurationPiece.epoch_ns.offset == 8
    assert ConfigurationPiece.published_ns.offset == 16
    assert ConfigurationPiece.hash.offset == 24
    assert ConfigurationPiece.revision.offset == 32
    assert ConfigurationPiece.piece.offset == 36
    assert ConfigurationPiece.pieces.offset == 40
    assert ConfigurationPiece.total.offset == 44
    assert ConfigurationPiece.length.offset == 48
    assert ConfigurationPiece.reserved.offset == 52
    assert ConfigurationPiece.data.offset == 56


class BridgeJournal(Struct):
    """A piece of the bridge's input journal. Topic `bridge/journal`, published while there is a subscriber: when the piece is
    full, and at most a quarter of a second after its first byte.
    
    The bytes of all pieces one after the other are the journal. A piece that is missing shows in `sequence`; the journal can
    be read again from the next piece with `begins`."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published; in the file `tail` when its last byte was written. [ns]"""
    begins: int
    """1 when the first byte of `data` begins a record that is a snapshot: reading can begin here."""
    length: int
    """Bytes of `data` that mean something, 0 ... 4056."""
    beginnings: int
    """How often the journal was begun by this publisher: for the first subscriber, and after each loss."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""
    data: Array[int]
    """The bytes, filled up with zeros."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., begins: int = ..., length: int = ..., beginnings: int = ..., reserved: int = ..., data: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("begins", ctypes.c_uint32),
            ("length", ctypes.c_uint32),
            ("beginnings", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
            ("data", ctypes.c_uint8 * 4056),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.BridgeJournal.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(BridgeJournal) == 4096
    assert BridgeJournal.sequence.offset == 0
    assert BridgeJournal.epoch_ns.offset == 8
    assert BridgeJournal.published_ns.offset == 16
    assert BridgeJournal.begins.offset == 24
    assert BridgeJournal.length.offset == 28
    assert BridgeJournal.beginnings.offset == 32
    assert BridgeJournal.reserved.offset == 36
    assert BridgeJournal.data.offset == 40


class StatusJournal(Struct):
    """A piece of status' input journal. Topic `status/journal`; else as `BridgeJournal`."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publishing process began. [ns]"""
    published_ns: int
    """When this was published. [ns]"""
    begins: int
    """1 when the first byte of `data` begins a record that is a snapshot: reading can begin here."""
    length: int
    """Bytes of `data` that mean something, 0 ... 984."""
    beginnings: int
    """How often the journal was begun by this publisher: for the first subscriber, and after each loss."""
    reserved: int
    """Always zero; keeps the size a multiple of eight."""
    data: Array[int]
    """The bytes, filled up with zeros."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., published_ns: int = ..., begins: int = ..., length: int = ..., beginnings: int = ..., reserved: int = ..., data: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("published_ns", ctypes.c_uint64),
            ("begins", ctypes.c_uint32),
            ("length", ctypes.c_uint32),
            ("beginnings", ctypes.c_uint32),
            ("reserved", ctypes.c_uint32),
            ("data", ctypes.c_uint8 * 984),
        ]

    @staticmethod
    def type_name() -> str:
        return "hero.StatusJournal.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(StatusJournal) == 1024
    assert StatusJournal.sequence.offset == 0
    assert StatusJournal.epoch_ns.offset == 8
    assert StatusJournal.published_ns.offset == 16
    assert StatusJournal.begins.offset == 24
    assert StatusJournal.length.offset == 28
    assert StatusJournal.beginnings.offset == 32
    assert StatusJournal.reserved.offset == 36
    assert StatusJournal.data.offset == 40
