"""RTPM's errors. Each also derives from the exception that Python's users expect, such as TimeoutError."""

from __future__ import annotations

from typing import ClassVar


class Error(Exception):
    """A failure that RTPM reports. The text says what happened, why, and what to do."""


class SetupError(Error):
    """Something could not be set up."""

    what: str
    why: str
    remedy: str


class RecordingError(Error):
    """A recording is damaged, was not ended, or is no recording."""


class CallError(Error):
    """A call gave no result."""

    #: Whether the servant's method ran; None if that is unknown.
    was_run: ClassVar[bool | None] = None
    #: Whether the same call may succeed later.
    is_transient: ClassVar[bool] = False
    method: str = ""
    target: str = ""


class NameNotFound(SetupError, LookupError):
    """Nothing is bound at the name."""


class ForkedError(Error, RuntimeError):
    """The object belongs to the parent of this forked process."""


class Timeout(CallError, TimeoutError):
    """No reply within the deadline; the method may have run."""

    is_transient = True


class Expired(CallError, TimeoutError):
    """The deadline passed before the method began."""

    was_run = False
    is_transient = True


class Overload(CallError):
    """The server's lane is full."""

    was_run = False
    is_transient = True


class NoChannel(CallError):
    """Every call channel is in use."""

    was_run = False
    is_transient = True


class Disconnected(CallError, ConnectionResetError):
    """The connection was lost; the method may have run."""

    is_transient = True


class PeerRestarted(CallError, ConnectionResetError):
    """The server restarted during the call; the method may have run."""

    is_transient = True


class Unreachable(CallError, ConnectionRefusedError):
    """No server answers at the address."""

    was_run = False
    is_transient = True


class NoResources(CallError, OSError):
    """This process lacks descriptors or memory."""


class Refused(CallError, ConnectionRefusedError):
    """The server refused the session."""

    was_run = False


class VersionUnsupported(CallError):
    """The two sides have no common version of the protocol."""

    was_run = False


class NoSuchMethod(CallError, LookupError):
    """The object lacks the method."""

    was_run = False


class NoSuchObject(CallError, LookupError):
    """The object does not exist."""

    was_run = False


class BadRequest(CallError, ValueError):
    """A value of the request is out of range, or the request does not match the method."""

    was_run = False


class NotLeaseHolder(CallError, PermissionError):
    """Another client holds the lease."""

    was_run = False


class ServantFailed(CallError):
    """The method ran and failed."""

    was_run = True


class TooLarge(CallError, ValueError):
    """A message exceeds the limit of caller or server."""


class WrongBand(CallError, ValueError):
    """The priority is in none of the object's bands."""

    was_run = False


class PriorityNotAllowed(CallError, PermissionError):
    """The priority is above the ceiling of this session."""

    was_run = False


class BadReply(CallError):
    """The reply does not match the schema."""


class Cancelled(CallError):
    """The call was cancelled; the method may have run."""


class Stopped(CallError, ConnectionAbortedError):
    """The server is stopping; the method may have run."""

    is_transient = True


class MaybeLost(CallError, ConnectionResetError):
    """This oneway was not sent, and earlier ones may not have arrived."""

    is_transient = True


class WrongInterface(CallError, TypeError):
    """The object has another interface."""

    was_run = False


class StreamLost(CallError, ConnectionAbortedError):
    """The server ended the stream because its reader paused for too long."""

    was_run = True


class NotAllowed(CallError, PermissionError):
    """The server's grants do not allow the call."""

    was_run = False


class DeviceError(Error):
    """A device refused a call."""

    target: str = ""


class LeaseLost(DeviceError, PermissionError):
    """This client does not hold the device's lease: it was never acquired, ended, or was taken over."""


class LeaseHeld(DeviceError, PermissionError):
    """Another client holds the device's lease."""


class NotActive(DeviceError):
    """The device is not active."""


class EmergencyStopped(DeviceError):
    """An emergency stop is in force."""


class BadCommand(DeviceError, ValueError):
    """A command or model has a number out of range, or a mode that the device does not have."""


def of_device(name: str, text: str, target: str) -> DeviceError:
    """Makes the error of a device's refusal; for the extension."""
    error: DeviceError = globals()[name](f"{target}: {text}")
    error.target = target
    return error


def of_call(name: str, text: str, method: str, target: str) -> CallError:
    """Makes the error of a failed call; for the extension."""
    where = "".join(f"{part}: " for part in (target, method) if part)
    error: CallError = globals()[name](where + text)
    error.method = method
    error.target = target
    return error


def of_setup(what: str, why: str, remedy: str, name: str, text: str) -> Error:
    """Makes the error of a failed set-up, of the class of the call's error `name`; for the extension."""
    if name:
        error: Error = globals()[name](text)
        return error
    kind = NameNotFound if "is not bound" in what or "is not bound" in why else SetupError
    setup = kind(text)
    setup.what, setup.why, setup.remedy = what, why, remedy
    return setup


def of_recording(path: str, what: str, why: str, remedy: str) -> RecordingError:
    """Makes the error of a recording; for the extension."""
    reason = ": ".join(part for part in (path, what, why) if part)
    return RecordingError(f"{reason}; {remedy}" if remedy else reason)
