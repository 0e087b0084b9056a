"""Events: subscriptions to a hub, with filters, and suppliers.

Events wait in a bounded queue outside Python until the program takes them; what it takes too late is
dropped and counted.
"""

from __future__ import annotations

import asyncio
import ctypes
import dataclasses
import functools
import logging
import time
import types
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Sequence
from types import TracebackType
from typing import Any, Generic, TypeVar, cast

from . import _core, endings, errors, schemas, values
from .calls import Node, default_node
from .values import Event, Struct

_log = logging.getLogger("rtpm")

_E = TypeVar("_E", bound=Event)
_EventClass = type[Event]

#: Larger numbers belong to the hub: events::kEventTypeMax.
_TYPE_MAX = 0x7FFF_FFFF
_HUB_NAMES = {0x8000_0001: "timeout", 0x8000_0002: "link"}
#: Device events; their source is a hash of the device's name: schema/idl/device_events.fbs.
_DEVICE_TYPES = {*range(1380974593, 1380974601), 1380974604}
_DEVICE = "rtpm.device.Device"
#: How often unknown types and names are asked for again, in seconds.
_ASK_INTERVAL = 1.0
#: How many events an `async for` takes in a row before the other tasks have their turn.
_EAGER_COUNT_MAX = 64


# ---- filters ------------------------------------------------------------------------------------


class Filter:
    """Which events a subscription gets. Filters combine by `|`, `&` and `~`."""

    __slots__ = ("text", "types")

    def __init__(self, text: str, types: tuple[type[Event], ...] = ()) -> None:
        #: As `rtpm echo --filter` takes it.
        self.text = text
        #: Event classes that it names.
        self.types = types

    def __or__(self, other: Any) -> Filter:
        return _joined(" or ", self, other)

    def __ror__(self, other: Any) -> Filter:
        return _joined(" or ", other, self)

    def __and__(self, other: Any) -> Filter:
        return _joined(" and ", self, other)

    def __rand__(self, other: Any) -> Filter:
        return _joined(" and ", other, self)

    def __invert__(self) -> Filter:
        return Filter(f"not ({self.text})", self.types)

    def __repr__(self) -> str:
        return f"rtpm.Filter({self.text!r})"


#: A filter, its text, an event's class, a union of classes, or a list of any of these.
Where = Filter | str | type[Event] | types.UnionType | Iterable[Any] | None


def filter_of(where: Where) -> Filter:
    """The filter that `where` means; None means all events."""
    if where is None:
        return Filter("all")
    if isinstance(where, Filter):
        return where
    if isinstance(where, str):
        return Filter(where)
    if isinstance(where, type):
        if not issubclass(where, Event) or not where._rtpm_event_[0]:
            raise TypeError(f"where takes the class of an event, not {where.__name__}")
        return Filter(f"type({where._rtpm_event_[0]})", (where,))
    if isinstance(where, types.UnionType):
        where = where.__args__
    if not isinstance(where, Iterable):
        raise TypeError(
            f"where takes a text, an event's class or a list of them, not {type(where).__name__}"
        )
    parts = list(where)
    if not parts:
        raise ValueError("where takes at least one event's class")
    return (
        functools.reduce(functools.partial(_joined, " or "), parts)
        if len(parts) > 1
        else filter_of(parts[0])
    )


def correlate(*of: Where, within: float | None = None) -> Filter:
    """The newest event of each together, as a tuple, with origins at most `within` seconds apart."""
    if len(of) < 2:
        raise TypeError("correlate takes at least two kinds of events")
    first, *others = [filter_of(each) for each in of]
    word = "with" if within is None else f"within {_nanoseconds(within)}ns of"
    text = f"(({first.text}) {word} {', '.join(f'({each.text})' for each in others)})"
    return Filter(text, sum((each.types for each in others), first.types))


def silence(seconds: float) -> Filter:
    """A timeout whenever nothing else was delivered for so long: an event whose `is_timeout` is true."""
    return Filter(f"silence({_nanoseconds(seconds)}ns)")


def _joined(word: str, left: Where, right: Where) -> Filter:
    left, right = filter_of(left), filter_of(right)
    return Filter(f"({left.text}){word}({right.text})", left.types + right.types)


def _nanoseconds(seconds: float) -> int:
    if not 0 < seconds < 1e9:
        raise ValueError(f"a time takes seconds above 0, not {seconds}")
    return round(seconds * 1e9)


# ---- types --------------------------------------------------------------------------------------


class EventType:
    """An event's type with its schema."""

    def __init__(self, kind: type[Event]) -> None:
        self.kind = kind
        self.name = kind._rtpm_key_[0]
        self.schema: _core.Schema
        self.index: int
        self.schema, self.index = kind._rtpm_origin_
        #: The struct that it consists of on the wire; None if it is a table.
        self.struct = cast("type[Struct] | None", _core.payload_struct(self.schema, self.index))

    @functools.cached_property
    def record(self) -> Any:
        """The class of a batch's elements."""
        # All of eight bytes: numpy cannot read a structure's padding from ctypes.
        fields = [
            ("time_ns", ctypes.c_int64),
            ("source", ctypes.c_uint64),
            ("sequence", ctypes.c_uint64),
        ]
        body = {
            "_fields_": [*fields, ("payload", self.struct)],
            "__doc__": f"A {self.name} of a batch.",
        }
        return type(f"{self.kind.__name__}Record", (ctypes.Structure,), body)

    def decode(self, payload: bytes) -> Any:
        return self.schema.decode(self.index, payload)

    def payload_of(self, value: Any) -> Any:
        """What is sent for `value`, which may be the event or, if that is a struct's, the struct."""
        if self.struct is None or not isinstance(value, self.kind):
            return value
        return getattr(value, self.kind.__match_args__[0])


class Received:
    """An event that was received."""

    __slots__ = ("_event", "_events", "_type", "_value")

    def __init__(self, events: Events, event: _Event) -> None:
        self._event = event
        self._events = events
        self._type = events._types.get(event[:2]) or events._type_of(event[0], event[1])

    @property
    def type_number(self) -> int:
        """The type's number in its schema; that of a timeout if `is_timeout`."""
        return self._event[0]

    @property
    def time_ns(self) -> int:
        """When it happened, on the clock of time.monotonic_ns()."""
        return self._event[2]

    @property
    def uncertainty_ns(self) -> int | None:
        """How far `time_ns` may be wrong; None if not known, as of a hub on another host."""
        return _known(self._event[8])

    @property
    def source(self) -> int:
        """Which supplier of the type sent it, by the number that it gave."""
        return self._event[3]

    @property
    def sequence(self) -> int:
        """Its number among those of its supplier, type and source, from 1."""
        return self._event[4]

    @property
    def priority(self) -> int:
        """That of its supplier."""
        return self._event[5]

    @property
    def is_replayed(self) -> bool:
        """Whether it is older than the subscription."""
        return self._event[6]

    @property
    def type(self) -> _EventClass | None:
        """The event's class; None for timeouts, and if the hub does not know the schema."""
        return self._type.kind if self._type else None

    @property
    def name(self) -> str:
        """The type's name, "lab.Touched"; its number if the hub does not know it."""
        return (
            self._type.name
            if self._type
            else _HUB_NAMES.get(self.type_number, str(self.type_number))
        )

    @property
    def is_timeout(self) -> bool:
        """Whether this tells that a time has passed, for example of silence."""
        return self.type_number == 0x8000_0001

    @property
    def value(self) -> Any:
        """The payload: the event's struct if it has nothing else, else the event; bytes without a schema."""
        if not hasattr(self, "_value"):
            payload = self._event[7]
            self._value = self._type.decode(payload) if self._type else payload
        return self._value

    @property
    def device(self) -> str | None:
        """The name of the device that sent it, such as "lab/arm0", if it is a device's event and its name is known."""
        return self._events._device_of(self.source) if self.type_number in _DEVICE_TYPES else None

    def __repr__(self) -> str:
        return f"<{self.name} {self.time_ns} ns, source {self.source}, #{self.sequence}: {self.value!r}>"


# ---- subscriptions ------------------------------------------------------------------------------

#: An event of the extension: type, schema, time, source, sequence, priority, whether it is replayed,
#: payload, and the time's uncertainty.
_Event = tuple[int, int, int, int, int, int, bool, bytes, int]


def _known(uncertainty_ns: int) -> int | None:
    return None if uncertainty_ns == 0xFFFF_FFFF else uncertainty_ns


@dataclasses.dataclass(frozen=True)
class Losses:
    """How many events were lost, by cause."""

    #: This program took them too late: `queue` events waited for it already.
    queue: int = 0
    #: It took them too late: 64 MiB waited for it already.
    queue_memory: int = 0
    #: A newer event of the same type and source took their place: policy "keep_latest".
    replaced: int = 0
    #: More than 4096 of them waited at the hub for the network.
    overflow: int = 0
    #: The subscription's thread read the hub's ring in shared memory too slowly.
    overrun: int = 0
    #: The network lost them: multicast.
    network: int = 0
    #: The hub, or the subscription's thread, had no memory for them.
    memory: int = 0
    #: They were too large for the transport.
    too_large: int = 0

    @property
    def total(self) -> int:
        """All of them."""
        return sum(dataclasses.astuple(self))

    def __bool__(self) -> bool:
        return self.total > 0


def _end_of(timeout: float | None) -> float | None:
    return None if timeout is None else time.monotonic() + timeout


def _left_until(end: float | None) -> float | None:
    return None if end is None else max(end - time.monotonic(), 0.0)


class Batch(Sequence[Any]):
    """Events of one type, a sequence of (time_ns, source, sequence, payload).

    numpy.asarray(batch) is a structured array that shares its memory.
    """

    __slots__ = ("records", "uncertainty_ns")

    def __init__(self, records: ctypes.Array[Any], uncertainty_ns: int | None = 0) -> None:
        #: A ctypes array, which is a buffer.
        self.records = records
        #: How far each `time_ns` may be wrong; None if not known, as of a hub on another host.
        self.uncertainty_ns = uncertainty_ns

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, index: Any) -> Any:
        return self.records[index]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        import numpy

        # Not by the buffer's format, in which ctypes leaves out the padding at a struct's end.
        kind = numpy.dtype(self.records._type_)
        array = numpy.frombuffer(cast(Any, self.records), kind)
        if dtype is not None and numpy.dtype(dtype) != kind:
            return array.astype(dtype)
        return array.copy() if copy else array

    def __repr__(self) -> str:
        return f"<{len(self)} {self.records._type_.__name__}>"


class Batches:
    """The events of a subscription, many at a time, for `for` and `async for`."""

    def __init__(self, events: Events, count: int, timeout: float | None) -> None:
        self._events = events
        self._count = count
        self._timeout = timeout

    def __iter__(self) -> Batches:
        return self

    def __next__(self) -> Batch:
        end = _end_of(self._timeout)
        while True:
            core = self._events._open_core()
            if core is None:
                raise StopIteration
            batch = self._take(core, core.peek(_left_until(end)))
            if batch:
                return batch

    def __aiter__(self) -> Batches:
        return self

    async def __anext__(self) -> Batch:
        end = _end_of(self._timeout)
        while True:
            core, first = await self._events._await(lambda core: core.try_peek(), end)
            batch = self._take(core, first)
            if batch:
                return batch

    def _take(self, core: _core.Subscription, first: Any) -> Batch | None:
        """A batch that begins with the event that peek() described; None if that is a timeout."""
        number, schema_id, size, is_part = first
        if number > _TYPE_MAX:
            core.try_next()
            return None
        known = self._events._type_of(number, schema_id)
        if is_part or known is None or known.struct is None:
            name = known.name if known else f"type {number}"
            raise TypeError(
                f"{name}: batches takes single events of a struct; use next() for others"
            )
        if size != ctypes.sizeof(known.struct):
            core.try_next()
            raise errors.BadReply(
                f"{known.name}: an event has {size} bytes, its schema {ctypes.sizeof(known.struct)}"
            )
        record = known.record
        data, uncertainty_ns = core.take_records(
            self._count, number, schema_id, size, record.payload.offset, ctypes.sizeof(record)
        )
        records = (record * (len(data) // ctypes.sizeof(record))).from_buffer(data)
        return Batch(records, _known(uncertainty_ns))


class Events(endings.Closing):
    """A subscription, as an iterator of events; those of a conjunction come together as a tuple.

    `for` waits, `async for` lets the other tasks of its event loop run. Either ends when the
    subscription is closed.
    """

    def __init__(
        self,
        where: Where = None,
        *,
        hub: str = "rtpm/events",
        node: Node | None = None,
        queue: int = 65536,
        policy: str = "drop_oldest",
        every_nth: int = 1,
        interval: float = 0,
        interval_per_source: bool = False,
        deadbands: Iterable[tuple[_EventClass, str, float]] = (),
        replay: int = 0,
        priority: int = 0,
        multicast: bool = False,
    ) -> None:
        if policy not in ("drop_oldest", "keep_latest"):
            raise ValueError(f"policy takes 'drop_oldest' or 'keep_latest', not {policy!r}")
        _check_range("queue", queue, 1, 1 << 20)
        _check_range("every_nth", every_nth, 1, (1 << 32) - 1)
        _check_range("replay", replay, 0, 64)
        self._node = node or default_node()
        selected = filter_of(where)
        given = [EventType(kind) for kind in dict.fromkeys(selected.types)]
        #: By number and fingerprint.
        self._types = {each.kind._rtpm_event_: each for each in given}
        self._devices: dict[int, str] = {}
        self._asked_types = self._asked_devices = -_ASK_INTERVAL
        self._core: _core.Subscription | None = _core.Subscription(
            self._node.core,
            hub,
            selected.text,
            [(each.schema, each.index) for each in given],
            queue,
            policy == "keep_latest",
            every_nth,
            interval,
            interval_per_source,
            [(kind._rtpm_event_[0], field, threshold) for kind, field, threshold in deadbands],
            replay,
            priority,
            multicast,
        )
        self._ended_losses = Losses()
        #: Of tasks that wait, all of one loop.
        self._waiters: set[asyncio.Future[None]] = set()
        self._eager_count = 0
        endings.before_exit(self)

    @property
    def core(self) -> _core.Subscription:
        """The extension's subscription."""
        core = self._open_core()
        if core is None:
            raise errors.Error("this subscription is closed")
        return core

    def _open_core(self) -> _core.Subscription | None:
        self._node.check()
        return self._core

    def __iter__(self) -> Iterator[Any]:
        return self

    def __next__(self) -> Any:
        core = self._core
        if core is None:
            raise StopIteration
        self._node.check()
        delivery = core.next(None)
        return Received(self, delivery) if type(delivery) is tuple else self._received(delivery)

    def next(self, timeout: float | None = None) -> Any:
        """The next event, or the tuple of a conjunction. Raises rtpm.Timeout if none arrives in time."""
        return self._received(self.core.next(timeout))

    def _received(self, delivery: Any) -> Any:
        if type(delivery) is tuple:
            return Received(self, delivery)
        return tuple(Received(self, event) for event in delivery)

    def __aiter__(self) -> AsyncIterator[Any]:
        return self

    async def __anext__(self) -> Any:
        _, delivery = await self._await(lambda core: core.try_next(), None)
        return self._received(delivery)

    def batches(self, count: int = 1024, timeout: float | None = None) -> Batches:
        """Waiting events, as soon as there are some, by up to `count` of one type at once.

        All must be events of structs; timeouts are left out. Raises rtpm.Timeout if none arrives in
        time.
        """
        _check_range("count", count, 1, 1 << 20)
        return Batches(self, count, timeout)

    @property
    def losses(self) -> Losses:
        """How many events were lost so far. While there are more, the log says so once a second."""
        core = self._open_core()
        return self._ended_losses if core is None else Losses(*core.losses)

    def fileno(self) -> int:
        """A file descriptor that is readable while next() would return at once, for event loops."""
        return self.core.fileno()

    def close(self) -> None:
        """Unsubscribes."""
        core, self._core = self._core, None
        if core is not None and not self._node.is_forked:
            core.close()
            self._ended_losses = Losses(*core.losses)

    stop = close

    async def __aenter__(self) -> Events:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    async def _await(
        self, take: Callable[[_core.Subscription], Any], end: float | None
    ) -> tuple[_core.Subscription, Any]:
        """The subscription, and what `take` returns of it as soon as that is not None."""
        if self._eager_count >= _EAGER_COUNT_MAX:
            await asyncio.sleep(0)
            self._eager_count = 0
        while True:
            core = self._open_core()
            if core is None:
                raise StopAsyncIteration
            try:
                taken = take(core)
            except StopIteration:
                raise StopAsyncIteration from None
            if taken is not None:
                self._eager_count += 1
                return core, taken
            left = _left_until(end)
            if left == 0:
                raise errors.Timeout("no event arrived in time")
            self._eager_count = 0
            await self._readable(core, left)

    async def _readable(self, core: _core.Subscription, timeout: float | None) -> None:
        """Waits until try_next() has more to tell, at most so many seconds."""
        loop = asyncio.get_running_loop()
        if any(waiter.get_loop() is not loop for waiter in self._waiters):
            raise RuntimeError("a task of another event loop waits for this subscription")
        waiter: asyncio.Future[None] = loop.create_future()
        # The task keeps the extension's subscription, so that the descriptor stays open.
        descriptor = core.fileno()
        if not self._waiters:
            loop.add_reader(descriptor, self._wake)
        self._waiters.add(waiter)
        try:
            await asyncio.wait((waiter,), timeout=timeout)
        finally:
            self._waiters.discard(waiter)
            if not self._waiters:
                loop.remove_reader(descriptor)

    def _wake(self) -> None:
        for waiter in self._waiters:
            if not waiter.done():
                waiter.set_result(None)

    def _type_of(self, number: int, schema_id: int) -> EventType | None:
        known = self._types.get((number, schema_id))
        if known or number > _TYPE_MAX:
            return known
        now = time.monotonic()
        if now - self._asked_types >= _ASK_INTERVAL:
            self._asked_types = now
            self._ask_types()
        return self._types.get((number, schema_id))

    def _ask_types(self) -> None:
        try:
            known = self.core.types()
        except errors.Error as error:
            _log.warning("the types of events are not known: %s", error)
            return
        for number, name, schema_id, text in known:
            if (number, schema_id) in self._types or not text:
                continue
            try:
                schema = schemas.schema_of(text)
            except ValueError as error:
                _log.warning("%s: %s", name, error)
                continue
            for index, item in enumerate(schema.layout["objects"]):
                if item["event"] == number and item["fingerprint"] == schema_id:
                    self._types[number, schema_id] = EventType(schema.classes.objects[index])

    def _device_of(self, source: int) -> str | None:
        now = time.monotonic()
        if source not in self._devices and now - self._asked_devices >= _ASK_INTERVAL:
            self._asked_devices = now
            try:
                entries = self._node.core.names("")
            except errors.Error:
                return None
            for entry in entries:
                if entry["interface"] == _DEVICE:
                    self._devices[source_of(entry["name"])] = entry["name"]
        return self._devices.get(source)


def source_of(name: str) -> int:
    """The source of a device's events: the 32-bit FNV-1a hash of its name."""
    result = 0x811C9DC5
    for byte in name.encode():
        result = (result ^ byte) * 0x01000193 & 0xFFFF_FFFF
    return result


def events(
    where: Where = None,
    *,
    hub: str = "rtpm/events",
    node: Node | None = None,
    queue: int = 65536,
    policy: str = "drop_oldest",
    every_nth: int = 1,
    interval: float = 0,
    interval_per_source: bool = False,
    deadbands: Iterable[tuple[_EventClass, str, float]] = (),
    replay: int = 0,
    priority: int = 0,
    multicast: bool = False,
) -> Events:
    """Subscribes to the events of a hub, for use in a `with` statement.

    where: a text such as "type(lab.Touched) and force.z > 2", an event's class, a list of classes, or
    a filter by rtpm.correlate() and rtpm.silence(), combined by `|`; all events if None. queue: how
    many events wait at most for this program. policy: what gives way when they are too many: the
    oldest, or with "keep_latest" all but the newest of each type and source.

    Fewer events: every_nth delivers the first and then every n-th. interval: at most one delivery
    in so many seconds, the last one at its end; interval_per_source: one of each type and source.
    deadbands: (class, field, threshold) leaves out an event whose field differs by less than the
    threshold from the last delivered one.

    replay: how many of the latest events of each type and source come first, if the hub still has
    them; 1 gives the latest value. priority: that of the hub's sends to this program. multicast: from
    a hub on another host, takes its multicast if it has one.
    """
    return Events(
        where,
        hub=hub,
        node=node,
        queue=queue,
        policy=policy,
        every_nth=every_nth,
        interval=interval,
        interval_per_source=interval_per_source,
        deadbands=deadbands,
        replay=replay,
        priority=priority,
        multicast=multicast,
    )


def _check_range(name: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} takes {low} to {high}, not {value}")


# ---- suppliers ----------------------------------------------------------------------------------


class Supplier(endings.Closing, Generic[_E]):
    """Pushes events of one type to a hub."""

    def __init__(
        self,
        kind: type[_E],
        *,
        hub: str = "rtpm/events",
        source: int = 0,
        priority: int = 0,
        node: Node | None = None,
    ) -> None:
        """A supplier for `hub`, a name or a URL, whose events come from `source`."""
        filter_of(kind)  # Raises if it is no event.
        self._node = node or default_node()
        self._type = EventType(kind)
        self._source = source
        self._core: _core.Supplier | None = _core.Supplier(
            self._node.core, (self._type.schema, self._type.index), hub, priority
        )

    @property
    def core(self) -> _core.Supplier:
        """The extension's supplier."""
        self._node.check()
        if self._core is None:
            raise errors.Error("this supplier is closed")
        return self._core

    def push(
        self, value: _E | Struct, *, source: int | None = None, time_ns: int | None = None
    ) -> None:
        """Pushes an event, without waiting for its consumers.

        time_ns: when it happened, by time.monotonic_ns(); now if None.
        """
        self.core.push(
            self._type.payload_of(value), self._source if source is None else source, time_ns
        )

    def push_many(self, many: Iterable[_E | Struct], *, source: int | None = None) -> None:
        """Pushes many events in few messages; of structs also as a buffer, such as a structured array.

        Does not wait for subscribers: one that takes them too slowly loses the oldest, and counts them.
        """
        source = self._source if source is None else source
        kind = self._type.struct
        if kind is None:
            self.core.push_many(many, source)
            return
        try:
            memoryview(cast(Any, many))
        except TypeError:
            many = [self._type.payload_of(value) for value in many]
        self.core.push_packed(
            values.struct_bytes(kind, many, "push_many"), ctypes.sizeof(kind), source
        )

    def close(self) -> None:
        """Ends the supplier."""
        self._core = None


def supplier(
    kind: type[_E],
    *,
    hub: str = "rtpm/events",
    source: int = 0,
    priority: int = 0,
    node: Node | None = None,
) -> Supplier[_E]:
    """A supplier of events of class `kind` to a hub, for use in a `with` statement.

    source: what its events come from. priority: that of its events at the hub.
    """
    return Supplier(kind, hub=hub, source=source, priority=priority, node=node)
