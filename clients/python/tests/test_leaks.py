"""Many objects of each kind come and go, and leave nothing behind: no object, memory or descriptor."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rtpm
from conftest import Laboratory
from rtpm import schemas
from test_recordings import file  # noqa: F401
from test_servants import echo_of, lab  # noqa: F401


class _Mallinfo(ctypes.Structure):
    _fields_ = [(f"_{number}", ctypes.c_size_t) for number in range(10)]

    def byte_count(self) -> int:
        used, mapped = self._7, self._4
        return int(used + mapped)


_mallinfo2 = ctypes.CDLL(None).mallinfo2
_mallinfo2.restype = _Mallinfo


def held() -> tuple[int, int, int, int]:
    """Objects, blocks of Python's allocator, bytes of malloc(), and descriptors."""
    gc.collect()
    objects = len(gc.get_objects())
    return (
        objects,
        sys.getallocatedblocks(),
        _mallinfo2().byte_count(),
        len(os.listdir("/proc/self/fd")),
    )


def expect_flat(work: Callable[[], object], count: int) -> None:
    """Nothing of `count` turns is left, but what the first ones and other threads' caches keep."""
    for _ in range(max(count // 10, 20)):
        work()
    end = time.monotonic() + 20
    before = held()
    for _ in range(count):
        work()
    # What a server or thread still ends takes a moment.
    while True:
        growth = [now - then for now, then in zip(held(), before, strict=True)]
        objects, blocks, byte_count, descriptors = growth
        is_flat = objects < count / 10 + 20 and blocks < count / 10 + 300
        if is_flat and byte_count < 4 * count + 200_000 and descriptors <= 0:
            return
        assert time.monotonic() < end, f"{count} turns left objects, blocks, bytes, files: {growth}"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def echo(lab: Any, node: rtpm.Node) -> Iterator[Any]:  # noqa: F811
    with (
        rtpm.serve({"test/leaks": echo_of(lab)}, node=node, named=False) as server,
        lab.EchoClient(server.url("test/leaks"), node=rtpm.Node(transport="shm")) as client,
    ):
        yield client


def test_values(lab: Any) -> None:  # noqa: F811
    index = lab.Text._rtpm_origin_[1]
    schema = lab.Text._rtpm_origin_[0]

    def work() -> None:
        force = lab.Force(1, 2, 3)
        memoryview(force)
        schema.decode(index, schema.encode(index, lab.Text(text="abc" * 100, count=3)))
        with pytest.raises(TypeError):
            lab.Force(x="1")

    expect_flat(work, 100_000)


@pytest.mark.parametrize("transport", ["shm", "udp", "tcp"])
def test_calls(laboratory: Laboratory, transport: str) -> None:
    node = rtpm.Node(laboratory.registry.url, transport=transport)
    arm: Any = rtpm.connect("lab/arm0", node=node)
    expect_flat(lambda: arm.read(deadline=10), 100_000 if transport == "shm" else 5_000)
    expect_flat(lambda: arm.describe(deadline=10), 1_000)
    expect_flat(lambda: rtpm.many(arm.read, [None] * 100, deadline=10), 20)


def test_failed_calls(lab: Any, echo: Any) -> None:  # noqa: F811
    arguments = lab.Force(x=30), lab.Text(text="a")

    def work() -> None:
        with pytest.raises(rtpm.BadRequest):
            echo.turn(arguments[0], deadline=10)
        with pytest.raises(TimeoutError):
            echo.repeat(arguments[1], deadline=0)
        with pytest.raises(TypeError):
            echo.turn(3)

    expect_flat(work, 3_000)


def test_calls_of_servants(lab: Any, echo: Any) -> None:  # noqa: F811
    force, text = lab.Force(1, 2, 3), lab.Text(text="a", count=0)

    def work() -> None:
        echo.turn(force, deadline=10)
        echo.repeat(text, deadline=10)
        echo.later(text, deadline=10)

    expect_flat(work, 2_000)


def test_streams(lab: Any, echo: Any) -> None:  # noqa: F811
    few, many = lab.Text(count=3), lab.Text(count=1_000_000)

    def work() -> None:
        assert len(list(echo.count_up(few, deadline=10))) == 3
        with echo.count_up(many, deadline=10) as stream:
            next(stream)
        next(echo.count_up(many, deadline=10))

    expect_flat(work, 300)


def test_asynchronous_calls(lab: Any, echo: Any) -> None:  # noqa: F811
    import asyncio

    url = rtpm.url_of(echo)

    async def call(client: Any) -> None:
        await client.turn(lab.Force(1, 2, 3), deadline=10)
        task = asyncio.ensure_future(client.later(lab.Text(count=100), deadline=10))
        await asyncio.sleep(0)
        task.cancel()
        async with client.count_up(lab.Text(count=1_000_000), deadline=10) as items:
            await anext(items)

    client = lab.EchoAsyncClient(url, node=rtpm.Node(transport="udp"))
    expect_flat(lambda: asyncio.run(call(client)), 200)


def test_clients_devices_and_nodes(laboratory: Laboratory, node: rtpm.Node) -> None:
    def work() -> None:
        own = rtpm.Node(laboratory.registry.url)
        client: Any = rtpm.connect("lab/arm0", node=own)
        client.read(deadline=10)
        rtpm.close(client)
        with (
            rtpm.device("lab/arm0", node=node, patience=10) as arm,
            arm.command(patience=10) as tip,
        ):
            tip.force = (0, 0, 0)
            tip.render(rtpm.Wall(normal=(0, 0, 1)))

    expect_flat(work, 50)


def test_servers(lab: Any, node: rtpm.Node) -> None:  # noqa: F811
    servant = echo_of(lab)

    def work() -> None:
        with rtpm.serve({"test/leaking": servant}, node=node, workers=2) as server:
            client = lab.EchoClient(server.url("test/leaking"), node=node)
            client.later(lab.Text(count=0), deadline=10)

    expect_flat(work, 40)


def test_subscriptions_and_suppliers(node: rtpm.Node) -> None:
    text = 'attribute "rtpm_event"; namespace lab; table Leaked (rtpm_event: 7041) { count:int; }'
    leaked = schemas.Schema(text).names()["Leaked"]

    def work() -> None:
        with (
            rtpm.events(leaked, node=node) as events,
            rtpm.supplier(leaked, node=node) as supplier,
        ):
            supplier.push(leaked(count=1))
            assert events.next(10).value.count == 1

    expect_flat(work, 40)


def test_events(node: rtpm.Node) -> None:
    with rtpm.events("type(rtpm.device.Sampled)", node=node) as events:
        expect_flat(lambda: events.next(10).value, 1_000)
        batches = events.batches(10, timeout=10)
        expect_flat(lambda: len(next(batches)), 200)


def test_recordings(file: Path) -> None:  # noqa: F811
    def work() -> None:
        with rtpm.open(file) as recording:
            topic = recording["lab/arm0"]
            assert next(topic.values()).sequence
            topic.array()

    expect_flat(work, 100)


def test_schemas() -> None:
    text = "namespace lab; table Leaking { number:int; } rpc_service Leaks { get(Leaking):Leaking (rtpm_id: 1); }"
    expect_flat(lambda: schemas.Schema('attribute "rtpm_id"; ' + text), 200)
