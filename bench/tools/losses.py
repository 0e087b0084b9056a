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


def _why(notes, name, figure):
    """The notes on a row's figure, each of which is taken out, so that it is shown once."""
    found = [note for note in notes if name.startswith(note[0]) and note[1] in (figure, "*")]
    for note in found:
        notes.remove(note)
    return "".join(" " + text for _, _, text in found)


def _missed(rows, notes):
    lines = []
    for verdict in targets.judge(rows):
        if verdict.value is None or verdict.is_met:
            continue
        target = verdict.target
        lines.append(
            f"- **{verdict.name}**: {target.figure} is {tables.number(verdict.value)} "
            f"{target.unit}; the target is {'at most' if target.is_most else 'at least'} "
            f"{tables.number(target.limit)}.{' ' + tables.MARK if verdict.is_marked else ''}"
            + _why(notes, verdict.name, target.figure))
    return lines


# By which figures RTPM is judged against a peer, and how each is called.
_AGAINST_PEERS = (
    ("rtpm_over_peer_p50", "the median"), ("rtpm_over_peer_p999", "p99.9"),
    ("rtpm_over_peer_each_p50", "the median of all deliveries"),
    ("rtpm_over_peer_each_p999", "p99.9 of all deliveries"),
    ("rtpm_over_peer_last_p50", "the median of the last consumer"),
)


def _lost(peers, notes):
    lines = []
    for record in peers:
        name = tables.row_name(record, ()).removesuffix(" " + tables.MARK)
        for figure, called in _AGAINST_PEERS:
            ratio = records.figure(record, figure)
            if ratio is not None and ratio > 1:
                lines.append(f"- **{name}**: RTPM takes {tables.number(ratio)} times as long at "
                             f"{called}.{' ' + tables.MARK if record.get('marks') else ''}"
                             + _why(notes, name, figure))
    return lines


def _furthest(rows, notes):
    found = sorted(((records.figure(row, "ratio_p50") or 0, row) for row in rows
                    if row["case"] != "throughput"), key=lambda pair: -pair[0])
    return [f"- {records.name_of(records.key_of(row))}: {tables.number(ratio)} times the floor at "
            "the median, " + f"{tables.number(records.figure(row, 'p50_us'))} us instead of "
            f"{tables.number(records.figure(row, 'floor_p50_us'))} us."
            + _why(notes, records.name_of(records.key_of(row)), "ratio_p50")
            for ratio, row in found[:FURTHEST] if ratio >= FAR]


def lines(rows, peers):
    """The list, computed from the rows, as lines of Markdown. `rows`: RTPM's own."""
    notes = read_notes()
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
        lost = _lost(peers, notes)
        text += (["Lost to peers:", "", *lost, ""] if lost else
                 ["RTPM is first in every row against peers, at the median and at p99.9.", ""])
    furthest = _furthest(rows, notes)
    if furthest:
        text += ["Furthest above the raw floor:", "", *furthest, ""]
    not_measured = [f"{verdict.name}: {verdict.target.figure}" for verdict in verdicts
                    if verdict.value is None]
    if not_measured:
        text += ["Targets that were not measured: " + "; ".join(not_measured) + ".", ""]
    return text
