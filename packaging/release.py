#!/usr/bin/env python3
"""Checks and describes a release: one version everywhere, and its parts.

release.py versions            fails unless all packages have the version of CMakeLists.txt
release.py sbom OUT [FILE …]   writes the bill of materials, CycloneDX 1.5; fails if one of the
                               programs FILE loads a library that components.json lacks
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import uuid
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
COMPONENTS = Path(__file__).with_name("components.json")
#: Parts of every system that runs C++.
SYSTEM_LIBRARIES = re.compile(r"(libc|libm|libgcc_s|libstdc\+\+|ld-linux[-\w]*|librtpm-c)\.so")
#: Where a version stands, and the pattern that finds it.
VERSIONS = (
    ("CMakeLists.txt", r"project\(rtpm VERSION (\S+)"),
    ("clients/java/pom.xml", r"<artifactId>rtpm</artifactId>\s*<version>([^<]+)</version>"),
    ("clients/typescript/package.json", r'"version": "([^"]+)"'),
    ("debian/changelog", r"^rtpm \(([^-)]+)-\d+\)"),
    ("CHANGELOG.md", r"## \[([^\]]+)\]"),
)


class Unfit(Exception):
    """The release can't be made like this; the text says why, and what to do."""


def version_in(file: str, pattern: str) -> str:
    found = re.search(pattern, (ROOT / file).read_text(), re.MULTILINE)
    if found is None:
        raise Unfit(f"{file}: no version is found. Remedy: write it as {pattern}")
    return found.group(1)


def check_versions() -> str:
    """Returns the version that all files have."""
    wanted = version_in(*VERSIONS[0])
    for file, pattern in VERSIONS[1:]:
        found = version_in(file, pattern)
        if found != wanted:
            raise Unfit(
                f"{file} has version {found}, but CMakeLists.txt has {wanted}. Remedy: write {wanted} there"
            )
    return wanted


def output_of(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def libraries_of(program: Path) -> set[str]:
    """The libraries that the program loads, without version: libsodium.so."""
    dump = output_of("objdump", "--private-headers", str(program))
    names = re.findall(r"NEEDED +(\S+?\.so)", dump)
    return {name for name in names if not SYSTEM_LIBRARIES.fullmatch(name)}


def check_libraries(programs: list[Path], components: list[dict[str, str]]) -> None:
    known = {each["library"] for each in components if "library" in each}
    for program in programs:
        if missing := sorted(libraries_of(program) - known):
            raise Unfit(
                f"{program.name} loads {', '.join(missing)}, which packaging/components.json lacks."
                " Remedy: add its name, Debian package and licence there"
            )


def component(name: str, version: str, purl: str, licence: str) -> dict[str, Any]:
    return {
        "type": "library",
        "bom-ref": f"{purl}#{name}",
        "name": name,
        "version": version,
        "licenses": [{"license": {"id": licence}}],
        "purl": purl,
    }


def named_component(entry: dict[str, str]) -> dict[str, Any]:
    """That of an entry of components.json, with the version that is installed."""
    if "pypi" in entry:
        version = metadata.version(entry["pypi"])
        return component(
            entry["name"], version, f"pkg:pypi/{entry['pypi']}@{version}", entry["licence"]
        )
    package = entry["debian"]
    try:
        version = output_of("dpkg-query", "--show", "--showformat=${Version}\n", package)
    except subprocess.CalledProcessError as error:
        raise Unfit(
            f"Debian's {package} is not installed, so its version is unknown. Remedy: ./dev setup"
        ) from error
    version = version.splitlines()[0]
    purl = f"pkg:deb/debian/{package}@{version.replace('+', '%2B').replace(':', '%3A')}"
    return component(entry["name"], version, purl, entry["licence"])


def page_components() -> list[dict[str, Any]]:
    """Those of npm that the console's page has within."""
    lock = json.loads((ROOT / "clients/console/page/package-lock.json").read_text())
    made = []
    for path, entry in sorted(lock["packages"].items()):
        if not path or entry.get("dev") or entry.get("optional"):
            continue
        name = path.rsplit("node_modules/", 1)[1]
        purl = f"pkg:npm/{name.replace('@', '%40')}@{entry['version']}"
        made.append(component(name, entry["version"], purl, entry["license"]))
    return made


def bill_of_materials(programs: list[Path]) -> dict[str, Any]:
    version = check_versions()
    entries: list[dict[str, str]] = json.loads(COMPONENTS.read_text())
    check_libraries(programs, entries)
    parts = [named_component(entry) for entry in entries] + page_components()
    # The same parts give the same number, so that two builds are alike.
    content = json.dumps([version, parts], sort_keys=True)
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, content)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "framework",
                "bom-ref": "rtpm",
                "name": "rtpm",
                "version": version,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
            }
        },
        "components": parts,
        "dependencies": [{"ref": "rtpm", "dependsOn": [part["bom-ref"] for part in parts]}],
    }


def main(arguments: list[str]) -> int:
    match arguments:
        case ["versions"]:
            print(check_versions())
        case ["sbom", out, *programs]:
            bill = bill_of_materials([Path(program) for program in programs])
            Path(out).write_text(json.dumps(bill, indent=2) + "\n")
        case _:
            print(__doc__, file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Unfit as unfit:
        print(f"release: {unfit}", file=sys.stderr)
        sys.exit(1)
