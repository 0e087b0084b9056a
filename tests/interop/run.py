#!/usr/bin/env python3
"""Runs the matrix of languages: every client with the servers of some languages. See README.md here.

Prints a line for each pair, and for each case that did not pass. Exit: 0 all passed, 1 one failed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

LANGUAGES = ("cpp", "python", "java", "typescript")
#: For a program of one case after the other, of which each ends in 20 s.
PATIENCE_S = 120
#: Languages whose servers have no sealed sessions; their READMEs say so.
UNSEALED_SERVERS = ("python",)


class Program:
    """A running program, ended with its input."""

    def __init__(self, command: list[str], environment: dict[str, str], pattern: str) -> None:
        self.command = command
        self.errors = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            text=True,
            env=environment,
        )
        assert self.process.stdout is not None
        for line in self.process.stdout:
            found = re.search(pattern, line)
            if found:
                #: What the pattern found, and its line.
                self.found, self.line = found.group(), line
                return
        raise RuntimeError(f"{shlex.join(command)} ended before it served: {self.error_text()}")

    def error_text(self) -> str:
        self.errors.seek(0)
        return self.errors.read().decode(errors="replace")[-2000:]

    def end(self) -> int:
        """Ends it. Returns its exit code."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            return self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return -1

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


class Matrix:
    """The languages' programs in a laboratory of its own: registry, hub, simulated arm."""

    def __init__(self, programs: Path, commands: dict[str, list[str]], folder: Path) -> None:
        self.programs = programs
        self.commands = commands
        self.folder = folder
        self.environment = os.environ | {
            "RTPM_RUNTIME_FOLDER": str(folder),
            "RTPM_KEYS": str(folder / "no-keys"),
            "XDG_STATE_HOME": str(folder),
        }
        self.running: list[Program] = []
        self.results: list[dict[str, str]] = []
        registry = self.start_program("rtpm-registryd", "--port", "0", "--realtime", "off")
        self.registry = registry.found
        self.start_program(
            *("rtpm-deviced", "--port", "0", "--realtime", "off"),
            *("--registry", self.registry, "--serve-events"),
        )

    def start(self, command: list[str], pattern: str) -> Program:
        self.running.append(Program(command, self.environment, pattern))
        return self.running[-1]

    def start_program(self, name: str, *arguments: str) -> Program:
        return self.start([str(self.programs / name), *arguments], r"rtpm://\S+")

    def end(self) -> None:
        for program in self.running:
            program.kill()

    def check_server(self, server: str) -> None:
        """Runs all clients with a server of this language."""
        name = f"interop/{server}"
        options = ("--registry", self.registry, "--name", name)
        served = self.start([*self.commands[server], "serve", *options], r"\{.*udp.*\}")
        urls = json.loads(served.line)
        port = re.search(r":(\d+)/", urls["udp"])
        assert port is not None
        relay = self.start([str(self.programs / "interop_relay"), port.group(1)], r"\d+")
        relayed = urls["udp"].replace(port.group(), f":{relay.found}/")
        for client in self.commands:
            self.check(client, server, "udp", urls["udp"], "--transport", "udp")
            self.check(client, server, "loss", relayed, "--transport", "udp", "--lossy")
            self.check(
                *(client, server, "tcp", urls["tcp"], "--transport", "tcp"),
                *(*options, "--device", "lab/arm0"),
            )
        self.expect_described(server, urls["udp"])
        if served.end() != 0:
            self.note("", server, "end", "end", "fail", served.error_text())
        relay.end()
        if server in UNSEALED_SERVERS:
            return
        own, own_public = self.new_key("server")
        key, public = self.new_key("client")
        sealed = self.start(
            [*self.commands[server], "serve", "--key", own, "--admit", public], r"\{.*udp.*\}"
        )
        urls = json.loads(sealed.line)
        for client in self.commands:
            for transport in ("udp", "tcp"):
                self.check(
                    *(client, server, f"sealed {transport}", urls[transport]),
                    *("--transport", transport, "--key", key, "--server-key", own_public),
                )
        sealed.end()

    def new_key(self, name: str) -> tuple[str, str]:
        """Makes a key. Returns its file and its public line."""
        folder = self.folder / f"key-{name}-{len(self.results)}"
        made = subprocess.run(
            [str(self.programs / "rtpm"), "key", "new"],
            env=self.environment | {"RTPM_KEYS": str(folder)},
            capture_output=True,
            text=True,
            check=True,
        )
        public = re.search(r"rtpm25519 \S+", made.stdout + made.stderr)
        assert public is not None, made
        return str(folder / "key"), public.group()

    def check(self, client: str, server: str, way: str, url: str, *options: str) -> None:
        """Runs a client's checks and notes their results."""
        begun = time.monotonic()
        command = [*self.commands[client], "check", url, *options]
        try:
            ended = subprocess.run(
                *(command,),
                env=self.environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
                check=False,
            )
        except subprocess.TimeoutExpired as late:
            self.note(
                client, server, way, "all", "fail", f"not done in {PATIENCE_S} s: {late.stdout!r}"
            )
            return
        count = {"pass": 0, "fail": 0, "not_offered": 0, "skipped": 0}
        for line in ended.stdout.splitlines():
            case = json.loads(line)
            count[case["result"]] += 1
            self.note(client, server, way, case["case"], case["result"], case.get("detail", ""))
        if sum(count.values()) == 0 or (ended.returncode != 0) != (count["fail"] > 0):
            count["fail"] += 1
            self.note(
                client, server, way, "end", "fail", f"exit code {ended.returncode}, {ended.stderr}"
            )
        took_s = time.monotonic() - begun
        print(
            f"{client:>10} -> {server:<10} {way:<10} {count['pass']:2} passed, {count['fail']} failed,"
            f" {count['not_offered']} not offered, {count['skipped']} skipped in {took_s:.1f} s",
            flush=True,
        )

    def expect_described(self, server: str, url: str) -> None:
        """The tool lists the server's objects and calls one by its published schema."""
        for arguments, wanted in (
            (("info", url), "rtpm.interop.Interop"),
            (("call", url, "add", '{"count": 0}'), "count"),
        ):
            ended = subprocess.run(
                [str(self.programs / "rtpm"), *arguments, "--deadline", "5s"],
                env=self.environment,
                capture_output=True,
                text=True,
                check=False,
            )
            is_good = ended.returncode == 0 and wanted in ended.stdout
            self.note(
                *("cpp", server, "tool", arguments[0]),
                *("pass" if is_good else "fail", "" if is_good else ended.stdout + ended.stderr),
            )

    def note(self, client: str, server: str, way: str, case: str, result: str, detail: str) -> None:
        names = ("client", "server", "way", "case", "result", "detail")
        self.results.append(
            dict(zip(names, (client, server, way, case, result, detail), strict=True))
        )
        if result == "fail":
            print(f"FAILED {client} -> {server} {way}, {case}: {detail}", flush=True)


def is_built(command: list[str]) -> bool:
    """Whether the command is one, and its files are there."""
    paths = [path for word in command for path in word.split(":") if path.startswith("/")]
    return bool(command) and all(Path(path).exists() for path in paths)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--programs", type=Path, required=True, help="where RTPM's programs are")
    parser.add_argument("--server", choices=LANGUAGES, action="append", help="all if left out")
    parser.add_argument("--client", choices=LANGUAGES, action="append", help="all if left out")
    parser.add_argument("--results", type=Path, help="a file for a line of JSON per case")
    for language in LANGUAGES:
        parser.add_argument(f"--{language}", default="", help="its program's command; empty: none")
    options = parser.parse_args()
    commands = {each: shlex.split(getattr(options, each)) for each in LANGUAGES}
    missing = [each for each in LANGUAGES if not is_built(commands[each])]
    commands = {each: commands[each] for each in LANGUAGES if each not in missing}
    required = set(os.environ.get("RTPM_LANGUAGES", "").split(",")) & set(missing)
    servers = [each for each in options.server or LANGUAGES if each in commands]
    if options.client:
        commands = {each: commands[each] for each in {*options.client, *servers}}
    with tempfile.TemporaryDirectory(prefix="rtpm-interop-") as folder:
        matrix = Matrix(options.programs, commands, Path(folder))
        try:
            for server in servers:
                matrix.check_server(server)
        finally:
            matrix.end()
    if options.results:
        lines = (json.dumps(result, ensure_ascii=False) + "\n" for result in matrix.results)
        options.results.write_text("".join(lines))
    if required or any(result["result"] == "fail" for result in matrix.results):
        if required:
            print(
                f"FAILED: no program in {', '.join(sorted(required))}, which RTPM_LANGUAGES asks for"
            )
        return 1
    if missing:
        print(f"[  SKIPPED ] no program in {', '.join(missing)}: ./dev test installs what it needs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
