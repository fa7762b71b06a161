/* Structs and numbers of the HERO RIL in shared memory, for C11 and C++11. docs/ipc.md says what they mean.
 * Made by ipc-types/tests/layout.rs: do not edit. */
#ifndef HERO_IPC_H
#define HERO_IPC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define HERO_ASSERT(what) static_assert(what, #what)
#else
#define HERO_ASSERT(what) _Static_assert(what, #what)
#endif

#define HERO_EVENT_ID_MAX 15
#define HERO_DSP_TELEMETRY_LAYOUT "hero.DspTelemetry.v3"
#define HERO_DSP_TELEMETRY_LAYOUT_HASH "8c6956c8fcb0b385"
#define HERO_HERO_TELEMETRY_LAYOUT "hero.HeroTelemetry.v3"
#define HERO_HERO_TELEMETRY_LAYOUT_HASH "9ec168c2cd0beb87"
#define HERO_MODULE_STATE_LAYOUT "hero.ModuleState.v7"
#define HERO_MODULE_STATE_LAYOUT_HASH "d2fde892c5344b3d"
#define HERO_MODULE_CONTROL_LAYOUT "hero.ModuleControl.v3/hero.RequestReport.v3"
#define HERO_MODULE_CONTROL_LAYOUT_HASH "cf3c38b4e2124ac6"
#define HERO_MOVEMENT_LAYOUT "hero.MovementData.v4/hero.RequestReport.v3"
#define HERO_MOVEMENT_LAYOUT_HASH "20f642fd866688b5"
#define HERO_PARAMETERS_LAYOUT "hero.ParameterRequest.v3/hero.RequestReport.v3"
#define HERO_PARAMETERS_LAYOUT_HASH "8f60139dda1a192e"
#define HERO_RELAY_LINK_LAYOUT "hero.RelayLink.v3"
#define HERO_RELAY_LINK_LAYOUT_HASH "59df1188187319fb"
#define HERO_RELAY_STATIONS_LAYOUT "hero.RelayStations.v4"
#define HERO_RELAY_STATIONS_LAYOUT_HASH "4f5b96e435f46e26"
#define HERO_MAVLINK_STATIONS_LAYOUT "hero.MavlinkStations.v1"
#define HERO_MAVLINK_STATIONS_LAYOUT_HASH "c608520ae195721a"
#define HERO_BRIDGE_OUTLINE_LAYOUT "hero.BridgeOutline.v1"
#define HERO_BRIDGE_OUTLINE_LAYOUT_HASH "ddd0ecd9990358d4"
#define HERO_BRIDGE_CONFIGURATION_LAYOUT "hero.ConfigurationPiece.v1"
#define HERO_BRIDGE_CONFIGURATION_LAYOUT_HASH "b00776c1f2b0df0a"
#define HERO_STATUS_CONFIGURATION_LAYOUT "hero.ConfigurationPiece.v1"
#define HERO_STATUS_CONFIGURATION_LAYOUT_HASH "b00776c1f2b0df0a"
#define HERO_BRIDGE_JOURNAL_LAYOUT "hero.BridgeJournal.v1"
#define HERO_BRIDGE_JOURNAL_LAYOUT_HASH "a0a172067737e627"
#define HERO_STATUS_JOURNAL_LAYOUT "hero.StatusJournal.v1"
#define HERO_STATUS_JOURNAL_LAYOUT_HASH "394f9e703707f1ff"

enum hero_control_command {
    HERO_CONTROL_COMMAND_START = 1,
    HERO_CONTROL_COMMAND_STOP = 2,
    HERO_CONTROL_COMMAND_RELOAD_FENCE = 3,
    HERO_CONTROL_COMMAND_TAKE_CONTROL = 4,
    HERO_CONTROL_COMMAND_RELEASE_CONTROL = 5,
    HERO_CONTROL_COMMAND_PASS_CONTROL = 6,
};

enum hero_movement_kind {
    HERO_MOVEMENT_KIND_GOTO = 1,
    HERO_MOVEMENT_KIND_TAKEOFF = 2,
    HERO_MOVEMENT_KIND_LAND = 3,
    HERO_MOVEMENT_KIND_HOLD = 4,
};

enum hero_module_id {
    HERO_MODULE_ID_HERO_BRIDGE = 1,
    HERO_MODULE_ID_HERO_STATUS = 2,
    HERO_MODULE_ID_HERO_RELAY = 3,
};

enum hero_module_status {
    HERO_MODULE_STATUS_WAITING_DATA_TO_START = 1,
    HERO_MODULE_STATUS_RUNNING = 2,
    HERO_MODULE_STATUS_ENDED = 3,
    HERO_MODULE_STATUS_ABORTED = 4,
};

enum hero_functionality {
    HERO_FUNCTIONALITY_AT_REST = 1,
    HERO_FUNCTIONALITY_RECEIVING_PATH = 2,
    HERO_FUNCTIONALITY_TAKING_OFF = 3,
    HERO_FUNCTIONALITY_FOLLOWING_PATH = 4,
    HERO_FUNCTIONALITY_LANDING = 5,
    HERO_FUNCTIONALITY_STOPPING = 6,
    HERO_FUNCTIONALITY_HOLDING = 7,
};

enum hero_link_state {
    HERO_LINK_STATE_CONNECTING = 1,
    HERO_LINK_STATE_UP = 2,
    HERO_LINK_STATE_SILENT = 3,
    HERO_LINK_STATE_GONE = 4,
};

enum hero_relay_link_state {
    HERO_RELAY_LINK_STATE_CONNECTING = 1,
    HERO_RELAY_LINK_STATE_UP = 2,
    HERO_RELAY_LINK_STATE_DOWN = 3,
};

enum hero_mavlink_vehicle {
    HERO_MAVLINK_VEHICLE_HEARD = 1,
    HERO_MAVLINK_VEHICLE_NO_STATE = 2,
    HERO_MAVLINK_VEHICLE_LINK_DOWN = 3,
    HERO_MAVLINK_VEHICLE_NO_TELEMETRY = 4,
};

enum hero_dsp_path_state {
    HERO_DSP_PATH_STATE_UNKNOWN = 1,
    HERO_DSP_PATH_STATE_EMPTY = 2,
    HERO_DSP_PATH_STATE_OURS = 3,
};

enum hero_outline_kind {
    HERO_OUTLINE_KIND_FENCE = 1,
    HERO_OUTLINE_KIND_AREA = 2,
    HERO_OUTLINE_KIND_PATH = 3,
};

enum hero_pilot_switch {
    HERO_PILOT_SWITCH_UNKNOWN = 0,
    HERO_PILOT_SWITCH_MANUAL = 1,
    HERO_PILOT_SWITCH_AUTO = 2,
};

enum hero_safety_rule {
    HERO_SAFETY_RULE_PILOT_SWITCH = 1,
    HERO_SAFETY_RULE_FENCE_INCLUSION = 2,
    HERO_SAFETY_RULE_FENCE_EXCLUSION = 3,
    HERO_SAFETY_RULE_FENCE_FLOOR = 4,
    HERO_SAFETY_RULE_FENCE_CEILING = 5,
    HERO_SAFETY_RULE_BATTERY = 6,
    HERO_SAFETY_RULE_FUEL = 7,
    HERO_SAFETY_RULE_LINK_LOSS = 8,
    HERO_SAFETY_RULE_FENCE_UNJUDGEABLE = 9,
    HERO_SAFETY_RULE_POSITION_LOST = 10,
    HERO_SAFETY_RULE_FENCE_AHEAD = 11,
    HERO_SAFETY_RULE_BELOW_TAKE_OFF = 12,
};

enum hero_safety_action {
    HERO_SAFETY_ACTION_WARN = 1,
    HERO_SAFETY_ACTION_REFUSE = 2,
    HERO_SAFETY_ACTION_HOLD = 3,
    HERO_SAFETY_ACTION_LAND = 4,
};

enum hero_parameter_operation {
    HERO_PARAMETER_OPERATION_READ = 1,
    HERO_PARAMETER_OPERATION_WRITE = 2,
    HERO_PARAMETER_OPERATION_LIST = 3,
};

enum hero_port_kind {
    HERO_PORT_KIND_U16 = 1,
    HERO_PORT_KIND_I16 = 2,
    HERO_PORT_KIND_F32 = 3,
};

enum hero_sender_lost {
    HERO_SENDER_LOST_CONTINUE = 1,
    HERO_SENDER_LOST_HOLD = 2,
    HERO_SENDER_LOST_LAND = 3,
};

enum hero_came_between {
    HERO_CAME_BETWEEN_START = 1,
    HERO_CAME_BETWEEN_STOP = 2,
    HERO_CAME_BETWEEN_TAKEOFF = 3,
    HERO_CAME_BETWEEN_GOTO = 4,
    HERO_CAME_BETWEEN_LAND = 5,
    HERO_CAME_BETWEEN_HOLD = 6,
    HERO_CAME_BETWEEN_SAFETY_RULE = 7,
    HERO_CAME_BETWEEN_PILOT = 8,
    HERO_CAME_BETWEEN_LINK_LOST = 9,
    HERO_CAME_BETWEEN_DSP_REBOOTED = 10,
    HERO_CAME_BETWEEN_BRIDGE_BEGAN = 11,
    HERO_CAME_BETWEEN_SENDER_LOST = 12,
};

enum hero_stage {
    HERO_STAGE_ACCEPTED = 1,
    HERO_STAGE_PROGRESS = 2,
    HERO_STAGE_DONE = 16,
    HERO_STAGE_REFUSED = 17,
    HERO_STAGE_ABORTED = 18,
    HERO_STAGE_UNKNOWN = 19,
};

enum hero_reason {
    HERO_REASON_NONE = 0,
    HERO_REASON_INVALID_REQUEST = 1,
    HERO_REASON_NOT_FINITE = 2,
    HERO_REASON_OUT_OF_RANGE = 3,
    HERO_REASON_TOO_FAR = 4,
    HERO_REASON_NOT_STARTED = 5,
    HERO_REASON_ALREADY_RUNNING = 6,
    HERO_REASON_UNABLE_TO_ABORT = 7,
    HERO_REASON_BUSY = 8,
    HERO_REASON_LINK_DOWN = 9,
    HERO_REASON_NOT_FLYING = 10,
    HERO_REASON_ALREADY_FLYING = 11,
    HERO_REASON_NO_POSITION = 12,
    HERO_REASON_PATH_WITHOUT_HEAD = 13,
    HERO_REASON_PATH_REPLACED = 14,
    HERO_REASON_PATH_TOO_LONG = 15,
    HERO_REASON_PATH_BROKEN = 16,
    HERO_REASON_TOO_MANY_REQUESTS = 17,
    HERO_REASON_TOO_LATE = 18,
    HERO_REASON_MOVEMENT_TIMEOUT = 19,
    HERO_REASON_STOPPED = 20,
    HERO_REASON_DSP_FATAL_ERROR = 21,
    HERO_REASON_COMMUNICATION_FATAL_ERROR = 22,
    HERO_REASON_DSP_REBOOTED = 23,
    HERO_REASON_BRIDGE_ENDING = 24,
    HERO_REASON_BRIDGE_GONE = 25,
    HERO_REASON_DELIVERY_FAILED = 26,
    HERO_REASON_NOT_REMEMBERED = 27,
    HERO_REASON_REFUSED_BY_DSP = 28,
    HERO_REASON_REPLACED = 29,
    HERO_REASON_PILOT_HAS_CONTROL = 30,
    HERO_REASON_FENCE_BREACH = 31,
    HERO_REASON_SUPPLY_LOW = 32,
    HERO_REASON_LINK_LOST = 33,
    HERO_REASON_NO_SUCH_PORT = 34,
    HERO_REASON_NOT_IN_FLIGHT = 35,
    HERO_REASON_INVALID_FENCE = 36,
    HERO_REASON_RELAY_LINK_DOWN = 37,
    HERO_REASON_RELAY_LINK_LOST = 38,
    HERO_REASON_RELAY_NOT_PERMITTED = 39,
    HERO_REASON_STILL_OPEN = 40,
    HERO_REASON_RELAY_TOO_MANY_STATIONS = 41,
    HERO_REASON_REPLAYED = 42,
    HERO_REASON_SUPERSEDED = 43,
    HERO_REASON_MODULE_GONE = 44,
    HERO_REASON_NOT_IN_CONTROL = 45,
    HERO_REASON_FENCE_UNREAD = 46,
    HERO_REASON_CLOCK_DIFFERS = 47,
    HERO_REASON_SENDER_LOST = 48,
    HERO_REASON_RELAY_TWO_ROBOTS = 49,
};

enum hero_imi_error {
    HERO_IMI_ERROR_NO_ERROR = 0,
    HERO_IMI_ERROR_MODULE_RUNNING_TO_RESTART_STOP_IT_BEFORE = 1,
    HERO_IMI_ERROR_IMPOSSIBLE_TO_STOP_MODULE = 2,
    HERO_IMI_ERROR_HERO_DSP_FATAL_ERROR = 100,
    HERO_IMI_ERROR_COMMUNICATION_FATAL_ERROR = 101,
    HERO_IMI_ERROR_MOVEMENT_TIMEOUT = 102,
};

enum hero_telemetry_group {
    HERO_TELEMETRY_GROUP_TIME = 1,
    HERO_TELEMETRY_GROUP_GEOGRAPHIC = 2,
    HERO_TELEMETRY_GROUP_XY = 4,
    HERO_TELEMETRY_GROUP_GPS_VELOCITY = 8,
    HERO_TELEMETRY_GROUP_GPS_QUALITY = 16,
    HERO_TELEMETRY_GROUP_ATTITUDE = 32,
    HERO_TELEMETRY_GROUP_ACCELERATION = 64,
    HERO_TELEMETRY_GROUP_ANGULAR_RATE = 128,
    HERO_TELEMETRY_GROUP_PILOT_PWM = 256,
    HERO_TELEMETRY_GROUP_SONAR = 512,
    HERO_TELEMETRY_GROUP_SUPPLY = 1024,
    HERO_TELEMETRY_GROUP_PAN_TILT = 2048,
    HERO_TELEMETRY_GROUP_ROTOR_SPEED = 4096,
    HERO_TELEMETRY_GROUP_BAROMETER = 8192,
    HERO_TELEMETRY_GROUP_ACTUATION = 16384,
    HERO_TELEMETRY_GROUP_REFERENCES = 32768,
};

enum hero_event {
    HERO_EVENT_DATA = 1,
    HERO_EVENT_ARRIVED = 2,
    HERO_EVENT_LEFT = 3,
    HERO_EVENT_DIED = 4,
};

#define HERO_DSP_GEOGRAPHIC_TYPE_NAME "hero.DspGeographic.v1"
typedef struct DspGeographic {
    double latitude_deg;
    double longitude_deg;
    double altitude_m;
} DspGeographic;
HERO_ASSERT(sizeof(DspGeographic) == 24);
HERO_ASSERT(offsetof(DspGeographic, latitude_deg) == 0);
HERO_ASSERT(offsetof(DspGeographic, longitude_deg) == 8);
HERO_ASSERT(offsetof(DspGeographic, altitude_m) == 16);

#define HERO_DSP_XY_TYPE_NAME "hero.DspXy.v1"
typedef struct DspXy {
    double x_m;
    double y_m;
} DspXy;
HERO_ASSERT(sizeof(DspXy) == 16);
HERO_ASSERT(offsetof(DspXy, x_m) == 0);
HERO_ASSERT(offsetof(DspXy, y_m) == 8);

#define HERO_DSP_GPS_VELOCITY_TYPE_NAME "hero.DspGpsVelocity.v1"
typedef struct DspGpsVelocity {
    float horizontal_speed_mps;
    float vertical_speed_mps;
    float heading_deg;
} DspGpsVelocity;
HERO_ASSERT(sizeof(DspGpsVelocity) == 12);
HERO_ASSERT(offsetof(DspGpsVelocity, horizontal_speed_mps) == 0);
HERO_ASSERT(offsetof(DspGpsVelocity, vertical_speed_mps) == 4);
HERO_ASSERT(offsetof(DspGpsVelocity, heading_deg) == 8);

#define HERO_DSP_ATTITUDE_TYPE_NAME "hero.DspAttitude.v1"
typedef struct DspAttitude {
    float pitch_deg;
    float roll_deg;
    float yaw_deg;
} DspAttitude;
HERO_ASSERT(sizeof(DspAttitude) == 12);
HERO_ASSERT(offsetof(DspAttitude, pitch_deg) == 0);
HERO_ASSERT(offsetof(DspAttitude, roll_deg) == 4);
HERO_ASSERT(offsetof(DspAttitude, yaw_deg) == 8);

#define HERO_DSP_ACCELERATION_TYPE_NAME "hero.DspAcceleration.v1"
typedef struct DspAcceleration {
    float x_mps2;
    float y_mps2;
    float z_mps2;
} DspAcceleration;
HERO_ASSERT(sizeof(DspAcceleration) == 12);
HERO_ASSERT(offsetof(DspAcceleration, x_mps2) == 0);
HERO_ASSERT(offsetof(DspAcceleration, y_mps2) == 4);
HERO_ASSERT(offsetof(DspAcceleration, z_mps2) == 8);

#define HERO_DSP_ANGULAR_RATE_TYPE_NAME "hero.DspAngularRate.v1"
typedef struct DspAngularRate {
    float x_radps;
    float y_radps;
    float z_radps;
} DspAngularRate;
HERO_ASSERT(sizeof(DspAngularRate) == 12);
HERO_ASSERT(offsetof(DspAngularRate, x_radps) == 0);
HERO_ASSERT(offsetof(DspAngularRate, y_radps) == 4);
HERO_ASSERT(offsetof(DspAngularRate, z_radps) == 8);

#define HERO_DSP_SERVO_PULSES_TYPE_NAME "hero.DspServoPulses.v1"
typedef struct DspServoPulses {
    uint32_t collective_us;
    uint32_t roll_us;
    uint32_t pitch_us;
    uint32_t tail_us;
    uint32_t throttle_us;
} DspServoPulses;
HERO_ASSERT(sizeof(DspServoPulses) == 20);
HERO_ASSERT(offsetof(DspServoPulses, collective_us) == 0);
HERO_ASSERT(offsetof(DspServoPulses, roll_us) == 4);
HERO_ASSERT(offsetof(DspServoPulses, pitch_us) == 8);
HERO_ASSERT(offsetof(DspServoPulses, tail_us) == 12);
HERO_ASSERT(offsetof(DspServoPulses, throttle_us) == 16);

#define HERO_DSP_SUPPLY_TYPE_NAME "hero.DspSupply.v1"
typedef struct DspSupply {
    uint32_t battery_mv;
    uint32_t fuel_percent;
    uint32_t auto_switch;
} DspSupply;
HERO_ASSERT(sizeof(DspSupply) == 12);
HERO_ASSERT(offsetof(DspSupply, battery_mv) == 0);
HERO_ASSERT(offsetof(DspSupply, fuel_percent) == 4);
HERO_ASSERT(offsetof(DspSupply, auto_switch) == 8);

#define HERO_DSP_PAN_TILT_TYPE_NAME "hero.DspPanTilt.v1"
typedef struct DspPanTilt {
    uint32_t pan_adc;
    uint32_t tilt_adc;
} DspPanTilt;
HERO_ASSERT(sizeof(DspPanTilt) == 8);
HERO_ASSERT(offsetof(DspPanTilt, pan_adc) == 0);
HERO_ASSERT(offsetof(DspPanTilt, tilt_adc) == 4);

#define HERO_DSP_REFERENCES_TYPE_NAME "hero.DspReferences.v1"
typedef struct DspReferences {
    float x_speed_mps;
    float y_speed_mps;
    float altitude_m;
    float pitch_deg;
    float roll_deg;
    float yaw_deg;
    uint32_t reserved;
} DspReferences;
HERO_ASSERT(sizeof(DspReferences) == 28);
HERO_ASSERT(offsetof(DspReferences, x_speed_mps) == 0);
HERO_ASSERT(offsetof(DspReferences, y_speed_mps) == 4);
HERO_ASSERT(offsetof(DspReferences, altitude_m) == 8);
HERO_ASSERT(offsetof(DspReferences, pitch_deg) == 12);
HERO_ASSERT(offsetof(DspReferences, roll_deg) == 16);
HERO_ASSERT(offsetof(DspReferences, yaw_deg) == 20);
HERO_ASSERT(offsetof(DspReferences, reserved) == 24);

#define HERO_DSP_TELEMETRY_TYPE_NAME "hero.DspTelemetry.v3"
typedef struct DspTelemetry {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t received_ns;
    uint64_t sent_ns;
    double sent_uncertainty_s;
    uint32_t dsp_time_ms;
    uint16_t valid_groups;
    uint8_t flying;
    uint8_t gps_quality;
    uint32_t dsp_boots;
    uint32_t dsp_errors;
    uint32_t last_dsp_error_code;
    uint32_t rotor_rpm;
    DspGeographic geographic;
    DspXy xy;
    DspGpsVelocity gps_velocity;
    DspAttitude attitude;
    DspAcceleration acceleration;
    DspAngularRate angular_rate;
    DspServoPulses pilot_pwm;
    DspServoPulses actuation;
    uint32_t sonar_adc;
    uint32_t barometer_adc;
    DspSupply supply;
    DspPanTilt pan_tilt;
    DspReferences references;
} DspTelemetry;
HERO_ASSERT(sizeof(DspTelemetry) == 248);
HERO_ASSERT(offsetof(DspTelemetry, sequence) == 0);
HERO_ASSERT(offsetof(DspTelemetry, epoch_ns) == 8);
HERO_ASSERT(offsetof(DspTelemetry, received_ns) == 16);
HERO_ASSERT(offsetof(DspTelemetry, sent_ns) == 24);
HERO_ASSERT(offsetof(DspTelemetry, sent_uncertainty_s) == 32);
HERO_ASSERT(offsetof(DspTelemetry, dsp_time_ms) == 40);
HERO_ASSERT(offsetof(DspTelemetry, valid_groups) == 44);
HERO_ASSERT(offsetof(DspTelemetry, flying) == 46);
HERO_ASSERT(offsetof(DspTelemetry, gps_quality) == 47);
HERO_ASSERT(offsetof(DspTelemetry, dsp_boots) == 48);
HERO_ASSERT(offsetof(DspTelemetry, dsp_errors) == 52);
HERO_ASSERT(offsetof(DspTelemetry, last_dsp_error_code) == 56);
HERO_ASSERT(offsetof(DspTelemetry, rotor_rpm) == 60);
HERO_ASSERT(offsetof(DspTelemetry, geographic) == 64);
HERO_ASSERT(offsetof(DspTelemetry, xy) == 88);
HERO_ASSERT(offsetof(DspTelemetry, gps_velocity) == 104);
HERO_ASSERT(offsetof(DspTelemetry, attitude) == 116);
HERO_ASSERT(offsetof(DspTelemetry, acceleration) == 128);
HERO_ASSERT(offsetof(DspTelemetry, angular_rate) == 140);
HERO_ASSERT(offsetof(DspTelemetry, pilot_pwm) == 152);
HERO_ASSERT(offsetof(DspTelemetry, actuation) == 172);
HERO_ASSERT(offsetof(DspTelemetry, sonar_adc) == 192);
HERO_ASSERT(offsetof(DspTelemetry, barometer_adc) == 196);
HERO_ASSERT(offsetof(DspTelemetry, supply) == 200);
HERO_ASSERT(offsetof(DspTelemetry, pan_tilt) == 212);
HERO_ASSERT(offsetof(DspTelemetry, references) == 220);

#define HERO_HERO_GEODETIC_TYPE_NAME "hero.HeroGeodetic.v1"
typedef struct HeroGeodetic {
    double latitude_rad;
    double longitude_rad;
    double altitude_m;
} HeroGeodetic;
HERO_ASSERT(sizeof(HeroGeodetic) == 24);
HERO_ASSERT(offsetof(HeroGeodetic, latitude_rad) == 0);
HERO_ASSERT(offsetof(HeroGeodetic, longitude_rad) == 8);
HERO_ASSERT(offsetof(HeroGeodetic, altitude_m) == 16);

#define HERO_HERO_LOCAL_TYPE_NAME "hero.HeroLocal.v1"
typedef struct HeroLocal {
    double east_m;
    double north_m;
} HeroLocal;
HERO_ASSERT(sizeof(HeroLocal) == 16);
HERO_ASSERT(offsetof(HeroLocal, east_m) == 0);
HERO_ASSERT(offsetof(HeroLocal, north_m) == 8);

#define HERO_HERO_VELOCITY_TYPE_NAME "hero.HeroVelocity.v1"
typedef struct HeroVelocity {
    float north_mps;
    float east_mps;
    float up_mps;
    float ground_speed_mps;
    float course_rad;
} HeroVelocity;
HERO_ASSERT(sizeof(HeroVelocity) == 20);
HERO_ASSERT(offsetof(HeroVelocity, north_mps) == 0);
HERO_ASSERT(offsetof(HeroVelocity, east_mps) == 4);
HERO_ASSERT(offsetof(HeroVelocity, up_mps) == 8);
HERO_ASSERT(offsetof(HeroVelocity, ground_speed_mps) == 12);
HERO_ASSERT(offsetof(HeroVelocity, course_rad) == 16);

#define HERO_HERO_ATTITUDE_TYPE_NAME "hero.HeroAttitude.v1"
typedef struct HeroAttitude {
    float roll_rad;
    float pitch_rad;
    float yaw_rad;
} HeroAttitude;
HERO_ASSERT(sizeof(HeroAttitude) == 12);
HERO_ASSERT(offsetof(HeroAttitude, roll_rad) == 0);
HERO_ASSERT(offsetof(HeroAttitude, pitch_rad) == 4);
HERO_ASSERT(offsetof(HeroAttitude, yaw_rad) == 8);

#define HERO_HERO_ACCELERATION_TYPE_NAME "hero.HeroAcceleration.v1"
typedef struct HeroAcceleration {
    float forward_mps2;
    float right_mps2;
    float down_mps2;
} HeroAcceleration;
HERO_ASSERT(sizeof(HeroAcceleration) == 12);
HERO_ASSERT(offsetof(HeroAcceleration, forward_mps2) == 0);
HERO_ASSERT(offsetof(HeroAcceleration, right_mps2) == 4);
HERO_ASSERT(offsetof(HeroAcceleration, down_mps2) == 8);

#define HERO_HERO_ANGULAR_RATE_TYPE_NAME "hero.HeroAngularRate.v1"
typedef struct HeroAngularRate {
    float forward_radps;
    float right_radps;
    float down_radps;
} HeroAngularRate;
HERO_ASSERT(sizeof(HeroAngularRate) == 12);
HERO_ASSERT(offsetof(HeroAngularRate, forward_radps) == 0);
HERO_ASSERT(offsetof(HeroAngularRate, right_radps) == 4);
HERO_ASSERT(offsetof(HeroAngularRate, down_radps) == 8);

#define HERO_HERO_SERVOS_TYPE_NAME "hero.HeroServos.v1"
typedef struct HeroServos {
    float collective;
    float roll;
    float pitch;
    float tail;
    float throttle;
} HeroServos;
HERO_ASSERT(sizeof(HeroServos) == 20);
HERO_ASSERT(offsetof(HeroServos, collective) == 0);
HERO_ASSERT(offsetof(HeroServos, roll) == 4);
HERO_ASSERT(offsetof(HeroServos, pitch) == 8);
HERO_ASSERT(offsetof(HeroServos, tail) == 12);
HERO_ASSERT(offsetof(HeroServos, throttle) == 16);

#define HERO_HERO_SUPPLY_TYPE_NAME "hero.HeroSupply.v1"
typedef struct HeroSupply {
    float battery_v;
    float fuel_fraction;
    uint32_t auto_switch;
} HeroSupply;
HERO_ASSERT(sizeof(HeroSupply) == 12);
HERO_ASSERT(offsetof(HeroSupply, battery_v) == 0);
HERO_ASSERT(offsetof(HeroSupply, fuel_fraction) == 4);
HERO_ASSERT(offsetof(HeroSupply, auto_switch) == 8);

#define HERO_HERO_REFERENCES_TYPE_NAME "hero.HeroReferences.v1"
typedef struct HeroReferences {
    float north_mps;
    float east_mps;
    float altitude_m;
    float roll_rad;
    float pitch_rad;
    float yaw_rad;
} HeroReferences;
HERO_ASSERT(sizeof(HeroReferences) == 24);
HERO_ASSERT(offsetof(HeroReferences, north_mps) == 0);
HERO_ASSERT(offsetof(HeroReferences, east_mps) == 4);
HERO_ASSERT(offsetof(HeroReferences, altitude_m) == 8);
HERO_ASSERT(offsetof(HeroReferences, roll_rad) == 12);
HERO_ASSERT(offsetof(HeroReferences, pitch_rad) == 16);
HERO_ASSERT(offsetof(HeroReferences, yaw_rad) == 20);

#define HERO_HERO_ESTIMATE_TYPE_NAME "hero.HeroEstimate.v1"
typedef struct HeroEstimate {
    double altitude_m;
    double altitude_variance_m2;
    double vertical_speed_mps;
    uint32_t inputs;
    uint32_t valid;
} HeroEstimate;
HERO_ASSERT(sizeof(HeroEstimate) == 32);
HERO_ASSERT(offsetof(HeroEstimate, altitude_m) == 0);
HERO_ASSERT(offsetof(HeroEstimate, altitude_variance_m2) == 8);
HERO_ASSERT(offsetof(HeroEstimate, vertical_speed_mps) == 16);
HERO_ASSERT(offsetof(HeroEstimate, inputs) == 24);
HERO_ASSERT(offsetof(HeroEstimate, valid) == 28);

#define HERO_HERO_TELEMETRY_TYPE_NAME "hero.HeroTelemetry.v3"
typedef struct HeroTelemetry {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t source_sequence;
    uint64_t source_epoch_ns;
    uint64_t received_ns;
    uint64_t sent_ns;
    double sent_uncertainty_s;
    uint64_t published_ns;
    double dsp_time_s;
    uint32_t valid_groups;
    uint32_t flying;
    uint32_t dsp_boots;
    uint32_t dsp_errors;
    uint32_t last_dsp_error_code;
    uint32_t gps_quality;
    HeroGeodetic geodetic;
    HeroLocal local;
    HeroVelocity velocity;
    HeroAttitude attitude;
    HeroAcceleration acceleration;
    HeroAngularRate angular_rate;
    HeroServos pilot;
    HeroServos actuation;
    float sonar_height_m;
    float barometer_altitude_m;
    HeroSupply supply;
    float pan_rad;
    float tilt_rad;
    float rotor_radps;
    HeroReferences references;
    HeroEstimate estimate;
} HeroTelemetry;
HERO_ASSERT(sizeof(HeroTelemetry) == 320);
HERO_ASSERT(offsetof(HeroTelemetry, sequence) == 0);
HERO_ASSERT(offsetof(HeroTelemetry, epoch_ns) == 8);
HERO_ASSERT(offsetof(HeroTelemetry, source_sequence) == 16);
HERO_ASSERT(offsetof(HeroTelemetry, source_epoch_ns) == 24);
HERO_ASSERT(offsetof(HeroTelemetry, received_ns) == 32);
HERO_ASSERT(offsetof(HeroTelemetry, sent_ns) == 40);
HERO_ASSERT(offsetof(HeroTelemetry, sent_uncertainty_s) == 48);
HERO_ASSERT(offsetof(HeroTelemetry, published_ns) == 56);
HERO_ASSERT(offsetof(HeroTelemetry, dsp_time_s) == 64);
HERO_ASSERT(offsetof(HeroTelemetry, valid_groups) == 72);
HERO_ASSERT(offsetof(HeroTelemetry, flying) == 76);
HERO_ASSERT(offsetof(HeroTelemetry, dsp_boots) == 80);
HERO_ASSERT(offsetof(HeroTelemetry, dsp_errors) == 84);
HERO_ASSERT(offsetof(HeroTelemetry, last_dsp_error_code) == 88);
HERO_ASSERT(offsetof(HeroTelemetry, gps_quality) == 92);
HERO_ASSERT(offsetof(HeroTelemetry, geodetic) == 96);
HERO_ASSERT(offsetof(HeroTelemetry, local) == 120);
HERO_ASSERT(offsetof(HeroTelemetry, velocity) == 136);
HERO_ASSERT(offsetof(HeroTelemetry, attitude) == 156);
HERO_ASSERT(offsetof(HeroTelemetry, acceleration) == 168);
HERO_ASSERT(offsetof(HeroTelemetry, angular_rate) == 180);
HERO_ASSERT(offsetof(HeroTelemetry, pilot) == 192);
HERO_ASSERT(offsetof(HeroTelemetry, actuation) == 212);
HERO_ASSERT(offsetof(HeroTelemetry, sonar_height_m) == 232);
HERO_ASSERT(offsetof(HeroTelemetry, barometer_altitude_m) == 236);
HERO_ASSERT(offsetof(HeroTelemetry, supply) == 240);
HERO_ASSERT(offsetof(HeroTelemetry, pan_rad) == 252);
HERO_ASSERT(offsetof(HeroTelemetry, tilt_rad) == 256);
HERO_ASSERT(offsetof(HeroTelemetry, rotor_radps) == 260);
HERO_ASSERT(offsetof(HeroTelemetry, references) == 264);
HERO_ASSERT(offsetof(HeroTelemetry, estimate) == 288);

#define HERO_MOVEMENT_STATE_TYPE_NAME "hero.MovementState.v1"
typedef struct MovementState {
    uint64_t request_id;
    uint64_t path_id;
    uint32_t kind;
    uint32_t waypoints_total;
    uint32_t waypoints_sent;
    uint32_t waypoints_reached;
    float distance_to_go_m;
    uint32_t distance_valid;
} MovementState;
HERO_ASSERT(sizeof(MovementState) == 40);
HERO_ASSERT(offsetof(MovementState, request_id) == 0);
HERO_ASSERT(offsetof(MovementState, path_id) == 8);
HERO_ASSERT(offsetof(MovementState, kind) == 16);
HERO_ASSERT(offsetof(MovementState, waypoints_total) == 20);
HERO_ASSERT(offsetof(MovementState, waypoints_sent) == 24);
HERO_ASSERT(offsetof(MovementState, waypoints_reached) == 28);
HERO_ASSERT(offsetof(MovementState, distance_to_go_m) == 32);
HERO_ASSERT(offsetof(MovementState, distance_valid) == 36);

#define HERO_MOVEMENT_END_TYPE_NAME "hero.MovementEnd.v1"
typedef struct MovementEnd {
    uint64_t ended_ns;
    uint64_t request_id;
    uint32_t kind;
    uint32_t stage;
    uint32_t reason;
    uint32_t waypoints_reached;
} MovementEnd;
HERO_ASSERT(sizeof(MovementEnd) == 32);
HERO_ASSERT(offsetof(MovementEnd, ended_ns) == 0);
HERO_ASSERT(offsetof(MovementEnd, request_id) == 8);
HERO_ASSERT(offsetof(MovementEnd, kind) == 16);
HERO_ASSERT(offsetof(MovementEnd, stage) == 20);
HERO_ASSERT(offsetof(MovementEnd, reason) == 24);
HERO_ASSERT(offsetof(MovementEnd, waypoints_reached) == 28);

#define HERO_LINK_HEALTH_TYPE_NAME "hero.LinkHealth.v2"
typedef struct LinkHealth {
    uint64_t last_message_ns;
    uint64_t last_telemetry_ns;
    uint64_t state_since_ns;
    uint64_t bytes_received;
    uint64_t messages_received;
    uint32_t state;
    uint32_t port_openings;
    uint32_t dsp_boots;
    uint32_t commands_acknowledged;
    uint32_t commands_repeated;
    uint32_t commands_failed;
    uint32_t acks_unmatched;
    uint32_t waypoints_sent;
    uint32_t waypoints_repeated;
    uint32_t delivery_verified;
    uint32_t telemetry_published;
    uint32_t telemetry_incoherent;
    uint32_t dsp_path;
    uint32_t pc_timeout_supported;
} LinkHealth;
HERO_ASSERT(sizeof(LinkHealth) == 96);
HERO_ASSERT(offsetof(LinkHealth, last_message_ns) == 0);
HERO_ASSERT(offsetof(LinkHealth, last_telemetry_ns) == 8);
HERO_ASSERT(offsetof(LinkHealth, state_since_ns) == 16);
HERO_ASSERT(offsetof(LinkHealth, bytes_received) == 24);
HERO_ASSERT(offsetof(LinkHealth, messages_received) == 32);
HERO_ASSERT(offsetof(LinkHealth, state) == 40);
HERO_ASSERT(offsetof(LinkHealth, port_openings) == 44);
HERO_ASSERT(offsetof(LinkHealth, dsp_boots) == 48);
HERO_ASSERT(offsetof(LinkHealth, commands_acknowledged) == 52);
HERO_ASSERT(offsetof(LinkHealth, commands_repeated) == 56);
HERO_ASSERT(offsetof(LinkHealth, commands_failed) == 60);
HERO_ASSERT(offsetof(LinkHealth, acks_unmatched) == 64);
HERO_ASSERT(offsetof(LinkHealth, waypoints_sent) == 68);
HERO_ASSERT(offsetof(LinkHealth, waypoints_repeated) == 72);
HERO_ASSERT(offsetof(LinkHealth, delivery_verified) == 76);
HERO_ASSERT(offsetof(LinkHealth, telemetry_published) == 80);
HERO_ASSERT(offsetof(LinkHealth, telemetry_incoherent) == 84);
HERO_ASSERT(offsetof(LinkHealth, dsp_path) == 88);
HERO_ASSERT(offsetof(LinkHealth, pc_timeout_supported) == 92);

#define HERO_REFUSED_COUNTERS_TYPE_NAME "hero.RefusedCounters.v1"
typedef struct RefusedCounters {
    uint32_t stray;
    uint32_t unknown_header;
    uint32_t truncated;
    uint32_t checksum;
    uint32_t padding;
    uint32_t value;
    uint32_t implausible_groups;
    uint32_t implausible_mask;
    uint32_t requests;
    uint32_t transmit_overflows;
    uint32_t other_profile;
    uint32_t missed_messages;
} RefusedCounters;
HERO_ASSERT(sizeof(RefusedCounters) == 48);
HERO_ASSERT(offsetof(RefusedCounters, stray) == 0);
HERO_ASSERT(offsetof(RefusedCounters, unknown_header) == 4);
HERO_ASSERT(offsetof(RefusedCounters, truncated) == 8);
HERO_ASSERT(offsetof(RefusedCounters, checksum) == 12);
HERO_ASSERT(offsetof(RefusedCounters, padding) == 16);
HERO_ASSERT(offsetof(RefusedCounters, value) == 20);
HERO_ASSERT(offsetof(RefusedCounters, implausible_groups) == 24);
HERO_ASSERT(offsetof(RefusedCounters, implausible_mask) == 28);
HERO_ASSERT(offsetof(RefusedCounters, requests) == 32);
HERO_ASSERT(offsetof(RefusedCounters, transmit_overflows) == 36);
HERO_ASSERT(offsetof(RefusedCounters, other_profile) == 40);
HERO_ASSERT(offsetof(RefusedCounters, missed_messages) == 44);

#define HERO_DSP_ERROR_COUNTERS_TYPE_NAME "hero.DspErrorCounters.v2"
typedef struct DspErrorCounters {
    uint32_t total;
    uint32_t unknown;
    uint32_t last_code;
    uint32_t escalated;
    uint32_t known[26];
} DspErrorCounters;
HERO_ASSERT(sizeof(DspErrorCounters) == 120);
HERO_ASSERT(offsetof(DspErrorCounters, total) == 0);
HERO_ASSERT(offsetof(DspErrorCounters, unknown) == 4);
HERO_ASSERT(offsetof(DspErrorCounters, last_code) == 8);
HERO_ASSERT(offsetof(DspErrorCounters, escalated) == 12);
HERO_ASSERT(offsetof(DspErrorCounters, known) == 16);

#define HERO_SAFETY_STATE_TYPE_NAME "hero.SafetyState.v1"
typedef struct SafetyState {
    double amount;
    uint32_t rule;
    uint32_t action;
    uint32_t pilot_switch;
    uint32_t fence_areas;
    uint32_t interventions;
    uint32_t reserved;
} SafetyState;
HERO_ASSERT(sizeof(SafetyState) == 32);
HERO_ASSERT(offsetof(SafetyState, amount) == 0);
HERO_ASSERT(offsetof(SafetyState, rule) == 8);
HERO_ASSERT(offsetof(SafetyState, action) == 12);
HERO_ASSERT(offsetof(SafetyState, pilot_switch) == 16);
HERO_ASSERT(offsetof(SafetyState, fence_areas) == 20);
HERO_ASSERT(offsetof(SafetyState, interventions) == 24);
HERO_ASSERT(offsetof(SafetyState, reserved) == 28);

#define HERO_CONTROL_SENDER_TYPE_NAME "hero.ControlSender.v1"
typedef struct ControlSender {
    uint32_t origin;
    uint32_t session;
    uint32_t process;
} ControlSender;
HERO_ASSERT(sizeof(ControlSender) == 12);
HERO_ASSERT(offsetof(ControlSender, origin) == 0);
HERO_ASSERT(offsetof(ControlSender, session) == 4);
HERO_ASSERT(offsetof(ControlSender, process) == 8);

#define HERO_CONTROL_STATE_TYPE_NAME "hero.ControlState.v1"
typedef struct ControlState {
    uint64_t since_ns;
    uint64_t last_order_ns;
    ControlSender holder;
    ControlSender asker;
    uint32_t held;
    uint32_t asked;
    uint32_t exclusive;
    uint32_t reserved;
} ControlState;
HERO_ASSERT(sizeof(ControlState) == 56);
HERO_ASSERT(offsetof(ControlState, since_ns) == 0);
HERO_ASSERT(offsetof(ControlState, last_order_ns) == 8);
HERO_ASSERT(offsetof(ControlState, holder) == 16);
HERO_ASSERT(offsetof(ControlState, asker) == 28);
HERO_ASSERT(offsetof(ControlState, held) == 40);
HERO_ASSERT(offsetof(ControlState, asked) == 44);
HERO_ASSERT(offsetof(ControlState, exclusive) == 48);
HERO_ASSERT(offsetof(ControlState, reserved) == 52);

#define HERO_LAST_MINUTE_TYPE_NAME "hero.LastMinute.v1"
typedef struct LastMinute {
    uint32_t duration_s;
    uint32_t messages;
    uint32_t rejected;
    uint32_t commands_repeated;
    uint32_t commands_failed;
} LastMinute;
HERO_ASSERT(sizeof(LastMinute) == 20);
HERO_ASSERT(offsetof(LastMinute, duration_s) == 0);
HERO_ASSERT(offsetof(LastMinute, messages) == 4);
HERO_ASSERT(offsetof(LastMinute, rejected) == 8);
HERO_ASSERT(offsetof(LastMinute, commands_repeated) == 12);
HERO_ASSERT(offsetof(LastMinute, commands_failed) == 16);

#define HERO_MODULE_STATE_TYPE_NAME "hero.ModuleState.v7"
typedef struct ModuleState {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint32_t module_id;
    uint32_t status;
    uint32_t imi_error;
    uint32_t blocked;
    uint32_t functionality;
    uint32_t unable_to_abort;
    MovementState movement;
    MovementEnd last_end;
    LinkHealth link;
    RefusedCounters refused;
    DspErrorCounters dsp_errors;
    SafetyState safety;
    double home_latitude_deg;
    double home_longitude_deg;
    double ground_altitude_m;
    uint64_t outline;
    ControlState control;
    uint32_t ground_valid;
    LastMinute last_minute;
} ModuleState;
HERO_ASSERT(sizeof(ModuleState) == 528);
HERO_ASSERT(offsetof(ModuleState, sequence) == 0);
HERO_ASSERT(offsetof(ModuleState, epoch_ns) == 8);
HERO_ASSERT(offsetof(ModuleState, published_ns) == 16);
HERO_ASSERT(offsetof(ModuleState, module_id) == 24);
HERO_ASSERT(offsetof(ModuleState, status) == 28);
HERO_ASSERT(offsetof(ModuleState, imi_error) == 32);
HERO_ASSERT(offsetof(ModuleState, blocked) == 36);
HERO_ASSERT(offsetof(ModuleState, functionality) == 40);
HERO_ASSERT(offsetof(ModuleState, unable_to_abort) == 44);
HERO_ASSERT(offsetof(ModuleState, movement) == 48);
HERO_ASSERT(offsetof(ModuleState, last_end) == 88);
HERO_ASSERT(offsetof(ModuleState, link) == 120);
HERO_ASSERT(offsetof(ModuleState, refused) == 216);
HERO_ASSERT(offsetof(ModuleState, dsp_errors) == 264);
HERO_ASSERT(offsetof(ModuleState, safety) == 384);
HERO_ASSERT(offsetof(ModuleState, home_latitude_deg) == 416);
HERO_ASSERT(offsetof(ModuleState, home_longitude_deg) == 424);
HERO_ASSERT(offsetof(ModuleState, ground_altitude_m) == 432);
HERO_ASSERT(offsetof(ModuleState, outline) == 440);
HERO_ASSERT(offsetof(ModuleState, control) == 448);
HERO_ASSERT(offsetof(ModuleState, ground_valid) == 504);
HERO_ASSERT(offsetof(ModuleState, last_minute) == 508);

#define HERO_MODULE_CONTROL_TYPE_NAME "hero.ModuleControl.v3"
typedef struct ModuleControl {
    uint64_t request_id;
    uint64_t issued_ns;
    uint64_t begin_by_ns;
    uint64_t after;
    uint32_t command;
    uint32_t issued_within_ns;
    uint32_t origin;
    uint32_t reserved;
} ModuleControl;
HERO_ASSERT(sizeof(ModuleControl) == 48);
HERO_ASSERT(offsetof(ModuleControl, request_id) == 0);
HERO_ASSERT(offsetof(ModuleControl, issued_ns) == 8);
HERO_ASSERT(offsetof(ModuleControl, begin_by_ns) == 16);
HERO_ASSERT(offsetof(ModuleControl, after) == 24);
HERO_ASSERT(offsetof(ModuleControl, command) == 32);
HERO_ASSERT(offsetof(ModuleControl, issued_within_ns) == 36);
HERO_ASSERT(offsetof(ModuleControl, origin) == 40);
HERO_ASSERT(offsetof(ModuleControl, reserved) == 44);

#define HERO_MOVEMENT_DATA_TYPE_NAME "hero.MovementData.v4"
typedef struct MovementData {
    uint64_t request_id;
    uint64_t path_id;
    uint64_t issued_ns;
    uint64_t begin_by_ns;
    uint64_t after;
    double latitude_deg;
    double longitude_deg;
    double altitude_m;
    uint32_t kind;
    uint16_t first;
    uint16_t last;
    uint32_t issued_within_ns;
    uint32_t origin;
    uint16_t repeat;
    uint16_t preempt;
    uint32_t lease_ms;
    uint32_t sender_lost;
    uint32_t reserved;
} MovementData;
HERO_ASSERT(sizeof(MovementData) == 96);
HERO_ASSERT(offsetof(MovementData, request_id) == 0);
HERO_ASSERT(offsetof(MovementData, path_id) == 8);
HERO_ASSERT(offsetof(MovementData, issued_ns) == 16);
HERO_ASSERT(offsetof(MovementData, begin_by_ns) == 24);
HERO_ASSERT(offsetof(MovementData, after) == 32);
HERO_ASSERT(offsetof(MovementData, latitude_deg) == 40);
HERO_ASSERT(offsetof(MovementData, longitude_deg) == 48);
HERO_ASSERT(offsetof(MovementData, altitude_m) == 56);
HERO_ASSERT(offsetof(MovementData, kind) == 64);
HERO_ASSERT(offsetof(MovementData, first) == 68);
HERO_ASSERT(offsetof(MovementData, last) == 70);
HERO_ASSERT(offsetof(MovementData, issued_within_ns) == 72);
HERO_ASSERT(offsetof(MovementData, origin) == 76);
HERO_ASSERT(offsetof(MovementData, repeat) == 80);
HERO_ASSERT(offsetof(MovementData, preempt) == 82);
HERO_ASSERT(offsetof(MovementData, lease_ms) == 84);
HERO_ASSERT(offsetof(MovementData, sender_lost) == 88);
HERO_ASSERT(offsetof(MovementData, reserved) == 92);

#define HERO_PARAMETER_REQUEST_TYPE_NAME "hero.ParameterRequest.v3"
typedef struct ParameterRequest {
    uint64_t request_id;
    uint64_t issued_ns;
    uint64_t begin_by_ns;
    uint64_t after;
    double value;
    uint32_t port;
    uint32_t operation;
    uint32_t issued_within_ns;
    uint32_t origin;
} ParameterRequest;
HERO_ASSERT(sizeof(ParameterRequest) == 56);
HERO_ASSERT(offsetof(ParameterRequest, request_id) == 0);
HERO_ASSERT(offsetof(ParameterRequest, issued_ns) == 8);
HERO_ASSERT(offsetof(ParameterRequest, begin_by_ns) == 16);
HERO_ASSERT(offsetof(ParameterRequest, after) == 24);
HERO_ASSERT(offsetof(ParameterRequest, value) == 32);
HERO_ASSERT(offsetof(ParameterRequest, port) == 40);
HERO_ASSERT(offsetof(ParameterRequest, operation) == 44);
HERO_ASSERT(offsetof(ParameterRequest, issued_within_ns) == 48);
HERO_ASSERT(offsetof(ParameterRequest, origin) == 52);

#define HERO_PORT_INFO_TYPE_NAME "hero.PortInfo.v1"
typedef struct PortInfo {
    double min;
    double max;
    uint32_t number;
    uint32_t kind;
    uint32_t access;
    uint32_t count;
    uint8_t name[32];
} PortInfo;
HERO_ASSERT(sizeof(PortInfo) == 64);
HERO_ASSERT(offsetof(PortInfo, min) == 0);
HERO_ASSERT(offsetof(PortInfo, max) == 8);
HERO_ASSERT(offsetof(PortInfo, number) == 16);
HERO_ASSERT(offsetof(PortInfo, kind) == 20);
HERO_ASSERT(offsetof(PortInfo, access) == 24);
HERO_ASSERT(offsetof(PortInfo, count) == 28);
HERO_ASSERT(offsetof(PortInfo, name) == 32);

#define HERO_REQUEST_REPORT_TYPE_NAME "hero.RequestReport.v3"
typedef struct RequestReport {
    uint64_t request_id;
    uint64_t path_id;
    uint64_t reported_ns;
    uint32_t stage;
    uint32_t reason;
    uint32_t imi_error;
    uint32_t waypoints_total;
    uint32_t waypoints_sent;
    uint32_t waypoints_reached;
    uint32_t rule;
    uint32_t waypoint;
    uint32_t dsp_error_code;
    uint16_t dsp_error_valid;
    uint16_t value_valid;
    double value;
    PortInfo port;
    uint64_t between_request_id;
    ControlSender between_sender;
    uint32_t between;
} RequestReport;
HERO_ASSERT(sizeof(RequestReport) == 160);
HERO_ASSERT(offsetof(RequestReport, request_id) == 0);
HERO_ASSERT(offsetof(RequestReport, path_id) == 8);
HERO_ASSERT(offsetof(RequestReport, reported_ns) == 16);
HERO_ASSERT(offsetof(RequestReport, stage) == 24);
HERO_ASSERT(offsetof(RequestReport, reason) == 28);
HERO_ASSERT(offsetof(RequestReport, imi_error) == 32);
HERO_ASSERT(offsetof(RequestReport, waypoints_total) == 36);
HERO_ASSERT(offsetof(RequestReport, waypoints_sent) == 40);
HERO_ASSERT(offsetof(RequestReport, waypoints_reached) == 44);
HERO_ASSERT(offsetof(RequestReport, rule) == 48);
HERO_ASSERT(offsetof(RequestReport, waypoint) == 52);
HERO_ASSERT(offsetof(RequestReport, dsp_error_code) == 56);
HERO_ASSERT(offsetof(RequestReport, dsp_error_valid) == 60);
HERO_ASSERT(offsetof(RequestReport, value_valid) == 62);
HERO_ASSERT(offsetof(RequestReport, value) == 64);
HERO_ASSERT(offsetof(RequestReport, port) == 72);
HERO_ASSERT(offsetof(RequestReport, between_request_id) == 136);
HERO_ASSERT(offsetof(RequestReport, between_sender) == 144);
HERO_ASSERT(offsetof(RequestReport, between) == 156);

#define HERO_RELAY_LINK_TYPE_NAME "hero.RelayLink.v3"
typedef struct RelayLink {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint64_t since_ns;
    uint64_t last_heard_ns;
    int64_t clock_offset_ns;
    double clock_uncertainty_s;
    double round_trip_s;
    double open_timeout_s;
    uint64_t samples_received;
    uint64_t samples_lost_on_air;
    uint64_t samples_lost_in_relay;
    uint64_t samples_left_out;
    uint64_t bytes_received;
    uint64_t bytes_sent;
    uint64_t orders_sent;
    uint64_t orders_repeated;
    uint64_t orders_unknown;
    uint32_t state;
    uint32_t robot;
    int32_t clock_drift_ppb;
    uint32_t clock_valid;
    uint32_t clock_resets;
    uint32_t outages;
    uint32_t orders_open;
    uint32_t refusal;
    uint8_t link[64];
    uint8_t station[32];
} RelayLink;
HERO_ASSERT(sizeof(RelayLink) == 272);
HERO_ASSERT(offsetof(RelayLink, sequence) == 0);
HERO_ASSERT(offsetof(RelayLink, epoch_ns) == 8);
HERO_ASSERT(offsetof(RelayLink, published_ns) == 16);
HERO_ASSERT(offsetof(RelayLink, since_ns) == 24);
HERO_ASSERT(offsetof(RelayLink, last_heard_ns) == 32);
HERO_ASSERT(offsetof(RelayLink, clock_offset_ns) == 40);
HERO_ASSERT(offsetof(RelayLink, clock_uncertainty_s) == 48);
HERO_ASSERT(offsetof(RelayLink, round_trip_s) == 56);
HERO_ASSERT(offsetof(RelayLink, open_timeout_s) == 64);
HERO_ASSERT(offsetof(RelayLink, samples_received) == 72);
HERO_ASSERT(offsetof(RelayLink, samples_lost_on_air) == 80);
HERO_ASSERT(offsetof(RelayLink, samples_lost_in_relay) == 88);
HERO_ASSERT(offsetof(RelayLink, samples_left_out) == 96);
HERO_ASSERT(offsetof(RelayLink, bytes_received) == 104);
HERO_ASSERT(offsetof(RelayLink, bytes_sent) == 112);
HERO_ASSERT(offsetof(RelayLink, orders_sent) == 120);
HERO_ASSERT(offsetof(RelayLink, orders_repeated) == 128);
HERO_ASSERT(offsetof(RelayLink, orders_unknown) == 136);
HERO_ASSERT(offsetof(RelayLink, state) == 144);
HERO_ASSERT(offsetof(RelayLink, robot) == 148);
HERO_ASSERT(offsetof(RelayLink, clock_drift_ppb) == 152);
HERO_ASSERT(offsetof(RelayLink, clock_valid) == 156);
HERO_ASSERT(offsetof(RelayLink, clock_resets) == 160);
HERO_ASSERT(offsetof(RelayLink, outages) == 164);
HERO_ASSERT(offsetof(RelayLink, orders_open) == 168);
HERO_ASSERT(offsetof(RelayLink, refusal) == 172);
HERO_ASSERT(offsetof(RelayLink, link) == 176);
HERO_ASSERT(offsetof(RelayLink, station) == 240);

#define HERO_RELAY_STATION_TYPE_NAME "hero.RelayStation.v3"
typedef struct RelayStation {
    uint8_t name[32];
    uint64_t last_heard_ns;
    uint64_t since_ns;
    uint64_t last_order_ns;
    uint64_t orders_executed;
    uint64_t orders_refused;
    uint64_t samples_sent;
    uint32_t may_command;
    uint32_t is_up;
    uint32_t orders_open;
    uint32_t refusal;
    uint32_t origin;
    uint32_t reserved;
} RelayStation;
HERO_ASSERT(sizeof(RelayStation) == 104);
HERO_ASSERT(offsetof(RelayStation, name) == 0);
HERO_ASSERT(offsetof(RelayStation, last_heard_ns) == 32);
HERO_ASSERT(offsetof(RelayStation, since_ns) == 40);
HERO_ASSERT(offsetof(RelayStation, last_order_ns) == 48);
HERO_ASSERT(offsetof(RelayStation, orders_executed) == 56);
HERO_ASSERT(offsetof(RelayStation, orders_refused) == 64);
HERO_ASSERT(offsetof(RelayStation, samples_sent) == 72);
HERO_ASSERT(offsetof(RelayStation, may_command) == 80);
HERO_ASSERT(offsetof(RelayStation, is_up) == 84);
HERO_ASSERT(offsetof(RelayStation, orders_open) == 88);
HERO_ASSERT(offsetof(RelayStation, refusal) == 92);
HERO_ASSERT(offsetof(RelayStation, origin) == 96);
HERO_ASSERT(offsetof(RelayStation, reserved) == 100);

#define HERO_RELAY_STATIONS_TYPE_NAME "hero.RelayStations.v4"
typedef struct RelayStations {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    RelayStation stations[16];
    uint32_t count;
    uint32_t samples_bytes_per_s;
} RelayStations;
HERO_ASSERT(sizeof(RelayStations) == 1696);
HERO_ASSERT(offsetof(RelayStations, sequence) == 0);
HERO_ASSERT(offsetof(RelayStations, epoch_ns) == 8);
HERO_ASSERT(offsetof(RelayStations, published_ns) == 16);
HERO_ASSERT(offsetof(RelayStations, stations) == 24);
HERO_ASSERT(offsetof(RelayStations, count) == 1688);
HERO_ASSERT(offsetof(RelayStations, samples_bytes_per_s) == 1692);

#define HERO_MAVLINK_STATION_TYPE_NAME "hero.MavlinkStation.v1"
typedef struct MavlinkStation {
    uint8_t address[48];
    uint64_t last_heard_ns;
    uint64_t since_ns;
    uint64_t last_command_ns;
    uint64_t commands;
    uint64_t refused;
    uint32_t system;
    uint32_t component;
    uint32_t may_command;
    uint32_t is_lost;
    uint32_t has_movement;
    uint32_t reserved;
} MavlinkStation;
HERO_ASSERT(sizeof(MavlinkStation) == 112);
HERO_ASSERT(offsetof(MavlinkStation, address) == 0);
HERO_ASSERT(offsetof(MavlinkStation, last_heard_ns) == 48);
HERO_ASSERT(offsetof(MavlinkStation, since_ns) == 56);
HERO_ASSERT(offsetof(MavlinkStation, last_command_ns) == 64);
HERO_ASSERT(offsetof(MavlinkStation, commands) == 72);
HERO_ASSERT(offsetof(MavlinkStation, refused) == 80);
HERO_ASSERT(offsetof(MavlinkStation, system) == 88);
HERO_ASSERT(offsetof(MavlinkStation, component) == 92);
HERO_ASSERT(offsetof(MavlinkStation, may_command) == 96);
HERO_ASSERT(offsetof(MavlinkStation, is_lost) == 100);
HERO_ASSERT(offsetof(MavlinkStation, has_movement) == 104);
HERO_ASSERT(offsetof(MavlinkStation, reserved) == 108);

#define HERO_MAVLINK_STATIONS_TYPE_NAME "hero.MavlinkStations.v1"
typedef struct MavlinkStations {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint64_t since_ns;
    uint64_t frames_read;
    uint64_t datagrams_sent;
    uint64_t refused_unreadable;
    uint64_t refused_unknown;
    uint64_t refused_checksum;
    uint64_t refused_unsigned;
    uint64_t refused_signature;
    uint64_t refused_replayed;
    uint64_t refused_full;
    MavlinkStation stations[8];
    uint32_t count;
    uint32_t vehicle;
    uint32_t system;
    uint32_t is_signed;
    uint64_t datagrams_dropped;
} MavlinkStations;
HERO_ASSERT(sizeof(MavlinkStations) == 1024);
HERO_ASSERT(offsetof(MavlinkStations, sequence) == 0);
HERO_ASSERT(offsetof(MavlinkStations, epoch_ns) == 8);
HERO_ASSERT(offsetof(MavlinkStations, published_ns) == 16);
HERO_ASSERT(offsetof(MavlinkStations, since_ns) == 24);
HERO_ASSERT(offsetof(MavlinkStations, frames_read) == 32);
HERO_ASSERT(offsetof(MavlinkStations, datagrams_sent) == 40);
HERO_ASSERT(offsetof(MavlinkStations, refused_unreadable) == 48);
HERO_ASSERT(offsetof(MavlinkStations, refused_unknown) == 56);
HERO_ASSERT(offsetof(MavlinkStations, refused_checksum) == 64);
HERO_ASSERT(offsetof(MavlinkStations, refused_unsigned) == 72);
HERO_ASSERT(offsetof(MavlinkStations, refused_signature) == 80);
HERO_ASSERT(offsetof(MavlinkStations, refused_replayed) == 88);
HERO_ASSERT(offsetof(MavlinkStations, refused_full) == 96);
HERO_ASSERT(offsetof(MavlinkStations, stations) == 104);
HERO_ASSERT(offsetof(MavlinkStations, count) == 1000);
HERO_ASSERT(offsetof(MavlinkStations, vehicle) == 1004);
HERO_ASSERT(offsetof(MavlinkStations, system) == 1008);
HERO_ASSERT(offsetof(MavlinkStations, is_signed) == 1012);
HERO_ASSERT(offsetof(MavlinkStations, datagrams_dropped) == 1016);

#define HERO_OUTLINE_POINT_TYPE_NAME "hero.OutlinePoint.v1"
typedef struct OutlinePoint {
    double latitude_deg;
    double longitude_deg;
    double altitude_m;
} OutlinePoint;
HERO_ASSERT(sizeof(OutlinePoint) == 24);
HERO_ASSERT(offsetof(OutlinePoint, latitude_deg) == 0);
HERO_ASSERT(offsetof(OutlinePoint, longitude_deg) == 8);
HERO_ASSERT(offsetof(OutlinePoint, altitude_m) == 16);

#define HERO_BRIDGE_OUTLINE_TYPE_NAME "hero.BridgeOutline.v1"
typedef struct BridgeOutline {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint64_t number;
    uint32_t piece;
    uint32_t pieces;
    uint32_t kind;
    uint32_t area;
    uint32_t first;
    uint32_t count;
    uint32_t total;
    uint32_t inclusion;
    double floor_m;
    double ceiling_m;
    double radius_m;
    uint32_t floor_valid;
    uint32_t ceiling_valid;
    uint8_t name[64];
    OutlinePoint points[32];
} BridgeOutline;
HERO_ASSERT(sizeof(BridgeOutline) == 928);
HERO_ASSERT(offsetof(BridgeOutline, sequence) == 0);
HERO_ASSERT(offsetof(BridgeOutline, epoch_ns) == 8);
HERO_ASSERT(offsetof(BridgeOutline, published_ns) == 16);
HERO_ASSERT(offsetof(BridgeOutline, number) == 24);
HERO_ASSERT(offsetof(BridgeOutline, piece) == 32);
HERO_ASSERT(offsetof(BridgeOutline, pieces) == 36);
HERO_ASSERT(offsetof(BridgeOutline, kind) == 40);
HERO_ASSERT(offsetof(BridgeOutline, area) == 44);
HERO_ASSERT(offsetof(BridgeOutline, first) == 48);
HERO_ASSERT(offsetof(BridgeOutline, count) == 52);
HERO_ASSERT(offsetof(BridgeOutline, total) == 56);
HERO_ASSERT(offsetof(BridgeOutline, inclusion) == 60);
HERO_ASSERT(offsetof(BridgeOutline, floor_m) == 64);
HERO_ASSERT(offsetof(BridgeOutline, ceiling_m) == 72);
HERO_ASSERT(offsetof(BridgeOutline, radius_m) == 80);
HERO_ASSERT(offsetof(BridgeOutline, floor_valid) == 88);
HERO_ASSERT(offsetof(BridgeOutline, ceiling_valid) == 92);
HERO_ASSERT(offsetof(BridgeOutline, name) == 96);
HERO_ASSERT(offsetof(BridgeOutline, points) == 160);

#define HERO_CONFIGURATION_PIECE_TYPE_NAME "hero.ConfigurationPiece.v1"
typedef struct ConfigurationPiece {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint64_t hash;
    uint32_t revision;
    uint32_t piece;
    uint32_t pieces;
    uint32_t total;
    uint32_t length;
    uint32_t reserved;
    uint8_t data[968];
} ConfigurationPiece;
HERO_ASSERT(sizeof(ConfigurationPiece) == 1024);
HERO_ASSERT(offsetof(ConfigurationPiece, sequence) == 0);
HERO_ASSERT(offsetof(ConfigurationPiece, epoch_ns) == 8);
HERO_ASSERT(offsetof(ConfigurationPiece, published_ns) == 16);
HERO_ASSERT(offsetof(ConfigurationPiece, hash) == 24);
HERO_ASSERT(offsetof(ConfigurationPiece, revision) == 32);
HERO_ASSERT(offsetof(ConfigurationPiece, piece) == 36);
HERO_ASSERT(offsetof(ConfigurationPiece, pieces) == 40);
HERO_ASSERT(offsetof(ConfigurationPiece, total) == 44);
HERO_ASSERT(offsetof(ConfigurationPiece, length) == 48);
HERO_ASSERT(offsetof(ConfigurationPiece, reserved) == 52);
HERO_ASSERT(offsetof(ConfigurationPiece, data) == 56);

#define HERO_BRIDGE_JOURNAL_TYPE_NAME "hero.BridgeJournal.v1"
typedef struct BridgeJournal {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint32_t begins;
    uint32_t length;
    uint32_t beginnings;
    uint32_t reserved;
    uint8_t data[4056];
} BridgeJournal;
HERO_ASSERT(sizeof(BridgeJournal) == 4096);
HERO_ASSERT(offsetof(BridgeJournal, sequence) == 0);
HERO_ASSERT(offsetof(BridgeJournal, epoch_ns) == 8);
HERO_ASSERT(offsetof(BridgeJournal, published_ns) == 16);
HERO_ASSERT(offsetof(BridgeJournal, begins) == 24);
HERO_ASSERT(offsetof(BridgeJournal, length) == 28);
HERO_ASSERT(offsetof(BridgeJournal, beginnings) == 32);
HERO_ASSERT(offsetof(BridgeJournal, reserved) == 36);
HERO_ASSERT(offsetof(BridgeJournal, data) == 40);

#define HERO_STATUS_JOURNAL_TYPE_NAME "hero.StatusJournal.v1"
typedef struct StatusJournal {
    uint64_t sequence;
    uint64_t epoch_ns;
    uint64_t published_ns;
    uint32_t begins;
    uint32_t length;
    uint32_t beginnings;
    uint32_t reserved;
    uint8_t data[984];
} StatusJournal;
HERO_ASSERT(sizeof(StatusJournal) == 1024);
HERO_ASSERT(offsetof(StatusJournal, sequence) == 0);
HERO_ASSERT(offsetof(StatusJournal, epoch_ns) == 8);
HERO_ASSERT(offsetof(StatusJournal, published_ns) == 16);
HERO_ASSERT(offsetof(StatusJournal, begins) == 24);
HERO_ASSERT(offsetof(StatusJournal, length) == 28);
HERO_ASSERT(offsetof(StatusJournal, beginnings) == 32);
HERO_ASSERT(offsetof(StatusJournal, reserved) == 36);
HERO_ASSERT(offsetof(StatusJournal, data) == 40);

#endif
