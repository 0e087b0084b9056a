#!/usr/bin/env python3
"""Goes a newcomer's ways on a bare Debian 12, and says how long each took.

wheels  pip install of the wheels, `rtpm demo`       needs `./dev wheel`
source  `./dev demo` in a clean checkout             compiles for minutes

Exit codes: 0 all holds, or nothing could be tested, which a line "[  SKIPPED ]" says; 1 a check failed.
"""

import argparse
import os
import shutil
import sys
from pathlib import Path

from root import (
    DEMO_SECONDS_MAX,
    Failure,
    Root,
    Step,
    clear,
    expect_demo,
    make_root,
    require,
    run,
    skip,
)

SOURCE = Path(__file__).resolve().parents[2]


def trust_this_machines_proxy(root: Root) -> None:
    """Lets pip in the root reach PyPI as it does here."""
    certificates = os.environ.get("PIP_CERT")
    if certificates:
        shutil.copy(certificates, root.path("/certificates"))
        root.path("/etc/pip.conf").write_text("[global]\ncert = /certificates\n")


def try_wheels(root: Root, wheels: list[Path]) -> None:
    root.path("/wheels").mkdir()
    for wheel in wheels:
        shutil.copy(wheel, root.path("/wheels"))
    with Step("installed python3-venv"):
        root.run(
            "apt-get -qq update && apt-get -qq install --yes --no-install-recommends python3-venv"
        )
    trust_this_machines_proxy(root)
    with Step("pip install *.whl"):
        root.run("python3 -m venv /lab && /lab/bin/pip install --quiet /wheels/*.whl")
    expect_demo(root, "/lab/bin/rtpm demo", DEMO_SECONDS_MAX)


def try_source(root: Root) -> None:
    run("git", "clone", "--quiet", SOURCE, root.path("/rtpm"))
    with Step("installed git, for a checkout"):
        root.run(
            "apt-get -qq update && apt-get -qq install --yes --no-install-recommends ca-certificates git"
        )
    expect_demo(root, "cd /rtpm && ./dev demo", 1800)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, required=True, help="where roots are kept")
    parser.add_argument(
        "--wheels", type=Path, help="the folder of the wheels; without it: of the sources"
    )
    options = parser.parse_args()
    require("packages.first_hour")
    wheels = sorted(options.wheels.glob("*.whl")) if options.wheels else []
    if options.wheels and not wheels:
        skip("packages.first_hour", "there are no wheels; run ./dev wheel")
    options.cache.mkdir(parents=True, exist_ok=True)
    root = make_root(options.cache, options.cache / "first_hour", "bare", "")
    if options.wheels:
        try_wheels(root, wheels)
    else:
        try_source(root)
    clear(root.folder)


try:
    main()
except Failure as failure:
    sys.exit(f"packages.first_hour: {failure}")
