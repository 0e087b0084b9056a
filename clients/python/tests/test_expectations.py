"""EXPECTATIONS.md names tests that exist, for each feature but those that it says are missing."""

from __future__ import annotations

import re
from pathlib import Path

HERE = Path(__file__).parent


def test_each_named_test_exists() -> None:
    page = (HERE.parent / "EXPECTATIONS.md").read_text()
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 20
    for feature, answer, tests in rows:
        named = re.findall(r"`(test_\w+)\.(test_\w+)`", tests)
        assert named or answer.strip().startswith("not yet: "), feature
        for module, function in named:
            source = (HERE / f"{module}.py").read_text()
            assert f"def {function}(" in source, f"{module}.{function}"
