"""RTPM: real-time middleware for haptic, robotic and multimodal applications."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._core import version as __version__
from .asynchronous import AsyncClient, AsyncStream, bind, connect_async
from .calls import Client, Node, Stream, calling, close, connect, many, transport_of, url_of
from .devices import Device, Servo, Tip, device
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
    RecordingError,
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
from .events import (
    Batch,
    Batches,
    Events,
    Filter,
    Losses,
    Received,
    Supplier,
    correlate,
    events,
    silence,
    supplier,
)
from .recordings import Recorded, Recording, Topic, open
from .servants import Call, Refusal, Servant, Server, current_call, serve
from .sessions import Session, session
from .trials import RunningTrial, mark, trial
from .values import Buffer, Event, Struct, Table, Vector, replace

# After values and calls, which it is made with.
from .idl.device_rtpm import (  # isort: skip
    AffineField,
    Box,
    Command,
    CommandMode,
    Description,
    Detents,
    DialDetents,
    Friction,
    Plane,
    Quaternion,
    Sample,
    Side,
    Sphere,
    Spring,
    Vector3,
)

from .idl.trial_rtpm import Trial, TrialPhase  # isort: skip

Wall = Plane

# Few programs need these: they are imported when they are first used.
if TYPE_CHECKING:
    from .laboratory import Laboratory, demo
    from .plots import Plot, plot
else:

    def __getattr__(name):
        module = {
            "Laboratory": "laboratory",
            "demo": "laboratory",
            "Plot": "plots",
            "plot": "plots",
        }
        if name not in module:
            raise AttributeError(f"module 'rtpm' has no attribute {name!r}")
        from importlib import import_module

        globals()[name] = getattr(import_module(f".{module[name]}", __name__), name)
        return globals()[name]

    def __dir__():
        return sorted({*globals(), *__all__})


__all__ = [
    "__version__",
    "AffineField",
    "AsyncClient",
    "AsyncStream",
    "BadCommand",
    "BadReply",
    "BadRequest",
    "Batch",
    "Batches",
    "Box",
    "Buffer",
    "Call",
    "CallError",
    "Cancelled",
    "Client",
    "Command",
    "CommandMode",
    "Description",
    "Detents",
    "Device",
    "DeviceError",
    "DialDetents",
    "Disconnected",
    "EmergencyStopped",
    "Error",
    "Event",
    "Events",
    "Expired",
    "Filter",
    "ForkedError",
    "Friction",
    "Laboratory",
    "LeaseHeld",
    "LeaseLost",
    "Losses",
    "MaybeLost",
    "NameNotFound",
    "NoChannel",
    "NoResources",
    "NoSuchMethod",
    "NoSuchObject",
    "Node",
    "NotActive",
    "NotAllowed",
    "NotLeaseHolder",
    "Overload",
    "PeerRestarted",
    "Plane",
    "Plot",
    "PriorityNotAllowed",
    "Quaternion",
    "Received",
    "Recorded",
    "Recording",
    "RecordingError",
    "Refusal",
    "Refused",
    "RunningTrial",
    "Sample",
    "Servant",
    "ServantFailed",
    "Server",
    "Servo",
    "Session",
    "SetupError",
    "Side",
    "Sphere",
    "Spring",
    "Stopped",
    "Stream",
    "StreamLost",
    "Struct",
    "Supplier",
    "Table",
    "Timeout",
    "Tip",
    "TooLarge",
    "Topic",
    "Trial",
    "TrialPhase",
    "Unreachable",
    "Vector",
    "Vector3",
    "VersionUnsupported",
    "Wall",
    "WrongBand",
    "WrongInterface",
    "bind",
    "calling",
    "close",
    "connect",
    "connect_async",
    "correlate",
    "current_call",
    "demo",
    "device",
    "events",
    "many",
    "mark",
    "open",
    "plot",
    "replace",
    "serve",
    "session",
    "silence",
    "supplier",
    "transport_of",
    "trial",
    "url_of",
]
