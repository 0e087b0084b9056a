"""Gymnasium: a device as an environment, whose observations are its samples and whose actions are forces.

env = gymnasium.make("rtpm/Touch-v0", device="lab/arm0")
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from .calls import Node
from .devices import Device, Tip
from .errors import LeaseLost, Timeout
from .idl.device_rtpm import Sample

try:
    import gymnasium
    import numpy
except ImportError as error:
    raise ImportError(
        f"rtpm.gym needs {error.name}; remedy: pip install 'rtpm[gym]'", name=error.name
    ) from None

Observation = dict[str, Any]

_OBSERVED = ("position_m", "linear_m_per_s", "force_newton")


class TouchEnv(gymnasium.Env[Observation, Any]):
    """A device that a policy holds: it sees samples, and acts by a force.

    An observation has `position_m`, `linear_m_per_s` and `force_newton` of the newest sample; `info`
    has all of it as "sample". An action is a force in newton in the device's frame, shortened to what
    the device can apply. A step lasts for one period of `rate`. Derive from the class for a reward or
    an end: it has neither.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        device: str,
        *,
        rate: float = 100.0,
        node: Node | None = None,
        patience: float = 2.0,
        stall: float = 10.0,
        render_mode: None = None,
    ) -> None:
        """Opens the device at `device`, a name or a URL, and acquires its lease within `patience` seconds.

        rate: steps per second. An action lasts for three of their periods, if no other follows. stall:
        for how many seconds the lease is kept between two steps, while a policy learns.
        """
        self._device = Device(device, node=node, patience=patience, stall=stall)
        limits = self._device.description
        self._force_max = limits.force_newton_max
        self._rate = rate
        self._hold = min(3 / rate, limits.hold_us_max * 1e-6)
        self._patience = patience
        self._tip: Tip | None = None
        self._samples: Iterator[Sample] = iter(())
        self._acquire()
        free = gymnasium.spaces.Box(-numpy.inf, numpy.inf, (3,), numpy.float64)
        self.observation_space = gymnasium.spaces.Dict({name: free for name in _OBSERVED})
        self.action_space = gymnasium.spaces.Box(
            -self._force_max, self._force_max, (3,), numpy.float64
        )

    @property
    def tip(self) -> Tip:
        """The device's tip, for models that it renders beside the actions."""
        if self._tip is None:
            raise RuntimeError("this environment is closed")
        return self._tip

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Takes the action's force away, and acquires the lease if it was lost. The hand stays where it is."""
        super().reset(seed=seed)
        try:
            self.tip.force = (0, 0, 0)
        except LeaseLost:
            self._acquire()
        sample = next(self._samples)
        return self._observe(sample), {"sample": sample}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Applies a force until the next period, and observes."""
        force = numpy.asarray(action, numpy.float64)
        length = float(numpy.linalg.norm(force))
        if length > self._force_max:
            force = force * (self._force_max / length)
        # An action that comes too late is left out: the next one counts, and no force lasts without one.
        with contextlib.suppress(Timeout):
            self.tip.force = force.tolist()
        sample = next(self._samples)
        observation = self._observe(sample)
        return (
            observation,
            self.reward(sample, force),
            self.is_over(sample),
            False,
            {"sample": sample},
        )

    def reward(self, sample: Sample, force: Any) -> float:
        """The reward of a step that ended with `sample` after `force`."""
        return 0.0

    def is_over(self, sample: Sample) -> bool:
        """Whether the episode ends with `sample`."""
        return False

    def close(self) -> None:
        """Takes the force away and releases the lease."""
        tip, self._tip = self._tip, None
        if tip is not None:
            tip.__exit__(None, None, None)
        self._device.close()

    def _acquire(self) -> None:
        self._tip = self._device.command(hold=self._hold, patience=self._patience)
        self._samples = self._tip.loop(self._rate)

    def _observe(self, sample: Sample) -> Observation:
        return {name: numpy.array(list(getattr(sample, name))) for name in _OBSERVED}


# A person's hand, or the simulated one, does not begin anew at a reset.
gymnasium.register("rtpm/Touch-v0", entry_point="rtpm.gym:TouchEnv", nondeterministic=True)
