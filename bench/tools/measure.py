"""Runs rtpm-bench part by part and keeps its results line by line as they come."""

import json
import shlex
import signal
import subprocess
import sys
import threading
import time

# A part that takes so many times as long as it should hangs.
PATIENCE = 4
PATIENCE_SECONDS_MIN = 60


class Measurement:
    """Appends the results of rtpm-bench to a file of JSON lines.

    Every record gets the field "part" where it is not to be a row of its own; and each part leaves a
    record {"case": "part", "part": NAME, "seconds": …, "outcome": …, "said": […]}, whose outcome is
    "done", "incomplete" (with what rtpm-bench said about it), "interrupted", "out of time" or
    "hung". So a file tells by itself what it lacks.
    """

    def __init__(self, bench, file, budget_s):
        """`bench`: the program. `file`: open for writing. `budget_s`: for all parts together."""
        self._bench = bench
        self._file = file
        self._end = time.monotonic() + budget_s
        self._process = None
        self.is_interrupted = False

    def keep(self, record):
        """Writes one record, so that it stays whatever comes."""
        self._file.write(json.dumps(record, ensure_ascii=False) + "\n")
        self._file.flush()

    def run_all(self, parts):
        """Runs the parts in turn, those for which there is time, until it is interrupted.

        An interrupt (Ctrl-C, or being asked to end) ends the part that runs, and is_interrupted tells
        of it; nothing is raised, so that what comes behind can be done.
        """
        signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        before = [signal.signal(number, self._interrupt) for number in signals]
        try:
            self._run_each(parts)
        finally:
            for number, handler in zip(signals, before):
                signal.signal(number, handler)

    def _interrupt(self, *_):
        self.is_interrupted = True
        if self._process is not None:
            self._process.terminate()

    def _run_each(self, parts):
        for number, part in enumerate(parts, 1):
            if self.is_interrupted:
                self.keep(_outcome(part, 0, "interrupted", []))
            elif time.monotonic() + part.seconds / 2 > self._end:
                print(f"leaving out {part.name}: there is no time left for it", file=sys.stderr,
                      flush=True)
                self.keep(_outcome(part, 0, "out of time", []))
            else:
                print(f"measuring {part.name}, {number} of {len(parts)}, about {part.seconds} s",
                      file=sys.stderr, flush=True)
                self.keep(self._run(part))

    def _run(self, part):
        """@return the part's record; each row is kept as it comes."""
        begin = time.monotonic()
        command = [self._bench, "run", *shlex.split(part.arguments), "--json"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as process:
            said = []
            listener = threading.Thread(target=_listen, args=(process.stderr, said))
            listener.start()
            has_hung = threading.Event()
            limit = max(PATIENCE_SECONDS_MIN, PATIENCE * part.seconds)
            guard = threading.Timer(limit, lambda: (has_hung.set(), process.kill()))
            guard.start()
            self._process = process
            if self.is_interrupted:  # Before the line above: nobody has told the process.
                process.terminate()
            self._pass_results(part, process.stdout)
            process.wait()
            self._process = None
            guard.cancel()
            listener.join()
        outcome = ("interrupted" if self.is_interrupted else "hung" if has_hung.is_set()
                   else "done" if process.returncode == 0 else "incomplete")
        return _outcome(part, time.monotonic() - begin, outcome, said)

    def _pass_results(self, part, lines):
        for line in lines:
            try:
                record = json.loads(line)
            except ValueError:
                continue  # The line that an ended process left unfinished.
            if not part.joins_rows:
                record["part"] = part.name
            self.keep(record)


def _outcome(part, seconds, outcome, said):
    return {"case": "part", "part": part.name, "arguments": part.arguments,
            "seconds": round(seconds, 1), "outcome": outcome, "said": said}


def _listen(stream, said):
    """Passes on what a program says on standard error, and remembers it."""
    for line in stream:
        said.append(line.rstrip("\n"))
        print(line, end="", file=sys.stderr, flush=True)
