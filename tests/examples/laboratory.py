"""The examples' laboratory in a folder of its own, and a browser, for tests and pictures."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
#: Many times what a busy machine needs.
PATIENCE_S = 20.0


#: A node of ROS that sends velocities, forwards and to the left, each for a second.
KEYBOARD = """
import sys, time
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node("keyboard")
publisher = node.create_publisher(Twist, "cmd_vel", 10)
while publisher.get_subscription_count() == 0:
    time.sleep(0.02)
for velocity in sys.argv[1:]:
    message = Twist()
    message.linear.x, message.linear.y = map(float, velocity.split(","))
    for _ in range(20):
        publisher.publish(message)
        time.sleep(0.05)
"""

#: Pushes the pendulum of the driver for a while, and prints the torque that it applies.
PUSH = """
import rtpm
with rtpm.device("lab/pendulum") as pendulum, pendulum.command() as tip:
    for count, sample in enumerate(tip.loop(rate=200)):
        command = rtpm.Command(mode=rtpm.CommandMode.JointEffort)
        command.joints[0] = 0.1
        tip.send(command)
        if count == 400:
            break
    print("effort", sample.efforts[0])
"""


class Program:
    """A program in a process group of its own; a thread keeps its output."""

    def __init__(self, command: list[str | Path], environment: dict[str, str]) -> None:
        self.command = " ".join(str(each) for each in command[:4])
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
            start_new_session=True,
        )
        self._lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.append(line)

    @property
    def output(self) -> str:
        return "".join(self._lines)

    def wait_for(self, pattern: str) -> str:
        """Waits until the output has the pattern; returns its first group, or all of it."""

        def find() -> re.Match[str] | None:
            found = re.search(pattern, self.output)
            if found is None and self.process.poll() is not None and not self._reader.is_alive():
                raise AssertionError(f"{self.command} ended: {self.output}")
            return found

        found = wait_until(find, f"{pattern!r} of {self.command}", lambda: self.output)
        return str(found[found.re.groups and 1])

    def wait(self, seconds: float) -> str:
        """Waits until it has ended with exit code 0; returns its output."""
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.command} runs after {seconds} s: {self.output}") from None
        self._reader.join(PATIENCE_S)
        assert self.process.returncode == 0, f"{self.command}: {self.output}"
        return self.output

    def end(self) -> None:
        """Ends it and all that it has started."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(self.process.pid, number)
                self.process.wait(PATIENCE_S)
        self._reader.join(PATIENCE_S)


def wait_until(
    condition: Callable[[], Any], what: str, more: Callable[[], object] = lambda: ""
) -> Any:
    """Returns the first value of the condition that is true."""
    end = time.monotonic() + PATIENCE_S
    while not (value := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"not within {PATIENCE_S} s: {what}: {more()}")
        time.sleep(0.02)
    return value


class Laboratory:
    """examples/laboratory.toml, until the end of a `with` statement."""

    def __init__(self, programs: Path, package: Path | None = None) -> None:
        """Its programs are in the folder `programs`, RTPM's package for Python in `package`."""
        self.programs = programs
        # In /tmp, because a socket's path has at most 107 bytes.
        self.folder = Path(tempfile.mkdtemp(prefix="rtpm-examples-", dir="/tmp"))
        kept = {name: text for name, text in os.environ.items() if not name.startswith("RTPM_")}
        self.environment = kept | {
            "HOME": str(self.folder),
            "PATH": f"{programs}:{os.environ['PATH']}",
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONUNBUFFERED": "1",
            "RTPM_DEADLINE": "10s",
            "RTPM_KEYS": str(self.folder / "keys"),
            "RTPM_PROGRAMS": str(programs),
            "RTPM_REALTIME": "off",
            "RTPM_RUNTIME_FOLDER": str(self.folder),
            "XDG_RUNTIME_DIR": str(self.folder),
            "XDG_STATE_HOME": str(self.folder / "state"),
        }
        if package is not None:
            self.environment["PYTHONPATH"] = str(package)
        self._running: list[Program] = []

    def __enter__(self) -> Laboratory:
        try:
            self.start("rtpm", "up", EXAMPLES / "laboratory.toml").wait_for("examples is up")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        for program in reversed(self._running):
            program.end()
        shutil.rmtree(self.folder, ignore_errors=True)

    def start(self, program: str | Path, *arguments: str | Path) -> Program:
        path = self.programs / program if isinstance(program, str) else program
        self._running.append(Program([path, *arguments], self.environment))
        return self._running[-1]

    def run(self, program: str | Path, *arguments: str | Path, seconds: float = 30) -> str:
        """Runs it to its end, which must be in time and with exit code 0; returns its output."""
        return self.start(program, *arguments).wait(PATIENCE_S + seconds)

    def read(self, device: str) -> dict[str, Any]:
        """The newest sample."""
        sample: dict[str, Any] = json.loads(self.run("rtpm", "call", device, "read", "--json"))
        return sample

    def wait_for_name(self, name: str) -> None:
        def is_bound() -> bool:
            return self.start("rtpm", "resolve", name).process.wait(PATIENCE_S) == 0

        wait_until(is_bound, name)

    @contextlib.contextmanager
    def watch(self, device: str, rate: int = 200) -> Iterator[list[dict[str, Any]]]:
        """The samples of a device during the `with` statement, in the list when that has ended."""
        echo = self.start("rtpm", "echo", device, "--rate", str(rate), "--json")
        echo.wait_for('"sample"')
        samples: list[dict[str, Any]] = []
        yield samples
        echo.end()
        # A line that the end cuts off is no JSON.
        for line in echo.output.splitlines():
            with contextlib.suppress(ValueError):
                samples.append(json.loads(line)["sample"])


class Browser:
    """A page in Chromium, which takes commands by a pipe (Chrome DevTools Protocol)."""

    def __init__(self, chromium: str, folder: Path) -> None:
        to_browser, self._to = os.pipe()
        self._from, from_browser = os.pipe()
        profile = f"--user-data-dir={folder / 'chromium'}"
        # The protocol takes descriptor 3 for commands and 4 for answers.
        script = f'exec "$@" 3<&{to_browser} 4>&{from_browser}'
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        self._process = subprocess.Popen(
            ["bash", "-c", script, "-", chromium, *options, profile, "--remote-debugging-pipe"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(to_browser, from_browser),
            start_new_session=True,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._count = 0
        self._rest = b""
        self._session: str | None = None
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *error: object) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait(PATIENCE_S)
        os.close(self._to)
        os.close(self._from)

    def open(self, url: str, width: int = 760, height: int = 640) -> None:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", **size)
        self._call("Page.navigate", url=url)

    def value(self, expression: str) -> Any:
        """Evaluates JavaScript in the page."""
        evaluated = self._call("Runtime.evaluate", expression=expression, returnByValue=True)
        return evaluated["result"].get("value")

    def picture(self) -> bytes:
        """The page as a PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot")["data"])

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        # Ends a read of a browser that hangs.
        watchdog = threading.Timer(PATIENCE_S, os.killpg, (self._process.pid, signal.SIGKILL))
        watchdog.start()
        try:
            while True:
                while b"\0" not in self._rest:
                    part = os.read(self._from, 1 << 16)
                    assert part, f"chromium ended, or did not answer {method}"
                    self._rest += part
                text, _, self._rest = self._rest.partition(b"\0")
                answer = json.loads(text)
                if answer.get("id") == self._count:
                    assert "error" not in answer, answer
                    result: dict[str, Any] = answer["result"]
                    return result
        finally:
            watchdog.cancel()


def enter_namespace() -> bool:
    """Runs this program again in a network namespace, where the domains of DDS are nobody else's.

    Returns True there, and False where there can be none.
    """
    if "RTPM_EXAMPLES_ALONE" in os.environ:
        return True
    alone = 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"'
    namespace = ["unshare", "--net", "--map-root-user", "--", "sh", "-c", alone, "-"]
    if subprocess.run([*namespace, "true"], capture_output=True).returncode != 0:
        return False
    os.environ["RTPM_EXAMPLES_ALONE"] = "1"
    os.execvp(namespace[0], [*namespace, sys.executable, "-B", *sys.argv])


def find_chromium() -> str | None:
    names = ("chromium", "chromium-browser", "google-chrome")
    return next((path for path in map(shutil.which, names) if path), None)


def skip(reason: str) -> None:
    """Ends a test that lacks a program."""
    print("[  SKIPPED ]", reason)
    sys.exit(0)
