#!/usr/bin/env python3
"""Installs, runs, updates and purges the packages of `./dev deb` in a root of their own: see README.md.

Exit codes: 0 all holds, or nothing could be tested, which a line "[  SKIPPED ]" says; 1 a check failed.
"""

from __future__ import annotations

import argparse
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from root import (
    DEMO_SECONDS_MAX,
    ENVIRONMENT,
    Failure,
    Root,
    Step,
    clear,
    expect_demo,
    found,
    make_root,
    require,
    run,
    skip,
)

TEST = "packages.system"
HERE = Path(__file__).resolve().parent
SERVICES = ("rtpm-registryd", "rtpm-eventd", "rtpm-deviced", "rtpm-console")
UNITS = (*SERVICES, "rtpm-camerad")
EXPOSURE_MAX = 3.0
# The root before RTPM: systemd, compilers for the programs that use the packages, and what
# rtpm-daemons recommends for cameras.
BASE_PACKAGES = (
    "systemd-sysv,dbus,udev,man-db,gcc,g++,cmake,make,pkg-config,default-jdk-headless,"
    "gstreamer1.0-plugins-base,gstreamer1.0-plugins-good,gstreamer1.0-plugins-ugly"
)
CAP_SYS_RESOURCE = 1 << 24


def install(root: Root, cache: Path, packages: list[Path]) -> None:
    """Installs all packages; what they need is downloaded once, into the cache."""
    archives = cache / "archives"
    archives.mkdir(exist_ok=True)
    (archives / "partial").mkdir(exist_ok=True)
    (root.folder / "packages").mkdir()
    for package in packages:
        shutil.copy(package, root.folder / "packages")
    kept = root.path("/var/cache/apt/archives")
    for archive in archives.glob("*.deb"):
        shutil.copy(archive, kept)
    with Step(f"installed {len(packages)} packages with what they need"):
        root.run(
            "apt-get -qq update && apt-get -qq -o APT::Keep-Downloaded-Packages=true install --yes "
            "--no-install-recommends /packages/*.deb"
        )
    for archive in kept.glob("*.deb"):
        shutil.move(archive, archives / archive.name)


def try_programs(root: Root) -> None:
    said = root.run("rtpm --version")
    if not re.fullmatch(r"rtpm \d+\.\d+\.\d+\n", said):
        raise Failure(f"rtpm --version says {said!r}")
    for page in ("rtpm", "rtpm-deviced", "rtpmc"):
        if "NAME" not in root.run(f"man {page}"):
            raise Failure(f"the manual page of {page} is not there")
    expect_demo(root, "rtpm demo", DEMO_SECONDS_MAX)


def try_libraries(root: Root) -> None:
    shutil.copytree(HERE / "programs", root.path("/programs"))
    root.run(
        "cd /programs && cc -Wall -Werror hello.c -o hello $(pkg-config --cflags --libs rtpm-c) && ./hello"
    )
    shutil.copytree(HERE.parent / "embed/find_package", root.path("/programs/find_package"))
    root.run(
        "cd /programs && cmake -S find_package -B build && cmake --build build && build/embedder"
    )
    root.run(
        "python3 -c 'import rtpm; print(rtpm.__version__); import importlib.metadata; "
        'assert importlib.metadata.version("rtpm") == rtpm.__version__\''
    )
    root.run("java -cp /usr/share/java/rtpm.jar /programs/Hello.java")
    root.run(
        "test -e /usr/lib/*/gstreamer-1.0/libgstrtpm.so && rtpm-ros2 --version && rtpm-camerad --version"
    )


def judge_units(root: Root) -> None:
    """Static checks of the units; prints how exposed each is."""
    names = " ".join(f"{unit}.service" for unit in UNITS)
    said = root.run(f"systemd-analyze verify --man=no --recursive-errors=no {names} 2>&1")
    if said.strip():
        raise Failure(f"systemd-analyze verify: {said}")
    for unit in UNITS:
        said = root.run(f"systemd-analyze security --offline=yes --no-pager {unit}.service")
        exposure = float(found(r"Overall exposure level for \S+: ([0-9.]+)", said))
        print(f"           {unit}: exposure {exposure}", flush=True)
        if exposure > EXPOSURE_MAX:
            raise Failure(
                f"{unit}.service is exposed by {exposure}, more than {EXPOSURE_MAX}:\n{said}"
            )


class Machine:
    """The root, booted by systemd-nspawn with a network of its own."""

    def __init__(self, root: Root, log: Path) -> None:
        self.root, self.log = root, log

    def __enter__(self) -> Machine:
        self.output = open(self.log, "w")
        # A session of its own, so that nothing but the container gets its signals.
        self.process = subprocess.Popen(
            [
                "systemd-nspawn",
                "--quiet",
                "--register=no",
                "--keep-unit",
                "--private-network",
                "--boot",
                "--console=pipe",
                "--resolv-conf=off",
                f"--directory={self.root.folder}",
            ],
            stdin=subprocess.DEVNULL,
            stdout=self.output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        return self

    def __exit__(self, *_: object) -> None:
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.output.close()

    def boots(self) -> bool:
        """Whether systemd comes up; where it does not, the reason is in the log."""
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and self.process.poll() is None:
            children = (
                Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
                .read_text()
                .split()
            )
            for child in children:
                try:
                    name = Path(f"/proc/{child}/comm").read_text().strip()
                except OSError:
                    continue
                if name == "systemd":
                    self.leader = child
                    if self.run("systemctl is-system-running --wait", check=False).strip() in (
                        "running",
                        "degraded",
                    ):
                        return True
            time.sleep(0.2)
        return False

    def run(self, script: str, check: bool = True) -> str:
        return run(
            "nsenter",
            "--target",
            self.leader,
            "--all",
            "/bin/bash",
            "-euc",
            script,
            check=check,
            env=ENVIRONMENT,
        )

    def expect(self, script: str, wanted: str, seconds: float = 20) -> None:
        """Waits until the script prints what is wanted."""
        deadline = time.monotonic() + seconds
        while wanted not in (said := self.run(script, check=False)):
            if time.monotonic() > deadline:
                units = " ".join(SERVICES)
                state = self.run(
                    f"systemctl status --no-pager {units}; journalctl --no-pager -n 60", check=False
                )
                raise Failure(
                    f"after {seconds} s {script!r} says {said!r}, not {wanted!r}:\n{state}"
                )
            time.sleep(0.2)


def try_limits(machine: Machine) -> None:
    """The unit's right to real-time scheduling, where this machine can give it."""
    effective = int(machine.run("sed -n 's/^CapEff:\t//p' /proc/1/status"), 16)
    if not effective & CAP_SYS_RESOURCE:
        print(
            "           not tested: LimitRTPRIO= of the units, as this machine gives nobody CAP_SYS_RESOURCE",
            flush=True,
        )
        return
    limit = machine.run(
        "grep 'realtime priority' /proc/$(systemctl show -P MainPID rtpm-deviced)/limits"
    )
    if limit.split()[-2:] != ["90", "90"]:
        raise Failure(f"rtpm-deviced has not the right to real-time scheduling: {limit}")


def try_services(machine: Machine) -> None:
    services = " ".join(SERVICES)
    machine.expect(f"systemctl is-active {services} | sort | uniq -c", f"{len(SERVICES)} active")
    machine.expect("rtpm list", "lab/arm0")
    machine.expect("rtpm call lab/arm0 read", "position")
    machine.expect("systemctl is-enabled rtpm-camerad || true", "disabled")
    machine.run("systemctl start rtpm-camerad")
    machine.expect("rtpm list", "lab/cam0")
    for service in SERVICES:
        if machine.run(f"ps -o user= -p $(systemctl show -P MainPID {service})").strip() != "rtpm":
            raise Failure(f"{service} does not run as the user rtpm")
    try_limits(machine)
    machine.run(f"systemctl restart {services}")
    machine.expect("rtpm call lab/arm0 read", "position")
    for service in SERVICES:
        before = machine.run(f"systemctl show -P MainPID {service}").strip()
        machine.run(f"kill -9 {before}")
        machine.expect(
            f"[ $(systemctl show -P MainPID {service}) != {before} ] && systemctl is-active {service}",
            "active",
        )
        machine.expect("rtpm call lab/arm0 read", "position")


def later_packages(cache: Path, packages: list[Path]) -> list[Path]:
    """The same packages of a later revision, with another default in a configuration file."""
    folder = cache / "later"
    clear(folder)
    folder.mkdir()
    for package in packages:
        if not package.name.startswith(("rtpm_", "rtpm-daemons_")):
            continue
        name, version, _ = package.name.split("_")
        upstream, revision = version.rsplit("-", 1)
        content = folder / name
        run("dpkg-deb", "--raw-extract", package, content)
        control = content / "DEBIAN/control"
        control.write_text(control.read_text().replace(version, f"{upstream}-{int(revision) + 1}"))
        if name == "rtpm-daemons":
            with open(content / "etc/rtpm/devices.toml", "a") as file:
                file.write("# A line of the next version.\n")
        run("dpkg-deb", "--build", "--root-owner-group", "-Zgzip", "-z1", content, folder)
        clear(content)
    return sorted(folder.glob("*.deb"))


def update(root: Root, cache: Path, packages: list[Path]) -> None:
    own = "# A line of the administrator.\n"
    with open(root.path("/etc/rtpm/devices.toml"), "a") as file:
        file.write(own)
    later = later_packages(cache, packages)
    for package in later:
        shutil.move(package, root.path("/packages") / f"later-{package.name}")
    root.run(
        "apt-get -qq -o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold install --yes "
        "/packages/later-*.deb"
    )
    versions = root.run("dpkg-query --show --showformat='${Version}\\n' rtpm rtpm-daemons").split()
    if set(versions) != {package.name.split("_")[1] for package in later}:
        raise Failure(f"after the update the versions are {versions}")
    if not root.path("/etc/rtpm/devices.toml").read_text().endswith(own):
        raise Failure(
            "the update has changed /etc/rtpm/devices.toml, which an administrator had edited"
        )


def purge(root: Root, names: list[str]) -> None:
    root.run(f"apt-get -qq purge --yes {' '.join(names)}")
    shutil.rmtree(root.path("/packages"))
    shutil.rmtree(root.path("/programs"))
    # Not counted: files of the user who ran the demo, man's cache, and a plug-in of GStreamer for RTP.
    left = run(
        "find",
        root.folder,
        "-xdev",
        "-iname",
        "*rtpm*",
        "-not",
        "-path",
        f"{root.path(ENVIRONMENT['HOME'])}/*",
        "-not",
        "-path",
        f"{root.folder}/tmp/*",
        "-not",
        "-path",
        f"{root.folder}/var/cache/man/*",
        "-not",
        "-name",
        "libgstrtpmanager.so",
    ).splitlines()
    states = root.run(
        "dpkg-query --show --showformat='${Package} ${db:Status-Abbrev}\\n' | grep rtpm || true"
    )
    if left or states:
        raise Failure("a purge leaves: " + "; ".join([*left, *states.splitlines()]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--packages", type=Path, required=True, help="the folder of the packages")
    cache = parser.parse_args().packages
    packages = require(TEST, cache)
    root = make_root(cache, cache / "root", "system", BASE_PACKAGES)
    install(root, cache, packages)
    with Step("ran the programs"):
        try_programs(root)
    with Step("built programs in C, C++, Python and Java with the libraries, and ran them"):
        try_libraries(root)
    with Step("judged the units"):
        judge_units(root)
    is_booted = shutil.which("systemd-nspawn") is not None
    if is_booted:
        with (
            Step("booted, and ran, restarted and killed the services"),
            Machine(root, cache / "boot.log") as machine,
        ):
            is_booted = machine.boots()
            if is_booted:
                try_services(machine)
    with Step("updated two packages"):
        update(root, cache, packages)
    with Step("purged all packages"):
        purge(root, [package.name.split("_")[0] for package in packages])
    clear(root.folder)
    if not is_booted:
        skip(
            TEST,
            "all else holds, but no service ran: systemd-nspawn is not installed (systemd-container), or boots "
            f"nothing here, see {cache / 'boot.log'}",
        )
    print("all packages hold")


try:
    main()
except Failure as failure:
    sys.exit(f"{TEST}: {failure}")
