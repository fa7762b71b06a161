/* See hero_consumer.h. flock needs more than plain C. */
#define _DEFAULT_SOURCE

#include "hero_consumer.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "iox2/iceoryx2.h"

/* Longest sleep: iceoryx2 0.10 can lose a wake-up, so that no sleep may be without a bound. */
#define SAFETY_BOUND_NS 100000000u

/* Longest name of a service and longest path, with the final zero; what is longer is refused. */
#define NAME_SIZE 128
#define PATH_SIZE 256

const hero_topic hero_topic_dsp_telemetry = {"dsp_telemetry", HERO_DSP_TELEMETRY_LAYOUT,
                                             HERO_DSP_TELEMETRY_LAYOUT_HASH, sizeof(DspTelemetry),
                                             _Alignof(DspTelemetry)};
const hero_topic hero_topic_hero_telemetry = {"hero_telemetry", HERO_HERO_TELEMETRY_LAYOUT,
                                              HERO_HERO_TELEMETRY_LAYOUT_HASH, sizeof(HeroTelemetry),
                                              _Alignof(HeroTelemetry)};
const hero_topic hero_topic_module_state = {"module_state", HERO_MODULE_STATE_LAYOUT, HERO_MODULE_STATE_LAYOUT_HASH,
                                            sizeof(ModuleState), _Alignof(ModuleState)};

/* What every sample begins with. */
typedef struct stamp {
    uint64_t sequence;
    uint64_t epoch_ns;
} stamp;
HERO_ASSERT(offsetof(HeroTelemetry, sequence) == offsetof(stamp, sequence));
HERO_ASSERT(offsetof(HeroTelemetry, epoch_ns) == offsetof(stamp, epoch_ns));

struct hero_consumer {
    const hero_topic *topic;
    char name[NAME_SIZE];
    int domain_lock;
    iox2_config_h config;
    iox2_node_h node;
    iox2_port_factory_pub_sub_h samples;
    iox2_port_factory_event_h events;
    iox2_port_factory_event_h arrivals;
    iox2_listener_h listener;
    iox2_subscriber_h subscriber;
    iox2_notifier_h arrival;
    stamp last;
    uint64_t lost;
};

static uint64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/* Holds a shared flock on the file, which may be removed and made anew meanwhile. -1 when it does not exist. */
static int shared_lock(const char *path) {
    for (;;) {
        int file = open(path, O_RDONLY | O_CLOEXEC);
        if (file < 0) {
            return -1;
        }
        while (flock(file, LOCK_SH) != 0 && errno == EINTR) {
        }
        struct stat held, present;
        if (fstat(file, &held) == 0 && stat(path, &present) == 0 && held.st_dev == present.st_dev &&
            held.st_ino == present.st_ino) {
            return file;
        }
        close(file);
    }
}

/* Begins to build a service of the node; the name is copied. NULL when it is no name. */
static iox2_service_builder_h builder(hero_consumer *self, const char *name) {
    iox2_service_name_h service_name = NULL;
    if (iox2_service_name_new(NULL, name, strlen(name), &service_name) != IOX2_OK) {
        return NULL;
    }
    iox2_service_builder_h result =
        iox2_node_service_builder(&self->node, NULL, iox2_cast_service_name_ptr(service_name));
    iox2_service_name_drop(service_name);
    return result;
}

/* Compares the layout of the service with that of hero_ipc.h, before anything of it is opened. */
static enum hero_result check_layout(hero_consumer *self, char *error, size_t error_size) {
    iox2_service_name_h name = NULL;
    if (iox2_service_name_new(NULL, self->name, strlen(self->name), &name) != IOX2_OK) {
        snprintf(error, error_size, "`%s` is no name of a service", self->name);
        return HERO_FAILED;
    }
    iox2_static_config_t details;
    bool is_there = false;
    int result = iox2_service_details(iox2_service_type_e_IPC, iox2_cast_service_name_ptr(name),
                                      iox2_cast_config_ptr(self->config), iox2_messaging_pattern_e_PUBLISH_SUBSCRIBE,
                                      &details, &is_there);
    iox2_service_name_drop(name);
    if (result != IOX2_OK) {
        snprintf(error, error_size, "service `%s` cannot be looked at: error %d of iceoryx2", self->name, result);
        return HERO_FAILED;
    }
    if (!is_there) {
        snprintf(error, error_size, "nobody has opened `%s`: start `ril status` or `ril bridge`", self->name);
        return HERO_NOT_THERE;
    }
    iox2_attribute_set_ptr attributes = iox2_cast_attribute_set_ptr(details.attributes);
    char layout[NAME_SIZE] = "nothing", hash[NAME_SIZE] = "";
    bool has_value = false;
    iox2_attribute_set_key_value(attributes, "layout", 0, layout, sizeof(layout), &has_value);
    iox2_attribute_set_key_value(attributes, "layout_hash", 0, hash, sizeof(hash), &has_value);
    iox2_attribute_set_drop(details.attributes);
    if (strcmp(layout, self->topic->layout) == 0 && strcmp(hash, self->topic->layout_hash) == 0) {
        return HERO_OK;
    }
    snprintf(error, error_size,
             "service `%s` carries `%s %s`, this program was built for `%s %s`: build it with the hero_ipc.h of the same "
             "version as the RIL",
             self->name, layout, hash, self->topic->layout, self->topic->layout_hash);
    return HERO_FAILED;
}

/* Opens the services and makes the ports. What was made before a failure is given back by hero_consumer_close. */
static bool make_ports(hero_consumer *self) {
    iox2_node_builder_h node_builder = iox2_node_builder_new(NULL);
    iox2_node_builder_set_config(&node_builder, &self->config);
    iox2_node_builder_set_signal_handling_mode(&node_builder, iox2_signal_handling_mode_e_DISABLED);
    if (iox2_node_builder_create(node_builder, NULL, iox2_service_type_e_IPC, &self->node) != IOX2_OK) {
        return false;
    }
    char arrivals[NAME_SIZE + sizeof("/subscribers")];
    snprintf(arrivals, sizeof(arrivals), "%s/subscribers", self->name);
    iox2_service_builder_h of_samples = builder(self, self->name);
    iox2_service_builder_h of_events = builder(self, self->name);
    iox2_service_builder_h of_arrivals = builder(self, arrivals);
    if (of_samples == NULL || of_events == NULL || of_arrivals == NULL) {
        return false;
    }
    iox2_service_builder_pub_sub_h pub_sub = iox2_service_builder_pub_sub(of_samples);
    const hero_topic *topic = self->topic;
    if (iox2_service_builder_pub_sub_set_payload_type_details(&pub_sub, iox2_type_variant_e_FIXED_SIZE, topic->layout,
                                                              strlen(topic->layout), topic->size,
                                                              topic->align) != IOX2_OK ||
        iox2_service_builder_pub_sub_open(pub_sub, NULL, &self->samples) != IOX2_OK ||
        iox2_service_builder_event_open(iox2_service_builder_event(of_events), NULL, &self->events) != IOX2_OK ||
        iox2_service_builder_event_open(iox2_service_builder_event(of_arrivals), NULL, &self->arrivals) != IOX2_OK) {
        return false;
    }
    /* The notifier comes last: its creation tells the publisher that somebody waits for the latest sample. */
    return iox2_port_factory_listener_builder_create(iox2_port_factory_event_listener_builder(&self->events, NULL), NULL,
                                                     &self->listener) == IOX2_OK &&
           iox2_port_factory_subscriber_builder_create(iox2_port_factory_pub_sub_subscriber_builder(&self->samples, NULL),
                                                       NULL, &self->subscriber) == IOX2_OK &&
           iox2_port_factory_notifier_builder_create(iox2_port_factory_event_notifier_builder(&self->arrivals, NULL), NULL,
                                                     &self->arrival) == IOX2_OK;
}

/* Everything that needs the domain, whose lock is held. */
static enum hero_result open_in(hero_consumer *self, const char *root, char *error, size_t error_size) {
    char path[PATH_SIZE];
    snprintf(path, sizeof(path), "%s/iceoryx2.toml", root);
    if (access(path, R_OK) != 0) {
        snprintf(error, error_size, "`%s` does not exist yet: the RIL is just starting, try again", path);
        return HERO_NOT_THERE;
    }
    iox2_set_log_level_from_env_or(iox2_log_level_e_ERROR);
    iox2_config_ptr global = NULL;
    if (iox2_config_setup_global_config_from_file(&global, path) != IOX2_OK) {
        snprintf(error, error_size, "iceoryx2 cannot read `%s`", path);
        return HERO_FAILED;
    }
    iox2_config_from_ptr(global, NULL, &self->config);
    enum hero_result result = check_layout(self, error, error_size);
    if (result == HERO_OK && !make_ports(self)) {
        snprintf(error, error_size, "service `%s` cannot be opened: the log of iceoryx2 (IOX2_LOG_LEVEL=debug) says why",
                 self->name);
        result = HERO_FAILED;
    }
    return result;
}

enum hero_result hero_consumer_open(hero_consumer **consumer, const hero_topic *topic, uint32_t robot, char *error,
                                    size_t error_size) {
    *consumer = NULL;
    char root[PATH_SIZE - NAME_SIZE], path[PATH_SIZE];
    const char *chosen = getenv("RIL_IPC_ROOT");
    int length = chosen != NULL ? snprintf(root, sizeof(root), "%s", chosen)
                                : snprintf(root, sizeof(root), "/dev/shm/hero%lu", (unsigned long)getuid());
    if (length < 0 || (size_t)length >= sizeof(root)) {
        snprintf(error, error_size, "RIL_IPC_ROOT is too long");
        return HERO_FAILED;
    }
    hero_consumer *self = calloc(1, sizeof(*self));
    if (self == NULL) {
        snprintf(error, error_size, "no memory");
        return HERO_FAILED;
    }
    self->topic = topic;
    snprintf(self->name, sizeof(self->name), "hero/%" PRIu32 "/%s", robot, topic->key);
    /* Whoever holds this lock keeps the domain; it goes last. */
    snprintf(path, sizeof(path), "%s/domain.lock", root);
    self->domain_lock = shared_lock(path);
    if (self->domain_lock < 0) {
        snprintf(error, error_size, "`%s` cannot be opened: nothing of the RIL runs, start it first", path);
        free(self);
        return HERO_NOT_THERE;
    }
    /* Whoever holds this one is making something, which must not be taken for the remains of a dead process. */
    snprintf(path, sizeof(path), "%s/making.lock", root);
    int making_lock = shared_lock(path);
    enum hero_result result = open_in(self, root, error, error_size);
    if (making_lock >= 0) {
        close(making_lock);
    }
    if (result == HERO_OK) {
        *consumer = self;
    } else {
        hero_consumer_close(self);
    }
    return result;
}

static void ignore(const iox2_event_id_t *id, uint64_t count, iox2_callback_context context) {
    (void)id;
    (void)count;
    (void)context;
}

int hero_consumer_wait(hero_consumer *self, uint32_t timeout_ms) {
    uint64_t end_ns = monotonic_ns() + (uint64_t)timeout_ms * 1000000u;
    for (;;) {
        bool has_samples = false;
        if (iox2_subscriber_has_samples(&self->subscriber, &has_samples) != IOX2_OK) {
            return -1;
        }
        uint64_t now_ns = monotonic_ns();
        if (has_samples || now_ns >= end_ns) {
            return has_samples;
        }
        uint64_t left_ns = end_ns - now_ns, count = 0;
        uint32_t sleep_ns = left_ns < SAFETY_BOUND_NS ? (uint32_t)left_ns : SAFETY_BOUND_NS;
        int result = iox2_listener_timed_wait(&self->listener, &count, ignore, NULL, 0, sleep_ns);
        if (result == (int)iox2_listener_wait_error_e_INTERRUPT_SIGNAL) {
            return 0;
        }
        if (result != IOX2_OK) {
            return -1;
        }
    }
}

/* Counts a sample and says whether to believe it: neither seen before, nor the rest of an earlier publisher. */
static bool is_next(hero_consumer *self, const stamp *next) {
    const stamp *last = &self->last;
    /* A publisher that begins in the future would leave no room for a later one. */
    if (next->sequence == 0 || next->epoch_ns > monotonic_ns() || next->epoch_ns < last->epoch_ns) {
        return false;
    }
    bool is_same = next->epoch_ns == last->epoch_ns;
    if (is_same && next->sequence <= last->sequence) {
        return false;
    }
    /* The first sample of all begins the count wherever it stands. */
    if (last->sequence > 0) {
        self->lost += next->sequence - 1 - (is_same ? last->sequence : 0);
    }
    self->last = *next;
    return true;
}

int hero_consumer_next(hero_consumer *self, void *copy) {
    for (;;) {
        iox2_sample_h sample = NULL;
        if (iox2_subscriber_receive(&self->subscriber, NULL, &sample) != IOX2_OK) {
            return -1;
        }
        if (sample == NULL) {
            return 0;
        }
        const void *payload = NULL;
        iox2_sample_payload(&sample, &payload, NULL);
        memcpy(copy, payload, self->topic->size);
        /* A subscriber may hold two samples; what was read is given back at once. */
        iox2_sample_drop(sample);
        stamp next;
        memcpy(&next, copy, sizeof(next));
        if (is_next(self, &next)) {
            return 1;
        }
    }
}

uint64_t hero_consumer_lost(const hero_consumer *self) {
    return self->lost;
}

void hero_consumer_close(hero_consumer *self) {
    if (self == NULL) {
        return;
    }
    if (self->arrival != NULL) {
        iox2_notifier_drop(self->arrival);
    }
    if (self->subscriber != NULL) {
        iox2_subscriber_drop(self->subscriber);
    }
    if (self->listener != NULL) {
        iox2_listener_drop(self->listener);
    }
    if (self->arrivals != NULL) {
        iox2_port_factory_event_drop(self->arrivals);
    }
    if (self->events != NULL) {
        iox2_port_factory_event_drop(self->events);
    }
    if (self->samples != NULL) {
        iox2_port_factory_pub_sub_drop(self->samples);
    }
    if (self->node != NULL) {
        iox2_node_drop(self->node);
    }
    if (self->config != NULL) {
        iox2_config_drop(self->config);
    }
    close(self->domain_lock);
    free(self);
}
