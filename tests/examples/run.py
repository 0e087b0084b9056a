#!/usr/bin/env python3
"""Runs an example against the simulated laboratory, and checks that it does as it promises.

Arguments: the example's name; then the build's folder, the Python that has RTPM's package, and the
Python that has rclpy; for the latter two "" if there is none.
"""

from __future__ import annotations

import csv
import math
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from laboratory import (
    EXAMPLES,
    KEYBOARD,
    PATIENCE_S,
    PUSH,
    Browser,
    Laboratory,
    enter_namespace,
    find_chromium,
    skip,
    wait_until,
)

LINE_COUNT_MAX = 100
BUILD = Path(sys.argv[2])
PROGRAMS = BUILD / "bin"
PYTHON = Path(sys.argv[3])
ROS_PYTHON = Path(sys.argv[4])
NO_PACKAGE = "RTPM's package for Python is not built (RTPM_PYTHON)"


def has_python() -> bool:
    return bool(sys.argv[3]) and (BUILD / "python" / "rtpm").is_dir()


def python_laboratory() -> Laboratory:
    if not has_python():
        skip(NO_PACKAGE)
    return Laboratory(PROGRAMS, BUILD / "python")


def numbers(pattern: str, text: str) -> list[float]:
    found = re.search(pattern, text)
    assert found, text
    return [float(each) for each in found.groups()]


def check_wall(samples: list[dict[str, Any]], output: str) -> None:
    """Inside the wall the arm pushes the hand out, outside it does nothing."""
    settled = samples[len(samples) // 5 :]
    inside = [s["force_newton"]["z"] for s in settled if s["position_m"]["z"] < -0.002]
    outside = [s["force_newton"]["z"] for s in settled if s["position_m"]["z"] > 0.005]
    assert len(inside) > 20 and len(outside) > 20, (len(inside), len(outside))
    # A busy machine delays some cycles, until a command has ended.
    assert sum(force > 0.5 for force in inside) > 0.7 * len(inside), sorted(inside)
    assert sum(abs(force) < 0.1 for force in outside) > 0.7 * len(outside), sorted(outside)
    cycles, touches, depth_mm, force = numbers(
        r"(\d+) cycles.*in the wall for (\d+), ([\d.]+) mm deep and ([\d.]+) N at most", output
    )
    assert cycles > 1000 and touches > 200, output
    # Without the wall, the hand comes down to 15 mm; the force's bound is the device's.
    assert 1 < depth_mm < 15.5 and 1 < force < 10, output


def cpp_servo() -> None:
    with Laboratory(PROGRAMS) as lab:
        with lab.watch("lab/arm0") as samples:
            output = lab.run("cpp_servo", "--duration", "4s", "--realtime", "off")
        check_wall(samples, output)
        refused = subprocess.run(
            [PROGRAMS / "cpp_servo", "--device", "lab/nothing"],
            env=lab.environment,
            capture_output=True,
            text=True,
            timeout=30,
        )
        assert refused.returncode == 1 and "lab/nothing" in refused.stderr, refused


def python_servo() -> None:
    with python_laboratory() as lab, lab.watch("lab/arm0") as samples:
        output = lab.run(PYTHON, EXAMPLES / "python_servo.py", "--seconds", "4")
    check_wall(samples, output)


def two_arms() -> None:
    with (
        Laboratory(PROGRAMS) as lab,
        lab.watch("lab/arm0") as first,
        lab.watch("lab/arm1") as second,
    ):
        output = lab.run("two_arms", "--duration", "5s", "--realtime", "off")
    way_mm, apart_mm = numbers(r"moved ([\d.]+) mm .* ([\d.]+) mm from lab/arm0", output)
    assert way_mm > 10 and apart_mm < 10, output
    # The same, as another program sees it: of each sample the one of the other arm nearest in time.
    apart, unbalanced = [], []
    for here in first:
        there = min(second, key=lambda each: abs(each["host_time_ns"] - here["host_time_ns"]))
        if abs(there["host_time_ns"] - here["host_time_ns"]) < 3e6:
            apart.append(math.dist(here["position_m"].values(), there["position_m"].values()))
            unbalanced.append(abs(here["force_newton"]["z"] + there["force_newton"]["z"]))
    begin = len(apart) // 3  # The force begins softly.
    assert begin > 70, len(apart)
    near = sum(distance < 0.005 for distance in apart[begin:])
    assert near > 0.8 * len(apart[begin:]), apart
    # As much as the hand pushes the second arm, that pushes the hand.
    balanced = sum(force < 0.15 for force in unbalanced[begin:])
    assert balanced > 0.8 * len(unbalanced[begin:]), unbalanced


def event_correlation() -> None:
    with python_laboratory() as lab:
        example = lab.start(PYTHON, EXAMPLES / "event_correlation.py", "--seconds", "60")
        example.wait_for(r"looked at \d")
        example.wait_for("no touch that was looked at")
        example.process.send_signal(signal.SIGINT)
        output = example.wait(PATIENCE_S)
    pairs = re.findall(r"looked at ([\d.]+) degrees down, ([-+][\d.]+) ms apart", output)
    assert pairs and all(float(down) > 2 and abs(float(ms)) <= 20 for down, ms in pairs), output
    pair_count, timeout_count = numbers(r"(\d+) touches were looked at; (\d+) timeouts", output)
    assert pair_count == len(pairs), output
    assert timeout_count == output.count("no touch that was looked at") > 0, output


def camera_beside_arm() -> None:
    if not (PROGRAMS / "rtpm-camerad").exists():
        skip("rtpm-camerad is not built")
    with python_laboratory() as lab:
        frames = lab.folder / "frames"
        lab.wait_for_name("lab/cam0")
        with lab.watch("lab/arm0") as samples:
            lab.run(PYTHON, EXAMPLES / "camera_beside_arm.py", frames, "--seconds", "4")
        rows = list(csv.DictReader((frames / "frames.csv").open()))
        pictures = [(frames / row["file"]).read_bytes() for row in rows]
    assert len(rows) > 40, len(rows)
    assert all(picture.startswith(b"\xff\xd8") for picture in pictures)
    assert min(float(row["z_m"]) for row in rows) < 0 < max(float(row["z_m"]) for row in rows)
    # The arm is where another program has seen it at that time; the hand is slower than 0.2 m/s.
    compared = 0
    for row in rows:
        time_ns = 1e9 * float(row["time_s"])
        sample = min(samples, key=lambda each: abs(each["host_time_ns"] - time_ns))
        apart_s = abs(sample["host_time_ns"] - time_ns) / 1e9
        place = [float(row[name]) for name in ("x_m", "y_m", "z_m")]
        distance_m = math.dist(place, sample["position_m"].values())
        assert distance_m < 0.2 * apart_s + 1e-3, (row, sample)
        compared += apart_s < 0.01
    assert compared > len(rows) // 2, (compared, len(rows))
    # The hand presses the button every two seconds.
    assert {row["button"] for row in rows} == {"0", "1"}


def remote_wall() -> None:
    with python_laboratory() as lab:
        output = lab.run(PYTHON, EXAMPLES / "remote_wall.py", "--delays", "40", "--seconds", "4.5")
    row = r" +([\d.]+) mm +([\d.]+) N/m +([-+][\d.]+) mJ +([\d.]+)%"
    deepest_mm, _, energy_mj, braked = numbers("40 ms" + row, output)
    own_mm, own_stiffness, own_mj, own_braked = numbers("own loop" + row, output)
    # The remote wall lets the hand in, and feeds it, until the device's guard brakes that.
    assert deepest_mm > own_mm + 0.5 and (energy_mj > 30 or braked > 20), output
    assert abs(own_stiffness - 600) < 60 and own_mm < 7, output
    assert own_mj < 15 and own_braked < 5, output


def stiffness_experiment() -> None:
    with python_laboratory() as lab:  # The example has one of its own.
        output = lab.run(PYTHON, EXAMPLES / "stiffness_experiment.py", "--seed", "3", seconds=60)
    trials, percent = numbers(r"(\d+) trials, threshold at 71 % right: ([\d.]+) % of", output)
    # The subject's own is 8 %; these are some 30 answers that depend on chance.
    assert trials > 20 and 8 / 4 < percent < 8 * 4, output


def web_page() -> None:
    page = BUILD / "examples" / "page"
    if not (page / "rtpm").is_dir():
        skip("RTPM's package for TypeScript is not built")
    chromium = find_chromium()
    if chromium is None:
        skip("chromium is not installed")
    assert chromium is not None
    token = "token-of-the-test-of-examples"
    with Laboratory(PROGRAMS) as lab:
        lab.environment["RTPM_CONSOLE_TOKEN"] = token
        console = lab.start("rtpm-console", "--port", "0", "--incidents", "none", "--page", page)
        url = console.wait_for(r"(http://\S+)")
        lab.start("cpp_servo", "--duration", "60s", "--realtime", "off")
        with Browser(chromium, lab.folder) as browser:

            def text(name: str) -> str:
                return str(browser.value(f"document.getElementById('{name}')?.textContent"))

            def number(name: str) -> float:
                found = re.search(r"(-?[\d.]+) ", text(name))
                return float(found[1]) if found else math.nan

            def is_drawn() -> bool:
                data = (
                    "document.getElementById('plot').getContext('2d').getImageData(0, 0, 880, 170)"
                )
                return bool(browser.value(f"{data}.data.some((each) => each > 0)"))

            browser.open(f"{url}web_page.html?token={token}")
            wait_until(
                lambda: "simulated arm" in text("name"), "the model", lambda: text("problem")
            )
            wait_until(lambda: number("position") > 5, "the arm above the wall")
            wait_until(lambda: number("force") > 0.5, "the force of the wall")
            wait_until(is_drawn, "a curve above the wall")
            assert text("problem") == ""
            browser.value("document.getElementById('stop').click()")
            stopped = 1 << 13  # Of a sample's faults.
            wait_until(lambda: lab.read("lab/arm0")["faults"] & stopped, "the emergency stop")
            browser.open(f"{url}web_page.html")
            wait_until(lambda: "token" in text("problem"), "why there is nothing to see")


def ros2_teleoperation() -> None:
    if not (PROGRAMS / "rtpm-ros2").exists():
        skip("rtpm-ros2 is not built: it needs cyclonedds-dev")
    if not sys.argv[4]:
        skip("RTPM_ROS_PYTHON names no Python with rclpy; ./dev test installs one")
    if not enter_namespace():
        skip("no network namespace can be made here")
    with Laboratory(PROGRAMS) as lab:
        lab.environment["ROS_DOMAIN_ID"] = "17"
        lab.start("rtpm-ros2", "--command", "lab/arm1").wait_for("bridging")
        node = lab.start(ROS_PYTHON, EXAMPLES / "ros2_teleoperation.py")
        node.wait_for("the arm is there")
        assert abs(lab.read("lab/arm1")["position_m"]["z"]) < 0.01
        publisher = lab.start(ROS_PYTHON, "-c", KEYBOARD, "1,0")
        wait_until(lambda: lab.read("lab/arm1")["position_m"]["z"] < -0.03, "the arm goes forwards")
        publisher.end()
        place = lab.read("lab/arm1")["position_m"]
        assert abs(place["x"]) < 0.01 and abs(place["y"]) < 0.01, place
        assert node.process.poll() is None, node.output


def driver_plugin() -> None:
    plugin = BUILD / "examples" / "driver_plugin.so"
    with Laboratory(PROGRAMS, BUILD / "python" if has_python() else None) as lab:
        checked = lab.run("rtpm-deviced", "--check", plugin)
        assert " 0 of " in " " + checked.splitlines()[-1], checked
        options: list[str | Path] = ["--device-pendulum-driver", plugin, "--stops", "none"]
        lab.start("rtpm-deviced", "--devices", "pendulum", *options).wait_for(
            "serving lab/pendulum"
        )
        assert "Example pendulum" in lab.run("rtpm", "info", "lab/pendulum")
        angles = [lab.read("lab/pendulum")["joints"][0] for _ in range(20)]
        # It swings by less than a radian to either side, and its energy falls.
        assert max(angles) - min(angles) > 0.02 and max(map(abs, angles)) < 1.01, angles
        if has_python():
            effort = numbers(r"effort ([\d.]+)", lab.run(PYTHON, "-c", PUSH))[0]
            assert abs(effort - 0.1) < 0.01, effort
        refused = lab.start("rtpm-deviced", "--check", plugin, "--check-arguments", "port=x")
        assert refused.process.wait(30) != 0
        refused.wait_for("the pendulum takes no arguments")


def check_length(name: str) -> None:
    """The example is short enough to be read at once."""
    files = list(EXAMPLES.glob(f"{name}.*"))
    assert files, name
    for file in files:
        count = len(file.read_text().splitlines())
        assert count <= LINE_COUNT_MAX, f"{file.name} has {count} lines"


def main() -> None:
    name = sys.argv[1]
    # A shell may have had it ignored, also by the programs that this one starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    check_length(name)
    globals()[name]()


if __name__ == "__main__":
    main()
