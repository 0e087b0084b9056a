"""Objects of Python are called as others are."""

from __future__ import annotations

import asyncio
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtpm
from rtpm import schemas

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def lab() -> Any:
    """The classes of echo.fbs, whose include is written out."""
    text = (HERE / "echo.fbs").read_text().replace('include "rtpm.fbs";', ATTRIBUTES)
    return type("Lab", (), schemas.Schema(text).names())


ATTRIBUTES = (
    "".join(
        f'attribute "{name}";\n'
        for name in (
            "rtpm_id",
            "rtpm_unit",
            "rtpm_range",
            "rtpm_stream",
            "rtpm_oneway",
            "rtpm_idempotent",
            "rtpm_max_size",
        )
    )
    + "namespace rtpm; table Empty {}\n"
)


def echo_of(lab: Any) -> Any:
    class Echo(lab.EchoServant):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            self.notes: list[int] = []
            self.gate = threading.Event()

        def turn(self, request: Any) -> Any:
            return -1 * request

        def repeat(self, request: Any) -> Any:
            return lab.Text(text=request.text * 2, count=request.count)

        def fail(self, request: Any) -> None:
            if request.count:
                raise rtpm.Refusal("not now", "Overload")
            raise KeyError(request.text)

        def count_up(self, request: Any) -> Iterator[Any]:
            for number in range(request.count):
                yield lab.Text(count=number)

        def note(self, request: Any) -> None:
            self.notes.append(request.count)

        def total(self) -> Any:
            return lab.Text(count=sum(self.notes))

        async def later(self, request: Any) -> Any:
            await asyncio.sleep(0.001 * request.count)
            return request

    return Echo()


@pytest.fixture
def served(lab: Any, node: rtpm.Node) -> Iterator[Any]:
    echo = echo_of(lab)
    with rtpm.serve({"test/echo": echo}, node=node) as server:
        yield type("Served", (), {"echo": echo, "server": server, "url": server.url("test/echo")})


@pytest.fixture(params=["udp", "tcp", "shm"])
def client(request: pytest.FixtureRequest, lab: Any, served: Any, laboratory: Any) -> Any:
    own = rtpm.Node(laboratory.registry.url, transport=request.param)
    return lab.EchoClient("test/echo", node=own)


def test_structs_tables_and_nothing_go_both_ways(lab: Any, client: Any) -> None:
    assert client.turn(lab.Force(1, 2, 3)) == lab.Force(-1, -2, -3)
    assert client.repeat(lab.Text(text="ab", count=7)) == lab.Text(text="abab", count=7)
    assert client.total().count == 0


def test_a_large_message_goes_both_ways(lab: Any, client: Any) -> None:
    assert len(client.repeat(lab.Text(text="x" * 500_000), deadline=10).text) == 1_000_000


@pytest.mark.parametrize("size", [1_200_000, 600_000], ids=["request", "reply"])
def test_a_message_beyond_the_methods_limit_is_refused(lab: Any, client: Any, size: int) -> None:
    with pytest.raises(rtpm.TooLarge):
        client.repeat(lab.Text(text="x" * size), deadline=10)
    assert client.repeat(lab.Text(text="x")).text == "xx"


def test_a_server_describes_its_own_objects(lab: Any, served: Any, node: rtpm.Node) -> None:
    other: Any = rtpm.connect("test/echo", node=node)
    assert other.turn(lab.Force(z=1)).z == -1


def test_a_number_out_of_range_is_refused_with_its_field(lab: Any, client: Any) -> None:
    with pytest.raises(ValueError, match=r"x is 30, but must be -20 to 20"):
        client.turn(lab.Force(x=30))


def test_failures_reach_the_caller_and_the_log(
    lab: Any, client: Any, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(rtpm.Overload, match="overloaded"):
        client.fail(lab.Text(count=1))
    with (
        caplog.at_level(logging.ERROR, "rtpm"),
        pytest.raises(rtpm.ServantFailed, match="KeyError: 'abc'") as caught,
    ):
        client.fail(lab.Text(text="abc"))
    assert caught.value.was_run is True
    assert "raise KeyError" in caplog.text


def test_a_generator_answers_with_a_stream(lab: Any, client: Any) -> None:
    with client.count_up(lab.Text(count=100)) as stream:
        assert [item.count for item in stream] == list(range(100))
    with client.count_up(lab.Text(count=1_000_000)) as stream:
        assert next(stream).count == 0


def test_oneways_arrive(lab: Any, client: Any, served: Any) -> None:
    for number in range(10):
        client.note(lab.Text(count=number))
    end = time.monotonic() + 5
    while sum(served.echo.notes) < 45:
        assert time.monotonic() < end
        time.sleep(0.001)


def test_async_methods_overlap(lab: Any, client: Any) -> None:
    replies = rtpm.many(client.later, [lab.Text(count=100)] * 10, deadline=5)
    assert len(replies) == 10


def test_a_call_that_waited_too_long_is_not_run(lab: Any, node: rtpm.Node) -> None:
    runs = []

    class Slow(type(echo_of(lab))):  # type: ignore[misc]
        def repeat(self, request: Any) -> Any:
            runs.append(request.count)
            self.gate.wait(5)
            return request

    slow = Slow()
    with rtpm.serve({"test/slow": slow}, node=node, named=False) as server:
        client = lab.EchoClient(server.url("test/slow"), node=rtpm.Node(transport="tcp"))
        with pytest.raises(TimeoutError):
            client.repeat(lab.Text(count=1), deadline=0.05)
        with pytest.raises(TimeoutError):
            client.repeat(lab.Text(count=2), deadline=0.05)
        slow.gate.set()
        assert client.total(deadline=5).count == 0
    assert runs == [1]


def test_wrong_servants_are_named(lab: Any, node: rtpm.Node) -> None:
    with pytest.raises(
        TypeError, match="test/x: serve takes a servant of a generated class, not int"
    ):
        rtpm.serve({"test/x": 3}, node=node)  # type: ignore[dict-item]
    with pytest.raises(TypeError, match="abstract"):
        lab.EchoServant()
    with pytest.raises(ValueError, match="kind takes BadRequest"):
        rtpm.Refusal("x", "Nonsense")


def test_a_program_with_a_running_server_ends(laboratory: Any) -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import test_servants as t, rtpm\n"
        "from rtpm import schemas\n"
        "text = (t.HERE / 'echo.fbs').read_text().replace('include \"rtpm.fbs\";', t.ATTRIBUTES)\n"
        "lab = type('Lab', (), schemas.Schema(text).names())\n"
        f"server = rtpm.serve({{'test/end': t.echo_of(lab)}}, node=rtpm.Node({laboratory.registry.url!r}))\n"
        "client = lab.EchoClient('test/end', node=rtpm.Node(transport='udp', registry=server._node.core.where))\n"
        "print(client.turn(lab.Force(1, 2, 3)).x)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(HERE)],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env=os.environ,
    )
    assert (done.returncode, done.stdout) == (0, "-1.0\n"), done.stderr
