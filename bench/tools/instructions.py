"""How many instructions chosen functions take, against a kept table: instructions.py --program P --tables F

Runs rtpm-instructions under valgrind's callgrind, which counts alike on every run, however busy the
machine. The counts depend on the compiler and the build, so that each has a table of its own, F/KEY.txt
with the KEY that the program tells. `--update` writes the table anew instead of comparing.

Exit codes: 0 all are within 3 % of the table, or there is none for this compiler, which is said; 1 one
moved further, or is in one of the two only; 2 it could not be counted, said in one sentence.
"""

import argparse
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import tempfile

import records

# As rtpm-instructions has it.
REPEAT_COUNT = 200
TOLERANCE_PERCENT = 3
PREFIX = "counted_"
TIMEOUT_SECONDS = 600


def _said_by(program, argument):
    try:
        done = subprocess.run([program, argument], capture_output=True, text=True, check=True,
                              timeout=TIMEOUT_SECONDS)
    except (OSError, subprocess.SubprocessError) as error:
        raise records.Fault(f"{program} {argument} does not run: {error}") from None
    return done.stdout.split()


def _share_one_cpu():
    """Keeps this process and its children on one CPU, where a woken thread never preempts (SCHED_BATCH).

    A lane and its caller then take turns in the same order in every run: the lane is asleep when a
    call arrives. On two CPUs it is awake for some calls, which saves them a third of their
    instructions.
    """
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def count(program):
    """Instructions for one run of each function, by its name. A Fault: valgrind is missing or fails."""
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        raise records.Fault("counting takes valgrind (Debian's package valgrind)")
    names = _said_by(program, "--list")
    with tempfile.TemporaryDirectory() as folder:
        command = [valgrind, "--tool=callgrind", "--fair-sched=try", f"--callgrind-out-file={folder}/counts"]
        for name in names:
            # Writes down what was counted, and begins anew, when the function begins and ends.
            command += [f"--dump-before={name}", f"--dump-after={name}"]
        done = subprocess.run([*command, program], capture_output=True, text=True, check=False,
                              timeout=TIMEOUT_SECONDS)
        if done.returncode != 0:
            said = [re.sub(r"^==\d+== ?", "", line) for line in done.stderr.splitlines()]
            raise records.Fault("valgrind failed: " + ([line for line in said if line] or [""])[-1])
        counts = _read_counts(pathlib.Path(folder))
    missing = [name for name in names if name not in counts]
    if missing:
        raise records.Fault(f"valgrind told nothing of {', '.join(missing)}")
    return {name.removeprefix(PREFIX): counts[name] / REPEAT_COUNT for name in names}


def _read_counts(folder):
    """The median of what each function took in its runs, from the files that callgrind wrote.

    The first run sets it up, and the end of a time slice makes the threads of some others meet
    differently: both are outliers.
    """
    runs = {}
    for path in folder.glob("counts.*"):
        text = path.read_text(encoding="utf-8")
        trigger = re.search(r"^desc: Trigger: --dump-after=(\S+)$", text, re.MULTILINE)
        summary = re.search(r"^(?:summary|totals): (\d+)$", text, re.MULTILINE)
        if trigger and summary:
            runs.setdefault(trigger[1], []).append(int(summary[1]))
    return {name: statistics.median(counts) for name, counts in runs.items()}


def read_table(path):
    """A kept table: counts by name."""
    table = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        match = re.fullmatch(r"(\w+) +(\d+(?:\.\d+)?)", line.strip())
        if not match:
            raise records.Fault(f"{path.name}, line {number}: this is no name and count: {line}")
        table[match[1]] = float(match[2])
    return table


def write_table(path, key, counts):
    """Writes a table anew."""
    lines = [f"# Instructions of one run, as valgrind 3 counts them; built by {key}.",
             "# Written by `./dev bench --instructions --update`."]
    lines += [f"{name:<28} {value:.1f}" for name, value in counts.items()]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def compare(counts, table):
    """@return a line for each function, and whether all are within the tolerance."""
    lines, is_within = [], True
    for name in [*counts, *(name for name in table if name not in counts)]:
        if name not in table or name not in counts:
            lines.append(f"{name}: only in {'the program' if name in counts else 'the table'}")
            is_within = False
            continue
        percent = 100 * (counts[name] / table[name] - 1) if table[name] else 0.0
        has_moved = abs(percent) > TOLERANCE_PERCENT
        is_within = is_within and not has_moved
        lines.append(f"{name:<28} {table[name]:>12.1f} {counts[name]:>12.1f} {percent:>+8.1f} %"
                     + ("  MOVED" if has_moved else ""))
    return lines, is_within


def run(options):
    """Counts, and compares or updates. @return the exit code."""
    key = _said_by(options.program, "--key")[0]
    path = pathlib.Path(options.tables) / f"{key}.txt"
    _share_one_cpu()
    counts = count(options.program)
    if options.update:
        write_table(path, key, counts)
        print(f"wrote the table of {key}: {len(counts)} functions")
        return 0
    if not path.exists():
        for name, value in counts.items():
            print(f"{name:<28} {value:>12.1f}")
        print(f"There is no table for {key}, so nothing is compared; --update makes one.")
        return 0
    lines, is_within = compare(counts, read_table(path))
    print(f"{'instructions of one run':<28} {'kept':>12} {'now':>12}")
    print("\n".join(lines))
    print(f"All are within {TOLERANCE_PERCENT} % of the table of {key}." if is_within else
          f"Not all are within {TOLERANCE_PERCENT} % of the table of {key}. If that is meant, "
          "--update keeps it.")
    return 0 if is_within else 1


def main(arguments):
    """The program. @return its exit code."""
    parser = argparse.ArgumentParser(prog="instructions", description="Counts instructions.")
    parser.add_argument("--program", required=True, help="the program rtpm-instructions")
    parser.add_argument("--tables", required=True, help="the folder of kept tables")
    parser.add_argument("--update", action="store_true", help="write the table anew")
    try:
        return run(parser.parse_args(arguments))
    except (records.Fault, subprocess.TimeoutExpired, OSError) as fault:
        print(f"instructions: {fault}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
