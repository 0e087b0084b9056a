"""Runs the tools of bench/tools as a person would, for their tests."""

import contextlib
import os
import pathlib
import subprocess
import sys
import tempfile
from typing import NamedTuple

HERE = pathlib.Path(__file__).resolve().parent
TOOLS = HERE.parents[3] / "bench" / "tools"


class End(NamedTuple):
    """How a tool ended."""

    code: int
    output: str
    errors: str

    def one_sentence(self, test, code):
        """The one line that it complained in, with exit code `code`; else `test` fails."""
        test.assertEqual(self.code, code, self.errors)
        test.assertEqual(self.errors.count("\n"), 1, self.errors)
        return self.errors.rstrip("\n")


def data(name):
    """The path of a recorded file."""
    return HERE / name


def run(tool, *arguments, environment=None):
    """Runs bench/tools/<tool>.py to its end."""
    done = subprocess.run(
        [sys.executable, "-B", TOOLS / f"{tool}.py", *map(str, arguments)], timeout=60,
        capture_output=True, text=True, check=False, env={**os.environ, **(environment or {})})
    return End(done.returncode, done.stdout, done.stderr)


@contextlib.contextmanager
def file(text):
    """The path of a file that holds `text`, which is there as long as the context."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "results.jsonl"
        path.write_text(text, encoding="utf-8")
        yield path
