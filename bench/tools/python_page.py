"""Measures the Python package beside C++, by turns, and writes a page: python_page.py OPTIONS

`--python` is a Python with the package, `--path` a folder with bench.fbs as `rtpmc --emit python` made
it, `--bench` the program rtpm-bench, `--programs` the folder of the daemons, `--page` the file.
"""

import argparse
import contextlib
import datetime
import json
import os
import re
import statistics
import subprocess
import sys

import page

SIDE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "python_side.py")
ROUNDS = 3


class Laboratory:
    """The programs of one measurement; all end with it."""

    def __init__(self, options):
        self._options = options
        self._ended = contextlib.ExitStack()
        self._environment = os.environ | {"PYTHONPATH": options.path, "RTPM_KEYS": "/nonexistent"}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._ended.close()

    def start(self, *command):
        """@return the URL that the program prints."""
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                   env=self._environment)
        self._ended.callback(process.wait)
        self._ended.callback(process.terminate)
        found, text = None, ""
        while found is None:
            more = os.read(process.stdout.fileno(), 4096).decode()
            if not more:
                raise SystemExit(f"python_page: {command[0]} ended before it served")
            text += more
            found = re.search(r"(rtpm://\S+|ready)\s?", text)
        return found[1], process

    def side(self, what, *arguments):
        """The command of one measurement in Python."""
        return self._options.python, SIDE, what, *arguments

    def measure(self, what, *arguments):
        """The result of one measurement in Python."""
        return json.loads(self.run(*self.side(what, *arguments)))

    def cpp(self, transport):
        """The same calls in C++."""
        printed = self.run(self._options.bench, "run", "call", "--transport", transport, "--realtime",
                           "off", "--samples", "20000", "--rounds", "1", "--json")
        return json.loads(printed.splitlines()[0])

    def run(self, *command):
        """@return what the command printed."""
        return subprocess.run(command, env=self._environment, check=True, stdout=subprocess.PIPE,
                              text=True).stdout


def measure_calls(options):
    """@return {(transport, kind): [figures of each round]}"""
    found = {}
    for _ in range(ROUNDS):
        for transport in ("shm", "udp", "tcp"):
            with Laboratory(options) as laboratory:
                found.setdefault((transport, "C++"), []).append(laboratory.cpp(transport))
                url, _ = laboratory.start(options.bench, "serve", "rtpm", "--realtime", "off",
                                          "--transport", transport)
                way = ("--url", url, "--transport", transport)
                for kind, what, more in (
                        ("Python", "call", ()), ("await", "await", ()),
                        ("Python, another thread computes", "call", ("--samples", "1000", "--computing"))):
                    found.setdefault((transport, kind), []).append(
                        laboratory.measure(what, *way, *more))
                url, _ = laboratory.start(*laboratory.side("serve"))
                found.setdefault((transport, "Python to a Python servant"), []).append(
                    laboratory.measure("call", "--url", url, "--transport", transport))
            print(f"measured calls over {transport}", file=sys.stderr, flush=True)
    return found


def measure_events(options):
    """@return {kind: [figures of each round]}"""
    found = {}
    for _ in range(ROUNDS):
        for kind, more in (("batches", ("--batches",)), ("one by one", ())):
            with Laboratory(options) as laboratory:
                url, _ = laboratory.start(os.path.join(options.programs, "rtpm-eventd"), "--port", "0",
                                          "--name", "")
                _, taker = laboratory.start(*laboratory.side("events", "--url", url, *more))
                laboratory.run(*laboratory.side("push", "--url", url, "--samples", "500000"))
                found.setdefault(kind, []).append(json.loads(taker.stdout.read()))
    return found


def measure_servo(options):
    """@return {kind: [figures of each round]}"""
    found = {}
    for _ in range(ROUNDS):
        for kind, more in (("alone", ()), ("another thread computes", ("--computing",))):
            with Laboratory(options) as laboratory:
                url, _ = laboratory.start(os.path.join(options.programs, "rtpm-deviced"), "--port", "0")
                device = re.match(r"rtpm://[^/]+", url)[0] + "/lab/arm0"
                found.setdefault(kind, []).append(
                    laboratory.measure("servo", "--url", device, "--samples", "10000", *more))
    return found


def median(rounds, name):
    return statistics.median(each[name] for each in rounds)


def ratio(rounds, base, name):
    """The ratio of paired rounds: its median and its ends."""
    ratios = sorted(one[name] / other[name] for one, other in zip(rounds, base))
    return f"{page.number(statistics.median(ratios))} ({page.number(ratios[0])}–{page.number(ratios[-1])})"


def write(options, calls, events, servo):
    lines = ["# The Python package, measured", "",
             f"Beside C++ by turns on the same CPUs, {ROUNDS} rounds; medians, and the lowest and highest "
             "ratio of", "a round. Times in µs belong to this machine; quote the ratios. All "
             f"time-shared. {datetime.date.today().isoformat()}.", "",
             "## Calls", "", "48 bytes there and back, one call after the other; the server is C++ "
             "unless stated.", "A thread that computes gives the interpreter's lock away every 5 ms: "
             "`sys.setswitchinterval()`.", "",
             "| transport, caller | p50 | p99 | × C++ p50 | × C++ p99 |", "|---|---:|---:|---:|---:|"]
    for (transport, kind), rounds in calls.items():
        base = calls[transport, "C++"]
        lines.append(f"| {transport}, {kind} | " + " | ".join((
            page.number(median(rounds, "p50_us")), page.number(median(rounds, "p99_us")),
            ratio(rounds, base, "p50_us"), ratio(rounds, base, "p99_us"))) + " |")
    lines += ["", "## Events", "", "32 bytes pushed by another Python program as quickly as it can, through a hub.", "",
              "| taken | events/s | lost |", "|---|---:|---:|"]
    for kind, rounds in events.items():
        lost = sum(each["lost"] for each in rounds) / sum(each["lost"] + each["taken"] for each in rounds)
        lines.append(f"| {kind} | {page.number(median(rounds, 'events_per_s'))} | {100 * lost:.1f} % |")
    lines += ["", "## A native servo", "", "`tip.render()` at 1 kHz for 10 s, alone and beside "
              "a Python thread that computes all the time.", "",
              "| beside it | cycles | late | worst, ms |", "|---|---:|---:|---:|"]
    for kind, rounds in servo.items():
        late = ", ".join(str(each["late"]) for each in rounds)
        lines.append(f"| {kind} | {median(rounds, 'cycles'):.0f} | {late} | "
                     f"{page.number(1000 * median(rounds, 'worst_s'))} |")
    with open(options.page, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser()
    for name in ("python", "path", "bench", "programs", "page"):
        parser.add_argument(f"--{name}", required=True)
    options = parser.parse_args()
    write(options, measure_calls(options), measure_events(options), measure_servo(options))


if __name__ == "__main__":
    main()
