"""Touches a scene of MuJoCo with a device: python mujoco_touch.py lab/arm0 --seconds 20

A small ball of the scene is tied to the device by a spring. Where it touches, or is about to, the
device gets a wall with the spring's stiffness. The device's own loop renders it, so that the wall
stays stiff although Python only moves it.
"""

# MuJoCo has no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import mujoco
import rtpm

RATE_HZ = 500
STIFFNESS_NEWTON_PER_M = 800
RADIUS_M = 0.005
# `gap` reports contacts before they touch, so that a wall is there in time.
SCENE = f"""
<mujoco>
  <option timestep="{1 / RATE_HZ}" integrator="implicitfast" gravity="0 0 0"/>
  <default><geom gap="0.01"/></default>
  <worldbody>
    <body name="plate" pos="0 0 -0.05">
      <joint type="slide" axis="0 0 1" stiffness="1500" damping="5"/>
      <geom type="box" size="0.1 0.1 0.05" mass="0.1"/>
    </body>
    <body name="tip">
      <joint name="x" type="slide" axis="1 0 0" stiffness="{STIFFNESS_NEWTON_PER_M}" damping="4"/>
      <joint name="y" type="slide" axis="0 1 0" stiffness="{STIFFNESS_NEWTON_PER_M}" damping="4"/>
      <joint name="z" type="slide" axis="0 0 1" stiffness="{STIFFNESS_NEWTON_PER_M}" damping="4"/>
      <geom name="tip" type="sphere" size="{RADIUS_M}" mass="0.02"/>
    </body>
  </worldbody>
</mujoco>
"""


class Scene:
    """The scene, in which a ball follows the device."""

    def __init__(self, position_m: rtpm.Vector3) -> None:
        self.model = mujoco.MjModel.from_xml_string(SCENE)
        self.data = mujoco.MjData(self.model)
        self.ball = self.model.geom("tip").id
        self.springs = [self.model.joint(axis).qposadr[0] for axis in "xyz"]
        self.data.qpos[self.springs] = list(position_m)

    def step(self, position_m: rtpm.Vector3) -> list[rtpm.Wall]:
        """Moves the ball's springs to the device, and the scene by a period; the walls at its contacts."""
        self.model.qpos_spring[self.springs] = list(position_m)
        mujoco.mj_step(self.model, self.data)
        touching = [contact for contact in self.data.contact if self.ball in contact.geom]
        # A device renders at most 16 models.
        return [self.wall(contact) for contact in touching[:16]]

    def wall(self, contact: Any) -> rtpm.Wall:
        """The wall that the ball's centre stands on, or is `dist` away from."""
        normal = contact.frame[:3] * (1 if contact.geom[1] == self.ball else -1)
        point = self.data.geom_xpos[self.ball] - normal * max(contact.dist, 0)
        return rtpm.Wall(
            point_m=rtpm.Vector3(*point),
            normal=rtpm.Vector3(*normal),
            stiffness_newton_per_m=STIFFNESS_NEWTON_PER_M,
        )


def touch(tip: rtpm.Tip, scene: Scene) -> Iterator[tuple[rtpm.Sample, list[rtpm.Wall]]]:
    """Lets the scene be touched; yields each sample with the walls that were felt in it."""
    walls: list[rtpm.Wall] = []
    for sample in tip.loop(RATE_HZ):
        yield sample, walls
        had_walls, walls = bool(walls), scene.step(sample.position_m)
        if walls or had_walls:
            tip.set_models(*walls)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("device", help="its name or URL, such as lab/arm0")
    options.add_argument("--seconds", type=float, default=20, help="for how long (20)")
    given = options.parse_args()
    strongest = 0.0
    with rtpm.device(given.device) as device, device.command() as tip:
        steps = zip(
            range(round(given.seconds * RATE_HZ)),
            touch(tip, Scene(device.read().position_m)),
            strict=False,
        )
        for _, (sample, walls) in steps:
            if walls:
                strongest = max(strongest, sample.force_newton.dot(walls[0].normal))
    print(f"the strongest contact was {strongest:.2f} N")


if __name__ == "__main__":
    main()
