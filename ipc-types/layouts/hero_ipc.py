"""Structs and numbers of the HERO RIL in shared memory. docs/ipc.md says what they mean.

Made by ipc-types/tests/layout.rs: do not edit.
"""

import ctypes
import enum

#: By service: the values of its attributes `layout` and `layout_hash`.
LAYOUTS = {
    "dsp_telemetry": ("hero.DspTelemetry.v2", "25be95d4f5a2c01b"),
    "hero_telemetry": ("hero.HeroTelemetry.v2", "cc14cf2487fae1b2"),
    "module_state": ("hero.ModuleState.v5", "9af1e6e2264f0883"),
    "module_control": ("hero.ModuleControl.v2/hero.RequestReport.v2", "6bfcc9740509a353"),
    "movement": ("hero.MovementData.v3/hero.RequestReport.v2", "2af2c004c0511e69"),
    "parameters": ("hero.ParameterRequest.v2/hero.RequestReport.v2", "76e7bccf46c20e2f"),
    "relay/link": ("hero.RelayLink.v3", "59df1188187319fb"),
    "relay/stations": ("hero.RelayStations.v4", "4f5b96e435f46e26"),
    "mavlink/stations": ("hero.MavlinkStations.v1", "c608520ae195721a"),
    "bridge/outline": ("hero.BridgeOutline.v1", "ddd0ecd9990358d4"),
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


class DspGeographic(ctypes.Structure):
    _fields_ = [
        ("latitude_deg", ctypes.c_double),
        ("longitude_deg", ctypes.c_double),
        ("altitude_m", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspGeographic.v1"


assert ctypes.sizeof(DspGeographic) == 24
assert DspGeographic.latitude_deg.offset == 0
assert DspGeographic.longitude_deg.offset == 8
assert DspGeographic.altitude_m.offset == 16


class DspXy(ctypes.Structure):
    _fields_ = [
        ("x_m", ctypes.c_double),
        ("y_m", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspXy.v1"


assert ctypes.sizeof(DspXy) == 16
assert DspXy.x_m.offset == 0
assert DspXy.y_m.offset == 8


class DspGpsVelocity(ctypes.Structure):
    _fields_ = [
        ("horizontal_speed_mps", ctypes.c_float),
        ("vertical_speed_mps", ctypes.c_float),
        ("heading_deg", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspGpsVelocity.v1"


assert ctypes.sizeof(DspGpsVelocity) == 12
assert DspGpsVelocity.horizontal_speed_mps.offset == 0
assert DspGpsVelocity.vertical_speed_mps.offset == 4
assert DspGpsVelocity.heading_deg.offset == 8


class DspAttitude(ctypes.Structure):
    _fields_ = [
        ("pitch_deg", ctypes.c_float),
        ("roll_deg", ctypes.c_float),
        ("yaw_deg", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspAttitude.v1"


assert ctypes.sizeof(DspAttitude) == 12
assert DspAttitude.pitch_deg.offset == 0
assert DspAttitude.roll_deg.offset == 4
assert DspAttitude.yaw_deg.offset == 8


class DspAcceleration(ctypes.Structure):
    _fields_ = [
        ("x_mps2", ctypes.c_float),
        ("y_mps2", ctypes.c_float),
        ("z_mps2", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspAcceleration.v1"


assert ctypes.sizeof(DspAcceleration) == 12
assert DspAcceleration.x_mps2.offset == 0
assert DspAcceleration.y_mps2.offset == 4
assert DspAcceleration.z_mps2.offset == 8


class DspAngularRate(ctypes.Structure):
    _fields_ = [
        ("x_radps", ctypes.c_float),
        ("y_radps", ctypes.c_float),
        ("z_radps", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspAngularRate.v1"


assert ctypes.sizeof(DspAngularRate) == 12
assert DspAngularRate.x_radps.offset == 0
assert DspAngularRate.y_radps.offset == 4
assert DspAngularRate.z_radps.offset == 8


class DspServoPulses(ctypes.Structure):
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


assert ctypes.sizeof(DspServoPulses) == 20
assert DspServoPulses.collective_us.offset == 0
assert DspServoPulses.roll_us.offset == 4
assert DspServoPulses.pitch_us.offset == 8
assert DspServoPulses.tail_us.offset == 12
assert DspServoPulses.throttle_us.offset == 16


class DspSupply(ctypes.Structure):
    _fields_ = [
        ("battery_mv", ctypes.c_uint32),
        ("fuel_percent", ctypes.c_uint32),
        ("auto_switch", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspSupply.v1"


assert ctypes.sizeof(DspSupply) == 12
assert DspSupply.battery_mv.offset == 0
assert DspSupply.fuel_percent.offset == 4
assert DspSupply.auto_switch.offset == 8


class DspPanTilt(ctypes.Structure):
    _fields_ = [
        ("pan_adc", ctypes.c_uint32),
        ("tilt_adc", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.DspPanTilt.v1"


assert ctypes.sizeof(DspPanTilt) == 8
assert DspPanTilt.pan_adc.offset == 0
assert DspPanTilt.tilt_adc.offset == 4


class DspReferences(ctypes.Structure):
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


assert ctypes.sizeof(DspReferences) == 28
assert DspReferences.x_speed_mps.offset == 0
assert DspReferences.y_speed_mps.offset == 4
assert DspReferences.altitude_m.offset == 8
assert DspReferences.pitch_deg.offset == 12
assert DspReferences.roll_deg.offset == 16
assert DspReferences.yaw_deg.offset == 20
assert DspReferences.reserved.offset == 24


class DspTelemetry(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("epoch_ns", ctypes.c_uint64),
        ("received_ns", ctypes.c_uint64),
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
        return "hero.DspTelemetry.v2"


assert ctypes.sizeof(DspTelemetry) == 232
assert DspTelemetry.sequence.offset == 0
assert DspTelemetry.epoch_ns.offset == 8
assert DspTelemetry.received_ns.offset == 16
assert DspTelemetry.dsp_time_ms.offset == 24
assert DspTelemetry.valid_groups.offset == 28
assert DspTelemetry.flying.offset == 30
assert DspTelemetry.gps_quality.offset == 31
assert DspTelemetry.dsp_boots.offset == 32
assert DspTelemetry.dsp_errors.offset == 36
assert DspTelemetry.last_dsp_error_code.offset == 40
assert DspTelemetry.rotor_rpm.offset == 44
assert DspTelemetry.geographic.offset == 48
assert DspTelemetry.xy.offset == 72
assert DspTelemetry.gps_velocity.offset == 88
assert DspTelemetry.attitude.offset == 100
assert DspTelemetry.acceleration.offset == 112
assert DspTelemetry.angular_rate.offset == 124
assert DspTelemetry.pilot_pwm.offset == 136
assert DspTelemetry.actuation.offset == 156
assert DspTelemetry.sonar_adc.offset == 176
assert DspTelemetry.barometer_adc.offset == 180
assert DspTelemetry.supply.offset == 184
assert DspTelemetry.pan_tilt.offset == 196
assert DspTelemetry.references.offset == 204


class HeroGeodetic(ctypes.Structure):
    _fields_ = [
        ("latitude_rad", ctypes.c_double),
        ("longitude_rad", ctypes.c_double),
        ("altitude_m", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroGeodetic.v1"


assert ctypes.sizeof(HeroGeodetic) == 24
assert HeroGeodetic.latitude_rad.offset == 0
assert HeroGeodetic.longitude_rad.offset == 8
assert HeroGeodetic.altitude_m.offset == 16


class HeroLocal(ctypes.Structure):
    _fields_ = [
        ("east_m", ctypes.c_double),
        ("north_m", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroLocal.v1"


assert ctypes.sizeof(HeroLocal) == 16
assert HeroLocal.east_m.offset == 0
assert HeroLocal.north_m.offset == 8


class HeroVelocity(ctypes.Structure):
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


assert ctypes.sizeof(HeroVelocity) == 20
assert HeroVelocity.north_mps.offset == 0
assert HeroVelocity.east_mps.offset == 4
assert HeroVelocity.up_mps.offset == 8
assert HeroVelocity.ground_speed_mps.offset == 12
assert HeroVelocity.course_rad.offset == 16


class HeroAttitude(ctypes.Structure):
    _fields_ = [
        ("roll_rad", ctypes.c_float),
        ("pitch_rad", ctypes.c_float),
        ("yaw_rad", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroAttitude.v1"


assert ctypes.sizeof(HeroAttitude) == 12
assert HeroAttitude.roll_rad.offset == 0
assert HeroAttitude.pitch_rad.offset == 4
assert HeroAttitude.yaw_rad.offset == 8


class HeroAcceleration(ctypes.Structure):
    _fields_ = [
        ("forward_mps2", ctypes.c_float),
        ("right_mps2", ctypes.c_float),
        ("down_mps2", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroAcceleration.v1"


assert ctypes.sizeof(HeroAcceleration) == 12
assert HeroAcceleration.forward_mps2.offset == 0
assert HeroAcceleration.right_mps2.offset == 4
assert HeroAcceleration.down_mps2.offset == 8


class HeroAngularRate(ctypes.Structure):
    _fields_ = [
        ("forward_radps", ctypes.c_float),
        ("right_radps", ctypes.c_float),
        ("down_radps", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroAngularRate.v1"


assert ctypes.sizeof(HeroAngularRate) == 12
assert HeroAngularRate.forward_radps.offset == 0
assert HeroAngularRate.right_radps.offset == 4
assert HeroAngularRate.down_radps.offset == 8


class HeroServos(ctypes.Structure):
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


assert ctypes.sizeof(HeroServos) == 20
assert HeroServos.collective.offset == 0
assert HeroServos.roll.offset == 4
assert HeroServos.pitch.offset == 8
assert HeroServos.tail.offset == 12
assert HeroServos.throttle.offset == 16


class HeroSupply(ctypes.Structure):
    _fields_ = [
        ("battery_v", ctypes.c_float),
        ("fuel_fraction", ctypes.c_float),
        ("auto_switch", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.HeroSupply.v1"


assert ctypes.sizeof(HeroSupply) == 12
assert HeroSupply.battery_v.offset == 0
assert HeroSupply.fuel_fraction.offset == 4
assert HeroSupply.auto_switch.offset == 8


class HeroReferences(ctypes.Structure):
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


assert ctypes.sizeof(HeroReferences) == 24
assert HeroReferences.north_mps.offset == 0
assert HeroReferences.east_mps.offset == 4
assert HeroReferences.altitude_m.offset == 8
assert HeroReferences.roll_rad.offset == 12
assert HeroReferences.pitch_rad.offset == 16
assert HeroReferences.yaw_rad.offset == 20


class HeroEstimate(ctypes.Structure):
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


assert ctypes.sizeof(HeroEstimate) == 32
assert HeroEstimate.altitude_m.offset == 0
assert HeroEstimate.altitude_variance_m2.offset == 8
assert HeroEstimate.vertical_speed_mps.offset == 16
assert HeroEstimate.inputs.offset == 24
assert HeroEstimate.valid.offset == 28


class HeroTelemetry(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("epoch_ns", ctypes.c_uint64),
        ("source_sequence", ctypes.c_uint64),
        ("source_epoch_ns", ctypes.c_uint64),
        ("received_ns", ctypes.c_uint64),
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
        return "hero.HeroTelemetry.v2"


assert ctypes.sizeof(HeroTelemetry) == 304
assert HeroTelemetry.sequence.offset == 0
assert HeroTelemetry.epoch_ns.offset == 8
assert HeroTelemetry.source_sequence.offset == 16
assert HeroTelemetry.source_epoch_ns.offset == 24
assert HeroTelemetry.received_ns.offset == 32
assert HeroTelemetry.published_ns.offset == 40
assert HeroTelemetry.dsp_time_s.offset == 48
assert HeroTelemetry.valid_groups.offset == 56
assert HeroTelemetry.flying.offset == 60
assert HeroTelemetry.dsp_boots.offset == 64
assert HeroTelemetry.dsp_errors.offset == 68
assert HeroTelemetry.last_dsp_error_code.offset == 72
assert HeroTelemetry.gps_quality.offset == 76
assert HeroTelemetry.geodetic.offset == 80
assert HeroTelemetry.local.offset == 104
assert HeroTelemetry.velocity.offset == 120
assert HeroTelemetry.attitude.offset == 140
assert HeroTelemetry.acceleration.offset == 152
assert HeroTelemetry.angular_rate.offset == 164
assert HeroTelemetry.pilot.offset == 176
assert HeroTelemetry.actuation.offset == 196
assert HeroTelemetry.sonar_height_m.offset == 216
assert HeroTelemetry.barometer_altitude_m.offset == 220
assert HeroTelemetry.supply.offset == 224
assert HeroTelemetry.pan_rad.offset == 236
assert HeroTelemetry.tilt_rad.offset == 240
assert HeroTelemetry.rotor_radps.offset == 244
assert HeroTelemetry.references.offset == 248
assert HeroTelemetry.estimate.offset == 272


class MovementState(ctypes.Structure):
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


assert ctypes.sizeof(MovementState) == 40
assert MovementState.request_id.offset == 0
assert MovementState.path_id.offset == 8
assert MovementState.kind.offset == 16
assert MovementState.waypoints_total.offset == 20
assert MovementState.waypoints_sent.offset == 24
assert MovementState.waypoints_reached.offset == 28
assert MovementState.distance_to_go_m.offset == 32
assert MovementState.distance_valid.offset == 36


class LinkHealth(ctypes.Structure):
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


class RefusedCounters(ctypes.Structure):
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


class DspErrorCounters(ctypes.Structure):
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


assert ctypes.sizeof(DspErrorCounters) == 120
assert DspErrorCounters.total.offset == 0
assert DspErrorCounters.unknown.offset == 4
assert DspErrorCounters.last_code.offset == 8
assert DspErrorCounters.escalated.offset == 12
assert DspErrorCounters.known.offset == 16


class SafetyState(ctypes.Structure):
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


assert ctypes.sizeof(SafetyState) == 32
assert SafetyState.amount.offset == 0
assert SafetyState.rule.offset == 8
assert SafetyState.action.offset == 12
assert SafetyState.pilot_switch.offset == 16
assert SafetyState.fence_areas.offset == 20
assert SafetyState.interventions.offset == 24
assert SafetyState.reserved.offset == 28


class ControlSender(ctypes.Structure):
    _fields_ = [
        ("origin", ctypes.c_uint32),
        ("session", ctypes.c_uint32),
        ("process", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.ControlSender.v1"


assert ctypes.sizeof(ControlSender) == 12
assert ControlSender.origin.offset == 0
assert ControlSender.session.offset == 4
assert ControlSender.process.offset == 8


class ControlState(ctypes.Structure):
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


assert ctypes.sizeof(ControlState) == 56
assert ControlState.since_ns.offset == 0
assert ControlState.last_order_ns.offset == 8
assert ControlState.holder.offset == 16
assert ControlState.asker.offset == 28
assert ControlState.held.offset == 40
assert ControlState.asked.offset == 44
assert ControlState.exclusive.offset == 48
assert ControlState.reserved.offset == 52


class LastMinute(ctypes.Structure):
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


assert ctypes.sizeof(LastMinute) == 20
assert LastMinute.duration_s.offset == 0
assert LastMinute.messages.offset == 4
assert LastMinute.rejected.offset == 8
assert LastMinute.commands_repeated.offset == 12
assert LastMinute.commands_failed.offset == 16


class ModuleState(ctypes.Structure):
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
        ("link", LinkHealth),
        ("refused", RefusedCounters),
        ("dsp_errors", DspErrorCounters),
        ("safety", SafetyState),
        ("ground_altitude_m", ctypes.c_double),
        ("outline", ctypes.c_uint64),
        ("control", ControlState),
        ("ground_valid", ctypes.c_uint32),
        ("last_minute", LastMinute),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.ModuleState.v5"


assert ctypes.sizeof(ModuleState) == 480
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
assert ModuleState.link.offset == 88
assert ModuleState.refused.offset == 184
assert ModuleState.dsp_errors.offset == 232
assert ModuleState.safety.offset == 352
assert ModuleState.ground_altitude_m.offset == 384
assert ModuleState.outline.offset == 392
assert ModuleState.control.offset == 400
assert ModuleState.ground_valid.offset == 456
assert ModuleState.last_minute.offset == 460


class ModuleControl(ctypes.Structure):
    _fields_ = [
        ("request_id", ctypes.c_uint64),
        ("issued_ns", ctypes.c_uint64),
        ("begin_by_ns", ctypes.c_uint64),
        ("command", ctypes.c_uint32),
        ("issued_within_ns", ctypes.c_uint32),
        ("origin", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.ModuleControl.v2"


assert ctypes.sizeof(ModuleControl) == 40
assert ModuleControl.request_id.offset == 0
assert ModuleControl.issued_ns.offset == 8
assert ModuleControl.begin_by_ns.offset == 16
assert ModuleControl.command.offset == 24
assert ModuleControl.issued_within_ns.offset == 28
assert ModuleControl.origin.offset == 32
assert ModuleControl.reserved.offset == 36


class MovementData(ctypes.Structure):
    _fields_ = [
        ("request_id", ctypes.c_uint64),
        ("path_id", ctypes.c_uint64),
        ("issued_ns", ctypes.c_uint64),
        ("begin_by_ns", ctypes.c_uint64),
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
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.MovementData.v3"


assert ctypes.sizeof(MovementData) == 80
assert MovementData.request_id.offset == 0
assert MovementData.path_id.offset == 8
assert MovementData.issued_ns.offset == 16
assert MovementData.begin_by_ns.offset == 24
assert MovementData.latitude_deg.offset == 32
assert MovementData.longitude_deg.offset == 40
assert MovementData.altitude_m.offset == 48
assert MovementData.kind.offset == 56
assert MovementData.first.offset == 60
assert MovementData.last.offset == 62
assert MovementData.issued_within_ns.offset == 64
assert MovementData.origin.offset == 68
assert MovementData.repeat.offset == 72
assert MovementData.preempt.offset == 74
assert MovementData.reserved.offset == 76


class ParameterRequest(ctypes.Structure):
    _fields_ = [
        ("request_id", ctypes.c_uint64),
        ("issued_ns", ctypes.c_uint64),
        ("begin_by_ns", ctypes.c_uint64),
        ("value", ctypes.c_double),
        ("port", ctypes.c_uint32),
        ("operation", ctypes.c_uint32),
        ("issued_within_ns", ctypes.c_uint32),
        ("origin", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.ParameterRequest.v2"


assert ctypes.sizeof(ParameterRequest) == 48
assert ParameterRequest.request_id.offset == 0
assert ParameterRequest.issued_ns.offset == 8
assert ParameterRequest.begin_by_ns.offset == 16
assert ParameterRequest.value.offset == 24
assert ParameterRequest.port.offset == 32
assert ParameterRequest.operation.offset == 36
assert ParameterRequest.issued_within_ns.offset == 40
assert ParameterRequest.origin.offset == 44


class PortInfo(ctypes.Structure):
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


assert ctypes.sizeof(PortInfo) == 64
assert PortInfo.min.offset == 0
assert PortInfo.max.offset == 8
assert PortInfo.number.offset == 16
assert PortInfo.kind.offset == 20
assert PortInfo.access.offset == 24
assert PortInfo.count.offset == 28
assert PortInfo.name.offset == 32


class RequestReport(ctypes.Structure):
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
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.RequestReport.v2"


assert ctypes.sizeof(RequestReport) == 136
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


class RelayLink(ctypes.Structure):
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


class RelayStation(ctypes.Structure):
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


class RelayStations(ctypes.Structure):
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


assert ctypes.sizeof(RelayStations) == 1696
assert RelayStations.sequence.offset == 0
assert RelayStations.epoch_ns.offset == 8
assert RelayStations.published_ns.offset == 16
assert RelayStations.stations.offset == 24
assert RelayStations.count.offset == 1688
assert RelayStations.samples_bytes_per_s.offset == 1692


class MavlinkStation(ctypes.Structure):
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


class MavlinkStations(ctypes.Structure):
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


class OutlinePoint(ctypes.Structure):
    _fields_ = [
        ("latitude_deg", ctypes.c_double),
        ("longitude_deg", ctypes.c_double),
        ("altitude_m", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "hero.OutlinePoint.v1"


assert ctypes.sizeof(OutlinePoint) == 24
assert OutlinePoint.latitude_deg.offset == 0
assert OutlinePoint.longitude_deg.offset == 8
assert OutlinePoint.altitude_m.offset == 16


class BridgeOutline(ctypes.Structure):
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


class BridgeJournal(ctypes.Structure):
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


assert ctypes.sizeof(BridgeJournal) == 4096
assert BridgeJournal.sequence.offset == 0
assert BridgeJournal.epoch_ns.offset == 8
assert BridgeJournal.published_ns.offset == 16
assert BridgeJournal.begins.offset == 24
assert BridgeJournal.length.offset == 28
assert BridgeJournal.beginnings.offset == 32
assert BridgeJournal.reserved.offset == 36
assert BridgeJournal.data.offset == 40


class StatusJournal(ctypes.Structure):
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


assert ctypes.sizeof(StatusJournal) == 1024
assert StatusJournal.sequence.offset == 0
assert StatusJournal.epoch_ns.offset == 8
assert StatusJournal.published_ns.offset == 16
assert StatusJournal.begins.offset == 24
assert StatusJournal.length.offset == 28
assert StatusJournal.beginnings.offset == 32
assert StatusJournal.reserved.offset == 36
assert StatusJournal.data.offset == 40
