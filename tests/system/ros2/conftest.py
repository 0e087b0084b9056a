"""A laboratory of RTPM's own programs, and a node of the real rclpy beside it.

Run in a network namespace of its own (CMakeLists.txt): domain and ports are nobody else's there.
"""

import json
import os
import pathlib
import signal
import subprocess
import time

import pytest

PROGRAMS = pathlib.Path(os.environ["RTPM_PROGRAMS"])
PATIENCE_S = 60.0


def wait_until(condition, what, seconds=PATIENCE_S):
    """Returns the first true value of the condition."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {seconds:g} s: {what}")


class Program:
    """A program whose output is kept; ended by SIGTERM."""

    def __init__(self, folder, name, *arguments):
        self.log = folder / f"{name}-{time.monotonic_ns()}.log"
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                [PROGRAMS / name, *arguments], stdout=log, stderr=subprocess.STDOUT
            )

    def text(self):
        return self.log.read_text()

    def wait_for(self, words):
        def is_there():
            assert self.process.poll() is None, self.text()
            return words in self.text()

        wait_until(is_there, f"{words!r} in {self.text()!r}")
        return self

    def end(self, how=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.process.wait(PATIENCE_S)


class Laboratory:
    def __init__(self, folder):
        self.folder = folder
        self.running = []
        self.start("rtpm-registryd", "--port", "0").wait_for("rtpm://")

    def start(self, name, *arguments):
        program = Program(self.folder, name, *arguments)
        self.running.append(program)
        return program

    def start_devices(self, names="arm0,knob0"):
        last = f"serving lab/{names.split(',')[-1]}"
        arguments = ["--port", "0", "--devices", names, "--serve-events"]
        return self.start("rtpm-deviced", *arguments).wait_for(last)

    def start_bridge(self, *arguments):
        return self.start("rtpm-ros2", *arguments).wait_for("bridging to ROS 2 domain 17")

    def rtpm(self, *arguments):
        done = subprocess.run(
            [PROGRAMS / "rtpm", *arguments], capture_output=True, text=True, timeout=PATIENCE_S
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def read(self, device):
        return json.loads(self.rtpm("call", device, "read", "--json"))

    def end(self):
        for program in reversed(self.running):
            assert program.end() not in (-signal.SIGSEGV, -signal.SIGABRT), program.text()


@pytest.fixture
def laboratory(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("RTPM_REALTIME", "off")
    # The schema's 10 ms of a read are for loops, and shorter than some pauses of a busy machine.
    monkeypatch.setenv("RTPM_DEADLINE", "10s")
    tmp_path.chmod(0o700)
    started = Laboratory(tmp_path)
    yield started
    started.end()


class Ros:
    """A node of rclpy, spun by whoever waits."""

    def __init__(self):
        import rclpy

        self.rclpy = rclpy
        self.context = rclpy.Context()
        self.context.init()
        self.node = rclpy.create_node("checker", context=self.context)
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def spin(self, seconds=0.0):
        end = time.monotonic() + seconds
        self.executor.spin_once(timeout_sec=0.02)
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)

    def wait_until(self, condition, what, seconds=PATIENCE_S):
        def spun():
            self.spin()
            return condition()

        return wait_until(spun, what, seconds)

    def collect(self, kind, topic, is_latched=False):
        from rclpy.qos import DurabilityPolicy, QoSProfile

        received = []
        quality = QoSProfile(depth=1000)
        if is_latched:
            quality = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(kind, topic, received.append, quality)
        return received

    def end(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()


@pytest.fixture
def ros():
    node = Ros()
    yield node
    node.end()
