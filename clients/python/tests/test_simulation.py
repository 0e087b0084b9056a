"""A device is an environment of Gymnasium, and a scene of MuJoCo is felt with it."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtpm
from conftest import Laboratory

TOUCH = Path(__file__).parents[1] / "examples" / "mujoco_touch.py"


@pytest.fixture
def env(node: rtpm.Node) -> Iterator[Any]:
    pytest.importorskip("rtpm.gym", exc_type=ImportError)
    import gymnasium

    # By URL: Gymnasium copies its arguments, and a node can't be copied.
    rtpm.device("lab/arm0", node=node, patience=5).close()
    url = node.url_of("lab/arm0")
    with gymnasium.make("rtpm/Touch-v0", device=url, patience=5) as made:
        yield made


def test_gymnasium_accepts_the_environment(env: Any) -> None:
    from gymnasium.utils.env_checker import check_env

    # The check of close() makes a second environment, for which the device has no second lease.
    check_env(env.unwrapped, skip_render_check=True, skip_close_check=True)


def test_an_action_is_a_force(env: Any) -> None:
    observation, info = env.reset()
    assert observation["position_m"].tolist() == list(info["sample"].position_m)
    limit = env.unwrapped.tip._device.description.force_newton_max
    assert env.action_space.high.tolist() == [limit] * 3
    begin_ns = info["sample"].host_time_ns
    # The force rises by soft start.
    while not observation["force_newton"] == pytest.approx([0, 0.5, 0], abs=0.01):
        observation, reward, is_over, is_cut, info = env.step([0.0, 0.5, 0.0])
        assert (reward, is_over, is_cut) == (0, False, False)
        assert info["sample"].host_time_ns < begin_ns + 20e9
    force = observation["force_newton"]
    while min(force) < 0.9 * limit / 3**0.5:
        # Ten times too much, along a diagonal.
        force = env.step([limit * 10] * 3)[0]["force_newton"]
        assert (force @ force) ** 0.5 <= limit * 1.001
        assert info["sample"].host_time_ns < begin_ns + 20e9


def test_a_reset_acquires_a_lost_lease_again(env: Any, node: rtpm.Node) -> None:
    env.reset()
    with rtpm.device("lab/arm0", node=node) as other, other.command(take_over=True):
        with pytest.raises(rtpm.LeaseLost):
            for _ in range(3):
                env.step([0.0, 0.0, 0.0])
    env.reset()
    env.step([0.0, 0.0, 0.0])


def test_the_lease_ends_with_the_environment(env: Any, node: rtpm.Node) -> None:
    env.reset()
    with rtpm.device("lab/arm0", node=node) as other:
        with pytest.raises(rtpm.LeaseHeld):
            other.command(patience=0)
        env.close()
        with other.command(patience=5):
            pass
    env.close()
    with pytest.raises(RuntimeError, match="closed"):
        env.unwrapped.reset()


@pytest.fixture
def example() -> Any:
    pytest.importorskip("mujoco", reason="mujoco, of the extra rtpm[mujoco], is not installed")
    spec = importlib.util.spec_from_file_location("mujoco_touch", TOUCH)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_contact_of_mujoco_is_felt_along_its_normal(example: Any, node: rtpm.Node) -> None:
    with rtpm.device("lab/arm0", node=node, patience=5) as arm, arm.command(patience=5) as tip:
        scene = example.Scene(arm.read().position_m)
        felt = 0
        # The hand strokes over the plate, below its surface for half of four seconds.
        for sample, walls in example.touch(tip, scene):
            for wall in walls:
                assert list(wall.normal) == pytest.approx([0, 0, 1], abs=1e-6)
                felt += sample.force_newton.dot(wall.normal) > 0.2
            if felt >= 100:
                break
            assert scene.data.time < 20
        plate = scene.data.qpos[0]
    assert plate < -0.0005  # It gave way.


def test_walls_stand_where_the_ball_touches(example: Any) -> None:
    scene = example.Scene((0, 0, 0.03))
    for _ in range(500):
        assert scene.step(rtpm.Vector3(0, 0, 0.03)) == []
    for _ in range(500):
        walls = scene.step(rtpm.Vector3(0.01, 0, 0.008))
    (wall,) = walls
    # Above the plate already where the ball would touch it.
    assert list(wall.point_m) == pytest.approx([0.01, 0, example.RADIUS_M], abs=1e-6)
    for _ in range(1000):
        (wall,) = scene.step(rtpm.Vector3(0.01, 0, -0.002))
    depth = wall.point_m.z + 0.002
    # The wall pushes the device as the plate's spring pushes the ball.
    assert wall.stiffness_newton_per_m * depth == pytest.approx(
        -1500 * scene.data.qpos[0], rel=0.05
    )


def test_the_example_runs(laboratory: Laboratory, example: Any) -> None:
    done = subprocess.run(
        [sys.executable, str(TOUCH), "lab/arm0", "--seconds", "0.2"],
        env=os.environ | {"RTPM_REGISTRY": laboratory.registry.url},
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 0 and "the strongest contact was" in done.stdout, done.stderr


def test_a_missing_package_is_named() -> None:
    code = "import sys; sys.modules['gymnasium'] = None; import rtpm.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stderr.splitlines()[-1] == (
        "ImportError: rtpm.gym needs gymnasium; remedy: pip install 'rtpm[gym]'"
    )
