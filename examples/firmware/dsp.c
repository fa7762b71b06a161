/* See dsp.h. */
#include "dsp.h"

/* How long the rotor needs to start and to stop. */
#define ROTOR_MS 2000u
/* The least height of a waypoint above the point of take-off (8.4). */
#define LEAST_HEIGHT_MM 500
/* The flow control 1 needs two free places: the second is for a waypoint on its way (8.4). */
#define PLACES_TO_SEND 2u
/* Error 100 for the other profile comes once a second at most (11). */
#define ALARM_MS 1000u
/* One step of 1e-7 degrees of latitude. */
#define METRES_PER_STEP 0.011131949f

static bool is_flying(const dsp *self)
{
    const dsp_phase phase = self->helicopter.phase;
    return (phase == DSP_CLIMB) || (phase == DSP_HOVER) || (phase == DSP_DESCENT);
}

static bool is_taking_off(const dsp *self)
{
    return (self->helicopter.phase == DSP_ROTOR_STARTS) || (self->helicopter.phase == DSP_CLIMB);
}

static bool is_landing(const dsp *self)
{
    return (self->helicopter.phase == DSP_DESCENT) || (self->helicopter.phase == DSP_ROTOR_STOPS);
}

static void report(dsp *self, uint16_t error)
{
    if (self->errors_len < DSP_ERRORS) {
        self->errors[self->errors_len] = error;
        self->errors_len++;
    }
}

/* ---- ports (6) ---- */

static uint16_t *place16(dsp *self, uint16_t number)
{
    const hero_dsp_port16 *port = hero_dsp_find_port16(number);
    return (port == NULL) ? NULL : &self->ports16[port - hero_dsp_ports16];
}

static uint16_t port16(dsp *self, uint16_t number)
{
    const uint16_t *place = place16(self, number);
    return (place == NULL) ? 0u : *place;
}

static float port32(const dsp *self, uint16_t number)
{
    const hero_dsp_port32 *port = hero_dsp_find_port32(number);
    return (port == NULL) ? 0.0f : self->ports32[port - hero_dsp_ports32];
}

static uint16_t read16(dsp *self, uint16_t number)
{
    uint16_t value = 0u;
    if (number == HERO_DSP_PORT_WAYPOINT_COUNT) {
        value = (uint16_t)(0x8000u | (self->waypoint_count & 0x7FFFu));
    } else if (number == HERO_DSP_PORT_TAKE_OFF) {
        value = is_taking_off(self) ? 1u : 0u;
    } else if (number == HERO_DSP_PORT_LAND) {
        value = is_landing(self) ? 1u : 0u;
    } else if (hero_dsp_find_port16(number) != NULL) {
        value = port16(self, number);
    } else {
        report(self, HERO_DSP_ERROR_INVALID_COMMAND);
    }
    return value;
}

static float read32(dsp *self, uint16_t number)
{
    if (hero_dsp_find_port32(number) == NULL) {
        report(self, HERO_DSP_ERROR_INVALID_COMMAND);
    }
    return port32(self, number);
}

/* ---- periods (8.3): a period begins with what is due next ---- */

static bool is_due(uint32_t due_ms, uint32_t now_ms)
{
    return (now_ms - due_ms) < 0x80000000u;
}

/* What was due is sent: when the next one is due. Those that a stall has cost are not made up for. */
static uint32_t next_due(uint32_t due_ms, uint16_t period_ms, uint32_t now_ms)
{
    return is_due(due_ms + period_ms, now_ms) ? (now_ms + period_ms) : (due_ms + period_ms);
}

/* A shorter period takes effect at once. */
static uint32_t no_later(uint32_t due_ms, uint16_t period_ms, uint32_t now_ms)
{
    const bool is_late = !is_due(due_ms, now_ms) && ((due_ms - now_ms) > period_ms);
    return is_late ? (now_ms + period_ms) : due_ms;
}

static void enter(dsp *self, dsp_phase phase, uint32_t now_ms)
{
    self->helicopter.phase = phase;
    self->helicopter.phase_since_ms = now_ms;
}

static void hover_here(dsp *self)
{
    dsp_helicopter *it = &self->helicopter;
    it->target_east_m = it->east_m;
    it->target_north_m = it->north_m;
    it->target_up_m = it->up_m;
}

/* Invalidate path (8.4): during take-off and landing the buffer is empty, and the movement goes on. */
static void invalidate_path(dsp *self)
{
    self->has_waypoint_number = false;
    if (self->path_len > 0u) {
        self->path_len = 0u;
        hover_here(self);
    }
}

/* Whether the write is carried out, or changes nothing without being refused (8.5). */
static bool take_off(dsp *self, uint32_t now_ms)
{
    bool is_taken = is_taking_off(self);
    if ((self->helicopter.phase == DSP_GROUND) && self->is_started_up && !self->helicopter.is_manual) {
        self->helicopter.climb_to_m = port32(self, HERO_DSP_PORT_TAKE_OFF_ALTITUDE_M);
        enter(self, DSP_ROTOR_STARTS, now_ms);
        is_taken = true;
    }
    return is_taken;
}

static bool land(dsp *self, uint32_t now_ms)
{
    bool is_taken = is_landing(self);
    if ((self->helicopter.phase == DSP_HOVER) && !self->helicopter.is_manual) {
        invalidate_path(self);
        hover_here(self);
        enter(self, DSP_DESCENT, now_ms);
        is_taken = true;
    }
    return is_taken;
}

static void write16(dsp *self, uint16_t number, uint16_t value, uint32_t now_ms)
{
    const hero_dsp_port16 *port = hero_dsp_find_port16(number);
    bool is_taken = (port != NULL) && hero_dsp_port16_accepts(port, value);
    if (is_taken && (number == HERO_DSP_PORT_TAKE_OFF)) {
        is_taken = take_off(self, now_ms);
    } else if (is_taken && (number == HERO_DSP_PORT_LAND)) {
        is_taken = land(self, now_ms);
    } else if (is_taken) {
        *place16(self, number) = value;
        if (number == HERO_DSP_PORT_STATUS_PERIOD_MS) {
            self->status_due_ms = no_later(self->status_due_ms, value, now_ms);
        } else if (number == HERO_DSP_PORT_FLOW_CONTROL_PERIOD_MS) {
            self->flow_due_ms = no_later(self->flow_due_ms, value, now_ms);
        } else {
            /* The others are read when they are needed. */
        }
    } else {
        is_taken = false;
    }
    if (!is_taken) {
        report(self, HERO_DSP_ERROR_INVALID_COMMAND);
    }
}

static void write32(dsp *self, uint16_t number, float value)
{
    const hero_dsp_port32 *port = hero_dsp_find_port32(number);
    if ((port != NULL) && hero_dsp_port32_accepts(port, value)) {
        self->ports32[port - hero_dsp_ports32] = value;
    } else {
        report(self, HERO_DSP_ERROR_INVALID_COMMAND);
    }
}

/* ---- commands (8.2) ---- */

static void execute(dsp *self, const hero_dsp_command *command, hero_dsp_downlink *ack, uint32_t now_ms)
{
    ack->header = HERO_DSP_ACK;
    ack->command = command->code;
    switch (command->code) {
    case HERO_DSP_READ_16:
        ack->header = HERO_DSP_ACK_16;
        ack->value16 = read16(self, command->port);
        break;
    case HERO_DSP_WRITE_16:
        write16(self, command->port, command->value16, now_ms);
        break;
    case HERO_DSP_READ_32:
        ack->header = HERO_DSP_ACK_32;
        ack->value32 = read32(self, command->port);
        break;
    case HERO_DSP_WRITE_32:
        write32(self, command->port, command->value32);
        break;
    case HERO_DSP_CLEAR_ERRORS:
        self->errors_len = 0u;
        break;
    case HERO_DSP_ACTIVATE_STATUS:
        if (!self->is_active) {
            self->is_active = true;
            self->status_due_ms = now_ms + port16(self, HERO_DSP_PORT_STATUS_PERIOD_MS);
        }
        break;
    case HERO_DSP_INVALIDATE_PATH:
        invalidate_path(self);
        break;
    default: /* following */
        if (command->on && !self->is_following) {
            self->flow_due_ms = now_ms + port16(self, HERO_DSP_PORT_FLOW_CONTROL_PERIOD_MS);
        }
        if (!command->on) {
            invalidate_path(self);
            self->is_flow_due = false;
        }
        self->is_following = command->on;
        self->is_started_up = self->is_started_up || command->on;
        break;
    }
}

/* A copy of the last command is acknowledged as that one was, and not executed (11). */
static void on_command(dsp *self, const hero_dsp_uplink *message, uint32_t now_ms)
{
    const bool is_copy = (self->profile == HERO_DSP_EXTENDED) && self->has_last_command &&
                         hero_dsp_is_copy(message, &self->last_command);
    if (!is_copy) {
        execute(self, &message->command, &self->last_ack, now_ms);
        self->last_ack.acknowledges = message->sequence;
        self->last_command = *message;
        self->has_last_command = true;
    }
    if (self->acks_len < DSP_ACKS) {
        self->acks[self->acks_len] = self->last_ack;
        self->acks_len++;
    } else {
        report(self, HERO_DSP_ERROR_SCI_A_WRITE_FULL);
    }
}

/* ---- waypoints (8.4) ---- */

static bool is_same_place(const hero_dsp_geographic *left, const hero_dsp_geographic *right)
{
    return (left->latitude_deg_e7 == right->latitude_deg_e7) &&
           (left->longitude_deg_e7 == right->longitude_deg_e7) && (left->altitude_mm == right->altitude_mm);
}

static void on_waypoint(dsp *self, const hero_dsp_uplink *message)
{
    const hero_dsp_geographic *waypoint = &message->waypoint;
    const bool is_copy = (self->profile == HERO_DSP_EXTENDED) && self->has_waypoint_number &&
                         (self->waypoint_number == message->sequence);
    if (is_copy) {
        /* It was taken already. */
    } else if ((self->helicopter.phase != DSP_HOVER) || !self->is_following) {
        report(self, HERO_DSP_ERROR_INVALID_COMMAND);
    } else if (!hero_dsp_is_plausible_place(waypoint) ||
               (waypoint->altitude_mm < (self->helicopter.home.altitude_mm + LEAST_HEIGHT_MM))) {
        report(self, HERO_DSP_ERROR_INVALID_COMMAND);
    } else if ((self->path_len > 0u) && is_same_place(&self->path[self->path_len - 1u], waypoint)) {
        /* Two equal waypoints in a row are one. */
    } else if (self->path_len >= DSP_PATH) {
        report(self, HERO_DSP_ERROR_UART_QUEUE_FULL);
    } else {
        self->path[self->path_len] = *waypoint;
        self->path_len++;
        self->waypoint_count++;
        self->waypoint_number = message->sequence;
        self->has_waypoint_number = true;
    }
}

void dsp_receive(dsp *self, const hero_dsp_byte *bytes, size_t len, uint32_t now_ms)
{
    size_t taken = 0u;
    hero_dsp_result result;
    do {
        hero_dsp_uplink message;
        taken += hero_dsp_receive_uplink(&self->decoder, &bytes[taken], len - taken, &message, &result);
        if (result == HERO_DSP_MESSAGE) {
            self->heard_ms = now_ms;
            if (message.header == HERO_DSP_COMMAND) {
                on_command(self, &message, now_ms);
            } else {
                on_waypoint(self, &message);
            }
        } else if (result == HERO_DSP_OTHER_PROFILE) {
            if (!self->has_alarmed || ((now_ms - self->alarm_ms) >= ALARM_MS)) {
                self->has_alarmed = true;
                self->alarm_ms = now_ms;
                self->is_alarm_due = true;
            }
        } else if (hero_dsp_error_of(result) != 0u) {
            report(self, hero_dsp_error_of(result));
        } else {
            /* Strays and truncated messages are not reported (5.1). */
        }
    } while (result != HERO_DSP_INCOMPLETE);
}

/* ---- the helicopter: a point ---- */

static float size_of(float value)
{
    return (value < 0.0f) ? -value : value;
}

/* Goes towards the target for so long. Returns whether it is there. */
static bool go(dsp *self, float seconds)
{
    dsp_helicopter *it = &self->helicopter;
    const float east = it->target_east_m - it->east_m;
    const float north = it->target_north_m - it->north_m;
    const float up = it->target_up_m - it->up_m;
    const float cruise = port32(self, HERO_DSP_PORT_CRUISE_SPEED_MPS);
    float takes = size_of(up) / port32(self, HERO_DSP_PORT_CLIMB_SPEED_MPS);
    float part = 1.0f;
    takes = (size_of(east) / cruise > takes) ? (size_of(east) / cruise) : takes;
    takes = (size_of(north) / cruise > takes) ? (size_of(north) / cruise) : takes;
    if (takes > seconds) {
        part = seconds / takes;
    }
    it->east_m += east * part;
    it->north_m += north * part;
    it->up_m += up * part;
    return takes <= seconds;
}

static void follow_path(dsp *self, float seconds)
{
    dsp_helicopter *it = &self->helicopter;
    if (self->path_len > 0u) {
        const hero_dsp_geographic *to = &self->path[0];
        const float radius = port32(self, HERO_DSP_PORT_ACCEPTANCE_RADIUS_M);
        float east, north, up;
        it->target_east_m = (float)(to->longitude_deg_e7 - it->home.longitude_deg_e7) * it->metres_per_step_east;
        it->target_north_m = (float)(to->latitude_deg_e7 - it->home.latitude_deg_e7) * it->metres_per_step_north;
        it->target_up_m = (float)(to->altitude_mm - it->home.altitude_mm) / 1000.0f;
        (void)go(self, seconds);
        east = it->target_east_m - it->east_m;
        north = it->target_north_m - it->north_m;
        up = it->target_up_m - it->up_m;
        if (((east * east) + (north * north) + (up * up)) <= (radius * radius)) {
            hero_dsp_byte at;
            for (at = 1u; at < self->path_len; at++) {
                self->path[at - 1u] = self->path[at];
            }
            self->path_len--;
        }
    } else {
        (void)go(self, seconds);
    }
}

static void fly(dsp *self, uint32_t now_ms)
{
    dsp_helicopter *it = &self->helicopter;
    const float seconds = (float)(now_ms - self->stepped_ms) / 1000.0f;
    const bool is_rotor_done = (now_ms - it->phase_since_ms) >= ROTOR_MS;
    switch (it->phase) {
    case DSP_ROTOR_STARTS:
        if (is_rotor_done) {
            hover_here(self);
            it->target_up_m = it->climb_to_m;
            enter(self, DSP_CLIMB, now_ms);
        }
        break;
    case DSP_CLIMB:
        /* While following is on, the first flow control 1 ends the take-off (8.5). */
        if (go(self, seconds) && !self->is_following) {
            enter(self, DSP_HOVER, now_ms);
        }
        break;
    case DSP_HOVER:
        if (!it->is_manual) {
            follow_path(self, seconds);
        }
        break;
    case DSP_DESCENT:
        it->target_up_m = 0.0f;
        if (go(self, seconds)) {
            enter(self, DSP_ROTOR_STOPS, now_ms);
        }
        break;
    case DSP_ROTOR_STOPS:
        if (is_rotor_done) {
            enter(self, DSP_GROUND, now_ms);
        }
        break;
    default:
        break;
    }
}

static bool may_send_waypoint(const dsp *self)
{
    return (self->helicopter.phase == DSP_HOVER) && !self->helicopter.is_manual &&
           ((DSP_PATH - self->path_len) >= PLACES_TO_SEND);
}

void dsp_step(dsp *self, uint32_t now_ms)
{
    const uint16_t pc_timeout_ms = port16(self, HERO_DSP_PORT_PC_TIMEOUT_MS);
    fly(self, now_ms);
    self->stepped_ms = now_ms;
    if ((pc_timeout_ms > 0u) && (self->path_len > 0u) && ((now_ms - self->heard_ms) >= pc_timeout_ms)) {
        invalidate_path(self);
    }
    if (self->is_following && is_due(self->flow_due_ms, now_ms)) {
        const dsp_helicopter *it = &self->helicopter;
        const uint16_t period_ms = port16(self, HERO_DSP_PORT_FLOW_CONTROL_PERIOD_MS);
        self->flow_due_ms = next_due(self->flow_due_ms, period_ms, now_ms);
        self->is_flow_due = true;
        if ((it->phase == DSP_CLIMB) && (it->up_m >= it->target_up_m) && !it->is_manual) {
            enter(self, DSP_HOVER, now_ms);
        }
    }
    if (self->is_active && is_due(self->status_due_ms, now_ms)) {
        const uint16_t period_ms = port16(self, HERO_DSP_PORT_STATUS_PERIOD_MS);
        self->status_due_ms = next_due(self->status_due_ms, period_ms, now_ms);
        /* One that is due while the one before has not left is left out (8.3). */
        self->is_status_due = !self->is_status_leaving;
    }
}

/* ---- the line (8.2) ---- */

static void set_pulses(dsp *self, hero_dsp_status *status)
{
    const uint16_t throttle = (self->helicopter.phase == DSP_GROUND) ? 1000u : 1600u;
    status->pilot_pwm.collective_us = 1500u;
    status->pilot_pwm.roll_us = 1500u;
    status->pilot_pwm.pitch_us = 1500u;
    status->pilot_pwm.tail_us = 1500u;
    status->pilot_pwm.throttle_us = 1000u;
    status->actuation.collective_us = 1500u;
    status->actuation.roll_us = 1500u;
    status->actuation.pitch_us = 1500u;
    status->actuation.tail_us = 1500u;
    status->actuation.throttle_us = throttle;
}

/* All sixteen groups; only those of the mask are sent. A point does not lean, and has no noise. */
static void compose_status(dsp *self, hero_dsp_status *status, uint32_t now_ms)
{
    const dsp_helicopter *it = &self->helicopter;
    const uint16_t rpm = port16(self, HERO_DSP_PORT_ROTOR_SPEED_RPM);
    *status = (hero_dsp_status){0};
    status->mask = port16(self, HERO_DSP_PORT_STATUS_MASK);
    status->flying = is_flying(self);
    status->time_ms = now_ms - self->boot_ms;
    status->geographic.latitude_deg_e7 = it->home.latitude_deg_e7 + (int32_t)(it->north_m / it->metres_per_step_north);
    status->geographic.longitude_deg_e7 = it->home.longitude_deg_e7 + (int32_t)(it->east_m / it->metres_per_step_east);
    status->geographic.altitude_mm = it->home.altitude_mm + hero_dsp_steps_i32((double)it->up_m, 1000u);
    status->xy.x_mm = hero_dsp_steps_i32((double)it->east_m, 1000u);
    status->xy.y_mm = hero_dsp_steps_i32((double)it->north_m, 1000u);
    status->gps_quality = 4u;
    status->acceleration.z_cmps2 = -981;
    status->sonar_adc = 400u;
    status->supply.battery_mv = 24000u;
    status->supply.fuel_percent = 80u;
    status->supply.auto_switch = (hero_dsp_byte)(it->is_manual ? 0u : 1u);
    status->pan_tilt.pan_adc = 2048u;
    status->pan_tilt.tilt_adc = 2048u;
    status->rotor_rpm = (it->phase == DSP_GROUND) ? 0u : rpm;
    status->barometer_adc = 2000u;
    status->references.altitude_mm = it->home.altitude_mm + hero_dsp_steps_i32((double)it->target_up_m, 1000u);
    set_pulses(self, status);
}

/* Puts the message into the frame that is being sent. */
static void begin_frame(dsp *self, const hero_dsp_downlink *message)
{
    self->frame_len = hero_dsp_encode_downlink(self->profile, message, self->frame);
    self->frame_sent = 0u;
    self->sequence = (hero_dsp_byte)((self->sequence + 1u) & 0x7Fu);
}

static void begin_ack(dsp *self)
{
    hero_dsp_byte at;
    self->message = self->acks[0];
    for (at = 1u; at < self->acks_len; at++) {
        self->acks[at - 1u] = self->acks[at];
    }
    self->acks_len--;
    self->message.sequence = self->sequence;
    begin_frame(self, &self->message);
}

static void begin_error(dsp *self, uint16_t code)
{
    self->message.header = HERO_DSP_ERROR;
    self->message.sequence = self->sequence;
    self->message.error = code;
    begin_frame(self, &self->message);
}

/* Chooses the next frame: nothing comes between a status and the error behind it. */
static void next_frame(dsp *self, uint32_t now_ms)
{
    const bool has_status_left = self->is_status_leaving;
    self->is_status_leaving = false;
    if (has_status_left && (self->errors_len > 0u)) {
        const uint16_t oldest = self->errors[0];
        hero_dsp_byte at;
        for (at = 1u; at < self->errors_len; at++) {
            self->errors[at - 1u] = self->errors[at];
        }
        self->errors_len--;
        begin_error(self, oldest);
    } else if (self->acks_len > 0u) {
        begin_ack(self);
    } else if (self->is_alarm_due) {
        self->is_alarm_due = false;
        begin_error(self, HERO_DSP_ERROR_UNKNOWN_HEADER);
    } else if (self->is_flow_due) {
        self->is_flow_due = false;
        self->message.header = HERO_DSP_FLOW_CONTROL;
        self->message.sequence = self->sequence;
        self->message.send = may_send_waypoint(self);
        begin_frame(self, &self->message);
    } else if (self->is_status_due) {
        self->is_status_due = false;
        self->is_status_leaving = true;
        self->message.header = HERO_DSP_STATUS;
        self->message.sequence = self->sequence;
        compose_status(self, &self->message.status, now_ms);
        begin_frame(self, &self->message);
    } else {
        self->frame_len = 0u;
        self->frame_sent = 0u;
    }
}

size_t dsp_send(dsp *self, hero_dsp_byte *bytes, size_t room, uint32_t now_ms)
{
    size_t len = 0u;
    bool has_more = true;
    while (has_more && (len < room)) {
        if (self->frame_sent >= self->frame_len) {
            next_frame(self, now_ms);
        }
        has_more = (self->frame_sent < self->frame_len);
        while ((self->frame_sent < self->frame_len) && (len < room)) {
            bytes[len] = self->frame[self->frame_sent];
            len++;
            self->frame_sent++;
        }
    }
    return len;
}

/* ---- boot (8.1) ---- */

void dsp_reboot(dsp *self, uint32_t now_ms)
{
    const dsp_helicopter kept = self->helicopter;
    const hero_dsp_profile profile = self->profile;
    size_t at;
    *self = (dsp){0};
    self->helicopter = kept;
    self->profile = profile;
    self->boot_ms = now_ms;
    self->stepped_ms = now_ms;
    hero_dsp_decoder_init(&self->decoder, profile);
    for (at = 0u; at < HERO_DSP_PORTS_16; at++) {
        self->ports16[at] = (uint16_t)hero_dsp_ports16[at].boot;
    }
    for (at = 0u; at < HERO_DSP_PORTS_32; at++) {
        self->ports32[at] = hero_dsp_ports32[at].boot;
    }
    if (self->helicopter.phase == DSP_HOVER) {
        hover_here(self);
    }
}

void dsp_boot(dsp *self, hero_dsp_profile profile, const hero_dsp_geographic *home, float cos_latitude, uint32_t now_ms)
{
    *self = (dsp){0};
    self->profile = profile;
    self->helicopter.home = *home;
    self->helicopter.metres_per_step_north = METRES_PER_STEP;
    self->helicopter.metres_per_step_east = METRES_PER_STEP * cos_latitude;
    dsp_reboot(self, now_ms);
}
