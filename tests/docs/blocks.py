"""The code blocks of a Markdown page, and how each is tested.

The words behind three backticks say it:

    sh                      run on the laboratory's machine
    sh background           started; it runs until `sh stop`, or the page's end
    sh stop                 Ctrl-C for the newest of these
    … at desk               the same on a second machine
    sh needs java           skipped, with its output, where that is not built: cpp, java, node, c
    … elsewhere             not run: it needs a right, a network or a device that no test has
    python                  run as a program
    LANGUAGE FILE           written to FILE
    text                    each line was printed by the block before; `…` stands for any text, and
                            a number for any number
    {literalinclude} FILE   a part of a file that the build compiles, or a test runs
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

#: Directives of Sphinx that show no code.
SILENT = {"toctree", "image", "figure", "note", "warning", "grid", "tab-set", "tab-item", "include"}
FENCE = re.compile(r"^(\s*)(`{3,})(\{?[\w+-]*\}?) ?(.*)$")


@dataclasses.dataclass
class Block:
    """A block: where it begins, its words, and its text."""

    line: int
    language: str
    words: list[str]
    text: str

    @property
    def directive(self) -> str | None:
        return self.language[1:-1] if self.language.startswith("{") else None

    @property
    def is_elsewhere(self) -> bool:
        return "elsewhere" in self.words

    @property
    def machine(self) -> str:
        return "desk" if self.words[-2:] == ["at", "desk"] else "lab"

    @property
    def need(self) -> str | None:
        return self.words[1] if self.words[:1] == ["needs"] else None

    @property
    def kind(self) -> str:
        """What the runner does with it."""
        words = [word for word in self.words if word not in ("at", "desk")]
        if words[:1] == ["needs"] and words[1:] in (["cpp"], ["java"], ["node"], ["c"]):
            words = []
        if self.directive is not None:
            return "directive"
        if self.is_elsewhere:
            return "elsewhere"
        if self.language == "text":
            return "text"
        if self.language == "sh" and not words:
            return "run"
        if self.language == "sh" and words in (["background"], ["stop"]):
            return words[0]
        if self.language == "python" and not words:
            return "python"
        if len(words) == 1 and re.fullmatch(r"[\w.-]+\.[a-z]+", words[0]):
            return "file"
        raise ValueError(f"line {self.line}: no test knows a block '{self.language} {self.words}'")


def blocks_of(page: Path) -> Iterator[Block]:
    lines = iter(enumerate(page.read_text("utf-8").splitlines(), 1))
    around: list[str] = []  # The fences of directives that are open: blocks inside of them count.
    for number, line in lines:
        opening = FENCE.match(line)
        if opening is None:
            continue
        indent, fence, language, rest = opening.groups()
        if around and line.strip() == around[-1]:
            around.pop()
            continue
        if language.strip("{}") in SILENT:
            around.append(fence)
            continue
        text = []
        for _, inner in lines:
            if inner.strip() == fence:
                break
            text.append(inner.removeprefix(indent))
        else:
            raise ValueError(f"line {number}: the block has no end")
        yield Block(number, language, rest.split(), "\n".join(text) + "\n")
