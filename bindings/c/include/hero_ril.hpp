/* The HERO RIL for C++17: hero_ril.h with objects that close themselves, structs as types, and exceptions.
 *
 * One header over the same library; what it says of threads holds here as well: use an object in one thread at a time.
 */
#ifndef HERO_RIL_HPP
#define HERO_RIL_HPP

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "hero_ril.h"

namespace hero_ril {

/* What a call to the library ended with. */
class Error : public std::runtime_error {
  public:
    Error(int code, const std::string &text) : std::runtime_error(text), code_(static_cast<hero_ril_result>(code)) {}

    hero_ril_result code() const noexcept { return code_; }

  private:
    hero_ril_result code_;
};

/* A request ended otherwise than done. */
class RequestFailed : public std::runtime_error {
  public:
    explicit RequestFailed(const RequestReport &report)
        : std::runtime_error(std::string(hero_ril_stage_name(report.stage)) + ": " +
                             hero_ril_reason_name(report.reason)),
          report_(report) {}

    const RequestReport &report() const noexcept { return report_; }

  private:
    RequestReport report_;
};

using Milliseconds = std::chrono::milliseconds;
using Waypoint = hero_ril_waypoint;
using Losses = hero_ril_losses;
using Offset = hero_ril_offset;

/* Waits without a limit. A negative time does not wait. */
inline constexpr Milliseconds FOREVER = Milliseconds::max();

/* Which topic carries a struct. For a struct of your own: HERO_RIL_TOPIC. */
template <class T> struct TopicOf;

template <> struct TopicOf<DspTelemetry> {
    static hero_ril_topic get() { return hero_ril_dsp_telemetry(); }
};
template <> struct TopicOf<HeroTelemetry> {
    static hero_ril_topic get() { return hero_ril_hero_telemetry(); }
};
template <> struct TopicOf<ModuleState> {
    static hero_ril_topic get() { return hero_ril_module_state(); }
};
template <> struct TopicOf<RelayLink> {
    static hero_ril_topic get() { return hero_ril_relay_link(); }
};
template <> struct TopicOf<RelayStations> {
    static hero_ril_topic get() { return hero_ril_relay_stations(); }
};

/* Which request service carries a struct. For a struct of your own: HERO_RIL_REQUEST. */
template <class T> struct RequestOf;

template <> struct RequestOf<MovementData> {
    static hero_ril_service get() { return hero_ril_movement(); }
};
template <> struct RequestOf<ParameterRequest> {
    static hero_ril_service get() { return hero_ril_parameters(); }
};
template <> struct RequestOf<ModuleControl> {
    static hero_ril_service get() { return hero_ril_control("module_control"); }
};

/* Declares the request service of a struct of your own, outside of every namespace: its key, and its schema or nullptr. */
#define HERO_RIL_REQUEST(Type, key_text, schema_text)                                                                  \
    template <> struct hero_ril::RequestOf<Type> {                                                                     \
        static hero_ril_service get() { return hero_ril_service{key_text, nullptr, schema_text, sizeof(Type)}; }       \
    }

/* Declares the topic of a struct of your own, outside of every namespace: its key, and its schema or nullptr. */
#define HERO_RIL_TOPIC(Type, key_text, schema_text)                                                                    \
    template <> struct hero_ril::TopicOf<Type> {                                                                       \
        static hero_ril_topic get() { return hero_ril_topic{key_text, nullptr, schema_text, sizeof(Type)}; }           \
    }

namespace detail {

inline int check(int result) {
    if (result < 0) {
        throw Error(result, hero_ril_last_error());
    }
    return result;
}

inline std::int32_t milliseconds(Milliseconds timeout) {
    if (timeout.count() > INT32_MAX) {
        return -1;
    }
    return static_cast<std::int32_t>(std::max(timeout, Milliseconds::zero()).count());
}

template <auto close> struct Closer {
    template <class T> void operator()(T *handle) const noexcept { close(handle); }
};

template <class T, auto close> using Handle = std::unique_ptr<T, Closer<close>>;

} // namespace detail

/* A moment of the host's monotonic clock, such as `received_ns`, by the system's clock now; nothing of 0, which is "never". */
inline std::optional<std::chrono::system_clock::time_point> utc(std::uint64_t monotonic_ns) {
    if (monotonic_ns == 0) {
        return std::nullopt;
    }
    std::chrono::nanoseconds since(hero_ril_utc_ns(monotonic_ns));
    return std::chrono::system_clock::time_point(std::chrono::duration_cast<std::chrono::system_clock::duration>(since));
}

inline double degrees(double radians) { return hero_ril_degrees(radians); }

/* Where a sample is, in degrees and as a place to fly to. */
inline Waypoint place_of(const HeroTelemetry &sample) {
    Waypoint place{};
    detail::check(hero_ril_place_of(&sample, &place));
    return place;
}

/* Metres north, east and up of an origin; see hero_ril_offset_of. */
class LocalFrame {
  public:
    explicit LocalFrame(const Waypoint &origin) : origin_(origin) {}

    Offset offset(const Waypoint &place) const {
        Offset offset{};
        detail::check(hero_ril_offset_of(&origin_, &place, &offset));
        return offset;
    }

    Waypoint place(double north_m, double east_m, double up_m = 0.0) const {
        Offset offset{north_m, east_m, up_m};
        Waypoint place{};
        detail::check(hero_ril_place_at(&origin_, &offset, &place));
        return place;
    }

  private:
    Waypoint origin_;
};

/* The reading end of a topic. */
template <class T> class Subscriber {
    static_assert(std::is_trivially_copyable_v<T>, "a sample is a plain struct");

  public:
    explicit Subscriber(hero_ril_robot *robot) {
        hero_ril_topic topic = TopicOf<T>::get();
        hero_ril_subscriber *subscriber = nullptr;
        detail::check(hero_ril_subscribe(robot, &topic, &subscriber));
        handle_.reset(subscriber);
    }

    /* The oldest sample that was not received yet. Nothing when the time is over, or a signal came. */
    std::optional<T> receive(Milliseconds timeout = FOREVER) {
        T sample;
        int result = hero_ril_receive(handle_.get(), &sample, sizeof sample, detail::milliseconds(timeout));
        return detail::check(result) == HERO_RIL_OK ? std::optional<T>(sample) : std::nullopt;
    }

    /* The newest sample that was not received yet; older ones are dropped. */
    std::optional<T> latest() {
        T sample;
        return detail::check(hero_ril_latest(handle_.get(), &sample, sizeof sample)) == HERO_RIL_OK
                   ? std::optional<T>(sample)
                   : std::nullopt;
    }

    /* Calls `take(const T &)` for each sample that is there, without a copy. */
    template <class Take> void for_each(Take &&take) {
        struct Context {
            Take &take;
            std::exception_ptr thrown;
        } context{take, nullptr};
        int result = hero_ril_drain(
            handle_.get(),
            [](const void *sample, size_t, void *pointer) {
                auto *context = static_cast<Context *>(pointer);
                // No exception may pass through the library.
                try {
                    if (!context->thrown) {
                        context->take(*static_cast<const T *>(sample));
                    }
                } catch (...) {
                    context->thrown = std::current_exception();
                }
            },
            &context);
        if (context.thrown) {
            std::rethrow_exception(context.thrown);
        }
        detail::check(result);
    }

    Losses losses() const {
        Losses losses;
        detail::check(hero_ril_count(handle_.get(), &losses));
        return losses;
    }

    /* For poll or an event loop, see hero_ril_descriptor. */
    int descriptor() const {
        int descriptor = -1;
        detail::check(hero_ril_descriptor(handle_.get(), &descriptor));
        return descriptor;
    }

    operator hero_ril_source() const { return {handle_.get(), nullptr, nullptr, nullptr}; }

  private:
    detail::Handle<hero_ril_subscriber, hero_ril_unsubscribe> handle_;
};

/* The writing end of a topic, of which a robot has one. */
template <class T> class Publisher {
    static_assert(std::is_trivially_copyable_v<T>, "a sample is a plain struct");

  public:
    explicit Publisher(hero_ril_robot *robot) {
        hero_ril_topic topic = TopicOf<T>::get();
        hero_ril_publisher *publisher = nullptr;
        detail::check(hero_ril_advertise(robot, &topic, &publisher));
        handle_.reset(publisher);
    }

    /* Publishes a copy and returns its number, from 1. Never blocks. */
    std::uint64_t publish(const T &sample) {
        std::uint64_t sequence = 0;
        detail::check(hero_ril_publish(handle_.get(), &sample, sizeof sample, &sequence));
        return sequence;
    }

    /* Gives the latest sample to subscribers that joined since: when seconds pass between two samples. */
    void tend() { detail::check(hero_ril_tend(handle_.get())); }

    operator hero_ril_source() const { return {nullptr, nullptr, handle_.get(), nullptr}; }

  private:
    detail::Handle<hero_ril_publisher, hero_ril_withdraw> handle_;
};

/* A request that was sent. The client must outlive it. */
class Request {
  public:
    Request(hero_ril_client *client, std::uint64_t id) : client_(client), id_(id) {}

    std::uint64_t id() const noexcept { return id_; }

    /* The next report. Nothing when the time is over, a signal came, or the final report was read. */
    std::optional<RequestReport> next(Milliseconds timeout = FOREVER) {
        RequestReport report;
        if (is_over_ ||
            detail::check(hero_ril_next_report(client_, id_, detail::milliseconds(timeout), &report)) != HERO_RIL_OK) {
            return std::nullopt;
        }
        is_over_ = hero_ril_is_final(&report) != 0;
        return report;
    }

    /* Whether the final report was read. */
    bool is_over() const noexcept { return is_over_; }

    /* Waits for the final report, hands each on, and throws RequestFailed unless the request was done. */
    template <class Take> RequestReport finish(Take &&take) {
        RequestReport last{};
        while (!is_over_) {
            if (auto report = next(Milliseconds(250))) {
                take(*report);
                last = *report;
            }
        }
        if (last.stage != HERO_STAGE_DONE) {
            throw RequestFailed(last);
        }
        return last;
    }

    RequestReport finish() {
        return finish([](const RequestReport &) {});
    }

  private:
    hero_ril_client *client_;
    std::uint64_t id_;
    bool is_over_ = false;
};

/* Sends requests, and follows several at a time. */
class Client {
  public:
    explicit Client(hero_ril_robot *robot) {
        hero_ril_client *client = nullptr;
        detail::check(hero_ril_client_open(robot, &client));
        handle_.reset(client);
    }

    /* The next order is the next step behind this one, see hero_ril_follow: client.after(take_off).go_to(path). */
    Client &after(const Request &step) {
        detail::check(hero_ril_follow(handle_.get(), step.id()));
        return *this;
    }

    Request start() { return sent(hero_ril_start); }
    Request stop() { return sent(hero_ril_stop); }
    Request hold() { return sent(hero_ril_hold); }
    Request take_off(double altitude_m) { return sent(hero_ril_take_off, altitude_m); }
    Request land(bool preempt = false) { return sent(hero_ril_land, preempt ? 1 : 0); }
    /* What becomes of the paths that follow when this program ends (0: the bridge's default), or hangs for the lease (0: none). */
    void when_lost(int sender_lost, int lease_ms = 0) { detail::check(hero_ril_when_lost(handle_.get(), sender_lost, lease_ms)); }

    Request go_to(const std::vector<Waypoint> &path, bool preempt = false) {
        return sent(hero_ril_go_to, path.data(), path.size(), preempt ? 1 : 0);
    }

    /* Waypoints in any other row: an array, or a std::span of C++20. */
    template <class Path> auto go_to(const Path &path, bool preempt = false) -> decltype(std::data(path), Request(nullptr, 0)) {
        return sent(hero_ril_go_to, std::data(path), std::size(path), preempt ? 1 : 0);
    }

    /* A request as its struct. */
    template <class T> Request send(const T &request) { return send(RequestOf<T>::get(), request); }

    /* The same to the service of another key that carries the struct, as "<module>/control" carries ModuleControl. */
    template <class T> Request send(const char *key, const T &request) {
        hero_ril_service service = RequestOf<T>::get();
        service.key = key;
        return send(service, request);
    }

    /* Gives up all requests without a final report. */
    void give_up() { detail::check(hero_ril_give_up(handle_.get())); }

    /* For poll or an event loop, see hero_ril_client_descriptors. */
    std::vector<int> descriptors() const {
        std::array<int, 16> all{};
        std::size_t count = 0;
        detail::check(hero_ril_client_descriptors(handle_.get(), all.data(), all.size(), &count));
        return {all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(count, all.size()))};
    }

    operator hero_ril_source() const { return {nullptr, handle_.get(), nullptr, nullptr}; }

  private:
    template <class T> Request send(const hero_ril_service &service, const T &request) {
        return sent(hero_ril_send, &service, static_cast<const void *>(&request), sizeof request);
    }

    template <class Send, class... Arguments> Request sent(Send send, Arguments... arguments) {
        std::uint64_t id = 0;
        detail::check(send(handle_.get(), arguments..., &id));
        return Request(handle_.get(), id);
    }

    detail::Handle<hero_ril_client, hero_ril_client_close> handle_;
};

/* A request that a server has taken. The server must outlive it. One that is dropped without a final report ends as aborted, so no
 * client waits in vain. */
template <class T> class Order {
  public:
    Order(hero_ril_server *server, std::uint64_t ticket, const T &request)
        : server_(server), ticket_(ticket), request_(request) {}
    Order(Order &&other) noexcept
        : server_(std::exchange(other.server_, nullptr)), ticket_(other.ticket_), request_(other.request_) {}
    Order &operator=(Order &&other) noexcept {
        if (this != &other) {
            abort();
            server_ = std::exchange(other.server_, nullptr);
            ticket_ = other.ticket_;
            request_ = other.request_;
        }
        return *this;
    }
    ~Order() { abort(); }

    const T &operator*() const noexcept { return request_; }
    const T *operator->() const noexcept { return &request_; }
    std::uint64_t ticket() const noexcept { return ticket_; }

    /* Whether neither a final report was sent nor the client found to be gone. */
    bool is_open() const noexcept { return server_ != nullptr; }

    /* Each of these returns whether the client is still there. */
    bool accept() { return report(HERO_STAGE_ACCEPTED); }
    bool progress() { return report(HERO_STAGE_PROGRESS); }
    bool done() { return report(HERO_STAGE_DONE); }
    bool refuse(std::uint32_t reason) { return report(HERO_STAGE_REFUSED, reason); }
    bool abort(std::uint32_t reason) { return report(HERO_STAGE_ABORTED, reason); }

    bool report(std::uint32_t stage, std::uint32_t reason = HERO_REASON_NONE) {
        RequestReport report{};
        report.stage = stage;
        report.reason = reason;
        return this->report(report);
    }

    bool report(const RequestReport &report) {
        if (!is_open()) {
            return false;
        }
        int result = detail::check(hero_ril_report(server_, ticket_, &report));
        if (result == HERO_RIL_GONE || hero_ril_is_final(&report) != 0) {
            server_ = nullptr;
        }
        return result != HERO_RIL_GONE;
    }

    /* For the server: the client is gone. */
    void close() noexcept { server_ = nullptr; }

  private:
    void abort() noexcept {
        if (server_ != nullptr) {
            hero_ril_answer(std::exchange(server_, nullptr), ticket_, HERO_STAGE_ABORTED, HERO_REASON_NONE);
        }
    }

    hero_ril_server *server_;
    std::uint64_t ticket_;
    T request_;
};

/* The server of a request service, of which a robot has one. */
template <class T> class Server {
    static_assert(std::is_trivially_copyable_v<T>, "a request is a plain struct");

  public:
    /* `serve` is hero_ril_serve or hero_ril_module_serve. */
    Server(hero_ril_robot *robot, const hero_ril_service &service, decltype(hero_ril_serve) *serve = hero_ril_serve) {
        hero_ril_server *server = nullptr;
        detail::check(serve(robot, &service, &server));
        handle_.reset(server);
    }

    /* The next request. Nothing when the time is over, a signal came, or a client is found to be gone: see vanished(). */
    std::optional<Order<T>> take(Milliseconds timeout = FOREVER) {
        T request;
        std::uint64_t ticket = 0;
        int result = detail::check(
            hero_ril_take(handle_.get(), &request, sizeof request, &ticket, detail::milliseconds(timeout)));
        if (result == HERO_RIL_GONE) {
            vanished_.push_back(ticket);
        }
        if (result != HERO_RIL_OK) {
            return std::nullopt;
        }
        return Order<T>(handle_.get(), ticket, request);
    }

    /* Tickets of the requests whose clients gave them up or died, each once. Call close() of their orders. */
    std::vector<std::uint64_t> vanished() { return std::exchange(vanished_, {}); }

    /* For poll or an event loop, see hero_ril_server_descriptor. */
    int descriptor() const {
        int descriptor = -1;
        detail::check(hero_ril_server_descriptor(handle_.get(), &descriptor));
        return descriptor;
    }

    operator hero_ril_source() const { return {nullptr, nullptr, nullptr, handle_.get()}; }

  private:
    detail::Handle<hero_ril_server, hero_ril_server_close> handle_;
    std::vector<std::uint64_t> vanished_;
};

/* A module: its state, its control, and the one wait of its loop. See docs/modules.md. */
class Module {
  public:
    Module(hero_ril_robot *robot, const char *name, std::uint32_t id, bool takes_signals) : robot_(robot) {
        hero_ril_module *module = nullptr;
        detail::check(hero_ril_module_open(robot, name, id, takes_signals ? 1 : 0, &module));
        handle_.reset(module);
    }

    /* A server that takes each request once. The robot must be there. */
    template <class T> Server<T> serve() { return Server<T>(robot_, RequestOf<T>::get(), hero_ril_module_serve); }

    /* Sleeps until something happens: HERO_RIL_STARTED, _STOPPED, _ENDING, _OK when a source may have something, or _NOTHING when the
     * time is over. */
    template <class... Sources> hero_ril_result wait(Milliseconds timeout, const Sources &...sources) {
        std::array<hero_ril_source, sizeof...(Sources) + 1> all{static_cast<hero_ril_source>(sources)...};
        return static_cast<hero_ril_result>(detail::check(
            hero_ril_module_wait(handle_.get(), all.data(), sizeof...(Sources), detail::milliseconds(timeout))));
    }

    /* Whether the module may command anything. */
    bool is_started() { return detail::check(hero_ril_module_is_started(handle_.get())) != 0; }

    /* Begins work; false, and none begins, when the module was not started. */
    bool begin(std::uint32_t functionality, const char *doing, hero_ril_on_stop on_stop = HERO_RIL_ABORTS) {
        return detail::check(hero_ril_module_begin(handle_.get(), functionality, doing, on_stop)) == HERO_RIL_OK;
    }

    void done() { detail::check(hero_ril_module_done(handle_.get())); }
    void fail(std::uint32_t error) { detail::check(hero_ril_module_fail(handle_.get(), error)); }

  private:
    hero_ril_robot *robot_;
    detail::Handle<hero_ril_module, hero_ril_module_close> handle_;
};

/* A part in the shared memory of a robot. */
class Robot {
  public:
    explicit Robot(const char *process_name, std::uint32_t robot = 1, const char *root = nullptr) {
        hero_ril_robot *joined = nullptr;
        detail::check(hero_ril_join(root, robot, process_name, &joined));
        handle_.reset(joined);
    }

    template <class T> Subscriber<T> subscribe() { return Subscriber<T>(handle_.get()); }
    template <class T> Publisher<T> advertise() { return Publisher<T>(handle_.get()); }
    Client client() { return Client(handle_.get()); }
    template <class T> Server<T> serve() { return Server<T>(handle_.get(), RequestOf<T>::get()); }

    /* The server of the service of another key that carries the struct, as "<module>/control" carries ModuleControl. */
    template <class T> Server<T> serve(const char *key) {
        hero_ril_service service = RequestOf<T>::get();
        service.key = key;
        return Server<T>(handle_.get(), service);
    }

    /* Becomes the module `name` with an `id` from 1000 to 9999; SIGINT, SIGTERM and SIGHUP end its wait if it takes them. */
    Module module(const char *name, std::uint32_t id, bool takes_signals = true) {
        return Module(handle_.get(), name, id, takes_signals);
    }

  private:
    detail::Handle<hero_ril_robot, hero_ril_leave> handle_;
};

/* How soon the calling thread runs after it was woken: see hero_ril_request_slice. */
inline void request_slice(hero_ril_role role) { detail::check(hero_ril_request_slice(role)); }

/* Sleeps until one of the subscribers, clients, publishers and servers may have something: wait(1s, telemetry, client). Returns false when
 * the time is over or a signal came. */
template <class... Sources> bool wait(Milliseconds timeout, const Sources &...sources) {
    std::array<hero_ril_source, sizeof...(Sources)> all{static_cast<hero_ril_source>(sources)...};
    return detail::check(hero_ril_wait(all.data(), all.size(), detail::milliseconds(timeout))) == HERO_RIL_OK;
}

} // namespace hero_ril

#endif
