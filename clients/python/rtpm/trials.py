"""Trials of experiments and marks, as events that recordings, pages and exports have."""

from __future__ import annotations

import time
from types import TracebackType

from . import endings
from .calls import Node
from .events import Supplier
from .idl.trial_rtpm import Trial, TrialPhase


class RunningTrial(endings.Closing):
    """A trial of an experiment, from its `with` statement's beginning to its end."""

    def __init__(
        self,
        number: int,
        condition: str,
        seed: int | None,
        note: str,
        supplier: Supplier[Trial],
    ) -> None:
        #: From 1.
        self.number = number
        #: How the trial differs from others.
        self.condition = condition
        #: The subject's response, sent with the trial's end.
        self.response = ""
        #: What the trial's random numbers were made with.
        self.seed = seed
        #: Sent with the trial's end.
        self.note = ""
        self._supplier = supplier
        #: When it began, by time.monotonic_ns().
        self.begin_ns = time.monotonic_ns()
        begin = Trial(
            phase=TrialPhase.Begin, number=number, condition=condition, seed=seed, note=note
        )
        supplier.push(begin, time_ns=self.begin_ns)
        self._is_open = True

    def mark(self, note: str, *, time_ns: int | None = None) -> None:
        """Marks a moment of the trial: now, or `time_ns` by time.monotonic_ns()."""
        self._supplier.push(Trial(number=self.number, note=note), time_ns=time_ns)

    def close(self) -> None:
        """Ends the trial."""
        if not self._is_open:
            return
        self._is_open = False
        end_ns = time.monotonic_ns()
        end = Trial(
            phase=TrialPhase.End,
            number=self.number,
            condition=self.condition,
            response=self.response,
            seed=self.seed,
            note=self.note,
            duration_ns=end_ns - self.begin_ns,
        )
        self._supplier.push(end, time_ns=end_ns)
        self._supplier.close()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # The data must not look as if the trial had gone well.
        if kind and not self.note:
            self.note = f"ended by {kind.__name__}"
        self.close()

    def __repr__(self) -> str:
        state = "runs" if self._is_open else "is over"
        return f"<rtpm.RunningTrial {self.number}, {self.condition!r}, {state}>"


def trial(
    number: int,
    condition: str = "",
    *,
    seed: int | None = None,
    note: str = "",
    hub: str = "rtpm/events",
    source: int = 0,
    node: Node | None = None,
) -> RunningTrial:
    """Begins a trial of an experiment, which ends with its `with` statement; both are events rtpm.Trial.

    number: from 1. condition: how it differs from others. seed: of its random numbers. In the block set
    its `response`, and mark moments by its `mark()`. source: tells experiments at one hub apart.
    """
    if number < 1:
        raise ValueError(f"trial takes a number from 1, not {number}")
    supplier = Supplier(Trial, hub=hub, source=source, node=node)
    return RunningTrial(number, condition, seed, note, supplier)


def mark(
    note: str,
    *,
    time_ns: int | None = None,
    hub: str = "rtpm/events",
    source: int = 0,
    node: Node | None = None,
) -> None:
    """Marks a moment outside of trials, as an event rtpm.Trial: now, or `time_ns` by time.monotonic_ns()."""
    if time_ns is None:
        time_ns = time.monotonic_ns()
    with Supplier(Trial, hub=hub, source=source, node=node) as supplier:
        supplier.push(Trial(note=note), time_ns=time_ns)
