"""RTPM's programs, compiled: `FOLDER` has them, and each is a command of its name."""

import os
import sys
from pathlib import Path

FOLDER = Path(__file__).parent / "bin"


def run() -> None:
    """Becomes the program that this process was started as."""
    program = FOLDER / Path(sys.argv[0]).name
    try:
        os.execv(program, [str(program), *sys.argv[1:]])
    except OSError as error:
        sys.exit(
            f"{program} can't be run: {error.strerror}. "
            "Remedy: pip install --force-reinstall rtpm-programs."
        )
