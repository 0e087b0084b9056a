"""Recordings: files that `rtpm record` wrote, or any other MCAP writer."""

from __future__ import annotations

import copy
import ctypes
import json
import logging
import os
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, cast

from . import _core, errors, schemas
from .endings import Closing
from .values import Struct

_log = logging.getLogger("rtpm")

_SAMPLED = "rtpm.device.Sampled"
#: Columns of a frame of samples, instead of the names of their fields.
_COLUMNS = {f"position_m.{axis}": axis for axis in "xyz"} | {
    f"force_newton.{axis}": f"f{axis}" for axis in "xyz"
}
_FOREVER_NS = 2**64 - 1


class _Channel(NamedTuple):
    number: int
    topic: str
    type: str
    encoding: str
    message_count: int
    metadata: dict[str, str]


class Recorded:
    """A recorded event, sample, request or reply."""

    __slots__ = ("_channel", "_data", "_recording", "log_time_ns", "sequence", "time_ns", "topic")

    def __init__(
        self, recording: Recording, channel: _Channel, message: tuple[int, int, int, int, bytes]
    ) -> None:
        _, self.sequence, self.log_time_ns, self.time_ns, self._data = message
        self.topic = channel.topic
        self._recording = recording
        self._channel = channel

    @property
    def value(self) -> Any:
        """The payload, as an event's `value`; JSON as Python's own types; bytes if the file has no schema of it."""
        return self._recording._decode(self._channel, self._data)

    def __repr__(self) -> str:
        return f"<{self.topic} {self.time_ns} ns, #{self.sequence}: {self.value!r}>"


class Topic:
    """The messages of one topic in order of time. `time_ns` of each is its origin, since 1970 in UTC."""

    def __init__(self, recording: Recording, name: str, channels: list[_Channel]) -> None:
        self._recording = recording
        self._channels = channels
        self.name = name
        self._range_ns = (0, _FOREVER_NS)
        #: The type's name, such as "lab.Touched"; empty if unknown.
        self.type = channels[0].type
        #: How many messages it has, as far as the file says.
        self.count = sum(channel.message_count for channel in channels)
        #: The recorder's notes on the topic.
        self.metadata: Mapping[str, str] = channels[0].metadata

    def __iter__(self) -> Iterator[Recorded]:
        return self._recording._read(self._channels, *self._range_ns)

    def between(self, begin: float, end: float) -> Topic:
        """The part that was recorded from `begin` until before `end`, in seconds since the recording began.

        `count` and `len()` of the part remain those of the whole topic.
        """
        if not begin < end:
            raise ValueError(f"begin takes a time before end, not {begin} before {end}")
        part = copy.copy(self)
        part._range_ns = (self._recording._ns_of(begin), self._recording._ns_of(end) - 1)
        return part

    def values(self) -> Iterator[Any]:
        """The values alone."""
        return (message.value for message in self)

    def array(self) -> Any:
        """Messages of a struct, such as samples, as a structured array: `time_ns`, then the struct's fields."""
        numpy = _import("numpy")
        kind = self._struct()
        record = _dtype_of(kind, numpy)
        data = self._recording.core.read_records(
            [channel.number for channel in self._channels],
            *self._range_ns,
            ctypes.sizeof(kind),
            8,
            8 + ctypes.sizeof(kind),
        )
        packed = {
            "names": ["time_ns", *record.names],
            "formats": ["<i8", *(record[name] for name in record.names)],
            "offsets": [0, *(8 + record.fields[name][1] for name in record.names)],
            "itemsize": 8 + ctypes.sizeof(kind),
        }
        return numpy.frombuffer(data, numpy.dtype(packed))

    def frame(self) -> Any:
        """Messages of a struct as a data frame of pandas: `time`, in seconds since the recording began, then the fields.

        A field of a field is a column "force.x". Samples have short names for the columns of an
        analysis: x, y, z (m), fx, fy, fz (N) and buttons, and no others.
        """
        return _import("pandas").DataFrame(self._frame_columns())

    def arrow(self) -> Any:
        """The columns of frame() as a table of pyarrow, for example for `pyarrow.parquet.write_table`."""
        return _import("pyarrow").table(self._frame_columns())

    def _frame_columns(self) -> dict[str, Any]:
        array = self.array()
        columns = _leaves(array[list(array.dtype.names[1:])], "")
        if self.type == _SAMPLED:
            names = _COLUMNS | {"buttons": "buttons"}
            columns = {names[name]: columns[name] for name in names}
        return {"time": (array["time_ns"] - self._recording.start_ns) * 1e-9} | columns

    def _struct(self) -> type[Struct]:
        kinds = {self._recording._struct_of(channel) for channel in self._channels}
        kind = kinds.pop()
        if kind is None or kinds:
            raise TypeError(
                f"{self.name}: array takes messages of one struct; iterate over {self.type or 'these'}"
            )
        return kind

    def __len__(self) -> int:
        return self.count

    def __repr__(self) -> str:
        return f"<rtpm.Topic {self.name}: {self.count} of {self.type or 'no type'}>"


class Recording(Closing):
    """A file of recorded events, samples and calls."""

    def __init__(self, path: str | os.PathLike[str], *, incomplete: bool = False) -> None:
        """Opens the file; see rtpm.open()."""
        os.stat(path)  # Raises FileNotFoundError or PermissionError.
        #: The file.
        self.path = os.fspath(path)
        self._core: _core.Recording | None = _core.Recording(self.path, incomplete)
        self._channels = {entry[0]: _Channel(*entry) for entry in self._core.channels()}
        self._schemas: dict[int, tuple[schemas.Schema, int] | None] = {}
        by_topic: dict[str, list[_Channel]] = {}
        for channel in self._channels.values():
            by_topic.setdefault(channel.topic, []).append(channel)
        #: The topics by name.
        self.topics = {
            name: Topic(self, name, channels) for name, channels in sorted(by_topic.items())
        }
        #: The names of the devices that it has something of.
        self.devices = sorted(
            {channel.metadata.get("rtpm.device", "") for channel in self._channels.values()} - {""}
        )
        #: Whether the program that wrote it ended it.
        self.is_complete: bool = self._core.is_complete
        #: When the first and last message were recorded, in nanoseconds since 1970 in UTC.
        self.start_ns: int = self._core.begin_ns
        self.end_ns: int = self._core.end_ns

    @property
    def core(self) -> _core.Recording:
        """The extension's recording."""
        if self._core is None:
            raise errors.Error(f"{self.path} is closed")
        return self._core

    @property
    def duration(self) -> float:
        """The time between the first message and the last, in seconds."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Notes on the whole recording: a name and texts each, such as counts of what was dropped."""
        return self.core.metadata()

    def __getitem__(self, name: str) -> Topic:
        """The topic `name`; with a device's name its samples."""
        if name in self.topics:
            return self.topics[name]
        sampled = [
            channel
            for channel in self._channels.values()
            if channel.metadata.get("rtpm.device") == name and channel.type == _SAMPLED
        ]
        if sampled:
            return Topic(self, name, sampled)
        raise KeyError(
            f"{self.path} has no topic or samples of a device {name!r}; it has {', '.join(self.topics)}"
        )

    def __iter__(self) -> Iterator[Recorded]:
        """All messages in order of the time of their recording."""
        return self._read(list(self._channels.values()), 0, _FOREVER_NS)

    def close(self) -> None:
        """Closes the file."""
        self._core = None

    def __repr__(self) -> str:
        return f"<rtpm.Recording {self.path}: {self.duration:.1f} s, {len(self.topics)} topics>"

    def _repr_html_(self) -> str:
        from .display import recording_html

        return recording_html(self)

    def _ns_of(self, seconds: float) -> int:
        return min(max(self.start_ns + round(seconds * 1e9), 1), _FOREVER_NS)

    def _read(self, channels: list[_Channel], from_ns: int, to_ns: int) -> Iterator[Recorded]:
        numbers = [channel.number for channel in channels]
        if not numbers:
            return
        done_count = 0
        while page := self.core.read_page(numbers, from_ns, to_ns, done_count):
            for message in page:
                # Where the next page begins: after so many messages of the last one's time.
                done_count = done_count + 1 if message[2] == from_ns else 1
                from_ns = message[2]
                yield Recorded(self, self._channels[message[0]], message)

    def _schema_of(self, channel: _Channel) -> tuple[schemas.Schema, int] | None:
        if channel.number not in self._schemas:
            self._schemas[channel.number] = None
            text, problem = self.core.schema_of(channel.number)
            if problem:
                _log.warning(
                    "%s: the schema of %s can't be read, so that its values are bytes: %s",
                    self.path,
                    channel.topic,
                    problem,
                )
            if text:
                schema = schemas.schema_of(text)
                for index, item in enumerate(schema.layout["objects"]):
                    if item["name"] == channel.type:
                        self._schemas[channel.number] = (schema, index)
        return self._schemas[channel.number]

    def _struct_of(self, channel: _Channel) -> type[Struct] | None:
        known = self._schema_of(channel)
        return (
            cast("type[Struct] | None", _core.payload_struct(known[0].core, known[1]))
            if known
            else None
        )

    def _decode(self, channel: _Channel, data: bytes) -> Any:
        if channel.encoding == "json":
            return json.loads(data)
        known = self._schema_of(channel)
        return self.core.decode(known[0].core, known[1], data) if known else data


def _dtype_of(kind: Any, numpy: Any) -> Any:
    """The dtype of a struct's class, without its padding, which numpy cannot read from ctypes."""
    if issubclass(kind, ctypes.Array):
        return numpy.dtype((_dtype_of(kind._type_, numpy), kind._length_))
    if not issubclass(kind, Struct):
        return numpy.dtype(kind)
    fields: list[tuple[str, Any, int]] = []
    position = 0
    for name, part, *_ in kind._fields_:
        position = -(-position // ctypes.alignment(part)) * ctypes.alignment(part)
        if not name.startswith("_padding_"):
            fields.append((name, _dtype_of(part, numpy), position))
        position += ctypes.sizeof(part)
    names, formats, offsets = zip(*fields, strict=True)
    return numpy.dtype(
        {"names": names, "formats": formats, "offsets": offsets, "itemsize": ctypes.sizeof(kind)}
    )


def _leaves(array: Any, prefix: str) -> dict[str, Any]:
    """The scalars of a structured array by their names, "force.x" or "joints[3]"."""
    if array.dtype.names:
        parts = [
            (f"{prefix}.{name}" if prefix else name, array[name]) for name in array.dtype.names
        ]
    elif array.ndim > 1:
        parts = [(f"{prefix}[{index}]", array[:, index]) for index in range(array.shape[1])]
    else:
        return {prefix: array}
    return {name: leaf for part, values in parts for name, leaf in _leaves(values, part).items()}


def _import(name: str) -> Any:
    try:
        return __import__(name)
    except ImportError:
        raise ImportError(f"this needs {name}: pip install {name}") from None


def open(path: str | os.PathLike[str], *, incomplete: bool = False) -> Recording:
    """Opens a recording, such as one of `rtpm record`.

    incomplete: also one that was not ended, because its program died; otherwise that is an error.
    """
    return Recording(path, incomplete=incomplete)
