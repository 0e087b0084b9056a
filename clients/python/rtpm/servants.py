"""Servants: objects of Python that others call.

A lane in C++ receives the calls, checks and orders them; workers of Python run them, the most urgent
first. Python never runs on the lane: its lock has no priorities.
"""

from __future__ import annotations

import abc
import asyncio
import contextvars
import inspect
import logging
import threading
from collections.abc import AsyncIterator, Awaitable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from . import _core, endings
from .calls import Node, default_node, scope, signature_of

if TYPE_CHECKING:
    from .schemas import Schema

_log = logging.getLogger("rtpm")

_KINDS = ("BadRequest", "Failed", "NoSuchObject", "NotAllowed", "NotLeaseHolder", "Overload")


class Refusal(Exception):
    """Refuses a call, when a servant's method raises it, with a sentence for the caller.

    kind: "BadRequest" (not done: a value is wrong), "Overload" (not done: too busy), "NotLeaseHolder",
    "NotAllowed", "NoSuchObject" (not done: the target is gone), or "Failed" (begun and failed). The
    sentence of "BadRequest" and "Failed" reaches the caller.
    """

    def __init__(self, text: str, kind: str = "BadRequest") -> None:
        if kind not in _KINDS:
            raise ValueError(f"kind takes {', '.join(_KINDS)}, not {kind!r}")
        super().__init__(text)
        self.kind = kind


class Servant(abc.ABC):  # noqa: B024 (generated classes have the methods)
    """An object that serves calls. Derive from a generated class, such as `ArmServant`.

    Methods are ordinary or `async`; a method that answers with a stream is a generator. An exception
    other than Refusal is logged, and its text goes to the caller. Calls that a method makes inherit
    the priority and the remaining time of the call that it answers: rtpm.current_call().
    """

    _rtpm_schema_: ClassVar[Any] = None
    _rtpm_service_: ClassVar[int] = 0


class Call:
    """The call that a servant's method answers, as rtpm.current_call() returns it."""

    __slots__ = ("_job",)

    def __init__(self, job: _core.Job) -> None:
        self._job = job

    @property
    def priority(self) -> int:
        """Its priority, which calls of the method inherit."""
        return self._job.priority

    @property
    def seconds_left(self) -> float | None:
        """How long its caller still waits; None if for ever. Calls of the method end by then."""
        return self._job.seconds_left

    @property
    def is_awaited(self) -> bool:
        """False once its caller cancelled, left, or waits no longer: further work is wasted."""
        return self._job.is_awaited

    @property
    def trace_id(self) -> int:
        """A number that its caller set, 0 if none; calls of the method pass it on."""
        return self._job.trace_id

    @property
    def session(self) -> int:
        """The session of its caller: equal numbers mean the same caller."""
        return self._job.session

    @property
    def host(self) -> str:
        """The address of its caller's host; "127.0.0.1" for this host."""
        return self._job.caller_host

    @property
    def caller(self) -> str:
        """Its caller's name in the grants; empty if the server checks none, or they give none."""
        return self._job.caller_name

    def __repr__(self) -> str:
        return f"<rtpm.Call priority {self.priority}, {self.seconds_left} s left, from {self.host}>"


_call: contextvars.ContextVar[Call | None] = contextvars.ContextVar("rtpm.call", default=None)


def current_call() -> Call | None:
    """The call that this task or thread answers; None outside servants' methods."""
    return _call.get()


class Server(endings.Closing):
    """Serves objects of Python until its `with` statement ends, or stop()."""

    def __init__(
        self,
        servants: Mapping[str, Servant],
        *,
        node: Node | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        named: bool = True,
        workers: int = 1,
        queue: int = 64,
    ) -> None:
        """Serves each servant under its path, such as "lab/arm0".

        host and port: where to listen; 0 lets the system choose. named: binds the paths as names.
        workers: how many methods may run at the same time. queue: how many calls may wait for them;
        more are refused with overload.
        """
        if workers < 1:
            raise ValueError(f"workers takes 1 or more, not {workers}")
        self._node = node or default_node()
        self._servants = tuple(servants.values())
        self._paths = tuple(servants)
        self._core = _core.Server(self._node.core, host, port, queue)
        for path, servant in servants.items():
            if not isinstance(servant, Servant) or servant._rtpm_schema_ is None:
                raise TypeError(
                    f"{path}: serve takes a servant of a generated class, not {type(servant).__name__}"
                )
            self._core.add(path, servant._rtpm_schema_.core, servant._rtpm_service_)
        self._is_ending = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._loop_thread: threading.Thread | None = None
        self._loop_lock = threading.Lock()
        self._core.start(named)
        self._workers = [
            threading.Thread(target=self._work, name=f"rtpm-worker-{number}")
            for number in range(workers)
        ]
        endings.before_exit(self)
        for worker in self._workers:
            worker.start()

    def url(self, path: str) -> str:
        """The URL of a served object."""
        return self._core.url(path)

    def wait(self, timeout: float | None = None) -> None:
        """Waits for stop(), or Ctrl-C."""
        self._is_ending.wait(timeout)

    def stop(self) -> None:
        """Ends the server. Calls that still wait fail as stopped; running methods are waited for."""
        if self._is_ending.is_set() or self._node.is_forked:
            return
        self._is_ending.set()
        self._core.stop()
        for worker in self._workers:
            if worker is not threading.current_thread():
                worker.join()
        if self._loop is not None and self._loop_thread is not None:
            asyncio.run_coroutine_threadsafe(_cancel_tasks(), self._loop).result()
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._loop_thread.join()
            self._loop.close()

    close = stop

    def __repr__(self) -> str:
        return f"<rtpm.Server {', '.join(self._paths)}>"

    def _work(self) -> None:
        while not self._is_ending.is_set():
            job = self._core.take()
            if job is None:
                continue
            if not job.is_awaited:
                job.expire()
                continue
            contextvars.copy_context().run(self._run, job)

    def _run(self, job: _core.Job) -> None:
        servant = self._servants[job.servant]
        method = servant._rtpm_schema_.layout["services"][servant._rtpm_service_]["methods"][
            job.method
        ]
        function = getattr(servant, method["attribute"])
        # Tasks of `async` methods copy these.
        _call.set(Call(job))
        scope.set(job.scope)
        try:
            if method["request"] is None:
                result = function()
            else:
                request = job.request()
                if job.is_answered:
                    return
                result = function(request)
            if job.is_stream:
                self._stream(job, result, function)
            elif inspect.isawaitable(result):
                asyncio.run_coroutine_threadsafe(
                    self._finish(job, result, function), self._event_loop()
                )
            else:
                job.complete(result)
        except BaseException as error:
            self._fail(job, error, function)

    async def _finish(self, job: _core.Job, result: Awaitable[Any], function: Any) -> None:
        try:
            job.complete(await result)
        except BaseException as error:
            self._fail(job, error, function)

    def _stream(self, job: _core.Job, items: Any, function: Any) -> None:
        if isinstance(items, AsyncIterator):
            asyncio.run_coroutine_threadsafe(
                self._stream_async(job, items, function), self._event_loop()
            )
            return
        for item in items:
            if not job.write(item):
                close = getattr(items, "close", None)
                if close is not None:
                    close()
                return
        job.finish()

    async def _stream_async(self, job: _core.Job, items: AsyncIterator[Any], function: Any) -> None:
        loop = asyncio.get_running_loop()
        try:
            async for item in items:
                # A slow caller must not hold up the loop.
                if not await loop.run_in_executor(None, job.write, item):
                    return
            job.finish()
        except BaseException as error:
            self._fail(job, error, function)

    def _fail(self, job: _core.Job, error: BaseException, function: Any) -> None:
        if isinstance(error, Refusal):
            job.refuse(error.kind, str(error))
            return
        if not isinstance(error, Exception):
            job.refuse("Failed", type(error).__name__)
            raise error
        _log.error("%s failed (trace %d)", function.__qualname__, job.trace_id, exc_info=error)
        job.refuse("Failed", f"{type(error).__name__}: {error}")

    def _event_loop(self) -> asyncio.AbstractEventLoop:
        """The loop of `async` methods, made with the first of them."""
        with self._loop_lock:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                self._loop_thread = threading.Thread(
                    target=self._loop.run_forever, name="rtpm-loop"
                )
                self._loop_thread.start()
            return self._loop


async def _cancel_tasks() -> None:
    """Cancels the other tasks of this loop."""
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def serve(
    servants: Mapping[str, Servant],
    *,
    node: Node | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    named: bool = True,
    workers: int = 1,
    queue: int = 64,
) -> Server:
    """Serves objects by their paths: `with rtpm.serve({"lab/arm0": Arm()}) as server: server.wait()`."""
    return Server(
        servants, node=node, host=host, port=port, named=named, workers=workers, queue=queue
    )


def servant_class(schema: Schema, index: int, module: str) -> type[Servant]:
    """The servant class of a schema's service."""
    service = schema.layout["services"][index]
    name = service["class"] + "Servant"
    body: dict[str, Any] = {
        "__module__": module,
        "__doc__": service["doc"].strip() or f"A servant of {service['name']}.",
        "_rtpm_schema_": schema,
        "_rtpm_service_": index,
    }
    for method in service["methods"]:
        body[method["attribute"]] = _abstract(method, name)
    return type(name, (Servant,), body)


def _abstract(method: dict[str, Any], owner: str) -> Any:
    def function(self: Any, *request: Any) -> Any:
        raise NotImplementedError

    function.__name__ = method["attribute"]
    function.__qualname__ = f"{owner}.{function.__name__}"
    function.__signature__ = signature_of(method, has_options=False)  # type: ignore[attr-defined]
    function.__doc__ = method["doc"].strip() or None
    return abc.abstractmethod(function)
