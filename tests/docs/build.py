#!/usr/bin/env python3
"""Builds the site without a warning, and follows its links as a newcomer does.

    build.py --programs FOLDER --package FOLDER --output FOLDER [--builder linkcheck]

Sphinx is in the virtual environment that `./dev docs` and `./dev test` make.
"""

from __future__ import annotations

import argparse
import filecmp
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

TREE = Path(__file__).resolve().parents[2]
ENVIRONMENT = TREE / "build" / "docs-python"
SKIPPED = "[  SKIPPED ] needs"
CLICKS_MAX = 2
#: A reference to another site. No page has one, so that each works without a network.
FOREIGN = re.compile(r"<(?:script|link|img)[^>]*(?:src|href)=\"(?:https?:)?//[^\"]*\"")


class Links(HTMLParser):
    """The links of a page, in its text and in its navigation."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag == "a":
            self.targets += [value for name, value in attributes if name == "href" and value]


def links_of(page: Path) -> set[Path]:
    """The pages that a page leads to."""
    reader = Links()
    reader.feed(page.read_text("utf-8"))
    parts = (urlsplit(target) for target in reader.targets)
    return {
        (page.parent / unquote(each.path)).resolve()
        for each in parts
        if not each.scheme and each.path.endswith(".html")
    }


def distances(site: Path) -> dict[str, int]:
    """How many clicks each page is away from the index."""
    reached = {site / "docs" / "index.html": 0}
    newest = list(reached)
    while newest:
        found = []
        for page in newest:
            for target in links_of(page):
                if target not in reached and target.exists():
                    reached[target] = reached[page] + 1
                    found.append(target)
        newest = found
    return {str(page.relative_to(site)): count for page, count in reached.items()}


def answers() -> list[tuple[str, str]]:
    """The questions of docs/questions.md, and their pages in the site."""
    text = (TREE / "docs" / "questions.md").read_text("utf-8")
    rows = re.findall(r"^\| (.+?) \| \[.+?\]\(/(.+?)\.md\) \|$", text, re.MULTILINE)
    return [(question, f"{page}.html") for question, page in rows]


def faults_of(site: Path) -> list[str]:
    site = site.resolve()
    clicks = distances(site)
    questions = answers()
    faults = [] if len(questions) == 10 else [f"questions.md has {len(questions)} questions"]
    for question, page in questions:
        if clicks.get(page, 99) > CLICKS_MAX:
            faults.append(f"{page} answers '{question}', more than {CLICKS_MAX} clicks away")
    pages = sorted(site.rglob("*.html"))
    for path in pages:
        page = str(path.relative_to(site))
        if page not in clicks and not re.match(r"index\.|search\.|genindex|_", page):
            faults.append(f"no link leads to {page}")
        text = path.read_text("utf-8")
        if foreign := FOREIGN.search(text):
            faults.append(f"{page} needs a network: {foreign.group()}")
        if str(TREE) in text:
            faults.append(f"{page} names a folder of this machine")
    print(f"{len(pages)} pages, at most {max(clicks.values())} clicks away")
    return faults


def missing() -> str | None:
    """What the build lacks, as a text."""
    wanted, installed = TREE / "docs" / "requirements.txt", ENVIRONMENT / "installed.txt"
    if not installed.exists() or not filecmp.cmp(wanted, installed, shallow=False):
        return "Sphinx and others in build/docs-python: ./dev docs"
    return None if shutil.which("doxygen") else "the Debian package doxygen"


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--programs", type=Path, required=True)
    parser.add_argument("--package", type=Path, required=True)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--builder", default="html")
    options = parser.parse_args()
    if lack := missing():
        print(SKIPPED, lack)
        return 0
    environment = os.environ | {
        "RTPM_PROGRAMS": str(options.programs),
        "RTPM_PYTHON_PACKAGE": str(options.package),
        "RTPM_DOXYGEN_XML": str(options.output / "doxygen" / "xml"),
    }
    site = options.output / options.builder
    sphinx = [ENVIRONMENT / "bin" / "python", "-B", "-m", "sphinx", "-b", options.builder]
    arguments = ["-q", "-W", "--keep-going", "-n", "-j", "2", "-d", options.output / "doctrees"]
    done = subprocess.run(
        [*sphinx, *arguments, "-c", TREE / "docs", TREE, site],
        env=environment,
        check=False,
        timeout=900,
    )
    if done.returncode != 0 or options.builder != "html":
        return done.returncode
    faults = faults_of(site)
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
