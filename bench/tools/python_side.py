"""One measurement of the Python package, in the Python that has it: python_side.py WHAT [OPTIONS]

Prints one JSON object. WHAT: call, await, serve, push, events, servo. `bench.fbs` was compiled by
`rtpmc --emit python` into a folder of PYTHONPATH.
"""

import argparse
import asyncio
import json
import os
import threading
import time

import bench_rtpm
import rtpm
from rtpm.idl.device_events_rtpm import ButtonChange, ButtonChanged

CLIENT_CPU, SERVER_CPU = 0, 1


def compute(ended):
    """Keeps the interpreter's lock as a program's own work does."""
    number = 0
    while not ended.is_set():
        number = (number * 3 + 1) % 1_000_003


class Beside:
    """Another Python thread that computes, if `is_wanted`, while the block runs."""

    def __init__(self, is_wanted):
        self._ended = threading.Event()
        self._thread = threading.Thread(target=compute, args=(self._ended,)) if is_wanted else None

    def __enter__(self):
        if self._thread:
            self._thread.start()

    def __exit__(self, *_):
        self._ended.set()
        if self._thread:
            self._thread.join()


def figures(times_ns):
    """Percentiles in microseconds."""
    ordered = sorted(times_ns)
    last = len(ordered) - 1
    return {name: ordered[round(last * share)] / 1000
            for name, share in (("p50_us", 0.5), ("p99_us", 0.99), ("p999_us", 0.999))}


def call(options):
    """Calls one after the other, of 48 bytes each way."""
    node = rtpm.Node(transport=options.transport)
    wrench = bench_rtpm.Wrench(1, 2, 3, 4, 5, 6)
    times = []
    with bench_rtpm.EchoClient(options.url, node=node) as echo, Beside(options.computing):
        for number in range(options.samples + options.samples // 10):
            begin = time.perf_counter_ns()
            echo.echo(wrench)
            if number >= options.samples // 10:
                times.append(time.perf_counter_ns() - begin)
    return figures(times)


def await_(options):
    """The same by asyncio."""
    async def run():
        node = rtpm.Node(transport=options.transport)
        wrench = bench_rtpm.Wrench(1, 2, 3, 4, 5, 6)
        times = []
        async with bench_rtpm.EchoAsyncClient(options.url, node=node) as echo:
            for number in range(options.samples + options.samples // 10):
                begin = time.perf_counter_ns()
                await echo.echo(wrench)
                if number >= options.samples // 10:
                    times.append(time.perf_counter_ns() - begin)
        return figures(times)

    with Beside(options.computing):
        return asyncio.run(run())


def serve(options):
    """Serves the schema's Echo, until standard input ends."""
    class Echo(bench_rtpm.EchoServant):
        def echo(self, request):
            return request

        def work(self, request):
            raise rtpm.Refusal("it is not measured")

        def echo_large(self, request):
            return request

        def nothing(self):
            pass

    del options
    with rtpm.serve({"bench/echo": Echo()}) as server:
        print(server.url("bench/echo"), flush=True)
        os.read(0, 1)


def push(options):
    """Pushes events as quickly as the hub takes them, in portions of 512."""
    samples = [ButtonChange(button=1, is_pressed=True)] * 512
    with rtpm.supplier(ButtonChanged, hub=options.url) as supplier:
        for _ in range(options.samples // len(samples)):
            supplier.push_many(samples)


def events(options):
    """Events that come as quickly as another program pushes them, taken in batches or one by one."""
    taken = 0
    with rtpm.events(ButtonChanged, hub=options.url, queue=65536) as received:
        print("ready", flush=True)
        items = received.batches(1024, 2) if options.batches else iter(lambda: received.next(2), 0)
        try:
            for item in items:
                begin = begin if taken else time.perf_counter()
                taken += len(item) if options.batches else 1
                end = time.perf_counter()
        except rtpm.Timeout:  # All has come.
            pass
        return {"events_per_s": taken / (end - begin), "taken": taken, "lost": received.losses.total}


def servo(options):
    """A native servo at 1 kHz, which renders a wall."""
    with rtpm.device(options.url) as arm, arm.command() as tip, Beside(options.computing):
        running = tip.render(rtpm.Plane(normal=(0, 0, 1), stiffness_newton_per_m=300.0))
        time.sleep(options.samples / 1000)
        found = running.figures
    return {key: found[key] for key in ("cycles", "late", "worst_s")}


def main():
    parser = argparse.ArgumentParser()
    kinds = {"call": call, "await": await_, "serve": serve, "events": events, "push": push, "servo": servo}
    parser.add_argument("what", choices=kinds)
    parser.add_argument("--url", default="")
    parser.add_argument("--transport", default="udp")
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--batches", action="store_true")
    parser.add_argument("--computing", action="store_true")
    options = parser.parse_args()
    if options.what != "servo":
        os.sched_setaffinity(0, {SERVER_CPU if options.what == "serve" else CLIENT_CPU})
    result = kinds[options.what](options)
    if result is not None:
        print(json.dumps(result))


if __name__ == "__main__":
    main()
