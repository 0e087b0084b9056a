"""The configuration of the teleoperator, in a module of its own, where LeRobot looks for it."""

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("rtpm")
@dataclass(kw_only=True)
class RtpmTeleoperatorConfig(TeleoperatorConfig):
    """Which device is the teleoperator."""

    #: Its name or URL, such as "lab/arm0".
    device: str
    #: The registry's URL; by default the environment's RTPM_REGISTRY, or this host.
    registry: str = ""
