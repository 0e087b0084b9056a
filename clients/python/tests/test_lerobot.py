"""A device is a teleoperator of LeRobot."""

from __future__ import annotations

import importlib
import importlib.util
import math
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtpm
from conftest import Laboratory

needs_lerobot = pytest.mark.skipif(
    importlib.util.find_spec("lerobot") is None,
    reason="lerobot, of the extra rtpm[lerobot], is not installed: it needs torch",
)


@pytest.fixture
def teleoperator(laboratory: Laboratory, tmp_path: Path) -> Iterator[Any]:
    from lerobot.configs.parser import load_plugin
    from lerobot.teleoperators.config import TeleoperatorConfig
    from lerobot.teleoperators.utils import make_teleoperator_from_config

    # As LeRobot's programs make it.
    load_plugin("rtpm.lerobot")
    kind: Any = TeleoperatorConfig.get_choice_class("rtpm")
    config = kind(device="lab/arm0", registry=laboratory.registry.url, calibration_dir=tmp_path)
    made = make_teleoperator_from_config(config)
    yield made
    if made.is_connected:
        made.disconnect()


@needs_lerobot
def test_actions_are_the_devices_motion(teleoperator: Any) -> None:
    names = ["ee.x", "ee.y", "ee.z", "button.stylus"]
    assert teleoperator.action_features == {name: float for name in names}
    assert teleoperator.feedback_features == {f"force.{axis}": float for axis in "xyz"}
    assert teleoperator.is_calibrated and not teleoperator.is_connected
    with pytest.raises(ConnectionError, match="lab/arm0 is not connected"):
        teleoperator.get_action()
    with teleoperator:
        with pytest.raises(ConnectionError, match="already connected"):
            teleoperator.connect()
        first = teleoperator.get_action()
        assert list(first) == names
        end = time.monotonic() + 5
        while teleoperator.get_action()["ee.z"] == first["ee.z"]:
            assert time.monotonic() < end
    assert not teleoperator.is_connected


@needs_lerobot
def test_feedback_is_a_force_that_ends(teleoperator: Any, node: rtpm.Node) -> None:
    with rtpm.device("lab/arm0", node=node) as arm:
        with teleoperator:
            end = time.monotonic() + 5
            while arm.read().force_newton.y < 0.4:
                assert time.monotonic() < end
                teleoperator.send_feedback({"force.x": 0, "force.y": 0.5, "force.z": 0, "a": 1})
            with pytest.raises(ValueError, match=r"it lacks force\.y, force\.z"):
                teleoperator.send_feedback({"force.x": 1})
            while abs(arm.read().force_newton) > 0:
                assert time.monotonic() < end
            # An operator took the lease, and has released it.
            with arm.command(take_over=True):
                with pytest.raises(rtpm.LeaseHeld):
                    for _ in range(3):
                        teleoperator.send_feedback({f"force.{axis}": 0 for axis in "xyz"})
            while True:
                try:
                    teleoperator.send_feedback({f"force.{axis}": 0 for axis in "xyz"})
                    break
                except rtpm.DeviceError:
                    assert time.monotonic() < end


@needs_lerobot
def test_the_plug_in_is_the_same_class(monkeypatch: pytest.MonkeyPatch) -> None:
    from rtpm.lerobot import RtpmTeleoperator

    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "lerobot_plugin"))
    plug_in = importlib.import_module("lerobot_teleoperator_rtpm")
    assert plug_in.RtpmTeleoperator is RtpmTeleoperator


@needs_lerobot
def test_an_orientation_is_a_rotation_vector() -> None:
    from rtpm.lerobot import _rotation_vector

    half = math.sqrt(0.5)
    assert _rotation_vector(rtpm.Quaternion(0, 0, 0, 1)) == [0, 0, 0]
    assert _rotation_vector(rtpm.Quaternion(0, half, 0, half)) == pytest.approx([0, math.pi / 2, 0])
    assert _rotation_vector(rtpm.Quaternion(0, half, 0, -half)) == pytest.approx(
        [0, -math.pi / 2, 0]
    )


def test_missing_lerobot_is_named() -> None:
    code = "import sys; sys.modules['lerobot'] = None; import rtpm.lerobot"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stderr.splitlines()[-1].endswith("remedy: pip install 'rtpm[lerobot]'")
