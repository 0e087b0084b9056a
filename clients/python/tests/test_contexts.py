"""Calls that a servant makes inherit the priority, the remaining time and the trace of its own call."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest
import rtpm
from rtpm import schemas
from test_servants import ATTRIBUTES

TEXT = (Path(__file__).parent / "echo.fbs").read_text()
lab: Any = type(
    "Lab",
    (),
    schemas.Schema(TEXT.replace('include "rtpm.fbs";', ATTRIBUTES)).names(),
)


class Rest(lab.EchoServant):  # type: ignore[misc, name-defined]
    """The methods that a test does not need."""

    def turn(self, request: Any) -> Any:
        return request

    def repeat(self, request: Any) -> Any:
        return request

    def fail(self, request: Any) -> None: ...

    def count_up(self, request: Any) -> Iterator[Any]:
        yield request

    def note(self, request: Any) -> None: ...

    def total(self) -> Any:
        return lab.Text()

    def later(self, request: Any) -> Any:
        return request


class Inner(Rest):
    """Notes the context of each call of total()."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, int]] = []
        self.left: list[float] = []
        self.gate = threading.Event()

    def total(self) -> Any:
        call = rtpm.current_call()
        assert call is not None and call.seconds_left is not None
        assert call.host == "127.0.0.1" and call.caller == "" and call.is_awaited
        self.seen.append((call.priority, call.trace_id))
        self.left.append(call.seconds_left)
        return lab.Text(count=call.priority)

    def repeat(self, request: Any) -> Any:
        self.gate.wait(10)
        return request


@pytest.fixture
def inner(node: rtpm.Node) -> Iterator[Any]:
    servant = Inner()
    with rtpm.serve({"test/inner": servant}, node=node, named=False, workers=2) as server:
        servant.url = server.url("test/inner")  # type: ignore[attr-defined]
        yield servant
        servant.gate.set()


class Outer(Rest):
    """Calls the inner servant."""

    def __init__(self, inner: Any, node: rtpm.Node) -> None:
        self.client = lab.EchoClient(inner.url, node=node)
        self.async_client = lab.EchoAsyncClient(inner.url, node=node)
        self.errors: list[Exception] = []

    def total(self) -> Any:
        return self.client.total()

    def repeat(self, request: Any) -> Any:
        try:
            return self.client.repeat(request)
        except rtpm.Error as error:
            self.errors.append(error)
            raise

    def count_up(self, request: Any) -> Iterator[Any]:
        yield self.client.total()

    async def later(self, request: Any) -> Any:
        await asyncio.sleep(0.001)
        # A task has the context, too.
        return await asyncio.create_task(self.async_client.total())


class AsyncOuter(Outer):
    async def total(self) -> Any:
        return await self.async_client.total()

    async def repeat(self, request: Any) -> Any:
        try:
            return await self.async_client.repeat(request)
        except rtpm.Error as error:
            self.errors.append(error)
            raise

    async def count_up(self, request: Any) -> AsyncIterator[Any]:  # type: ignore[override]
        yield await self.async_client.total()


@pytest.fixture(params=[Outer, AsyncOuter])
def outer(request: pytest.FixtureRequest, inner: Any, node: rtpm.Node) -> Iterator[Any]:
    servant = request.param(inner, node)
    with rtpm.serve({"test/outer": servant}, node=node, named=False, workers=4) as server:
        servant.own = lab.EchoClient(server.url("test/outer"), node=node)
        yield servant


def test_a_nested_call_inherits(inner: Any, outer: Any) -> None:
    with rtpm.calling(trace_id=77):
        assert outer.own.total(priority=500, deadline=0.5).count == 500
        assert outer.own.later(lab.Text(), priority=501, deadline=0.5).count == 501
        assert [item.count for item in outer.own.count_up(lab.Text(), priority=502)] == [502]
    assert inner.seen == [(500, 77), (501, 77), (502, 77)]
    assert max(inner.left[:2]) <= 0.5
    # It never gets more time than its method has by itself: a second.
    outer.own.total(deadline=100)
    assert inner.left[-1] <= 1
    assert rtpm.current_call() is None


def test_calls_at_the_same_time_keep_their_own(inner: Any, outer: Any) -> None:
    async def call_all() -> list[Any]:
        client = lab.EchoAsyncClient(rtpm.url_of(outer.own), node=outer.own._rtpm_node_)
        calls = [client.later(lab.Text(), priority=number, deadline=5) for number in range(20)]
        return await asyncio.gather(*calls)

    assert [reply.count for reply in asyncio.run(call_all())] == list(range(20))


def test_the_end_of_the_remaining_time_ends_a_nested_call(outer: Any) -> None:
    # Both deadlines end together: the servant may still tell of its own.
    with pytest.raises((TimeoutError, rtpm.ServantFailed)):
        outer.own.repeat(lab.Text(), deadline=0.1)
    # The servant's own call ends long before the inner method returns.
    end = time.monotonic() + 5
    while not outer.errors and time.monotonic() < end:
        time.sleep(0.001)
    assert isinstance(outer.errors[0], TimeoutError)


def test_a_block_of_calls_has_a_priority_and_a_deadline(inner: Any, node: rtpm.Node) -> None:
    client = lab.EchoClient(inner.url, node=node)
    with rtpm.calling(priority=300, deadline=20, trace_id=5):
        client.total()
        with rtpm.calling(priority=301):
            client.total()
        with rtpm.calling(deadline=0.4):
            client.total()
        client.total(priority=302, deadline=0.3)
    client.total()
    assert inner.seen == [(300, 5), (301, 5), (300, 5), (302, 5), (inner.seen[-1][0], 0)]
    first, second, third, fourth, last = inner.left
    assert 1 < second <= first <= 20 and third <= 0.4 and fourth <= 0.3 and last <= 1
    with rtpm.calling(deadline=0.05), pytest.raises(TimeoutError):
        while True:
            client.total()
    with pytest.raises(ValueError, match="priority takes 0 to 32767"), rtpm.calling(priority=-1):
        pass


def test_coroutines_have_blocks_of_their_own(inner: Any, node: rtpm.Node) -> None:
    async def one(client: Any, priority: int) -> int:
        with rtpm.calling(priority=priority):
            await asyncio.sleep(0.001)
            return int((await client.total()).count)

    async def test() -> list[int]:
        client = lab.EchoAsyncClient(inner.url, node=node)
        return await asyncio.gather(*(one(client, number) for number in range(10)))

    assert asyncio.run(test()) == list(range(10))
