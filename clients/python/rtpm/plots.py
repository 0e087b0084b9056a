"""A live plot of a device: in a notebook, or in a window of matplotlib."""

from __future__ import annotations

import collections
import ctypes
import importlib
import math
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from . import endings, errors
from .devices import Device
from .display import name_and_unit, printable
from .idl.device_rtpm import DeviceClient, Sample
from .values import Vector

_READ_HZ_MAX = 30.0
#: Of one line; more points would not be seen.
_POINT_COUNT_MAX = 600
_DRAW_INTERVAL_S = 0.1
#: Seen on white and on black.
_COLOURS = ("#3b82d0", "#d9722c", "#2f9e6e", "#b05fc4", "#a0842c", "#d0506c", "#4f9aa8", "#8a8a8a")
_WIDTH, _PANEL_HEIGHT = 660, 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 36, 22, 30

_plots: dict[str, Plot] = {}


class _Panel(NamedTuple):
    """A field of the samples: a line per number."""

    title: str
    labels: Sequence[str]
    numbers: Callable[[Sample], Sequence[float]]


class _Point(NamedTuple):
    time_s: float
    #: By panel and line.
    numbers: list[Sequence[float]]


def _panel(field: str, sample: Sample) -> _Panel:
    """The panel of a field: "position_m", "position", or "position_m.z" for one number of it."""
    wanted, _, part = field.partition(".")
    names = [name for name in sample.__match_args__ if wanted in (name, name_and_unit(name)[0])]
    if not names:
        raise ValueError(
            f"a sample has no field {wanted!r}; it has {', '.join(sample.__match_args__)}"
        )
    name = names[0]
    value = getattr(sample, name)
    if isinstance(value, Vector):
        labels = list(value.__match_args__)
    elif isinstance(value, ctypes.Array):
        labels = [str(number) for number in range(len(value))]
    else:
        labels = [""]
    if part and part not in labels:
        raise ValueError(f"{name} has no {part!r}; it has {', '.join(labels)}")
    chosen = [labels.index(part)] if part else range(len(labels))

    def numbers(sample: Sample) -> Sequence[float]:
        value = getattr(sample, name)
        return [value] if labels == [""] else [value[index] for index in chosen]

    title, unit = name_and_unit(name)
    title = f"{title}.{part}" if part else title
    return _Panel(f"{title} ({unit})" if unit else title, [labels[i] for i in chosen], numbers)


class Plot(endings.Closing):
    """The newest seconds of a device's samples, until its `with` statement ends, or stop()."""

    def __init__(self, device: Device, fields: Iterable[str], seconds: float = 10.0) -> None:
        """Starts reading; see plot()."""
        if not seconds > 0:
            raise ValueError(f"seconds takes a number above 0, not {seconds}")
        self._name = device.name
        self._seconds = seconds
        # A client of its own: reading does not count as a use of the device, which keeps a lease.
        self._client = DeviceClient(device.name, node=device.node)
        sample = self._client.read(deadline=1.0)
        self._panels = [_panel(field, sample) for field in fields]
        if not self._panels:
            raise ValueError("a plot takes at least one field, such as 'position_m'")
        self._interval = max(1 / _READ_HZ_MAX, seconds / _POINT_COUNT_MAX)
        self._points: collections.deque[_Point] = collections.deque()
        self._problem = ""
        self._handle: Any = None
        self._ended = threading.Event()
        self._add(sample)
        if device.name in _plots:
            _plots[device.name].stop()
        _plots[device.name] = self
        self._thread = threading.Thread(target=self._read, name="rtpm-plot", daemon=True)
        self._thread.start()
        endings.before_exit(self)

    def svg(self) -> str:
        """The picture as it is now."""
        points = list(self._points)
        height = len(self._panels) * _PANEL_HEIGHT + _BOTTOM
        parts = [
            _draw(panel, index, points, self._seconds) for index, panel in enumerate(self._panels)
        ]
        caption = printable(f"{self._name}: {self._problem}" if self._problem else self._name)
        parts.append(_text(_LEFT, height - 4, caption))
        parts.append(_text(_WIDTH - _RIGHT, height - 4, "time (s)", "end"))
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" '
            'style="max-width:100%;height:auto" font-family="sans-serif" font-size="11" '
            f'fill="currentColor" stroke-linejoin="round">{"".join(parts)}</svg>'
        )

    def show(self) -> None:
        """Shows it: in a notebook below the running cell, else in a window until that is closed."""
        display = _notebook_display()
        if display is None:
            self._show_window()
        else:
            self._handle = display(self._bundle(), raw=True, display_id=True)

    def stop(self) -> None:
        """Ends reading. The last picture stays."""
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join()
        if _plots.get(self._name) is self:
            del _plots[self._name]

    close = stop

    def __enter__(self) -> Plot:
        if _notebook_display() is not None:
            self.show()
        return self

    def __repr__(self) -> str:
        state = "stopped" if self._ended.is_set() else f"{len(self._points)} samples"
        return f"<rtpm.Plot of {self._name}: {state}>"

    def _ipython_display_(self) -> None:
        if _notebook_display() is None:
            raise NotImplementedError  # IPython then shows the text.
        self.show()

    def _add(self, sample: Sample) -> None:
        time_s = sample.host_time_ns * 1e-9
        self._points.append(_Point(time_s, [panel.numbers(sample) for panel in self._panels]))
        while self._points[0].time_s < time_s - self._seconds:
            self._points.popleft()

    def _read(self) -> None:
        due_s = 0.0
        while not self._ended.wait(self._interval):
            try:
                self._add(self._client.read(deadline=1.0))
                self._problem = ""
            except errors.Error as error:
                self._problem = str(error)
            due_s -= self._interval
            if due_s <= 0:
                due_s = _DRAW_INTERVAL_S
                self._update()
        self._update()

    def _update(self) -> None:
        if self._handle is not None:
            self._handle.update(self._bundle(), raw=True)

    def _bundle(self) -> dict[str, str]:
        return {"text/html": self.svg(), "text/plain": repr(self)}

    def _show_window(self) -> None:
        try:
            pyplot = importlib.import_module("matplotlib.pyplot")
        except ImportError:
            raise ImportError(
                "a plot outside a notebook needs matplotlib: pip install matplotlib"
            ) from None
        figure, grid = pyplot.subplots(len(self._panels), sharex=True, squeeze=False)
        axes = grid[:, 0]
        lines = []
        for panel, axis in zip(self._panels, axes, strict=True):
            axis.set_title(panel.title, loc="left", fontsize="medium")
            axis.set_xlim(-self._seconds, 0)
            lines.append([axis.plot([], [], label=label)[0] for label in panel.labels])
            if panel.labels != [""]:
                axis.legend(loc="upper left", ncols=len(panel.labels))
        axes[-1].set_xlabel("time (s)")

        def update() -> None:
            points = list(self._points)
            times = [point.time_s - points[-1].time_s for point in points]
            for index, axis in enumerate(axes):
                for number, line in enumerate(lines[index]):
                    line.set_data(times, [point.numbers[index][number] for point in points])
                axis.relim()
                axis.autoscale_view(scalex=False)
            figure.suptitle(self._problem or self._name)
            figure.canvas.draw_idle()

        update()
        timer = figure.canvas.new_timer(interval=int(_DRAW_INTERVAL_S * 1000))
        timer.add_callback(update)
        timer.start()
        pyplot.show()
        timer.stop()


def _notebook_display() -> Any:
    """IPython's display() in a notebook; None elsewhere."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if getattr(shell, "kernel", None) is None:
        return None
    return importlib.import_module("IPython.display").display


# ---- drawing ------------------------------------------------------------------------------------


def _text(x: float, y: float, text: str, anchor: str = "start", colour: str = "") -> str:
    fill = f' fill="{colour}"' if colour else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{fill}>{text}</text>'


def _ticks(low: float, high: float) -> list[float]:
    """Three to six round numbers between two others."""
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
    return [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _bounds(points: list[_Point], index: int) -> tuple[float, float]:
    """What a panel shows at least, with a margin."""
    numbers = [
        number for point in points for number in point.numbers[index] if math.isfinite(number)
    ]
    low, high = min(numbers, default=0.0), max(numbers, default=0.0)
    margin = max(0.05 * (high - low), 1e-3 * max(abs(low), abs(high)), 1e-6)
    return low - margin, high + margin


def _draw(panel: _Panel, index: int, points: list[_Point], seconds: float) -> str:
    top = index * _PANEL_HEIGHT + _TOP
    width, height = _WIDTH - _LEFT - _RIGHT, _PANEL_HEIGHT - _TOP - 16
    low, high = _bounds(points, index)
    now_s = points[-1].time_s

    def x_of(time_s: float) -> float:
        return _LEFT + width * (1 + time_s / seconds)

    def y_of(number: float) -> float:
        return top + height * (high - number) / (high - low)

    parts = [f'<text x="{_LEFT}" y="{top - 7}" font-weight="bold">{printable(panel.title)}</text>']
    grid = []
    for tick in _ticks(low, high):
        grid.append(f"M{_LEFT} {y_of(tick):.1f}h{width}")
        parts.append(_text(_LEFT - 6, y_of(tick) + 4, f"{tick:.6g}", "end"))
    for tick in _ticks(-seconds, 0):
        grid.append(f"M{x_of(tick):.1f} {top}v{height}")
        parts.append(_text(x_of(tick), top + height + 13, f"{tick:.6g}", "middle"))
    parts.append(f'<path d="{"".join(grid)}" stroke="currentColor" stroke-opacity=".18"/>')
    ends = []
    for line, label in enumerate(panel.labels):
        colour = _COLOURS[line % len(_COLOURS)]
        seen = [
            (x_of(point.time_s - now_s), y_of(point.numbers[index][line]))
            for point in points
            if math.isfinite(point.numbers[index][line])
        ]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in seen)
        parts.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"/>'
        )
        if seen and label:
            ends.append((seen[-1][1], label, colour))
    bottom = top + height + 4.0
    for y, label, colour in sorted(ends, reverse=True):
        bottom = min(y + 4, bottom)
        parts.append(_text(_LEFT + width + 6, bottom, printable(label), colour=colour))
        bottom -= 12  # So that labels do not cover each other.
    return "".join(parts)


def plot(device: Device, fields: Iterable[str], *, seconds: float = 10.0) -> Plot:
    """Plots fields of a device's samples live: the newest `seconds` seconds.

        with rtpm.plot(arm, ["position_m", "force"], seconds=5):
            time.sleep(10)

    A notebook shows it during the `with` statement, or as the last expression of a cell; elsewhere
    show() opens a window of matplotlib. A field is a sample's, with or without its unit, or one
    number of it, such as "position_m.z". A thread reads at most 30 times a second, on a connection of
    its own, and delays no native loop. A new plot of a device ends its earlier one.
    """
    return Plot(device, fields, seconds)
