"""What rtpm-bench writes with --json: one object a line, here read back.

A record is a dict as it stands in the file. Fields may be lists of numbers, one for each round of
the run, or for each few rounds where one has too few samples: those whose name has `rounds_` in it
("floor_rounds_p50_us" belongs to "floor_p50_us").
"""

import json
import math
import statistics

# What tells one row from another, in the order in which a row is named. All else is measured.
IDENTITY = (
    "case", "part", "peer", "transport", "floor", "hub", "delivery", "wait", "rtpm_transport",
    "rtpm_wait", "payload", "rate_hz", "low_callers", "work_us", "consumers", "stopped",
    "slow", "hosts", "in_flight", "clients", "hello_storms",
)

# How a part of a row's name is said to people; "{}" stands for the value. Others: "name value".
_WORDS = {
    "case": "{}", "part": "({})", "peer": "{}", "transport": "{}",
    "floor": "beside raw {} sockets", "hub": "hub in the {} program", "delivery": "by {}", "wait": "{}",
    "rtpm_transport": "beside RTPM over {}", "rtpm_wait": "{} wait", "payload": "{} B",
    "rate_hz": "{} Hz", "low_callers": "{} low callers", "work_us": "{} us work",
    "consumers": "{} consumers", "stopped": "{} stopped", "slow": "{} slow", "hosts": "{} hosts", "in_flight": "{} in flight",
    "clients": "{} clients", "hello_storms": "{} storms of HELLOs",
}


class Fault(Exception):
    """Something that a user can mend; its text is one sentence that names it."""


def read(path, keep_partial=False):
    """The records of the file at `path`, in its order.

    `keep_partial`: a last line that an interrupted run left unfinished is left out; else it is a
    Fault, like a line that is no JSON object, an object without "case", and a file that cannot be
    read.
    """
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise Fault(f"{path} cannot be read: {reason}") from None
    lines = text.split("\n")
    records = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            record = json.loads(line)
        except ValueError as error:
            if keep_partial and number == len(lines):
                continue
            raise Fault(f"{path}, line {number}: this is no JSON: {error}") from None
        if not isinstance(record, dict) or not isinstance(record.get("case"), str):
            raise Fault(f'{path}, line {number}: this is no result: it has no field "case"')
        records.append(record)
    return records


def key_of(record):
    """What the record is a result of, as a tuple of (field, value)."""
    return tuple((name, record[name]) for name in IDENTITY if name in record)


def name_of(key):
    """A key for people: "call, udp, adaptive, 48 B"."""
    return ", ".join(_said(name, value) for name, value in key)


def _said(name, value):
    words = _WORDS.get(name, name + " {}")
    # "1 consumer", not "1 consumers".
    return (words.removesuffix("s") if value == 1 else words).format(_plain(value))


def _plain(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def by_key(records):
    """The records by their key, in the order of the first of each; of several, the last."""
    return {key_of(record): record for record in records}


def select(records, **wanted):
    """Those whose fields are as `wanted`; None: they lack the field."""
    return [record for record in records
            if all(record.get(name) == value for name, value in wanted.items())]


def is_number(value):
    """Whether `value` is a number that can be computed with."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def rounds_of(record):
    """What each round showed, by the figure's name: {"p50_us": [6.5, 6.6], "ratio_p50": […], …}.

    Ratios are computed round by round, because the contenders took turns in each: RTPM's to the
    floor, or in a peer's row RTPM's to the peer.
    """
    found = {}
    for name, values in record.items():
        if "rounds_" not in name or not isinstance(values, list):
            continue
        if values and all(is_number(value) for value in values):
            found[name.replace("rounds_", "", 1)] = values
    over, under, ratio = (("rtpm_", "", "rtpm_over_peer_") if "peer" in record
                          else ("", "floor_", "ratio_"))
    for name in [name.removeprefix(over) for name in found if name.startswith(over)]:
        values, below = found[over + name], found.get(under + name)
        if below and len(below) == len(values) and min(below) > 0:
            found[ratio + name.removesuffix("_us")] = [
                value / each for value, each in zip(values, below)]
    return found


# Of how many samples a figure whose name has that in it is at least: ten lie beyond it. Fewer tell
# nothing of it.
_SAMPLES_MIN = {"p99_": 1000, "p99$": 1000, "p999_": 10_000, "p999$": 10_000, "p9999_": 100_000,
                "p9999$": 100_000}


def has_samples_for(record, name):
    """Whether a record rests on enough samples for its figure `name`, a percentile or not."""
    count = record.get("n")
    if not is_number(count):
        return True
    if "each_" in name:
        count *= record.get("consumers", 1)
    ends = name + "$"
    return all(count >= least for part, least in _SAMPLES_MIN.items() if part in ends)


def middle(values):
    """The mean of the middle half of some values, as rtpm-bench takes it."""
    cut = (len(values) + 1) // 4
    return statistics.fmean(sorted(values)[cut:len(values) - cut])


def figure(record, name):
    """The figure `name` of a record, a number, or None where the record has none, or too few
    samples for it.

    A figure that is told only round by round is the middle of its rounds.
    """
    if not has_samples_for(record, name):
        return None
    value = record.get(name)
    if is_number(value):
        return float(value)
    rounds = rounds_of(record).get(name)
    return middle(rounds) if rounds else None


def interval(record, name):
    """Where the ratio `name` lies with 95 % confidence, (low, high), or None where that is not told."""
    ends = record.get(name + "_low"), record.get(name + "_high")
    return ends if all(is_number(end) for end in ends) else None
