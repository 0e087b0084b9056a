"""The end of a program: what still runs is stopped before the interpreter ends its threads."""

from __future__ import annotations

import atexit
import os
import threading
import weakref
from types import TracebackType
from typing import Protocol, TypeVar

from . import _core

_C = TypeVar("_C", bound="Closing")


class Closing:
    """Closes with its `with` statement."""

    __slots__ = ()

    def close(self) -> None:
        raise NotImplementedError

    def __enter__(self: _C) -> _C:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class _Stoppable(Protocol):
    def stop(self) -> None: ...


_running: weakref.WeakSet[_Stoppable] = weakref.WeakSet()


def before_exit(running: _Stoppable) -> None:
    """Stops `running`, unless it is gone by then, before the interpreter waits for its threads."""
    _running.add(running)


def _stop_all() -> None:
    for running in list(_running):
        running.stop()


# Python waits for threads before it calls atexit's functions, which would then come too late.
getattr(threading, "_register_atexit", atexit.register)(_stop_all)
atexit.register(_core.end_threads)
os.register_at_fork(after_in_child=_core.forget_threads)
# What runs is the parent's.
os.register_at_fork(after_in_child=_running.clear)
