"""The simulated arm is read and commanded, and is left without force however a program ends."""

from __future__ import annotations

import itertools
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtpm
from conftest import Laboratory

# Bits of driver::Fault.
COMMAND_NOT_FINITE = 1 << 8
EMERGENCY_STOP = 1 << 13


@pytest.fixture
def arm(node: rtpm.Node) -> Iterator[rtpm.Device]:
    with rtpm.device("lab/arm0", node=node, patience=5) as opened:
        yield opened


def force_of(arm: rtpm.Device) -> float:
    return abs(arm.read().force_newton)


def wait_until(is_true: object, seconds: float = 5) -> None:
    end = time.monotonic() + seconds
    while not is_true():  # type: ignore[operator]
        assert time.monotonic() < end, "the condition did not become true"
        time.sleep(0.005)


def test_a_loop_of_python_pulls_the_arm(arm: rtpm.Device) -> None:
    with arm.command(hold=0.05) as tip:
        for count, sample in enumerate(tip.loop(rate=200)):
            tip.force = -20 * sample.position_m
            if count == 50:
                break
        assert sample.position_m.x != 0
        wait_until(lambda: force_of(arm) > 0)
    wait_until(lambda: force_of(arm) == 0)


def test_positions_are_vectors(arm: rtpm.Device) -> None:
    position = arm.read().position_m
    assert list(2 * position) == [2 * position.x, 2 * position.y, 2 * position.z]
    assert list(position - position) == [0, 0, 0]
    assert list(position + (1, 1, 1)) == [position.x + 1, position.y + 1, position.z + 1]
    assert abs(position) == pytest.approx(position.dot(position) ** 0.5)
    with pytest.raises(TypeError):
        position * position


def test_a_command_is_not_repeated_when_python_stalls(arm: rtpm.Device) -> None:
    with arm.command(hold=0.02) as tip:
        tip.force = (1, 0, 0)
        wait_until(lambda: force_of(arm) == 0)


def test_a_native_loop_renders_a_wall_beside_a_computing_thread(arm: rtpm.Device) -> None:
    is_ending = threading.Event()

    def compute() -> None:
        while not is_ending.is_set():
            sum(range(1000))

    thread = threading.Thread(target=compute)
    with arm.command() as tip:
        # The arm's hand moves within 0.02 m, so that it always presses on this wall.
        servo = tip.render(
            rtpm.Wall(point_m=(0, 0, 0.05), normal=(0, 0, 1), stiffness_newton_per_m=50)
        )
        thread.start()
        wait_until(lambda: force_of(arm) > 0)
        servo.set(rtpm.Spring(anchor_m=(0, 0, 0), stiffness_newton_per_m=0, force_newton_max=1))
        wait_until(lambda: force_of(arm) == 0)
        assert servo.is_running
        assert servo.figures["cycles"] > 0
        is_ending.set()
        thread.join()


def test_wrong_commands_are_refused_in_plain_words(arm: rtpm.Device, node: rtpm.Node) -> None:
    with pytest.raises(ValueError, match=r"hold takes more than 0 and up to 0\.1 s at .*, not 5"):
        arm.command(hold=5)
    with pytest.raises(rtpm.NameNotFound, match="most like it: lab/arm0"):
        rtpm.device("lab/amr0", node=node)
    with arm.command() as tip:
        for wrong in ((0, 2), (1, 2, 3, 4), 1.5, (1, "a", 3)):
            with pytest.raises(
                TypeError, match=r"force takes three numbers, such as \(0, 0, 1.5\)"
            ):
                tip.force = wrong  # type: ignore[assignment]
        with pytest.raises(AttributeError, match="frce"):
            tip.frce = (0, 0, 1)  # type: ignore[attr-defined]
        with pytest.raises(ValueError, match="normal is 2"):
            tip.render(rtpm.Wall(normal=(0, 0, 2), stiffness_newton_per_m=100))
        servo = tip.render(rtpm.Wall(normal=(0, 0, 1), stiffness_newton_per_m=100))
        assert "running" in repr(servo)
        with pytest.raises(ValueError, match="stiffness_newton_per_m is -1; choose 0 to 1667"):
            servo.set(rtpm.Wall(normal=(0, 0, 1), stiffness_newton_per_m=-1))
        assert servo.is_running


def test_a_wall_that_is_too_stiff_is_refused_with_the_number(arm: rtpm.Device) -> None:
    with arm.command() as tip:
        with pytest.raises(
            ValueError,
            match=r"stiffness_newton_per_m is 9000; choose 0 to 1667 in a loop of 1000 Hz; tip\.set_models",
        ):
            tip.render(rtpm.Wall(normal=(0, 0, 1), stiffness_newton_per_m=9000))
        with pytest.raises(ValueError, match="stiffness_newton_per_m is 9000"):
            tip.set_models(rtpm.Wall(normal=(0, 0, 1), stiffness_newton_per_m=9000))
        with pytest.raises(TypeError, match="a model takes Plane, Sphere"):
            tip.set_models(3)


def test_the_devices_own_loop_renders_models(arm: rtpm.Device) -> None:
    with arm.command() as tip:
        tip.set_models(rtpm.Wall(point_m=(0, 0, 0.05), normal=(0, 0, 1), stiffness_newton_per_m=50))
        wait_until(lambda: force_of(arm) > 0)
        tip.set_models()
        wait_until(lambda: force_of(arm) == 0)


def test_the_lease_is_one_clients(arm: rtpm.Device, node: rtpm.Node) -> None:
    with arm.command() as tip, rtpm.device("lab/arm0", node=node) as other:
        with pytest.raises(PermissionError, match="another client holds the device's lease"):
            other.command(patience=0)
        with other.command(take_over=True):
            with pytest.raises(rtpm.LeaseLost):
                tip.force = (0, 0, 0)
                tip.force = (0, 0, 0)


def test_the_lease_is_kept_only_while_python_runs(node: rtpm.Node) -> None:
    with rtpm.device("lab/arm0", node=node, stall=0.3) as arm:
        tip = arm.command(hold=0.02)
        arm.read()
        time.sleep(2.5)  # Longer than the stall and the lease together.
        with pytest.raises(rtpm.LeaseLost):
            tip.force = (0, 0, 0)


def test_a_stop_needs_no_lease_and_ends_by_rearm(arm: rtpm.Device) -> None:
    with arm.command() as tip:
        arm.stop()
        with pytest.raises(rtpm.EmergencyStopped, match="rearm"):
            tip.force = (1, 0, 0)
        wait_until(lambda: arm.read().faults & EMERGENCY_STOP)
        tip.rearm()
        wait_until(lambda: not arm.read().faults & EMERGENCY_STOP)
        tip.force = (0, 0, 0)
    with pytest.raises(ValueError, match="scope takes"):
        arm.stop("world")


def test_wrong_values_are_named(arm: rtpm.Device) -> None:
    with arm.command() as tip:
        with pytest.raises(TypeError, match="force takes three numbers, such as"):
            tip.force = 3
        with pytest.raises(ValueError, match="not finite"):
            tip.force = (float("nan"), 0, 0)
        wait_until(lambda: arm.read().faults & COMMAND_NOT_FINITE)
        tip.recover()
        wait_until(lambda: not arm.read().faults & COMMAND_NOT_FINITE)


def test_late_cycles_are_reported_at_the_end(
    arm: rtpm.Device, caplog: pytest.LogCaptureFixture
) -> None:
    with arm.command() as tip, caplog.at_level(logging.WARNING, "rtpm"):
        for count, _ in enumerate(tip.loop(rate=500)):
            if count == 2:
                time.sleep(0.02)
            if count == 4:
                break
    assert "skipped because Python was late" in caplog.text


def test_late_commands_cost_cycles_and_are_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    served = Laboratory(tmp_path)
    try:
        with rtpm.device("lab/arm0", node=rtpm.Node(served.registry.url)) as arm:
            tip = arm.command(hold=0.05, patience=5)
            served.devices.process.send_signal(signal.SIGSTOP)
            tip.force = (0.5, 0, 0)
            served.devices.process.send_signal(signal.SIGCONT)
            for _ in itertools.islice(tip.loop(rate=500), 10):
                tip.force = (0.5, 0, 0)
            tip.release()
            assert "commands got no answer in time" in caplog.text
            tip = arm.command(hold=0.05, patience=5)
            served.devices.process.send_signal(signal.SIGSTOP)
            begin = time.monotonic()
            with pytest.raises(TimeoutError):
                while time.monotonic() < begin + 20:
                    tip.force = (0.5, 0, 0)
            assert time.monotonic() - begin > 0.9
            served.devices.process.send_signal(signal.SIGCONT)
    finally:
        served.end()


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL, signal.SIGSTOP])
def test_no_force_is_left_behind(laboratory: Laboratory, arm: rtpm.Device, end: int) -> None:
    code = (
        "import rtpm\n"
        f"arm = rtpm.device('lab/arm0', node=rtpm.Node({laboratory.registry.url!r}))\n"
        "with arm.command(hold=0.05, patience=5) as tip:\n"
        "    for sample in tip.loop(rate=500):\n"
        "        tip.force = (0.5, 0, 0)\n"
        "        print(flush=True)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert child.stdout is not None
    child.stdout.readline()
    wait_until(lambda: force_of(arm) > 0)
    os.kill(child.pid, end)
    wait_until(lambda: force_of(arm) == 0)
    child.kill()
    child.wait()
    child.stdout.close()
