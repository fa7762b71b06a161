"""A consumer of what the HERO RIL publishes, for Python: sections 3, 5, 8 and 10 of docs/ipc.md as a class.

Needs the package `iceoryx2` 0.10.0 of PyPI, and `hero_ipc.py`, which is made of the RIL's own structs. It only reads: it
publishes nothing and sends no request.
"""

import contextlib
import ctypes
import fcntl
import os
import time

import hero_ipc
import iceoryx2 as iox2

#: Longest sleep, in milliseconds: iceoryx2 0.10 can lose a wake-up, so that no sleep may be without a bound.
SAFETY_BOUND_MS = 100

#: What each published service carries.
PAYLOADS = {
    "dsp_telemetry": hero_ipc.DspTelemetry,
    "hero_telemetry": hero_ipc.HeroTelemetry,
    "module_state": hero_ipc.ModuleState,
}


class NotThere(Exception):
    """Nothing of the RIL runs, or nobody publishes the service."""


class OtherLayout(Exception):
    """The service carries another layout than the module `hero_ipc` has."""


class Consumer:
    """Reads a published service. Use it in a `with` statement, so that nothing is left behind.

    `received` and `lost` count samples; a sample is lost when the sequence has a gap.
    """

    def __init__(self, service="hero_telemetry", robot=1):
        self.name = f"hero/{robot}/{service}"
        self.received = 0
        self.lost = 0
        self._last = None
        self._ports = contextlib.ExitStack()
        root = os.environ.get("RIL_IPC_ROOT", f"/dev/shm/hero{os.getuid()}")
        # Whoever holds this lock keeps the domain; it goes last.
        self._ports.enter_context(_shared_lock(f"{root}/domain.lock"))
        with contextlib.ExitStack() as on_failure:
            on_failure.callback(self.close)
            # Whoever holds this one is making something, which must not be taken for the remains of a dead process.
            with _shared_lock(f"{root}/making.lock"):
                self._open(root, service)
            on_failure.pop_all()

    def _open(self, root, service):
        iox2.set_log_level_from_env_or(iox2.LogLevel.Error)
        path = f"{root}/iceoryx2.toml"
        if not os.path.exists(path):
            raise NotThere(f"`{path}` does not exist yet: the RIL is just starting, try again")
        config = iox2.config.setup_global_config_from_file(iox2.FilePath.new(path))
        self._check_layout(config, service)
        node = (
            iox2.NodeBuilder.new()
            .config(config)
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )

        def builder(name):
            return node.service_builder(iox2.ServiceName.new(name))

        samples = builder(self.name).publish_subscribe(PAYLOADS[service]).open()
        self._listener = builder(self.name).event().open().listener_builder().create()
        self._ports.callback(self._listener.delete)
        self._subscriber = samples.subscriber_builder().create()
        self._ports.callback(self._subscriber.delete)
        # Last: its creation tells the publisher that somebody waits for the latest sample.
        arrivals = builder(f"{self.name}/subscribers").event().open()
        arrival = arrivals.notifier_builder().create()
        self._ports.callback(arrival.delete)

    def _check_layout(self, config, service):
        details = iox2.Service.details(
            iox2.ServiceName.new(self.name),
            config,
            iox2.MessagingPattern.PublishSubscribe,
            iox2.ServiceType.Ipc,
        )
        if details is None:
            raise NotThere(f"nobody has opened `{self.name}`: start `ril status` or `ril bridge`")
        keys = ["layout", "layout_hash"]
        values = [details.attributes().key_values(iox2.AttributeKey.new(key)) for key in keys]
        found = tuple(value[0].to_string() if value else "nothing" for value in values)
        wanted = hero_ipc.LAYOUTS[service]
        if found != wanted:
            raise OtherLayout(
                f"service `{self.name}` carries `{' '.join(found)}`, this program was made for "
                f"`{' '.join(wanted)}`: take hero_ipc.py of the same version as the RIL"
            )

    def wait(self, timeout_s=1.0):
        """Sleeps until there may be something, at most so long, and returns all samples that are there, as copies."""
        end = time.monotonic() + timeout_s
        while True:
            left_ms = max(0, int((end - time.monotonic()) * 1000))
            sleep_ms = min(left_ms, SAFETY_BOUND_MS)
            try:
                self._listener.timed_wait(iox2.Duration.from_millis(sleep_ms))
            except iox2.ListenerWaitError as error:
                # A signal; Python runs its handler when this line is done.
                if "InterruptSignal" not in str(error):
                    raise
            samples = self._drain()
            if samples or left_ms <= SAFETY_BOUND_MS:
                return samples

    def _drain(self):
        samples = []
        while (sample := self._subscriber.receive()) is not None:
            payload = sample.payload().contents
            copy = type(payload).from_buffer_copy(payload)
            # A subscriber may hold two samples; what was read is given back at once.
            del payload
            sample.delete()
            if self._is_next(copy.epoch_ns, copy.sequence):
                samples.append(copy)
        return samples

    def _is_next(self, epoch_ns, sequence):
        """Counts a sample and says whether to believe it: neither seen before, nor the rest of an earlier publisher."""
        if epoch_ns > time.clock_gettime_ns(time.CLOCK_MONOTONIC):
            return False
        if self._last is not None:
            last_epoch_ns, last_sequence = self._last
            if epoch_ns == last_epoch_ns:
                missing = sequence - last_sequence - 1
            else:
                missing = sequence - 1
            if epoch_ns < last_epoch_ns or missing < 0:
                return False
            self.lost += missing
        self.received += 1
        self._last = (epoch_ns, sequence)
        return True

    def close(self):
        """Gives everything back, the lock last."""
        self._ports.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def is_valid(sample, group):
    """Whether the group of `hero_ipc.TelemetryGroup` means something in this sample of telemetry."""
    return bool(sample.valid_groups & group)


@contextlib.contextmanager
def _shared_lock(path):
    """Holds a shared flock on the file at `path`, which may be removed and made anew meanwhile."""
    while True:
        try:
            file = open(path, "rb")
        except FileNotFoundError:
            raise NotThere(f"`{path}` does not exist: nothing of the RIL runs, start it first") from None
        with file:
            fcntl.flock(file, fcntl.LOCK_SH)
            try:
                is_current = os.path.samestat(os.fstat(file.fileno()), os.stat(path))
            except FileNotFoundError:
                is_current = False
            if is_current:
                yield
                return
