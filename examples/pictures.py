"""Makes the pictures of README.md from runs of the examples: all of them, or those that are named.

    build/python/bin/python examples/pictures.py build/dev [NAME …]

It needs matplotlib and Pillow, for web_page chromium, and for ros2_teleoperation also
`--ros-python build/ros/bin/python`.
"""

from __future__ import annotations

import argparse
import csv
import io
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("svg")
from matplotlib import pyplot
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "examples"))
from laboratory import (
    EXAMPLES,
    KEYBOARD,
    PUSH,
    Browser,
    Laboratory,
    enter_namespace,
    find_chromium,
)

PICTURES = EXAMPLES / "pictures"
SIZE_MAX = 60_000
BLUE, RED, GREEN, GREY = "#0b6bcb", "#c2410c", "#15803d", "#64748b"
WALL = "#e8edf3"

pyplot.rcParams.update(
    {
        "axes.edgecolor": GREY,
        "axes.labelcolor": "#1b2733",
        "axes.spines.right": False,
        "axes.spines.top": False,
        "figure.constrained_layout.use": True,
        "figure.figsize": (7.2, 3.2),
        "font.family": "sans-serif",
        "font.size": 10,
        "legend.frameon": False,
        "lines.linewidth": 1.5,
        "svg.fonttype": "none",
        "svg.hashsalt": "rtpm",
        "xtick.color": GREY,
        "ytick.color": GREY,
    }
)


class Pictures:
    """One method for each example."""

    def __init__(self, build: Path, ros_python: Path | None) -> None:
        self.build = build.resolve()
        self.ros_python = ros_python and ros_python.absolute()
        self.python = Path(sys.executable)

    def laboratory(self) -> Laboratory:
        return Laboratory(self.build / "bin", self.build / "python")

    def cpp_servo(self) -> None:
        with self.laboratory() as lab, lab.watch("lab/arm0", 100) as samples:
            lab.run("cpp_servo", "--duration", "6s")
        figure, (above, below) = pyplot.subplots(2, sharex=True)
        times = seconds(samples)
        above.axhspan(-20, 0, color=WALL)
        above.plot(times, [1000 * each["position_m"]["z"] for each in samples], color=BLUE)
        above.set(ylabel="z, mm", ylim=(-8, 30))
        above.text(0.05, -6.5, "wall", color=GREY)
        below.plot(times, [each["force_newton"]["z"] for each in samples], color=RED)
        below.set(xlabel="time, s", ylabel="force, N", xlim=(0, times[-1]))
        save(figure, "cpp_servo")

    def python_servo(self) -> None:
        with self.laboratory() as lab, lab.watch("lab/arm0", 50) as samples:
            lab.run(self.python, EXAMPLES / "python_servo.py", "--seconds", "7")
        figure, axes = pyplot.subplots()
        # Past the soft start.
        depth = [-1000 * each["position_m"]["z"] for each in samples[25:]]
        force = [each["force_newton"]["z"] for each in samples[25:]]
        axes.axvspan(0, 20, color=WALL)
        axes.plot([0, 6], [0, 3.6], color=GREY, linestyle="--", linewidth=1)
        axes.text(4.1, 2.05, "600 N/m", color=GREY)
        axes.plot(depth, force, ".", color=BLUE, markersize=4)
        axes.text(-2.8, 0.2, "above the wall", color=GREY)
        axes.set(xlabel="depth in the wall, mm", ylabel="force, N", xlim=(-3, 6), ylim=(-0.1, 3.7))
        save(figure, "python_servo")

    def event_correlation(self) -> None:
        with (
            self.laboratory() as lab,
            lab.watch("lab/gaze0", 50) as gaze,
            lab.watch("lab/arm0", 100) as arm,
        ):
            begin_ns = time.monotonic_ns()
            output = lab.run(self.python, EXAMPLES / "event_correlation.py", "--seconds", "13")
        # Python takes a moment to start; the example's times begin behind that.
        pairs = [float(each) for each in re.findall(r"([\d.]+) s  touch with", output)]
        silences = [float(each) for each in re.findall(r"([\d.]+) s  no touch", output)]
        forces = [(s["host_time_ns"], s["force_newton"]["z"]) for s in arm]
        touches = [b[0] for a, b in zip(forces, forces[1:], strict=False) if a[1] < 0.05 <= b[1]]
        start_ns = min((t - 1e9 * pairs[0] for t in touches), key=lambda t: abs(t - begin_ns))
        figure, (above, below) = pyplot.subplots(2, sharex=True)
        down = [-2 * 57.3 * each["orientation"]["x"] for each in gaze]
        above.axhspan(2.3, 14, color=WALL)
        above.plot(seconds(gaze, start_ns), down, color=GREEN)
        above.set(ylabel="gaze,\ndegrees down", ylim=(-14, 14))
        below.plot(seconds(arm, start_ns), [force for _, force in forces], color=BLUE)
        for axes in (above, below):
            for at in pairs:
                axes.axvline(at, color=RED, linewidth=1)
        below.plot(silences, [3.4] * len(silences), "|", color=GREY, markersize=9)
        below.plot(pairs, [3.4] * len(pairs), "o", color=RED, markersize=6)
        below.text(-0.1, 3.4, "hub", ha="right", va="center", color=GREY)
        below.set(xlabel="time, s", ylabel="force, N", xlim=(0, 13), ylim=(-0.1, 3.9))
        save(figure, "event_correlation")

    def camera_beside_arm(self) -> None:
        with self.laboratory() as lab:
            folder = lab.folder / "frames"
            lab.wait_for_name("lab/cam0")
            lab.run(self.python, EXAMPLES / "camera_beside_arm.py", folder, "--seconds", "4.5")
            rows = list(csv.DictReader((folder / "frames.csv").open()))
            frames = [Image.open(folder / row["file"]).convert("RGB") for row in rows]
        times = [float(row["time_s"]) - float(rows[0]["time_s"]) for row in rows]
        figure, axes = pyplot.subplots(figsize=(7.2, 3.4))
        axes.plot(times, [1000 * float(row["z_m"]) for row in rows], ".-", color=BLUE, markersize=3)
        axes.set(xlabel="time, s", ylabel="z of the arm, mm", xlim=(0, 4.5))
        axes.set_yticks([0, 20])
        # Eight frames, each above the instant of its capture; one of them while the button is down.
        pressed = [t for t, row in zip(times, rows, strict=True) if row["button"] == "1"]
        for n in range(8):
            at = 0.25 + n / 2 + (pressed[0] + 0.05 - 0.25) % 0.5
            chosen = min(range(len(times)), key=lambda i: abs(times[i] - at))
            left = times[chosen]
            axes.plot(
                [left, left], [1000 * float(rows[chosen]["z_m"]), 34], color=GREY, linewidth=0.7
            )
            axes.imshow(
                frames[chosen], extent=(left - 0.23, left + 0.23, 34, 58), aspect="auto", zorder=2
            )
        axes.plot(pressed, [-15] * len(pressed), "s", color=RED, markersize=4)
        axes.text(0.05, -15, "button", color=RED, va="center")
        axes.set(xlim=(0, 4.5), ylim=(-18, 62))
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=110)
        Image.open(buffer).convert("RGB").quantize(96).save(
            PICTURES / "camera_beside_arm.png", optimize=True
        )

    def two_arms(self) -> None:
        with (
            self.laboratory() as lab,
            lab.watch("lab/arm0", 100) as first,
            lab.watch("lab/arm1", 100) as second,
        ):
            lab.run("two_arms", "--duration", "6s")
        figure, axes = pyplot.subplots()
        begin_ns = first[0]["host_time_ns"]
        for samples, colour, width, name in (
            (first, BLUE, 5, "lab/arm0, in the hand"),
            (second, RED, 1.5, "lab/arm1"),
        ):
            for axis, at in (("z", 0), ("x", -70)):
                places = [at + 1000 * each["position_m"][axis] for each in samples]
                label = name if axis == "z" else None
                axes.plot(
                    seconds(samples, begin_ns),
                    places,
                    color=colour,
                    linewidth=width,
                    label=label,
                    alpha=0.35 if width > 2 else 1,
                )
        axes.set_yticks([-70, 0], ["x", "z"])
        axes.plot([6.6, 6.6], [-60, -40], color=GREY)
        axes.text(6.65, -50, "20 mm", color=GREY, va="center")
        axes.set(xlabel="time, s", xlim=(0, 7.2))
        axes.legend(loc="upper right", ncols=2, bbox_to_anchor=(1, 1.15))
        save(figure, "two_arms")

    def remote_wall(self) -> None:
        figure, panels = pyplot.subplots(1, 3, sharey=True, sharex=True)
        links: tuple[list[str], ...] = (["0"], ["20"], [])
        titles = ("link without delay", "20 ms there and back", "device's own loop")
        for axes, link, title in zip(panels, links, titles, strict=True):
            with self.laboratory() as lab:
                # The wall in the device's own loop comes last, after the one behind the link.
                delays = link or ["0"]
                example = EXAMPLES / "remote_wall.py"
                with lab.watch("lab/arm0", 250) as samples:
                    lab.run(self.python, example, "--delays", *delays, "--seconds", "5")
            half = len(samples) // 2
            part = samples[half - 1100 : half - 100] if link else samples[-1100:-50]
            depth = [-1000 * each["position_m"]["z"] for each in part]
            force = [each["force_newton"]["z"] for each in part]
            axes.axvspan(0, 20, color=WALL)
            axes.plot(depth, force, color=RED if link == ["20"] else BLUE, linewidth=1)
            axes.set_title(title, fontsize=10)
            axes.set(xlim=(-8, 17), ylim=(-0.3, 9.3), xlabel="depth, mm")
        panels[0].set_ylabel("force, N")
        save(figure, "remote_wall")

    def stiffness_experiment(self) -> None:
        with self.laboratory() as lab:
            lab.environment["MATPLOTLIBRC"] = str(lab.folder)
            style = "figure.figsize: 7.2, 3.2\nfigure.constrained_layout.use: True\nfont.size: 10\n"
            style += "axes.spines.top: False\naxes.spines.right: False\nsvg.fonttype: none\n"
            style += "svg.hashsalt: rtpm\n"
            (lab.folder / "matplotlibrc").write_text(style)
            picture = PICTURES / "stiffness_experiment.svg"
            experiment = EXAMPLES / "stiffness_experiment.py"
            lab.run(self.python, experiment, "--seed", "20", "--plot", picture, seconds=60)
        # The time of the run makes no difference between two runs.
        text = re.sub(r"\s*<dc:date>.*?</dc:date>", "", picture.read_text())
        picture.write_text(re.sub(r" +$", "", text, flags=re.M))

    def web_page(self) -> None:
        chromium = find_chromium()
        assert chromium is not None, "chromium is not installed"
        token = "token-of-the-pictures"
        with self.laboratory() as lab:
            lab.environment["RTPM_CONSOLE_TOKEN"] = token
            page = self.build / "examples" / "page"
            console = lab.start(
                "rtpm-console", "--port", "0", "--incidents", "none", "--page", page
            )
            url = console.wait_for(r"(http://\S+)")
            lab.start("cpp_servo", "--duration", "60s")
            with Browser(chromium, lab.folder) as browser:
                browser.open(f"{url}web_page.html?token={token}", height=560)
                time.sleep(11.5)
                picture = browser.picture()
        Image.open(io.BytesIO(picture)).convert("RGB").quantize(64).save(
            PICTURES / "web_page.png", optimize=True
        )

    def ros2_teleoperation(self) -> None:
        assert self.ros_python is not None, "--ros-python names a Python with rclpy"
        # A namespace cannot be left again, so this picture is made by a process of its own.
        assert enter_namespace(), "no network namespace can be made here"
        with self.laboratory() as lab:
            lab.environment.pop("PYTHONPATH")
            lab.environment["ROS_DOMAIN_ID"] = "17"
            lab.start("rtpm-ros2", "--command", "lab/arm1").wait_for("bridging")
            node = lab.start(self.ros_python, EXAMPLES / "ros2_teleoperation.py")
            node.wait_for("the arm is there")
            keys = ("1,0", "0,-1", "-1,0", "0,1")
            with lab.watch("lab/arm1", 50) as samples:
                lab.run(self.ros_python, "-c", KEYBOARD, *keys)
        figure, axes = pyplot.subplots(figsize=(7.2, 3.6))
        right = [1000 * each["position_m"]["x"] for each in samples]
        forwards = [-1000 * each["position_m"]["z"] for each in samples]
        axes.plot(right, forwards, color=BLUE)
        axes.plot(right[0], forwards[0], "o", color=RED)
        for x, y, key in ((-2, 25, "linear.x 1"), (17, 54, "linear.y −1"), (53, 25, "linear.x −1")):
            axes.text(x, y, key, color=GREY, ha="right" if x < 0 else "left", va="center")
        axes.text(17, -5, "linear.y 1", color=GREY, va="center")
        axes.set(xlabel="to the right, mm", ylabel="forwards, mm", xlim=(-30, 80), ylim=(-9, 58))
        axes.set_aspect("equal")
        save(figure, "ros2_teleoperation")

    def driver_plugin(self) -> None:
        plugin = self.build / "examples" / "driver_plugin.so"
        options: list[str | Path] = ["--device-pendulum-driver", plugin, "--stops", "none"]
        with self.laboratory() as lab:
            lab.start("rtpm-deviced", "--devices", "pendulum", *options).wait_for("serving")
            with lab.watch("lab/pendulum", 100) as samples:
                time.sleep(2)
                lab.run(self.python, "-c", PUSH)
                time.sleep(2)
        figure, (above, below) = pyplot.subplots(2, sharex=True)
        times = seconds(samples)
        above.plot(times, [57.3 * each["joints"][0] for each in samples], color=BLUE)
        above.set(ylabel="angle, degrees")
        below.plot(times, [each["efforts"][0] for each in samples], color=RED)
        below.set(xlabel="time, s", ylabel="torque, N m", xlim=(0, times[-1]))
        save(figure, "driver_plugin")


def seconds(samples: Iterable[dict[str, Any]], begin_ns: float | None = None) -> list[float]:
    times = [each["host_time_ns"] for each in samples]
    return [(each - (times[0] if begin_ns is None else begin_ns)) / 1e9 for each in times]


def save(figure: Any, name: str) -> None:
    """Writes the figure as SVG, in which numbers have two decimals."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    pyplot.close(figure)
    text = re.sub(r"\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", buffer.getvalue())
    (PICTURES / f"{name}.svg").write_text(re.sub(r" +$", "", text, flags=re.M))


def main() -> None:
    made = [name for name in vars(Pictures) if not name.startswith("_") and name != "laboratory"]
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("build", type=Path, help="the build's folder, such as build/dev")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(made))
    parser.add_argument("--ros-python", type=Path, help="a Python with rclpy")
    options = parser.parse_args()
    if unknown := set(options.names) - set(made):
        parser.error(f"no picture is named {', '.join(unknown)}; there are: {', '.join(made)}")
    names = options.names or made
    if len(names) == 1:
        make: Callable[[], None] = getattr(Pictures(options.build, options.ros_python), names[0])
        make()
    else:
        ros = ["--ros-python", options.ros_python] if options.ros_python else []
        for name in names:
            subprocess.run([sys.executable, "-B", __file__, options.build, name, *ros], check=True)
    for file in PICTURES.glob("*.*"):
        if file.stat().st_size > SIZE_MAX:
            print(f"{file.name} has {file.stat().st_size} bytes, more than {SIZE_MAX}")


if __name__ == "__main__":
    main()
