"""The honest list: where RTPM loses to others, misses what it set itself, or is far from the floor."""

import os

import records
import tables
import targets

# What of the rows not named otherwise stands furthest above the floor, so many of them.
FURTHEST = 5
FAR = 1.5
NOTES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "notes.txt")


def read_notes(path=NOTES):
    """Why a row is as it is: a list of (how the row's name begins, figure, text).

    The file is kept by hand: a note a line, its three parts parted by "|"; lines that begin with #
    are comments; the figure * is every one.
    """
    notes = []
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if not line.strip() or line.startswith("#"):
                continue
            parts = [part.strip() for part in line.split("|")]
            if len(parts) != 3:
                raise records.Fault(f"{path}, line {number}: a note has three parts, not "
                                    f"{len(parts)}: row | figure | why")
            notes.append(tuple(parts))
    return notes


class _Notes:
    """What is known of why rows are as they are; each note is told in full once."""

    def __init__(self, notes):
        self._notes = notes
        self._told = set()

    def why(self, name, figure):
        """The notes on a row's figure, with a space before them; "" if there is none."""
        said = []
        for number, (begin, of, text) in enumerate(self._notes):
            if not name.startswith(begin) or of not in (figure, "*"):
                continue
            said.append(text if number not in self._told else "(Why: as said above.)")
            self._told.add(number)
        return "".join(" " + text for text in said)


def _by_chance(verdict):
    if not verdict.may_be_met():
        return ""
    low, high = map(tables.number, verdict.interval)
    return f" It may be chance: with 95 % confidence it lies from {low} to {high}."


def _beside_others(verdict):
    shared, rounds = verdict.beside_others
    if not shared:
        return ""
    return f" Somebody else computed on a core of the run in {shared} of its {rounds} rounds."


def _missed(rows, notes):
    lines = []
    for verdict in targets.judge(rows):
        if verdict.value is None or verdict.is_met:
            continue
        target = verdict.target
        beside_others = _beside_others(verdict)
        why = notes.why(verdict.name, target.figure) or _by_chance(verdict)
        lines.append(
            f"- **{verdict.name}**: {target.figure} is {tables.number(verdict.value)} "
            f"{target.unit}; the target is {'at most' if target.is_most else 'at least'} "
            f"{tables.number(target.limit)}.{' ' + tables.MARK if verdict.is_marked else ''}"
            + (beside_others + why or NO_REASON))
    return lines


# By which figures RTPM is judged against a peer, and how each is called.
_AGAINST_PEERS = (
    ("rtpm_over_peer_p50", "the median"), ("rtpm_over_peer_p999", "p99.9"),
    ("rtpm_over_peer_each_p50", "the median of all deliveries"),
    ("rtpm_over_peer_each_p999", "p99.9 of all deliveries"),
    ("rtpm_over_peer_last_p50", "the median of the last consumer"),
)
NO_REASON = " No reason is known."
# As near to the floor as that, RTPM has nothing left to gain.
_AT_THE_FLOOR = 1.15


class _Standing:
    """How RTPM stands against a peer in one figure of one row.

    `outcome`: "first", "lost", or "open" where the interval of the ratio has 1 in it, so that another
    run may turn it round.
    """

    def __init__(self, record, figure, called):
        self.name = tables.row_name(record, ()).removesuffix(" " + tables.MARK)
        self.figure = figure
        self.called = called
        self.mark = " " + tables.MARK if record.get("marks") else ""
        self.ratio = records.figure(record, figure)
        self.interval = records.interval(record, figure) or (self.ratio, self.ratio)
        low, high = self.interval
        self.outcome = "lost" if low > 1 else "open" if self.ratio > 1 or high > 1 else "first"
        percentile = figure.removeprefix("rtpm_over_peer_")
        ours, floor = (records.figure(record, f"{who}_{percentile}_us") for who in ("rtpm", "floor"))
        self.is_at_floor = bool(ours and floor and ours <= _AT_THE_FLOOR * floor)
        self.floor_us = floor

    def ratio_text(self):
        """The ratio and its interval."""
        return (f"{tables.number(self.ratio)} times as long ({tables.number(self.interval[0])} to "
                f"{tables.number(self.interval[1])})")

    def line(self, notes):
        """What was lost, and why."""
        why = notes.why(self.name, self.figure)
        if not why and self.is_at_floor:
            why = (f" So does the raw floor of its transport, {tables.number(self.floor_us)} us: the "
                   "peer's transport is the quicker one here.")
        return (f"- **{self.name}**: RTPM takes {self.ratio_text()} at {self.called}.{self.mark}"
                + (why or NO_REASON))


def standings(peers):
    """A _Standing for each figure that the rows of peers tell."""
    return [_Standing(record, figure, called) for record in peers
            for figure, called in _AGAINST_PEERS if records.figure(record, figure) is not None
            # To one consumer, each delivery is the last.
            and not ("last_" in figure and record.get("consumers") == 1)]


def _against_peers(peers, notes):
    """Where RTPM is first, where not, where that is open, and what tells nothing."""
    found = standings(peers)
    first, lost, still_open = ([each for each in found if each.outcome == outcome]
                               for outcome in ("first", "lost", "open"))
    # Not those that the row cannot have, but those of which it has too few samples.
    untold = sum(records.is_number(record.get(figure)) and records.figure(record, figure) is None
                 for record in peers for figure, _ in _AGAINST_PEERS)
    text = ["Against peers, RTPM is first in " + (
        f"every one of {len(found)} figures" if len(first) == len(found) else
        f"{len(first)} of {len(found)} figures (the medians and p99.9 of all rows), loses "
        f"{len(lost)}, and {len(still_open)} are too close to tell")
            + (f"; too few samples tell of {untold} more, all of them p99.9" if untold else "") + ".",
            ""]
    if lost:
        text += ["Lost to peers (in brackets, where the ratio lies with 95 % confidence):", "",
                 *(each.line(notes) for each in lost), ""]
    if still_open:
        text += ["Too close to tell, as the interval has 1 in it:", "",
                 *(f"- {each.name}: {each.ratio_text()} at {each.called}.{each.mark}"
                   for each in still_open), ""]
    return text


def _furthest(rows, notes):
    found = sorted(((records.figure(row, "ratio_p50") or 0, row) for row in rows
                    if row["case"] != "throughput"), key=lambda pair: -pair[0])
    return [f"- {records.name_of(records.key_of(row))}: {tables.number(ratio)} times the floor at "
            "the median, " + f"{tables.number(records.figure(row, 'p50_us'))} us instead of "
            f"{tables.number(records.figure(row, 'floor_p50_us'))} us."
            + notes.why(records.name_of(records.key_of(row)), "ratio_p50")
            for ratio, row in found[:FURTHEST] if ratio >= FAR]


def lines(rows, peers):
    """The list, computed from the rows, as lines of Markdown. `rows`: RTPM's own."""
    notes = _Notes(read_notes())
    verdicts = targets.judge(rows)
    measured = [verdict for verdict in verdicts if verdict.value is not None]
    met = sum(verdict.is_met for verdict in measured)
    text = ["## Where RTPM loses, or misses what it set itself", "",
            f"{met} of {len(measured)} measured targets are met"
            + (f"; {len(verdicts) - len(measured)} were not measured in this run."
               if len(measured) < len(verdicts) else "."), ""]
    missed = _missed(rows, notes)
    text += ["Missed targets:", "", *missed, ""] if missed else []
    if peers:
        text += _against_peers(peers, notes)
    furthest = _furthest(rows, notes)
    if furthest:
        text += ["Furthest above the raw floor:", "", *furthest, ""]
    not_measured = [f"{verdict.name}: {verdict.target.figure}" for verdict in verdicts
                    if verdict.value is None]
    if not_measured:
        text += ["Targets that were not measured: " + "; ".join(not_measured) + ".", ""]
    return text
