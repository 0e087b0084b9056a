"""A simulated laboratory that belongs to this program: for first steps, lessons and tests."""

from __future__ import annotations

import atexit
import importlib
import os
import re
import subprocess
from pathlib import Path

from . import calls, errors
from .endings import Closing

_FILE = Path(__file__).with_name("laboratory.toml")
#: Ends the laboratory and removes its folder when its input ends, as it does when this process dies.
_GUARD = """
trap '' PIPE
"$0" up "$1" --detach --set "hand=$3" 2>&1
echo "= $?"
read -r _
"$0" down demo >/dev/null 2>&1
rm -rf "$2"
"""

_running: Laboratory | None = None


def _find_program(name: str) -> str:
    import shutil

    folder: str | None = os.environ.get("RTPM_PROGRAMS") or None
    if folder is None:
        try:
            folder = str(importlib.import_module("rtpm_programs").FOLDER)
        except ImportError:
            pass  # PATH remains.
    path = shutil.which(name, path=folder)
    if path is None:
        raise errors.SetupError(
            f"the program {name} is not in {folder or 'PATH'}; install RTPM's programs: "
            "pip install rtpm[demo]"
        )
    return os.path.abspath(path)


class Laboratory(Closing):
    """A registry, a hub of events and simulated devices, on free ports of this host.

    Names without a `node` are looked up here, also by programs that this one starts. It ends with its
    `with` statement, by end(), and with this program, also if that is killed.
    """

    def __init__(self, hand: str | os.PathLike[str] | None = None) -> None:
        """Starts it; see demo()."""
        import tempfile

        tool = _find_program("rtpm")
        if hand is not None:
            os.stat(hand)  # Raises FileNotFoundError or PermissionError.
        #: Where its programs keep files. The folder is removed at the end.
        self.folder = Path(tempfile.mkdtemp(prefix="rtpm-demo-"))
        # The user's own options and keys belong to other laboratories.
        self._environment = {
            name: value for name, value in os.environ.items() if not name.startswith("RTPM_")
        } | {
            "XDG_RUNTIME_DIR": str(self.folder),
            "XDG_STATE_HOME": str(self.folder),
            "RTPM_KEYS": str(self.folder / "keys"),
        }
        self._process = os.getpid()
        self._earlier = os.environ.get("RTPM_REGISTRY")
        self._started: list[subprocess.Popen[str]] = []
        #: The registry's URL.
        self.registry = ""
        # In a session of its own, so that Ctrl-C and a notebook's interrupt do not end it.
        self._guard: subprocess.Popen[str] | None = subprocess.Popen(
            [
                "/bin/sh",
                "-c",
                _GUARD,
                tool,
                _FILE,
                self.folder,
                os.path.abspath(hand) if hand else "",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=self._environment,
            start_new_session=True,
        )
        atexit.register(self.end)
        try:
            self._await()
        except BaseException:
            self.end()
            raise

    def _await(self) -> None:
        assert self._guard is not None and self._guard.stdout is not None
        text = line = ""
        while (line := self._guard.stdout.readline()) and not line.startswith("= "):
            text += line
        log = self._log()
        if line != "= 0\n":
            cause = re.search(r"\| (rtpm-.*)", log)
            raise errors.SetupError(cause[1] if cause else text.strip())
        self.registry = re.findall(r"^registry \| .*(rtpm://\S+)", log, re.M)[0]
        #: The devices' names.
        self.devices: list[str] = re.findall(r"^devices \| serving (\S+) at", log, re.M)
        self._environment["RTPM_REGISTRY"] = os.environ["RTPM_REGISTRY"] = self.registry
        calls.forget_default_node()

    def _log(self) -> str:
        file = self.folder / "rtpm" / "demo.log"
        return file.read_text("utf-8", "replace") if file.exists() else ""

    def start(self, program: str, *arguments: str | os.PathLike[str]) -> subprocess.Popen[str]:
        """Starts a program of RTPM in this laboratory, such as `lab.start("rtpm", "record", "run.mcap")`.

        It ends with the laboratory, or by its `terminate()` and `wait()`: a recording can be opened then.
        """
        if self._guard is None:
            raise errors.Error("this laboratory has ended")
        started = subprocess.Popen(
            [_find_program(program), *arguments], text=True, env=self._environment
        )
        self._started.append(started)
        return started

    def end(self) -> None:
        """Ends all its programs. Names are then looked up where they were before."""
        guard = self._guard
        if guard is None or os.getpid() != self._process:
            return  # A forked process does not end its parent's laboratory.
        self._guard = None
        atexit.unregister(self.end)
        if os.environ.get("RTPM_REGISTRY") == self.registry:
            os.environ.pop("RTPM_REGISTRY")
            if self._earlier is not None:
                os.environ["RTPM_REGISTRY"] = self._earlier
            calls.forget_default_node()
        for program in self._started:
            program.terminate()
        for program in self._started:
            try:
                program.wait(10)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()
        guard.communicate("\n")

    close = end

    def __repr__(self) -> str:
        if self._guard is None:
            return "<rtpm.Laboratory: ended>"
        return f"<rtpm.Laboratory {self.registry}: {', '.join(self.devices)}>"


def demo(hand: str | os.PathLike[str] | None = None) -> Laboratory:
    """Starts a simulated laboratory: an arm in a hand, a gaze tracker, a biometric sensor and a knob.

    `rtpm.device("lab/arm0")` then finds its arm. An earlier laboratory of this program is ended first,
    so that a notebook's cell can run again. hand: a CSV file of t_s,x_m,y_m,z_m that moves the arm.
    """
    global _running
    if _running is not None:
        _running.end()
    _running = Laboratory(hand)
    return _running
