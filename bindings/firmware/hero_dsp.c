/* See hero_dsp.h. */
#include "hero_dsp.h"

#define DIGIT_MASK 0x7Fu
#define DIGIT_BITS 7u
#define HEADER_BIT 0x80u
#define MAX_COMMAND_CODE 7u
/* Classic: header and checksum. Extended: header, sequence and kind before the payload, five digits of CRC behind it. */
#define CLASSIC_FRONT 1u
#define CLASSIC_OVERHEAD 2u
#define EXTENDED_FRONT 3u
#define CRC_DIGITS 5u
#define EXTENDED_OVERHEAD (EXTENDED_FRONT + CRC_DIGITS)
/* The mask at the front of a status' payload, from which its length follows, and the flags behind it. */
#define MASK_DIGITS 3u
#define MASK_AND_FLAGS_LEN 4u
#define GROUPS 16u

/* ---- values: 7 bits a byte, the most significant first (3) ---- */

typedef struct {
    hero_dsp_byte *bytes;
    size_t len;
} writer;

typedef struct {
    const hero_dsp_byte *bytes;
    size_t at;
    bool has_excess; /* an unused bit was set */
} reader;

static void put_digits(writer *out, uint32_t value, hero_dsp_byte count)
{
    uint32_t rest = value;
    hero_dsp_byte left;
    for (left = count; left > 0u; left--) {
        out->bytes[out->len + left - 1u] = (hero_dsp_byte)(rest & DIGIT_MASK);
        rest >>= DIGIT_BITS;
    }
    out->len += count;
}

static void put_u7(writer *out, hero_dsp_byte value)
{
    put_digits(out, (value > DIGIT_MASK) ? DIGIT_MASK : value, 1u);
}

static void put_u14(writer *out, uint16_t value)
{
    put_digits(out, (value > 0x3FFFu) ? 0x3FFFu : value, 2u);
}

static void put_u16(writer *out, uint16_t value)
{
    put_digits(out, value, 3u);
}

static void put_i16(writer *out, int16_t value)
{
    put_u16(out, (uint16_t)value);
}

static void put_u32(writer *out, uint32_t value)
{
    put_digits(out, value, 5u);
}

static void put_i32(writer *out, int32_t value)
{
    put_u32(out, (uint32_t)value);
}

/* Takes `count` digits whose topmost has `unused` unused bits. What is shifted out of 32 bits are unused bits. */
static uint32_t take_digits(reader *in, hero_dsp_byte count, hero_dsp_byte unused)
{
    uint32_t value = 0u;
    hero_dsp_byte taken;
    if (((uint32_t)in->bytes[in->at] >> (DIGIT_BITS - unused)) != 0u) {
        in->has_excess = true;
    }
    for (taken = 0u; taken < count; taken++) {
        value = (value << DIGIT_BITS) | in->bytes[in->at + taken];
    }
    in->at += count;
    return value;
}

static hero_dsp_byte take_u7(reader *in)
{
    return (hero_dsp_byte)take_digits(in, 1u, 0u);
}

static uint16_t take_u14(reader *in)
{
    return (uint16_t)take_digits(in, 2u, 0u);
}

static uint16_t take_u16(reader *in)
{
    return (uint16_t)(take_digits(in, 3u, 5u) & 0xFFFFu);
}

/* The two's complement without a conversion that C leaves to the compiler. */
static int16_t take_i16(reader *in)
{
    const uint16_t bits = take_u16(in);
    return (bits <= 0x7FFFu) ? (int16_t)bits : (int16_t)((int32_t)bits - 65536);
}

static uint32_t take_u32(reader *in)
{
    return take_digits(in, 5u, 3u);
}

static int32_t take_i32(reader *in)
{
    const uint32_t bits = take_u32(in);
    return (bits <= 0x7FFFFFFFu) ? (int32_t)bits : (-(int32_t)(0xFFFFFFFFu - bits) - 1);
}

/* A `float` and its bit pattern: a union is the one way that C99 defines without a function of its library. */
typedef union {
    float number;
    uint32_t bits;
} float_bits;

static void put_f32(writer *out, float value)
{
    float_bits pattern;
    pattern.number = value;
    put_u32(out, pattern.bits);
}

static float take_f32(reader *in)
{
    float_bits pattern;
    pattern.bits = take_u32(in);
    return pattern.number;
}

/* Halves away from zero; `least` and `greatest` are the ends of the type. */
static double rounded(double value, uint32_t steps_per_unit, double least, double greatest)
{
    const double exact = value * (double)steps_per_unit;
    double steps = 0.0; /* what is not a number compares false with everything */
    if (exact >= greatest) {
        steps = greatest;
    } else if (exact <= least) {
        steps = least;
    } else if ((exact > least) && (exact < greatest)) {
        const double size = (exact < 0.0) ? -exact : exact;
        const int32_t whole = (int32_t)size;
        steps = ((size - (double)whole) >= 0.5) ? ((double)whole + 1.0) : (double)whole;
        steps = (exact < 0.0) ? -steps : steps;
    } else {
        steps = 0.0;
    }
    return steps;
}

uint16_t hero_dsp_steps_u16(double value, uint32_t steps_per_unit)
{
    return (uint16_t)rounded(value, steps_per_unit, 0.0, 65535.0);
}

int16_t hero_dsp_steps_i16(double value, uint32_t steps_per_unit)
{
    return (int16_t)rounded(value, steps_per_unit, -32768.0, 32767.0);
}

int32_t hero_dsp_steps_i32(double value, uint32_t steps_per_unit)
{
    return (int32_t)rounded(value, steps_per_unit, -2147483648.0, 2147483647.0);
}

/* ---- groups, limits, ports ---- */

/* made: crates/dsp-protocol/tests/firmware writes it */
/* Bytes of each group on the line. */
#define TIME_LEN 5u
#define GEOGRAPHIC_LEN 15u
#define XY_LEN 10u
#define GPS_VELOCITY_LEN 9u
#define GPS_QUALITY_LEN 1u
#define ATTITUDE_LEN 9u
#define ACCELERATION_LEN 9u
#define ANGULAR_RATE_LEN 9u
#define PILOT_PWM_LEN 10u
#define SONAR_LEN 2u
#define SUPPLY_LEN 5u
#define PAN_TILT_LEN 4u
#define ROTOR_SPEED_LEN 2u
#define BAROMETER_LEN 2u
#define ACTUATION_LEN 10u
#define REFERENCES_LEN 20u

static const hero_dsp_byte GROUP_LEN[GROUPS] = {
    TIME_LEN,
    GEOGRAPHIC_LEN,
    XY_LEN,
    GPS_VELOCITY_LEN,
    GPS_QUALITY_LEN,
    ATTITUDE_LEN,
    ACCELERATION_LEN,
    ANGULAR_RATE_LEN,
    PILOT_PWM_LEN,
    SONAR_LEN,
    SUPPLY_LEN,
    PAN_TILT_LEN,
    ROTOR_SPEED_LEN,
    BAROMETER_LEN,
    ACTUATION_LEN,
    REFERENCES_LEN,
};

const hero_dsp_port16 hero_dsp_ports16[HERO_DSP_PORTS_16] = {
    {HERO_DSP_PORT_STATUS_MASK, false, 0, 65535, 0},
    {HERO_DSP_PORT_STATUS_PERIOD_MS, false, 1, 10000, 20},
    {HERO_DSP_PORT_FLOW_CONTROL_PERIOD_MS, false, 10, 1000, 100},
    {HERO_DSP_PORT_PC_TIMEOUT_MS, false, 0, 60000, 0},
    {HERO_DSP_PORT_TAKE_OFF, false, 1, 1, 0},
    {HERO_DSP_PORT_LAND, false, 1, 1, 0},
    {HERO_DSP_PORT_TRIM_COLLECTIVE_US, true, -500, 500, 0},
    {HERO_DSP_PORT_TRIM_ROLL_US, true, -500, 500, 0},
    {HERO_DSP_PORT_TRIM_PITCH_US, true, -500, 500, 0},
    {HERO_DSP_PORT_TRIM_TAIL_US, true, -500, 500, 0},
    {HERO_DSP_PORT_TRIM_THROTTLE_US, true, -500, 500, 0},
    {HERO_DSP_PORT_ROTOR_SPEED_RPM, false, 500, 3000, 1500},
};

const hero_dsp_port32 hero_dsp_ports32[HERO_DSP_PORTS_32] = {
    {HERO_DSP_PORT_CRUISE_SPEED_MPS, 0.1f, 20.0f, 5.0f},
    {HERO_DSP_PORT_CLIMB_SPEED_MPS, 0.1f, 5.0f, 2.0f},
    {HERO_DSP_PORT_ACCEPTANCE_RADIUS_M, 0.1f, 50.0f, 0.5f},
    {HERO_DSP_PORT_POSITION_GAIN, 0.05f, 5.0f, 0.8f},
    {HERO_DSP_PORT_VELOCITY_GAIN, 0.05f, 10.0f, 2.0f},
    {HERO_DSP_PORT_ATTITUDE_GAIN, 0.5f, 20.0f, 6.0f},
    {HERO_DSP_PORT_YAW_GAIN, 0.05f, 10.0f, 1.5f},
    {HERO_DSP_PORT_TAKE_OFF_ALTITUDE_M, 0.5f, 200.0f, 10.0f},
};

static void write_geographic(writer *out, const hero_dsp_geographic *group)
{
    put_i32(out, group->latitude_deg_e7);
    put_i32(out, group->longitude_deg_e7);
    put_i32(out, group->altitude_mm);
}

static void read_geographic(reader *in, hero_dsp_geographic *group)
{
    group->latitude_deg_e7 = take_i32(in);
    group->longitude_deg_e7 = take_i32(in);
    group->altitude_mm = take_i32(in);
}

static bool is_plausible_geographic(const hero_dsp_geographic *group)
{
    return (group->latitude_deg_e7 >= -900000000) &&
           (group->latitude_deg_e7 <= 900000000) &&
           (group->longitude_deg_e7 >= -1800000000) &&
           (group->longitude_deg_e7 <= 1800000000) &&
           (group->altitude_mm >= -1000000) &&
           (group->altitude_mm <= 20000000);
}

static void write_xy(writer *out, const hero_dsp_xy *group)
{
    put_i32(out, group->x_mm);
    put_i32(out, group->y_mm);
}

static void read_xy(reader *in, hero_dsp_xy *group)
{
    group->x_mm = take_i32(in);
    group->y_mm = take_i32(in);
}

static bool is_plausible_xy(const hero_dsp_xy *group)
{
    return (group->x_mm >= -100000000) &&
           (group->x_mm <= 100000000) &&
           (group->y_mm >= -100000000) &&
           (group->y_mm <= 100000000);
}

static void write_gps_velocity(writer *out, const hero_dsp_gps_velocity *group)
{
    put_u16(out, group->horizontal_speed_cmps);
    put_i16(out, group->vertical_speed_cmps);
    put_u16(out, group->heading_cdeg);
}

static void read_gps_velocity(reader *in, hero_dsp_gps_velocity *group)
{
    group->horizontal_speed_cmps = take_u16(in);
    group->vertical_speed_cmps = take_i16(in);
    group->heading_cdeg = take_u16(in);
}

static bool is_plausible_gps_velocity(const hero_dsp_gps_velocity *group)
{
    return (group->horizontal_speed_cmps <= 10000u) &&
           (group->vertical_speed_cmps >= -5000) &&
           (group->vertical_speed_cmps <= 5000) &&
           (group->heading_cdeg <= 36000u);
}

static void write_attitude(writer *out, const hero_dsp_attitude *group)
{
    put_i16(out, group->pitch_cdeg);
    put_i16(out, group->roll_cdeg);
    put_i16(out, group->yaw_cdeg);
}

static void read_attitude(reader *in, hero_dsp_attitude *group)
{
    group->pitch_cdeg = take_i16(in);
    group->roll_cdeg = take_i16(in);
    group->yaw_cdeg = take_i16(in);
}

static bool is_plausible_attitude(const hero_dsp_attitude *group)
{
    return (group->pitch_cdeg >= -9000) &&
           (group->pitch_cdeg <= 9000) &&
           (group->roll_cdeg >= -18000) &&
           (group->roll_cdeg <= 18000) &&
           (group->yaw_cdeg >= -18000) &&
           (group->yaw_cdeg <= 18000);
}

static void write_acceleration(writer *out, const hero_dsp_acceleration *group)
{
    put_i16(out, group->x_cmps2);
    put_i16(out, group->y_cmps2);
    put_i16(out, group->z_cmps2);
}

static void read_acceleration(reader *in, hero_dsp_acceleration *group)
{
    group->x_cmps2 = take_i16(in);
    group->y_cmps2 = take_i16(in);
    group->z_cmps2 = take_i16(in);
}

static bool is_plausible_acceleration(const hero_dsp_acceleration *group)
{
    return (group->x_cmps2 >= -16000) &&
           (group->x_cmps2 <= 16000) &&
           (group->y_cmps2 >= -16000) &&
           (group->y_cmps2 <= 16000) &&
           (group->z_cmps2 >= -16000) &&
           (group->z_cmps2 <= 16000);
}

static void write_angular_rate(writer *out, const hero_dsp_angular_rate *group)
{
    put_i16(out, group->x_mradps);
    put_i16(out, group->y_mradps);
    put_i16(out, group->z_mradps);
}

static void read_angular_rate(reader *in, hero_dsp_angular_rate *group)
{
    group->x_mradps = take_i16(in);
    group->y_mradps = take_i16(in);
    group->z_mradps = take_i16(in);
}

static bool is_plausible_angular_rate(const hero_dsp_angular_rate *group)
{
    return (group->x_mradps >= -20000) &&
           (group->x_mradps <= 20000) &&
           (group->y_mradps >= -20000) &&
           (group->y_mradps <= 20000) &&
           (group->z_mradps >= -20000) &&
           (group->z_mradps <= 20000);
}

static void write_pilot_pwm(writer *out, const hero_dsp_pilot_pwm *group)
{
    put_u14(out, group->collective_us);
    put_u14(out, group->roll_us);
    put_u14(out, group->pitch_us);
    put_u14(out, group->tail_us);
    put_u14(out, group->throttle_us);
}

static void read_pilot_pwm(reader *in, hero_dsp_pilot_pwm *group)
{
    group->collective_us = take_u14(in);
    group->roll_us = take_u14(in);
    group->pitch_us = take_u14(in);
    group->tail_us = take_u14(in);
    group->throttle_us = take_u14(in);
}

static bool is_plausible_pilot_pwm(const hero_dsp_pilot_pwm *group)
{
    return (group->collective_us >= 500u) &&
           (group->collective_us <= 2500u) &&
           (group->roll_us >= 500u) &&
           (group->roll_us <= 2500u) &&
           (group->pitch_us >= 500u) &&
           (group->pitch_us <= 2500u) &&
           (group->tail_us >= 500u) &&
           (group->tail_us <= 2500u) &&
           (group->throttle_us >= 500u) &&
           (group->throttle_us <= 2500u);
}

static void write_supply(writer *out, const hero_dsp_supply *group)
{
    put_u16(out, group->battery_mv);
    put_u7(out, group->fuel_percent);
    put_u7(out, group->auto_switch);
}

static void read_supply(reader *in, hero_dsp_supply *group)
{
    group->battery_mv = take_u16(in);
    group->fuel_percent = take_u7(in);
    group->auto_switch = take_u7(in);
}

static bool is_plausible_supply(const hero_dsp_supply *group)
{
    return (group->battery_mv <= 60000u) &&
           (group->fuel_percent <= 100u) &&
           (group->auto_switch <= 1u);
}

static void write_pan_tilt(writer *out, const hero_dsp_pan_tilt *group)
{
    put_u14(out, group->pan_adc);
    put_u14(out, group->tilt_adc);
}

static void read_pan_tilt(reader *in, hero_dsp_pan_tilt *group)
{
    group->pan_adc = take_u14(in);
    group->tilt_adc = take_u14(in);
}

static bool is_plausible_pan_tilt(const hero_dsp_pan_tilt *group)
{
    return (group->pan_adc <= 4095u) &&
           (group->tilt_adc <= 4095u);
}

static void write_actuation(writer *out, const hero_dsp_actuation *group)
{
    put_u14(out, group->collective_us);
    put_u14(out, group->roll_us);
    put_u14(out, group->pitch_us);
    put_u14(out, group->tail_us);
    put_u14(out, group->throttle_us);
}

static void read_actuation(reader *in, hero_dsp_actuation *group)
{
    group->collective_us = take_u14(in);
    group->roll_us = take_u14(in);
    group->pitch_us = take_u14(in);
    group->tail_us = take_u14(in);
    group->throttle_us = take_u14(in);
}

static bool is_plausible_actuation(const hero_dsp_actuation *group)
{
    return (group->collective_us >= 500u) &&
           (group->collective_us <= 2500u) &&
           (group->roll_us >= 500u) &&
           (group->roll_us <= 2500u) &&
           (group->pitch_us >= 500u) &&
           (group->pitch_us <= 2500u) &&
           (group->tail_us >= 500u) &&
           (group->tail_us <= 2500u) &&
           (group->throttle_us >= 500u) &&
           (group->throttle_us <= 2500u);
}

static void write_references(writer *out, const hero_dsp_references *group)
{
    put_i16(out, group->x_speed_cmps);
    put_i16(out, group->y_speed_cmps);
    put_i32(out, group->altitude_mm);
    put_i16(out, group->pitch_cdeg);
    put_i16(out, group->roll_cdeg);
    put_i16(out, group->yaw_cdeg);
}

static void read_references(reader *in, hero_dsp_references *group)
{
    group->x_speed_cmps = take_i16(in);
    group->y_speed_cmps = take_i16(in);
    group->altitude_mm = take_i32(in);
    group->pitch_cdeg = take_i16(in);
    group->roll_cdeg = take_i16(in);
    group->yaw_cdeg = take_i16(in);
}

static bool is_plausible_references(const hero_dsp_references *group)
{
    return (group->x_speed_cmps >= -10000) &&
           (group->x_speed_cmps <= 10000) &&
           (group->y_speed_cmps >= -10000) &&
           (group->y_speed_cmps <= 10000) &&
           (group->altitude_mm >= -1000000) &&
           (group->altitude_mm <= 20000000) &&
           (group->pitch_cdeg >= -9000) &&
           (group->pitch_cdeg <= 9000) &&
           (group->roll_cdeg >= -18000) &&
           (group->roll_cdeg <= 18000) &&
           (group->yaw_cdeg >= -18000) &&
           (group->yaw_cdeg <= 18000);
}

static void write_groups(writer *out, const hero_dsp_status *status)
{
    if ((status->mask & HERO_DSP_GROUP_TIME) != 0u) {
        put_u32(out, status->time_ms);
    }
    if ((status->mask & HERO_DSP_GROUP_GEOGRAPHIC) != 0u) {
        write_geographic(out, &status->geographic);
    }
    if ((status->mask & HERO_DSP_GROUP_XY) != 0u) {
        write_xy(out, &status->xy);
    }
    if ((status->mask & HERO_DSP_GROUP_GPS_VELOCITY) != 0u) {
        write_gps_velocity(out, &status->gps_velocity);
    }
    if ((status->mask & HERO_DSP_GROUP_GPS_QUALITY) != 0u) {
        put_u7(out, status->gps_quality);
    }
    if ((status->mask & HERO_DSP_GROUP_ATTITUDE) != 0u) {
        write_attitude(out, &status->attitude);
    }
    if ((status->mask & HERO_DSP_GROUP_ACCELERATION) != 0u) {
        write_acceleration(out, &status->acceleration);
    }
    if ((status->mask & HERO_DSP_GROUP_ANGULAR_RATE) != 0u) {
        write_angular_rate(out, &status->angular_rate);
    }
    if ((status->mask & HERO_DSP_GROUP_PILOT_PWM) != 0u) {
        write_pilot_pwm(out, &status->pilot_pwm);
    }
    if ((status->mask & HERO_DSP_GROUP_SONAR) != 0u) {
        put_u14(out, status->sonar_adc);
    }
    if ((status->mask & HERO_DSP_GROUP_SUPPLY) != 0u) {
        write_supply(out, &status->supply);
    }
    if ((status->mask & HERO_DSP_GROUP_PAN_TILT) != 0u) {
        write_pan_tilt(out, &status->pan_tilt);
    }
    if ((status->mask & HERO_DSP_GROUP_ROTOR_SPEED) != 0u) {
        put_u14(out, status->rotor_rpm);
    }
    if ((status->mask & HERO_DSP_GROUP_BAROMETER) != 0u) {
        put_u14(out, status->barometer_adc);
    }
    if ((status->mask & HERO_DSP_GROUP_ACTUATION) != 0u) {
        write_actuation(out, &status->actuation);
    }
    if ((status->mask & HERO_DSP_GROUP_REFERENCES) != 0u) {
        write_references(out, &status->references);
    }
}

static void read_groups(reader *in, hero_dsp_status *status)
{
    if ((status->mask & HERO_DSP_GROUP_TIME) != 0u) {
        status->time_ms = take_u32(in);
    }
    if ((status->mask & HERO_DSP_GROUP_GEOGRAPHIC) != 0u) {
        read_geographic(in, &status->geographic);
    }
    if ((status->mask & HERO_DSP_GROUP_XY) != 0u) {
        read_xy(in, &status->xy);
    }
    if ((status->mask & HERO_DSP_GROUP_GPS_VELOCITY) != 0u) {
        read_gps_velocity(in, &status->gps_velocity);
    }
    if ((status->mask & HERO_DSP_GROUP_GPS_QUALITY) != 0u) {
        status->gps_quality = take_u7(in);
    }
    if ((status->mask & HERO_DSP_GROUP_ATTITUDE) != 0u) {
        read_attitude(in, &status->attitude);
    }
    if ((status->mask & HERO_DSP_GROUP_ACCELERATION) != 0u) {
        read_acceleration(in, &status->acceleration);
    }
    if ((status->mask & HERO_DSP_GROUP_ANGULAR_RATE) != 0u) {
        read_angular_rate(in, &status->angular_rate);
    }
    if ((status->mask & HERO_DSP_GROUP_PILOT_PWM) != 0u) {
        read_pilot_pwm(in, &status->pilot_pwm);
    }
    if ((status->mask & HERO_DSP_GROUP_SONAR) != 0u) {
        status->sonar_adc = take_u14(in);
    }
    if ((status->mask & HERO_DSP_GROUP_SUPPLY) != 0u) {
        read_supply(in, &status->supply);
    }
    if ((status->mask & HERO_DSP_GROUP_PAN_TILT) != 0u) {
        read_pan_tilt(in, &status->pan_tilt);
    }
    if ((status->mask & HERO_DSP_GROUP_ROTOR_SPEED) != 0u) {
        status->rotor_rpm = take_u14(in);
    }
    if ((status->mask & HERO_DSP_GROUP_BAROMETER) != 0u) {
        status->barometer_adc = take_u14(in);
    }
    if ((status->mask & HERO_DSP_GROUP_ACTUATION) != 0u) {
        read_actuation(in, &status->actuation);
    }
    if ((status->mask & HERO_DSP_GROUP_REFERENCES) != 0u) {
        read_references(in, &status->references);
    }
}

uint16_t hero_dsp_implausible_groups(const hero_dsp_status *status)
{
    uint32_t implausible = 0u;
    if ((status->mask & HERO_DSP_GROUP_GEOGRAPHIC) != 0u) {
        implausible |= (is_plausible_geographic(&status->geographic)) ? 0u : HERO_DSP_GROUP_GEOGRAPHIC;
    }
    if ((status->mask & HERO_DSP_GROUP_XY) != 0u) {
        implausible |= (is_plausible_xy(&status->xy)) ? 0u : HERO_DSP_GROUP_XY;
    }
    if ((status->mask & HERO_DSP_GROUP_GPS_VELOCITY) != 0u) {
        implausible |= (is_plausible_gps_velocity(&status->gps_velocity)) ? 0u : HERO_DSP_GROUP_GPS_VELOCITY;
    }
    if ((status->mask & HERO_DSP_GROUP_GPS_QUALITY) != 0u) {
        implausible |= ((status->gps_quality <= 8u)) ? 0u : HERO_DSP_GROUP_GPS_QUALITY;
    }
    if ((status->mask & HERO_DSP_GROUP_ATTITUDE) != 0u) {
        implausible |= (is_plausible_attitude(&status->attitude)) ? 0u : HERO_DSP_GROUP_ATTITUDE;
    }
    if ((status->mask & HERO_DSP_GROUP_ACCELERATION) != 0u) {
        implausible |= (is_plausible_acceleration(&status->acceleration)) ? 0u : HERO_DSP_GROUP_ACCELERATION;
    }
    if ((status->mask & HERO_DSP_GROUP_ANGULAR_RATE) != 0u) {
        implausible |= (is_plausible_angular_rate(&status->angular_rate)) ? 0u : HERO_DSP_GROUP_ANGULAR_RATE;
    }
    if ((status->mask & HERO_DSP_GROUP_PILOT_PWM) != 0u) {
        implausible |= (is_plausible_pilot_pwm(&status->pilot_pwm)) ? 0u : HERO_DSP_GROUP_PILOT_PWM;
    }
    if ((status->mask & HERO_DSP_GROUP_SONAR) != 0u) {
        implausible |= ((status->sonar_adc <= 4095u)) ? 0u : HERO_DSP_GROUP_SONAR;
    }
    if ((status->mask & HERO_DSP_GROUP_SUPPLY) != 0u) {
        implausible |= (is_plausible_supply(&status->supply)) ? 0u : HERO_DSP_GROUP_SUPPLY;
    }
    if ((status->mask & HERO_DSP_GROUP_PAN_TILT) != 0u) {
        implausible |= (is_plausible_pan_tilt(&status->pan_tilt)) ? 0u : HERO_DSP_GROUP_PAN_TILT;
    }
    if ((status->mask & HERO_DSP_GROUP_ROTOR_SPEED) != 0u) {
        implausible |= ((status->rotor_rpm <= 4000u)) ? 0u : HERO_DSP_GROUP_ROTOR_SPEED;
    }
    if ((status->mask & HERO_DSP_GROUP_BAROMETER) != 0u) {
        implausible |= ((status->barometer_adc <= 4095u)) ? 0u : HERO_DSP_GROUP_BAROMETER;
    }
    if ((status->mask & HERO_DSP_GROUP_ACTUATION) != 0u) {
        implausible |= (is_plausible_actuation(&status->actuation)) ? 0u : HERO_DSP_GROUP_ACTUATION;
    }
    if ((status->mask & HERO_DSP_GROUP_REFERENCES) != 0u) {
        implausible |= (is_plausible_references(&status->references)) ? 0u : HERO_DSP_GROUP_REFERENCES;
    }
    return (uint16_t)implausible;
}
/* end of what is made */

static size_t status_payload_len(uint16_t mask)
{
    size_t len = MASK_AND_FLAGS_LEN;
    hero_dsp_byte group;
    for (group = 0u; group < GROUPS; group++) {
        if ((((uint32_t)mask >> group) & 1u) != 0u) {
            len += GROUP_LEN[group];
        }
    }
    return len;
}

size_t hero_dsp_status_frame_len(hero_dsp_profile profile, uint16_t mask)
{
    const size_t overhead = (profile == HERO_DSP_EXTENDED) ? EXTENDED_OVERHEAD : CLASSIC_OVERHEAD;
    return status_payload_len(mask) + overhead;
}

bool hero_dsp_is_plausible_place(const hero_dsp_geographic *place)
{
    return is_plausible_geographic(place);
}

bool hero_dsp_is_copy(const hero_dsp_uplink *command, const hero_dsp_uplink *last)
{
    float_bits value;
    float_bits last_value;
    value.number = command->command.value32;
    last_value.number = last->command.value32;
    return (command->header == last->header) && (command->sequence == last->sequence) &&
           (command->command.code == last->command.code) && (command->command.port == last->command.port) &&
           (command->command.value16 == last->command.value16) && (value.bits == last_value.bits) &&
           (command->command.on == last->command.on);
}

uint16_t hero_dsp_error_of(hero_dsp_result result)
{
    uint16_t error = 0u;
    switch (result) {
    case HERO_DSP_UNKNOWN_HEADER:
    case HERO_DSP_OTHER_PROFILE:
        error = HERO_DSP_ERROR_UNKNOWN_HEADER;
        break;
    case HERO_DSP_CHECKSUM:
        error = HERO_DSP_ERROR_PC_CHECKSUM;
        break;
    case HERO_DSP_PADDING:
    case HERO_DSP_VALUE:
    case HERO_DSP_UNKNOWN_COMMAND:
        error = HERO_DSP_ERROR_INVALID_COMMAND;
        break;
    default:
        error = 0u;
        break;
    }
    return error;
}

const hero_dsp_port16 *hero_dsp_find_port16(uint16_t number)
{
    const hero_dsp_port16 *found = NULL;
    size_t at;
    for (at = 0u; at < HERO_DSP_PORTS_16; at++) {
        if (hero_dsp_ports16[at].number == number) {
            found = &hero_dsp_ports16[at];
        }
    }
    return found;
}

const hero_dsp_port32 *hero_dsp_find_port32(uint16_t number)
{
    const hero_dsp_port32 *found = NULL;
    size_t at;
    for (at = 0u; at < HERO_DSP_PORTS_32; at++) {
        if (hero_dsp_ports32[at].number == number) {
            found = &hero_dsp_ports32[at];
        }
    }
    return found;
}

bool hero_dsp_port16_accepts(const hero_dsp_port16 *port, uint16_t bits)
{
    int32_t value = (int32_t)bits;
    if (port->is_signed && (bits > 0x7FFFu)) {
        value -= 65536;
    }
    return (value >= port->min) && (value <= port->max);
}

bool hero_dsp_port32_accepts(const hero_dsp_port32 *port, float value)
{
    return (value >= port->min) && (value <= port->max);
}

/* ---- checks at the end of a frame ---- */

hero_dsp_byte hero_dsp_checksum(const hero_dsp_byte *bytes, size_t len)
{
    uint32_t sum = 0u;
    size_t at;
    for (at = 0u; at < len; at++) {
        sum += bytes[at];
    }
    return (hero_dsp_byte)(sum & DIGIT_MASK);
}

uint32_t hero_dsp_crc32(const hero_dsp_byte *bytes, size_t len)
{
    /* Four bits at a time: the polynomial 0x1EDC6F41, reflected. */
    static const uint32_t STEPS[16] = {
        0x00000000u, 0x105EC76Fu, 0x20BD8EDEu, 0x30E349B1u, 0x417B1DBCu, 0x5125DAD3u, 0x61C69362u, 0x7198540Du,
        0x82F63B78u, 0x92A8FC17u, 0xA24BB5A6u, 0xB21572C9u, 0xC38D26C4u, 0xD3D3E1ABu, 0xE330A81Au, 0xF36E6F75u,
    };
    uint32_t crc = 0xFFFFFFFFu;
    size_t at;
    for (at = 0u; at < len; at++) {
        crc ^= bytes[at];
        crc = (crc >> 4) ^ STEPS[crc & 0xFu];
        crc = (crc >> 4) ^ STEPS[crc & 0xFu];
    }
    return crc ^ 0xFFFFFFFFu;
}

/* ---- what a frame is ---- */

typedef enum { UPLINK, DOWNLINK } direction;

/* What the first bytes of a frame or payload show of its length. */
typedef struct {
    hero_dsp_result why; /* HERO_DSP_INCOMPLETE, or why no message begins like this */
    bool is_exact;       /* else more is known once `len` bytes are there */
    size_t len;
} length;

static bool is_acknowledgement(hero_dsp_byte header)
{
    return (header == HERO_DSP_ACK) || (header == HERO_DSP_ACK_16) || (header == HERO_DSP_ACK_32);
}

static size_t command_payload_len(hero_dsp_byte code)
{
    static const hero_dsp_byte LENGTHS[MAX_COMMAND_CODE + 1u] = {4u, 7u, 4u, 9u, 1u, 1u, 1u, 2u};
    return LENGTHS[code];
}

static length exactly(size_t len)
{
    length found;
    found.why = HERO_DSP_INCOMPLETE;
    found.is_exact = true;
    found.len = len;
    return found;
}

static length at_least(size_t len)
{
    length found = exactly(len);
    found.is_exact = false;
    return found;
}

static length unknown(hero_dsp_result why)
{
    length found = exactly(0u);
    found.why = why;
    return found;
}

/* The length of the payload of the message with the classic `header`, of which `held` bytes are there. */
static length payload_len(direction of, hero_dsp_byte header, const hero_dsp_byte *payload, size_t held)
{
    length found = unknown(HERO_DSP_UNKNOWN_HEADER);
    if (of == UPLINK) {
        if (header == HERO_DSP_WAYPOINT) {
            found = exactly(GEOGRAPHIC_LEN);
        } else if (header == HERO_DSP_COMMAND) {
            if (held == 0u) {
                found = at_least(1u);
            } else if (payload[0] > MAX_COMMAND_CODE) {
                found = unknown(HERO_DSP_UNKNOWN_COMMAND);
            } else {
                found = exactly(command_payload_len(payload[0]));
            }
        } else {
            found = unknown(HERO_DSP_UNKNOWN_HEADER);
        }
    } else {
        switch (header) {
        case HERO_DSP_STATUS:
            if (held < MASK_DIGITS) {
                found = at_least(MASK_DIGITS);
            } else {
                /* Unused bits of the mask are judged after the checksum. */
                const uint32_t mask =
                    ((uint32_t)payload[0] << 14) | ((uint32_t)payload[1] << 7) | (uint32_t)payload[2];
                found = exactly(status_payload_len((uint16_t)(mask & 0xFFFFu)));
            }
            break;
        case HERO_DSP_FLOW_CONTROL:
        case HERO_DSP_ACK:
            found = exactly(1u);
            break;
        case HERO_DSP_ERROR:
            found = exactly(3u);
            break;
        case HERO_DSP_ACK_16:
            found = exactly(4u);
            break;
        case HERO_DSP_ACK_32:
            found = exactly(6u);
            break;
        default:
            found = unknown(HERO_DSP_UNKNOWN_HEADER);
            break;
        }
    }
    return found;
}

/* The length of the frame of which the decoder holds the first bytes, at least the header. */
static length frame_len(const hero_dsp_decoder *decoder, direction of)
{
    const hero_dsp_byte extended_header = (of == UPLINK) ? HERO_DSP_EXTENDED_UPLINK : HERO_DSP_EXTENDED_DOWNLINK;
    const hero_dsp_byte *bytes = decoder->buffer;
    length found;
    if (decoder->profile == HERO_DSP_CLASSIC) {
        if (bytes[0] == extended_header) {
            found = unknown(HERO_DSP_OTHER_PROFILE);
        } else {
            found = payload_len(of, bytes[0], &bytes[CLASSIC_FRONT], (size_t)decoder->held - CLASSIC_FRONT);
            found.len += found.is_exact ? CLASSIC_OVERHEAD : CLASSIC_FRONT;
        }
    } else if (bytes[0] != extended_header) {
        found = payload_len(of, bytes[0], &bytes[0], 0u);
        if (found.why == HERO_DSP_INCOMPLETE) {
            found = unknown(HERO_DSP_OTHER_PROFILE);
        }
    } else if (decoder->held < EXTENDED_FRONT) {
        found = at_least(EXTENDED_FRONT);
    } else {
        const hero_dsp_byte header = (hero_dsp_byte)(bytes[2] | HEADER_BIT);
        found = payload_len(of, header, &bytes[EXTENDED_FRONT], (size_t)decoder->held - EXTENDED_FRONT);
        found.len += found.is_exact ? EXTENDED_OVERHEAD : EXTENDED_FRONT;
        if (found.is_exact && is_acknowledgement(header)) {
            found.len += 1u; /* the number of the command */
        }
    }
    return found;
}

static bool is_sound(const hero_dsp_decoder *decoder)
{
    const hero_dsp_byte *bytes = decoder->buffer;
    bool sound;
    if (decoder->profile == HERO_DSP_CLASSIC) {
        const size_t summed = (size_t)decoder->held - 1u;
        sound = (bytes[summed] == hero_dsp_checksum(bytes, summed));
    } else {
        hero_dsp_byte digits[CRC_DIGITS];
        writer expected;
        const size_t summed = (size_t)decoder->held - CRC_DIGITS;
        hero_dsp_byte at;
        expected.bytes = digits;
        expected.len = 0u;
        put_u32(&expected, hero_dsp_crc32(bytes, summed));
        sound = true;
        for (at = 0u; at < CRC_DIGITS; at++) {
            sound = sound && (bytes[summed + at] == digits[at]);
        }
    }
    return sound;
}

/* Looks at the bytes of the message that has begun: whether they can be one, and whether they are whole. */
static hero_dsp_result look(hero_dsp_decoder *decoder, direction of)
{
    const length found = frame_len(decoder, of);
    hero_dsp_result result = found.why;
    if (found.why != HERO_DSP_INCOMPLETE) {
        decoder->skipping = true;
        decoder->held = 0u;
    } else if (found.is_exact && (found.len <= (size_t)decoder->held)) {
        result = is_sound(decoder) ? HERO_DSP_MESSAGE : HERO_DSP_CHECKSUM;
        decoder->held = 0u;
    } else {
        decoder->wanted = (hero_dsp_byte)found.len;
    }
    return result;
}

void hero_dsp_decoder_init(hero_dsp_decoder *decoder, hero_dsp_profile profile)
{
    decoder->profile = profile;
    decoder->held = 0u;
    decoder->wanted = 0u;
    decoder->skipping = false;
}

/* HERO_DSP_MESSAGE leaves a whole frame with a right check in the decoder's buffer. */
static size_t next_frame(hero_dsp_decoder *decoder, direction of, const hero_dsp_byte *bytes, size_t len, hero_dsp_result *result)
{
    size_t taken = 0u;
    hero_dsp_result found = HERO_DSP_INCOMPLETE;
    while ((taken < len) && (found == HERO_DSP_INCOMPLETE)) {
        const hero_dsp_byte byte = bytes[taken];
        const bool is_header = (byte & HEADER_BIT) != 0u;
        if (is_header && (decoder->held > 0u)) {
            /* The next call begins with it. */
            decoder->held = 0u;
            found = HERO_DSP_TRUNCATED;
        } else if (is_header) {
            decoder->skipping = false;
            decoder->buffer[0] = byte;
            decoder->held = 1u;
            taken++;
            found = look(decoder, of);
        } else if (decoder->held > 0u) {
            decoder->buffer[decoder->held] = byte;
            decoder->held++;
            taken++;
            if (decoder->held >= decoder->wanted) {
                found = look(decoder, of);
            }
        } else {
            if (!decoder->skipping) {
                decoder->skipping = true;
                found = HERO_DSP_STRAY;
            }
            taken++;
        }
    }
    *result = found;
    return taken;
}

/* ---- messages ---- */

/* The numbers of a frame of the extended profile, its classic header, and a reader at its payload. */
static hero_dsp_byte open_frame(const hero_dsp_decoder *decoder, reader *in, hero_dsp_byte *sequence)
{
    const hero_dsp_byte *bytes = decoder->buffer;
    hero_dsp_byte header = bytes[0];
    *sequence = 0u;
    in->bytes = bytes;
    in->has_excess = false;
    in->at = CLASSIC_FRONT;
    if (decoder->profile == HERO_DSP_EXTENDED) {
        *sequence = bytes[1];
        header = (hero_dsp_byte)(bytes[2] | HEADER_BIT);
        in->at = EXTENDED_FRONT;
    }
    return header;
}

/* Padding is judged before values. */
static hero_dsp_result judged(const reader *in, bool has_possible_values)
{
    hero_dsp_result result = HERO_DSP_MESSAGE;
    if (in->has_excess) {
        result = HERO_DSP_PADDING;
    } else if (!has_possible_values) {
        result = HERO_DSP_VALUE;
    } else {
        result = HERO_DSP_MESSAGE;
    }
    return result;
}

static bool read_command(reader *in, hero_dsp_command *command)
{
    bool is_possible = true;
    command->code = take_u7(in);
    command->port = 0u;
    command->value16 = 0u;
    command->value32 = 0.0f;
    command->on = false;
    if (command->code <= (hero_dsp_byte)HERO_DSP_WRITE_32) {
        command->port = take_u16(in);
    }
    if (command->code == (hero_dsp_byte)HERO_DSP_WRITE_16) {
        command->value16 = take_u16(in);
    } else if (command->code == (hero_dsp_byte)HERO_DSP_WRITE_32) {
        command->value32 = take_f32(in);
    } else if (command->code == (hero_dsp_byte)HERO_DSP_FOLLOWING) {
        const hero_dsp_byte on = take_u7(in);
        command->on = (on == 1u);
        is_possible = (on <= 1u);
    } else {
        /* The others have no value. */
    }
    return is_possible;
}

size_t hero_dsp_receive_uplink(hero_dsp_decoder *decoder, const hero_dsp_byte *bytes, size_t len, hero_dsp_uplink *message,
                               hero_dsp_result *result)
{
    const size_t taken = next_frame(decoder, UPLINK, bytes, len, result);
    if (*result == HERO_DSP_MESSAGE) {
        reader in;
        bool is_possible = true;
        message->header = open_frame(decoder, &in, &message->sequence);
        if (message->header == HERO_DSP_COMMAND) {
            is_possible = read_command(&in, &message->command);
        } else {
            read_geographic(&in, &message->waypoint);
        }
        *result = judged(&in, is_possible);
    }
    return taken;
}

static bool read_status(reader *in, hero_dsp_status *status)
{
    hero_dsp_byte flags;
    status->mask = take_u16(in);
    flags = take_u7(in);
    status->flying = (flags == 1u);
    read_groups(in, status);
    return flags <= 1u;
}

static bool read_downlink(reader *in, hero_dsp_downlink *message)
{
    bool is_possible = true;
    hero_dsp_byte request;
    switch (message->header) {
    case HERO_DSP_STATUS:
        is_possible = read_status(in, &message->status);
        break;
    case HERO_DSP_FLOW_CONTROL:
        request = take_u7(in);
        message->send = (request == 1u);
        is_possible = (request <= 1u);
        break;
    case HERO_DSP_ERROR:
        message->error = take_u16(in);
        break;
    default: /* the three acknowledgements */
        message->command = take_u7(in);
        is_possible = (message->command <= MAX_COMMAND_CODE);
        if (message->header == HERO_DSP_ACK_16) {
            message->value16 = take_u16(in);
        } else if (message->header == HERO_DSP_ACK_32) {
            message->value32 = take_f32(in);
        } else {
            /* Without a value. */
        }
        break;
    }
    return is_possible;
}

size_t hero_dsp_receive_downlink(hero_dsp_decoder *decoder, const hero_dsp_byte *bytes, size_t len, hero_dsp_downlink *message,
                                 hero_dsp_result *result)
{
    const size_t taken = next_frame(decoder, DOWNLINK, bytes, len, result);
    if (*result == HERO_DSP_MESSAGE) {
        reader in;
        bool is_possible;
        message->header = open_frame(decoder, &in, &message->sequence);
        message->acknowledges = 0u;
        is_possible = read_downlink(&in, message);
        if ((decoder->profile == HERO_DSP_EXTENDED) && is_acknowledgement(message->header)) {
            message->acknowledges = take_u7(&in);
        }
        *result = judged(&in, is_possible);
    }
    return taken;
}

/* Opens a frame of the message with the classic `header`. */
static void begin_frame(writer *out, hero_dsp_profile profile, direction of, hero_dsp_byte header, hero_dsp_byte sequence)
{
    out->len = 1u;
    if (profile == HERO_DSP_EXTENDED) {
        out->bytes[0] = (of == UPLINK) ? HERO_DSP_EXTENDED_UPLINK : HERO_DSP_EXTENDED_DOWNLINK;
        put_u7(out, (hero_dsp_byte)(sequence & DIGIT_MASK));
        put_u7(out, (hero_dsp_byte)(header & DIGIT_MASK));
    } else {
        out->bytes[0] = header;
    }
}

/* Closes the frame with its check. Returns its length. */
static size_t end_frame(hero_dsp_profile profile, writer *out)
{
    if (profile == HERO_DSP_EXTENDED) {
        put_u32(out, hero_dsp_crc32(out->bytes, out->len));
    } else {
        put_u7(out, hero_dsp_checksum(out->bytes, out->len));
    }
    return out->len;
}

size_t hero_dsp_encode_downlink(hero_dsp_profile profile, const hero_dsp_downlink *message, hero_dsp_byte *frame)
{
    writer out;
    bool is_known = true;
    out.bytes = frame;
    begin_frame(&out, profile, DOWNLINK, message->header, message->sequence);
    switch (message->header) {
    case HERO_DSP_STATUS:
        put_u16(&out, message->status.mask);
        put_u7(&out, message->status.flying ? 1u : 0u);
        write_groups(&out, &message->status);
        break;
    case HERO_DSP_FLOW_CONTROL:
        put_u7(&out, message->send ? 1u : 0u);
        break;
    case HERO_DSP_ERROR:
        put_u16(&out, message->error);
        break;
    case HERO_DSP_ACK:
    case HERO_DSP_ACK_16:
    case HERO_DSP_ACK_32:
        put_u7(&out, message->command);
        if (message->header == HERO_DSP_ACK_16) {
            put_u16(&out, message->value16);
        } else if (message->header == HERO_DSP_ACK_32) {
            put_f32(&out, message->value32);
        } else {
            /* Without a value. */
        }
        if (profile == HERO_DSP_EXTENDED) {
            put_u7(&out, (hero_dsp_byte)(message->acknowledges & DIGIT_MASK));
        }
        break;
    default:
        is_known = false;
        break;
    }
    return is_known ? end_frame(profile, &out) : 0u;
}

size_t hero_dsp_encode_uplink(hero_dsp_profile profile, const hero_dsp_uplink *message, hero_dsp_byte *frame)
{
    const hero_dsp_command *command = &message->command;
    writer out;
    bool is_known = true;
    out.bytes = frame;
    begin_frame(&out, profile, UPLINK, message->header, message->sequence);
    if (message->header == HERO_DSP_WAYPOINT) {
        write_geographic(&out, &message->waypoint);
    } else if ((message->header == HERO_DSP_COMMAND) && (command->code <= MAX_COMMAND_CODE)) {
        put_u7(&out, command->code);
        if (command->code <= (hero_dsp_byte)HERO_DSP_WRITE_32) {
            put_u16(&out, command->port);
        }
        if (command->code == (hero_dsp_byte)HERO_DSP_WRITE_16) {
            put_u16(&out, command->value16);
        } else if (command->code == (hero_dsp_byte)HERO_DSP_WRITE_32) {
            put_f32(&out, command->value32);
        } else if (command->code == (hero_dsp_byte)HERO_DSP_FOLLOWING) {
            put_u7(&out, command->on ? 1u : 0u);
        } else {
            /* The others have no value. */
        }
    } else {
        is_known = false;
    }
    return is_known ? end_frame(profile, &out) : 0u;
}
