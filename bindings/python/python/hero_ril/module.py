"""A module of the robot in Python: a class with `open` and `step`. docs/modules.md has the rules, which are those of the kit for Rust,
by the same code."""

import dataclasses
import difflib
import json
import signal
import sys
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Tuple, Type, TypeVar

from ._native import Module as _Module
from .loop import Loop

if TYPE_CHECKING:
    from . import Robot, Server

_M = TypeVar("_M", bound="Module")
#: What `check` says of a configuration: the keys that lead to what is wrong, and why it is.
_Fault = Optional[Tuple[List[str], str]]


def ranged(default: Any, least: Any, greatest: Any) -> Any:
    """A field of a configuration with its default and its bounds, which belong to the range."""
    return dataclasses.field(default=default, metadata={"range": (least, greatest)})


@dataclasses.dataclass
class NoConfig:
    """The configuration of a module that has none: an empty file."""


class Module(Loop):
    """A module. Write `open`, which opens its ports, and `step`, and run it by `main()`.

    It publishes `<name>/state` and serves `<name>/control`, so `ril start --module <name>` and `ril stop --module <name>` know it. It
    has the options of every process of the RIL, tells systemd that it is ready, and ends in order with SIGINT, SIGTERM and SIGHUP."""

    #: One word in lower snake case: the first part of the keys of all its services.
    name: str = ""
    #: A number from 1000 to 9999.
    id: int = 0
    #: What stands in `<name>.toml`: a dataclass of numbers, texts and flags, each with a default; `ranged` bounds a number.
    Config: type = NoConfig

    robot: "Robot"
    config: Any
    _native: Any

    def open(self) -> None:
        """Opens the ports: `self.robot` and `self.config` are there."""

    def step(self) -> None:
        """Called after every wake, when callbacks and timers were. It must not block. A module that is not started commands nothing."""

    def started(self) -> None:
        """A start was accepted."""

    def stopped(self) -> None:
        """A stop was accepted: end what is under way. The stop is done when this returns."""

    @property
    def is_started(self) -> bool:
        """Whether the module may work: it was started, and neither a stop nor an error has ended that."""
        return bool(self._native.is_so("started"))

    @property
    def is_ready(self) -> bool:
        """Whether the module may work, and has not since its last start."""
        return bool(self._native.is_so("ready"))

    @property
    def is_working(self) -> bool:
        """Whether work is under way."""
        return bool(self._native.is_so("working"))

    def begin(self, functionality: int, doing: str, on_stop: str = "aborts") -> bool:
        """Begins work, or goes on to another: a number of the module's own, and the same in up to 48 letters of ASCII. What a stop does:
        it "aborts" the work, "ends" it as if it had been done, or is "refused". False, and no work begins, if it was not started."""
        return bool(self._native.work(functionality, doing, on_stop))

    def done(self) -> None:
        """The work ended as it should."""
        self._native.done()

    def fail(self, error: int) -> None:
        """The work ended early, with an error from 1000 to 9999: the module is blocked until the next start."""
        self._native.fail(error)

    def serve(self, key: str, struct: Any, callback: Callable[[Any], object]) -> "Server[Any]":
        """Serves a request: `callback` gets each order once. One that is sent again gets the reports of the first; one whose
        `begin_by_ns` has passed is refused. `is_vanished` of such an order is never true: carry it out, whether or not its client is there."""
        server: "Server[Any]" = self.on(self.robot.serve(key, struct, once=True), callback)
        return server

    @classmethod
    def main(cls, arguments: Optional[List[str]] = None) -> None:
        """The body of a program: options, configuration, signals, the loop. Raises SystemExit when there is an error to report."""
        from . import Robot

        module = cls()
        # Its own handler would raise KeyboardInterrupt in the middle of a step.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        words = [cls.name, *(sys.argv[1:] if arguments is None else arguments)]
        native, module._native = _Module.begin(cls.name, cls.id, words, module._configure)
        with Robot._of(native) as module.robot:
            try:
                module.open()
                module.run()
            finally:
                module.close()

    @classmethod
    def within(cls: Type[_M], robot: "Robot", config: Any = None) -> _M:
        """The module within another program, a test for example, which ends it by `stop()` and closes the robot: no options, no signals."""
        module = cls()
        module.robot = robot
        module.config = cls.Config() if config is None else config
        module._native = _Module(robot._native, cls.name, cls.id)
        robot._keep(module)
        module.open()
        return module

    def close(self) -> None:
        """Closes its state and control; its ports are closed with the robot."""
        self._native.close()

    def _configure(self, text: str) -> _Fault:
        table: Dict[str, Any] = json.loads(text)
        fields = {field.name: field for field in dataclasses.fields(self.Config)}
        for key, value in table.items():
            if key not in fields:
                near = difflib.get_close_matches(key, fields, 1)
                what = f"did you mean `{near[0]}`?" if near else f"there are {', '.join(fields) or 'none'}"
                return [key], f"unknown field `{key}`: {what}"
            wrong = _wrong(fields[key], value)
            if wrong is not None:
                return [key], f"`{key}` is {wrong}"
            if isinstance(fields[key].default, float):
                table[key] = float(value)
        self.config = self.Config(**table)
        return None

    def _wait(self, timeout: Optional[float]) -> None:
        event = self._native.wait(self._epoll.fileno(), timeout)
        if event == "started":
            self.started()
        elif event == "stopped":
            self.stopped()
        elif event == "ending":
            self.stop()

    def _turn(self) -> None:
        super()._turn()
        self.step()


def _wrong(field: Any, value: Any) -> Optional[str]:
    """What is wrong with a value; None if it can be that of the field."""
    kind: Type[Any] = type(field.default)
    kinds = (int, float) if kind is float else (kind,)
    if not isinstance(value, kinds) or isinstance(value, bool) != (kind is bool):
        return f"{value!r}: it must be a {kind.__name__}"
    bounds = field.metadata.get("range")
    if bounds is not None and not bounds[0] <= value <= bounds[1]:
        return f"{value!r}: it must be from {bounds[0]} to {bounds[1]}"
    return None
