"""rtpm.demo() starts a simulated laboratory, which ends with the program however that ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import rtpm

CHILD = """
import os, rtpm
lab = rtpm.demo()
if os.fork() == 0:
    raise SystemExit
os.wait()
try:
    print(lab.folder, flush=True)
    while True:
        rtpm.device("lab/arm0").read()
except KeyboardInterrupt:
    print(rtpm.device("lab/arm0").read().sequence > 0, flush=True)
"""


def test_its_devices_are_found_without_further_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RTPM_REGISTRY", "rtpm://127.0.0.1:1/rtpm/names")
    with rtpm.demo() as lab:
        assert lab.devices == ["lab/arm0", "lab/gaze0", "lab/biometric0", "lab/knob0"]
        with rtpm.device("lab/arm0") as arm:
            assert arm.read().sequence > 0
        with rtpm.events("type(rtpm.device.Sampled)") as events:
            next(iter(events))
        # Programs that this one starts look there, too.
        assert os.environ["RTPM_REGISTRY"] == lab.registry
        assert lab.start("rtpm", "resolve", "lab/knob0").wait() == 0
        assert lab.folder.exists()
    assert not lab.folder.exists()
    assert os.environ["RTPM_REGISTRY"] == "rtpm://127.0.0.1:1/rtpm/names"
    with pytest.raises(rtpm.SetupError):
        rtpm.device("lab/arm0")
    with pytest.raises(rtpm.Error, match="has ended"):
        lab.start("rtpm", "list")
    lab.end()


def test_programs_of_a_laboratory_end_with_it(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with rtpm.demo() as lab, rtpm.device("lab/arm0") as arm:
        recorder = lab.start("rtpm", "record", file)
        while not file.exists() or arm.read().sequence < 100:
            time.sleep(0.01)
    assert recorder.poll() == 0
    with rtpm.open(file) as recording:
        assert recording.is_complete


def test_a_cell_that_runs_again_has_a_new_one() -> None:
    first = rtpm.demo()
    with rtpm.demo() as second:
        assert not first.folder.exists()
        assert rtpm.device("lab/arm0").read().sequence > 0
    assert repr(second) == "<rtpm.Laboratory: ended>"


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_it_ends_with_a_program_that_is_killed(end: signal.Signals) -> None:
    child = subprocess.Popen([sys.executable, "-c", CHILD], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    folder = Path(child.stdout.readline().strip())
    assert folder.exists()
    child.send_signal(end)
    child.wait()
    deadline = time.monotonic() + 10
    while folder.exists():
        assert time.monotonic() < deadline, "the laboratory did not end"
        time.sleep(0.01)


def test_an_interrupt_and_a_fork_leave_it_running() -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert child.stdout is not None
    folder = Path(child.stdout.readline().strip())
    os.killpg(child.pid, signal.SIGINT)
    assert child.stdout.readline() == "True\n"
    assert child.wait(20) == 0
    assert not folder.exists()


def test_missing_programs_are_named_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("RTPM_PROGRAMS", str(tmp_path))
    with pytest.raises(rtpm.SetupError, match=r"rtpm is not in .*pip install rtpm\[demo\]"):
        rtpm.demo()
    # Without that folder, those of the package rtpm-programs are used, else those in PATH.
    monkeypatch.delenv("RTPM_PROGRAMS")
    monkeypatch.setitem(sys.modules, "rtpm_programs", SimpleNamespace(FOLDER=tmp_path / "bin"))
    with pytest.raises(rtpm.SetupError, match=f"rtpm is not in {tmp_path}/bin"):
        rtpm.demo()
    monkeypatch.setitem(sys.modules, "rtpm_programs", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(rtpm.SetupError, match="rtpm is not in PATH"):
        rtpm.demo()


def test_a_hand_is_a_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        rtpm.demo(hand=tmp_path / "none.csv")
    hand = tmp_path / "still.csv"
    hand.write_text("0,0,0,0.02\n1,0,0,0.02\n")
    with rtpm.demo(hand=hand), rtpm.device("lab/arm0") as arm:
        assert arm.read().position_m.x == pytest.approx(0, abs=0.002)
