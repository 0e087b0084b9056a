"""RTPM: real-time middleware for haptic, robotic and multimodal applications."""

from __future__ import annotations

from ._core import version as __version__
from .calls import Client, Node, Stream, connect, many
from .devices import Device, Tip, device
from .errors import (
    BadCommand,
    BadReply,
    BadRequest,
    CallError,
    Cancelled,
    DeviceError,
    Disconnected,
    EmergencyStopped,
    Error,
    Expired,
    ForkedError,
    LeaseHeld,
    LeaseLost,
    MaybeLost,
    NameNotFound,
    NoChannel,
    NoResources,
    NoSuchMethod,
    NoSuchObject,
    NotActive,
    NotAllowed,
    NotLeaseHolder,
    Overload,
    PeerRestarted,
    PriorityNotAllowed,
    Refused,
    ServantFailed,
    SetupError,
    Stopped,
    StreamLost,
    Timeout,
    TooLarge,
    Unreachable,
    VersionUnsupported,
    WrongBand,
    WrongInterface,
)
from .values import Event, Struct, Table, Vector


def __getattr__(name: str) -> object:
    """The models' classes, made from the device schema when they are first needed."""
    from .devices import model_types

    types = {} if name.startswith("_") else model_types()
    if name not in types:
        raise AttributeError(f"module 'rtpm' has no attribute '{name}'")
    globals().update(types)
    return types[name]
