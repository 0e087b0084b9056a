"""The example programs run as their readers run them."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_the_staircase_finds_the_simulated_subjects_threshold(tmp_path: Path) -> None:
    arguments = [sys.executable, "-B", str(EXAMPLES / "stiffness_experiment.py"), "--seed", "20"]
    if importlib.util.find_spec("matplotlib"):
        arguments += ["--plot", str(tmp_path / "staircase.png")]
    ran = subprocess.run(arguments, capture_output=True, text=True, timeout=100)
    assert ran.returncode == 0, ran.stderr
    found = re.search(r"(\d+) trials, threshold at 71 % right: ([\d.]+) % of 300 N/m", ran.stdout)
    assert found, ran.stdout
    assert int(found[1]) > 20
    # The subject's own is 8 %; these are some 45 answers that depend on chance.
    assert 8 / 4 < float(found[2]) < 8 * 4
    if len(arguments) > 5:
        assert (tmp_path / "staircase.png").stat().st_size > 5000


def test_a_person_answers_at_a_laboratory_that_runs() -> None:
    ran = subprocess.run(
        [sys.executable, "-B", str(EXAMPLES / "stiffness_experiment.py"), "--help"],
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0 and "--person" in ran.stdout
