"""Telemetry, requests and topics of the HERO's Robot Implementation Layer.

    with hero_ril.Robot() as robot:
        for report in robot.take_off(10):
            print(report.stage, report.reason)
        for sample in robot.telemetry():
            print(sample.geodetic.altitude_m)

Samples and reports are ctypes structures, copies of what lies in shared memory: see `hero_ril.structs`.

Every object belongs to one thread at a time. Iterations can be `for` or, in asyncio, `async for`.
"""

import asyncio
import contextlib

from . import structs
from ._native import (
    RECHECK_S,
    FullError,
    LayoutError,
    NotThereError,
    RilError,
    Robot as _Robot,
    TakenError,
    reason as reason_name,
    stage as stage_name,
)
from ._schema import schema_of, structure_of
from .structs import DspTelemetry, HeroTelemetry, ModuleState, RequestReport

__all__ = [
    "DspTelemetry",
    "FullError",
    "HeroTelemetry",
    "LayoutError",
    "Losses",
    "ModuleState",
    "NotThereError",
    "Publisher",
    "Report",
    "Request",
    "RequestFailed",
    "RilError",
    "Robot",
    "Subscriber",
    "TakenError",
    "reason_name",
    "schema_of",
    "stage_name",
    "structs",
]

_OWN_TOPICS = {
    "dsp_telemetry": DspTelemetry,
    "hero_telemetry": HeroTelemetry,
    "module_state": ModuleState,
}


class Losses:
    """What a subscriber got and missed."""

    def __init__(self, received, lost, repeated, publisher_restarts):
        self.received = received
        self.lost = lost
        self.repeated = repeated
        self.publisher_restarts = publisher_restarts

    def __repr__(self):
        return f"Losses(received={self.received}, lost={self.lost}, repeated={self.repeated}, publisher_restarts={self.publisher_restarts})"


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


async def _readable(descriptors):
    """Sleeps until one of the descriptors can be read, and no longer than the contract allows."""
    loop = asyncio.get_running_loop()
    is_ready = loop.create_future()

    def ready():
        if not is_ready.done():
            is_ready.set_result(None)

    for descriptor in descriptors:
        loop.add_reader(descriptor, ready)
    try:
        await asyncio.wait_for(is_ready, RECHECK_S)
    except asyncio.TimeoutError:
        pass
    finally:
        for descriptor in descriptors:
            loop.remove_reader(descriptor)


class Subscriber(_Closing):
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
        """For `select` and event loops: readable when there may be samples. Receive until None then, and every 0.25 s in any case.
        It changes when the publisher starts again; -1 when none has been there."""
        descriptor = self._native.descriptor()
        return -1 if descriptor is None else descriptor

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
            descriptor = self._native.descriptor()
            # Making the descriptor does not announce what came before it.
            if (sample := self.receive(0)) is not None:
                break
            await _readable([] if descriptor is None else [descriptor])
        return sample


class Publisher(_Closing):
    """The writing end of a topic, of which a robot has one."""

    def __init__(self, native, struct):
        self._native = native
        self.struct = struct

    def publish(self, sample):
        """Publishes a copy of the structure and returns its number, from 1. `sequence` and `epoch_ns` are filled in."""
        return self._native.publish(bytes(sample))

    def tend(self):
        """Gives the latest sample to subscribers that joined since; call it when seconds pass between two samples."""
        self._native.tend()


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
                descriptors = self._native.descriptors()
                report = self.next(0)
                if report is None:
                    await _readable(descriptors)
                    continue
            yield report
        self._check()

    def __await__(self):
        return self._finish().__await__()

    async def _finish(self):
        async for _ in self:
            pass
        return self.final


class Robot(_Closing):
    """A part in the shared memory of a robot. Use it in a `with` statement, so that nothing is left behind.

    `name` is what other processes see. `root` is the folder of the shared memory, by default RIL_IPC_ROOT or the user's own.
    """

    def __init__(self, robot=1, name="python", root=None):
        self._native = _Robot(robot, name, root)
        self._ports = contextlib.ExitStack()
        self._client = None

    def close(self):
        """Closes everything that was made with it."""
        self._ports.close()
        self._client = None
        self._native.close()

    # Topics

    def subscribe(self, key, struct=None, *, schema=None, timeout=None):
        """Subscribes to a topic, such as "battery_watch/cell_voltages".

        With a structure or a schema the publisher need not be there yet; without, the structure is made from the schema that lies
        beside the topic. An iteration ends when there was no sample for `timeout` seconds.
        """
        own = _OWN_TOPICS.get(key)
        layout_hash, size = None, 0
        if struct is None and schema is None and own is not None:
            struct, layout_hash = own, structs.LAYOUTS[key][1]
        elif struct is not None and schema is None:
            schema = schema_of(struct)
        if struct is not None:
            import ctypes

            size = ctypes.sizeof(struct)
        subscriber = Subscriber(self._native.subscribe(key, layout_hash, schema, size), struct, timeout)
        return self._ports.enter_context(subscriber)

    def telemetry(self, timeout=None):
        """Telemetry in SI units."""
        return self.subscribe("hero_telemetry", timeout=timeout)

    def dsp_telemetry(self, timeout=None):
        """Raw telemetry of the DSP."""
        return self.subscribe("dsp_telemetry", timeout=timeout)

    def module_state(self, timeout=None):
        """State of the bridge and of the movement under way."""
        return self.subscribe("module_state", timeout=timeout)

    def advertise(self, key, struct, *, schema=None):
        """Becomes the publisher of a topic that carries the structure; `schema` says the same with comments, if it is given."""
        import ctypes

        native = self._native.advertise(key, schema or schema_of(struct), ctypes.sizeof(struct))
        return self._ports.enter_context(Publisher(native, struct))

    def topics(self):
        """Key, layout and publishing process of every topic that there is."""
        return self._native.topics()

    # Requests

    def _requests(self):
        if self._client is None:
            self._client = self._native.client()
            self._ports.callback(self._client.close)
        return self._client

    def start(self):
        """Starts the module."""
        return Request(self._requests(), "start", self._requests().start())

    def stop(self):
        """Stops the module."""
        return Request(self._requests(), "stop", self._requests().stop())

    def take_off(self, altitude_m):
        """Takes off and climbs to so many meters over this point."""
        return Request(self._requests(), "take off", self._requests().take_off(altitude_m))

    def land(self, *, preempt=False):
        """Lands here; with `preempt` out of a path that is under way."""
        return Request(self._requests(), "land", self._requests().land(preempt))

    def hold(self):
        """Hovers here; a path that is under way ends as replaced."""
        return Request(self._requests(), "hold", self._requests().hold())

    def go_to(self, *path, preempt=False):
        """Flies a path of (latitude in degrees, longitude in degrees, altitude in m)."""
        return Request(self._requests(), "go to", self._requests().go_to(list(path), preempt))

    def send(self, key, request):
        """Sends a structure as a request of the service `key`, such as ParameterRequest to "parameters"."""
        return Request(self._requests(), key, self._requests().send(key, bytes(request)))
