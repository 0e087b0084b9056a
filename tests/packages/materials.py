#!/usr/bin/env python3
"""The bill of materials is whole, and CycloneDX's own library reads it: materials.py PROGRAMS FOLDER.

Exit codes: 0 all holds, or its library is missing, which a line "[  SKIPPED ]" says; 1 a check failed.
"""

import json
import subprocess
import sys
from pathlib import Path

RELEASE = Path(__file__).resolve().parents[2] / "packaging/release.py"


def release(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-B", RELEASE, *map(str, arguments)], capture_output=True, text=True
    )


def programs_of(folder: Path) -> list[Path]:
    """RTPM's own programs; those of tests begin otherwise."""
    return [file for file in sorted(folder.glob("rtpm*")) if file.read_bytes()[:4] == b"\x7fELF"]


def main() -> None:
    programs, folder = map(Path, sys.argv[1:])
    out = folder / "rtpm.cdx.json"
    made = release("sbom", out, *programs_of(programs))
    assert made.returncode == 0, made.stderr
    text = out.read_text()
    names = {part["name"] for part in json.loads(text)["components"]}
    assert {"libsodium", "flatbuffers", "three", "nanobind"} <= names, names
    # A program of the system, with libraries that RTPM has not.
    unknown = release("sbom", out, "/usr/bin/apt")
    assert unknown.returncode == 1 and "libapt-pkg.so" in unknown.stderr, unknown.stderr
    try:
        from cyclonedx.schema import SchemaVersion
        from cyclonedx.validation.json import JsonStrictValidator
    except ImportError:
        print(
            "[  SKIPPED ] needs cyclonedx-python-lib[json-validation] from PyPI, which ./dev test installs"
        )
        return
    fault = JsonStrictValidator(SchemaVersion.V1_5).validate_str(text)
    assert fault is None, fault
    print(f"{len(names)} components")


main()
