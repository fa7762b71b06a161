/* The board of examples/firmware/dsp.c for dialogues.rs: time and bytes come from lines of the standard input, and each line is answered by
 * what the DSP then sends. Arguments: the profile; `flying` for a DSP that has booted in flight. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp.h"

int main(int argc, char **argv)
{
    static const hero_dsp_geographic HOME = {374110000, -60010000, 10000};
    static dsp it;
    char line[1024];
    if (argc != 3) {
        return 2;
    }
    dsp_boot(&it, strcmp(argv[1], "extended") == 0 ? HERO_DSP_EXTENDED : HERO_DSP_CLASSIC, &HOME, 0.794307f, 0);
    if (strcmp(argv[2], "flying") == 0) {
        it.helicopter.phase = DSP_HOVER;
        it.helicopter.up_m = 10.0f;
        dsp_reboot(&it, 0);
    }
    while (fgets(line, sizeof line, stdin) != NULL) {
        char *rest = strchr(line, ' ');
        const uint32_t now_ms = (uint32_t)strtoul(rest, &rest, 10);
        hero_dsp_byte bytes[512];
        size_t len = 0, at;
        if (line[0] == 'r' && line[2] == 'b') {
            dsp_reboot(&it, now_ms);
        } else if (line[0] == 'r') {
            char *end;
            unsigned long byte = strtoul(rest, &end, 16);
            while (end != rest) {
                bytes[len++] = (hero_dsp_byte)byte;
                rest = end;
                byte = strtoul(rest, &end, 16);
            }
            dsp_receive(&it, bytes, len, now_ms);
        } else {
            dsp_step(&it, now_ms);
        }
        len = dsp_send(&it, bytes, sizeof bytes, now_ms);
        for (at = 0; at < len; at++) {
            printf("%02X ", (unsigned)bytes[at]);
        }
        printf("\n");
        fflush(stdout);
    }
    return 0;
}
