"""Lab Streaming Layer: devices and events of RTPM as LSL streams, and LSL streams with RTPM's times.

    with rtpm.lsl.outlet("lab/arm0"), rtpm.lsl.markers("type(lab.Touched)"):
        ...

Run it on the host of the hub and the devices: stamps are exact there.
"""

from __future__ import annotations

import collections
import ctypes
import enum
import json
import logging
import math
import socket
import threading
import time
import urllib.parse
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from . import endings, errors
from .calls import Node, default_node
from .events import Events, Filter, Received, Where, filter_of, source_of
from .idl.device_events_rtpm import Sampled
from .idl.device_rtpm import Description, DeviceClient
from .values import Struct, Table

try:
    import numpy
    import pylsl
except ImportError as error:
    raise ImportError(
        f"rtpm.lsl needs {error.name}; remedy: pip install 'rtpm[lsl]'", name=error.name
    ) from None
except (RuntimeError, AttributeError):
    raise ImportError(
        "rtpm.lsl: pylsl found no liblsl that it can load; remedy: pip install 'pylsl>=1.18', whose wheel for "
        "Linux x86_64 has it, or let the environment's PYLSL_LIB name a liblsl.so"
    ) from None

_log = logging.getLogger("rtpm")

#: How long a wait in liblsl lasts at most before Python sees Ctrl-C, in seconds.
_SLICE_S = 0.05
#: How many seconds of a stream wait for this program; of one without a rate 100 times as many samples.
_QUEUE_S = 60


# ---- clocks -------------------------------------------------------------------------------------


class Clock(NamedTuple):
    """How far LSL's clock is ahead of time.monotonic(), and the bound of that figure's error, in seconds."""

    offset_s: float
    uncertainty_s: float

    def stamp_of(self, time_ns: Any) -> Any:
        """LSL's stamp, in seconds, of a time by time.monotonic_ns(); also of an array."""
        return time_ns * 1e-9 + self.offset_s


def measure_clock() -> Clock:
    """Compares LSL's local_clock() with time.monotonic(). They are one clock on Linux: the offset is 0."""
    shortest, offset = math.inf, 0.0
    for _ in range(100):
        before = time.monotonic_ns()
        stamp = pylsl.local_clock()
        after = time.monotonic_ns()
        if after - before < shortest:
            shortest = after - before
            offset = stamp - (before + after) / 2 * 1e-9
    uncertainty = shortest / 2 * 1e-9 + math.ulp(offset)
    # Not distinguishable from one clock, whose stamps stay as they are then.
    return (
        Clock(0.0, uncertainty + abs(offset))
        if abs(offset) <= uncertainty
        else Clock(offset, uncertainty)
    )


def _is_here(url: str) -> bool:
    """Whether the host of `url` is this one, so that its stamps are by this host's clock."""
    try:
        host = urllib.parse.urlsplit(url).hostname or ""
        for family, kind, protocol, _, address in socket.getaddrinfo(
            host, 0, type=socket.SOCK_DGRAM
        ):
            with socket.socket(family, kind, protocol) as probe:
                probe.bind(address)  # Only a host's own addresses can be bound.
    except (OSError, ValueError):
        return False
    return True


# ---- outlets ------------------------------------------------------------------------------------


class Channel(NamedTuple):
    """A number of a device's samples, as a channel of its stream."""

    label: str
    type: str
    #: In SI units.
    unit: str
    #: Where a sample has it: a field, and the name or number of a part of it.
    field: str
    part: str | int | None = None


def channels_of(description: Description) -> list[Channel]:
    """The channels of a device's stream: those of what it senses and applies, then buttons and sequence."""
    axes = {axis.name: axis for axis in description.axes}
    straight = [axis for axis in "xyz" if axis in axes]
    turns = [axis for axis in "xyz" if f"r{axis}" in axes]
    channels = [
        Channel(axis, f"Position{axis.upper()}", "m", "position_m", axis)
        for axis in straight
        if axes[axis].is_sensed
    ]
    if any(axes[f"r{axis}"].is_sensed for axis in turns):
        # In XDF's order, w first.
        channels += [
            Channel(f"q{part}", f"Orientation{letter}", "quaternion", "orientation", part)
            for part, letter in zip("wxyz", "ABCD", strict=True)
        ]
    channels += [
        Channel(f"f{axis}", f"Force{axis.upper()}", "N", "force_newton", axis)
        for axis in straight
        if axes[axis].is_actuated
    ]
    channels += [
        Channel(f"t{axis}", f"Torque{axis.upper()}", "N m", "torque_newton_metre", axis)
        for axis in turns
        if axes[f"r{axis}"].is_actuated
    ]
    for index, joint in enumerate(description.joints):
        channels.append(Channel(joint.name, "Joint", joint.unit, "joints", index))
    for index, analog in enumerate(description.analogs):
        channels.append(Channel(analog.name, "Analog", analog.unit, "analogs", index))
    if description.buttons:
        channels.append(Channel("buttons", "Buttons", "bits", "buttons"))
    return [*channels, Channel("sequence", "Sequence", "1", "sequence")]


class Outlet(endings.Closing):
    """A stream that a thread of its own fills from a hub's events until it is closed."""

    def __init__(self, info: pylsl.StreamInfo, events: Events, clock: Clock, period: float) -> None:
        self._info = info
        self._events = events
        self._outlet = pylsl.StreamOutlet(info)
        self._period = period
        #: How stamps are converted.
        self.clock = clock
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rtpm-lsl", daemon=True)
        self._thread.start()
        endings.before_exit(self)

    @property
    def name(self) -> str:
        """The stream's name."""
        return str(self._info.name())

    @property
    def losses(self) -> int:
        """How many events were lost between the hub and the stream."""
        return self._events.losses.total

    def wait_for_consumer(self, timeout: float) -> bool:
        """Waits until a program reads the stream; tells whether one does."""
        end = time.monotonic() + timeout
        while not self._outlet.wait_for_consumers(_SLICE_S):
            if time.monotonic() >= end:
                return False
        return True

    def close(self) -> None:
        """Ends the stream."""
        self._ended.set()
        self._events.close()
        self._thread.join()

    stop = close

    def _run(self) -> None:
        try:
            self._push()
        except Exception:
            if not self._ended.is_set():
                _log.exception("%s: the LSL stream gets no more data", self.name)

    def _push(self) -> None:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<rtpm.lsl.Outlet {self.name!r}>"


class _DeviceOutlet(Outlet):
    def __init__(self, *arguments: Any, channels: list[Channel]) -> None:
        self._channels = channels
        super().__init__(*arguments)

    def _push(self) -> None:
        for batch in self._events.batches(4096):
            array = numpy.asarray(batch)
            columns = [_column(array["payload"], channel) for channel in self._channels]
            # A list: pylsl would take a whole array of stamps for a number.
            stamps = self.clock.stamp_of(array["time_ns"]).tolist()
            self._outlet.push_chunk(numpy.column_stack(columns).astype(numpy.float64), stamps)
            if self._ended.wait(self._period):
                return


def _column(samples: Any, channel: Channel) -> Any:
    column = samples[channel.field]
    if channel.part is None:
        return column
    return column[channel.part] if isinstance(channel.part, str) else column[:, channel.part]


def outlet(
    device: str,
    *,
    hub: str = "rtpm/events",
    node: Node | None = None,
    period: float = 0.010,
) -> Outlet:
    """Offers the samples of the device named `device` as an LSL stream, until it is closed.

    Every sample that the device pushes to `hub` is sent, with its own stamp; those of `period` seconds
    together. The stream's description has the channels with units, model and serial number, and how
    far its stamps can be wrong.
    """
    node = node or default_node()
    with DeviceClient(device, node=node) as client:
        description = client.describe()
    where = filter_of(Sampled) & Filter(f"source({source_of(device)})")
    channels = channels_of(description)
    is_exact = _is_here(node.url_of(hub)) and _is_here(node.url_of(device))
    clock = _clock_for(device, is_exact)
    info = pylsl.StreamInfo(
        _clean(device),
        "MoCap" if channels[0].field == "position_m" else description.device_class.name,
        len(channels),
        description.rate_hz or pylsl.IRREGULAR_RATE,
        pylsl.cf_double64,
        _clean(f"rtpm:{device}:{description.model}:{description.serial}"),
    )
    info.set_channel_labels([_clean(channel.label) for channel in channels])
    info.set_channel_types([channel.type for channel in channels])
    info.set_channel_units([_clean(channel.unit) for channel in channels])
    acquisition = info.desc().append_child("acquisition")
    acquisition.append_child_value("model", _clean(description.model))
    acquisition.append_child_value("serial_number", _clean(description.serial))
    acquisition.append_child_value("frame", _clean(description.frame))
    _describe_clock(info, clock)
    events = Events(where, hub=hub, node=node)
    return _DeviceOutlet(info, events, clock, period, channels=channels)


class _MarkerOutlet(Outlet):
    def __init__(self, *arguments: Any, text: Callable[[Received], str]) -> None:
        self._text = text
        super().__init__(*arguments)

    def _push(self) -> None:
        for received in self._events:
            for event in received if isinstance(received, tuple) else (received,):
                self._outlet.push_sample([self._text(event)], self.clock.stamp_of(event.time_ns))


def markers(
    where: Where = None,
    *,
    name: str = "RTPM events",
    text: Callable[[Received], str] | None = None,
    hub: str = "rtpm/events",
    node: Node | None = None,
) -> Outlet:
    """Offers events of `hub` as an LSL stream of markers, until it is closed.

    where: as rtpm.events() takes it; all but samples by default. text: makes a marker of an event;
    marker_of() by default. The stream's name is `name`. Its description's bound of the stamps' error
    holds for events of programs on the hub's host.
    """
    node = node or default_node()
    chosen = filter_of(where) if where is not None else ~filter_of(Sampled)
    clock = _clock_for(name, _is_here(node.url_of(hub)))
    info = pylsl.StreamInfo(
        _clean(name),
        "Markers",
        1,
        pylsl.IRREGULAR_RATE,
        pylsl.cf_string,
        _clean(f"rtpm:{hub}:{chosen.text}"),
    )
    info.set_channel_labels(["marker"])
    _describe_clock(info, clock)
    return _MarkerOutlet(
        info, Events(chosen, hub=hub, node=node), clock, 0.0, text=text or marker_of
    )


def marker_of(event: Received) -> str:
    """A marker of an event as JSON: its type, its device or source, and its value."""
    where = {"device": event.device} if event.device else {"source": event.source}
    return json.dumps({"event": event.name, **where, "value": _json(event.value)})


def _json(value: Any) -> Any:
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, Struct):
        return {name: _json(getattr(value, name)) for name in value._rtpm_names_}
    if isinstance(value, Table):
        return {name: _json(getattr(value, name)) for name in value._rtpm_fields_}
    if isinstance(value, (bytes, bytearray)):
        return value.hex()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return [_json(each) for each in value]


def _clock_for(name: str, is_exact: bool) -> Clock:
    clock = measure_clock()
    if is_exact:
        return clock
    _log.warning(
        "%s: hub or device are on another host, so how far the stamps of its LSL stream are wrong is "
        "not known; remedy: run this program on the hub's host",
        _clean(name),
    )
    return Clock(clock.offset_s, math.nan)


def _describe_clock(info: pylsl.StreamInfo, clock: Clock) -> None:
    """Adds XDF's description of the stamps' error, in seconds."""
    description = info.desc().append_child("synchronization")
    description.append_child_value("time_source", "RTPM")
    description.append_child_value(
        "offset_mean", "0" if math.isfinite(clock.uncertainty_s) else "nan"
    )
    description.append_child_value("offset_5_centile", f"{-clock.uncertainty_s:g}")
    description.append_child_value("offset_95_centile", f"{clock.uncertainty_s:g}")
    description.append_child_value("can_drop_samples", "true")


def _clean(text: str) -> str:
    """Text of another program, for XML and messages."""
    return "".join(character if character.isprintable() else "?" for character in text)


# ---- inlets -------------------------------------------------------------------------------------


class Pulled(NamedTuple):
    """A sample of an LSL stream."""

    #: When it was taken, by this host's time.monotonic_ns(), as rtpm.supplier() takes it.
    time_ns: int
    #: The bound of that time's error.
    uncertainty_ns: int
    #: A number or text per channel.
    value: list[Any]


class Inlet(endings.Closing):
    """An LSL stream, as an iterator of its samples."""

    def __init__(self, where: str, *, timeout: float = 5.0) -> None:
        """Opens the stream that `where` names; see rtpm.lsl.inlet()."""
        self._inlet: Any = None
        info = _find(where, timeout)
        self.name = _clean(info.name())
        self.type = _clean(info.type())
        #: How many samples it has per second; 0 if they come irregularly.
        self.rate_hz = float(info.nominal_srate())
        self._is_text = info.channel_format() == pylsl.cf_string
        self._waiting: collections.deque[Pulled] = collections.deque()
        self._clock = measure_clock()
        self._inlet = pylsl.StreamInlet(info, max_buflen=_QUEUE_S)
        try:
            self._inlet.open_stream(timeout)
            full = self._inlet.info(timeout)
            self.correction()
        except pylsl.util.TimeoutError:
            raise errors.Timeout(
                f"LSL stream {self.name!r} did not answer within {timeout:g} s; is its program still running?"
            ) from None
        #: The channels' labels; empty where the stream has none.
        self.channels = [_clean(label or "") for label in full.get_channel_labels() or []]

    def correction(self) -> Clock:
        """What is added to the stream's stamps for this host's time.monotonic(), and its error's bound."""
        uncertainty = ctypes.c_double()
        failed = ctypes.c_int()
        function = pylsl.lib.lib["lsl_time_correction_ex"]
        function.restype = ctypes.c_double
        remote = ctypes.c_double()
        offset = function(
            self._open.obj,
            ctypes.byref(remote),
            ctypes.byref(uncertainty),
            ctypes.c_double(5.0),
            ctypes.byref(failed),
        )
        pylsl.util.handle_error(failed)
        # LSL's figure is the round trip.
        return Clock(
            offset - self._clock.offset_s, uncertainty.value / 2 + self._clock.uncertainty_s
        )

    def __iter__(self) -> Iterator[Pulled]:
        return self

    def __next__(self) -> Pulled:
        if self._inlet is None:
            raise StopIteration
        return self.next()

    def next(self, timeout: float | None = None) -> Pulled:
        """The next sample. Raises rtpm.Timeout if none arrives in time."""
        if not self._waiting:
            times_ns, values, uncertainty_ns = self._pull(timeout)
            for time_ns, value in zip(times_ns.tolist(), values.tolist(), strict=True):
                self._waiting.append(Pulled(time_ns, uncertainty_ns, self._texts(value)))
        return self._waiting.popleft()

    def batches(self, timeout: float | None = None) -> Iterator[tuple[Any, Any]]:
        """Yields the samples that wait: their times as an array of nanoseconds, and an array of rows."""
        while self._inlet is not None:
            times_ns, values, _ = self._pull(timeout)
            yield times_ns, values

    def close(self) -> None:
        """Closes the stream."""
        self._inlet = None
        self._waiting.clear()

    @property
    def _open(self) -> Any:
        if self._inlet is None:
            raise errors.Error("this LSL inlet is closed")
        return self._inlet

    def _pull(self, timeout: float | None) -> tuple[Any, Any, int]:
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            wait = min(_SLICE_S, max(0.0, end - time.monotonic()))
            try:
                values, stamps = self._open.pull_chunk(wait, 1024, min_samples=1, as_numpy=True)
            except pylsl.util.LostError:
                raise errors.Disconnected(
                    f"LSL stream {self.name!r} was lost, and has no source id to find it again by"
                ) from None
            if len(stamps):
                correction = self.correction()
                times_ns = numpy.rint((stamps + correction.offset_s) * 1e9).astype(numpy.int64)
                return times_ns, values, round(correction.uncertainty_s * 1e9)
            if time.monotonic() >= end:
                raise errors.Timeout(f"LSL stream {self.name!r} had no sample within {timeout:g} s")

    def _texts(self, value: list[Any]) -> list[Any]:
        if not self._is_text:
            return value
        return [each.decode(errors="replace") for each in value]

    def __repr__(self) -> str:
        state = "closed" if self._inlet is None else f"{self.rate_hz:g} Hz"
        return f"<rtpm.lsl.Inlet {self.name!r} {state}>"


def _find(where: str, timeout: float) -> Any:
    """The first stream that matches `where`."""
    resolver = pylsl.ContinuousResolver(pred=where)
    end = time.monotonic() + timeout
    while not (found := resolver.results()):
        if time.monotonic() >= end:
            raise errors.NameNotFound(
                f"no LSL stream matched {where!r} within {timeout:g} s; does its program run, and do both have "
                "the same session id and network in lsl_api.cfg?"
            )
        time.sleep(_SLICE_S)
    return found[0]


def inlet(where: str, *, timeout: float = 5.0) -> Inlet:
    """Opens an LSL stream, for use in a `with` statement.

    where: LSL's predicate, such as "name='BioSemi'" or "type='EEG'"; the first stream is taken that is
    found within `timeout` seconds. The stream's stamps are converted to this host's clock. If its program
    restarts, the inlet goes on. At most 60 s of it wait for this program; older samples are dropped.
    """
    return Inlet(where, timeout=timeout)
