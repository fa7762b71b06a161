"""Callbacks for what comes through ports, and timers that keep their grid: `Loop`, and `every` for programs with a loop of their own."""

import asyncio
import math
import select
import time
from typing import Any, AsyncIterator, Callable, Iterator, List, Optional, Set

from ._native import wait_for


class Every:
    """Ticks on a grid of `period_s` seconds, the first one a period after its making. A tick comes as soon as there is time for it and
    never moves the next one; ticks that there was no time for are left out, and counted in `missed`.

    Iterate it with `for` or `async for`."""

    def __init__(self, period_s: float) -> None:
        if not 0 < period_s < math.inf:
            raise ValueError(f"a period is a time in seconds above 0, not {period_s}")
        #: Distance of two ticks [s].
        self.period_s = period_s
        #: Ticks that were left out.
        self.missed = 0
        self._begun = time.monotonic()
        self._tick = 0

    def left_s(self) -> float:
        """How long until the next tick [s]; 0 or less when it is due."""
        return self._begun + (self._tick + 1) * self.period_s - time.monotonic()

    def take(self) -> int:
        """Takes the tick that is due: its number, from 1."""
        passed = math.floor((time.monotonic() - self._begun) / self.period_s)
        due = max(passed, self._tick + 1)
        self.missed += due - self._tick - 1
        self._tick = due
        return due

    def __iter__(self) -> Iterator[int]:
        return self

    def __next__(self) -> int:
        time.sleep(max(0.0, self.left_s()))
        return self.take()

    def __aiter__(self) -> AsyncIterator[int]:
        return self

    async def __anext__(self) -> int:
        await asyncio.sleep(max(0.0, self.left_s()))
        return self.take()


def every(period_s: float) -> Every:
    """A timer for a loop of your own: `for _ in every(0.02)`, or `async for _ in every(0.02)`."""
    return Every(period_s)


class Loop:
    """Calls functions when something comes through a port, or when a timer is due, all in the thread that runs it:

        loop = hero_ril.Loop()
        loop.on(robot.telemetry(), lambda sample: print(sample.geodetic.altitude_m))
        loop.every(0.02, control)
        loop.run()
    """

    def __init__(self) -> None:
        self._ports: List[Any] = []
        self._timers: List[Any] = []
        self._watched: Set[int] = set()
        self._epoll = select.epoll()
        self._is_running = False

    def on(self, port: Any, callback: Callable[[Any], object]) -> Any:
        """Calls `callback` with each sample of a subscriber, each order of a server, or each report of a request. Returns the port."""
        self._ports.append((port, callback))
        self._watch(port)
        return port

    def off(self, port: Any) -> None:
        """Ends what `on` began; close the port afterwards, if it is to be closed."""
        self._ports = [entry for entry in self._ports if entry[0] is not port]
        for descriptor in port._descriptors():
            if descriptor in self._watched and not any(descriptor in it._descriptors() for it, _ in self._ports):
                self._watched.discard(descriptor)
                self._epoll.unregister(descriptor)

    def every(self, period_s: float, callback: Callable[[], object]) -> Every:
        """Calls `callback` on a grid of `period_s` seconds; see `Every`. Returns the timer."""
        timer = Every(period_s)
        self._timers.append((timer, callback))
        return timer

    def stop(self) -> None:
        """Ends `run` after the callback that calls this."""
        self._is_running = False

    def run(self, duration: Optional[float] = None) -> None:
        """Runs until `stop`, or for `duration` seconds."""
        until = math.inf if duration is None else time.monotonic() + duration
        self._is_running = True
        while self._is_running:
            self._turn()
            timeout = min([timer.left_s() for timer, _ in self._timers] + [until - time.monotonic()])
            if until <= time.monotonic() or not self._is_running:
                break
            self._wait(None if timeout == math.inf else max(0.0, timeout))

    def _watch(self, port: Any) -> None:
        for descriptor in port._descriptors():
            if descriptor not in self._watched:
                self._watched.add(descriptor)
                self._epoll.register(descriptor, select.EPOLLIN)

    def _turn(self) -> None:
        """Takes all that has come, and calls the timers that are due."""
        for port, callback in list(self._ports):
            if not port._take_all(callback):
                self.off(port)
        for timer, callback in self._timers:
            if timer.left_s() <= 0:
                timer.take()
                callback()

    def _wait(self, timeout: Optional[float]) -> None:
        wait_for(self._epoll.fileno(), timeout)
