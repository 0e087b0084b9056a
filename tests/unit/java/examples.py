#!/usr/bin/env python3
"""Runs the examples of RTPM for Java beside the haptic servo, as their texts say.

Arguments: scene (on a display) or octave; the folder of RTPM's programs, that of RTPM's classes for
Java, one to write to.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

CLIENTS = Path(__file__).parents[3] / "clients"
EXAMPLES = CLIENTS / "java" / "examples"


SKIPPED = "[  SKIPPED ] needs"
#: Debian's; another one may have no windows.
JAVA_HOME = Path("/usr/lib/jvm/java-17-openjdk-amd64")


class Servo:
    """A registry, the simulated arm and a force loop at a ball, until the end of a `with` statement."""

    def __init__(self, programs: Path, folder: Path) -> None:
        self._programs = programs
        self._running: list[subprocess.Popen[str]] = []
        self.environment = os.environ | {
            "RTPM_RUNTIME_FOLDER": str(folder),
            "RTPM_KEYS": str(folder / "no-keys"),
            "XDG_STATE_HOME": str(folder),
        }

    def __enter__(self) -> Servo:
        self.environment["RTPM_REGISTRY"] = self._serve("rtpm-registryd", "--port", "0")
        hand = str(CLIENTS / "scene" / "stroke.csv")
        self._serve("rtpm-deviced", "--port", "0", "--serve-events", "--device-arm0-hand", hand)
        return self

    def __exit__(self, *error: object) -> None:
        for program in self._running:
            program.kill()
            program.wait()

    def start(self, name: str, *arguments: str) -> subprocess.Popen[str]:
        command = [self._programs / name, *arguments, "--realtime", "off"]
        self._running.append(
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=self.environment)
        )
        return self._running[-1]

    def _serve(self, name: str, *arguments: str) -> str:
        output = self.start(name, *arguments).stdout
        assert output is not None
        for line in output:
            if found := re.search(r"rtpm://\S+", line):
                return found.group()
        raise AssertionError(f"{name} ended")

    def run(self, command: list[str | Path], **more: str) -> str:
        done = subprocess.run(
            command,
            env=self.environment | more,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        print(done.stdout, done.stderr)
        assert done.returncode == 0, done.returncode
        return done.stdout


def scene(programs: Path, classes: Path, folder: Path) -> None:
    """Compiles HapticScene, and draws on a display."""
    if not shutil.which("xvfb-run") or not (JAVA_HOME / "lib" / "libawt_xawt.so").exists():
        print(SKIPPED, "the Debian packages openjdk-17-jre, xvfb and xauth")
        return
    generated, compiled = folder / "generated", folder / "classes"
    schema = CLIENTS / "scene" / "touch.fbs"
    subprocess.run([programs / "rtpmc", "--emit", "java", "-o", generated, schema], check=True)
    javac = [JAVA_HOME / "bin" / "javac", "-Xlint:all", "-Werror"]
    paths = ["-cp", classes, "-sourcepath", generated]
    example = EXAMPLES / "HapticScene.java"
    subprocess.run([*javac, "-d", compiled, *paths, example], check=True)
    picture = folder / "scene.png"
    java = [JAVA_HOME / "bin" / "java", "-cp", f"{compiled}:{classes}"]
    with Servo(programs, folder) as servo:
        loop = ("--scene", "sphere", "--events", "rtpm/events", "--seconds", "60", "--live", "off")
        servo.start("rtpm-servo", *loop)
        printed = servo.run(["xvfb-run", "-a", *java, "HapticScene", "--picture", picture])
    seen = re.match(r"(\d+) touches, at most ([\d.]+) N", printed)
    # The hand strokes the ball for most of the 3 s.
    assert seen is not None and int(seen.group(1)) > 200 and 0.3 < float(seen.group(2)) < 20
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 3000


def octave(programs: Path, classes: Path, folder: Path) -> None:
    """Runs arm.m, with the jar that it names."""
    if not shutil.which("octave-cli"):
        print(SKIPPED, "the Debian package octave")
        return
    jar = folder / "rtpm.jar"
    make = [JAVA_HOME / "bin" / "jar", "--create", "--file", jar, "-C", classes, "."]
    subprocess.run(make, check=True)
    with Servo(programs, folder) as servo:
        printed = servo.run(
            ["octave-cli", "--quiet", EXAMPLES / "arm.m"],
            **{"RTPM_JAR": str(jar), "JAVA_HOME": str(JAVA_HOME)},
        )
    seen = re.match(r"at (\S+) \S+ \S+ mm, force (\S+) N\n", printed)
    assert seen is not None and 0 < float(seen.group(2)) <= 1.01, printed


def main() -> int:
    programs, classes, folder = (Path(each) for each in sys.argv[2:])
    if not (classes / "org").is_dir() or not JAVA_HOME.is_dir():
        print(SKIPPED, "RTPM's classes for Java, and Debian's JDK")
        return 0
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, mode=0o700)
    {"scene": scene, "octave": octave}[sys.argv[1]](programs, classes, folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
