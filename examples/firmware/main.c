/* The board of dsp.c on a computer with POSIX: the serial line is a pseudo-terminal, the timer is the clock of the system.
 *
 *   cc -std=c99 -I ../../bindings/firmware main.c dsp.c ../../bindings/firmware/hero_dsp.c -o dsp
 *   ./dsp /tmp/dsp [extended]     and then: ril run bridge --port /tmp/dsp
 *
 * A real board has in its place: an interrupt that puts received bytes into a ring, a main loop as below, a timer. */
#define _XOPEN_SOURCE 700
#define _DEFAULT_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "dsp.h"

/* The longest time between two steps of the helicopter. */
#define STEP_MS 5

static volatile sig_atomic_t is_over;

static void on_signal(int number)
{
    (void)number;
    is_over = 1;
}

static uint32_t now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((unsigned long long)now.tv_sec * 1000u + (unsigned long long)now.tv_nsec / 1000000u);
}

/* Opens a pseudo-terminal. Its other end stays open here, too, so that a PC may come and go. */
static int open_line(const char *link)
{
    struct termios raw;
    const int line = posix_openpt(O_RDWR | O_NOCTTY);
    int other;
    if (line < 0 || grantpt(line) != 0 || unlockpt(line) != 0) {
        return -1;
    }
    other = open(ptsname(line), O_RDWR | O_NOCTTY);
    if (other < 0 || tcgetattr(other, &raw) != 0) {
        return -1;
    }
    cfmakeraw(&raw);
    if (tcsetattr(other, TCSANOW, &raw) != 0 || fcntl(line, F_SETFL, O_NONBLOCK) != 0) {
        return -1;
    }
    unlink(link);
    return symlink(ptsname(line), link) == 0 ? line : -1;
}

/* Sends what waits. A line that nobody reads is full one day: what is sent then is lost, as on a cable without a PC. */
static void send_all(dsp *it, int line)
{
    hero_dsp_byte bytes[256];
    size_t len;
    while ((len = dsp_send(it, bytes, sizeof bytes, now_ms())) > 0) {
        if (write(line, bytes, len) < 0 && errno != EAGAIN) {
            is_over = 1;
        }
    }
}

int main(int argc, char **argv)
{
    /* Near Seville; 0.794307 is the cosine of the latitude. */
    static const hero_dsp_geographic HOME = {374110000, -60010000, 10000};
    static dsp it;
    struct sigaction end = {.sa_handler = on_signal};
    int line;
    if (argc < 2 || argc > 3 || (argc == 3 && strcmp(argv[2], "extended") != 0)) {
        fprintf(stderr, "usage: %s LINK [extended]\n", argv[0]);
        return 2;
    }
    line = open_line(argv[1]);
    if (line < 0) {
        perror(argv[1]);
        return 1;
    }
    sigaction(SIGINT, &end, NULL);
    sigaction(SIGTERM, &end, NULL);
    dsp_boot(&it, argc == 3 ? HERO_DSP_EXTENDED : HERO_DSP_CLASSIC, &HOME, 0.794307f, now_ms());
    printf("ready\n");
    fflush(stdout);
    while (!is_over) {
        struct pollfd source = {.fd = line, .events = POLLIN};
        hero_dsp_byte bytes[256];
        ssize_t len;
        poll(&source, 1, STEP_MS);
        while ((len = read(line, bytes, sizeof bytes)) > 0) {
            dsp_receive(&it, bytes, (size_t)len, now_ms());
            send_all(&it, line);
        }
        dsp_step(&it, now_ms());
        send_all(&it, line);
    }
    unlink(argv[1]);
    return 0;
}
