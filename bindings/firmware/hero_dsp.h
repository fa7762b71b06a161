/* The wire protocol between the HERO's PC and its DSP, for firmware: frames of both profiles, encoded and decoded.
 *
 * C99 for any compiler, with or without an operating system: no memory is allocated, no function of the C library is called, nothing
 * is kept between two calls but what the caller holds. Every loop has a fixed bound; no function calls itself.
 *
 * docs/protocol.md is the contract; numbers in parentheses are its sections. docs/firmware.md says how to use this. To use it, copy
 * hero_dsp.h and hero_dsp.c into the firmware. What stands between the lines `made` and `end of what is made` is made from the tables of
 * the Rust crate `dsp-protocol`, which the PC and the simulator use: do not edit it. */
#ifndef HERO_DSP_H
#define HERO_DSP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A byte of the line, or another small number. On some DSPs, such as TI's C2000, no type is smaller than 16 bits; of a received byte only
 * the low eight may be set there. */
#ifndef HERO_DSP_BYTE
#define HERO_DSP_BYTE uint_least8_t
#endif
typedef HERO_DSP_BYTE hero_dsp_byte;

/* A 16-bit port (6). */
typedef struct {
    uint16_t number;
    bool is_signed; /* the 16 bits are two's complement */
    int32_t min;    /* least and greatest value that may be written */
    int32_t max;
    int32_t boot; /* value at boot */
} hero_dsp_port16;

/* A 32-bit port (6). */
typedef struct {
    uint16_t number;
    float min; /* least and greatest value that may be written */
    float max;
    float boot; /* value at boot */
} hero_dsp_port32;

/* made: crates/dsp-protocol/tests/firmware writes it */
/* Headers (2). The classic header names a message in both profiles. */
#define HERO_DSP_STATUS 0xE9u /* DSP to PC */
#define HERO_DSP_FLOW_CONTROL 0xAAu /* DSP to PC */
#define HERO_DSP_ACK 0xC3u /* DSP to PC, without a value */
#define HERO_DSP_ACK_16 0xCCu /* DSP to PC, with 16 bits */
#define HERO_DSP_ACK_32 0xA5u /* DSP to PC, with 32 bits */
#define HERO_DSP_ERROR 0xE6u /* DSP to PC */
#define HERO_DSP_COMMAND 0xF0u /* PC to DSP */
#define HERO_DSP_WAYPOINT 0x99u /* PC to DSP */
#define HERO_DSP_EXTENDED_DOWNLINK 0xDAu /* DSP to PC, every message of the extended profile */
#define HERO_DSP_EXTENDED_UPLINK 0xB3u /* PC to DSP, every message of the extended profile */

/* The longest frames, in bytes: a status with all groups. */
#define HERO_DSP_MAX_CLASSIC_FRAME_LEN 128u
#define HERO_DSP_MAX_FRAME_LEN 134u

/* Codes of the commands (5.1). */
typedef enum {
    HERO_DSP_READ_16 = 0,
    HERO_DSP_WRITE_16 = 1,
    HERO_DSP_READ_32 = 2,
    HERO_DSP_WRITE_32 = 3,
    HERO_DSP_CLEAR_ERRORS = 4,
    HERO_DSP_ACTIVATE_STATUS = 5,
    HERO_DSP_INVALIDATE_PATH = 6,
    HERO_DSP_FOLLOWING = 7
} hero_dsp_command_code;

/* What bytes gave: a message, or why they were discarded (2, 11). */
typedef enum {
    HERO_DSP_INCOMPLETE = 0,
    HERO_DSP_MESSAGE = 1,
    HERO_DSP_STRAY = 2,
    HERO_DSP_UNKNOWN_HEADER = 3,
    HERO_DSP_TRUNCATED = 4,
    HERO_DSP_CHECKSUM = 5,
    HERO_DSP_PADDING = 6,
    HERO_DSP_VALUE = 7,
    HERO_DSP_UNKNOWN_COMMAND = 8,
    HERO_DSP_OTHER_PROFILE = 9
} hero_dsp_result;

/* Errors that the DSP reports (7). */
typedef enum {
    HERO_DSP_ERROR_SCI_A_RECEIVE_FULL = 1, /* receive queue of sci_a full (interrupt) */
    HERO_DSP_ERROR_SCI_B_RECEIVE_FULL = 2, /* receive queue of sci_b full (interrupt) */
    HERO_DSP_ERROR_SCI_A_READ_EMPTY = 3, /* blocking read of sci_a with an empty queue */
    HERO_DSP_ERROR_SCI_B_READ_EMPTY = 4, /* blocking read of sci_b with an empty queue */
    HERO_DSP_ERROR_SCI_A_WRITE_FULL = 5, /* write to sci_a with a full queue */
    HERO_DSP_ERROR_SCI_B_WRITE_FULL = 6, /* write to sci_b with a full queue */
    HERO_DSP_ERROR_SCI_PORT = 7, /* invalid port when sending by sci */
    HERO_DSP_ERROR_PWM_WRITE = 8, /* PWM output write error (nwords is not 1) */
    HERO_DSP_ERROR_UART_NUMBER = 9, /* invalid uart in read or write */
    HERO_DSP_ERROR_UART_1_RECEIVE_FULL = 10, /* receive queue of uart 1 full */
    HERO_DSP_ERROR_UART_2_RECEIVE_FULL = 11, /* receive queue of uart 2 full */
    HERO_DSP_ERROR_UART_1_FRAMING = 12, /* framing error in uart 1 (interrupt) */
    HERO_DSP_ERROR_UART_2_FRAMING = 13, /* framing error in uart 2 (interrupt) */
    HERO_DSP_ERROR_UART_QUEUE_EMPTY = 14, /* uart queue empty */
    HERO_DSP_ERROR_UART_QUEUE_FULL = 15, /* uart queue full, or a waypoint found the path buffer full */
    HERO_DSP_ERROR_SCHEDULER = 18, /* scheduler: the foreground process ran over 1 s */
    HERO_DSP_ERROR_READ_ROUTINE = 20, /* default read driver routine */
    HERO_DSP_ERROR_WRITE_ROUTINE = 21, /* default write driver routine */
    HERO_DSP_ERROR_INTERRUPT_ROUTINE = 22, /* default interrupt routine */
    HERO_DSP_ERROR_INVALID_COMMAND = 30, /* invalid command */
    HERO_DSP_ERROR_IMU_CHECKSUM = 40, /* IMU checksum */
    HERO_DSP_ERROR_GPS_CRC = 45, /* GPS CRC */
    HERO_DSP_ERROR_GPS_STATE = 46, /* GPS unexpected state */
    HERO_DSP_ERROR_UNKNOWN_HEADER = 100, /* unknown header from the PC */
    HERO_DSP_ERROR_PC_CHECKSUM = 102, /* checksum error from the PC */
    HERO_DSP_ERROR_RADIO_CHECKSUM = 300 /* DDS-10 radio receiver checksum */
} hero_dsp_error;

/* Virtual ports (6). */
#define HERO_DSP_PORT_STATUS_MASK 10000u /* 16 bits */
#define HERO_DSP_PORT_STATUS_PERIOD_MS 10001u /* 16 bits */
#define HERO_DSP_PORT_FLOW_CONTROL_PERIOD_MS 10002u /* 16 bits */
#define HERO_DSP_PORT_WAYPOINT_COUNT 10003u /* 16 bits, read only */
#define HERO_DSP_PORT_PC_TIMEOUT_MS 10004u /* 16 bits */
#define HERO_DSP_PORT_TAKE_OFF 10121u /* 16 bits */
#define HERO_DSP_PORT_LAND 10122u /* 16 bits */
#define HERO_DSP_PORT_TRIM_COLLECTIVE_US 10200u /* 16 bits */
#define HERO_DSP_PORT_TRIM_ROLL_US 10201u /* 16 bits */
#define HERO_DSP_PORT_TRIM_PITCH_US 10202u /* 16 bits */
#define HERO_DSP_PORT_TRIM_TAIL_US 10203u /* 16 bits */
#define HERO_DSP_PORT_TRIM_THROTTLE_US 10204u /* 16 bits */
#define HERO_DSP_PORT_ROTOR_SPEED_RPM 10210u /* 16 bits */
#define HERO_DSP_PORT_CRUISE_SPEED_MPS 20000u /* 32 bits */
#define HERO_DSP_PORT_CLIMB_SPEED_MPS 20001u /* 32 bits */
#define HERO_DSP_PORT_ACCEPTANCE_RADIUS_M 20002u /* 32 bits */
#define HERO_DSP_PORT_POSITION_GAIN 20010u /* 32 bits */
#define HERO_DSP_PORT_VELOCITY_GAIN 20011u /* 32 bits */
#define HERO_DSP_PORT_ATTITUDE_GAIN 20012u /* 32 bits */
#define HERO_DSP_PORT_YAW_GAIN 20013u /* 32 bits */
#define HERO_DSP_PORT_TAKE_OFF_ALTITUDE_M 20121u /* 32 bits */

/* The ports that may be written, ascending: without HERO_DSP_PORT_WAYPOINT_COUNT. */
#define HERO_DSP_PORTS_16 12u
#define HERO_DSP_PORTS_32 8u
extern const hero_dsp_port16 hero_dsp_ports16[HERO_DSP_PORTS_16];
extern const hero_dsp_port32 hero_dsp_ports32[HERO_DSP_PORTS_32];

/* Groups of a status (4.1): bits of its mask. */
#define HERO_DSP_GROUP_TIME 0x0001u
#define HERO_DSP_GROUP_GEOGRAPHIC 0x0002u
#define HERO_DSP_GROUP_XY 0x0004u
#define HERO_DSP_GROUP_GPS_VELOCITY 0x0008u
#define HERO_DSP_GROUP_GPS_QUALITY 0x0010u
#define HERO_DSP_GROUP_ATTITUDE 0x0020u
#define HERO_DSP_GROUP_ACCELERATION 0x0040u
#define HERO_DSP_GROUP_ANGULAR_RATE 0x0080u
#define HERO_DSP_GROUP_PILOT_PWM 0x0100u
#define HERO_DSP_GROUP_SONAR 0x0200u
#define HERO_DSP_GROUP_SUPPLY 0x0400u
#define HERO_DSP_GROUP_PAN_TILT 0x0800u
#define HERO_DSP_GROUP_ROTOR_SPEED 0x1000u
#define HERO_DSP_GROUP_BAROMETER 0x2000u
#define HERO_DSP_GROUP_ACTUATION 0x4000u
#define HERO_DSP_GROUP_REFERENCES 0x8000u
#define HERO_DSP_GROUP_ALL 0xFFFFu

/* The groups as they are on the line, in whole steps: `_deg_e7` counts 1/10000000 deg, `_cdeg` 1/100 deg, `_cmps` cm/s. A comment
 * gives the step and the limits of section 9. */
typedef struct {
    int32_t latitude_deg_e7; /* 1/10000000 deg, -900000000 ... 900000000 */
    int32_t longitude_deg_e7; /* 1/10000000 deg, -1800000000 ... 1800000000 */
    int32_t altitude_mm; /* 1/1000 m, -1000000 ... 20000000 */
} hero_dsp_geographic;

typedef struct {
    int32_t x_mm; /* 1/1000 m, -100000000 ... 100000000 */
    int32_t y_mm; /* 1/1000 m, -100000000 ... 100000000 */
} hero_dsp_xy;

typedef struct {
    uint16_t horizontal_speed_cmps; /* 1/100 m/s, 0 ... 10000 */
    int16_t vertical_speed_cmps; /* 1/100 m/s, -5000 ... 5000 */
    uint16_t heading_cdeg; /* 1/100 deg, 0 ... 36000 */
} hero_dsp_gps_velocity;

typedef struct {
    int16_t pitch_cdeg; /* 1/100 deg, -9000 ... 9000 */
    int16_t roll_cdeg; /* 1/100 deg, -18000 ... 18000 */
    int16_t yaw_cdeg; /* 1/100 deg, -18000 ... 18000 */
} hero_dsp_attitude;

typedef struct {
    int16_t x_cmps2; /* 1/100 m/s2, -16000 ... 16000 */
    int16_t y_cmps2; /* 1/100 m/s2, -16000 ... 16000 */
    int16_t z_cmps2; /* 1/100 m/s2, -16000 ... 16000 */
} hero_dsp_acceleration;

typedef struct {
    int16_t x_mradps; /* 1/1000 1/s, -20000 ... 20000 */
    int16_t y_mradps; /* 1/1000 1/s, -20000 ... 20000 */
    int16_t z_mradps; /* 1/1000 1/s, -20000 ... 20000 */
} hero_dsp_angular_rate;

typedef struct {
    uint16_t collective_us; /* us, 500 ... 2500 */
    uint16_t roll_us; /* us, 500 ... 2500 */
    uint16_t pitch_us; /* us, 500 ... 2500 */
    uint16_t tail_us; /* us, 500 ... 2500 */
    uint16_t throttle_us; /* us, 500 ... 2500 */
} hero_dsp_pilot_pwm;

typedef struct {
    uint16_t battery_mv; /* mV, 0 ... 60000 */
    hero_dsp_byte fuel_percent; /* %, 0 ... 100 */
    hero_dsp_byte auto_switch; /* 0 ... 1 */
} hero_dsp_supply;

typedef struct {
    uint16_t pan_adc; /* 0 ... 4095 */
    uint16_t tilt_adc; /* 0 ... 4095 */
} hero_dsp_pan_tilt;

typedef struct {
    uint16_t collective_us; /* us, 500 ... 2500 */
    uint16_t roll_us; /* us, 500 ... 2500 */
    uint16_t pitch_us; /* us, 500 ... 2500 */
    uint16_t tail_us; /* us, 500 ... 2500 */
    uint16_t throttle_us; /* us, 500 ... 2500 */
} hero_dsp_actuation;

typedef struct {
    int16_t x_speed_cmps; /* 1/100 m/s, -10000 ... 10000 */
    int16_t y_speed_cmps; /* 1/100 m/s, -10000 ... 10000 */
    int32_t altitude_mm; /* 1/1000 m, -1000000 ... 20000000 */
    int16_t pitch_cdeg; /* 1/100 deg, -9000 ... 9000 */
    int16_t roll_cdeg; /* 1/100 deg, -18000 ... 18000 */
    int16_t yaw_cdeg; /* 1/100 deg, -18000 ... 18000 */
} hero_dsp_references;

/* A status: the flying flag, and the groups of its mask. The others are not sent and not changed. */
typedef struct {
    uint16_t mask; /* HERO_DSP_GROUP_... */
    bool flying;
    uint32_t time_ms; /* ms, 0 ... 4294967295 */
    hero_dsp_geographic geographic;
    hero_dsp_xy xy;
    hero_dsp_gps_velocity gps_velocity;
    hero_dsp_byte gps_quality; /* 0 ... 8 */
    hero_dsp_attitude attitude;
    hero_dsp_acceleration acceleration;
    hero_dsp_angular_rate angular_rate;
    hero_dsp_pilot_pwm pilot_pwm;
    uint16_t sonar_adc; /* 0 ... 4095 */
    hero_dsp_supply supply;
    hero_dsp_pan_tilt pan_tilt;
    uint16_t rotor_rpm; /* rpm, 0 ... 4000 */
    uint16_t barometer_adc; /* 0 ... 4095 */
    hero_dsp_actuation actuation;
    hero_dsp_references references;
} hero_dsp_status;
/* end of what is made */

/* What stands around a message on the line. Both ends are configured to speak the same. */
typedef enum {
    HERO_DSP_CLASSIC = 0, /* a header for each message, a sum of seven bits (2) */
    HERO_DSP_EXTENDED = 1 /* one header for each direction, a sequence number, a CRC-32 (11) */
} hero_dsp_profile;

/* A command of the PC (5.1). A decoded one has 0 in the members that its code lacks. */
typedef struct {
    hero_dsp_byte code; /* hero_dsp_command_code */
    uint16_t port;      /* of the four commands that read or write a port */
    uint16_t value16;   /* of HERO_DSP_WRITE_16; a signed port carries two's complement */
    float value32;      /* of HERO_DSP_WRITE_32; any bit pattern, also one that is not a number */
    bool on;            /* of HERO_DSP_FOLLOWING */
} hero_dsp_command;

/* A message of the PC. */
typedef struct {
    hero_dsp_byte header;         /* HERO_DSP_COMMAND or HERO_DSP_WAYPOINT, in both profiles */
    hero_dsp_byte sequence;       /* the message's own number, 0 ... 127; 0 in the classic profile, which has none */
    hero_dsp_command command;     /* of HERO_DSP_COMMAND */
    hero_dsp_geographic waypoint; /* of HERO_DSP_WAYPOINT */
} hero_dsp_uplink;

/* A message of the DSP. The encoder reads only what the header says that it has. */
typedef struct {
    hero_dsp_byte header;       /* HERO_DSP_STATUS, _FLOW_CONTROL, _ACK, _ACK_16, _ACK_32 or _ERROR, in both profiles */
    hero_dsp_byte sequence;     /* the message's own number, 0 ... 127; the classic profile has none */
    hero_dsp_byte acknowledges; /* of the three acknowledgements: the number of the command; the classic profile has none */
    hero_dsp_byte command;      /* of the three acknowledgements: the code of the command, 0 ... 7 */
    uint16_t value16;           /* of HERO_DSP_ACK_16 */
    float value32;              /* of HERO_DSP_ACK_32 */
    bool send;                  /* of HERO_DSP_FLOW_CONTROL: one new waypoint may be sent */
    uint16_t error;             /* of HERO_DSP_ERROR: hero_dsp_error, or any other code */
    hero_dsp_status status;     /* of HERO_DSP_STATUS */
} hero_dsp_downlink;

/* Finds the messages of one direction in a stream of bytes, however it is cut. Its members are its own. */
typedef struct {
    hero_dsp_profile profile;
    hero_dsp_byte buffer[HERO_DSP_MAX_FRAME_LEN]; /* the message that has begun */
    hero_dsp_byte held;                           /* how many bytes of it are there; 0 while no message is open */
    hero_dsp_byte wanted;                         /* how many it takes to know more */
    bool skipping;                                /* bytes up to the next header belong to a rejection that was reported */
} hero_dsp_decoder;

/* Make a decoder that waits for the first header. */
void hero_dsp_decoder_init(hero_dsp_decoder *decoder, hero_dsp_profile profile);

/* Take bytes of the PC from the front of `bytes`, up to the end of the next message or rejection. Returns how many it took, and says in
 * `result` what they gave: HERO_DSP_MESSAGE with the message in `message`, HERO_DSP_INCOMPLETE when all bytes are taken, or why bytes
 * were discarded. Call it again with the rest until it answers HERO_DSP_INCOMPLETE. A rejection may take no byte, but never twice in a
 * row: a header that breaks a message off begins the next one. After anything but HERO_DSP_MESSAGE, `message` is undefined. */
size_t hero_dsp_receive_uplink(hero_dsp_decoder *decoder, const hero_dsp_byte *bytes, size_t len, hero_dsp_uplink *message,
                               hero_dsp_result *result);

/* The same for bytes of the DSP: for another PC, or to test a DSP. */
size_t hero_dsp_receive_downlink(hero_dsp_decoder *decoder, const hero_dsp_byte *bytes, size_t len, hero_dsp_downlink *message,
                                 hero_dsp_result *result);

/* Write a message of the DSP as one frame into `frame`, which has room for HERO_DSP_MAX_FRAME_LEN bytes. Returns its length, or 0 when
 * the DSP has no message with this header. Numbers beyond their type on the wire become the nearest end of that type. */
size_t hero_dsp_encode_downlink(hero_dsp_profile profile, const hero_dsp_downlink *message, hero_dsp_byte *frame);

/* The same for a message of the PC; also 0 for a command whose code is over 7. */
size_t hero_dsp_encode_uplink(hero_dsp_profile profile, const hero_dsp_uplink *message, hero_dsp_byte *frame);

/* The length of the frame of a status with these groups. */
size_t hero_dsp_status_frame_len(hero_dsp_profile profile, uint16_t mask);

/* Which groups of a status hold a value outside the limits of section 9. Groups that it does not carry are not judged. */
uint16_t hero_dsp_implausible_groups(const hero_dsp_status *status);

/* Whether a position or waypoint lies within the limits of section 9. */
bool hero_dsp_is_plausible_place(const hero_dsp_geographic *place);

/* Whether a command of the extended profile is a copy of the last one: its number and its bytes are equal (11). Values that are not a
 * number are compared by their bits. */
bool hero_dsp_is_copy(const hero_dsp_uplink *command, const hero_dsp_uplink *last);

/* The error that the DSP reports for a rejection (5.1), or 0 for none. For HERO_DSP_OTHER_PROFILE it is 100, which does not wait in the
 * queue of errors and is sent at most once a second (11). */
uint16_t hero_dsp_error_of(hero_dsp_result result);

/* The 16-bit port with this number, or NULL. The port HERO_DSP_PORT_WAYPOINT_COUNT can only be read, so it is not in the table. */
const hero_dsp_port16 *hero_dsp_find_port16(uint16_t number);

/* The 32-bit port with this number, or NULL. */
const hero_dsp_port32 *hero_dsp_find_port32(uint16_t number);

/* Whether the 16 bits on the wire are in the port's range. */
bool hero_dsp_port16_accepts(const hero_dsp_port16 *port, uint16_t bits);

/* Whether the value is in the port's range, hence finite. */
bool hero_dsp_port32_accepts(const hero_dsp_port32 *port, float value);

/* Steps of the wire (3): `value` in the unit times the steps of one unit, rounded to the nearest, halves away from zero, at most the
 * ends of the type. What is not a number gives 0; leave such a group out of the status instead. Example: 40.4168123 degrees of latitude
 * are hero_dsp_steps_i32(40.4168123, 10000000). The codec itself uses no floating point. */
uint16_t hero_dsp_steps_u16(double value, uint32_t steps_per_unit);
int16_t hero_dsp_steps_i16(double value, uint32_t steps_per_unit);
int32_t hero_dsp_steps_i32(double value, uint32_t steps_per_unit);

/* The sum of section 2 over bytes 0 ... n-2 of a classic frame. */
hero_dsp_byte hero_dsp_checksum(const hero_dsp_byte *bytes, size_t len);

/* The CRC-32/ISCSI of section 11. Of the ASCII characters 123456789 it is 0xE3069283. */
uint32_t hero_dsp_crc32(const hero_dsp_byte *bytes, size_t len);

#ifdef __cplusplus
}
#endif

#endif
