"""Asynchronous clients wait by one descriptor, and cancel what is cancelled."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import rtpm
from test_servants import echo_of, lab  # noqa: F401


@pytest.fixture(scope="module")
def served(lab: Any, node: rtpm.Node) -> Iterator[Any]:  # noqa: F811
    echo = echo_of(lab)
    with rtpm.serve({"test/async": echo}, node=node, workers=2):
        yield echo


@pytest.fixture(params=["udp", "tcp", "shm"])
def client(request: pytest.FixtureRequest, lab: Any, served: Any, laboratory: Any) -> Any:  # noqa: F811
    return lab.EchoAsyncClient(
        "test/async", node=rtpm.Node(laboratory.registry.url, transport=request.param)
    )


def test_calls_overlap_on_one_loop(lab: Any, client: Any) -> None:  # noqa: F811
    async def run() -> list[Any]:
        return await asyncio.gather(
            *(client.later(lab.Text(count=number), deadline=5) for number in range(40))
        )

    assert [reply.count for reply in asyncio.run(run())] == list(range(40))


def test_a_cancelled_task_cancels_its_call(lab: Any, client: Any) -> None:  # noqa: F811
    async def run() -> None:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(client.later(lab.Text(count=5000), deadline=20), 0.05)
        assert (await client.turn(lab.Force(1, 2, 3), deadline=5)).x == -1

    asyncio.run(run())


def test_errors_arrive_as_exceptions(lab: Any, client: Any) -> None:  # noqa: F811
    async def run() -> None:
        with pytest.raises(ValueError, match="x is 30, but must be"):
            await client.turn(lab.Force(x=30))
        with pytest.raises(TimeoutError):
            await client.later(lab.Text(count=1000), deadline=0.01)
        with pytest.raises(TypeError, match="turn takes 1 argument, not 0"):
            await client.turn()

    asyncio.run(run())


def test_streams_are_async_iterators(lab: Any, client: Any) -> None:  # noqa: F811
    async def run() -> list[int]:
        async with client.count_up(lab.Text(count=500)) as stream:
            return [item.count async for item in stream]

    assert asyncio.run(run()) == list(range(500))


def test_several_loops_follow_one_another(lab: Any, client: Any) -> None:  # noqa: F811
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(20):
        asyncio.run(client.total())
    assert len(os.listdir("/proc/self/fd")) < before + 20


def test_an_object_is_connected_to_within_a_loop(lab: Any, served: Any, node: rtpm.Node) -> None:  # noqa: F811
    async def run() -> float:
        other: Any = await rtpm.connect_async("test/async", node=node)
        async with other:
            x: float = (await other.turn(lab.Force(1, 0, 0))).x
            return x

    assert asyncio.run(run()) == -1


SERVER = """
import sys; sys.path.insert(0, sys.argv[1])
import rtpm, test_contexts
with rtpm.serve({"test/other": test_contexts.Rest()}, node=rtpm.Node("host"), named=False) as server:
    print(server.url("test/other"), flush=True)
    server.wait()
"""


def test_a_stopped_server_does_not_hold_up_the_loop(lab: Any, laboratory: Any) -> None:  # noqa: F811
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER, os.path.dirname(__file__)], stdout=subprocess.PIPE, text=True
    )
    assert server.stdout is not None

    async def run(url: str) -> None:
        turns = 0

        async def work() -> None:
            nonlocal turns
            while True:
                await asyncio.sleep(0.001)
                turns += 1

        client = await rtpm.bind(lab.EchoAsyncClient, url, node=rtpm.Node("host"))
        await client.total()
        other = asyncio.create_task(work())
        server.send_signal(signal.SIGSTOP)
        # Each needs a channel of its own.
        calls = [client.total(deadline=0.2) for _ in range(4)]
        ended = await asyncio.gather(*calls, return_exceptions=True)
        assert all(isinstance(end, rtpm.CallError) for end in ended), ended
        assert turns > 4
        server.send_signal(signal.SIGCONT)
        assert (await client.total(deadline=5)).count == 0
        other.cancel()

    try:
        asyncio.run(run(server.stdout.readline().strip()))
    finally:
        server.kill()
        server.wait()


def test_waiting_does_not_poll(lab: Any, client: Any) -> None:  # noqa: F811
    class Loop(asyncio.SelectorEventLoop):
        turns = 0

        def _run_once(self) -> None:
            self.turns += 1
            super()._run_once()  # type: ignore[misc]

    loop = Loop()
    try:
        loop.run_until_complete(client.total(deadline=5))
        loop.turns = 0
        loop.run_until_complete(client.later(lab.Text(count=500), deadline=20))
        assert loop.turns < 20
    finally:
        loop.close()
