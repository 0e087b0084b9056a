"""Pyright accepts what mypy accepts, and finds what it finds."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest
import rtpm
from test_generated import HERE, SOURCES, folder  # noqa: F401

PACKAGE = Path(rtpm.__file__).parent


def test_pyright_agrees(folder: Path, tmp_path: Path) -> None:  # noqa: F811
    pytest.importorskip("basedpyright", reason="pip install basedpyright")
    goldens = tmp_path / "goldens"
    goldens.mkdir()
    for golden in (SOURCES / "schema" / "goldens").glob("*_rtpm.pyi.golden"):
        (goldens / golden.stem).write_text(golden.read_text())
    settings = tmp_path / "pyrightconfig.json"
    included = [PACKAGE, goldens, HERE / "typed_use.py", HERE / "typed_misuse.py"]
    settings.write_text(
        json.dumps(
            {
                "include": [str(path) for path in included],
                "extraPaths": [str(PACKAGE.parent), str(folder)],
                "typeCheckingMode": "standard",
                "reportMissingImports": False,  # Adapters import packages that may be missing.
                "pythonVersion": "3.10",
            }
        )
    )
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "basedpyright",
            "--outputjson",
            "-p",
            settings,
            "--pythonpath",
            sys.executable,
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    found: dict[str, set[int]] = defaultdict(set)
    for fault in json.loads(done.stdout)["generalDiagnostics"]:
        found[Path(fault["file"]).name].add(fault["range"]["start"]["line"] + 1)
    lines = (HERE / "typed_misuse.py").read_text().splitlines()
    expected = {number for number, line in enumerate(lines, 1) if "# expected" in line}
    assert found == {"typed_misuse.py": expected}, done.stdout
