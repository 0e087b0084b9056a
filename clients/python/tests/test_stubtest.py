"""Stubs tell the truth."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import rtpm

HERE = Path(__file__).parent
SOURCES = HERE.parents[2]


def test_stubs_match_the_modules() -> None:
    done = subprocess.run(
        [
            *(sys.executable, "-m", "mypy.stubtest", "rtpm", "--concise"),
            *("--mypy-config-file", SOURCES / "pyproject.toml"),
            *("--allowlist", HERE / "stubtest_allowed.txt", "--ignore-unused-allowlist"),
        ],
        capture_output=True,
        text=True,
        env=os.environ | {"MYPYPATH": str(Path(rtpm.__file__).parents[1])},
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
