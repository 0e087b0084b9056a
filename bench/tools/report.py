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

import measure
import page
import plan
import plots
import records

# How long all may take with the build, in half an hour and five minutes. What there is no time left
# for is left out, by name. However long the build took, some of it is measured.
BUDGET_SECONDS = {"full": 29 * 60, "quick": 4.75 * 60}
BUDGET_SECONDS_MIN = 90

def draw(results, folder):
    """Draws all plots. @return the names of those drawn; none, said on standard error, without
    matplotlib."""
    try:
        return plots.draw_all(results, folder)
    except records.Fault as fault:
        print(f"report: {fault}", file=sys.stderr)
        return []


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
    parser.add_argument("--results", help="where the results go, instead of FOLDER/results.jsonl")
    parser.add_argument("--page", required=True, help="the page to write")
    parser.add_argument("--quick", action="store_true", help="within five minutes, with short runs")
    parser.add_argument("--spent", type=float, default=0, help="seconds that are gone already")
    parser.add_argument("--from", dest="source", help="measure nothing: the results are there")
    options = parser.parse_args(arguments)
    if (options.bench is None) == (options.source is None):
        parser.error("it takes either --bench or --from")
    os.makedirs(options.folder, exist_ok=True)
    path = (options.source or options.results
            or os.path.join(options.folder, "results.jsonl"))
    os.makedirs(os.path.dirname(os.path.abspath(path)), exist_ok=True)
    is_interrupted = options.source is None and _measure(options, path)
    try:
        results = records.read(path, keep_partial=True)
    except records.Fault as fault:
        print(f"report: {fault}", file=sys.stderr)
        return 2
    text = page.page(results, draw(results, options.folder))
    with open(options.page, "w", encoding="utf-8") as file:
        file.write(text)
    print(f"the results are in {os.path.relpath(options.page)}", file=sys.stderr)
    if is_interrupted:
        return 130
    is_complete = all(part["outcome"] == "done" for part in
                      records.by_key(records.select(results, case="part")).values())
    return 0 if is_complete else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
