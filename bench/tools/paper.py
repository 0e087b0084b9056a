"""The paper's section 5 again: paper.py --bench PROGRAM --folder FOLDER

1000 calls of 48 bytes as quickly as they go, on one node and between two; 1000 events 1 ms apart
through a hub, on the same node and on another. Prints the distributions beside the paper's figures,
and plots them into FOLDER. Two nodes are two network namespaces that a veth pair joins.

Exit codes: 0 all was measured; 1 something was not, which is said; 2 a wrong option.
"""

import argparse
import math
import os
import sys

import measure
import plan
import plots
import records

# What the paper tells in words; its plots have no numbers that could be read off exactly.
CALLS_TEXT = (
    "The paper, single node (Pentium 4 of 2.5 GHz, TAO, TCP by the loop interface): 58 us for 91 % "
    "of the calls on Timesys, the best of its systems; 99.8 % below 1 ms on plain Linux and "
    "Windows 2000.")
NETWORK_TEXT = (
    "The paper, two nodes (Ethernet of 100 Mbit/s): the network adds about 110 us, 200 us at worst. "
    "Here the two nodes are network namespaces joined by a veth pair: the kernel's whole path "
    "without a wire.")
EVENTS_TEXT = (
    "The paper, events with the event channel on the second node: the same delay and a much wider "
    "distribution than that of calls, in plots without numbers.")
BINS_PER_OCTAVE = 8
BAR_MAX = 50


class Distribution:
    """The latencies of one curve of a figure, in microseconds, and how it is called."""

    def __init__(self, label, latencies_us):
        self.label = label
        self.sorted_us = sorted(latencies_us)

    def at(self, percent):
        """The latency that so many percent do not exceed."""
        rank = math.ceil(percent / 100 * len(self.sorted_us) - 1e-6)
        return self.sorted_us[max(0, min(len(self.sorted_us), rank) - 1)]

    def percent_below(self, limit_us):
        """How many percent are below `limit_us`."""
        return 100 * sum(value < limit_us for value in self.sorted_us) / len(self.sorted_us)

    def bins(self):
        """(from_us, percent) of each bin, an eighth of an octave wide; gaps and edges are zero."""
        counts = {}
        for value in self.sorted_us:
            place = math.floor(math.log2(max(value, 0.01)) * BINS_PER_OCTAVE)
            counts[place] = counts.get(place, 0) + 1
        return [(2 ** (place / BINS_PER_OCTAVE),
                 100 * counts.get(place, 0) / len(self.sorted_us))
                for place in range(min(counts) - 1, max(counts) + 2)]


def curves(results, **wanted):
    """The Distributions of RTPM and the floor in those results that are as wanted."""
    found = []
    for record in records.select(results, **wanted):
        if "latencies_us" not in record:
            continue
        label = f"{record['transport']}, {record['wait']} wait"
        for who, name in (("RTPM", "latencies_us"), ("floor", "floor_latencies_us")):
            values = [value for value in record.get(name, []) if records.is_number(value)]
            if values:
                found.append(Distribution(f"{who}, {label}", values))
    return found


def figures(results):
    """What the section has: (title, what the paper says, its Distributions)."""
    return (
        ("As the paper's Figure 6: 1000 calls of 48 bytes, one node", CALLS_TEXT,
         curves(results, part="paper-calls")),
        ("As the paper's Figure 7 a: 1000 calls of 48 bytes, two nodes",
         NETWORK_TEXT, curves(results, part="paper-two-nodes")),
        ("1000 events at 1 ms through a hub, one node", EVENTS_TEXT,
         curves(results, part="paper-events", consumers=1, hosts=None)),
        ("As the paper's Figure 7 b, c: 1000 events at 1 ms, the hub on another node", EVENTS_TEXT,
         curves(results, part="paper-events", consumers=1, hosts=2)),
    )


def summary_rows(distributions):
    """The rows of a table: [label, p50, p91, p99, p99.9, max, percent below 1 ms] as texts."""
    return [[each.label, *(f"{value:.1f}" for value in (
        each.at(50), each.at(91), each.at(99), each.at(99.9), each.at(100))),
        f"{each.percent_below(1000):.1f} %"] for each in distributions]


SUMMARY_HEAD = ("", "p50", "p91", "p99", "p99.9", "max", "below 1 ms")


def added_lines(results):
    """What two nodes add to the median of one, a line for each curve that both have."""
    one = {each.label: each for each in curves(results, part="paper-calls")}
    return [f"{each.label}: two nodes add {each.at(50) - one[each.label].at(50):+.1f} us at the "
            "median" for each in curves(results, part="paper-two-nodes") if each.label in one]


def _print_figure(title, paper_text, distributions):
    print(f"\n{title}\n{paper_text}\n")
    print(f"  {SUMMARY_HEAD[0]:<28}" + "".join(f"{head:>11}" for head in SUMMARY_HEAD[1:]))
    for row in summary_rows(distributions):
        print(f"  {row[0]:<28}" + "".join(f"{cell:>11}" for cell in row[1:]))
    for each in distributions:
        print(f"\n  {each.label}: microseconds from, percent")
        bins = [(start, share) for start, share in each.bins() if share > 0]
        largest = max(share for _, share in bins)
        for start, share in bins:
            bar = "#" * math.ceil(share / largest * BAR_MAX)
            print(f"  {start:>10.2f} {share:>6.1f}  {bar}")


def show(results, folder):
    """Prints and plots all figures; False if one has nothing to show, which is said."""
    is_complete = True
    for title, paper_text, distributions in figures(results):
        if not distributions:
            print(f"paper: not measured: {title}", file=sys.stderr)
            is_complete = False
            continue
        _print_figure(title, paper_text, distributions)
    print("")
    for line in added_lines(results):
        print(line)
    plots.draw_all(results, folder)
    print(f"\nplots: {os.path.relpath(folder)}/paper-*.svg")
    return is_complete


def main(arguments):
    """The program. @return its exit code."""
    parser = argparse.ArgumentParser(prog="paper", description="The paper's section 5 again.")
    parser.add_argument("--bench", required=True, help="the program rtpm-bench")
    parser.add_argument("--folder", required=True, help="where plots and results go")
    options = parser.parse_args(arguments)
    os.makedirs(options.folder, exist_ok=True)
    path = os.path.join(options.folder, "paper.jsonl")
    with open(path, "w", encoding="utf-8") as file:
        run = measure.Measurement(options.bench, file, 300)
        run.run_all(plan.PAPER)
    if run.is_interrupted:
        return 130
    try:
        is_complete = show(records.read(path), options.folder)
    except records.Fault as fault:
        print(f"paper: {fault}", file=sys.stderr)
        return 1
    return 0 if is_complete else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
