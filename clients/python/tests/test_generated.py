"""Generated modules work, and type checkers know them."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import rtpm
from rtpm import generated

HERE = Path(__file__).parent
SOURCES = HERE.parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("modules")
    package = made / "generated"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "py.typed").touch()
    rtpmc = Path(os.environ["RTPM_PROGRAMS"]) / "rtpmc"
    subprocess.run(
        [
            rtpmc,
            "--emit",
            "python",
            "-o",
            package,
            "-I",
            SOURCES / "schema" / "idl",
            HERE / "lab.fbs",
        ],
        check=True,
    )
    return made


@pytest.fixture
def lab(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(folder))
    return importlib.import_module("generated.lab_rtpm")


def test_a_generated_module_has_the_classes(lab: Any) -> None:
    assert lab.Force(1, 2, 3) + lab.Force(0, 0, 1) == lab.Force(1, 2, 4)
    assert lab.Drawing(title="a").mode is lab.Mode.Off
    assert "x: Towards the right.; newton, -20 to 20" in lab.Force.__doc__
    assert lab.ArmClient.draw.__doc__.startswith(
        "draw(request: Drawing, /, *, priority=None, deadline=None) -> Drawing"
    )
    assert issubclass(lab.ArmClient, rtpm.Client)
    assert lab.Force.__module__ == "generated.lab_rtpm"


def test_a_server_with_another_interface_is_refused(lab: Any, node: rtpm.Node) -> None:
    with pytest.raises(rtpm.WrongInterface, match="rtpm.device.Device"):
        lab.ArmClient("lab/arm0", node=node)


def test_a_module_of_a_later_version_says_what_to_do() -> None:
    sys.modules.setdefault("later_rtpm", ModuleType("later_rtpm"))
    with pytest.raises(rtpm.Error, match="generate it with this version's rtpmc"):
        generated.load("later_rtpm", level=99, schema="")


def checked(folder: Path, source: str) -> tuple[int, str]:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mypy",
            "--strict",
            "--no-incremental",
            "--show-error-codes",
            HERE / source,
        ],
        capture_output=True,
        text=True,
        env=os.environ | {"MYPYPATH": f"{folder}:{os.environ['PYTHONPATH']}"},
        check=False,
    )
    return done.returncode, done.stdout


def test_types_allow_right_use(folder: Path) -> None:
    code, text = checked(folder, "typed_use.py")
    assert code == 0, text


def test_types_refuse_wrong_use(folder: Path) -> None:
    _, text = checked(folder, "typed_misuse.py")
    lines = (HERE / "typed_misuse.py").read_text().splitlines()
    expected = {
        (number, line.split("# expected: ")[1])
        for number, line in enumerate(lines, 1)
        if "# expected" in line
    }
    found = {
        (int(line), code)
        for line, code in re.findall(r"typed_misuse\.py:(\d+): error: .*\[([a-z-]+)\]", text)
    }
    assert found == expected, text
