"""A live plot reads beside all else, and tells in its picture what it can't read."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest
import rtpm


@pytest.fixture(scope="module")
def lab() -> Iterator[rtpm.Laboratory]:
    with rtpm.demo() as started:
        yield started


@pytest.fixture
def arm(lab: rtpm.Laboratory) -> Iterator[rtpm.Device]:
    with rtpm.device("lab/arm0", stall=0.3) as opened:
        yield opened


def wait_until(is_true: Callable[[], object], seconds: float = 10) -> None:
    end = time.monotonic() + seconds
    while not is_true():
        assert time.monotonic() < end, "the condition did not become true"
        time.sleep(0.01)


def lines_of(plot: rtpm.Plot) -> list[int]:
    """How many points each line has."""
    return [points.count(",") for points in re.findall(r'<polyline points="([^"]*)"', plot.svg())]


def test_a_plot_draws_what_the_device_measures(arm: rtpm.Device) -> None:
    with rtpm.plot(arm, ["position_m", "force", "position_m.z", "buttons"], seconds=0.5) as plot:
        wait_until(lambda: min(lines_of(plot)) > 5)
        assert len(lines_of(plot)) == 3 + 3 + 1 + 1
        for text in (
            ">position (m)<",
            ">force (N)<",
            ">position.z (m)<",
            ">buttons<",
            ">lab/arm0<",
        ):
            assert text in plot.svg(), text
        for label in "xyz":
            assert f">{label}<" in plot.svg()
        time.sleep(0.5)
        # Nothing older than it shows, and at most 30 readings a second.
        assert max(lines_of(plot)) <= 17
    assert repr(plot) == "<rtpm.Plot of lab/arm0: stopped>"
    picture = plot.svg()
    time.sleep(0.1)
    assert plot.svg() == picture


def test_a_new_plot_of_a_device_ends_its_earlier_one(arm: rtpm.Device) -> None:
    first = rtpm.plot(arm, ["force"])
    with rtpm.plot(arm, ["force"]) as second:
        assert "stopped" in repr(first)
        wait_until(lambda: min(lines_of(second)) > 2)


def test_wrong_fields_are_named(arm: rtpm.Device) -> None:
    with pytest.raises(ValueError, match="no field 'speed'; it has sequence, host_time_ns"):
        rtpm.plot(arm, ["speed"])
    with pytest.raises(ValueError, match="position_m has no 'w'; it has x, y, z"):
        rtpm.plot(arm, ["position_m.w"])
    with pytest.raises(ValueError, match="at least one field"):
        rtpm.plot(arm, [])
    with pytest.raises(ValueError, match="above 0"):
        rtpm.plot(arm, ["force"], seconds=0)


def test_a_plot_does_not_keep_a_lease(arm: rtpm.Device) -> None:
    tip = arm.command()
    with rtpm.plot(arm, ["force"]):
        time.sleep(2.5)  # Longer than the stall and the lease together.
        with pytest.raises(rtpm.LeaseLost):
            tip.force = (0, 0, 0)


def test_elsewhere_it_is_shown_in_a_window(
    arm: rtpm.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    with rtpm.plot(arm, ["position_m", "buttons"], seconds=5) as plot:
        monkeypatch.setattr(pyplot, "show", lambda: None)
        wait_until(lambda: min(lines_of(plot)) > 2)
        plot.show()
        top, bottom = pyplot.gcf().axes
        assert [line.get_label() for line in top.lines] == ["x", "y", "z"]
        assert len(top.lines[0].get_xdata()) > 2
        assert bottom.get_title("left") == "buttons"
        pyplot.close()


def test_the_package_needs_none_of_the_plotting_packages() -> None:
    code = (
        "import sys, rtpm\n"
        "assert not {'numpy', 'pandas', 'matplotlib', 'IPython', 'rtpm.plots'} & set(sys.modules)\n"
        "assert {'demo', 'plot', 'Plot', 'device'} < set(dir(rtpm))\n"
        "assert rtpm.plot.__module__ == 'rtpm.plots'\n"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=30).returncode == 0


@pytest.mark.parametrize("code", ["plot.svg()", "raise SystemExit", "plot.stop(); plot.stop()"])
def test_a_running_plot_does_not_keep_the_program(lab: rtpm.Laboratory, code: str) -> None:
    program = (
        "import rtpm\nplot = rtpm.plot(rtpm.device('lab/arm0'), ['force'])\nimport time\n" + code
    )
    assert subprocess.run([sys.executable, "-c", program], timeout=30).returncode == 0


def test_a_lost_device_is_told_in_the_picture(lab: rtpm.Laboratory) -> None:
    with rtpm.device("lab/gaze0") as gaze, rtpm.plot(gaze, ["orientation"]) as plot:
        lab.end()
        wait_until(lambda: re.search(r">lab/gaze0: [^<]+<", plot.svg()))
