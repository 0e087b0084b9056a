"""Events of a hub arrive filtered, in order and decoded; suppliers push single ones and many."""

from __future__ import annotations

import asyncio
import ctypes
import logging
import os
import select
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import numpy as np
import pytest
import rtpm
from conftest import Laboratory, Program
from rtpm import schemas

TEXT = """
attribute "rtpm_event";
namespace lab;
struct Force { x:double; y:double; z:double; }
/// The user touched something.
table Touched (rtpm_event: 7001) { force:Force (required); }
table Marked (rtpm_event: 7002) { name:string; level:int = 3; }
"""
_names = schemas.Schema(TEXT).names()
Force, Touched, Marked = _names["Force"], _names["Touched"], _names["Marked"]


@pytest.fixture
def hub(laboratory: Laboratory) -> Iterator[str]:
    started = Program("rtpm-eventd", "--port", "0", "--name", "", folder=laboratory.folder)
    yield started.url
    started.end()


def touch(z: float) -> Any:
    return Force(0, 0, z)


def test_events_arrive_typed_and_in_order(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Touched, hub=hub, node=node) as events,
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
    ):
        before = time.monotonic_ns()
        touched.push(touch(1))
        touched.push(Touched(force=touch(2)), source=4)
        touched.push_many([touch(3), touch(4)], source=4)
        received = [events.next(5) for _ in range(4)]
        assert [event.value.z for event in received] == [1, 2, 3, 4]
        assert [event.source for event in received] == [0, 4, 4, 4]
        assert [event.sequence for event in received] == [1, 1, 2, 3]
        assert all(before <= event.time_ns <= time.monotonic_ns() for event in received)
        assert received[0].type is Touched and received[0].name == "lab.Touched"
        assert received[0].device is None and events.losses == rtpm.Losses()
        assert (received[0].priority, received[0].is_replayed) == (0, False)
        with pytest.raises(TimeoutError):
            events.next(0.01)


def test_an_origin_is_kept(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Marked, hub=hub, node=node) as events,
        rtpm.supplier(Marked, hub=hub, node=node) as marked,
    ):
        at = time.monotonic_ns() - 20_000_000
        marked.push(Marked(name="then"), time_ns=at)
        event = events.next(5)
        assert event.value == Marked(name="then", level=3)
        assert abs(event.time_ns - at) < 5_000_000


def test_filters_select_by_text_class_and_combination(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
        rtpm.supplier(Marked, hub=hub, node=node) as marked,
        rtpm.events("type(lab.Touched) and z > 2", hub=hub, node=node) as strong,
        rtpm.events([Touched, Marked], hub=hub, node=node) as both,
        rtpm.events(~rtpm.Filter("type(lab.Touched)"), hub=hub, node=node) as others,
    ):
        touched.push(touch(1))
        touched.push(touch(3))
        touched.push(touch(4))
        marked.push(Marked(name="end"))
        assert [strong.next(5).value.z for _ in range(2)] == [3, 4]
        # Events of two suppliers have no order.
        names = sorted(both.next(5).name for _ in range(4))
        assert names == ["lab.Marked"] + ["lab.Touched"] * 3
        assert others.next(5).value.name == "end"


def test_types_that_only_the_hub_knows_are_decoded(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.supplier(Marked, hub=hub, node=node) as marked,
        rtpm.events(hub=hub, node=node) as events,
    ):
        marked.push(Marked(name="seen", level=5))
        event = events.next(5)
        assert (event.value.name, event.value.level, event.type) == ("seen", 5, Marked)


def test_events_of_a_conjunction_come_together(hub: str, node: rtpm.Node) -> None:
    where = rtpm.correlate(Touched, Marked, within=1.0) | rtpm.silence(0.02)
    with (
        rtpm.events(where, hub=hub, node=node) as events,
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
        rtpm.supplier(Marked, hub=hub, node=node) as marked,
    ):
        assert events.next(5).is_timeout
        marked.push(Marked(name="a"))
        touched.push(touch(9))
        while not isinstance(pair := events.next(5), tuple):
            assert pair.is_timeout and pair.value == b""
        first, second = pair
        assert (first.value.z, second.value.name) == (9, "a")


def test_batches_are_structured_arrays(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Touched, hub=hub, node=node) as events,
        rtpm.supplier(Touched, hub=hub, node=node, source=3) as touched,
    ):
        forces = np.zeros((500, 3))
        forces[:, 2] = np.arange(500)
        touched.push_many(forces)
        batches = []
        for batch in events.batches(128, timeout=5):
            assert len(batch) <= 128
            batches.append(np.asarray(batch))
            if sum(map(len, batches)) == 500:
                break
        every = np.concatenate(batches)
        assert every["payload"]["z"].tolist() == list(range(500))
        assert set(every["source"]) == {3} and every["sequence"].tolist() == list(range(1, 501))
        assert (np.diff(every["time_ns"]) >= 0).all()
        assert ctypes.sizeof(batch.records) == every.dtype.itemsize * len(batch)


def test_batches_need_structs(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Marked, hub=hub, node=node) as events,
        rtpm.supplier(Marked, hub=hub, node=node) as marked,
    ):
        marked.push(Marked(name="table"))
        with pytest.raises(TypeError, match="lab.Marked: batches takes single events of a struct"):
            next(events.batches(10, timeout=5))


@pytest.mark.parametrize("policy, last", [("drop_oldest", [8, 9]), ("keep_latest", [9])])
def test_a_slow_program_loses_old_events_and_counts_them(
    hub: str, node: rtpm.Node, policy: str, last: list[int]
) -> None:
    with (
        rtpm.events(Touched, hub=hub, node=node, queue=2, policy=policy) as events,
        rtpm.events(Touched, hub=hub, node=node) as fast,
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
    ):
        for z in range(10):
            touched.push(touch(z))
            fast.next(5)
        end = time.monotonic() + 5
        while events.losses.total < 10 - len(last):
            assert time.monotonic() < end
            time.sleep(0.001)
        assert [events.next(5).value.z for _ in last] == last
        cause = {"drop_oldest": "queue", "keep_latest": "replaced"}[policy]
        assert events.losses == rtpm.Losses(**{cause: 10 - len(last)})
    assert events.losses


def test_losses_are_logged_once_a_burst_and_at_the_end(
    hub: str, node: rtpm.Node, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        caplog.at_level(logging.WARNING, "rtpm"),
        rtpm.events(Touched, hub=hub, node=node, queue=1) as events,
        rtpm.events(Touched, hub=hub, node=node) as fast,
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
    ):
        for first in (0, 4):
            for z in range(first, first + 4):
                touched.push(touch(z))
                fast.next(5)
            while events.losses.total < (3 if first == 0 else 6):
                time.sleep(0.001)
            assert events.next(5).value.z == first + 3
    texts = [record.getMessage() for record in caplog.records]
    queue = "because this program's queue was full"
    assert texts == [
        f"{hub}: 3 events were lost; in all 3 {queue}",
        f"{hub}: 3 events were lost; in all 6 {queue}",
    ]


def test_a_burst_of_many_events_arrives_whole(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Touched, hub=hub, node=node) as events,
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
    ):
        for _ in range(5):
            touched.push_many(np.zeros((2000, 3)))
        assert sum(len(next(events.batches(1, timeout=5))) for _ in range(10_000)) == 10_000


def test_a_struct_with_padding_is_an_array_without_a_warning(hub: str, node: rtpm.Node) -> None:
    text = """
    attribute "rtpm_event"; namespace lab;
    struct Step { at:double; number:int; }
    table Stepped (rtpm_event: 7003) { step:Step (required); }
    """
    names: Any = schemas.Schema(text).names()
    with (
        rtpm.events(names["Stepped"], hub=hub, node=node) as events,
        rtpm.supplier(names["Stepped"], hub=hub, node=node) as stepped,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")
        stepped.push_many([names["Step"](number, number) for number in range(3)])
        arrays = []
        while sum(map(len, arrays)) < 3:
            batch = next(events.batches(timeout=5))
            array = np.asarray(batch)
            assert array[0]["payload"]["number"] == batch[0].payload.number
            arrays.append(array)
        every = np.concatenate(arrays)
        assert every["payload"]["at"].tolist() == every["payload"]["number"].tolist() == [0, 1, 2]


def test_deliveries_are_thinned_out(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Touched, hub=hub, node=node, every_nth=3) as third,
        rtpm.events(Touched, hub=hub, node=node, deadbands=[(Touched, "z", 3)]) as coarse,
        rtpm.events(Touched, hub=hub, node=node, interval=0.2) as seldom,
        rtpm.supplier(Touched, hub=hub, node=node, priority=100) as touched,
    ):
        touched.push_many([touch(z) for z in range(7)])
        assert [third.next(5).value.z for _ in range(3)] == [0, 3, 6]
        assert [coarse.next(5).value.z for _ in range(3)] == [0, 3, 6]
        first, last = seldom.next(5), seldom.next(5)
        assert (first.value.z, last.value.z, last.priority) == (0, 6, 100)
        assert not third.losses and not coarse.losses and not seldom.losses


def test_the_latest_value_is_replayed(hub: str, node: rtpm.Node) -> None:
    with rtpm.supplier(Touched, hub=hub, node=node) as touched:
        with rtpm.events(Touched, hub=hub, node=node) as events:
            touched.push_many([touch(0), touch(1)])
            touched.push(touch(2), source=4)
            assert [events.next(5).value.z for _ in range(3)] == [0, 1, 2]
        with rtpm.events(Touched, hub=hub, node=node, replay=1) as events:
            late = [events.next(5) for _ in range(2)]
            assert {(event.source, event.value.z, event.is_replayed) for event in late} == {
                (0, 1, True),
                (4, 2, True),
            }


def test_fields_may_have_any_name(hub: str, node: rtpm.Node) -> None:
    text = """attribute "rtpm_event"; namespace lab;
    table Named (rtpm_event: 7004) { type_number:int; schema_id:int; name:string; }"""
    kind: Any = schemas.Schema(text).names()["Named"]
    with (
        rtpm.events(kind, hub=hub, node=node) as events,
        rtpm.supplier(kind, hub=hub, node=node) as named,
    ):
        named.push(kind(type_number=1, schema_id=2, name="n"))
        event = events.next(5)
        assert event.type is kind and event.value == kind(type_number=1, schema_id=2, name="n")


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(asyncio.wait_for(test(), 20))


def test_a_loop_takes_events_beside_its_other_tasks(hub: str, node: rtpm.Node) -> None:
    async def test() -> None:
        turns = 0

        async def work() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        other = asyncio.create_task(work())
        async with rtpm.events(Touched, hub=hub, node=node) as events:
            with rtpm.supplier(Touched, hub=hub, node=node) as touched:
                touched.push_many([touch(z) for z in range(1000)])
                received = []
                turns_before = turns
                async for event in events:
                    received.append(event.value.z)
                    if len(received) == 1000:
                        break
                assert received == list(range(1000)) and turns - turns_before >= 10
                before = turns
                asyncio.get_running_loop().call_later(0.05, touched.push, touch(7))
                async for event in events:
                    assert event.value.z == 7
                    break
                assert turns > before
        other.cancel()

    run(test)


def test_a_loop_takes_batches(hub: str, node: rtpm.Node) -> None:
    async def test() -> None:
        with (
            rtpm.events([Touched, rtpm.silence(0.01)], hub=hub, node=node) as events,
            rtpm.supplier(Touched, hub=hub, node=node) as touched,
        ):
            touched.push_many(np.ones((500, 3)))
            count = 0
            async for batch in events.batches(128, timeout=5):
                assert len(batch) <= 128 and (np.asarray(batch)["payload"]["z"] == 1).all()
                count += len(batch)
                if count == 500:
                    break
            with pytest.raises(rtpm.Timeout):
                async for batch in events.batches(128, timeout=0.1):
                    raise AssertionError(batch)

    run(test)


def test_a_cancelled_task_leaves_the_subscription_usable(hub: str, node: rtpm.Node) -> None:
    async def test() -> None:
        with (
            rtpm.events(Touched, hub=hub, node=node) as events,
            rtpm.supplier(Touched, hub=hub, node=node) as touched,
        ):
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(anext(events), 0.05)
            waiting = [asyncio.create_task(anext(events)) for _ in range(3)]
            await asyncio.sleep(0.01)
            waiting[0].cancel()
            await asyncio.sleep(0)
            touched.push_many([touch(1), touch(2), touch(3)])
            got = await asyncio.gather(*waiting, return_exceptions=True)
            assert isinstance(got[0], asyncio.CancelledError)
            assert sorted(event.value.z for event in got[1:]) == [1, 2]
            assert (await anext(events)).value.z == 3

    run(test)


@pytest.mark.parametrize("is_closed_by_thread", [False, True])
def test_closing_ends_an_asynchronous_iteration(
    hub: str, node: rtpm.Node, is_closed_by_thread: bool
) -> None:
    async def test() -> None:
        events = rtpm.events(Touched, hub=hub, node=node)

        async def read(iterator: Any) -> list[Any]:
            return [each async for each in iterator]

        readers = [asyncio.create_task(read(each)) for each in (events, events.batches(8))]
        await asyncio.sleep(0.01)
        if is_closed_by_thread:
            await asyncio.to_thread(events.close)
        else:
            events.close()
        assert await asyncio.gather(*readers) == [[], []]

    run(test)


def test_a_descriptor_is_readable_while_events_wait(hub: str, node: rtpm.Node) -> None:
    with (
        rtpm.events(Touched, hub=hub, node=node) as events,
        rtpm.supplier(Touched, hub=hub, node=node) as touched,
    ):
        assert select.select([events], [], [], 0)[0] == []
        touched.push(touch(1))
        assert select.select([events], [], [], 5)[0] == [events]
        events.next(0)
        assert select.select([events], [], [], 0)[0] == []


@pytest.mark.parametrize("read", [list, lambda events: list(events.batches(8))])
def test_closing_ends_the_iteration_of_another_thread(
    hub: str, node: rtpm.Node, read: Callable[[rtpm.Events], list[Any]]
) -> None:
    events = rtpm.events(Touched, hub=hub, node=node)
    results = []
    thread = threading.Thread(target=lambda: results.append(read(events)))
    thread.start()
    events.close()
    thread.join(5)
    assert results == [[]]
    with pytest.raises(rtpm.Error, match="closed"):
        events.next()


def test_a_restarted_hub_is_logged(
    laboratory: Laboratory, node: rtpm.Node, caplog: pytest.LogCaptureFixture
) -> None:
    started = Program("rtpm-eventd", "--port", "0", "--name", "", folder=laboratory.folder)
    with (
        rtpm.events(Touched, hub=started.url, node=node) as events,
        caplog.at_level(logging.WARNING, "rtpm"),
    ):
        started.end()
        end = time.monotonic() + 10
        while not caplog.text and time.monotonic() < end:
            with pytest.raises(TimeoutError):
                events.next(0.05)
    assert started.url in caplog.text


def test_the_device_of_an_event_is_named(node: rtpm.Node) -> None:
    with rtpm.events("type(rtpm.device.Sampled)", node=node) as events:
        event = events.next(5)
        assert event.device == "lab/arm0"
        assert event.value.position_m is not None
        batch = next(events.batches(10, timeout=5))
        assert batch[0].payload.sequence > 0


def test_wrong_arguments_are_named(hub: str, node: rtpm.Node) -> None:
    with pytest.raises(ValueError, match="no type is named 'lab.Tuched'"):
        rtpm.events("type(lab.Tuched)", hub=hub, node=node)
    with pytest.raises(TypeError, match="where takes the class of an event, not Force"):
        rtpm.events(Force, hub=hub, node=node)
    with pytest.raises(ValueError, match="policy takes"):
        rtpm.events(Touched, hub=hub, node=node, policy="none")
    with pytest.raises(ValueError, match="queue takes"):
        rtpm.events(Touched, hub=hub, node=node, queue=0)
    with rtpm.supplier(Touched, hub=hub, node=node) as touched:
        with pytest.raises(TypeError, match="Force"):
            touched.push(3)  # type: ignore[arg-type]
        with pytest.raises(TypeError, match="push_many"):
            touched.push_many([3])  # type: ignore[list-item]


def test_a_missing_hub_is_an_error(node: rtpm.Node) -> None:
    with pytest.raises(rtpm.Error, match="127.0.0.1:9"):
        rtpm.events(hub="rtpm://127.0.0.1:9/rtpm/events", node=node)


CODE = """
import os, signal, sys, rtpm
from rtpm import schemas
Touched = schemas.Schema({text!r}).names()["Touched"]
events = rtpm.events(Touched, hub={hub!r}, node=rtpm.Node("host"))
"""


@pytest.mark.parametrize(
    "code, expected",
    [
        ("pass", 0),
        ("child = os.fork()\nif child: sys.exit(os.waitpid(child, 0)[1])", 0),
        ("child = os.fork()\nif child: sys.exit(os.waitpid(child, 0)[1] >> 8)\nevents.next()", 1),
        (
            "signal.setitimer(signal.ITIMER_REAL, 0.1)\nsignal.signal(signal.SIGALRM, signal.default_int_handler)\nevents.next()",
            -signal.SIGINT,
        ),
    ],
)
def test_a_program_ends_with_an_open_subscription(hub: str, code: str, expected: int) -> None:
    program = CODE.format(text=TEXT, hub=hub) + code
    ended = subprocess.run(
        [sys.executable, "-c", program], timeout=30, capture_output=True, text=True, env=os.environ
    )
    assert ended.returncode == expected, ended.stderr


def test_a_thread_that_iterates_does_not_hold_up_the_exit(hub: str) -> None:
    code = (
        CODE.format(text=TEXT, hub=hub)
        + "import threading\nthreading.Thread(target=lambda: list(events)).start()"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=10).returncode == 0
