"""Calls of real servers, by the schemas that they publish."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import socket
import threading
import time
from typing import Any

import pytest
import rtpm
from conftest import Laboratory


@pytest.fixture
def arm(node: rtpm.Node) -> Any:
    with rtpm.connect("lab/arm0", node=node) as client:
        yield client


def test_an_object_is_called_by_its_own_schema(arm: Any) -> None:
    description = arm.describe()
    assert description.model == "RTPM simulated arm"
    assert [axis.name for axis in description.axes] == ["x", "y", "z"]
    first = arm.read()
    while arm.read().sequence == first.sequence:
        time.sleep(0.001)
    assert "newest sample" in arm.read.__doc__


@pytest.mark.parametrize("transport", ["udp", "tcp", "shm"])
def test_calls_go_over_each_transport(laboratory: Laboratory, transport: str) -> None:
    own = rtpm.Node(laboratory.registry.url, transport=transport)
    arm: Any = rtpm.connect("lab/arm0", node=own)
    assert rtpm.transport_of(arm) == transport
    assert arm.describe().serial == "sim-arm0"


def test_many_calls_keep_their_order(arm: Any) -> None:
    replies = rtpm.many(arm.read, [None] * 100, deadline=5)
    sequences = [reply.sequence for reply in replies]
    assert len(sequences) == 100
    assert sequences == sorted(sequences)


def test_errors_are_pythons_own(arm: Any, node: rtpm.Node) -> None:
    with pytest.raises(LookupError, match="the name 'lab/arm9' is not bound.*lab/arm0"):
        rtpm.connect("lab/arm9", node=node)
    with pytest.raises(ConnectionRefusedError, match="does not answer"):
        rtpm.connect("rtpm://127.0.0.1:9/nothing", node=node)
    with pytest.raises(TypeError, match="the argument takes a Command, not int"):
        arm.command(3)
    with pytest.raises(ValueError, match="priority takes 0 to 32767, not 99999"):
        arm.read(priority=99999)
    with pytest.raises(ValueError, match="a time takes seconds"):
        arm.read(deadline=-1)
    with pytest.raises(TimeoutError) as caught:
        for _ in range(1000):
            arm.read(deadline=1e-9)
    assert isinstance(caught.value, rtpm.CallError)
    assert caught.value.is_transient
    assert caught.value.target == "lab/arm0"


def test_a_closed_client_says_so(node: rtpm.Node) -> None:
    arm: Any = rtpm.connect("lab/arm0", node=node)
    rtpm.close(arm)
    with pytest.raises(rtpm.Error, match="this client is closed"):
        arm.read()


def test_ctrl_c_ends_a_wait(node: rtpm.Node) -> None:
    # A port that takes datagrams and answers none.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        url = f"rtpm://127.0.0.1:{silent.getsockname()[1]}/x"
        sent_at = 0.0

        def interrupt() -> None:
            nonlocal sent_at
            sent_at = time.monotonic()
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(0.2, interrupt)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            rtpm.connect(url, node=node)
        assert sent_at > 0
        timer.join()


def test_threads_call_at_the_same_time(arm: Any) -> None:
    counts: list[int] = []

    def work() -> None:
        for _ in range(200):
            arm.read(deadline=1)
        counts.append(1)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(counts) == 8


def test_other_threads_run_during_a_wait(node: rtpm.Node) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        url = f"rtpm://127.0.0.1:{silent.getsockname()[1]}/x"

        def wait() -> None:
            with pytest.raises(rtpm.Error):
                rtpm.device(url, node=node, patience=0.2)

        waiting = threading.Thread(target=wait)
        waiting.start()
        count = 0
        while waiting.is_alive():
            count += 1
        assert count > 1000


def test_handles_do_not_pickle_and_say_why(node: rtpm.Node, arm: Any) -> None:
    with rtpm.device("lab/arm0", node=node) as device, rtpm.events(node=node) as events:
        for handle in (node, arm, device, events):
            with pytest.raises(TypeError, match="pass the name, and open it there"):
                pickle.dumps(handle)


def in_child(arm: Any, answers: Any) -> None:
    try:
        arm.read()
    except rtpm.ForkedError as error:
        answers.put(str(error))
    else:
        answers.put("the call went through")


def test_a_forked_child_is_told_so(arm: Any) -> None:
    context = multiprocessing.get_context("fork")
    answers = context.SimpleQueue()
    child = context.Process(target=in_child, args=(arm, answers))
    child.start()
    assert "make an rtpm.Node here" in answers.get()
    child.join(10)
    assert child.exitcode == 0
