"""`rtpm stubs` writes the module of an object that runs."""

from __future__ import annotations

import importlib
import json
import subprocess
from pathlib import Path

import pytest
import rtpm
from conftest import PROGRAMS, Laboratory


def stubs(laboratory: Laboratory, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [PROGRAMS / "rtpm", "--registry", laboratory.registry.url, "stubs", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_objects_module_is_written(
    laboratory: Laboratory, node: rtpm.Node, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "made"
    done = stubs(laboratory, "lab/arm0", "-o", folder)
    assert done.stdout.split() == [f"{folder}/arm0_rtpm.py", f"{folder}/arm0_rtpm.pyi"], done.stderr
    assert "class DeviceClient(rtpm.Client):" in (folder / "arm0_rtpm.pyi").read_text()
    monkeypatch.syspath_prepend(str(folder))
    module = importlib.import_module("arm0_rtpm")
    assert module.Sample is rtpm.Sample
    with module.DeviceClient("lab/arm0", node=node) as arm:
        assert arm.describe(deadline=5).serial == "sim-arm0"


def test_a_url_will_do(laboratory: Laboratory, node: rtpm.Node, tmp_path: Path) -> None:
    done = stubs(laboratory, node.url_of("lab/arm0"), "-o", tmp_path, "--json")
    assert [Path(path).name for path in json.loads(done.stdout)["files"]] == [
        "arm0_rtpm.py",
        "arm0_rtpm.pyi",
    ]


def test_failures_say_what_to_do(laboratory: Laboratory, tmp_path: Path) -> None:
    done = stubs(laboratory, "lab/arm9")
    assert (done.returncode, done.stdout) == (3, "")
    assert "'lab/arm9' is not bound" in done.stderr
    (tmp_path / "file").touch()
    done = stubs(laboratory, "lab/arm0", "-o", tmp_path / "file" / "below")
    assert done.returncode == 1
    assert "below" in done.stderr
