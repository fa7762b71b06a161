/* Lets a test ask hero_dsp.c. Each line of the standard input is a question, answered by one line:
 *
 *   decode PROFILE DIRECTION CHUNK HEX   what the bytes give, in pieces of CHUNK bytes (0: whole): words of results, and for each message
 *                                        `message`, its fields, and its bytes when it is encoded again, joined by commas
 *   encode PROFILE DIRECTION NAME=NUMBER...   the frame in hexadecimal, `-` when there is none
 *   len PROFILE MASK                     the length of a status
 *   steps TYPE BITS STEPS                the steps of the double with these bits
 *   port16 NUMBER BITS, port32 NUMBER BITS   `-` for no port, or its row and whether it accepts the value
 *   error RESULT                         the error for a result
 *   copy HEX HEX                         whether the second command of the extended profile is a copy of the first
 *
 * fields.inc has a line for each field of a status: FIELD(group's bit, name, place in hero_dsp_status, is signed). */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hero_dsp.h"

static const char *const RESULTS[] = {
#define RESULT(name) #name,
#include "results.inc"
#undef RESULT
};

struct field {
    uint16_t group;
    const char *name;
    size_t offset, size;
    int is_signed;
};

#define FIELD(group, name, place, is_signed) \
    {group, name, offsetof(hero_dsp_status, place), sizeof(((hero_dsp_status *)0)->place), is_signed},
static const struct field FIELDS[] = {
#include "fields.inc"
};
#undef FIELD
#define FIELDS_LEN (sizeof FIELDS / sizeof FIELDS[0])

static const struct field PLACE[] = {
    {0, "latitude_deg_e7", offsetof(hero_dsp_geographic, latitude_deg_e7), 4, 1},
    {0, "longitude_deg_e7", offsetof(hero_dsp_geographic, longitude_deg_e7), 4, 1},
    {0, "altitude_mm", offsetof(hero_dsp_geographic, altitude_mm), 4, 1},
};

static long long get(const void *base, const struct field *field)
{
    const char *at = (const char *)base + field->offset;
    union { uint8_t u1; uint16_t u2; int16_t i2; uint32_t u4; int32_t i4; } value;
    memcpy(&value, at, field->size);
    switch (field->size) {
    case 1: return value.u1;
    case 2: return field->is_signed ? (long long)value.i2 : (long long)value.u2;
    default: return field->is_signed ? (long long)value.i4 : (long long)value.u4;
    }
}

static void set(void *base, const struct field *field, long long number)
{
    char *at = (char *)base + field->offset;
    uint8_t u1 = (uint8_t)number;
    uint16_t u2 = (uint16_t)number;
    uint32_t u4 = (uint32_t)number;
    memcpy(at, field->size == 1 ? (void *)&u1 : field->size == 2 ? (void *)&u2 : (void *)&u4, field->size);
}

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static float float_of(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void print_hex(const hero_dsp_byte *bytes, size_t len)
{
    size_t at;
    for (at = 0; at < len; at++) {
        printf("%02X", (unsigned)bytes[at]);
    }
    if (len == 0) {
        printf("-");
    }
}

static void print_downlink(hero_dsp_profile profile, const hero_dsp_downlink *message)
{
    hero_dsp_byte frame[HERO_DSP_MAX_FRAME_LEN];
    size_t at;
    printf("message,header=%u,sequence=%u,", (unsigned)message->header, (unsigned)message->sequence);
    switch (message->header) {
    case HERO_DSP_STATUS:
        printf("mask=%u,flying=%u,", (unsigned)message->status.mask, (unsigned)message->status.flying);
        for (at = 0; at < FIELDS_LEN; at++) {
            if (FIELDS[at].group & message->status.mask) {
                printf("%s=%lld,", FIELDS[at].name, get(&message->status, &FIELDS[at]));
            }
        }
        printf("implausible=%u,", (unsigned)hero_dsp_implausible_groups(&message->status));
        break;
    case HERO_DSP_FLOW_CONTROL:
        printf("send=%u,", (unsigned)message->send);
        break;
    case HERO_DSP_ERROR:
        printf("error=%u,", (unsigned)message->error);
        break;
    default:
        printf("acknowledges=%u,command=%u,", (unsigned)message->acknowledges, (unsigned)message->command);
        if (message->header == HERO_DSP_ACK_16) {
            printf("value16=%u,", (unsigned)message->value16);
        } else if (message->header == HERO_DSP_ACK_32) {
            printf("value32=%" PRIu32 ",", bits_of(message->value32));
        }
    }
    print_hex(frame, hero_dsp_encode_downlink(profile, message, frame));
}

static void print_uplink(hero_dsp_profile profile, const hero_dsp_uplink *message)
{
    const hero_dsp_command *command = &message->command;
    hero_dsp_byte frame[HERO_DSP_MAX_FRAME_LEN];
    size_t at;
    printf("message,header=%u,sequence=%u,", (unsigned)message->header, (unsigned)message->sequence);
    if (message->header == HERO_DSP_WAYPOINT) {
        for (at = 0; at < 3; at++) {
            printf("%s=%lld,", PLACE[at].name, get(&message->waypoint, &PLACE[at]));
        }
        printf("implausible=%u,", (unsigned)!hero_dsp_is_plausible_place(&message->waypoint));
    } else {
        printf("code=%u,port=%u,value16=%u,value32=%" PRIu32 ",on=%u,", (unsigned)command->code, (unsigned)command->port,
               (unsigned)command->value16, bits_of(command->value32), (unsigned)command->on);
    }
    print_hex(frame, hero_dsp_encode_uplink(profile, message, frame));
}

/* The bytes lie in memory of their own, so that a sanitizer sees a step beyond their end. */
static void decode(hero_dsp_profile profile, int is_uplink, size_t chunk, const char *hex)
{
    const size_t len = strlen(hex) / 2;
    hero_dsp_decoder decoder;
    size_t begin, words = 0;
    hero_dsp_decoder_init(&decoder, profile);
    for (begin = 0; begin < len; begin += chunk == 0 ? len : chunk) {
        const size_t piece = chunk == 0 || len - begin < chunk ? len - begin : chunk;
        hero_dsp_byte *bytes = malloc(piece * sizeof *bytes);
        size_t at, taken = 0;
        hero_dsp_result result;
        for (at = 0; at < piece; at++) {
            unsigned byte;
            sscanf(hex + 2 * (begin + at), "%2X", &byte);
            bytes[at] = (hero_dsp_byte)byte;
        }
        do {
            hero_dsp_downlink down;
            hero_dsp_uplink up;
            memset(&down, 0xA5, sizeof down);
            memset(&up, 0xA5, sizeof up);
            taken += is_uplink ? hero_dsp_receive_uplink(&decoder, bytes + taken, piece - taken, &up, &result)
                               : hero_dsp_receive_downlink(&decoder, bytes + taken, piece - taken, &down, &result);
            if (result != HERO_DSP_INCOMPLETE) {
                printf("%s", words++ == 0 ? "" : " ");
            }
            if (result == HERO_DSP_MESSAGE && is_uplink) {
                print_uplink(profile, &up);
            } else if (result == HERO_DSP_MESSAGE) {
                print_downlink(profile, &down);
            } else if (result != HERO_DSP_INCOMPLETE) {
                printf("%s", RESULTS[result]);
            }
        } while (result != HERO_DSP_INCOMPLETE);
        if (taken != piece) {
            printf(" %zu-bytes-left", piece - taken);
        }
        free(bytes);
    }
    printf(words == 0 ? "-\n" : "\n");
}

static int set_in(void *base, const struct field *fields, size_t len, const char *name, long long number)
{
    size_t at;
    for (at = 0; at < len; at++) {
        if (strcmp(fields[at].name, name) == 0) {
            set(base, &fields[at], number);
            return 1;
        }
    }
    return 0;
}

static void encode(hero_dsp_profile profile, int is_uplink, char *rest)
{
    hero_dsp_byte frame[HERO_DSP_MAX_FRAME_LEN];
    hero_dsp_downlink down;
    hero_dsp_uplink up;
    char *word;
    memset(&down, 0, sizeof down);
    memset(&up, 0, sizeof up);
    for (word = strtok(rest, " "); word != NULL; word = strtok(NULL, " ")) {
        char *equals = strchr(word, '=');
        const long long number = strtoll(equals + 1, NULL, 10);
        *equals = '\0';
#define IS(what) (strcmp(word, what) == 0)
        if (IS("header")) {
            down.header = up.header = (hero_dsp_byte)number;
        } else if (IS("sequence")) {
            down.sequence = up.sequence = (hero_dsp_byte)number;
        } else if (IS("acknowledges")) {
            down.acknowledges = (hero_dsp_byte)number;
        } else if (IS("mask")) {
            down.status.mask = (uint16_t)number;
        } else if (IS("flying")) {
            down.status.flying = number != 0;
        } else if (IS("send")) {
            down.send = number != 0;
        } else if (IS("error")) {
            down.error = (uint16_t)number;
        } else if (IS("command")) {
            down.command = (hero_dsp_byte)number;
        } else if (IS("code")) {
            up.command.code = (hero_dsp_byte)number;
        } else if (IS("port")) {
            up.command.port = (uint16_t)number;
        } else if (IS("value16")) {
            down.value16 = up.command.value16 = (uint16_t)number;
        } else if (IS("value32")) {
            down.value32 = up.command.value32 = float_of((uint32_t)number);
        } else if (IS("on")) {
            up.command.on = number != 0;
        } else if (!set_in(&down.status, FIELDS, FIELDS_LEN, word, number) &&
                   !set_in(&up.waypoint, PLACE, 3, word, number)) {
            printf("unknown field %s\n", word);
            return;
        }
    }
    print_hex(frame, is_uplink ? hero_dsp_encode_uplink(profile, &up, frame)
                               : hero_dsp_encode_downlink(profile, &down, frame));
    printf("\n");
}

static void steps(const char *type, uint64_t bits, uint32_t per_unit)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    if (strcmp(type, "u16") == 0) {
        printf("%u\n", (unsigned)hero_dsp_steps_u16(value, per_unit));
    } else if (strcmp(type, "i16") == 0) {
        printf("%d\n", (int)hero_dsp_steps_i16(value, per_unit));
    } else {
        printf("%" PRId32 "\n", hero_dsp_steps_i32(value, per_unit));
    }
}

static void port16(uint16_t number, uint16_t bits)
{
    const hero_dsp_port16 *port = hero_dsp_find_port16(number);
    if (port == NULL) {
        printf("-\n");
    } else {
        printf("%u %u %" PRId32 " %" PRId32 " %" PRId32 " %u\n", (unsigned)port->number, (unsigned)port->is_signed, port->min,
               port->max, port->boot, (unsigned)hero_dsp_port16_accepts(port, bits));
    }
}

static void port32(uint16_t number, uint32_t bits)
{
    const hero_dsp_port32 *port = hero_dsp_find_port32(number);
    if (port == NULL) {
        printf("-\n");
    } else {
        printf("%u %" PRIu32 " %" PRIu32 " %" PRIu32 " %u\n", (unsigned)port->number, bits_of(port->min), bits_of(port->max),
               bits_of(port->boot), (unsigned)hero_dsp_port32_accepts(port, float_of(bits)));
    }
}

static hero_dsp_uplink uplink_of(const char *hex)
{
    const size_t len = strlen(hex) / 2;
    hero_dsp_byte bytes[HERO_DSP_MAX_FRAME_LEN];
    hero_dsp_decoder decoder;
    hero_dsp_uplink message;
    hero_dsp_result result;
    size_t at;
    for (at = 0; at < len && at < HERO_DSP_MAX_FRAME_LEN; at++) {
        unsigned byte;
        sscanf(hex + 2 * at, "%2X", &byte);
        bytes[at] = (hero_dsp_byte)byte;
    }
    memset(&message, 0xA5, sizeof message);
    hero_dsp_decoder_init(&decoder, HERO_DSP_EXTENDED);
    hero_dsp_receive_uplink(&decoder, bytes, at, &message, &result);
    return message;
}

int main(void)
{
    static char line[1 << 20];
    while (fgets(line, sizeof line, stdin) != NULL) {
        char what[16], first[64], second[64];
        int used = 0;
        line[strcspn(line, "\n")] = '\0';
        if (sscanf(line, "%15s %63s %63s %n", what, first, second, &used) < 2) {
            return 2;
        }
        if (strcmp(what, "decode") == 0 || strcmp(what, "encode") == 0) {
            const hero_dsp_profile profile = strcmp(first, "extended") == 0 ? HERO_DSP_EXTENDED : HERO_DSP_CLASSIC;
            const int is_uplink = strcmp(second, "uplink") == 0;
            if (what[0] == 'd') {
                char *hex;
                const size_t chunk = strtoul(line + used, &hex, 10);
                decode(profile, is_uplink, chunk, hex + (*hex == ' '));
            } else {
                encode(profile, is_uplink, line + used);
            }
        } else if (strcmp(what, "len") == 0) {
            const hero_dsp_profile profile = strcmp(first, "extended") == 0 ? HERO_DSP_EXTENDED : HERO_DSP_CLASSIC;
            printf("%zu\n", hero_dsp_status_frame_len(profile, (uint16_t)strtoul(second, NULL, 10)));
        } else if (strcmp(what, "steps") == 0) {
            char *rest;
            const uint64_t bits = strtoull(strchr(line + 6, ' '), &rest, 10);
            steps(first, bits, (uint32_t)strtoul(rest, NULL, 10));
        } else if (strcmp(what, "port16") == 0) {
            port16((uint16_t)strtoul(first, NULL, 10), (uint16_t)strtoul(second, NULL, 10));
        } else if (strcmp(what, "port32") == 0) {
            port32((uint16_t)strtoul(first, NULL, 10), (uint32_t)strtoul(second, NULL, 10));
        } else if (strcmp(what, "copy") == 0) {
            const hero_dsp_uplink last = uplink_of(first);
            const hero_dsp_uplink command = uplink_of(second);
            printf("%u\n", (unsigned)hero_dsp_is_copy(&command, &last));
        } else if (strcmp(what, "error") == 0) {
            printf("%u\n", (unsigned)hero_dsp_error_of((hero_dsp_result)strtol(first, NULL, 10)));
        } else {
            return 2;
        }
    }
    return 0;
}
