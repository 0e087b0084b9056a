"""Schemas: compiled in this process, with a class for each type, event and service."""

from __future__ import annotations

import sys
from typing import Any

from . import _core, calls, values


class Schema:
    """A compiled schema and its classes."""

    def __init__(self, text: str, module: str = "rtpm.schemas") -> None:
        self.core = _core.Schema(text)
        self.layout: dict[str, Any] = self.core.layout()
        self.classes = values.Classes(self.layout, module)
        self.core.set_classes(self.classes.for_extension(), self.classes.enums)
        #: The client class of each service, by its qualified name.
        self.clients: dict[str, type[calls.Client]] = {}
        for index, service in enumerate(self.layout["services"]):
            self.clients[service["name"]] = calls.client_class(self, index, module)

    def names(self) -> dict[str, Any]:
        """All classes by the names that generated modules have for them."""
        named: list[tuple[str, str, Any]] = [(name, values.short_name(name), kind) for name, kind in self.classes.public()]
        for name, client in self.clients.items():
            named.append((name, client.__name__, client))
        counts: dict[str, int] = {}
        for _, short, _ in named:
            counts[short] = counts.get(short, 0) + 1
        return {
            values.python_name(short if counts[short] == 1 else name.replace(".", "_")): kind for name, short, kind in named
        }


_schemas: dict[str, Schema] = {}


def schema_of(text: str) -> Schema:
    """The schema of a text, compiled once."""
    if text not in _schemas:
        _schemas[text] = Schema(text)
    return _schemas[text]


def load_into(module: str, text: str) -> None:
    """Adds a schema's classes to a module."""
    vars(sys.modules[module]).update(Schema(text, module).names())
