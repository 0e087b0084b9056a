#!/usr/bin/env python3
"""Reads all pages of docs/: each block has a test, is a part of a tested file, or says why not.

The pages of SHORT explain by fragments; they are checked for files only. The tables of faults have
each fault of gvd/driver, with its value and its words.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

from blocks import Block, blocks_of

TREE = Path(__file__).resolve().parents[2]
#: Whose files are compiled by the build, or run by a test.
TESTED = ("clients/", "devices/", "examples/", "gvd/driver/template/", "schema/idl/", "tests/")
#: Indented fragments, as READMEs have them, and settings of other programs.
SHORT = {"events", "names", "other-systems", "realtime", "security", "vocabulary", "windows"}
#: Directives of the reference; Sphinx checks them.
REFERENCE = {"eval-rst", "doxygenclass", "doxygenstruct", "doxygenenum"}


def faults_of(block: Block) -> str | None:
    """The fault of a block, if it has one."""
    if block.directive == "literalinclude":
        path = block.words[0].lstrip("/")
        if not (TREE / path).is_file():
            return f"there is no {path}"
        return None if path.startswith(TESTED) else f"no test compiles or runs {path}"
    if block.directive is not None:
        return None if block.directive in REFERENCE else f"unknown directive {block.directive}"
    try:
        kind = block.kind
        if block.language == "python" and kind in ("python", "file"):
            ast.parse(block.text)
    except (ValueError, SyntaxError) as error:
        return str(error)
    return None


def faults_of_fault_tables() -> list[str]:
    """The rows that the pages lack of the faults of a sample."""
    driver = TREE / "gvd" / "driver"
    declared = (driver / "include/rtpm/driver/sample.hpp").read_text("utf-8")
    bits = dict(re.findall(r"\b(k\w+) =\s*1u << (\d+)", declared))
    source = (driver / "src/words.cpp").read_text("utf-8")
    words = dict(re.findall(r"Fault::(k\w+), \"([^\"]+)\"", source))
    how_to, python = (
        (TREE / "docs" / page).read_text("utf-8")
        for page in ("how-to/faulted-device.md", "reference/python.md")
    )
    faults = [] if bits.keys() == words.keys() and bits else ["faults without bits or words"]
    for name, bit in bits.items():
        row = f"| {1 << int(bit)} | {words.get(name)} |"
        if f"| {bit} {row} `{name}` |" not in how_to:
            faults.append(f"how-to/faulted-device.md lacks '| {bit} {row} `{name}` |'")
        if row not in python:
            faults.append(f"reference/python.md lacks '{row}'")
    return faults


def main() -> int:
    counts: dict[str, int] = {}
    faults = faults_of_fault_tables()
    for page in sorted((TREE / "docs").rglob("*.md")):
        if page.stem in SHORT and page.parent == TREE / "docs":
            continue
        for block in blocks_of(page):
            where = f"{page.relative_to(TREE)}:{block.line}"
            if fault := faults_of(block):
                faults.append(f"{where}: {fault}")
            else:
                counts[block.kind] = counts.get(block.kind, 0) + 1
    print(", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())))
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
