#!/usr/bin/env python3
"""Prints the table of spec/README.md from the results of run.py, given as files of JSON lines.

A cell has the cases that passed of those that ran; behind the table stands each other case.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

NAMES = {"cpp": "C++", "python": "Python", "java": "Java", "typescript": "TypeScript"}


def main() -> int:
    results = [json.loads(line) for path in sys.argv[1:] for line in Path(path).open()]
    count = Counter((each["client"], each["server"], each["result"]) for each in results)
    print("| client \\ server |", " | ".join(NAMES.values()), "|")
    print("|---" * (len(NAMES) + 1) + "|")
    for client, name in NAMES.items():
        cells = []
        for server in NAMES:
            passed, failed, not_offered = (
                count[client, server, result] for result in ("pass", "fail", "not_offered")
            )
            run = passed + failed + not_offered
            cells.append(f"{passed} of {run}" if run else "not run")
        print(f"| {name} |", " | ".join(cells), "|")
    for each in results:
        if each["result"] not in ("pass", "skipped"):
            print("{client} -> {server} {way}, {case}: {result}: {detail}".format(**each))
    return 0


if __name__ == "__main__":
    sys.exit(main())
