"""Trials and marks are events, in recordings and for other programs."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path

import pytest
import rtpm
from conftest import PROGRAMS, Laboratory


def test_a_trial_is_an_interval(laboratory: Laboratory, node: rtpm.Node) -> None:
    with rtpm.events(rtpm.Trial, node=node) as events:
        with rtpm.trial(3, "soft", seed=7, note="first block", node=node, source=2) as trial:
            trial.mark("touches", time_ns=trial.begin_ns + 5)
            trial.response = "stiffer"
        begin, mark, end = (events.next(5) for _ in range(3))
    phases = rtpm.TrialPhase
    assert [each.value.phase for each in (begin, mark, end)] == [
        phases.Begin,
        phases.Mark,
        phases.End,
    ]
    assert {each.source for each in (begin, mark, end)} == {2}
    assert {each.value.number for each in (begin, mark, end)} == {3}
    assert begin.value.condition == "soft" and begin.value.note == "first block"
    assert mark.value.note == "touches" and mark.value.seed is None
    assert mark.time_ns - begin.time_ns == 5
    # The end describes the trial without the events before it.
    assert (end.value.condition, end.value.seed, end.value.response) == ("soft", 7, "stiffer")
    assert end.value.duration_ns == end.time_ns - begin.time_ns > 0


def test_an_error_ends_its_trial_and_shows(laboratory: Laboratory, node: rtpm.Node) -> None:
    with rtpm.events(rtpm.Trial, node=node) as events:
        with pytest.raises(RuntimeError), rtpm.trial(1, node=node):
            raise RuntimeError
        events.next(5)
        assert events.next(5).value.note == "ended by RuntimeError"
        rtpm.mark("a pause", node=node)
        pause = events.next(5)
        assert (pause.value.number, pause.value.note) == (0, "a pause")
    with pytest.raises(ValueError, match="from 1"):
        rtpm.trial(0, node=node)


def test_a_recording_has_trials_of_python_and_of_the_tool(
    laboratory: Laboratory, node: rtpm.Node, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    environment = os.environ | {"RTPM_RUNTIME_FOLDER": str(laboratory.folder)}
    tool = [str(PROGRAMS / "rtpm"), "--registry", laboratory.registry.url]
    command = ["record", str(path), "--filter", "type(1380974656)", "--for", "1500ms"]
    recorder = subprocess.Popen([*tool, *command], stdout=subprocess.DEVNULL, env=environment)
    number = 0
    while recorder.poll() is None:
        number += 1
        with rtpm.trial(number, node=node):
            time.sleep(0.05)
        if number == 20:
            mark = ["mark", "--trial", "20", "--end", "--response", "by hand", "a note"]
            subprocess.run([*tool, *mark], check=True, stdout=subprocess.DEVNULL, env=environment)
    assert recorder.returncode == 0
    with rtpm.open(path) as recording:
        ends = [
            each.value
            for each in recording["rtpm.Trial/0"]
            if each.value.phase == rtpm.TrialPhase.End
        ]
    assert len(ends) > 10
    (by_hand,) = [each for each in ends if each.note]
    assert (by_hand.number, by_hand.response, by_hand.note) == (20, "by hand", "a note")
    assert all(each.duration_ns > 40_000_000 for each in ends if not each.note)
