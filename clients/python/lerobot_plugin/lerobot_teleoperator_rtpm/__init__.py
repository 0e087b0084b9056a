"""Registers RTPM's teleoperator with LeRobot."""

from rtpm.lerobot import RtpmTeleoperator, RtpmTeleoperatorConfig

__all__ = ["RtpmTeleoperator", "RtpmTeleoperatorConfig"]
