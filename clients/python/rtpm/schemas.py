"""Schemas: compiled in this process, with a class for each type, event and service."""

from __future__ import annotations

import sys
from typing import Any

from . import _core, asynchronous, calls, servants, values


class Schema:
    """A compiled schema and its classes."""

    def __init__(self, text: str, module: str = "rtpm.schemas") -> None:
        self.core = _core.Schema(text)
        self.layout: dict[str, Any] = self.core.layout()
        self.classes = values.Classes(self.layout, module)
        for index, kind in enumerate(self.classes.objects):
            kind._rtpm_origin_ = (self.core, index)
        self.core.set_classes(self.classes.for_extension(), self.classes.enums)
        #: The client class of each service, by its qualified name.
        self.clients: dict[str, type[calls.Client]] = {}
        #: The asynchronous client class and the servant class of each service, likewise.
        self.async_clients: dict[str, type[asynchronous.AsyncClient]] = {}
        self.servants: dict[str, type[servants.Servant]] = {}
        for index, service in enumerate(self.layout["services"]):
            self.clients[service["name"]] = calls.client_class(self, index, module)
            self.async_clients[service["name"]] = asynchronous.async_client_class(
                self, index, module
            )
            self.servants[service["name"]] = servants.servant_class(self, index, module)

    def names(self) -> dict[str, Any]:
        """All classes by the names that generated modules have for them."""
        services = [*self.clients.values(), *self.async_clients.values(), *self.servants.values()]
        return dict(self.classes.public()) | {kind.__name__: kind for kind in services}


_schemas: dict[str, Schema] = {}


def encode(value: values.Struct | values.Table) -> bytes:
    """The wire bytes of a value of a class that a schema made."""
    schema, index = type(value)._rtpm_origin_
    encoded: bytes = schema.encode(index, value)
    return encoded


def schema_of(text: str) -> Schema:
    """The schema of a text, compiled once."""
    if text not in _schemas:
        _schemas[text] = Schema(text)
    return _schemas[text]


def load_into(module: str, text: str) -> None:
    """Adds a schema's classes to a module."""
    vars(sys.modules[module]).update(Schema(text, module).names())
