"""Devices: read by anybody, commanded by the client that holds the lease.

Commands are never repeated for Python: each lasts for the tip's `hold`, then the device takes its force
away. So a program that stalls, waits in a debugger or is killed leaves no force behind.
"""

from __future__ import annotations

import gc
import logging
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Any

from . import _core, errors, schemas
from .calls import Node, default_node
from .endings import Closing
from .idl import device_rtpm
from .idl.device_rtpm import (
    AffineField,
    Box,
    Command,
    Description,
    Detents,
    DialDetents,
    Friction,
    Plane,
    Sample,
    Sphere,
    Spring,
    Vector3,
)

_log = logging.getLogger("rtpm")

#: What a force or position takes: a Vector3, or three numbers.
Vector3Like = Iterable[float]
#: A local model; `rtpm.Wall` is a Plane.
Model = Plane | Sphere | Box | Spring | AffineField | Friction | Detents | DialDetents

#: For how many seconds samples and commands may be late.
_PATIENCE = 1.0

#: The models' fields in the schema's Model.
_MODEL_FIELDS: dict[type, str] = {
    Plane: "plane",
    Sphere: "sphere",
    Box: "box",
    Spring: "spring",
    AffineField: "affine_field",
    Friction: "friction",
    Detents: "detents",
    DialDetents: "dial_detents",
}


def _models(models: Iterable[Model]) -> bytes:
    wrapped = []
    for model in models:
        field = _MODEL_FIELDS.get(type(model))
        if field is None:
            kinds = ", ".join(kind.__name__ for kind in _MODEL_FIELDS)
            raise TypeError(f"a model takes {kinds}, not {type(model).__name__}")
        wrapped.append(device_rtpm.Model(**{field: model}))  # type: ignore[arg-type]
    return schemas.encode(device_rtpm.SetModelsRequest(models=wrapped))


def _read(core: _core.Device, priority: int | None = None) -> Sample:
    """The newest sample. The deadline of one reading is for loops of C++; a busy host exceeds it."""
    end = time.monotonic() + _PATIENCE
    while True:
        try:
            return Sample.from_buffer_copy(core.read(priority))
        except TimeoutError:
            if time.monotonic() > end:
                raise


class Device(Closing):
    """A device, to read and, by `command()`, to command."""

    def __init__(
        self,
        target: str,
        *,
        node: Node | None = None,
        hold: float = 0.010,
        patience: float = 0.0,
        stall: float = 0.5,
    ) -> None:
        """Opens the device at `target`, a name or a URL.

        patience: for how many seconds to wait for a device that is not there yet. hold and stall: see
        command().
        """
        self._node = node or default_node()
        #: Its name or URL, as it was opened.
        self.name = target
        self._hold = hold
        self._stall = stall
        error = None
        try:
            self._core: _core.Device | None = _core.Device(
                self._node.core, target, hold, patience, stall
            )
        except errors.NameNotFound as missing:
            error = missing
        if error is not None:
            self._node.core.describe(
                target
            )  # Raises the same, with the names that are most like it.
            raise error
        with device_rtpm.DeviceClient(target, node=self._node) as client:
            self._description = client.describe()

    @property
    def core(self) -> _core.Device:
        """The extension's device."""
        self._node.check()
        if self._core is None:
            raise errors.Error("this device is closed")
        return self._core

    @property
    def node(self) -> Node:
        """The node that it was opened with."""
        return self._node

    @property
    def description(self) -> Description:
        """The device's own description: axes, limits, workspace, units."""
        return self._description

    @property
    def url(self) -> str:
        """The URL that calls go to now."""
        return self.core.url

    def read(self, *, priority: int | None = None) -> Sample:
        """The newest sample. Raises TimeoutError if there is none within a second."""
        return _read(self.core, priority)

    def command(
        self, *, hold: float | None = None, patience: float = 2.0, take_over: bool = False
    ) -> Tip:
        """Acquires the device's lease, for use in a `with` statement.

        hold: for how many seconds a command lasts without a newer one (0.010; at most the
        description's hold_us_max). patience: for how long
        to wait while another client holds the lease. take_over: takes the lease away from its holder,
        as an operator may. The lease is kept only while this program runs: not beyond `stall` seconds
        without any use of the device.
        """
        hold_max = self._description.hold_us_max / 1e6
        if hold is not None and not 0 < hold <= hold_max:
            raise ValueError(
                f"hold takes more than 0 and up to {hold_max:g} s at {self.core.target}, not {hold}"
            )
        if hold is not None and hold != self._hold:
            target = self.core.target
            self._hold = hold
            self._core = _core.Device(self._node.core, target, hold, 0.0, self._stall)
        return Tip(self, patience, take_over)

    def stop(self, scope: str = "device") -> None:
        """Stops the device at once, all of its server ("server"), or the whole laboratory ("system")."""
        scopes = ("device", "server", "system")
        if scope not in scopes:
            raise ValueError(f"scope takes 'device', 'server' or 'system', not {scope!r}")
        self.core.emergency_stop(scopes.index(scope))

    def close(self) -> None:
        """Closes the device."""
        self._core = None

    def __repr__(self) -> str:
        state = "closed" if self._core is None else self.name
        return f"<rtpm.Device {state}: {self._description.model}>"

    def _repr_html_(self) -> str:
        from .display import device_html

        return device_html(self)


class Tip:
    """The commanded end of a device. Ends with its `with` statement, and then leaves no force behind."""

    # A misspelt attribute would command nothing.
    __slots__ = (
        "_core",
        "_device",
        "_force",
        "_late_count",
        "_late_since",
        "_servo",
        "_torque",
        "__weakref__",
    )

    def __init__(self, device: Device, patience: float, take_over: bool) -> None:
        self._device = device
        self._core = device.core
        self._servo: Servo | None = None
        self._force = Vector3()
        self._torque = Vector3()
        self._late_count = 0
        # When the first of the late commands began that none in time followed.
        self._late_since: float | None = None
        if take_over:
            self._core.take_over()
        else:
            self._core.acquire(patience)

    @property
    def core(self) -> _core.Device:
        """The extension's device."""
        self._device._node.check()
        return self._core

    @property
    def force(self) -> Vector3:
        """The force, in newton in the device's frame. Setting it commands it for `hold` seconds.

        The device applies at most the description's `force_newton_max`, and lets the force rise
        softly at first: `sample.force_newton` is the applied one.

        A command that gets no answer in time costs a cycle: it may act, and release() reports how
        many there were. After a second without any in time, TimeoutError is raised.
        """
        return self._force

    @force.setter
    def force(self, value: Vector3Like) -> None:
        self._force = self._vector("force", value)
        self._send()

    @property
    def torque(self) -> Vector3:
        """The torque, in newton metre. Setting it commands it, with the force, for `hold` seconds."""
        return self._torque

    @torque.setter
    def torque(self, value: Vector3Like) -> None:
        self._torque = self._vector("torque", value)
        self._send()

    def send(self, command: Command) -> None:
        """Commands a whole `Command`: pose, velocity, joints or outputs by its mode."""
        if not isinstance(command, Command):
            raise TypeError(f"send takes a Command, not {type(command).__name__}")
        core = self.core
        self._command(lambda: core.command(bytes(command), None))

    def loop(self, rate: float = 1000.0, *, pause_gc: bool = False) -> Iterator[Sample]:
        """Yields the newest sample `rate` times a second; late cycles are skipped, counted, and reported at the end.

        Cycles whose sample comes too late count so, too; without any for a second, TimeoutError is raised.

        Python's threads share one lock, so that a computing thread delays such a loop by milliseconds:
        render() does not know that. pause_gc: holds back garbage collection during the loop, and lets
        threads change more often.
        """
        pacer = _core.Pacer(rate)
        interval = sys.getswitchinterval()
        if pause_gc:
            gc.freeze()
            gc.disable()
            sys.setswitchinterval(min(interval, 0.0005))
        try:
            while True:
                yield _read(self.core)
                pacer.wait()
        finally:
            if pause_gc:
                sys.setswitchinterval(interval)
                gc.enable()
                gc.unfreeze()
            figures = pacer.figures()
            if figures["late"]:
                _log.warning(
                    "%s: %g Hz loop: %d cycles, %d skipped because Python was late, at worst by %.1f ms; "
                    "tip.render() keeps its rate",
                    self._core.target,
                    rate,
                    figures["cycles"],
                    figures["late"],
                    figures["worst_s"] * 1e3,
                )

    def render(self, *models: Model, rate: float = 1000.0, priority: int = 24000) -> Servo:
        """Renders models by a native loop in this program, at `rate`, whatever Python does meanwhile."""
        if self._servo is not None:
            self._servo.stop()
        self._servo = Servo(self.core, models, rate, priority)
        return self._servo

    def set_models(self, *models: Model) -> None:
        """Renders models in the device's own loop, which no network delays. They replace earlier ones."""
        self.core.set_models(_models(models))

    def recover(self) -> None:
        """Clears a latched fault, such as a command that was not finite."""
        self.core.recover()

    def rearm(self) -> None:
        """Ends an emergency stop."""
        self.core.rearm()

    def release(self) -> None:
        """Takes the force away and releases the lease."""
        if self._device._node.is_forked:
            return
        if self._servo is not None:
            self._servo.stop()
            self._servo = None
        if self._late_count:
            _log.warning(
                "%s: %d commands got no answer in time, at a deadline of 10 ms each",
                self._core.target,
                self._late_count,
            )
            self._late_count = 0
        self.core.release()

    def __enter__(self) -> Tip:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.release()
        except (errors.DeviceError, errors.CallError):
            # The lease has ended already, or ends with the silence; the body's own error matters more.
            if error is None and kind is None:
                _log.warning(
                    "%s: the lease could not be released", self._core.target, exc_info=True
                )

    def _vector(self, name: str, value: Vector3Like) -> Vector3:
        if isinstance(value, Vector3):
            return value
        try:
            x, y, z = value
            return Vector3(x, y, z)
        except (TypeError, ValueError):
            raise TypeError(
                f"{name} takes three numbers, such as (0, 0, 1.5), not {value!r:.60}"
            ) from None

    def _send(self) -> None:
        core = self.core
        self._command(lambda: core.set_wrench([*self._force, *self._torque], None))

    def _command(self, command: Callable[[], None]) -> None:
        """Commands. The deadline is for loops of C++; a busy host exceeds it, for commands as for _read()."""
        begin = time.monotonic()
        try:
            command()
        except TimeoutError:
            self._late_count += 1
            self._late_since = self._late_since or begin
            if time.monotonic() - self._late_since > _PATIENCE:
                raise
        else:
            self._late_since = None


class Servo:
    """Models that a native loop renders. It stops with its tip, or by stop()."""

    def __init__(
        self,
        core: _core.Device,
        models: Iterable[Model],
        rate: float,
        priority: int,
    ) -> None:
        self._target = core.target
        self._core = _core.Servo(core, rate, priority, _models(models))
        self._ended = threading.Event()
        # Proves that the interpreter runs: without it the native loop takes the force away.
        self._pulse = threading.Thread(
            target=self._beat, args=(core,), name="rtpm-pulse", daemon=True
        )
        self._pulse.start()

    def set(self, *models: Model) -> None:
        """Renders other models from the next cycle on."""
        self._core.set(_models(models))

    @property
    def is_running(self) -> bool:
        """Whether it commands; it ends when the lease is lost."""
        return self._core.is_running

    @property
    def figures(self) -> dict[str, Any]:
        """Cycles so far: how many, late, failed, paused, and the worst delay in seconds."""
        return self._core.figures()

    def stop(self) -> None:
        """Ends the loop."""
        self._ended.set()
        self._core.stop()

    def __repr__(self) -> str:
        state = "running" if self.is_running else "ended"
        figures = ", ".join(f"{name} {value}" for name, value in self.figures.items())
        return f"<rtpm.Servo of {self._target}: {state}, {figures}>"

    def _beat(self, core: _core.Device) -> None:
        while not self._ended.wait(0.1):
            core.see()


def device(
    target: str,
    *,
    node: Node | None = None,
    hold: float = 0.010,
    patience: float = 0.0,
    stall: float = 0.5,
) -> Device:
    """Opens the device at `target`, a name such as "lab/arm0" or a URL.

    patience: for how many seconds to wait for a device that is not there yet. hold and stall: for how
    long a command and an unused lease last, see Device.command().
    """
    return Device(target, node=node, hold=hold, patience=patience, stall=stall)
