#!/usr/bin/env python3
"""Runs the steps of packaging/container/Containerfile in a root of Debian, and RTPM within.

Exit codes: 0 all holds, or nothing could be tested, which a line "[  SKIPPED ]" says; 1 a check failed.
"""

import argparse
import json
import re
import shlex
import shutil
import sys
from pathlib import Path

from root import Failure, Root, Step, clear, make_root, require

#: Files that tell programs of a container, and the sizes and rights that Docker gives without options.
BARE = (
    "touch /.dockerenv; mount -t tmpfs -o size=64m tmpfs /dev/shm; ulimit -r 0; ulimit -l 64;",
    "--bounding-set -sys_nice,-ipc_lock --inh-caps -all",
)
#: With those that the recipe asks for. Capabilities stand in for the limits, which not every root may raise.
FULL = (
    "touch /.dockerenv; mount -t tmpfs -o size=1g tmpfs /dev/shm;",
    "--inh-caps +sys_nice,+ipc_lock --ambient-caps +sys_nice,+ipc_lock",
)


def steps_of(recipe: Path) -> list[tuple[str, str]]:
    """The recipe's instructions and their arguments, in order."""
    text = recipe.read_text().replace("\\\n", " ")
    lines = [line.strip() for line in text.splitlines()]
    steps = [line.partition(" ") for line in lines if line and not line.startswith("#")]
    return [(step, argument.strip()) for step, _, argument in steps]


class Container:
    """A root that a recipe's steps were done in."""

    def __init__(self, root: Root, files: Path) -> None:
        self.root = root
        self.files = files
        self.user = "root"
        self.folder = "/"
        self.entry: list[str] = []
        self.command: list[str] = []

    def do(self, step: str, argument: str) -> None:
        match step:
            case "FROM":
                if argument != "debian:12-slim":
                    raise Failure(f"the recipe begins with {argument}, the test with Debian 12")
            case "COPY":
                self.copy(argument.split())
            case "RUN":
                self.root.run(argument)
            case "USER":
                self.user = argument
            case "WORKDIR":
                self.folder = argument
            case "ENTRYPOINT":
                self.entry = json.loads(argument)
            case "CMD":
                self.command = json.loads(argument)
            case _:
                raise Failure(f"the test knows no step {step} of a recipe")

    def copy(self, words: list[str]) -> None:
        *patterns, target = words
        for pattern in patterns:
            found = list(self.files.glob(pattern))
            if not found:
                raise Failure(f"COPY {pattern}: {self.files} has no such file")
            for file in found:
                shutil.copy(file, self.root.path(target))

    def run(self, rights: tuple[str, str], *arguments: str) -> str:
        """Runs the entry point with the recipe's user, folder and command, or other arguments."""
        words = [*self.entry, *(arguments or self.command)]
        inner = f"cd {self.folder} && exec {shlex.join(words)}"
        setup, capabilities = rights
        return self.root.run(
            f"{setup} exec setpriv --reuid {self.user} --regid {self.user} --init-groups {capabilities}"
            f" env HOME={self.folder} bash -c {shlex.quote(inner)}",
            check=False,
        )


def expect(text: str, *patterns: str) -> None:
    for pattern in patterns:
        if not re.search(pattern, text):
            raise Failure(f"{pattern!r} is not in:\n{text}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--packages", type=Path, required=True, help="the folder of the packages")
    parser.add_argument("--recipe", type=Path, required=True)
    options = parser.parse_args()
    require("packages.container", options.packages)
    root = make_root(options.packages, options.packages / "container", "bare", "")
    container = Container(root, options.packages)
    with Step("did the steps of the recipe"):
        for step, argument in steps_of(options.recipe):
            container.do(step, argument)
    with Step("let rtpm doctor judge a container without the options"):
        said = container.run(BARE, "doctor")
        expect(
            said,
            r"container: it is a container \(docker\)",
            "--network host",
            "--cap-add SYS_NICE",
            "--shm-size=1g",
            r"problem\s+realtime",
        )
    with Step("let it judge one with them"):
        said = container.run(FULL, "doctor")
        expect(said, r"good .*realtime, memory-lock", "shared-memory")
    with Step("ran the laboratory for 3 s"):
        expect(container.run(FULL, *container.command, "--seconds", "3"), "lab/arm0", "p99")
    clear(root.folder)
    print("the recipe holds")


try:
    main()
except Failure as failure:
    sys.exit(f"packages.container: {failure}")
