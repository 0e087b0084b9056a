"""The wheels in a new environment: those of `RTPM_WHEELS`, else wheels packed from this build."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

BUILD = Path(os.environ.get("RTPM_PROGRAMS", "")).parent
SOURCES = Path(__file__).parents[3]
IS_RELEASED = "RTPM_WHEELS" in os.environ

SYSTEM = {"ld-linux-x86-64", "libc", "libgcc_s", "libm", "libpthread", "libstdc++"}
PACKAGE = {"libflatbuffers", "liblz4", "libsodium", "libz", "libzstd"}
DEVICES = {"libcap", "libevdev", "libhidapi-hidraw", "libserialport", "libudev", "libusb"}
TERMINAL = {"libncursesw", "libtinfo"}
NAMES = {"libsqlite3"}
# Names in etcd, which wheels of a release leave out.
ETCD = set() if IS_RELEASED else {"libcurl"}
ALLOWED = SYSTEM | PACKAGE | DEVICES | TERMINAL | NAMES | ETCD


def run(*command: str | Path, timeout: float = 100) -> str:
    """The output of the command, which must succeed."""
    done = subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=timeout,
    )
    assert done.returncode == 0, f"{command} exited with {done.returncode}:\n{done.stdout}"
    return done.stdout


def pack(project: Path, content: Path, folder: Path) -> None:
    """Packs `content`, which is built, with the metadata of the project's pyproject.toml."""
    settings = {
        "wheel.cmake": "false",
        "wheel.platlib": "true",
        "wheel.packages": str(content),
        "install.strip": "true",
    }
    words = [
        word for key, value in settings.items() for word in ("--config-settings", f"{key}={value}")
    ]
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
    run(*pip, "--no-deps", "--no-build-isolation", "--wheel-dir", folder, *words, project)


def commands() -> set[str]:
    """The entry points of rtpm-programs."""
    text = (SOURCES / "clients" / "python" / "programs" / "pyproject.toml").read_text()
    return set(re.findall(r'^([\w-]+) = "rtpm_programs:run"$', text, re.MULTILINE))


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    if IS_RELEASED:
        return sorted(Path(os.environ["RTPM_WHEELS"]).glob("*.whl"))
    folder = tmp_path_factory.mktemp("wheels")
    package = folder / "rtpm"
    shutil.copytree(
        BUILD / "python" / "rtpm", package, ignore=shutil.ignore_patterns("__pycache__")
    )
    for extension in package.glob("_core*.so"):
        run("strip", extension)
    pack(SOURCES, package, folder)
    programs = folder / "rtpm_programs"
    run("cmake", "--install", BUILD, "--component", "programs", "--strip", "--prefix", programs)
    project = SOURCES / "clients" / "python" / "programs"
    shutil.copy(project / "rtpm_programs" / "__init__.py", programs)
    for program in (programs / "bin").iterdir():
        if program.name not in commands():
            program.unlink()
    pack(project, programs, folder)
    return sorted(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def environment(wheels: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of programs of a virtual environment that has the wheels."""
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", folder)
    run(folder / "bin" / "pip", "install", "--quiet", "--disable-pip-version-check", *wheels)
    return folder / "bin"


def without_network(environment: Path, *command: str) -> str:
    """Runs a program of the environment where there is no network but the loopback."""
    script = 'ip link set lo up && exec "$0" "$@"'
    has_right = subprocess.run(["unshare", "-n", "true"], stderr=subprocess.DEVNULL).returncode == 0
    if not has_right:
        pytest.skip("no right to unshare the network")
    place = {
        "HOME": str(environment),
        "PATH": f"{environment}:/usr/bin:/usr/sbin",
        "RTPM_RUNTIME_FOLDER": str(environment / "runtime"),
    }
    variables = [f"{name}={value}" for name, value in place.items()]
    return run("unshare", "-n", "env", "-i", *variables, "sh", "-c", script, *command)


def library_of(name: str) -> str:
    """The library's name without versions and the marks of auditwheel: libusb-1-9d0e975d.0.so.0."""
    return re.sub(r"(-1\.0)?(-1-[0-9a-f]{8}\.0|-[0-9a-f]{8})?\.so.*", "", name)


def libraries(program: bytes) -> set[str]:
    """The names, without versions, of what the ELF file needs."""
    dynamic = ELFFile(io.BytesIO(program)).get_section_by_name(".dynamic")
    needed = [tag.needed for tag in dynamic.iter_tags() if tag.entry.d_tag == "DT_NEEDED"]
    return {library_of(name) for name in needed}


def test_link_only_known_libraries(wheels: list[Path]) -> None:
    programs = set()
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            for name in archive.namelist():
                own = re.fullmatch(r"rtpm_programs/bin/(\S+)|rtpm/_core\.abi3\.so", name)
                if own:
                    allowed = ALLOWED if own[1] else SYSTEM | PACKAGE
                    assert libraries(archive.read(name)) <= allowed, name
                    programs.add(own[1])
                elif IS_RELEASED and re.search(r"\.libs/.", name):
                    assert library_of(Path(name).name) in ALLOWED, f"{wheel.name} has {name}"
    assert programs == commands() | {None}


@pytest.mark.skipif(not IS_RELEASED, reason="only wheels of ./dev wheel have their last names")
def test_are_for_all_pythons_and_most_systems(wheels: list[Path]) -> None:
    package, programs = (wheel.name for wheel in wheels)
    assert re.fullmatch(r"rtpm-[\d.]+-cp310-abi3-manylinux_2_\d\d_\w+\.whl", package)
    assert re.fullmatch(r"rtpm_programs-[\d.]+-py3-none-manylinux_2_\d\d_\w+\.whl", programs)


FIVE_LINES = """
import rtpm
laboratory = rtpm.demo()
with rtpm.device("lab/arm0") as arm, arm.command(hold=0.010) as tip:
    for cycle, sample in enumerate(tip.loop(rate=1000)):
        tip.force = -200 * sample.position_m
        if cycle == 100:
            break
print(arm.description.model, len(laboratory.devices))
"""


def test_run_the_first_program(environment: Path) -> None:
    # It may be told that Python was late.
    assert without_network(environment, "python", "-c", FIVE_LINES).endswith("simulated arm 4\n")


def test_show_the_laboratory(environment: Path) -> None:
    shown = without_network(environment, "rtpm", "demo", "--seconds", "2")
    assert "lab/arm0" in shown
    assert "felt as" in shown


def test_import_little_and_have_one_version(environment: Path) -> None:
    program = "import sys, rtpm; print(sorted({'numpy', 'pandas', 'IPython', 'matplotlib'} & {*sys.modules}))"
    assert run(environment / "python", "-c", program) == "[]\n"
    versions = (
        "import importlib.metadata as m; print(m.version('rtpm'), m.version('rtpm-programs'))"
    )
    package, programs = run(environment / "python", "-c", versions).split()
    assert package == programs == run(environment / "rtpm", "--version").split()[-1]
