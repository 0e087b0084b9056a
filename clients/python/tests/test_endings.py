"""A program ends at once, with its own exit code and without a crash, whatever it has open."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import pytest
from conftest import Laboratory

BEFORE = """
import asyncio, atexit, gc, itertools, multiprocessing, os, signal, socket, subprocess, sys, threading, time
"""

ARM = """
import rtpm
node = rtpm.Node(sys.argv[1])
arm = rtpm.connect("lab/arm0", node=node)

def read():
    return arm.read(deadline=10)  # Enough for a busy machine.

read()

def daemon(work, count=1):
    for _ in range(count):
        threading.Thread(target=work, daemon=True).start()
    time.sleep(0.1)

def acquired():
    return rtpm.device("lab/arm0", node=node, patience=20, stall=60).command(patience=20)

silent = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # Takes requests and answers none.
silent.bind(("127.0.0.1", 0))
nobody = f"rtpm://127.0.0.1:{silent.getsockname()[1]}/x"
"""

ECHO = '''
from rtpm import schemas
lab = schemas.Schema("""
attribute "rtpm_id"; attribute "rtpm_stream"; attribute "rtpm_event";
namespace lab;
table Text { count:uint; }
table Noted (rtpm_event: 7031) { count:uint; }
rpc_service Echo {
  at_once(Text):Text (rtpm_id: 1);
  wait(Text):Text (rtpm_id: 2);
  sleep(Text):Text (rtpm_id: 3);
  fail(Text):Text (rtpm_id: 4);
  count_up(Text):Text (rtpm_id: 5, rtpm_stream);
}
""").names()
Text = lab["Text"]
is_ending = threading.Event()

class Echo(lab["EchoServant"]):
    def at_once(self, request):
        return request
    def wait(self, request):
        is_ending.wait(0.001 * request.count)
        return request
    async def sleep(self, request):
        await asyncio.sleep(0.001 * request.count)
        return request
    def fail(self, request):
        raise KeyError(request.count)
    def count_up(self, request):
        for number in itertools.count():
            yield Text(count=number % 1000)

server = rtpm.serve({"x": Echo()}, node=node, named=False, workers=6)
echo = lab["EchoClient"](server.url("x"), node=node)
echo.at_once(Text(), deadline=10)
'''


class Ending(NamedTuple):
    code: str
    status: int = 0
    #: A pattern of the whole standard error.
    error: str = ""
    before: str = ARM


ENDINGS = {
    "with an open client": Ending(""),
    "with a call in atexit": Ending("atexit.register(read)"),
    "with a call in atexit that was registered before the import": Ending(
        ARM + "opened.append(arm)",
        before="opened = []\natexit.register(lambda: opened[0].read(deadline=10))",
    ),
    "with a connection made in atexit": Ending(
        "atexit.register(lambda: rtpm.connect('lab/arm0', node=node).read(deadline=10))"
    ),
    "with a held lease": Ending("tip = acquired()\ntip.force = (0, 0, 0)"),
    "with a running servo": Ending("tip = acquired()\nservo = tip.render()"),
    "in a loop's middle": Ending(
        "tip = acquired()\nloop = tip.loop(500)\nnext(loop)\nnext(loop)",
        error=r"(lab/arm0: 500 Hz loop: .* skipped .*\n)?",
    ),
    "by sys.exit in with statements": Ending(
        "with rtpm.device('lab/arm0', node=node) as arm, rtpm.events(node=node), acquired() as tip:\n"
        "    tip.force = (0, 0, 0)\n"
        "    sys.exit(3)",
        3,
    ),
    "by os._exit": Ending("tip = acquired()\nservo = tip.render()\nos._exit(4)", 4),
    "by SIGTERM": Ending(
        "tip = acquired()\nservo = tip.render()\nos.kill(os.getpid(), signal.SIGTERM)\ntime.sleep(60)",
        -signal.SIGTERM,
    ),
    "by an exception in with statements": Ending(
        "with rtpm.events(node=node) as events, acquired() as tip:\n    raise KeyError(1)",
        1,
        r"Traceback(.*\n)+KeyError: 1\n",
    ),
    "by Ctrl-C in asyncio.run": Ending(
        ECHO
        + """
async def work():
    client = lab["EchoAsyncClient"](server.url("x"), node=node)
    asyncio.get_running_loop().call_later(0.1, os.kill, os.getpid(), signal.SIGINT)
    await client.sleep(Text(count=60_000), deadline=60)
asyncio.run(work())
""",
        -signal.SIGINT,
        r"Traceback(.*\n)+KeyboardInterrupt\n",
    ),
    "in daemon threads' calls": Ending(
        "def work():\n    while True: read()\ndaemon(work, 4)",
    ),
    "in a daemon thread's call that is not answered": Ending(
        "daemon(lambda: rtpm.device(nobody, node=node, patience=60))"
    ),
    "in a daemon thread's wait": Ending(
        "def work():\n    while True: pacer.wait()\npacer = rtpm._core.Pacer(30)\ndaemon(work)"
    ),
    "in daemon threads' connecting": Ending(
        # To a server of its own: it takes the whole capacity.
        ECHO
        + """
own = rtpm.Node(transport="udp")
def work():
    while True:
        try: rtpm.connect(server.url("x"), node=own)
        except rtpm.Error: pass
daemon(work, 4)
daemon(lambda: rtpm.connect(nobody, node=node))
"""
    ),
    "in daemon threads' many calls": Ending(
        "def requests():\n"
        "    while True: yield None\n"
        "def work():\n"
        "    while True:\n"
        "        try: rtpm.many(arm.read, requests(), deadline=5)\n"
        "        except rtpm.CallError: pass\n"
        "daemon(work, 2)"
    ),
    "in a daemon thread's event loop": Ending(
        ECHO
        + """
async def work():
    client = lab["EchoAsyncClient"](server.url("x"), node=node)
    while True: await client.at_once(Text(), deadline=5)
def run():
    try: asyncio.run(work())
    except (rtpm.CallError, RuntimeError): pass  # The server or asyncio's threads have ended.
daemon(run, 2)
"""
    ),
    "in a daemon thread's subscription": Ending(
        "events = rtpm.events(node=node)\ndaemon(lambda: [event.value for event in events])"
    ),
    "with an open subscription and supplier": Ending(
        ECHO + "noted = rtpm.supplier(lab['Noted'], node=node)\n"
        "events = rtpm.events(node=node, queue=16)\n"
        "noted.push_many([lab['Noted'](count=n) for n in range(1000)])",
        error=r"(rtpm/events: .* lost.*\n)*",
    ),
    "with a thread that goes on": Ending(
        """
def work():
    threading.main_thread().join()
    for _ in range(100): read()
    print("read")
threading.Thread(target=work).start()
"""
    ),
    "with a pool of threads": Ending(
        "from concurrent.futures import ThreadPoolExecutor\n"
        "pool = ThreadPoolExecutor(4)\n"
        "for _ in range(200): pool.submit(read)"
    ),
    "with an import in a thread": Ending(
        "def work():\n"
        "    import rtpm\n"
        "    rtpm.connect('lab/arm0', node=rtpm.Node(sys.argv[1])).read(deadline=10)\n"
        "thread = threading.Thread(target=work)\nthread.start()\nthread.join()",
        before="",
    ),
    "with an idle server": Ending(ECHO),
    "with a call that a servant runs": Ending(
        ECHO
        + """
def work():
    try: echo.wait(Text(count=300), deadline=5)
    except rtpm.Stopped: pass
threading.Thread(target=work).start()
time.sleep(0.1)
"""
    ),
    "with a call that an async servant runs": Ending(
        ECHO
        + """
def work():
    try: echo.sleep(Text(count=60_000), deadline=60)
    except rtpm.CallError: pass
threading.Thread(target=work).start()
time.sleep(0.1)
"""
    ),
    "with an exception of a servant": Ending(
        ECHO + "try: echo.fail(Text(count=5))\nexcept rtpm.ServantFailed: pass\n"
        "raise SystemExit(6)",
        6,
        r"Echo\.fail failed(.*\n)+KeyError: 5\n",
    ),
    "with an exception of a callback": Ending(
        ECHO
        + """
def done(task):
    raise KeyError(7)
async def work():
    client = lab["EchoAsyncClient"](server.url("x"), node=node)
    call = asyncio.ensure_future(client.at_once(Text(), deadline=10))
    call.add_done_callback(done)
    await call
asyncio.run(work())
""",
        error=r"Exception in callback (.*\n)+KeyError: 7\n",
    ),
    "with a stream half read": Ending(
        ECHO + "items = echo.count_up(Text(), deadline=60)\nnext(items)"
    ),
    "with a stream half read by a generator": Ending(
        ECHO
        + """
def numbers():
    with echo.count_up(Text(), deadline=60) as items:
        for item in items: yield item.count
generator = numbers()
next(generator)
dropped = numbers()
next(dropped)
del dropped
gc.collect()
"""
    ),
    "in a daemon thread's stream": Ending(
        ECHO
        + """
def work():
    try:
        for _ in echo.count_up(Text(), deadline=60): pass
    except rtpm.CallError: pass
daemon(work, 2)
"""
    ),
    "with an open recording": Ending(
        """
subprocess.run([os.environ["RTPM_PROGRAMS"] + "/rtpm", "--registry", sys.argv[1], "record", sys.argv[2],
                "--for", "50ms"], check=True, stdout=subprocess.DEVNULL)
recording = rtpm.open(sys.argv[2])
messages = iter(recording)
next(messages)
"""
    ),
    "with its modules deleted": Ending(
        """
events = rtpm.events(node=node)
for name in [name for name in sys.modules if name.split(".")[0] == "rtpm"]:
    del sys.modules[name]
del rtpm, events
gc.collect()
read()
"""
    ),
    "with a subinterpreter that imports it": Ending(
        """
try: import _interpreters as interpreters
except ImportError: import _xxsubinterpreters as interpreters
other = interpreters.create()
failure = None
try: failure = interpreters.run_string(other, "import sys; sys.path[:] = %r; import rtpm" % sys.path)
except Exception as error: failure = error
assert failure is None or "ImportError" in str(failure.__dict__ if hasattr(failure, "type") else failure), failure
interpreters.destroy(other)
"""
    ),
    "with a subprocess": Ending(
        "tip = acquired()\n"
        "subprocess.run([sys.executable, '-c', ''], check=True, preexec_fn=os.setsid)\n"
        "assert subprocess.run(['false']).returncode == 1\n"
        "tip.force = (0, 0, 0)"
    ),
    "of a forked child": Ending(
        ECHO
        + """
events = rtpm.events(node=node)
items = echo.count_up(Text(), deadline=60)
next(items)
tip = acquired()
servo = tip.render()
child = os.fork()
if child == 0:
    with server, tip, events, items: pass  # Of the parent.
    try: tip.force = (1, 0, 0)
    except rtpm.ForkedError: sys.exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
assert servo.is_running and echo.at_once(Text(count=3), deadline=10).count == 3 and next(items).count == 1
"""
    ),
    "of a forked child that collects": Ending(
        ECHO
        + """
events = rtpm.events(node=node)
noted = rtpm.supplier(lab["Noted"], node=node)
clients = [lab["EchoClient"](server.url("x"), node=rtpm.Node(transport=way)) for way in ("udp", "tcp", "shm")]
streams = [client.count_up(Text(), deadline=60) for client in clients]
assert [next(items).count for items in streams] == [0, 0, 0]
loop = asyncio.new_event_loop()
others = lab["EchoAsyncClient"](server.url("x"), node=rtpm.Node(transport="udp"))
call = loop.create_task(others.wait(Text(count=200), deadline=10))
loop.run_until_complete(asyncio.sleep(0.1))
tip = acquired()
child = os.fork()
if child == 0:
    del events, noted, clients, streams, others, echo, arm, server, tip
    gc.collect()
    node = rtpm.Node(sys.argv[1])
    rtpm.connect("lab/arm0", node=node).read(deadline=10)
    sys.exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
assert [next(items).count for items in streams] == [1, 1, 1]
assert [client.at_once(Text(count=3), deadline=10).count for client in clients] == [3, 3, 3]
tip.force = (0, 0, 0)
assert loop.run_until_complete(call).count == 200
events.next(5)
noted.push(lab["Noted"]())
"""
    ),
}
PROCESSES = """
# Its objects of this program are not the children's.
def work(registry):
    import rtpm
    rtpm.connect("lab/arm0", node=rtpm.Node(registry)).read(deadline=10)

if __name__ == "__main__":
    context = multiprocessing.get_context("{method}")
    with context.Pool(2) as pool:
        pool.map(work, sys.argv[1:2] * 4)
    child = context.Process(target=work, args=sys.argv[1:2])
    child.start()
    child.join()
    sys.exit(child.exitcode)
"""
for method in ("fork", "spawn", "forkserver"):
    is_main = 'if __name__ == "__main__":\n' + textwrap.indent(ARM, "    ")
    ENDINGS[f"with children by {method}"] = Ending(PROCESSES.format(method=method), before=is_main)


@pytest.fixture(scope="module")
def ended(
    laboratory: Laboratory,
    tmp_path_factory: pytest.TempPathFactory,
    request: pytest.FixtureRequest,
) -> Iterator[dict[str, Future[subprocess.CompletedProcess[str]]]]:
    """The programs of the chosen tests, several at a time."""
    folder = tmp_path_factory.mktemp("endings")

    def run(name: str) -> subprocess.CompletedProcess[str]:
        ending = ENDINGS[name]
        program = folder / f"{name.replace(' ', '_')}.py"
        program.write_text(BEFORE + ending.before + ending.code)
        return subprocess.run(
            [
                *(sys.executable, "-W", "ignore:This process:DeprecationWarning"),  # Of fork().
                *(program, laboratory.registry.url, program.with_suffix(".mcap")),
            ],
            capture_output=True,
            text=True,
            timeout=40,
            check=False,
        )

    chosen = [
        item.callspec.params["ending"]
        for item in request.session.items
        if isinstance(item, pytest.Function) and item.originalname == "test_a_program_ends"
    ]
    with ThreadPoolExecutor(6) as pool:
        yield {name: pool.submit(run, name) for name in chosen}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_program_ends(
    ended: dict[str, Future[subprocess.CompletedProcess[str]]], ending: str
) -> None:
    done = ended[ending].result()
    assert done.returncode == ENDINGS[ending].status, done.stderr
    assert re.fullmatch(ENDINGS[ending].error, done.stderr), done.stderr
