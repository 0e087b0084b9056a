"""A laboratory for the tests: a registry and a device server with simulated devices, on free ports."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtpm

PROGRAMS = Path(os.environ["RTPM_PROGRAMS"])
HAND = Path(__file__).parents[2] / "scene" / "stroke.csv"


class Program:
    """A server, ended with the test."""

    def __init__(self, name: str, *arguments: str, folder: Path) -> None:
        environment = os.environ | {
            "RTPM_RUNTIME_FOLDER": str(folder),
            "RTPM_KEYS": str(folder / "no-keys"),
            "XDG_STATE_HOME": str(folder),
        }
        self.process = subprocess.Popen(
            [str(PROGRAMS / name), *arguments], stdout=subprocess.PIPE, text=True, env=environment
        )
        self.url = ""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            found = re.search(r"rtpm://\S+", line)
            if found:
                self.url = found.group()
                return
        raise AssertionError(f"{name} ended with {self.process.wait()} before it served")

    def end(self) -> None:
        self.process.terminate()
        self.process.wait(10)


class Laboratory:
    """One simulated arm, `lab/arm0`, at a registry of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.registry = Program("rtpm-registryd", "--port", "0", folder=folder)
        self.devices = self.start_devices()

    def start_devices(self, *arguments: str) -> Program:
        return Program(
            "rtpm-deviced",
            *(
                "--port",
                "0",
                "--registry",
                self.registry.url,
                "--serve-events",
                "--device-arm0-hand",
                str(HAND),
            ),
            *arguments,
            folder=self.folder,
        )

    def end(self) -> None:
        self.devices.end()
        self.registry.end()


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Laboratory]:
    folder = tmp_path_factory.mktemp("runtime")
    os.environ["RTPM_RUNTIME_FOLDER"] = str(folder)
    started = Laboratory(folder)
    yield started
    started.end()


@pytest.fixture(scope="session")
def node(laboratory: Laboratory) -> rtpm.Node:
    return rtpm.Node(laboratory.registry.url)
