"""Watches rtpm-ros2 with four devices at 200 Hz for a time: messages, memory, CPU time.

    tests/system/ros2/run.sh build/dev/bin build/ros/bin/python tests/system/ros2/soak.py --seconds 3600

Prints one JSON document per minute, and one at the end. Memory may grow by about 1 MiB for each of
Cyclone DDS's receiving threads, which use up buffers of that size page by page.
"""

import argparse
import json
import os
import pathlib
import tempfile
import time

from conftest import Laboratory, Ros


def status_of(process, key):
    for line in pathlib.Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1])
    raise LookupError(key)


def cpu_s(process):
    fields = pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def soak(seconds, warm_up_s, report=lambda figures: None):
    """Returns the figures of the time after the warm-up."""
    from geometry_msgs.msg import PoseStamped

    os.environ["RTPM_REALTIME"] = "off"
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_RUNTIME_DIR"] = os.environ["HOME"] = folder
        laboratory = Laboratory(pathlib.Path(folder))
        ros = Ros()
        try:
            laboratory.start_devices("arm0,gaze0,biometric0,knob0")
            bridge = laboratory.start_bridge("--tf", "--rate", "200", "--report", "10s")
            poses = ros.collect(PoseStamped, "/rtpm/lab/arm0/pose")
            ros.wait_until(lambda: poses, "poses arrive")
            ros.spin(warm_up_s)
            process = bridge.process.pid
            count = 0
            poses.clear()
            begin, cpu, rss = time.monotonic(), cpu_s(process), status_of(process, "VmRSS")
            figures = {}
            while time.monotonic() - begin < seconds:
                ros.spin(min(60.0, seconds))
                count += len(poses)
                poses.clear()
                passed = time.monotonic() - begin
                figures = {
                    "seconds": round(passed, 1),
                    "poses_per_s": round(count / passed, 1),
                    "rss_kib": status_of(process, "VmRSS"),
                    "rss_growth_kib": status_of(process, "VmRSS") - rss,
                    "threads": status_of(process, "Threads"),
                    "cpu_percent": round(100 * (cpu_s(process) - cpu) / passed, 1),
                    "bridge": bridge.text().splitlines()[-1],
                }
                report(figures)
            return figures
        finally:
            ros.end()
            laboratory.end()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--warm-up", type=float, default=30)
    given = parser.parse_args()
    print(
        json.dumps(soak(given.seconds, given.warm_up, lambda f: print(json.dumps(f), flush=True)))
    )
