"""Clients: objects of servers as Python objects."""

from __future__ import annotations

import contextlib
import contextvars
import inspect
import os
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NoReturn, TypeVar, cast

from . import _core, errors
from .endings import Closing

if TYPE_CHECKING:
    from .schemas import Schema

_Request = TypeVar("_Request")
_Reply = TypeVar("_Reply")
_Item = TypeVar("_Item")
_C = TypeVar("_C", bound="Client")

_forks = 0


def _note_fork() -> None:
    global _forks
    _forks += 1


os.register_at_fork(after_in_child=_note_fork)


class _Handle:
    """Belongs to one process."""

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "an rtpm.Node, and what was opened with it, belong to one process; pass the name, and open it there"
        )


class Node(_Handle):
    """This program's side of all calls: where names are looked up, and its identity."""

    def __init__(
        self,
        registry: str | None = None,
        *,
        transport: str = "auto",
        key_file: str = "",
        known_servers_file: str = "",
    ) -> None:
        """Makes a node.

        registry: a registry's URL, or "host" or "lan" to search for name services; by default the
        environment's RTPM_REGISTRY, or "host". transport: "auto", "udp", "tcp" or "shm".
        """
        self._forks = _forks
        self._core = _core.Node(
            registry if registry is not None else os.environ.get("RTPM_REGISTRY", "") or "host",
            transport,
            key_file or os.environ.get("RTPM_KEY", ""),
            known_servers_file or os.environ.get("RTPM_KNOWN_SERVERS", ""),
        )

    @property
    def is_forked(self) -> bool:
        """Whether this process was forked after the node was made: then it is the parent's."""
        return self._forks != _forks

    def check(self) -> None:
        """Raises ForkedError in a process that was forked after the node was made."""
        if self.is_forked:
            raise errors.ForkedError(
                "this node belongs to the process that this one was forked from; make an rtpm.Node here, or start "
                "processes by multiprocessing's method 'spawn'"
            )

    @property
    def core(self) -> _core.Node:
        """The extension's node."""
        self.check()
        return self._core

    def url_of(self, target: str) -> str:
        """The URL of a name; a URL stays as it is."""
        return self.core.url_of(target)

    def __repr__(self) -> str:
        return f"rtpm.Node({self._core.where!r})"


_default: Node | None = None


def default_node() -> Node:
    """The node of functions that were given none, made when it is first needed."""
    global _default
    if _default is None or _default.is_forked:
        _default = Node()
    return _default


def forget_default_node() -> None:
    """Makes the next user of the default node make it anew, by the environment as it is then."""
    global _default
    _default = None


#: What the calls of this task or thread inherit: of calling(), or of the call that a servant answers.
scope: contextvars.ContextVar[_core.CallScope | None] = contextvars.ContextVar(
    "rtpm.scope", default=None
)


@contextlib.contextmanager
def calling(
    *, priority: int | None = None, deadline: float | None = None, trace_id: int | None = None
) -> Iterator[None]:
    """Gives all calls of its `with` block a priority, a time by which they end together, a trace.

    deadline: seconds from now, in place of the methods' own deadlines, and within that of an outer
    block or of the call that a servant answers. A call's own arguments go before both. trace_id: a
    number that servants see, and pass on in their own calls.
    """
    token = scope.set(_core.CallScope(priority, deadline, trace_id, scope.get()))
    try:
        yield
    finally:
        scope.reset(token)


class _Bound(_Handle):
    """The common part of clients: a bound object of a server."""

    _rtpm_schema_: ClassVar[Any] = None
    _rtpm_service_: ClassVar[int] = 0

    def __init__(
        self, target: str, *, node: Node | None = None, deadline: float | None = None
    ) -> None:
        """Binds the object at `target`, a name or a URL, within `deadline` seconds (1)."""
        if self._rtpm_schema_ is None:
            raise TypeError("this is a base class; use a generated one, or rtpm.connect(target)")
        self._rtpm_node_ = node or default_node()
        self._rtpm_bound_: _core.Binding | None = _core.Binding(
            self._rtpm_node_.core, self._rtpm_schema_.core, self._rtpm_service_, target, deadline
        )

    @property
    def _rtpm_binding_(self) -> _core.Binding:
        self._rtpm_node_.check()
        if self._rtpm_bound_ is None:
            raise errors.Error("this client is closed")
        return self._rtpm_bound_

    def __repr__(self) -> str:
        target = "closed" if self._rtpm_bound_ is None else self._rtpm_bound_.target
        return f"<{type(self).__name__} {target}>"


class Client(_Bound):
    """An object of a server. Its class has one method per method of the service, and no others."""

    def __enter__(self: _C) -> _C:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        close(self)


def close(client: _Bound) -> None:
    """Ends a client; further calls fail. A `with` statement does it, too."""
    client._rtpm_bound_ = None


def url_of(client: _Bound) -> str:
    """The URL that a client's calls go to now."""
    return client._rtpm_binding_.url


def transport_of(client: _Bound) -> str:
    """How a client's calls go: "local", "shm", "udp" or "tcp"."""
    return client._rtpm_binding_.transport


class Stream(Closing, Generic[_Item]):
    """The items that answer a call, as an iterator. The server waits for a slow reader."""

    def __init__(self, core: _core.Stream, node: Node) -> None:
        self._node = node
        self._core = core

    def __iter__(self) -> Iterator[_Item]:
        return self

    def __next__(self) -> _Item:
        return self.next()

    def next(self, timeout: float | None = None) -> _Item:
        """The next item. Raises StopIteration after the last one, and rtpm.Timeout if none arrives in time."""
        self._node.check()
        return cast(_Item, self._core.next(timeout))

    def close(self) -> None:
        """Cancels the stream."""
        if not self._node.is_forked:
            self._core.cancel()


def many(
    method: Callable[[_Request], _Reply],
    requests: Iterable[_Request],
    *,
    priority: int | None = None,
    deadline: float | None = None,
) -> list[_Reply]:
    """Calls a client's method with each request, several at a time; returns the replies in order."""
    client: Any = getattr(method, "__self__", None)
    index = getattr(method, "_rtpm_index_", None)
    if not isinstance(client, Client) or index is None:
        raise TypeError(
            "rtpm.many takes a method of a client, such as rtpm.many(arm.get_force, requests)"
        )
    return client._rtpm_binding_.call_many(index, requests, priority, deadline, scope.get())


def _signature(method: dict[str, Any], schema: Schema) -> str:
    request = (
        ""
        if method["request"] is None
        else f"request: {schema.classes.objects[method['request']].__name__}, /, "
    )
    reply = "None" if method["reply"] is None else schema.classes.objects[method["reply"]].__name__
    if method["is_stream"]:
        reply = f"rtpm.Stream[{reply}]"
    return f"({request}*, priority=None, deadline=None) -> {reply}"


def _documentation(method: dict[str, Any]) -> str:
    facts = []
    if method["is_oneway"]:
        facts.append("Oneway: returns without a reply.")
    if method["is_idempotent"]:
        facts.append("Idempotent: it is repeated if the connection breaks.")
    if method["deadline"] is not None:
        facts.append(f"The default deadline is {method['deadline']:g} s.")
    return "\n\n".join(text for text in (method["doc"].strip(), " ".join(facts)) if text)


def signature_of(method: dict[str, Any], *, has_options: bool) -> inspect.Signature:
    """A method's signature, for those whose functions take any arguments."""
    of = inspect.Parameter
    names = ["self"] if method["request"] is None else ["self", "request"]
    kind = of.POSITIONAL_OR_KEYWORD if len(names) == 1 else of.POSITIONAL_ONLY
    parameters = [of(name, kind) for name in names]
    if has_options:
        for name in ("priority", "deadline"):
            parameters.append(of(name, of.KEYWORD_ONLY, default=None))
    return inspect.Signature(parameters)


def set_facts(function: Any, schema: Schema, index: int, method: dict[str, Any], owner: str) -> Any:
    """Gives a client's method its name and documentation."""
    name = method["attribute"]
    function.__name__ = name
    function.__qualname__ = f"{owner}.{name}"
    function.__doc__ = f"{name}{_signature(method, schema)}\n\n{_documentation(method)}".strip()
    function.__signature__ = signature_of(method, has_options=True)
    function._rtpm_index_ = index
    return function


def _method(schema: Schema, index: int, method: dict[str, Any], owner: str) -> Any:
    if method["is_stream"]:

        def call(self: Any, request: Any, priority: Any, deadline: Any) -> Any:
            core = self._rtpm_binding_.open_stream(
                index, request, priority, deadline, scope.get(), 16
            )
            return Stream(core, self._rtpm_node_)

    else:

        def call(self: Any, request: Any, priority: Any, deadline: Any) -> Any:
            return self._rtpm_binding_.call(index, request, priority, deadline, scope.get())

    function: Any
    if method["request"] is None:

        def without(
            self: Any, *, priority: int | None = None, deadline: float | None = None
        ) -> Any:
            return call(self, None, priority, deadline)

        function = without
    else:

        def with_request(
            self: Any,
            request: Any,
            /,
            *,
            priority: int | None = None,
            deadline: float | None = None,
        ) -> Any:
            return call(self, request, priority, deadline)

        function = with_request
    return set_facts(function, schema, index, method, owner)


def client_class(schema: Schema, index: int, module: str) -> type[Client]:
    """The client class of a schema's service."""
    service = schema.layout["services"][index]
    name = service["class"] + "Client"
    body: dict[str, Any] = {
        "__module__": module,
        "__doc__": service["doc"].strip() or f"A client of {service['name']}.",
        "_rtpm_schema_": schema,
        "_rtpm_service_": index,
    }
    for number, method in enumerate(service["methods"]):
        body[method["attribute"]] = _method(schema, number, method, name)
    return type(name, (Client,), body)


def connect(target: str, *, node: Node | None = None) -> Client:
    """A client of the object at `target`, a name or a URL, by the schema that its server publishes."""
    from . import schemas

    node = node or default_node()
    service, text = node.core.describe(target)
    schema = schemas.schema_of(text)
    return schema.clients[service](target, node=node)
