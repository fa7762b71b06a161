/* The HERO RIL for C11 and C++11: telemetry, requests, and topics and request services of your own, through the library hero_ril.
 *
 * Every function that returns int returns a hero_ril_result: HERO_RIL_OK (0); a positive value when there is nothing to report,
 * which is no error; a negative value for an error, whose text hero_ril_last_error() has.
 *
 * Threads: use a handle in one thread at a time; different handles may be used in different threads at the same time, and a
 * handle may move to another thread. Close the handles of a robot in any order; when the last one is closed, the process has left
 * nothing in shared memory. Other processes clean up after a process that was killed.
 *
 * Fork: start other programs by exec (posix_spawn, system). A child that was forked from a process that had joined can use nothing of this
 * library: what it calls, hero_ril_join too, fails with a text that names the fork, or does nothing. Closing handles there, or returning
 * from main, changes nothing for the parent. A child that was forked before anything joined may join.
 * A program that is started by exec inherits descriptors that iceoryx2 has open here, some twenty for a publisher and a subscriber. No
 * lock and no segment is among them: it keeps nothing alive. iceoryx2 opens some of them whenever another process comes, so the library cannot
 * mark them all in time. Where they matter, let the child call close_range(3, ~0U, 0) before exec; Python's subprocess closes them by itself.
 *
 * Files: while one thread joins, opens or closes a handle, the umask of the whole process is another one for moments, by iceoryx2. A file
 * or folder that another thread makes just then has mode 600, and a child that it starts keeps that umask. Open all handles before other
 * threads make files, or set their modes by fchmod. Handles that follow a restarted process open anew while they are used.
 */
#ifndef HERO_RIL_H
#define HERO_RIL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "hero_ipc.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum hero_ril_result {
    HERO_RIL_OK = 0,
    HERO_RIL_NOTHING = 1,     /* The time is over, or there is nothing. */
    HERO_RIL_INTERRUPTED = 2, /* A signal came first. Nothing is lost: call again, or end. */
    HERO_RIL_GONE = 3,        /* The client of a request gave it up or died. */
    HERO_RIL_STARTED = 4,     /* The module was started. */
    HERO_RIL_STOPPED = 5,     /* The module was stopped. */
    HERO_RIL_ENDING = 6,      /* SIGINT, SIGTERM or SIGHUP asks the process to end. */
    HERO_RIL_INVALID = -1,    /* An argument is invalid. */
    HERO_RIL_LAYOUT = -2,     /* The service carries another struct than this program was built with. */
    HERO_RIL_NOT_THERE = -3,  /* No process serves the request, or no schema of the service is there. */
    HERO_RIL_TAKEN = -4,      /* Another process publishes the topic, or serves the request, already. */
    HERO_RIL_FULL = -5,       /* As many as there can be: 32 subscribers, 16 clients, 8 open requests of a client. */
    HERO_RIL_FAILED = -6,     /* Anything else. */
    HERO_RIL_PANIC = -7       /* A bug in the library. Close the handle. */
} hero_ril_result;

/* How soon a thread runs after it was woken; see hero_ril_request_slice. */
typedef enum hero_ril_role {
    HERO_RIL_PROVIDER = 0,  /* Others wait for what it publishes. */
    HERO_RIL_CONSUMER = 1,  /* It takes samples or sends requests, and is to run as soon as it is woken. */
    HERO_RIL_BACKGROUND = 2 /* Samples may wait for it, as for a recorder: it runs after all others. */
} hero_ril_role;

typedef struct hero_ril_robot hero_ril_robot;
typedef struct hero_ril_subscriber hero_ril_subscriber;
typedef struct hero_ril_publisher hero_ril_publisher;
typedef struct hero_ril_client hero_ril_client;
typedef struct hero_ril_server hero_ril_server;
typedef struct hero_ril_module hero_ril_module;

/* What a stop does to a module's work. */
typedef enum hero_ril_on_stop {
    HERO_RIL_ABORTS = 0, /* The work ends early: the module is aborted. */
    HERO_RIL_ENDS = 1,   /* The work may end at any time: the module is stopped, as if it had rested. */
    HERO_RIL_REFUSES = 2 /* The work cannot be stopped: the stop is refused. */
} hero_ril_on_stop;

/* Which topic, and the struct that this program expects in it. */
typedef struct hero_ril_topic {
    const char *key;         /* Such as "hero_telemetry", or "battery_watch/cell_voltages". */
    const char *layout_hash; /* What hero_ipc.h has; NULL is not checked. */
    const char *schema;      /* The struct in ROS 2's message format. NULL: of the robot's own topics the known one, of a module's
                                topic the one that its publisher has laid beside it. */
    size_t size;             /* sizeof the struct; 0 is not checked. */
} hero_ril_topic;

/* The same of a request service. Its struct begins with `uint64 request_id`. Where the robot's own struct is used for a service of
 * another key, as ModuleControl is for "<module>/control", `layout_hash` says which one it is. */
typedef hero_ril_topic hero_ril_service;

/* A place to fly to. The altitude is a telemetry altitude. */
typedef struct hero_ril_waypoint {
    double latitude_deg;
    double longitude_deg;
    double altitude_m;
} hero_ril_waypoint;

/* A place by its distances from another one. */
typedef struct hero_ril_offset {
    double north_m;
    double east_m;
    double up_m;
} hero_ril_offset;

/* What a subscriber got and missed. */
typedef struct hero_ril_losses {
    uint64_t received;
    uint64_t lost;               /* Published for it, but never came. */
    uint64_t joined_late;        /* Published before the first that came, by a publisher that had begun earlier. */
    uint64_t repeated;           /* Came twice and were dropped. */
    uint64_t publisher_restarts; /* Another publisher took over. */
} hero_ril_losses;

/* One of the four; the others are NULL. */
typedef struct hero_ril_source {
    hero_ril_subscriber *subscriber;
    hero_ril_client *client;
    hero_ril_publisher *publisher;
    hero_ril_server *server;
} hero_ril_source;

/* The sample lies in shared memory and is valid during the call. The callback must not call functions with the subscriber, and
 * no exception or longjmp may leave it. */
typedef void (*hero_ril_sample_callback)(const void *sample, size_t size, void *context);

/* The text of the last error of this thread; valid until its next error. */
const char *hero_ril_last_error(void);

/* ---- A robot ---- */

/* Takes part in the shared memory of a robot (1, 2, ...). `root` is the folder of the shared memory; NULL takes the variable
 * RIL_IPC_ROOT, else the user's own. `process_name` is what others see: letters, digits, `-` and `_`, and not
 * `bridge`, `status`, `relay` or `mavlink`, which are the names of the RIL's own modules. */
int hero_ril_join(const char *root, uint32_t robot, const char *process_name, hero_ril_robot **out);
void hero_ril_leave(hero_ril_robot *robot);

/* Asks Linux (6.12 and later) for a slice of the calling thread's processor as `role`, a hero_ril_role, has it: a shorter slice lets a
 * thread run sooner after it was woken. Needs no privilege. Where the system grants none, nothing changes. Never needed. */
int hero_ril_request_slice(int role);

/* ---- Telemetry, and topics of modules ---- */

/* Subscribes to a topic. The publisher need not be there yet, unless the topic is a module's and `schema` is NULL. */
int hero_ril_subscribe(hero_ril_robot *robot, const hero_ril_topic *topic, hero_ril_subscriber **out);
void hero_ril_unsubscribe(hero_ril_subscriber *subscriber);

/* Copies the oldest sample that was not received yet; `size` is that of the struct. Waits for one as long as `timeout_ms`: 0
 * does not wait, a negative number waits without a limit. */
int hero_ril_receive(hero_ril_subscriber *subscriber, void *sample, size_t size, int32_t timeout_ms);

/* Copies the newest sample that was not received yet, and drops older ones. */
int hero_ril_latest(hero_ril_subscriber *subscriber, void *sample, size_t size);

/* Calls `callback` for each sample that is there, without a copy. */
int hero_ril_drain(hero_ril_subscriber *subscriber, hero_ril_sample_callback callback, void *context);

/* Size of a sample, for a topic whose struct this program does not know. */
size_t hero_ril_sample_size(const hero_ril_subscriber *subscriber);

int hero_ril_count(hero_ril_subscriber *subscriber, hero_ril_losses *losses);

/* A descriptor for poll, epoll or an event loop, the same for as long as the subscriber lives: readable when there may be samples, and
 * every 250 ms in any case. Receive until HERO_RIL_NOTHING then. Do not read or close it. */
int hero_ril_descriptor(hero_ril_subscriber *subscriber, int *descriptor);

/* ---- Publishing ---- */

/* Becomes the one publisher of a topic; a module's topic needs its schema. The struct begins with `uint64 sequence` and
 * `uint64 epoch_ns`, which the library fills in. */
int hero_ril_advertise(hero_ril_robot *robot, const hero_ril_topic *topic, hero_ril_publisher **out);

/* Publishes a copy of the struct. Never blocks. `sequence` (or NULL) gets its number, from 1. */
int hero_ril_publish(hero_ril_publisher *publisher, const void *sample, size_t size, uint64_t *sequence);

/* Gives the latest sample to subscribers that have joined since. hero_ril_publish and hero_ril_wait do so too: call it only when
 * seconds pass between two samples. */
int hero_ril_tend(hero_ril_publisher *publisher);
void hero_ril_withdraw(hero_ril_publisher *publisher);

/* ---- For tests: hero_ril_testing.h is made of these ---- */

/* As hero_ril_advertise, but hero_ril_publish waits: up to `wait_ms` while the queue of a subscriber is full, which loses the sample else,
 * and while there is no subscriber and 50 samples wait for the first one. Negative: without a limit. */
int hero_ril_advertise_patient(hero_ril_robot *robot, const hero_ril_topic *topic, int32_t wait_ms, hero_ril_publisher **out);

/* How many files, folders and segments there are of the shared memory `root`, after what no live process uses was removed if `sweep` is
 * not 0. */
int hero_ril_residue(const char *root, int sweep, size_t *count);

/* ---- Places and moments ---- */

/* A moment of the host's monotonic clock, such as `received_ns`, as nanoseconds since 1970 (UTC) by the host's clock now; 0 of 0, which
 * is "never". */
uint64_t hero_ril_utc_ns(uint64_t monotonic_ns);
double hero_ril_degrees(double radians);

/* Where a sample is, in degrees and as a place to fly to. */
int hero_ril_place_of(const HeroTelemetry *sample, hero_ril_waypoint *place);

/* Metres north, east and up of `origin`, along the ellipsoid WGS 84. Up to 60 degrees of latitude they differ from the plane that touches
 * the ellipsoid at the origin by at most 0.15 m in a distance of 1 km, and by 15 m in 10 km. */
int hero_ril_offset_of(const hero_ril_waypoint *origin, const hero_ril_waypoint *place, hero_ril_offset *offset);

/* The place that is so far from `origin`. */
int hero_ril_place_at(const hero_ril_waypoint *origin, const hero_ril_offset *offset, hero_ril_waypoint *place);

/* ---- Requests ---- */

/* A client of all request services of the robot, those of modules included. Up to 8 requests of each service may be open, that is,
 * without a final report, whether or not reports were read. While 8 are open, sending waits 0.25 s at most for one to end, and is then
 * refused with HERO_RIL_FULL. The client keeps 256 reports that were not read; at that bound the oldest that is not final is dropped,
 * and when all are final, the oldest. */
int hero_ril_client_open(hero_ril_robot *robot, hero_ril_client **out);

/* Gives up the requests that have no final report yet. */
void hero_ril_client_close(hero_ril_client *client);

/* Sends a request as its struct. A `request_id` of 0 in it is replaced. Here and below, `request_id` (or NULL) gets the id. */
int hero_ril_send(hero_ril_client *client, const hero_ril_service *service, const void *request, size_t size, uint64_t *request_id);
int hero_ril_start(hero_ril_client *client, uint64_t *request_id);
int hero_ril_stop(hero_ril_client *client, uint64_t *request_id);
int hero_ril_take_off(hero_ril_client *client, double altitude_m, uint64_t *request_id);
int hero_ril_land(hero_ril_client *client, int preempt, uint64_t *request_id);
int hero_ril_hold(hero_ril_client *client, uint64_t *request_id);

/* The client's next start, stop, take-off, landing, hold or path is the next step of the command whose last step is `request_id`: the
 * bridge takes it only if nothing came between, and else refuses it as `superseded`, with what did (`between` of the report). Between:
 * an order of any program, the pilot, a safety rule, a loss of the link. hero_ril_send takes the field `after` of the struct instead. */
int hero_ril_follow(hero_ril_client *client, uint64_t request_id);

/* From now on a path of hero_ril_go_to() says what becomes of it when this program ends, or closes the client: a HERO_SENDER_LOST_...,
 * or 0 for the bridge's default, which is hold. With a `lease_ms` of 500 to 60000, the helicopter hovers also when this program does not
 * call a function that looks at the client's reports for so long; 0 is no lease. */
int hero_ril_when_lost(hero_ril_client *client, int sender_lost, int lease_ms);

/* Flies a path of 1 to 1024 waypoints. The id is that of the last waypoint, or of the first one that was refused. */
int hero_ril_go_to(hero_ril_client *client, const hero_ril_waypoint *waypoints, size_t count, int preempt, uint64_t *request_id);

/* Copies the oldest report about the request, of any request for 0; waits for it as long as `timeout_ms`. HERO_RIL_NOTHING when the time
 * is over. HERO_RIL_INVALID at once when the request is not open: read until hero_ril_is_final(). A request whose server is gone ends
 * with the stage `unknown`. */
int hero_ril_next_report(hero_ril_client *client, uint64_t request_id, int32_t timeout_ms, RequestReport *report);
int hero_ril_is_final(const RequestReport *report);

/* Gives up all requests that have no final report yet: their servers see them as gone. */
int hero_ril_give_up(hero_ril_client *client);

/* The same for reports: a descriptor for each service that was sent to. Writes at most `capacity` of them and says how many there
 * are. */
int hero_ril_client_descriptors(hero_ril_client *client, int *descriptors, size_t capacity, size_t *count);

/* Such as "done" and "not-flying"; valid until the thread's next call of the same function. */
const char *hero_ril_stage_name(uint32_t stage);
const char *hero_ril_reason_name(uint32_t reason);

/* ---- Serving requests ---- */

/* Becomes the one server of a request service; a module's own request needs its schema. */
int hero_ril_serve(hero_ril_robot *robot, const hero_ril_service *service, hero_ril_server **out);

/* Open requests end at their clients with the stage `unknown`. */
void hero_ril_server_close(hero_ril_server *server);

/* Takes what is to be done next; waits for it as long as `timeout_ms`.
 *   HERO_RIL_OK:   copies a request, of which `size` is the size of the struct. Answer it by its `ticket`, which is valid until the
 *                  final report.
 *   HERO_RIL_GONE: the client of the request `ticket` gave it up or died. Stop working on it; the ticket is closed.
 * Call it after every wake-up until HERO_RIL_NOTHING, and at least four times a second while requests are open. */
int hero_ril_take(hero_ril_server *server, void *request, size_t size, uint64_t *ticket, int32_t timeout_ms);

/* Answers a request as often as need be: accepted at once, any number of progress, one final report (`stage` from HERO_STAGE_DONE
 * on). `request_id` is filled in, and `reported_ns` if it is 0. HERO_RIL_NOTHING: progress was dropped, because the client does not
 * read; a final report never is. HERO_RIL_GONE: the client is gone; the ticket is closed. */
int hero_ril_report(hero_ril_server *server, uint64_t ticket, const RequestReport *report);

/* As hero_ril_descriptor: readable when there may be something to take. */
int hero_ril_server_descriptor(hero_ril_server *server, int *descriptor);

/* A report that says no more than stage and reason. */
static inline int hero_ril_answer(hero_ril_server *server, uint64_t ticket, uint32_t stage, uint32_t reason) {
    RequestReport report;
    memset(&report, 0, sizeof report);
    report.stage = stage;
    report.reason = reason;
    return hero_ril_report(server, ticket, &report);
}

/* ---- Several at once ---- */

/* Sleeps until one of the sources may have something, or the time is over. Then receive from all of them. Publishers serve their
 * subscribers meanwhile, and do not end it. 16 sources are possible, each handle once; a client counts for each service that it
 * has sent to. */
int hero_ril_wait(const hero_ril_source *sources, size_t count, int32_t timeout_ms);

/* ---- A module ---- */

/* Becomes the module `name`, one word in lower snake case, with an `id` from 1000 to 9999: publishes "<name>/state" at every change and
 * at least once a second, and serves "<name>/control", by the rules of docs/modules.md. A second process of the name gets
 * HERO_RIL_TAKEN. With `takes_signals` other than 0, SIGINT, SIGTERM and SIGHUP end the loop: only one module of a process may take
 * them. */
int hero_ril_module_open(hero_ril_robot *robot, const char *name, uint32_t id, int takes_signals, hero_ril_module **out);
void hero_ril_module_close(hero_ril_module *module);

/* As hero_ril_wait, for at most 13 sources, or none; also serves the control and publishes the state. The first call tells systemd that the
 * process is ready; later ones keep its watchdog content. After HERO_RIL_STOPPED end what is under way before the next call, which
 * reports the stop as done. After HERO_RIL_ENDING close everything and return from main. Call it at once after every event. */
int hero_ril_module_wait(hero_ril_module *module, const hero_ril_source *sources, size_t count, int32_t timeout_ms);

/* As hero_ril_serve; each request is taken once: one that is sent again with the same id gets the reports of the first, and one whose
 * `begin_by_ns` has passed is refused. HERO_RIL_GONE never comes: carry a request out, and report its end, whether or not its client is
 * there. */
int hero_ril_module_serve(hero_ril_robot *robot, const hero_ril_service *service, hero_ril_server **out);

/* Whether the module may command anything: it was started, and neither a stop nor an error has ended that. */
int hero_ril_module_is_started(hero_ril_module *module);

/* Begins work: `functionality` is the module's own number of what it does, `doing` the same in up to 48 letters of ASCII, `on_stop` a
 * hero_ril_on_stop. HERO_RIL_NOTHING, and no work begins, when the module was not started. */
int hero_ril_module_begin(hero_ril_module *module, uint32_t functionality, const char *doing, int on_stop);

/* The work ended as it should. */
int hero_ril_module_done(hero_ril_module *module);

/* The work ended early, with an error of the module's own from 1000 to 9999: the module is blocked until the next start. */
int hero_ril_module_fail(hero_ril_module *module, uint32_t error);

/* ---- The robot's own topics and request services ---- */

static inline hero_ril_topic hero_ril_dsp_telemetry(void) {
    hero_ril_topic topic = {"dsp_telemetry", HERO_DSP_TELEMETRY_LAYOUT_HASH, NULL, sizeof(DspTelemetry)};
    return topic;
}

static inline hero_ril_topic hero_ril_hero_telemetry(void) {
    hero_ril_topic topic = {"hero_telemetry", HERO_HERO_TELEMETRY_LAYOUT_HASH, NULL, sizeof(HeroTelemetry)};
    return topic;
}

static inline hero_ril_topic hero_ril_module_state(void) {
    hero_ril_topic topic = {"module_state", HERO_MODULE_STATE_LAYOUT_HASH, NULL, sizeof(ModuleState)};
    return topic;
}

/* Of the relay: how its link is, on a station's machine. */
static inline hero_ril_topic hero_ril_relay_link(void) {
    hero_ril_topic topic = {"relay/link", HERO_RELAY_LINK_LAYOUT_HASH, NULL, sizeof(RelayLink)};
    return topic;
}

/* Of the relay: which stations there are, on a robot's machine. */
static inline hero_ril_topic hero_ril_relay_stations(void) {
    hero_ril_topic topic = {"relay/stations", HERO_RELAY_STATIONS_LAYOUT_HASH, NULL, sizeof(RelayStations)};
    return topic;
}

static inline hero_ril_service hero_ril_movement(void) {
    hero_ril_service service = {"movement", HERO_MOVEMENT_LAYOUT_HASH, NULL, sizeof(MovementData)};
    return service;
}

static inline hero_ril_service hero_ril_parameters(void) {
    hero_ril_service service = {"parameters", HERO_PARAMETERS_LAYOUT_HASH, NULL, sizeof(ParameterRequest)};
    return service;
}

/* Start and stop: of the bridge as "module_control", of every other module as "<module>/control". */
static inline hero_ril_service hero_ril_control(const char *key) {
    hero_ril_service service = {key, HERO_MODULE_CONTROL_LAYOUT_HASH, NULL, sizeof(ModuleControl)};
    return service;
}

#ifdef __cplusplus
}
#endif

#endif
