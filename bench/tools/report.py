"""Measures, and writes the page of results: report.py --bench PROGRAM --folder FOLDER --page FILE.md

The results go line by line to FOLDER/results.jsonl as they come, the plots to FOLDER, and the page to
FILE.md. An interrupted run makes its page from what it has. `--from FILE.jsonl` measures nothing.

Exit codes: 0 all was measured; 1 something was not, which the page says as well; 2 a wrong option or
file; 130 interrupted, the page being made all the same.
"""

import argparse
import datetime
import os
import subprocess
import sys

import losses
import measure
import paper
import pictures
import plan
import records
import tables

# How long all may take with the build, in half an hour and five minutes. What there is no time left
# for is left out, by name. However long the build took, some of it is measured.
BUDGET_SECONDS = {"full": 29 * 60, "quick": 4.75 * 60}
BUDGET_SECONDS_MIN = 90

# (heading, what it says, which rows, columns, plot)
SECTIONS = (
    ("Calls of 48 bytes", "One after the other, as quickly as they go. Microseconds.",
     lambda row: row["case"] == "call" and row["payload"] == 48, tables.DUEL, "tails"),
    ("Calls of other payloads", "As many bytes there as back. Microseconds.",
     lambda row: row["case"] == "call" and row["payload"] != 48, tables.DUEL, "payload"),
    ("Paced calls", "At a fixed rate, counted from when each was due. Microseconds.",
     lambda row: row["case"] == "paced",
     tables.DUEL + (("server CPU %", "server_cpu_percent"),), None),
    ("Priority under load",
     "A 1 kHz caller of high priority, while callers of low priority saturate the server's CPU with "
     "calls of 200 us. The floor has a thread and a socket for each priority; shared memory stands "
     "beside that, and beside a thread and a ring for each. Microseconds.",
     lambda row: row["case"] == "isolation", tables.LOADED, "isolation"),
    ("Small calls beside large",
     "A 1 kHz caller of high priority, while 1 MiB goes to and fro below it. Microseconds.",
     lambda row: row["case"] == "large", tables.LOADED, None),
    ("Events, to so many consumers",
     "32 bytes at 1 kHz through a hub; the floor is a raw relay over UDP. Microseconds.",
     lambda row: row["case"] == "events" and "ratio_each_p50" in row, tables.EVENTS, "consumers"),
    ("Events, while some consumers are stopped or slow", "The others' latencies. Microseconds.",
     lambda row: row["case"] == "events" and "bad_over_well_p50" in row, tables.BAD_CONSUMERS, None),
    ("Events, as many as go through", "Through the hub to one consumer.",
     lambda row: row["case"] == "events" and "events_per_s" in row, tables.EVENT_RATE, None),
    ("What each layer adds to an event",
     "One event at 1 kHz from a supplier to a consumer of the same program, with what is between on "
     "the other CPU: a call there and back; a call that is handed on by a call back; a hub in the "
     "same program; a hub in a process of its own; two hubs, linked. All by turns. Microseconds.",
     lambda row: row["case"] == "ladder", tables.LADDER, None),
    ("Throughput", "One caller, one lane, many calls on their way at a time.",
     lambda row: row["case"] == "throughput", tables.THROUGHPUT, None),
    ("Two nodes",
     "Two network namespaces joined by a veth pair; with loss, only RTPM's packets are lost. "
     "Microseconds.",
     lambda row: row["case"] == "two-node",
     tables.DUEL + (("succeeded %", "succeeded_percent"), ("run twice", "run_twice")), None),
    ("A force loop through a device",
     "Each cycle at 1 kHz reads the simulated arm's newest sample and commands a force from it: two "
     "calls. The floor's cycle is two raw echoes of 48 bytes. Microseconds.",
     lambda row: row["case"] == "device", tables.DUEL, None),
    ("Many clients", "A caller while so many others are bound and silent. Microseconds.",
     lambda row: row["case"] == "scale",
     tables.DUEL + (("server's KiB for each client", "per_client_kib"),), None),
    ("Memory", "Of a server, a program of its own, all of it locked.",
     lambda row: row["case"] == "memory", tables.MEMORY, None),
    ("Idle", "CPU time of a server with one bound client that does not call.",
     lambda row: row["case"] == "idle", (("% of a CPU", "cpu_percent"),), None),
    ("Start", "From the start of a server's program to the first answered call, on a machine that has "
     "it in its caches. The floor's opens a socket (UDP beside shared memory). Microseconds.",
     lambda row: row["case"] == "startup", tables.STARTUP, None),
)


def own_rows(results):
    """RTPM's rows beside its floor: the last of each."""
    return [record for key, record in records.by_key(results).items()
            if record["case"] not in ("report", "part") and not {"part", "peer"} & dict(key).keys()]


def peer_rows(results):
    """The rows of peers."""
    return [record for record in records.by_key(results).values() if "peer" in record]


def _head_lines(results):
    head = next(iter(records.select(results, case="report")), {})
    form = head.get("form", "")
    return [
        "# Results", "",
        f"Made by `./dev bench --report{' --quick' if form == 'quick' else ''}`"
        + (f" on {head['date']}" if "date" in head else "")
        + (f" at commit {head['commit']}" if head.get("commit") else " at an unknown commit")
        + "; the rows themselves are in [results/results.jsonl](results/results.jsonl). What each "
        "case does, and how it is measured, is said in [README.md](README.md).", "",
        "Every row was measured beside the raw floor, by turns in one run: the sockets or rings "
        "themselves, with the same bytes, wait, priority and CPU. Times belong to this machine and "
        "these minutes; the ratios are what to compare. A median is the mean of the middle half of "
        "the rounds' own; p99 and p99.9 are those of as many rounds together as it takes to have ten "
        "samples beyond them; "
        "p99.99 and the maximum are those of all samples. A dash stands where there are too few "
        "samples: p99 takes 1000, p99.9 takes 10 000, p99.99 takes 100 000.",
        *(["", "This is the quick form: short runs, which tell little of the tails."]
          if form == "quick" else []), ""]


def _parts_of(results):
    """What is said of each part; of one that was measured again, what is said last."""
    return list(records.by_key(records.select(results, case="part")).values())


def _machine_lines(rows, parts):
    environment = next((row["environment"] for row in rows if "environment" in row), {})
    words = {"cpu": "CPU", "cpu_count": "CPUs", "virtualised": "virtualised", "kernel": "Linux",
             "governor": "governor", "sched_rt_runtime_us": "real-time throttling, us of 1 s",
             "client_cpu": "callers on CPU", "server_cpu": "servers on CPU",
             "realtime": "SCHED_FIFO and locked memory", "compiler": "compiler", "build": "built as"}
    said = [[words.get(name, name), ("yes" if value else "no") if isinstance(value, bool) else value]
            for name, value in environment.items()]
    stolen = [row["steal_percent"] for row in rows if "steal_percent" in row]
    if stolen:
        said.append(["taken by the hypervisor (steal)",
                     f"{max(stolen):.2f} % of the CPU time in the worst row, "
                     f"{sum(stolen) / len(stolen):.2f} % on average"])
    shared = sum(bool(row.get("rounds_core_shared")) for row in rows)
    said.append(["rows in whose rounds somebody else computed on the same core",
                 f"{shared} of {len(rows)}"])
    again = [part for part in parts if "first_disturbance" in part]
    if again:
        said.append(["parts measured again, as the first run was disturbed more",
                     ", ".join(f"`{part['part']}`" for part in again)])
    marked = sum(bool(row.get("marks")) for row in rows)
    said.append(["disturbed rows", f"{marked} of {len(rows)}, marked {tables.MARK}"])
    lines = ["## The machine", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in said] + [""]
    marks = sorted({f"{tables.row_name(row, ()).rstrip(' ' + tables.MARK)}: {mark}"
                    for row in rows for mark in row.get("marks", [])})
    if marks:
        lines += ["What disturbed them:", "", *(f"- {mark}" for mark in marks), ""]
    return lines


def _missing_lines(results):
    parts = _parts_of(results)
    lines = []
    for part in parts:
        if part["outcome"] == "done" and not part["said"]:
            continue
        if part["outcome"] != "done":
            lines.append(f"- `{part['part']}` ({part['arguments']}): {part['outcome']}")
        # Several parts may say the same, as of a peer that is not built.
        said = [f"- {text.removeprefix('rtpm-bench: ')}" for text in part["said"]]
        lines += [line for line in said if line not in lines]
    head = next(iter(records.select(results, case="report")), {})
    done = {part["part"] for part in parts}
    lines += [f"- `{name}`: not begun" for name in head.get("parts", []) if name not in done]
    if not lines:
        return ["## What is missing", "", "Nothing: every part ran to its end.", ""]
    return ["## What is missing", "", *lines, ""]


def _paper_lines(results, drawn):
    lines = []
    for name, title, text, distributions in paper.figures(results):
        if not distributions:
            continue
        lines += [f"### {title}", "", text, "", "Microseconds.", ""]
        lines += tables.markdown(paper.SUMMARY_HEAD, paper.summary_rows(distributions)) + [""]
        if name in drawn:
            lines += [f"![{title}](results/{name}.png)", ""]
    if not lines:
        return []
    return ["## The paper's own measurements", "", *lines,
            *(f"- {line}." for line in paper.added_lines(results)), ""]


def _peer_lines(others, drawn):
    lines = ["## Peers", "",
             "Each by turns with RTPM and the floor, pinned and prioritised alike. Microseconds; a "
             "ratio below 1 is for RTPM.", ""]
    for case, heading, columns in (("call", "Calls", tables.PEERS), ("paced", "Paced calls", tables.PEERS),
                                   ("isolation", "Priority under load", tables.PEERS),
                                   ("events", "Events", tables.PEER_EVENTS)):
        found = records.select(others, case=case)
        if not found:
            continue
        shared = tables.in_common(found)
        lines += [f"### {heading}", ""]
        lines += [f"All: {records.name_of(shared)}.", ""] if shared else []
        lines += [*tables.of(found, columns, ("case", *(name for name, _ in shared))), ""]
        if case == "call" and "peers" in drawn:
            lines += ["![Calls](results/peers.png)", ""]
    return lines if others else []


def page(results, drawn):
    """The page as text. `drawn`: the names of the plots that there are."""
    rows, others = own_rows(results), peer_rows(results)
    lines = _head_lines(results) + losses.lines(rows, others) + _missing_lines(results)
    lines += _machine_lines(rows + others, _parts_of(results))
    for heading, text, is_in, columns, plot in SECTIONS:
        found = [row for row in rows if is_in(row)]
        if not found:
            continue
        shared = tables.in_common(found)
        if shared:
            text += f" All: {records.name_of(shared)}."
        leave_out = ("case", *(name for name, _ in shared))
        lines += [f"## {heading}", "", text, "", *tables.of(found, columns, leave_out), ""]
        if plot in drawn:
            lines += [f"![{heading}](results/{plot}.png)", ""]
    lines += _peer_lines(others, drawn)
    return "\n".join(lines + _paper_lines(results, drawn)).rstrip() + "\n"


def draw(results, folder):
    """Draws all plots. @return the names of those drawn; none, said on standard error, without
    gnuplot."""
    drawn = []
    try:
        drawn += pictures.draw_all(own_rows(results) + peer_rows(results), folder)
        for name, title, _, distributions in paper.figures(results):
            if distributions:
                paper.plots.draw(paper.plot_of(name, title, distributions), folder)
                drawn.append(name)
    except records.Fault as fault:
        print(f"report: {fault}", file=sys.stderr)
    return drawn


def _commit():
    """The tree's commit; empty where it has none, as in a source archive, or where there is no git."""
    try:
        done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True,
                              text=True, cwd=os.path.dirname(os.path.abspath(__file__)), check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _measure(options, path):
    """Measures all parts into `path`. @return whether it was interrupted."""
    form = "quick" if options.quick else "full"
    parts = plan.QUICK if options.quick else plan.FULL
    with open(path, "w", encoding="utf-8") as file:
        run = measure.Measurement(options.bench, file,
                                  max(BUDGET_SECONDS_MIN, BUDGET_SECONDS[form] - options.spent))
        run.keep({"case": "report", "form": form, "commit": _commit(),
                  "date": datetime.date.today().isoformat(),
                  "parts": [part.name for part in parts]})
        run.run_all(parts)
    return run.is_interrupted


def main(arguments):
    """The program. @return its exit code."""
    parser = argparse.ArgumentParser(prog="report", description="Measures, and writes the results.")
    parser.add_argument("--bench", help="the program rtpm-bench")
    parser.add_argument("--folder", required=True, help="where results and plots go")
    parser.add_argument("--page", required=True, help="the page to write")
    parser.add_argument("--quick", action="store_true", help="within five minutes, with short runs")
    parser.add_argument("--spent", type=float, default=0, help="seconds that are gone already")
    parser.add_argument("--from", dest="source", help="measure nothing: the results are there")
    options = parser.parse_args(arguments)
    if (options.bench is None) == (options.source is None):
        parser.error("it takes either --bench or --from")
    os.makedirs(options.folder, exist_ok=True)
    path = options.source or os.path.join(options.folder, "results.jsonl")
    is_interrupted = options.source is None and _measure(options, path)
    try:
        results = records.read(path, keep_partial=True)
    except records.Fault as fault:
        print(f"report: {fault}", file=sys.stderr)
        return 2
    text = page(results, draw(results, options.folder))
    with open(options.page, "w", encoding="utf-8") as file:
        file.write(text)
    print(f"the results are in {os.path.relpath(options.page)}", file=sys.stderr)
    if is_interrupted:
        return 130
    is_complete = all(part["outcome"] == "done" for part in _parts_of(results))
    return 0 if is_complete else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
