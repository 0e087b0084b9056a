"""Tables of HTML that notebooks show for devices and values. They take the page's own colours."""

from __future__ import annotations

import array
import ctypes
import enum
import html
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from .values import Struct, Table, Vector

if TYPE_CHECKING:
    from .devices import Device
    from .recordings import Recording

_UNITS = {
    "m": "m",
    "metre": "m",
    "s": "s",
    "ms": "ms",
    "us": "µs",
    "ns": "ns",
    "hz": "Hz",
    "rad": "rad",
    "newton": "N",
    "joule": "J",
}
_SEQUENCES = (Vector, list, tuple, array.array, ctypes.Array)
_TEXT_SIZE_MAX = 200
_ITEM_COUNT_MAX = 16
_DEPTH_MAX = 3


def name_and_unit(field: str) -> tuple[str, str]:
    """A field's name without its unit, and that: "stiffness_max" and "N/m" of "stiffness_newton_per_m_max"."""
    words = field.split("_")
    bound = [words.pop()] if words[-1] in ("max", "min") else []
    upper: list[str] = []
    lower: list[str] = []
    while len(words) > 1 and words[-1] in _UNITS:
        upper.insert(0, _UNITS[words.pop()])
        if len(words) > 1 and words[-1] == "per" and not lower:
            words.pop()
            upper, lower = [], upper
    unit = "·".join(upper)
    return "_".join(words + bound), f"{unit or '1'}/{'·'.join(lower)}" if lower else unit


def printable(value: object) -> str:
    """A text, shortened, without characters that change how others are shown; for HTML."""
    text = str(value)
    if len(text) > _TEXT_SIZE_MAX:
        text = text[:_TEXT_SIZE_MAX] + "…"
    return html.escape("".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text))


def _rows(rows: Iterable[tuple[str, str, str]]) -> str:
    """A table of a name, a value and its unit each. The values are HTML."""
    left = 'style="text-align:left;vertical-align:top"'
    cells = (
        f"<tr><th {left}>{printable(name)}</th><td {left}>{value}</td>"
        f'<td style="text-align:left;vertical-align:top;opacity:.7">{printable(unit)}</td></tr>'
        for name, value, unit in rows
    )
    return f"<table>{''.join(cells)}</table>"


def _value(value: Any, depth: int) -> str:
    if value is None:
        return "—"
    if isinstance(value, enum.Enum):
        return printable(value.name)
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (bytes, bytearray)):
        return printable(f"{len(value)} bytes {value[:_ITEM_COUNT_MAX].hex(' ')}")
    if isinstance(value, _SEQUENCES):
        items = [
            f"({_value(item, depth + 1)})"
            if isinstance(item, _SEQUENCES)
            else _value(item, depth + 1)
            for item in list(value)[:_ITEM_COUNT_MAX]
        ]
        more = f", … {len(value)} in all" if len(value) > len(items) else ""
        return ", ".join(items) + more if items else "none"
    if isinstance(value, (Struct, Table)) and depth < _DEPTH_MAX:
        return _rows(_fields(value, depth))
    return printable(value)


def _fields(value: Struct | Table, depth: int) -> Iterable[tuple[str, str, str]]:
    for name in value.__match_args__:
        unit = value._rtpm_units_.get(name) or name_and_unit(name)[1]
        yield name, _value(getattr(value, name), depth + 1), unit


def value_html(value: Struct | Table) -> str:
    """A value's fields, with their units."""
    return f"<b>{printable(type(value).__name__)}</b>{_rows(_fields(value, 0))}"


# ---- devices ------------------------------------------------------------------------------------


def _range(low: float, high: float) -> str:
    return "without end" if low == high else f"{low:g} to {high:g}"


def _models(description: Any) -> list[str]:
    """The local models that the device's own loop renders."""
    names = []
    if description.stiffness_newton_per_m_max > 0:
        names = ["Wall", "Sphere", "Box", "Spring", "AffineField", "Friction", "Detents"]
    if any(joint.effort_max > 0 for joint in description.joints):
        names.append("DialDetents")
    return names


def _axes(axes: Iterable[Any]) -> str:
    groups: dict[str, list[str]] = {}
    for axis in axes:
        does = [
            word
            for word, is_so in (("sensed", axis.is_sensed), ("actuated", axis.is_actuated))
            if is_so
        ]
        groups.setdefault(" and ".join(does) or "not used", []).append(axis.name)
    return "; ".join(f"{', '.join(names)} {does}" for does, names in groups.items())


def _facts(device: Device) -> Iterable[tuple[str, object, str]]:
    told = device.description
    low, high = told.workspace_low_m, told.workspace_high_m
    yield "class", told.device_class.name, ""
    yield "serial number", told.serial, ""
    yield "frame", told.frame, ""
    yield "axes", _axes(told.axes) or "none", ""
    for axis, from_m, to_m in zip("xyz", low, high, strict=True):
        if from_m < to_m:
            yield f"workspace, {axis}", _range(from_m, to_m), "m"
    for name, number, unit in (
        ("position resolution", told.position_resolution_m * 1e6, "µm"),
        ("rate", told.rate_hz, "Hz"),
        ("force, at most", told.force_newton_max, "N"),
        ("torque, at most", told.torque_newton_metre_max, "N·m"),
        ("stiffness, at most", told.stiffness_newton_per_m_max, "N/m in its own loop"),
        ("damping", told.damping_newton_s_per_m, "N·s/m"),
        ("speed, at most", told.velocity_m_per_s_max, "m/s"),
        ("turning speed, at most", told.velocity_rad_per_s_max, "rad/s"),
    ):
        if number > 0:
            yield name, f"{number:.4g}", unit
    yield "commands", ", ".join(mode.name for mode in told.modes) or "none", ""
    if told.modes:
        yield "a command holds, at most", f"{told.hold_us_max / 1e3:g}", "ms"
        yield "then its force ends within", f"{told.ramp_us / 1e3:g}", "ms"
    yield "local models", ", ".join(_models(told)) or "none", ""
    yield "buttons", ", ".join(told.buttons) or "none", ""
    for kind, inputs in (
        ("analog", told.analogs),
        ("output", told.outputs),
        ("joint", told.joints),
    ):
        for item in inputs:
            yield f"{kind} {item.name}", _range(item.low, item.high), item.unit.removeprefix("1")


def device_html(device: Device) -> str:
    """A device's description: what it measures and takes, with units and limits."""
    facts = ((name, printable(value), unit) for name, value, unit in _facts(device))
    return f"<b>{printable(device.name)}</b>: {printable(device.description.model)}{_rows(facts)}"


def recording_html(recording: Recording) -> str:
    """A recording's topics, with their types and counts."""
    rows = (
        (name, printable(topic.type or "no type"), str(topic.count))
        for name, topic in recording.topics.items()
    )
    return f"<b>{printable(recording.path)}</b>: {recording.duration:.1f} s{_rows(rows)}"
