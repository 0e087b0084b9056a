"""Notebooks show devices and values as tables, with units, and no text of a server as HTML."""

from __future__ import annotations

import enum
from collections.abc import Iterator

import pytest
import rtpm
from rtpm import schemas
from rtpm.display import name_and_unit

TEXT = """
attribute "rtpm_unit";
attribute "rtpm_range";
namespace lab;
enum Mode : ubyte { Off = 0, Follow = 3 }
struct Force { x:double (rtpm_unit: "newton", rtpm_range: "-20..20"); depth_m:double; }
table Note { text:string; mode:Mode = Follow; force:Force; numbers:[double]; forces:[Force]; more:[Note]; data:[ubyte]; }
"""
_names = schemas.Schema(TEXT).names()
Force, Note = _names["Force"], _names["Note"]


@pytest.fixture(scope="module")
def lab() -> Iterator[rtpm.Laboratory]:
    with rtpm.demo() as started:
        yield started


def test_the_unit_of_a_field_is_in_its_name() -> None:
    units = {
        "position_m": ("position", "m"),
        "stiffness_newton_per_m_max": ("stiffness_max", "N/m"),
        "damping_newton_metre_s_per_rad": ("damping", "N·m·s/rad"),
        "items_per_s": ("items", "1/s"),
        "sequence": ("sequence", ""),
        "m": ("m", ""),
        "max": ("max", ""),
    }
    assert {name: name_and_unit(name) for name in units} == units


def test_values_have_units_and_ranges() -> None:
    shown = Force(1.5, 0.25)._repr_html_()
    assert "<b>Force</b>" in shown
    assert "newton, -20 to 20" in shown
    assert ">0.25<" in shown and ">m<" in shown


def test_tables_nest_and_long_lists_are_cut() -> None:
    note = Note(
        text="a",
        force=Force(1, 2),
        numbers=list(range(100)),
        forces=[Force(3, 4), Force(5, 6)],
        data=b"\x01\x02",
    )
    note.more = [Note(more=[note])]
    shown = note._repr_html_()
    assert shown.count("<table>") == shown.count("</table>") > 1
    assert "1, 2" in shown and "(3, 4), (5, 6)" in shown
    assert "0, 1, 2," in shown and "… 100 in all" in shown
    assert "Follow" in shown and "2 bytes 01 02" in shown
    assert "—" in shown  # The absent force of the inner note.


def test_texts_are_escaped() -> None:
    shown = Note(text="<script>alert('x')</script>\u202e\n")._repr_html_()
    assert "<script>" not in shown and "&lt;script&gt;" in shown
    assert "\u202e" not in shown and "\\u202e\\u000a" in shown
    assert len(Note(text="x" * 100_000)._repr_html_()) < 2_000


def test_devices_show_what_they_measure_and_take(lab: rtpm.Laboratory) -> None:
    with rtpm.device("lab/arm0") as arm:
        shown = arm._repr_html_()
        sample = arm.read()._repr_html_()
    assert "<b>lab/arm0</b>" in shown
    for text in ("x, y, z sensed and actuated", "-0.1 to 0.1", ">N<", "Force", "Wall", "1000"):
        assert text in shown, text
    assert "DialDetents" not in shown
    for text in ("<b>Sample</b>", "position_m", ">m<", "linear_m_per_s", ">m/s<", "force_newton"):
        assert text in sample, text
    with rtpm.device("lab/knob0") as knob:
        assert "DialDetents" in knob._repr_html_()
    with rtpm.device("lab/gaze0") as gaze:
        assert isinstance(gaze.description.device_class, enum.Enum)
        assert "none" in gaze._repr_html_()
        gaze.close()
        assert "lab/gaze0" in gaze._repr_html_()
