"""What RTPM has promised of its figures, and whether a run keeps it."""

from typing import NamedTuple

import records


class Target(NamedTuple):
    """A bound on one figure of the rows that are as `wanted`.

    `times`: fields that make another row of the same run out of the row, by whose same figure the
    row's is divided first.
    """

    wanted: dict
    figure: str
    limit: float
    is_most: bool = True
    times: dict = {}
    unit: str = "x the floor"


def _call(transport, wait, figure, limit):
    return Target({"case": "call", "transport": transport, "wait": wait, "payload": 48}, figure,
                  limit)


def _events(figure, limit, unit, is_most=True, **wanted):
    return Target({"case": "events", "hosts": None, "stopped": None, **wanted}, figure, limit,
                  is_most, {}, unit)


TARGETS = (
    _call("shm", "spin", "ratio_p50", 1.8),
    _call("shm", "spin", "ratio_p99", 2),
    _call("shm", "block", "ratio_p50", 1.1),
    *(_call(transport, "adaptive", figure, limit) for transport in ("udp", "tcp")
      for figure, limit in (("ratio_p50", 1.15), ("ratio_p99", 1.25))),
    *(_call(transport, "block", "ratio_p50", 1.1) for transport in ("udp", "tcp")),
    Target({"case": "call-sealed", "transport": "udp", "wait": "adaptive", "payload": 48}, "ratio_p50",
           1.3, True, {}, "x a raw socket with the same seals"),
    *(Target({"case": "isolation", "transport": transport, "floor": floor, "low_callers": 4}, figure,
             1.15, True, {}, unit)
      for transport, floor, unit in (
          ("udp", None, "x two raw sockets"), ("tcp", None, "x two raw sockets"),
          ("shm", "udp", "x two raw sockets"), ("shm", None, "x two raw rings"))
      for figure in ("ratio_p50", "ratio_p99", "ratio_p999")),
    *(Target({"case": "paced", "transport": transport, "wait": "periodic", "rate_hz": 1000},
             "ratio_p50", 1.3, True, {"wait": "spin"},
             "x that of the spin wait, both by the raw socket that spins beside them")
      for transport in ("udp", "tcp", "shm")),
    *(Target({"case": "paced", "transport": transport, "wait": "periodic", "rate_hz": 1000},
             "server_cpu_percent", 10, True, {}, "% of a core")
      for transport in ("udp", "tcp", "shm")),
    Target({"case": "throughput", "transport": "shm"}, "calls_per_second", 1e6, False, {},
           "calls a second"),
    Target({"case": "throughput", "transport": "udp"}, "calls_per_second", 2e5, False, {},
           "calls a second"),
    *(Target({"case": "memory", "transport": transport, "clients": 100}, "rss_mib", 40, True, {},
             "MiB") for transport in ("udp", "tcp", "shm")),
    *(Target({"case": "idle", "transport": transport, "wait": "adaptive"}, "cpu_percent", 0.5, True,
             {}, "% of a core") for transport in ("udp", "tcp", "shm")),
    _events("ratio_each_p50", 1.15, "x two raw hops", transport="udp", consumers=1),
    _events("last_p50_us", 90, "us", transport="shm", consumers=16),
    _events("last_p50_us", 250, "us", transport="shm", consumers=64),
    _events("events_per_s", 1e6, "events a second", False, transport="shm"),
    *(Target({"case": "events", "transport": transport, "stopped": 8}, "bad_over_well_p99", 1.1,
             True, {}, "x while all are well") for transport in ("udp", "tcp", "shm")),
)


class Verdict(NamedTuple):
    """A target and what a run says of it. `value`: None where it was not measured."""

    target: Target
    name: str
    value: float
    is_met: bool


def _value_of(target, record, rows):
    value = records.figure(record, target.figure)
    if value is None or not target.times:
        return value
    key = {name: record.get(name) for name in records.IDENTITY} | target.times
    others = [records.figure(other, target.figure) for other in records.select(rows, **key)]
    return value / others[0] if others and others[0] else None


def judge(rows):
    """A Verdict for each target, in their order. `rows`: RTPM's own, without those of peers."""
    verdicts = []
    for target in TARGETS:
        found = [record for record in records.select(rows, **target.wanted)
                 if records.figure(record, target.figure) is not None]
        record = found[0] if found else target.wanted
        value = _value_of(target, record, rows) if found else None
        is_met = value is not None and (
            value <= target.limit if target.is_most else value >= target.limit)
        named = {name: value for name, value in record.items() if value is not None}
        verdicts.append(Verdict(target, records.name_of(records.key_of(named)), value, is_met))
    return verdicts
