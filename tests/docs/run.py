#!/usr/bin/env python3
"""Runs the code blocks of a page in their order, beside simulated devices, on two machines.

The machines are network namespaces, with a link between them: the laboratory's at 192.168.7.4, and a
desk at 192.168.7.2, each with folders of its own. `blocks.py` has the kinds of blocks.

    run.py PAGE.md FOLDER --programs FOLDER --package FOLDER
"""

from __future__ import annotations

import argparse
import ctypes
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from blocks import Block, blocks_of

TREE = Path(__file__).resolve().parents[2]
BLOCK_SECONDS = 60.0
PAGE_SECONDS = 240.0
PR_SET_CHILD_SUBREAPER = 36
SKIPPED = "[  SKIPPED ] needs"
OTHER = {"lab": "desk", "desk": "lab"}


class Broken(Exception):
    """A block that does not do what its page says."""


class Machine:
    """Folders, and the environment of programs that run there."""

    def __init__(self, name: str, folder: Path, options: argparse.Namespace) -> None:
        self.folder = folder / name
        self.prefix: list[str] = []
        shutil.rmtree(self.folder, ignore_errors=True)
        programs = self.folder / ".programs"
        for each in (programs, self.folder / ".run", self.folder / ".keys"):
            each.mkdir(parents=True, mode=0o700)
        for program, text in (
            ("python3", f'exec "{sys.executable}" "$@"'),
            # `scp FILE… MACHINE:` copies between the folders of the two machines.
            (
                "scp",
                f'for file; do case $file in *:) ;; *) cp "$file" "{folder / OTHER[name]}" ;; esac; done',
            ),
        ):
            (programs / program).write_text(f"#!/bin/sh\n{text}\n")
            (programs / program).chmod(0o755)
        build = options.programs.parent
        (self.folder / "build").mkdir()
        (self.folder / "build" / "position").symlink_to(options.programs / "docs_position")
        (self.folder / "node_modules").mkdir()
        typescript = build / "clients" / "typescript" / "work"
        (self.folder / "node_modules" / "rtpm").symlink_to(typescript)
        classes, library = build / "java" / "target" / "classes", build / "clients" / "c"
        #: What a block may need.
        self.has = {
            "cpp": (options.programs / "docs_position").exists(),
            "java": (classes / "org").exists() and shutil.which("javac") is not None,
            "node": (typescript / "dist").exists() and shutil.which("node") is not None,
            "c": (library / "librtpm-c.so").exists() and shutil.which("cc") is not None,
        }
        kept = {
            key: value
            for key, value in os.environ.items()
            if not key.startswith(("RTPM_", "XDG_", "PYTHON"))
        }
        self.environment = kept | {
            "PATH": f"{programs}:{options.programs}:{os.environ['PATH']}",
            "HOME": str(self.folder),
            "XDG_RUNTIME_DIR": str(self.folder / ".run"),
            "XDG_STATE_HOME": str(self.folder / ".state"),
            "RTPM_RUNTIME_FOLDER": str(self.folder / ".run"),
            "RTPM_KEYS": str(self.folder / ".keys"),
            "RTPM_PROGRAMS": str(options.programs),
            "RTPM_REALTIME": "off",
            "PYTHONPATH": str(options.package),
            "PYTHONUNBUFFERED": "1",
            "CLASSPATH": f"{classes}:.",
            "CPATH": str(TREE / "clients" / "c" / "include"),
            "LIBRARY_PATH": str(library),
            "LD_LIBRARY_PATH": str(library),
        }


#: Any text, a bar of the display, a number with its sign; a page shows those of its author's machine.
VARYING = {
    r"…": ".*",
    r"[▁-█]+": "[▁-█]+",
    r"(?<!\w)[-+]?\d[\d.:]*": r"[-+]?\d[\d.:]*",
}


def pattern_of(word: str) -> str:
    """The regular expression of a word that a page says is printed."""
    pieces = re.split(f"({'|'.join(VARYING)})", word)
    found = [
        next(
            (value for key, value in VARYING.items() if re.fullmatch(key, piece)), re.escape(piece)
        )
        for piece in pieces
        if piece
    ]
    return "".join(found)


class Page:
    def __init__(self, path: Path, machines: dict[str, Machine]) -> None:
        self._path = path
        self._machines = machines
        self._folder = machines["lab"].folder.parent
        self._running: list[tuple[subprocess.Popen[bytes], Path]] = []
        self._output = self._folder / "output"
        self._end = time.monotonic() + PAGE_SECONDS
        self.counts: dict[str, int] = {}

    def run(self) -> None:
        is_skipped = False
        for block in blocks_of(self._path):
            kind = block.kind
            if kind != "text":
                is_skipped = block.need is not None and not self._machines["lab"].has[block.need]
            if is_skipped:
                print(f"{self._path.name}:{block.line}: skipped, there is no {block.need}")
                continue
            self.counts[kind] = self.counts.get(kind, 0) + 1
            if kind in ("directive", "elsewhere"):
                continue
            print(f"{self._path.name}:{block.line}: {kind} at {block.machine}", flush=True)
            try:
                getattr(self, f"_{kind}")(block, self._machines[block.machine])
            except Broken as error:
                raise Broken(f"{self._path}:{block.line}: {error}") from None

    def _start(self, machine: Machine, command: list[str], output: Path) -> subprocess.Popen[bytes]:
        with output.open("wb") as file:
            return subprocess.Popen(
                [*machine.prefix, *command],
                cwd=machine.folder,
                env=machine.environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def _finish(self, machine: Machine, command: list[str]) -> None:
        self._output = self._folder / "output"
        process = self._start(machine, command, self._output)
        try:
            code = process.wait(min(BLOCK_SECONDS, self._end - time.monotonic()))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise Broken(f"it did not end in time\n{self._printed()}") from None
        print(self._printed(), end="", flush=True)
        if code != 0:
            raise Broken(f"exit code {code}")

    def _printed(self) -> str:
        return self._output.read_text("utf-8", "replace")

    def _run(self, block: Block, machine: Machine) -> None:
        self._finish(machine, ["bash", "-euo", "pipefail", "-c", block.text])

    def _python(self, block: Block, machine: Machine) -> None:
        program = self._folder / f"line{block.line}.py"
        program.write_text(block.text, "utf-8")
        self._finish(machine, [sys.executable, str(program)])

    def _file(self, block: Block, machine: Machine) -> None:
        (machine.folder / block.words[0]).write_text(block.text, "utf-8")

    def _background(self, block: Block, machine: Machine) -> None:
        self._output = self._folder / f"output{block.line}"
        command = ["bash", "-euo", "pipefail", "-c", f"exec {block.text}"]
        self._running.append((self._start(machine, command, self._output), self._output))

    def _stop(self, block: Block, machine: Machine) -> None:
        if not self._running:
            raise Broken("nothing runs in the background")
        process, self._output = self._running.pop()
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            raise Broken(f"Ctrl-C did not end it\n{self._printed()}") from None

    def _text(self, block: Block, machine: Machine) -> None:
        deadline = time.monotonic() + 15
        for wanted in filter(None, block.text.splitlines()):
            pattern = r"\s+".join(map(pattern_of, wanted.split()))
            pattern = re.sub(r"(\\s\+)?\.\*(\\s\+)?", ".*", pattern)
            while not re.search(rf"^\s*{pattern}\s*$", self._printed(), re.MULTILINE):
                if time.monotonic() > deadline:
                    raise Broken(f"this was not printed: {wanted}\n{self._printed()}")
                time.sleep(0.05)


def end_children() -> None:
    """Ends everything that this process started, also what has left its parents."""
    own = Path(f"/proc/self/task/{os.getpid()}/children")
    for number, seconds in ((signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
        end = time.monotonic() + seconds
        while children := [int(each) for each in own.read_text().split()]:
            for child in children:
                os.kill(child, number)
            try:
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
            except ChildProcessError:
                return
            if time.monotonic() > end:
                break
            time.sleep(0.05)


def link(machines: dict[str, Machine]) -> None:
    """A second machine behind a cable. This process is on the laboratory's already."""
    desk = subprocess.Popen(["unshare", "--net", "sleep", "600"])
    space = Path(f"/proc/{desk.pid}/ns/net")
    end = time.monotonic() + 5
    while space.readlink() == Path("/proc/self/ns/net").readlink():
        if time.monotonic() > end:
            raise Broken("there is no second network")
        time.sleep(0.01)
    machines["desk"].prefix = ["nsenter", "--target", str(desk.pid), "--net", "--"]
    at_desk = machines["desk"].prefix
    for command in (
        ["ip", "link", "set", "lo", "up"],
        ["ip", "link", "add", "lab0", "type", "veth", "peer", "name", "desk0"],
        ["ip", "link", "set", "desk0", "netns", str(desk.pid)],
        ["ip", "address", "add", "192.168.7.4/24", "dev", "lab0"],
        ["ip", "link", "set", "lab0", "up"],
        [*at_desk, "ip", "address", "add", "192.168.7.2/24", "dev", "desk0"],
        [*at_desk, "ip", "link", "set", "desk0", "up"],
        [*at_desk, "ip", "link", "set", "lo", "up"],
    ):
        subprocess.run(command, check=True, timeout=10)


def own_network() -> list[str] | None:
    """The command that gives a program a network of its own."""
    ways = (["unshare", "--net"], ["unshare", "--user", "--map-root-user", "--net"])
    for way in ways:
        try:
            done = subprocess.run(
                [*way, "ip", "link"], capture_output=True, timeout=10, check=False
            )
        except FileNotFoundError:
            return None
        if done.returncode == 0:
            return way
    return None


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("page", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--programs", type=Path, required=True)
    parser.add_argument("--package", type=Path, required=True)
    parser.add_argument("--is-inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if not options.is_inside:
        way = own_network()
        if way is None or not (options.package / "rtpm").is_dir():
            print(SKIPPED, "a network namespace, iproute2, and RTPM's package for Python")
            return 0
        os.execvp(way[0], [*way, sys.executable, "-B", *sys.argv, "--is-inside"])
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    machines = {name: Machine(name, options.folder, options) for name in ("lab", "desk")}
    page = Page(options.page, machines)
    try:
        link(machines)
        page.run()
    except Broken as error:
        print(error, file=sys.stderr)
        return 1
    finally:
        end_children()
    print("tested:", ", ".join(f"{count} {kind}" for kind, count in page.counts.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
