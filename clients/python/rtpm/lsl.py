"""Lab Streaming Layer: devices and events of RTPM as LSL streams, and LSL streams as devices of RTPM.

    with rtpm.lsl.outlet("lab/arm0"), rtpm.lsl.markers("type(lab.Touched)"):
        ...
    with rtpm.lsl.device("type='EEG'", "lab/eeg0"):
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
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

from . import endings, errors
from .calls import Node, default_node
from .events import Events, Filter, Received, Supplier, Where, filter_of, source_of
from .idl.device_events_rtpm import Sampled
from .idl.device_rtpm import (
    Analog,
    Description,
    DeviceClass,
    DeviceClient,
    DeviceServant,
    FlightRecordReply,
    LeaseStanding,
    Outcome,
    Quaternion,
    Sample,
    Vector3,
)
from .servants import Refusal, serve
from .values import Struct, Table, replace

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
#: How often an outlet's clock is told, in seconds.
_CLOCK_S = 1.0


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
        Channel(axis, f"Position{axis.upper()}", "meters", "position_m", axis)
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
        Channel(f"f{axis}", f"Force{axis.upper()}", "newtons", "force_newton", axis)
        for axis in straight
        if axes[axis].is_actuated
    ]
    channels += [
        Channel(f"t{axis}", f"Torque{axis.upper()}", "newton meters", "torque_newton_metre", axis)
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
    """A stream that a thread of its own fills from a hub's events until it is closed.

    Beside it, the stream "NAME.clock" tells once a second how far its stamps may be wrong, in seconds;
    NaN as long as that is not known.
    """

    def __init__(self, info: pylsl.StreamInfo, events: Events, clock: Clock, period: float) -> None:
        self._info = info
        self._events = events
        self._outlet = pylsl.StreamOutlet(info)
        self._period = period
        #: How stamps are converted.
        self.clock = clock
        #: How far the newest stamps may be wrong, in seconds.
        self.uncertainty_s = math.nan
        self._ended = threading.Event()
        self._threads = [
            threading.Thread(target=run, name="rtpm-lsl", daemon=True)
            for run in (self._run, self._tell_clock)
        ]
        for thread in self._threads:
            thread.start()
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
        for thread in self._threads:
            thread.join()

    stop = close

    def _tell_clock(self) -> None:
        info = pylsl.StreamInfo(
            f"{self._info.name()}.clock",
            "Clock",
            1,
            1 / _CLOCK_S,
            pylsl.cf_double64,
            f"{self._info.source_id()}:clock",
        )
        info.set_channel_labels(["uncertainty"])
        info.set_channel_units(["seconds"])
        outlet = pylsl.StreamOutlet(info)
        while not self._ended.wait(_CLOCK_S):
            outlet.push_sample([self.uncertainty_s], pylsl.local_clock())

    def _learn_uncertainty(self, uncertainty_ns: int | None) -> None:
        known_s = math.nan if uncertainty_ns is None else uncertainty_ns * 1e-9
        self.uncertainty_s = known_s + self.clock.uncertainty_s

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
            self._learn_uncertainty(batch.uncertainty_ns)
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
    # Stamps are times of measurement, as the device tells them: nothing was subtracted.
    acquisition.append_child_value("compensated_lag", "0")
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
                self._learn_uncertainty(event.uncertainty_ns)
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
    centre = "0" if math.isfinite(clock.uncertainty_s) else "nan"
    description.append_child_value("offset_mean", centre)
    description.append_child_value("offset_median", centre)
    description.append_child_value("offset_rms", f"{clock.uncertainty_s:g}")
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
    """An LSL stream, as an iterator of its samples.

    A thread takes them from LSL as they come; what the program takes too late is dropped and counted.
    """

    def __init__(self, where: str, *, timeout: float = 5.0, queue: int | None = None) -> None:
        """Opens the stream that `where` names; see rtpm.lsl.inlet()."""
        self._inlet: Any = None
        info = _find(where, timeout)
        self.name = _clean(info.name())
        self.type = _clean(info.type())
        #: How many samples it has per second; 0 if they come irregularly.
        self.rate_hz = float(info.nominal_srate())
        self._is_text = info.channel_format() == pylsl.cf_string
        if queue is None:
            queue = round(_QUEUE_S * (self.rate_hz or 100))
        self._waiting: collections.deque[tuple[int, int, Any]] = collections.deque(maxlen=queue)
        #: How many samples were dropped, because `queue` newer ones waited for the program.
        self.losses = 0
        self._problem: errors.Error | None = None
        self._news = threading.Condition()
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
        #: The channels' labels, units; empty where the stream has none.
        self.channels = [_clean(label or "") for label in full.get_channel_labels() or []]
        self.units = [_clean(unit or "") for unit in full.get_channel_units() or []]
        self.channel_count = int(info.channel_count())
        #: What the stream's program calls its source; empty if it does not.
        self.source_id = _clean(info.source_id())
        self._thread = threading.Thread(target=self._take, name="rtpm-lsl-inlet", daemon=True)
        self._thread.start()
        endings.before_exit(self)

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
        with self._news:
            self._await(timeout)
            time_ns, uncertainty_ns, value = self._waiting.popleft()
        return Pulled(time_ns, uncertainty_ns, self._texts(value.tolist()))

    def batches(self, timeout: float | None = None) -> Iterator[tuple[Any, Any]]:
        """Yields the samples that wait: their times as an array of nanoseconds, and an array of rows."""
        while self._inlet is not None:
            with self._news:
                self._await(timeout)
                rows = list(self._waiting)
                self._waiting.clear()
            times_ns = numpy.array([time_ns for time_ns, _, _ in rows], numpy.int64)
            yield times_ns, numpy.array([value for _, _, value in rows])

    def close(self) -> None:
        """Closes the stream."""
        with self._news:
            self._inlet = None
            self._waiting.clear()
            self._news.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    stop = close

    @property
    def _open(self) -> Any:
        if self._inlet is None:
            raise errors.Error("this LSL inlet is closed")
        return self._inlet

    def _await(self, timeout: float | None) -> None:
        """Waits for a sample; the caller has the lock."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        while not self._waiting:
            assert self._open
            if self._problem is not None:
                raise self._problem
            left = end - time.monotonic()
            if left <= 0:
                raise errors.Timeout(f"LSL stream {self.name!r} had no sample within {timeout:g} s")
            self._news.wait(min(_SLICE_S, left))

    def _take(self) -> None:
        """Moves samples from LSL's buffer to the program's."""
        while (inlet := self._inlet) is not None:
            try:
                values, stamps = inlet.pull_chunk(_SLICE_S, 1024, min_samples=1, as_numpy=True)
                if not len(stamps):
                    continue
                correction = self.correction()
            except pylsl.util.LostError:
                self._fail(
                    f"LSL stream {self.name!r} was lost, and has no source id to find it again by"
                )
                return
            except (errors.Error, pylsl.util.TimeoutError):
                continue  # Closed meanwhile, or its clock did not answer: the next chunk tells.
            times_ns = numpy.rint((stamps + correction.offset_s) * 1e9).astype(numpy.int64)
            uncertainty_ns = round(correction.uncertainty_s * 1e9)
            with self._news:
                for time_ns, value in zip(times_ns.tolist(), values, strict=True):
                    self.losses += len(self._waiting) == self._waiting.maxlen
                    self._waiting.append((time_ns, uncertainty_ns, value))
                self._news.notify_all()

    def _fail(self, text: str) -> None:
        with self._news:
            self._problem = errors.Disconnected(text)
            self._news.notify_all()

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


def inlet(where: str, *, timeout: float = 5.0, queue: int | None = None) -> Inlet:
    """Opens an LSL stream, for use in a `with` statement.

    where: LSL's predicate, such as "name='BioSemi'" or "type='EEG'"; the first stream is taken that is
    found within `timeout` seconds. The stream's stamps are converted to this host's clock. If its program
    restarts, the inlet goes on. queue: how many samples wait at most for this program, those of 60 s by
    default; older ones are dropped, and counted in `losses`.
    """
    return Inlet(where, timeout=timeout, queue=queue)


# ---- streams as devices -------------------------------------------------------------------------

#: How many channels of a stream a sample takes; one more analog has the time's uncertainty.
CHANNEL_COUNT_MAX = 7
_ACTIVE, _FAULT = 2, 3
_DEVICE_GONE = 1 << 2


class _StreamServant(DeviceServant):
    """Answers for a device that only measures: it describes itself, and has no force to command."""

    def __init__(self, name: str, description: Description) -> None:
        self._name = name
        self._description = description
        self.newest = Sample(orientation=Quaternion(0, 0, 0, 1), lifecycle=_ACTIVE)

    def describe(self) -> Description:
        return self._description

    def read(self) -> Sample:
        return self.newest

    def emergency_stop(self, request: Any) -> Outcome:
        return Outcome()  # Nothing moves.

    def lease_state(self, request: Any) -> LeaseStanding:
        return LeaseStanding()

    def read_flight_record(self, request: Any) -> FlightRecordReply:
        return FlightRecordReply(cycles=[])

    def _refuse(self, *request: Any) -> Any:
        raise Refusal(f"{self._name} is an LSL stream: it measures, and takes no commands")

    command = acquire = renew = release = recover = activate = deactivate = take_over = _refuse
    rearm = set_models = _refuse


class StreamDevice(endings.Closing):
    """An LSL stream that is a device of RTPM until it is closed."""

    def __init__(
        self,
        where: str,
        name: str,
        *,
        channels: Sequence[int] | None,
        hub: str,
        node: Node | None,
        timeout: float,
    ) -> None:
        self.name = name
        self.inlet = Inlet(where, timeout=timeout)
        self._source = source_of(name)
        try:
            self._channels = self._choose(channels)
            self._servant = _StreamServant(name, self._description())
            self._supplier = Supplier(Sampled, hub=hub, source=self._source, node=node)
            self._server = serve({name: self._servant}, node=node)
        except BaseException:
            self.inlet.close()
            raise
        self._thread = threading.Thread(target=self._run, name="rtpm-lsl-device", daemon=True)
        self._thread.start()
        endings.before_exit(self)

    @property
    def losses(self) -> int:
        """How many samples of the stream were dropped because this program was too slow."""
        return self.inlet.losses

    def close(self) -> None:
        """Ends the device."""
        self.inlet.close()
        self._thread.join()
        self._server.stop()
        self._supplier.close()

    stop = close

    def _choose(self, channels: Sequence[int] | None) -> list[int]:
        count = self.inlet.channel_count
        if self.inlet._is_text:
            raise errors.SetupError(
                f"LSL stream {self.inlet.name!r} consists of texts; read it by rtpm.lsl.inlet()"
            )
        if channels is None:
            if count > CHANNEL_COUNT_MAX:
                _log.warning(
                    "%s: the device has %d of the %d channels; `channels` chooses which",
                    self.name,
                    CHANNEL_COUNT_MAX,
                    count,
                )
            return list(range(min(count, CHANNEL_COUNT_MAX)))
        if not 1 <= len(channels) <= CHANNEL_COUNT_MAX or not all(
            0 <= each < count for each in channels
        ):
            raise ValueError(
                f"channels takes 1 to {CHANNEL_COUNT_MAX} numbers from 0 to {count - 1}"
            )
        return list(channels)

    def _description(self) -> Description:
        def entry(texts: list[str], channel: int, default: str) -> str:
            return (texts[channel] if channel < len(texts) else "") or default

        analogs = [
            Analog(
                name=entry(self.inlet.channels, channel, f"channel {channel}"),
                unit=entry(self.inlet.units, channel, "1"),
            )
            for channel in self._channels
        ]
        return Description(
            device_class=DeviceClass.Biometric,
            model=f"LSL {self.inlet.type or 'stream'}",
            serial=self.inlet.source_id or self.inlet.name,
            frame="none",
            axes=[],
            buttons=[],
            analogs=[*analogs, Analog(name="time uncertainty", unit="s")],
            workspace_low_m=Vector3(0, 0, 0),
            workspace_high_m=Vector3(0, 0, 0),
            rate_hz=self.inlet.rate_hz,
            joints=[],
            outputs=[],
            modes=[],
        )

    def _run(self) -> None:
        sequence = 0
        try:
            for pulled in self.inlet:
                sequence += 1
                self._publish(sequence, pulled)
        except errors.Disconnected as error:
            _log.error("%s: %s", self.name, error)
            gone = {"lifecycle": _FAULT, "faults": _DEVICE_GONE, "success_rate": 0.0}
            self._servant.newest = cast(Sample, replace(self._servant.newest, **gone))
        except errors.Error:
            if self.inlet._inlet is not None:
                _log.exception("%s: the device gets no more data", self.name)

    def _publish(self, sequence: int, pulled: Pulled) -> None:
        values = [float(pulled.value[channel]) for channel in self._channels]
        values.append(pulled.uncertainty_ns * 1e-9)
        sample = Sample(
            sequence=sequence,
            host_time_ns=pulled.time_ns,
            orientation=Quaternion(0, 0, 0, 1),
            analogs=values + [0.0] * (8 - len(values)),
            success_rate=1.0,
            lifecycle=_ACTIVE,
        )
        self._servant.newest = sample
        try:
            self._supplier.push(sample, time_ns=pulled.time_ns)
        except errors.CallError as error:
            _log.warning("%s: a sample did not reach the hub: %s", self.name, error)

    def __repr__(self) -> str:
        return f"<rtpm.lsl.StreamDevice {self.name!r} of {self.inlet!r}>"


def device(
    where: str,
    name: str,
    *,
    channels: Sequence[int] | None = None,
    hub: str = "rtpm/events",
    node: Node | None = None,
    timeout: float = 5.0,
) -> StreamDevice:
    """Makes an LSL stream a device of class biometric, named `name`, for use in a `with` statement.

    Its samples go to `hub`, so that pages, recordings and filters have them beside those of other
    devices, with their times on this host's clock. channels: which, by number from 0; at most seven,
    the first ones by default. They are the sample's analogs, and one more is the bound of the time's
    error in seconds. The device takes no commands.
    """
    return StreamDevice(where, name, channels=channels, hub=hub, node=node, timeout=timeout)
