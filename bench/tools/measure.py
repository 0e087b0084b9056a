"""Runs rtpm-bench part by part, keeps what it says line by line as it comes, and runs again what
others on the machine disturbed."""

import json
import shlex
import signal
import statistics
import subprocess
import sys
import threading
import time

# A part that takes so many times as long as it should hangs.
PATIENCE = 4
PATIENCE_SECONDS_MIN = 60
# A part that was disturbed more is run again if there is time: the unit is a percent of the CPU time
# that the hypervisor took.
DISTURBED = 0.5
# So much counts a row in all of whose rounds somebody else computed on the cores.
ALL_SHARED = 5


def disturbance(rows):
    """How much others disturbed some rows, on average."""
    return statistics.fmean([_disturbance_of(row) for row in rows] or [0])


def _disturbance_of(row):
    rounds = row.get("rounds", 0)
    shared = row.get("rounds_core_shared", 0) / rounds if rounds else 0
    return row.get("steal_percent", 0) + ALL_SHARED * shared



class Measurement:
    """Appends the results of rtpm-bench to a file of JSON lines.

    Every record gets the field "part" where it is not to be a row of its own; and each part leaves a
    record {"case": "part", "part": NAME, "seconds": …, "outcome": …, "said": […]}, whose outcome is
    "done", "incomplete" (with what rtpm-bench said about it), "interrupted", "out of time" or
    "hung". So a file tells by itself what it lacks. A part that ran also has "disturbance"; where a
    second run was kept, its records stand behind those of the first, and "first_disturbance" says
    how that was.
    """

    def __init__(self, bench, file, budget_s):
        """`bench`: the program. `file`: open for writing. `budget_s`: for all parts together."""
        self._bench = bench
        self._file = file
        self._end = time.monotonic() + budget_s
        self._process = None
        self._parts = {}  # What each part's kept record says of it, by its name.
        self.is_interrupted = False

    def keep(self, record):
        """Writes one record, so that it stays whatever comes."""
        self._file.write(json.dumps(record, ensure_ascii=False) + "\n")
        self._file.flush()

    def run_all(self, parts):
        """Runs the parts in turn, those for which there is time, until it is interrupted; then again
        what was incomplete or disturbed, the worst first, while there is time. Of a part's two runs,
        the more complete is kept, or the less disturbed; what they measured has no say in that.

        An interrupt (Ctrl-C, or being asked to end) ends the part that runs, and is_interrupted tells
        of it; nothing is raised, so that what comes behind can be done.
        """
        signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        before = [signal.signal(number, self._interrupt) for number in signals]
        try:
            self._run_each(parts)
            self._run_again(parts)
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
                self._keep_outcome(_outcome(part, 0, "interrupted", []))
            elif time.monotonic() + part.seconds / 2 > self._end:
                print(f"leaving out {part.name}: there is no time left for it", file=sys.stderr,
                      flush=True)
                self._keep_outcome(_outcome(part, 0, "out of time", []))
            else:
                print(f"measuring {part.name}, {number} of {len(parts)}, about {part.seconds} s",
                      file=sys.stderr, flush=True)
                self._keep_outcome(self._run(part, self.keep))

    def _run_again(self, parts):
        worst_first = sorted(filter(self._is_worth_it, parts),
                             key=lambda part: _rank(self._parts[part.name]), reverse=True)
        for part in worst_first:
            if self.is_interrupted:
                return
            if time.monotonic() + self._parts[part.name]["seconds"] < self._end:
                print(f"measuring {part.name} again, as it was disturbed", file=sys.stderr,
                      flush=True)
                self._run_once_more(part)

    def _is_worth_it(self, part):
        first = self._parts[part.name]
        return (first["outcome"] == "incomplete"
                or first["outcome"] == "done" and first["disturbance"] > DISTURBED)

    def _run_once_more(self, part):
        rows = []
        outcome = self._run(part, rows.append)
        first = self._parts[part.name]
        if _rank(outcome) >= _rank(first):
            return
        for row in rows:
            self.keep(row)
        self._keep_outcome(outcome | {"first_disturbance": first["disturbance"]})

    def _run(self, part, keep):
        """@return what the part's record says; each row goes to `keep` as it comes."""
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
            found = _pass_results(part, process.stdout, keep)
            process.wait()
            self._process = None
            guard.cancel()
            listener.join()
        outcome = ("interrupted" if self.is_interrupted else "hung" if has_hung.is_set()
                   else "done" if process.returncode == 0 else "incomplete")
        return _outcome(part, time.monotonic() - begin, outcome, said) | {
            "disturbance": round(disturbance(found), 2)}

    def _keep_outcome(self, outcome):
        self._parts[outcome["part"]] = outcome
        self.keep(outcome)


def _outcome(part, seconds, outcome, said):
    return {"case": "part", "part": part.name, "arguments": part.arguments,
            "seconds": round(seconds, 1), "outcome": outcome, "said": said}


def _rank(outcome):
    """The lower, the better a run of a part is."""
    return outcome["outcome"] != "done", outcome["disturbance"]


def _pass_results(part, lines, keep):
    """Gives each row to `keep` as it comes. @return all of them."""
    found = []
    for line in lines:
        try:
            record = json.loads(line)
        except ValueError:
            continue  # What it was killed in the middle of.
        if not part.joins_rows:
            record["part"] = part.name
        found.append(record)
        keep(record)
    return found


def _listen(stream, said):
    """Passes on what a program says on standard error, and remembers it."""
    for line in stream:
        said.append(line.rstrip("\n"))
        print(line, end="", file=sys.stderr, flush=True)
