"""The matrix of languages in Python, see tests/interop/README.md."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import ctypes
import json
import math
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import interop_rtpm as lab
import rtpm

TEXT = "naïve 触覚 🖐"
FAILURE = "größer als 5"
PATIENCE_S = 5.0


# ---- the server ---------------------------------------------------------------------------------


class Interop(lab.InteropServant):
    """The servant of the matrix."""

    def __init__(self, node: rtpm.Node) -> None:
        self._node = node
        self._sum = 0
        self._note_count = 0
        self._stream_count = 0
        self._supplier: rtpm.Supplier[lab.Measured] | None = None

    def echo_numbers(self, request: lab.Numbers) -> lab.Numbers:
        return request

    def echo_values(self, request: lab.Values) -> lab.Values:
        return request

    def echo_bytes(self, request: lab.Bytes) -> lab.Bytes:
        return request

    def add(self, request: lab.Count) -> lab.Count:
        self._sum += request.count
        return lab.Count(count=self._sum)

    def refuse(self, request: lab.Refusal) -> None:
        kinds = {
            lab.Reason.bad_request: "BadRequest",
            lab.Reason.not_lease_holder: "NotLeaseHolder",
            lab.Reason.gone: "NoSuchObject",
            lab.Reason.servant_failed: "Failed",
        }
        raise rtpm.Refusal(request.text, kinds[request.reason])

    async def wait(self, request: lab.Pause) -> None:
        await asyncio.sleep(request.milliseconds / 1000)

    def hold(self, request: lab.Pause) -> lab.Pausing:
        time.sleep(request.milliseconds / 1000)
        return lab.Pausing(was_alone=True)

    def note_sent(self, request: lab.Note) -> None:
        self._note_count += 1

    def note_received(self, request: lab.Note) -> None:
        self._note_count += 1

    def note_done(self, request: lab.Note) -> None:
        self._note_count += 1

    def notes(self) -> lab.Notes:
        return lab.Notes(count=self._note_count)

    async def count_up(self, request: lab.Range) -> AsyncIterator[lab.Item]:
        self._stream_count += 1
        try:
            number = 0
            while request.count == 0 or number < request.count:
                yield lab.Item(number=number, padding=bytes(request.padding))
                number += 1
            if request.failure:
                raise rtpm.Refusal(request.failure, "Failed")
        finally:
            self._stream_count -= 1

    def streams(self) -> lab.Count:
        return lab.Count(count=self._stream_count)

    def priority(self) -> lab.Priority:
        call = rtpm.current_call()
        assert call is not None
        return lab.Priority(priority=call.priority)

    def emit(self, request: lab.Emission) -> None:
        if self._supplier is None:
            self._supplier = rtpm.supplier(lab.Measured, node=self._node)
        for level in range(request.first, request.first + request.count):
            self._supplier.push(lab.Measured(level=level, text=request.text))


class Other(lab.OtherServant):
    """The servant with the other interface."""

    def nothing(self) -> None:
        pass


def serve(options: argparse.Namespace) -> int:
    """Serves until the input ends."""
    node = rtpm.Node(options.registry)
    servant = Interop(node)
    objects = {"interop": servant, "interop/other": Other()}
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(rtpm.serve(objects, node=node, named=False))
        if options.name:
            stack.enter_context(rtpm.serve({options.name: servant}, node=node))
        url = server.url("interop")
        print(json.dumps({"udp": url, "tcp": url}), flush=True)
        sys.stdin.read()
    return 0


# ---- the checks ---------------------------------------------------------------------------------


class Apart(Exception):
    """Ends a case without a verdict on the server."""

    def __init__(self, result: str, why: str) -> None:
        super().__init__(why)
        self.result = result


def require(holds: bool, fault: str) -> None:
    if not holds:
        raise AssertionError(fault)


def require_error(
    kinds: type[rtpm.CallError] | tuple[type[rtpm.CallError], ...], call: Callable[[], object]
) -> rtpm.CallError:
    try:
        call()
    except kinds as error:
        return error
    raise AssertionError("a call succeeded that must not")


def wait_until(holds: Callable[[], bool], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True


def are_same(one: float, other: float) -> bool:
    if math.isnan(one):
        return math.isnan(other)
    return one == other and math.copysign(1, one) == math.copysign(1, other)


def numbers_of(*, is_highest: bool, real: float) -> lab.Numbers:
    limit = 3.4028234663852886e38
    single = math.copysign(limit, real) if abs(real) == sys.float_info.max else real
    single = ctypes.c_float(single).value
    bits = {8: "8", 16: "16", 32: "32", 64: "64"}
    integers = {}
    for width, name in bits.items():
        integers["i" + name] = 2 ** (width - 1) - 1 if is_highest else -(2 ** (width - 1))
        integers["u" + name] = 2**width - 1 if is_highest else 0
    return lab.Numbers(
        **integers,
        f32=single,
        f64=real,
        flag=is_highest,
        color=lab.Color.Blue if is_highest else lab.Color.Red,
        at=lab.Vector(real, 1.0, -real),
        three=[0, 513, 65535],
    )


def full_values() -> lab.Values:
    return lab.Values(
        text=TEXT,
        texts=["", TEXT, "last"],
        reals=[0.1 * i for i in range(100)],
        bytes=bytes([0, 1, 127, 128, 255]),
        longs=[0, 1, 2**64 - 1],
        vectors=[lab.Vector(1, 2, 3), lab.Vector(-1, -2, -3)],
        leaves=[lab.Leaf(name="bare"), lab.Leaf(name="weighed", weight=0.5)],
        colors=[lab.Color.Blue, lab.Color.Red, lab.Color.Green],
        color=lab.Color.Blue,
        level=2**31 - 1,
        maybe=0,
        newton=-20,
    )


class Checks:
    """The cases, in order."""

    def __init__(self, options: argparse.Namespace, keys: dict[str, str]) -> None:
        self.options = options
        self.keys = keys
        self.node = self.new_node()
        self.client = self.bind(options.url)

    def new_node(self) -> rtpm.Node:
        return rtpm.Node(self.options.registry, transport=self.options.transport, **self.keys)

    def bind(self, target: str) -> lab.InteropClient:
        return lab.InteropClient(target, node=self.node, deadline=PATIENCE_S)

    def beside(self, path: str) -> str:
        return str(self.options.url)[: -len("interop")] + path

    def add(self, count: int) -> int:
        return self.client.add(lab.Count(count=count), deadline=PATIENCE_S).count

    def numbers(self) -> None:
        largest = sys.float_info.max
        reals = (largest, -largest, 0.0, -0.0, math.pi, 5e-324, math.inf, -math.inf, math.nan)
        for real in reals:
            for is_highest in (False, True):
                sent = numbers_of(is_highest=is_highest, real=real)
                got = self.client.echo_numbers(sent)
                for name in ("i8", "u8", "i16", "u16", "i32", "u32", "i64", "u64", "flag", "color"):
                    require(getattr(got, name) == getattr(sent, name), f"{name} has changed")
                require(list(got.three) == [0, 513, 65535], "an array has changed")
                for a, b in (
                    (got.f32, sent.f32),
                    (got.f64, real),
                    (got.at.x, real),
                    (got.at.z, -real),
                ):
                    require(are_same(a, b), f"{b} came back as {a}")

    def echo(self, sent: lab.Values) -> lab.Values:
        got = self.client.echo_values(sent)
        require(got == sent, f"{sent} came back as {got}")
        return got

    def values(self) -> None:
        full = full_values()
        full.shape = lab.Leaf(name="leaf")
        self.echo(full)
        full.shape = lab.Vector(1, 2, 3)
        full.maybe = 2**64 - 1
        self.echo(full)
        bare = self.echo(lab.Values(text=""))
        require(
            (bare.color, bare.level, bare.maybe) == (lab.Color.Green, -3, None), "a wrong default"
        )
        require(bare.shape is None and not bare.absent, "an absent value is there")

    def range(self) -> None:
        self.echo(lab.Values(text="", newton=20))
        require_error(
            rtpm.BadRequest, lambda: self.client.echo_values(lab.Values(text="", newton=20.5))
        )

    def large(self) -> None:
        for size in (0, 1, 1400, 1048576):
            sent = (bytes(range(256)) * (size // 256 + 1))[:size]
            got = self.client.echo_bytes(lab.Bytes(bytes=sent)).bytes
            require(bytes(got) == sent, f"{size} bytes have changed")

    def too_large(self) -> None:
        require_error(
            rtpm.TooLarge, lambda: self.client.echo_bytes(lab.Bytes(bytes=bytes(1100001)))
        )
        self.add(0)

    def refusals(self) -> None:
        reasons: tuple[tuple[lab.Reason, type[rtpm.CallError], bool, bool], ...] = (
            (lab.Reason.bad_request, rtpm.BadRequest, True, False),
            (lab.Reason.not_lease_holder, rtpm.NotLeaseHolder, False, False),
            (lab.Reason.gone, rtpm.NoSuchObject, False, False),
            (lab.Reason.servant_failed, rtpm.ServantFailed, True, True),
        )
        for reason, kind, has_text, was_run in reasons:
            request = lab.Refusal(reason=reason, text=FAILURE)
            error = require_error(kind, lambda request=request: self.client.refuse(request))
            require(not has_text or FAILURE in str(error), f"{reason.name} has lost its text")
            require(error.was_run is was_run, f"{reason.name}: was_run is {error.was_run}")

    def no_such_object(self) -> None:
        with contextlib.suppress(rtpm.NoSuchObject):
            self.bind(self.beside("interop/nothing"))
            raise AssertionError("interop/nothing was bound")

    def wrong_interface(self) -> None:
        with contextlib.suppress(rtpm.WrongInterface):
            self.bind(self.beside("interop/other"))
            raise AssertionError("interop/other was bound as Interop")

    def deadline(self) -> None:
        begun = time.monotonic()
        require_error(
            (rtpm.Timeout, rtpm.Expired, rtpm.Cancelled),
            lambda: self.client.wait(lab.Pause(milliseconds=500), deadline=0.1),
        )
        took = time.monotonic() - begun
        require(0.05 <= took <= 0.45, f"it took {took} s")
        self.add(0)

    def cancel(self) -> None:
        pause_ms = 300 if self.options.lossy else 3000

        async def begin_and_cancel() -> float:
            client = await rtpm.bind(lab.InteropAsyncClient, self.options.url, node=self.node)
            task = asyncio.ensure_future(client.wait(lab.Pause(milliseconds=pause_ms), deadline=5))
            await asyncio.sleep(0.05)
            begun = time.monotonic()
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
                raise AssertionError("a cancelled call succeeded")
            return time.monotonic() - begun

        took = asyncio.run(begin_and_cancel())
        require(took <= 0.5, f"it took {took} s")
        if self.options.lossy:
            time.sleep(0.3)  # A CANCEL that is lost leaves the call its place.
        self.add(0)

    def expired(self) -> None:
        if self.options.lossy:
            raise Apart("skipped", "add may come before hold")
        before = self.add(0)
        held: list[lab.Pausing] = []
        holding = threading.Thread(
            target=lambda: held.append(self.client.hold(lab.Pause(milliseconds=400)))
        )
        holding.start()
        time.sleep(0.05)
        require_error(
            (rtpm.Timeout, rtpm.Expired), lambda: self.client.add(lab.Count(count=1), deadline=0.1)
        )
        holding.join()
        if not held[0].was_alone:
            raise Apart("not_offered", "the server runs several calls of a priority at once")
        require(self.add(0) == before, "an expired call ran")

    def at_most_once(self) -> None:
        before = self.add(0)
        for i in range(1, 101):
            require(self.add(1) == before + i, f"call {i} ran not once")

    def concurrent(self) -> None:
        requests = [lab.Values(text=f"call {i}") for i in range(32)]
        replies = rtpm.many(self.client.echo_values, requests, deadline=PATIENCE_S)
        require(
            [reply.text for reply in replies] == [each.text for each in requests],
            "replies are mixed up",
        )

    def oneways(self) -> None:
        before = self.client.notes().count
        for i in range(10):
            self.client.note_sent(lab.Note(number=i))
            self.client.note_received(lab.Note(number=i))
            self.client.note_done(lab.Note(number=i))
        wanted = 20 if self.options.lossy else 30
        is_noted = wait_until(lambda: self.client.notes().count - before >= wanted, 2)
        count = self.client.notes().count - before
        require(is_noted, f"only {count} were noted")
        require(count <= 30, f"{count} were noted")

    def priority(self) -> None:
        for called in (0, 50):
            seen = self.client.priority(priority=called).priority
            require(seen == called, f"a call at {called} is seen at {seen}")

    def stream(self) -> None:
        with self.client.count_up(lab.Range(count=2000)) as items:
            require(
                [item.number for item in items] == list(range(2000)),
                "items are missing or mixed up",
            )

    def slow_reader(self) -> None:
        with self.client.count_up(lab.Range(count=3000, padding=1000)) as items:
            count = 0
            for item in items:
                require(
                    item.number == count and len(item.padding) == 1000,
                    f"item {item.number} came as {count}",
                )
                count += 1
                if count <= 5:
                    time.sleep(0.1)
        require(count == 3000, f"the stream ended behind {count} items")

    def stream_cancel(self) -> None:
        with self.client.count_up(lab.Range()) as items:
            require([next(items).number for _ in range(6)] == list(range(6)), "items are mixed up")
        is_over = wait_until(
            lambda: self.client.streams().count == 0, 0 if self.options.lossy else 2
        )
        # A cancellation that is lost has no effect but later.
        require(is_over or self.options.lossy, "the server goes on")

    def stream_failure(self) -> None:
        with self.client.count_up(lab.Range(count=3, failure=FAILURE)) as items:
            require([next(items).number for _ in range(3)] == [0, 1, 2], "items are mixed up")
            require_error(rtpm.ServantFailed, lambda: next(items))

    def events(self) -> None:
        if not self.options.registry:
            raise Apart("skipped", "no --registry")
        text = str(random.getrandbits(60))
        levels: list[int] = []
        where = rtpm.Filter("type(rtpm.interop.Measured) and level >= 5", (lab.Measured,))
        with rtpm.events(where, node=self.node) as events:
            self.client.emit(lab.Emission(first=0, count=10, text=text), deadline=PATIENCE_S)
            end = time.monotonic() + PATIENCE_S
            while len(levels) < 5 and time.monotonic() < end:
                with contextlib.suppress(TimeoutError):
                    event = events.next(0.2)
                    if event.value.text == text:
                        levels.append(event.value.level)
            with contextlib.suppress(TimeoutError):
                event = events.next(0.02)
                if event.value.text == text:
                    levels.append(event.value.level)
        require(levels == [5, 6, 7, 8, 9], f"the levels {levels} came")

    def name(self) -> None:
        if not self.options.name:
            raise Apart("skipped", "no --name")
        self.bind(self.options.name).add(lab.Count())
        own = f"matrix/{random.getrandbits(60)}"
        # A name of Python leads to an object of this program, not elsewhere, and has a lease of 2 s.
        with rtpm.serve({own: Other()}, node=self.node) as server:
            time.sleep(2.5)
            require(self.node.url_of(own) == server.url(own), "the name leads elsewhere")
        with contextlib.suppress(rtpm.NameNotFound):
            raise AssertionError(f"an unbound name is found at {self.node.url_of(own)}")

    def device(self) -> None:
        if not self.options.device:
            raise Apart("skipped", "no --device")
        own = rtpm.Device(self.options.device, node=self.node)
        other = rtpm.Device(self.options.device, node=self.new_node())
        with own.command(hold=0.1) as tip:
            with contextlib.suppress(rtpm.LeaseHeld), other.command(patience=0):
                raise AssertionError("two hold the lease")
            tip.force = (0, 0, 1)
            require(
                wait_until(lambda: own.read().force_newton.z != 0, 0.1), "no sample shows the force"
            )
        with other.command():
            pass


CASES = (
    "numbers", "values", "range", "large", "too_large", "refusals", "no_such_object",
    "wrong_interface", "deadline", "cancel", "expired", "at_most_once", "concurrent", "oneways",
    "priority", "stream", "slow_reader", "stream_cancel", "stream_failure", "events", "name", "device",
)  # fmt: skip


def check(options: argparse.Namespace) -> int:
    """Runs the cases. Returns whether one failed."""
    with tempfile.TemporaryDirectory() as folder:
        keys = {}
        if options.key:
            known = Path(folder, "known_servers")
            known.write_text(f"127.0.0.1 {options.server_key}\n")
            keys = {"key_file": options.key, "known_servers_file": str(known)}
        checks = Checks(options, keys)
        results = [run(checks, case) for case in CASES]
    return int("fail" in results)


def run(checks: Checks, case: str) -> str:
    result, detail = "pass", ""
    try:
        getattr(checks, case)()
    except Apart as apart:
        result, detail = apart.result, str(apart)
    except Exception as fault:
        result, detail = "fail", f"{type(fault).__name__}: {fault}"
    print(json.dumps({"case": case, "result": result, "detail": detail}), flush=True)
    return result


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    for verb in ("serve", "check"):
        options = verbs.add_parser(verb)
        for name in ("registry", "name", "key"):
            options.add_argument("--" + name)
    verbs.choices["serve"].add_argument("--admit")
    options = verbs.choices["check"]
    options.add_argument("url")
    options.add_argument("--transport", choices=("udp", "tcp"), required=True)
    options.add_argument("--device")
    options.add_argument("--server-key")
    options.add_argument("--lossy", action="store_true")
    given = parser.parse_args()
    return serve(given) if given.verb == "serve" else check(given)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code) if code else sys.exit(code)
