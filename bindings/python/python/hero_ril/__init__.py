"""Telemetry, requests, and topics and request services of one's own, for the HERO's Robot Implementation Layer.

    with hero_ril.Robot() as robot:
        for report in robot.take_off(10):
            print(report.stage, report.reason)
        for sample in robot.telemetry():
            print(sample.geodetic.altitude_m)

Samples and reports are ctypes structures, copies of what lies in shared memory: see `hero_ril.structs`. A recorded flight is read
as frames of pandas: see `Flight`.

Every object belongs to one thread at a time, but a server and its orders may be used by several. Iterations can be `for` or, in
asyncio, `async for`.
"""

import asyncio
import contextlib
import ctypes
import os
import weakref

from . import structs
from ._names import KEYS
from ._native import (
    FullError,
    LayoutError,
    NotThereError,
    RilError,
    Robot as _Robot,
    TakenError,
    count_fork as _count_fork,
    reason as reason_name,
    reason_code,
    request_slice,
    stage as stage_name,
    stage_code,
)
from ._schema import schema_of, structure_of
from .flight import Flight
from .geo import LocalFrame, Offset, Place, utc
from .loop import Every, Loop, every
from .module import Module, ranged
from .structs import DspTelemetry, HeroTelemetry, ModuleState, RequestReport

__all__ = [
    "DspTelemetry",
    "Every",
    "Flight",
    "FullError",
    "HeroTelemetry",
    "LayoutError",
    "LocalFrame",
    "Loop",
    "Losses",
    "Module",
    "ModuleState",
    "NotThereError",
    "Offset",
    "Order",
    "Place",
    "Publisher",
    "Report",
    "Request",
    "RequestFailed",
    "RilError",
    "Robot",
    "Server",
    "Subscriber",
    "TakenError",
    "every",
    "ranged",
    "reason_name",
    "request_slice",
    "schema_of",
    "stage_name",
    "structs",
    "utc",
]

# In a child, what its parent has made raises an error.
os.register_at_fork(after_in_child=_count_fork)

_OWN_TOPICS = {
    "dsp_telemetry": DspTelemetry,
    "hero_telemetry": HeroTelemetry,
    "module_state": ModuleState,
}


class Losses:
    """What a subscriber got and missed; `joined_late`: samples before the first, of a publisher that began earlier."""

    def __init__(self, received, lost, joined_late, repeated, publisher_restarts):
        self.received = received
        self.lost = lost
        self.joined_late = joined_late
        self.repeated = repeated
        self.publisher_restarts = publisher_restarts

    def __repr__(self):
        return f"Losses(received={self.received}, lost={self.lost}, joined_late={self.joined_late}, repeated={self.repeated}, publisher_restarts={self.publisher_restarts})"


class Report:
    """One answer about a request: `raw` is the structure, `stage` and `reason` are names such as "done" and "none"."""

    def __init__(self, raw, is_final):
        self.raw = raw
        self.is_final = is_final

    @property
    def stage(self):
        return stage_name(self.raw.stage)

    @property
    def reason(self):
        return reason_name(self.raw.reason)

    def __repr__(self):
        return f"Report({self.stage!r}, {self.reason!r})"


class RequestFailed(RilError):
    """A request ended otherwise than done. `report` is its final report."""

    def __init__(self, what, report):
        super().__init__(f"{what}: {report.stage}, {report.reason}")
        self.report = report


class _Closing:
    """Closes its handle at the end of a `with` statement."""

    def close(self):
        self._native.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class _Port(_Closing):
    """A port of a robot: one that is dropped gives up its place in the service."""

    def __del__(self):
        # Not when it was never made, and not at the end of the program.
        with contextlib.suppress(Exception):
            self.close()


def _check_instance(value, struct):
    if not isinstance(value, struct):
        raise TypeError(f"{struct.__name__} is wanted, not {type(value).__name__}")


#: By event loop and descriptor: the tasks that wait for it. An event loop itself knows one reader of a descriptor.
_waiting = weakref.WeakKeyDictionary()


def _wake(waiting):
    for is_ready in waiting:
        if not is_ready.done():
            is_ready.set_result(None)


async def _readable(descriptors):
    """Sleeps until one of the descriptors can be read, which each is every 0.25 s in any case, unless it was closed meanwhile."""
    loop = asyncio.get_running_loop()
    all_waiting = _waiting.setdefault(loop, {})
    is_ready = loop.create_future()
    for descriptor in descriptors:
        waiting = all_waiting.setdefault(descriptor, [])
        if not waiting:
            loop.add_reader(descriptor, _wake, waiting)
        waiting.append(is_ready)
    try:
        await asyncio.wait_for(is_ready, 1.0)
    except asyncio.TimeoutError:
        pass
    finally:
        for descriptor in descriptors:
            all_waiting[descriptor].remove(is_ready)
            if not all_waiting[descriptor]:
                del all_waiting[descriptor]
                loop.remove_reader(descriptor)


class Subscriber(_Port):
    """The reading end of a topic. Iterating gives every sample and waits for the next one."""

    def __init__(self, native, struct, timeout=None):
        self._native = native
        #: The ctypes structure of a sample.
        self.struct = struct or structure_of(*native.describe())
        self._from = self.struct.from_buffer_copy
        self._timeout = timeout

    def receive(self, timeout=None):
        """The oldest sample that was not received yet; waits as long as `timeout` seconds, or without a limit. Returns None when
        the time is over."""
        sample = self._native.receive(timeout)
        return None if sample is None else self._from(sample)

    def latest(self):
        """The newest sample that was not received yet, or None; older ones are dropped."""
        sample = self._native.latest()
        return None if sample is None else self._from(sample)

    def array(self):
        """All samples that are there, as an array of NumPy."""
        import numpy

        return numpy.frombuffer(self._native.drain(), dtype=self.dtype)

    @property
    def dtype(self):
        """The structure as a dtype of NumPy."""
        import numpy

        return numpy.dtype(self.struct)

    @property
    def losses(self):
        return Losses(*self._native.losses())

    def fileno(self):
        """For `select` and event loops: readable when there may be samples, and every 0.25 s in any case. Receive until None then."""
        return self._native.descriptor()

    def _descriptors(self):
        return [self.fileno()]

    def _take_all(self, callback):
        while (sample := self.receive(0)) is not None:
            callback(sample)
        return True

    def __iter__(self):
        return self

    def __next__(self):
        sample = self.receive(self._timeout)
        if sample is None:
            raise StopIteration
        return sample

    def __aiter__(self):
        return self

    async def __anext__(self):
        waited = 0.0
        loop = asyncio.get_running_loop()
        began = loop.time()
        while (sample := self.receive(0)) is None:
            waited = loop.time() - began
            if self._timeout is not None and waited >= self._timeout:
                raise StopAsyncIteration
            await _readable([self._native.descriptor()])
        return sample


class Publisher(_Port):
    """The writing end of a topic, of which a robot has one. Subscribers that join get the latest sample from a thread of its own."""

    def __init__(self, native, struct):
        self._native = native
        self.struct = struct

    def publish(self, sample):
        """Publishes a copy of the structure and returns its number, from 1. `sequence` and `epoch_ns` are filled in."""
        _check_instance(sample, self.struct)
        return self._native.publish(bytes(sample))


class Request:
    """A request that was sent. Iterating gives its reports, and raises RequestFailed after a final one that is not done."""

    def __init__(self, native, what, request_id):
        self._native = native
        self._what = what
        self.id = request_id
        #: The final report, when it was read.
        self.final = None

    def next(self, timeout=None):
        """The next report, or None when the time is over or the final one was read."""
        if self.final is not None:
            return None
        answer = self._native.next_report(self.id, timeout)
        if answer is None:
            return None
        raw, is_final = answer
        report = Report(RequestReport.from_buffer_copy(raw), is_final)
        if is_final:
            self.final = report
        return report

    def wait(self):
        """The final report; raises RequestFailed unless it is done."""
        for _ in self:
            pass
        return self.final

    def _descriptors(self):
        return self._native.descriptors()

    def _take_all(self, callback):
        while (report := self.next(0)) is not None:
            callback(report)
        return self.final is None

    def _check(self):
        if self.final is not None and self.final.stage != "done":
            raise RequestFailed(self._what, self.final)

    def __iter__(self):
        while (report := self.next()) is not None:
            yield report
        self._check()

    async def __aiter__(self):
        while self.final is None:
            report = self.next(0)
            if report is None:
                await _readable(self._native.descriptors())
                continue
            yield report
        self._check()

    def __await__(self):
        return self._finish().__await__()

    async def _finish(self):
        async for _ in self:
            pass
        return self.final


class Order:
    """A request that a server has taken. `data` is its structure.

    Answer it with `accept()`, any number of `progress()`, and one of `done()`, `refuse()` and `abort()`, from any thread, also while
    another one waits for the next request; each returns whether the client is still there. In a `with` statement, a request without a final report ends as done, or as aborted after an exception. An
    order that is dropped without a final report ends as aborted, so that no client waits in vain.
    """

    def __init__(self, server, ticket, data):
        self._server = server
        self._ticket = ticket
        #: The structure that was sent.
        self.data = data
        #: Whether the client gave the request up or died, as far as the server knows: it looks whenever it receives.
        self.is_vanished = False
        #: Whether a final report was sent.
        self.is_over = False

    @property
    def is_open(self):
        return not (self.is_vanished or self.is_over)

    def report(self, stage, reason="none", **fields):
        """Sends a report: names of stage and reason, and other fields of RequestReport."""
        raw = RequestReport(stage=stage_code(stage), reason=reason_code(reason), **fields)
        if not self.is_open:
            return False
        outcome = self._server._native.report(self._ticket, bytes(raw))
        if outcome == "gone":
            self.is_vanished = True
        elif raw.stage >= structs.Stage.DONE:
            self.is_over = True
        if not self.is_open:
            self._server._orders.pop(self._ticket, None)
        return not self.is_vanished

    def accept(self, **fields):
        return self.report("accepted", **fields)

    def progress(self, **fields):
        """Says how far it is. It is dropped when the client does not read."""
        return self.report("progress", **fields)

    def done(self, **fields):
        return self.report("done", **fields)

    def refuse(self, reason, **fields):
        """Refuses it: nothing was done. The reason is a name such as "busy"."""
        return self.report("refused", reason, **fields)

    def abort(self, reason="none", **fields):
        """Ends it early."""
        return self.report("aborted", reason, **fields)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if self.is_open:
            self.report("done" if kind is None else "aborted")

    def __del__(self):
        # Not at the end of the program, when the server is closed: its clients see that.
        with contextlib.suppress(Exception):
            self.abort()

    def __repr__(self):
        return f"Order({type(self.data).__name__}, request_id={self.data.request_id})"


class Server(_Port):
    """The server of a request service, of which a robot has one. Iterating gives every request and waits for the next one."""

    def __init__(self, native, struct):
        self._native = native
        #: The ctypes structure of a request.
        self.struct = struct
        # Orders that the program has forgotten are of no interest when their clients vanish.
        self._orders = weakref.WeakValueDictionary()

    def receive(self, timeout=None):
        """The next request; waits as long as `timeout` seconds, or without a limit. Returns None when the time is over, and when the
        client of an open request is found to be gone: `is_vanished` of that order says so then."""
        taken = self._native.take(timeout)
        return None if taken is None else self._order(*taken)

    def _order(self, ticket, request):
        if request is None:
            order = self._orders.pop(ticket, None)
            if order is not None:
                order.is_vanished = True
            return None
        order = Order(self, ticket, self.struct.from_buffer_copy(request))
        self._orders[ticket] = order
        return order

    def fileno(self):
        """For `select` and event loops: readable when there may be something to receive, and every 0.25 s in any case. Receive until
        None then."""
        return self._native.descriptor()

    def _descriptors(self):
        return [self.fileno()]

    def _take_all(self, callback):
        while (taken := self._native.take(0)) is not None:
            order = self._order(*taken)
            if order is not None:
                callback(order)
        return True

    def __iter__(self):
        return self

    def __next__(self):
        while (order := self.receive()) is None:
            pass
        return order

    def __aiter__(self):
        return self

    async def __anext__(self):
        while (order := self.receive(0)) is None:
            await _readable([self._native.descriptor()])
        return order


class Robot(_Closing):
    """A part in the shared memory of a robot. Use it in a `with` statement, so that nothing is left behind.

    `name` is what other processes see. `root` is the folder of the shared memory, by default RIL_IPC_ROOT or the user's own.
    """

    def __init__(self, robot=1, name="python", root=None):
        self._begin(_Robot(robot, name, root))

    @classmethod
    def _of(cls, native):
        robot = cls.__new__(cls)
        robot._begin(native)
        return robot

    def _begin(self, native):
        self._native = native
        #: Those that the program still has.
        self._ports = weakref.WeakSet()
        self._client = None

    def close(self):
        """Closes everything that was made with it."""
        for port in list(self._ports):
            port.close()
        if self._client is not None:
            self._client.close()
            self._client = None
        self._native.close()

    def _keep(self, port):
        self._ports.add(port)
        return port

    # Topics

    def subscribe(self, key, struct=None, *, schema=None, timeout=None):
        """Subscribes to a topic, such as "battery_watch/cell_voltages". The robot's own are called as in recordings and in `ril echo`:
        "hero/telemetry", "hero" or "hero_telemetry".

        With a structure or a schema the publisher need not be there yet; without, the structure is made from the schema that lies
        beside the topic. An iteration ends when there was no sample for `timeout` seconds.
        """
        key = KEYS.get(key, key)
        own = _OWN_TOPICS.get(key)
        layout_hash = None
        if struct is None and schema is None and own is not None:
            struct, layout_hash = own, structs.LAYOUTS[key][1]
        elif struct is not None and schema is None:
            schema = schema_of(struct)
        size = 0 if struct is None else ctypes.sizeof(struct)
        subscriber = Subscriber(self._native.subscribe(key, layout_hash, schema, size), struct, timeout)
        return self._keep(subscriber)

    def telemetry(self, timeout=None):
        """Telemetry in SI units."""
        return self.subscribe("hero_telemetry", timeout=timeout)

    def dsp_telemetry(self, timeout=None):
        """Raw telemetry of the DSP."""
        return self.subscribe("dsp_telemetry", timeout=timeout)

    def module_state(self, timeout=None):
        """State of the bridge and of the movement under way."""
        return self.subscribe("module_state", timeout=timeout)

    def advertise(self, key, struct, *, schema=None, patience=None):
        """Becomes the publisher of a topic that carries the structure; `schema` says the same with comments, if it is given. With
        `patience`, for tests, a sample waits up to so many seconds while a subscriber's queue is full, and for the first subscriber."""
        native = self._native.advertise(key, schema or schema_of(struct), ctypes.sizeof(struct), patience)
        return self._keep(Publisher(native, struct))

    def topics(self):
        """Key, layout and publishing process of every topic that there is."""
        return self._native.topics()

    # Requests

    def _requests(self):
        if self._client is None:
            self._client = self._native.client()
        return self._client

    def _ordered(self, what, after, send):
        client = self._requests()
        client.follow(0 if after is None else after.id)
        return Request(client, what, send(client))

    # With `after`, the Request that was the step before, an order is the next step of a command: the bridge takes it only if nothing
    # came between (an order of any program, the pilot, a safety rule, a loss of the link), and else refuses it as "superseded".

    def start(self, *, after=None):
        """Starts the module."""
        return self._ordered("start", after, lambda client: client.start())

    def stop(self, *, after=None):
        """Stops the module."""
        return self._ordered("stop", after, lambda client: client.stop())

    def take_off(self, altitude_m, *, after=None):
        """Takes off and climbs to so many meters over this point."""
        return self._ordered("take off", after, lambda client: client.take_off(altitude_m))

    def land(self, *, preempt=False, after=None):
        """Lands here; with `preempt` out of a path that is under way."""
        return self._ordered("land", after, lambda client: client.land(preempt))

    def hold(self, *, after=None):
        """Hovers here; a path that is under way ends as replaced."""
        return self._ordered("hold", after, lambda client: client.hold())

    def when_lost(self, action=None, *, lease_s=0.0):
        """From now on a path says what becomes of it when this program ends: a `SenderLost`, or None for the bridge's default, which
        is to hover. With `lease_s`, the helicopter hovers also when this program does not look at its reports for so long."""
        self._requests().when_lost(int(action or 0), round(1000 * lease_s))

    def go_to(self, *path, preempt=False, after=None):
        """Flies a path of (latitude in degrees, longitude in degrees, altitude in m)."""
        return self._ordered("go to", after, lambda client: client.go_to(list(path), preempt))

    def send(self, key, request, *, schema=None):
        """Sends a structure as a request of the service `key`, such as ParameterRequest to "parameters", ModuleControl to
        "battery_watch/control", or a structure of your own to a module. A `request_id` of 0 is replaced."""
        _check_instance(request, ctypes.Structure)
        schema = schema or schema_of(type(request))
        return Request(self._requests(), key, self._requests().send(key, bytes(request), None, schema))

    def serve(self, key, struct, *, schema=None, once=False):
        """Becomes the server of the request service `key`, whose requests carry the structure; `schema` says the same with
        comments, if it is given. With `once` each request is handed on once: see `Module.serve`."""
        native = self._native.serve(key, schema or schema_of(struct), ctypes.sizeof(struct), once)
        return self._keep(Server(native, struct))
