"""How two runs of rtpm-bench differ: compare.py [--all] A.jsonl B.jsonl

For each row that both have, and each figure that was told round by round: both values, the
difference in percent of A's, and the interval in which it lies with 95 % confidence. The interval is
found by drawing the rounds of each run again and again (bootstrap of their middles), so it knows what
moved within the runs, and not what a reboot or another day would have changed.

Exit codes: 0 compared; 2 something is wrong with a file or an option, said in one sentence.
"""

import argparse
import random
import sys

import records

DRAW_COUNT = 2000
CONFIDENCE_PERCENT = 95
# Smaller differences are not worth a word, however sure they are.
LEAST_PERCENT = 2
# What two runs on one machine are to agree within, at the median of a ratio.
AGREEMENT_PERCENT = 10
RATIOS_AT_THE_MEDIAN = ("ratio_p50", "ratio_each_p50", "ratio_last_p50", "rtpm_over_peer_p50",
                        "rtpm_over_peer_each_p50", "rtpm_over_peer_last_p50")
# Without --all.
MAIN_FIGURES = (
    "p50_us", "p99_us", "p999_us", "ratio_p50", "ratio_p99", "ratio_p999", "each_p50_us",
    "each_p99_us", "ratio_each_p50", "ratio_each_p99", "ratio_last_p50", "calls_per_second",
    "rss_mib", "rtpm_over_peer_p50", "rtpm_over_peer_p999", "rtpm_over_peer_each_p50",
    "rtpm_over_peer_last_p50",
)


def interval(first, second, seed):
    """Where the difference of the middles of `second` and `first` lies, in percent of the latter's:
    (low, high). `seed` makes it repeatable. Both lists have numbers above 0.
    """
    draw = random.Random(seed)
    differences = sorted(
        100 * (records.middle(draw.choices(second, k=len(second)))
               / records.middle(draw.choices(first, k=len(first))) - 1)
        for _ in range(DRAW_COUNT))
    outside = (100 - CONFIDENCE_PERCENT) / 200
    low = differences[int(outside * DRAW_COUNT)]
    high = differences[min(DRAW_COUNT - 1, int((1 - outside) * DRAW_COUNT))]
    return low, high


class Difference:
    """One figure of one row in both runs.

    `is_sure`: the interval leaves out zero, and the difference is worth a word.
    """

    def __init__(self, name, first, second):
        self.name = name
        self.first = records.middle(first)
        self.second = records.middle(second)
        self.percent = 100 * (self.second / self.first - 1)
        # One round tells nothing of what moves by itself.
        self.has_interval = min(len(first), len(second)) > 1
        self.low, self.high = (interval(first, second, name) if self.has_interval
                               else (self.percent, self.percent))
        self.is_sure = (self.has_interval and (self.low > 0 or self.high < 0)
                        and abs(self.percent) >= LEAST_PERCENT)


def differences(first, second, takes_all):
    """The Differences of two records of one key, in the order of the main figures."""
    rounds = records.rounds_of(first), records.rounds_of(second)
    names = [name for name in rounds[0] if name in rounds[1]]
    if not takes_all:
        names = [name for name in MAIN_FIGURES if name in names]
    return [Difference(name, rounds[0][name], rounds[1][name]) for name in names
            if min(rounds[0][name]) > 0 and min(rounds[1][name]) > 0]


def environment_lines(first, second):
    """What the two runs' machines differ in, a line each."""
    one = next((record.get("environment", {}) for record in first), {})
    other = next((record.get("environment", {}) for record in second), {})
    return [f"  {name}: {one.get(name, 'not told')} / {other.get(name, 'not told')}"
            for name in sorted({*one, *other}) if one.get(name) != other.get(name)]


def short(value):
    """A number with three significant places or so."""
    size = abs(value)
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"


def row_lines(key, found):
    """A row's table."""
    lines = [records.name_of(key)]
    for each in found:
        span = f"{each.low:+7.1f} … {each.high:+.1f} %" if each.has_interval else "one round"
        verdict = "  DIFFERS" if each.is_sure else ""
        lines.append(f"  {each.name:<18} {short(each.first):>9} {short(each.second):>9} "
                     f"{each.percent:+8.1f} %  ({span.strip()}){verdict}")
    return lines


def summary_lines(all_found):
    """Which figures differ beyond noise, and how well the ratios' medians agree."""
    sure = [(key, each) for key, found in all_found for each in found if each.is_sure]
    count = sum(len(found) for _, found in all_found)
    lines = [f"{len(sure)} of {count} figures differ beyond noise"
             + (":" if sure else "; no difference is proven.")]
    for key, each in sorted(sure, key=lambda pair: -abs(pair[1].percent)):
        lines.append(f"  {each.percent:+7.1f} %  {each.name} of {records.name_of(key)}")
    # Of one round, nothing is known of what moves by itself: the paper's 1000 calls are not judged.
    # To one consumer, each delivery is the last.
    ratios = [(key, each) for key, found in all_found for each in found
              if each.name in RATIOS_AT_THE_MEDIAN and each.has_interval
              and not ("last_" in each.name and dict(key).get("consumers") == 1)]
    if ratios:
        apart = [pair for pair in ratios if abs(pair[1].percent) > AGREEMENT_PERCENT]
        lines.append(f"{len(ratios) - len(apart)} of {len(ratios)} ratios agree at the median "
                     f"within {AGREEMENT_PERCENT} %" + (", but not:" if apart else "."))
        for key, each in sorted(apart, key=lambda pair: -abs(pair[1].percent)):
            lines.append(f"  {each.percent:+7.1f} %  {records.name_of(key)}: {short(each.first)} / "
                         f"{short(each.second)}" + ("" if each.is_sure else ", which may be noise"))
    return lines


def compare(first, second, takes_all):
    """The whole comparison of two lists of records, as lines."""
    one, other = records.by_key(first), records.by_key(second)
    lines = []
    apart = environment_lines(first, second)
    if apart:
        lines += ["The runs differ in where they were made (A / B):", *apart, ""]
    all_found = [(key, differences(one[key], other[key], takes_all))
                 for key in one if key in other]
    all_found = [(key, found) for key, found in all_found if found]
    for key, found in all_found:
        lines += [*row_lines(key, found), ""]
    for who, mine, theirs in (("A", one, other), ("B", other, one)):
        lines += [f"only in {who}: {records.name_of(key)}" for key in mine if key not in theirs]
    if not all_found:
        raise records.Fault("the two files have no figure in common that was told round by round")
    return lines + summary_lines(all_found)


def main(arguments):
    """The program. @return its exit code."""
    parser = argparse.ArgumentParser(prog="compare", description="How two runs of rtpm-bench differ.")
    parser.add_argument("first", metavar="A.jsonl")
    parser.add_argument("second", metavar="B.jsonl")
    parser.add_argument("--all", action="store_true", help="every figure, not only the main ones")
    options = parser.parse_args(arguments)
    try:
        lines = compare(records.read(options.first, keep_partial=True),
                        records.read(options.second, keep_partial=True), options.all)
    except records.Fault as fault:
        print(f"compare: {fault}", file=sys.stderr)
        return 2
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
