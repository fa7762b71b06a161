/* A whole DSP as docs/protocol.md describes it, written from that page with the codec of bindings/firmware: start-up, ports, status, flow
 * control, waypoints, take-off and landing, errors, loss of the PC, both profiles. Numbers in parentheses are sections of the page.
 *
 * It has no operating system below it: the board calls the four functions from its main loop and moves the bytes. The helicopter is a
 * point that goes where it is told; in a real firmware the control loops stand in its place. */
#ifndef DSP_H
#define DSP_H

#include "hero_dsp.h"

/* Places of the queues (8.4, 8.6), and of the acknowledgements that wait: the PC has one command outstanding, and may repeat it. */
#define DSP_PATH 16u
#define DSP_ERRORS 16u
#define DSP_ACKS 4u

/* Where the helicopter is in its flight: the rows of the table of 8.5. */
typedef enum { DSP_GROUND, DSP_ROTOR_STARTS, DSP_CLIMB, DSP_HOVER, DSP_DESCENT, DSP_ROTOR_STOPS } dsp_phase;

/* The helicopter, in metres from the point of take-off. */
typedef struct {
    dsp_phase phase;
    uint32_t phase_since_ms;
    float east_m, north_m, up_m;
    float target_east_m, target_north_m, target_up_m;
    float climb_to_m;
    hero_dsp_geographic home;
    float metres_per_step_north; /* of 1e-7 degrees, at home */
    float metres_per_step_east;
    bool is_manual; /* the pilot's switch */
} dsp_helicopter;

typedef struct {
    hero_dsp_profile profile;
    hero_dsp_decoder decoder;
    uint32_t boot_ms;
    uint32_t heard_ms; /* the last valid message of the PC (8.8) */

    uint16_t ports16[HERO_DSP_PORTS_16];
    float ports32[HERO_DSP_PORTS_32];
    bool is_started_up; /* "following on" was executed since the boot (8.5) */
    bool is_active;     /* status transmission */
    bool is_following;
    uint32_t status_due_ms;
    uint32_t flow_due_ms;

    hero_dsp_geographic path[DSP_PATH]; /* the first is being flown to */
    hero_dsp_byte path_len;
    uint16_t waypoint_count;
    bool has_waypoint_number; /* of the last waypoint that was taken (11) */
    hero_dsp_byte waypoint_number;

    uint16_t errors[DSP_ERRORS];
    hero_dsp_byte errors_len;

    bool has_last_command; /* to know a copy (11) */
    hero_dsp_uplink last_command;
    hero_dsp_downlink last_ack;

    /* What waits for the line (8.2). */
    hero_dsp_downlink acks[DSP_ACKS];
    hero_dsp_byte acks_len;
    bool is_alarm_due; /* error 100 for the other profile */
    bool has_alarmed;
    uint32_t alarm_ms;
    bool is_flow_due;
    bool is_status_due;
    bool is_status_leaving; /* the frame that is being sent is a status */
    hero_dsp_byte sequence; /* of the next message */
    hero_dsp_byte frame[HERO_DSP_MAX_FRAME_LEN];
    size_t frame_len;
    size_t frame_sent;
    hero_dsp_downlink message; /* of the frame: a status is too large for the stack of some interrupts */

    dsp_helicopter helicopter;
    uint32_t stepped_ms;
} dsp;

/* Boot (8.1). `home` is the place where the helicopter stands; `cos_latitude` is the cosine of its latitude. */
void dsp_boot(dsp *self, hero_dsp_profile profile, const hero_dsp_geographic *home, float cos_latitude, uint32_t now_ms);

/* Boot again in flight or on the ground: all is forgotten but the helicopter. */
void dsp_reboot(dsp *self, uint32_t now_ms);

/* Bytes of the PC have arrived. Call dsp_send after it: an acknowledgement must begin within 50 ms. */
void dsp_receive(dsp *self, const hero_dsp_byte *bytes, size_t len, uint32_t now_ms);

/* Time has passed: fly, and find what is due. Call it at least every few milliseconds. */
void dsp_step(dsp *self, uint32_t now_ms);

/* The next bytes for the line, at most `room`. Returns how many; 0 when nothing waits. They count as sent. */
size_t dsp_send(dsp *self, hero_dsp_byte *bytes, size_t room, uint32_t now_ms);

#endif
