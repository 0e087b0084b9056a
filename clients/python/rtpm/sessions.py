"""Sessions of experiments: recordings that state who, what and how."""

from __future__ import annotations

import os
from collections.abc import Sequence
from types import TracebackType

from . import _core, endings
from .calls import Node, default_node


class Session(endings.Closing):
    """A session that is being recorded, until the end of its `with` statement."""

    def __init__(self, node: Node, core: _core.LiveRecording) -> None:
        self._node = node
        self._core = core
        #: The recording's file.
        self.path: str = core.path
        self._last: tuple[int, int, int, list[str]] | None = None
        endings.before_exit(self)

    @property
    def message_count(self) -> int:
        """Messages in the file so far."""
        return self._status()[0]

    @property
    def lost_count(self) -> int:
        """Events that were lost on their way into the file."""
        return self._status()[1]

    @property
    def missing(self) -> list[str]:
        """Sentences about what is not recorded, such as the parameters of a device that gave no answer."""
        return list(self._status()[3])

    def stop(self) -> None:
        """Ends the recording."""
        if self._last is None:
            self._last = self._core.stop()

    def close(self) -> None:
        """Ends the recording."""
        self.stop()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # The data must not look as if the session had gone well.
        if kind and self._last is None:
            self._core.annotate(f"ended by {kind.__name__}")
        self.stop()

    def _status(self) -> tuple[int, int, int, list[str]]:
        return self._core.status() if self._last is None else self._last

    def __repr__(self) -> str:
        state = "is being recorded" if self._last is None else "is over"
        return f"<rtpm.Session {self.path!r}, {state}>"


def session(
    *,
    participant: str = "",
    experiment: str = "",
    condition: str = "",
    notes: str = "",
    path: str | os.PathLike[str] = "{experiment}_{participant}_{condition}_{date}_{time}",
    devices: Sequence[str] = (),
    topics: Sequence[str] = (),
    hub: str = "rtpm/events",
    node: Node | None = None,
) -> Session:
    """Records a session of an experiment until the end of its `with` statement.

    The file has the events of `hub`, the session, and all parameters of the devices with each change.

    participant: a code, not a name. path: may have the fields of its default; a number is added to a
    name that is taken. devices, topics: only the events of these devices and types, such as
    "lab/arm0" and "lab.Touched", and trials; all if both are empty.
    """
    node = node or default_node()
    node.check()
    core = _core.LiveRecording(
        node.core,
        os.fspath(path),
        participant,
        experiment,
        condition,
        notes,
        hub,
        [*devices],
        [*topics],
    )
    return Session(node, core)
