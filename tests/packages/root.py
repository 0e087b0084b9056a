"""Folders with a Debian system of their own, in which the tests install packages of RTPM."""

import os
import re
import shlex
import shutil
import subprocess
import time
from pathlib import Path
from typing import NoReturn

DEMO_SECONDS_MAX = 60
TOOLS = {"mmdebstrap": "mmdebstrap", "zstd": "zstd"}
ENVIRONMENT = {
    "DEBIAN_FRONTEND": "noninteractive",
    "LC_ALL": "C.UTF-8",
    "HOME": "/root",
    "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
    "TERM": "dumb",
    **{name: value for name, value in os.environ.items() if name.lower().endswith("_proxy")},
}


class Failure(Exception):
    """A check that does not hold, in a sentence."""


def skip(test: str, reason: str) -> NoReturn:
    """Ends the program; ctest shows the test as skipped."""
    print(f"[  SKIPPED ] {test}: {reason}", flush=True)
    raise SystemExit(0)


def require(test: str, packages: Path | None = None) -> list[Path]:
    """Skips the test where the packages, a right or a tool is missing; returns the packages."""
    found = sorted(packages.glob("*.deb")) if packages else []
    if packages and not found:
        skip(test, "there are no packages; run ./dev deb")
    if os.geteuid() != 0:
        skip(test, "only root can make a root for the packages; run it as root")
    for tool, package in TOOLS.items():
        if shutil.which(tool) is None:
            skip(test, f"{tool} is missing; apt-get install {package}")
    return found


def run(*command: str | Path, check: bool = True, env: dict[str, str] | None = None) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        text=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=env,
    )
    if check and done.returncode != 0:
        raise Failure(
            f"{shlex.join(map(str, command))} ended with {done.returncode}:\n"
            + "\n".join(done.stdout.splitlines()[-30:])
        )
    return done.stdout


def found(pattern: str, text: str) -> str:
    """The first group of the pattern in the text."""
    match = re.search(pattern, text)
    if match is None:
        raise Failure(f"{pattern!r} is not in:\n{text}")
    return match[1]


class Step:
    """Prints what is done and how long it took."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __enter__(self) -> None:
        self.begin = time.monotonic()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        seconds = time.monotonic() - self.begin
        print(f"[{seconds:6.1f} s] {self.text}{'' if kind is None else ': FAILED'}", flush=True)


class Root:
    """A folder with a Debian system, entered with process ids and mounts of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(self, script: str, check: bool = True) -> str:
        """Runs a shell script in the root, with the host's network; its processes end with it."""
        return run(
            "unshare",
            "--mount",
            "--pid",
            "--fork",
            "--kill-child",
            "bash",
            "-c",
            'mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" && '
            'exec chroot "$0" /bin/bash -euc "$1"',
            self.folder,
            script,
            check=check,
            env=ENVIRONMENT,
        )

    def path(self, path: str) -> Path:
        return self.folder / path.lstrip("/")


def expect_demo(root: Root, command: str, seconds_max: float) -> None:
    """The command shows the laboratory for 5 s; prints how long it took beside them."""
    begin = time.monotonic()
    # The demo runs for 5 s from when all of it serves.
    said = root.run(f"{command} --seconds 5")
    seconds = time.monotonic() - begin - 5
    if "lab/arm0" not in said or "p99" not in said:
        raise Failure(f"{command} shows no laboratory: {said}")
    print(f"           {command}: its laboratory came up and went in {seconds:.1f} s", flush=True)
    if seconds > seconds_max:
        raise Failure(f"{command} took {seconds:.0f} s, more than {seconds_max:.0f} s")


def clear(folder: Path) -> None:
    """Removes a root; --one-file-system spares what an interrupted run left mounted."""
    run("rm", "-rf", "--one-file-system", folder)


def debian_server() -> tuple[str, str]:
    """The server and the release that this machine's own packages come from."""
    name = found(r"VERSION_CODENAME=(\w+)", Path("/etc/os-release").read_text())
    lines = run(
        "apt-get",
        "indextargets",
        "--format",
        "$(REPO_URI)",
        "Created-By: Packages",
        "Component: main",
        f"Codename: {name}",
    ).split()
    return lines[0], name


def make_root(cache: Path, folder: Path, kind: str, packages: str) -> Root:
    """Unpacks a system with these packages, separated by commas, and without RTPM.

    The first time, it is made by mmdebstrap, and kept in the cache as `kind`.
    """
    clear(folder)
    base = cache / f"{kind}.tar.zst"
    made_of = cache / f"{kind}.packages"
    if not base.exists() or made_of.read_text() != packages:
        server, name = debian_server()
        with Step(f"made the root '{kind}' by mmdebstrap"):
            run(
                "mmdebstrap",
                "--quiet",
                "--variant=apt",
                *([f"--include={packages}"] if packages else []),
                name,
                f"{base}.new.tar",
                server,
            )
            run("zstd", "--quiet", "--force", "-3", "--rm", f"{base}.new.tar", "-o", base)
        made_of.write_text(packages)
    folder.mkdir(parents=True)
    with Step(f"unpacked the root '{kind}'"):
        run("tar", "--extract", "--file", base, "--directory", folder, "--exclude=./dev/*")
    shutil.copy("/etc/resolv.conf", folder / "etc/resolv.conf")
    return Root(folder)
