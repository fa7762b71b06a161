"""Fixtures for tests: shared memory of a test's own, and stand-ins for whoever publishes a topic or serves a request.

With pytest they are there by themselves:

    def test_the_counter_loses_nothing(hero_domain):
        counter = Counter(hero_domain.join())
        belt = hero_domain.topic("conveyor/belt", Belt)
        for step in range(1000):
            belt.publish(Belt(speed_mps=step))
        assert counter.count(1000) == 1000

`hero_status` plays telemetry, `hero_bridge` answers movements, starts and stops, and parameters as it is told. In unittest, `Domain` is a
context manager.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import queue
import random
import secrets
import signal
import subprocess
import threading
import time
from typing import Any, Callable, Dict, Generic, Iterable, Iterator, List, Literal, Optional, Type, TypeVar, Union

from . import Order, Publisher, Report, Request, Robot, Subscriber, structs
from ._native import residue, sweep

__all__ = ["Domain", "StandInBridge", "StandInServer", "StandInTopic", "garbage", "final_report", "nothing_lost", "until"]

#: How long a wait lasts at most [s]: only a test that hangs meets it.
WAIT_S = 90.0

_T = TypeVar("_T")
_W = TypeVar("_W", bound="_Working")
#: How a `StandInServer` answers.
_Answer = Union[Literal["hang", "die"], Callable[["Order[_T]"], object]]


class Domain:
    """Shared memory of a test's own. Closing it ends what was made of it, and asserts that nothing is left."""

    def __init__(self) -> None:
        self.root = f"/dev/shm/hx{os.getpid():x}-{secrets.token_hex(3)}"
        self._made = contextlib.ExitStack()
        self._has_killed = False

    @property
    def environment(self) -> Dict[str, str]:
        """What a child process needs to be in it."""
        return {**os.environ, "RIL_IPC_ROOT": self.root}

    def join(self, name: str = "test", robot: int = 1) -> Robot:
        """The robot, for the program under test or for the test itself."""
        return self._made.enter_context(Robot(robot, name, self.root))

    def topic(self, key: str, struct: Type[_T], *, lossy: bool = False, robot: int = 1) -> StandInTopic[_T]:
        """A `StandInTopic`."""
        return self._made.enter_context(StandInTopic(self, key, struct, lossy=lossy, robot=robot))

    def server(self, key: str, struct: Type[_T], *, robot: int = 1) -> StandInServer[_T]:
        """A `StandInServer`."""
        return self._made.enter_context(StandInServer(self, key, struct, robot=robot))

    def process(self, *command: Union[str, os.PathLike[str]], **options: Any) -> subprocess.Popen[Any]:
        """A child process in it, as of `subprocess.Popen`; killed at the end with all that it has started."""
        child = subprocess.Popen(command, env=self.environment, start_new_session=True, **options)
        self._made.callback(self._end, child)
        return child

    def _end(self, child: subprocess.Popen[Any]) -> None:
        self._has_killed = True
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        for stream in (child.stdin, child.stdout, child.stderr):
            if stream is not None:
                stream.close()

    def residue(self) -> List[str]:
        """What is there of it now: files, folders and segments."""
        return list(residue(self.root))

    def close(self) -> None:
        self._made.close()
        if self._has_killed:
            # What a killed process leaves, the next start removes.
            sweep(self.root)
        left = self.residue()
        # The next test must not find it.
        sweep(self.root)
        if left:
            raise AssertionError("left of the test's domain: " + ", ".join(left))

    def __enter__(self) -> Domain:
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], *_: object) -> None:
        try:
            self.close()
        except AssertionError:
            if kind is None:
                raise


class _Working:
    """A thread that is ended by `close`."""

    _robot: Robot

    def _begin(self) -> None:
        self._error: Optional[Exception] = None
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._guarded, daemon=True)
        self._thread.start()

    def _guarded(self) -> None:
        try:
            self._work()
        except Exception as error:
            self._error = error

    def _work(self) -> None:
        raise NotImplementedError

    def close(self) -> None:
        self._is_over.set()
        self._stop()
        self._thread.join()
        self._robot.close()
        if self._error is not None:
            raise self._error

    def _stop(self) -> None:
        pass

    def __enter__(self: _W) -> _W:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class StandInTopic(_Working, Generic[_T]):
    """In the place of whoever publishes `key`. A thread publishes what it is given, in order.

    It waits for its subscribers: a script that is longer than a queue loses nothing, also when the test publishes all of it before it reads.
    With `lossy` it does not wait, as a module does not.
    """

    def __init__(self, domain: Domain, key: str, struct: Type[_T], *, lossy: bool = False, robot: int = 1) -> None:
        self.struct = struct
        self._given: queue.Queue[Optional[Callable[[], object]]] = queue.Queue()
        self._robot = domain.join("stand_in_topic", robot)
        self._open: Callable[[], Publisher[_T]] = lambda: self._robot.advertise(
            key, struct, patience=None if lossy else WAIT_S
        )
        self._publisher = self._open()
        self._begin()

    def publish(self, sample: _T) -> None:
        """Gives a sample, which is published as soon as there is room."""
        self._given.put(lambda: self._send(sample))

    def play(self, samples: Iterable[_T]) -> None:
        """Gives many."""
        for sample in samples:
            self.publish(sample)

    def stall(self, seconds: float) -> None:
        """The publisher lives and is silent for so long."""
        self._given.put(lambda: self._is_over.wait(seconds))

    def restart(self) -> None:
        """The publisher ends, and another one begins, which counts from 1."""
        self._given.put(self._restart)

    def garbage(self, seed: int, samples: int) -> None:
        """So many samples of any bit pattern."""
        self.play(garbage(self.struct, seed, samples))

    def settle(self) -> None:
        """Waits until everything that was given is published, if another thread reads."""
        self._given.join()

    def _restart(self) -> None:
        self._publisher.close()
        self._publisher = self._open()

    def _send(self, sample: _T) -> None:
        try:
            self._publisher.publish(sample)
        except Exception:
            # What has no room when it is over is lost.
            if not self._is_over.is_set():
                raise

    def _work(self) -> None:
        while (act := self._given.get()) is not None:
            if not self._is_over.is_set():
                act()
            self._given.task_done()
        self._publisher.close()

    def _stop(self) -> None:
        self._given.put(None)
        # It may wait for a subscriber.
        self._publisher.close()


class StandInServer(_Working, Generic[_T]):
    """In the place of whoever serves `key`. Requests are accepted and done at once, unless `answer_next` says otherwise."""

    def __init__(self, domain: Domain, key: str, struct: Type[_T], *, robot: int = 1) -> None:
        self._answers: queue.Queue[_Answer[_T]] = queue.Queue()
        self._requests: queue.Queue[_T] = queue.Queue()
        self._hanging: List[Order[_T]] = []
        self._robot = domain.join("stand_in_server", robot)
        self._server = self._robot.serve(key, struct)
        self._begin()

    def answer_next(self, answer: _Answer[_T]) -> None:
        """How the next request is answered: "hang", "die", or a function that gets the `Order`, such as
        `lambda order: order.refuse("busy")`. Several are for as many requests."""
        self._answers.put(answer)

    def next_request(self, timeout: float = WAIT_S) -> _T:
        """The next request, in the order in which they came."""
        return self._requests.get(timeout=timeout)

    def hanging(self) -> List[Order[_T]]:
        """The orders that hang, for the test to report something about."""
        return self._hanging

    def _work(self) -> None:
        while not self._is_over.is_set():
            order = self._server.receive(0.25)
            if order is None:
                continue
            self._requests.put(order.data)
            answer: _Answer[_T]
            try:
                answer = self._answers.get_nowait()
            except queue.Empty:
                answer = _done
            if callable(answer):
                answer(order)
            elif answer == "hang":
                self._hanging.append(order)
            else:
                break
        self._server.close()


def _done(order: Order[Any]) -> None:
    order.accept()
    order.done()


class StandInBridge:
    """In the place of the bridge: serves `movement`, `module_control` and `parameters`, and publishes its state and raw telemetry."""

    def __init__(self, domain: Domain) -> None:
        self.movement = domain.server("movement", structs.MovementData)
        self.control = domain.server("module_control", structs.ModuleControl)
        self.parameters = domain.server("parameters", structs.ParameterRequest)
        self.state = domain.topic("module_state", structs.ModuleState)
        self.telemetry = domain.topic("dsp_telemetry", structs.DspTelemetry)


def garbage(struct: Type[_T], seed: int, count: int) -> Iterator[_T]:
    """So many structures of any bit pattern, always the same for the same seed."""
    dice = random.Random(seed)
    structure: Any = struct
    for _ in range(count):
        yield structure.from_buffer_copy(dice.randbytes(ctypes.sizeof(structure)))


def until(subscriber: Subscriber[_T], wanted: Callable[[_T], object], timeout: float = WAIT_S) -> _T:
    """Reads until a sample is as `wanted` says, and returns it."""
    end = time.monotonic() + timeout
    while (left := end - time.monotonic()) > 0:
        sample = subscriber.receive(left)
        if sample is not None and wanted(sample):
            return sample
    raise AssertionError("no sample came as it is wanted")


def nothing_lost(subscriber: Subscriber[Any]) -> None:
    """Asserts that the subscriber got every sample that was published since it began."""
    losses = subscriber.losses
    assert (losses.lost, losses.joined_late) == (0, 0), losses


def final_report(request: Request, timeout: float = WAIT_S) -> Report:
    """Follows a request to its end, and returns its final report."""
    end = time.monotonic() + timeout
    while request.final is None and (left := end - time.monotonic()) > 0:
        request.next(left)
    assert request.final is not None, "no final report came"
    return request.final


try:
    import pytest
except ImportError:  # For unittest alone.
    pytest = None  # type: ignore[assignment]

if pytest is not None:

    @pytest.fixture
    def hero_domain() -> Iterator[Domain]:
        """A `Domain` of the test's own."""
        with Domain() as domain:
            yield domain

    @pytest.fixture
    def hero_status(hero_domain: Domain) -> StandInTopic[structs.HeroTelemetry]:
        """In the place of status: a `StandInTopic` of telemetry in SI units."""
        return hero_domain.topic("hero_telemetry", structs.HeroTelemetry)

    @pytest.fixture
    def hero_bridge(hero_domain: Domain) -> StandInBridge:
        """A `StandInBridge`."""
        return StandInBridge(hero_domain)
