"""LeRobot: a device as a teleoperator, whose actions are its motion and whose feedback is a force.

lerobot-teleoperate --teleop.discover_packages_path=rtpm.lerobot --teleop.type=rtpm --teleop.device=lab/arm0 …
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from typing import Any

try:
    from lerobot.teleoperators.teleoperator import Teleoperator
    from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
except ImportError as error:
    raise ImportError(
        f"rtpm.lerobot needs {error.name}; remedy: pip install 'rtpm[lerobot]'", name=error.name
    ) from None

from ..calls import Node
from ..devices import Device, Tip
from ..errors import LeaseLost, Timeout
from ..idl.device_rtpm import Description, DeviceClient, Quaternion, Sample
from .config_rtpm import RtpmTeleoperatorConfig

__all__ = ["RtpmTeleoperator", "RtpmTeleoperatorConfig"]

#: How long a command lasts, in seconds, since LeRobot's loops are slow.
_HOLD_S = 0.1
#: For how many seconds late replies are asked for again.
_PATIENCE_S = 1.0


class RtpmTeleoperator(Teleoperator):
    """A device of RTPM as a teleoperator of LeRobot.

    An action has the pose ("ee.x", in metres; with a sensed orientation "ee.wx", a rotation vector),
    each joint ("NAME.pos") and button ("button.NAME": 0 or 1). Feedback is a force in newton
    ("force.x"), in the device's frame; it ends 0.1 s after the last one, and with disconnect().
    """

    config_class = RtpmTeleoperatorConfig
    name = "rtpm"

    def __init__(self, config: RtpmTeleoperatorConfig) -> None:
        super().__init__(config)
        self.config = config
        self._node = Node(config.registry or None)
        self._known: Description | None = None
        self._device: Device | None = None
        self._tip: Tip | None = None

    @property
    def _description(self) -> Description:
        """Also before connect(), if the device's server runs."""
        if self._known is None:
            with DeviceClient(self.config.device, node=self._node) as client:
                self._known = client.describe()
        return self._known

    @property
    def action_features(self) -> dict[str, type]:
        """The names of an action's numbers."""
        return {name: float for name, _ in self._action(Sample())}

    @property
    def feedback_features(self) -> dict[str, type]:
        """The names of a force's numbers; none if the device applies no force."""
        actuated = {axis.name for axis in self._description.axes if axis.is_actuated}
        return {f"force.{axis}": float for axis in "xyz" if axis in actuated}

    @property
    def is_connected(self) -> bool:
        return self._device is not None

    @property
    def is_calibrated(self) -> bool:
        return True  # The device's server calibrates it.

    def connect(self, calibrate: bool = True) -> None:
        """Opens the device, and acquires its lease if it applies forces."""
        if self._device is not None:
            raise DeviceAlreadyConnectedError(f"{self.config.device} is already connected")
        device = Device(self.config.device, node=self._node, patience=2.0)
        self._known = device.description
        if self.feedback_features:
            self._tip = self._acquire(device, patience=2.0)
        self._device = device

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def get_action(self) -> dict[str, float]:
        """The newest sample's pose, joints and buttons."""
        device = self._connected()
        end = time.monotonic() + _PATIENCE_S
        while True:
            try:
                return dict(self._action(device.read()))
            except Timeout:
                if time.monotonic() > end:
                    raise

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Applies a force. Of other numbers, such as a whole observation, nothing is used."""
        device = self._connected()
        lacking = [name for name in self.feedback_features if name not in feedback]
        if lacking or self._tip is None:
            raise ValueError(
                f"{self.config.device}: feedback takes {', '.join(self.feedback_features) or 'nothing'}, in newton; "
                f"it lacks {', '.join(lacking) or 'a motor'}"
            )
        force = [float(feedback.get(f"force.{axis}", 0)) for axis in "xyz"]
        # A force that comes too late is left out: the next one counts.
        with contextlib.suppress(Timeout):
            try:
                self._tip.force = force
            except LeaseLost:  # Of a loop that paused.
                self._tip = self._acquire(device, patience=0)
                self._tip.force = force

    def disconnect(self) -> None:
        """Takes the force away and releases the lease."""
        device = self._connected()
        tip, self._tip, self._device = self._tip, None, None
        if tip is not None:
            tip.__exit__(None, None, None)
        device.close()

    def _acquire(self, device: Device, patience: float) -> Tip:
        return device.command(
            hold=min(_HOLD_S, device.description.hold_us_max * 1e-6), patience=patience
        )

    def _connected(self) -> Device:
        if self._device is None:
            raise DeviceNotConnectedError(f"{self.config.device} is not connected; call connect()")
        return self._device

    def _action(self, sample: Sample) -> Iterator[tuple[str, float]]:
        sensed = {axis.name for axis in self._description.axes if axis.is_sensed}
        for axis in sorted(sensed & set("xyz")):
            yield f"ee.{axis}", getattr(sample.position_m, axis)
        if sensed & {"rx", "ry", "rz"}:
            for axis, angle in zip("xyz", _rotation_vector(sample.orientation), strict=True):
                yield f"ee.w{axis}", angle
        for index, joint in enumerate(self._description.joints):
            yield f"{joint.name}.pos", sample.joints[index]
        for index, button in enumerate(self._description.buttons):
            yield f"button.{button}", float(sample.buttons >> index & 1)


def _rotation_vector(turn: Quaternion) -> list[float]:
    """The axis times the angle, in radians."""
    sine = math.hypot(turn.x, turn.y, turn.z)
    if sine == 0:
        return [0.0, 0.0, 0.0]
    angle = 2 * math.atan2(sine, abs(turn.w))
    return [math.copysign(angle, turn.w) * part / sine for part in (turn.x, turn.y, turn.z)]
