"""The report's tables, as Markdown, from the rows of a run."""

import records

MARK = "†"


def number(value):
    """A figure with three significant places or so; a dash for none."""
    if value is None:
        return "–"
    if value == int(value) and abs(value) < 100_000:
        return str(int(value))
    size = abs(value)
    if size >= 100_000:
        return f"{value / 1000:,.0f} k".replace(",", " ")
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"


def markdown(head, rows):
    """A Markdown table, the first column to the left, the others to the right."""
    lines = ["| " + " | ".join(head) + " |",
             "|---|" + "---:|" * (len(head) - 1)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def row_name(record, leave_out=("case",)):
    """A row's name without what the section's heading says, with a mark if it was disturbed."""
    key = [pair for pair in records.key_of(record) if pair[0] not in (*leave_out, "part")]
    return records.name_of(key) + (f" {MARK}" if record.get("marks") else "")


# (head of a column, its figure)
DUEL = (("p50", "p50_us"), ("p99", "p99_us"), ("p99.9", "p999_us"), ("p99.99", "p9999_us"),
        ("max", "max_us"), ("floor p50", "floor_p50_us"), ("p99", "floor_p99_us"),
        ("p99.9", "floor_p999_us"), ("ratio p50", "ratio_p50"), ("p99", "ratio_p99"),
        ("p99.9", "ratio_p999"))
LOADED = DUEL + (("loaded/idle p99", "loaded_over_idle_p99"), ("p99.9", "loaded_over_idle_p999"))
EVENTS = (("each p50", "each_p50_us"), ("p99", "each_p99_us"), ("last p50", "last_p50_us"),
          ("p99", "last_p99_us"), ("floor each p50", "floor_each_p50_us"),
          ("last p50", "floor_last_p50_us"), ("ratio each p50", "ratio_each_p50"),
          ("p99", "ratio_each_p99"), ("ratio last p50", "ratio_last_p50"),
          ("p99", "ratio_last_p99"), ("missing", "missing"), ("lost", "lost"))
BAD_CONSUMERS = (("others p50", "each_p50_us"), ("p99", "each_p99_us"),
                 ("all well p50", "well_each_p50_us"), ("p99", "well_each_p99_us"),
                 ("ratio p50", "bad_over_well_p50"), ("p99", "bad_over_well_p99"))
EVENT_RATE = (("events a second", "events_per_s"), ("missing", "missing"), ("told as lost", "lost"))
THROUGHPUT = (("calls a second", "calls_per_second"), ("lowest block", "calls_per_second_low"),
              ("highest", "calls_per_second_high"), ("floor", "floor_calls_per_second"),
              ("ratio", "ratio"))
LADDER = (("p50", "p50_us"), ("p90", "p90_us"), ("p99", "p99_us"), ("max", "max_us"),
          ("raw relay p50", "floor_p50_us"), ("p99", "floor_p99_us"), ("ratio p50", "ratio_p50"),
          ("p99", "ratio_p99"), ("missing", "missing"))
STARTUP = (("p50", "p50_us"), ("p90", "p90_us"), ("max", "max_us"), ("of it, serves p50", "ready_p50_us"),
           ("bind p50", "bind_p50_us"), ("first call p50", "first_call_p50_us"),
           ("floor p50", "floor_p50_us"), ("ratio p50", "ratio_p50"))
MEMORY = (("MiB in memory", "rss_mib"), ("of its own", "pss_mib"),
          ("KiB for each client", "per_client_kib"), ("floor, no client, MiB", "floor_rss_mib"))
PEER_EVENTS = (("each p50", "each_p50_us"), ("p99", "each_p99_us"), ("p99.9", "each_p999_us"),
               ("last p50", "last_p50_us"), ("p99", "last_p99_us"), ("RTPM each p50", "rtpm_each_p50_us"),
               ("last p50", "rtpm_last_p50_us"),
               ("RTPM / peer each p50", "rtpm_over_peer_each_p50"),
               ("p99", "rtpm_over_peer_each_p99"), ("p99.9", "rtpm_over_peer_each_p999"),
               ("last p50", "rtpm_over_peer_last_p50"), ("p99", "rtpm_over_peer_last_p99"),
               ("missing", "missing"))
PEERS = (("p50", "p50_us"), ("p99", "p99_us"), ("p99.9", "p999_us"), ("max", "max_us"),
         ("RTPM p50", "rtpm_p50_us"), ("p99", "rtpm_p99_us"), ("p99.9", "rtpm_p999_us"),
         ("RTPM / peer p50", "rtpm_over_peer_p50"), ("p99", "rtpm_over_peer_p99"),
         ("p99.9", "rtpm_over_peer_p999"))


def in_common(rows):
    """The parts of the rows' names in which they all agree, other than the transport."""
    keys = [dict(records.key_of(row)) for row in rows]
    return [(name, value) for name, value in keys[0].items()
            if name not in ("case", "part", "transport", "peer", "rtpm_transport") and len(rows) > 1
            and all(key.get(name) == value for key in keys)]


def of(rows, columns, leave_out=("case",)):
    """A table of rows that are alike, without columns of which no row has a figure."""
    used = [(head, name) for head, name in columns
            if any(records.figure(record, name) is not None for record in rows)]
    return markdown(
        ["", *(head for head, _ in used)],
        [[row_name(record, leave_out),
          *(number(records.figure(record, name)) for _, name in used)] for record in rows])
