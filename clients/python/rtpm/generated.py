"""Support for modules that rtpmc generates."""

from __future__ import annotations

from . import errors, schemas

#: The levels of generated modules that this version reads.
_LEVELS = range(1, 2)


def load(module: str, *, level: int, schema: str) -> None:
    """Adds the schema's classes to the generated module `module`."""
    if level not in _LEVELS:
        raise errors.Error(
            f"{module} was generated for another version of rtpm (level {level}, this version reads "
            f"{_LEVELS.start} to {_LEVELS.stop - 1}); generate it with this version's rtpmc"
        )
    schemas.load_into(module, schema)
