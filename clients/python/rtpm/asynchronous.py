"""Clients for asyncio: no thread and no polling, one descriptor per event loop."""

from __future__ import annotations

import asyncio
import weakref
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from . import _core
from .calls import Node, _Bound, close, default_node, scope, set_facts

if TYPE_CHECKING:
    from .schemas import Schema

_A = TypeVar("_A", bound="AsyncClient")
_Item = TypeVar("_Item")

_calls: weakref.WeakKeyDictionary[asyncio.AbstractEventLoop, _core.AsyncCalls] = (
    weakref.WeakKeyDictionary()
)


def _calls_of(loop: asyncio.AbstractEventLoop) -> _core.AsyncCalls:
    """The calls of an event loop, which it polls when their descriptor is readable."""
    calls = _calls.get(loop)
    if calls is None:
        calls = _calls[loop] = _core.AsyncCalls()
        loop.add_reader(calls.fileno(), calls.poll)
    return calls


class AsyncClient(_Bound):
    """An object of a server, for asyncio. Its class has one method per method of the service.

    Making it binds the object, which may block for up to `deadline` seconds: in a running loop,
    `await rtpm.bind(ArmAsyncClient, "lab/arm0")` does not. A cancelled call tells the server so.
    """

    async def __aenter__(self: _A) -> _A:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        close(self)


class AsyncStream(Generic[_Item]):
    """The items that answer a call, for `async for`. The server waits for a slow reader."""

    def __init__(self, core: _core.Stream, node: Node) -> None:
        self._core = core
        self._node = node

    def __aiter__(self) -> AsyncStream[_Item]:
        return self

    async def __anext__(self) -> _Item:
        self._node.check()
        loop = asyncio.get_running_loop()
        while True:
            state = self._core.try_next()
            if state is None:
                raise StopAsyncIteration
            has_item, *rest = cast("tuple[Any, ...]", state)
            if has_item:
                return cast(_Item, rest[0])
            await _readable(loop, *rest)

    async def close(self) -> None:
        """Cancels the stream."""
        if not self._node.is_forked:
            self._core.cancel()

    async def __aenter__(self) -> AsyncStream[_Item]:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()


async def _readable(loop: asyncio.AbstractEventLoop, descriptor: int, seconds: float) -> None:
    """Waits until the descriptor is readable, at most so many seconds."""
    if descriptor < 0:
        await asyncio.sleep(0)
        return
    is_readable = asyncio.Event()
    loop.add_reader(descriptor, is_readable.set)
    timer = loop.call_later(seconds, is_readable.set)
    try:
        await is_readable.wait()
    finally:
        timer.cancel()
        loop.remove_reader(descriptor)


async def bind(
    kind: type[_A], target: str, *, node: Node | None = None, deadline: float | None = None
) -> _A:
    """Makes an asynchronous client without holding up the event loop."""
    loop = asyncio.get_running_loop()
    return await loop.run_in_executor(None, lambda: kind(target, node=node, deadline=deadline))


async def connect_async(target: str, *, node: Node | None = None) -> AsyncClient:
    """An asynchronous client of the object at `target`, by the schema that its server publishes."""
    from . import schemas

    node = node or default_node()
    loop = asyncio.get_running_loop()
    service, text = await loop.run_in_executor(None, node.core.describe, target)
    return await bind(schemas.schema_of(text).async_clients[service], target, node=node)


async def _start(loop: asyncio.AbstractEventLoop, call: _core.PreparedCall) -> None:
    """Starts a call that may have to open a channel, for which the loop must not wait."""
    started = loop.run_in_executor(None, call.start)
    # Its exception is of no interest once the task is gone.
    started.add_done_callback(lambda ended: ended.cancelled() or ended.exception())
    done, _ = await asyncio.wait((started,), timeout=call.seconds_left)
    if not done:
        call.time_out()
    started.result()


async def _call(
    binding: _core.Binding, index: int, request: Any, priority: Any, deadline: Any
) -> Any:
    loop = asyncio.get_running_loop()
    calls = _calls_of(loop)
    future: asyncio.Future[Any] = loop.create_future()

    def done(reply: Any, error: Any) -> None:
        if future.done():
            return
        if error is None:
            future.set_result(reply)
        else:
            future.set_exception(error)

    begun = calls.begin(binding, index, request, priority, deadline, scope.get(), done)
    if isinstance(begun, _core.PreparedCall):
        await _start(loop, begun)
        begun = calls.add(begun, done)
    number = cast(int, begun)
    try:
        return await future
    except asyncio.CancelledError:
        calls.cancel(number)
        raise


def async_client_class(schema: Schema, index: int, module: str) -> type[AsyncClient]:
    """The asynchronous client class of a schema's service."""
    service = schema.layout["services"][index]
    name = service["class"] + "AsyncClient"
    body: dict[str, Any] = {
        "__module__": module,
        "__doc__": service["doc"].strip() or f"An asynchronous client of {service['name']}.",
        "_rtpm_schema_": schema,
        "_rtpm_service_": index,
    }
    for number, method in enumerate(service["methods"]):
        body[method["attribute"]] = set_facts(_method(number, method), schema, number, method, name)
    return type(name, (AsyncClient,), body)


def _method(index: int, method: dict[str, Any]) -> Any:
    if method["is_stream"]:

        def stream(
            self: Any, *request: Any, priority: int | None = None, deadline: float | None = None
        ) -> Any:
            argument = _argument(method, request)
            core = self._rtpm_binding_.open_stream(
                index, argument, priority, deadline, scope.get(), 16
            )
            return AsyncStream(core, self._rtpm_node_)

        return stream
    if method["is_oneway"]:

        async def oneway(
            self: Any, *request: Any, priority: int | None = None, deadline: float | None = None
        ) -> None:
            self._rtpm_binding_.call(
                index, _argument(method, request), priority, deadline, scope.get()
            )

        return oneway

    async def call(
        self: Any, *request: Any, priority: int | None = None, deadline: float | None = None
    ) -> Any:
        return await _call(
            self._rtpm_binding_, index, _argument(method, request), priority, deadline
        )

    return call


def _argument(method: dict[str, Any], request: tuple[Any, ...]) -> Any:
    wanted = 0 if method["request"] is None else 1
    if len(request) != wanted:
        raise TypeError(
            f"{method['attribute']} takes {wanted} argument{'' if wanted == 1 else 's'}, not {len(request)}"
        )
    return request[0] if request else None
