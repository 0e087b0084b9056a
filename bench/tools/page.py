"""The page of results: five tables, four plots and where RTPM loses, as Markdown."""

import plots
import records
import targets

MARK = "†"


def number(value):
    """A figure with three significant places or so; a dash for none."""
    if value is None:
        return "–"
    size = abs(value)
    if size >= 100_000:
        return f"{value / 1000:,.0f} k".replace(",", " ")
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.2f}"


def _ratio(record, name):
    value, ends = records.figure(record, name), records.interval(record, name)
    if value is None or ends is None:
        return number(value)
    return f"{number(value)} ({number(ends[0])}–{number(ends[1])})"


def _table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows), ""]


def _figures(record, names):
    return [_ratio(record, name) if "ratio" in name or "over" in name
            else number(records.figure(record, name)) for name in names]


def _title(record, *fields):
    text = ", ".join(str(record[field]) for field in fields if record.get(field) is not None)
    return text + (f" {MARK}" if record.get("marks") else "")


def own_rows(results):
    """RTPM's rows beside its floor: the last of each."""
    return [record for record in records.by_key(results).values()
            if record["case"] not in ("report", "part") and not {"part", "peer"} & record.keys()]


def peer_rows(results):
    """The rows of peers."""
    return [record for record in records.by_key(results).values() if "peer" in record]


def _calls(rows):
    found = records.select(rows, case="call", payload=48)
    sealed = {(row["transport"], row["wait"]): row
              for row in records.select(rows, case="call-sealed", payload=48)}
    return _table(("transport, wait", "p50", "p99", "p99.9", "floor p50", "× floor p50 (95 %)",
                   "× floor p99 (95 %)", "sealed p50", "sealed × sealed floor p50 (95 %)"), [
        [_title(row, "transport", "wait"), *_figures(row, (
            "p50_us", "p99_us", "p999_us", "floor_p50_us", "ratio_p50", "ratio_p99")),
         *_figures(sealed.get((row["transport"], row["wait"]), {}), ("p50_us", "ratio_p50"))]
        for row in found]) if found else []


def _isolation(rows):
    found = records.select(rows, case="isolation", low_callers=4)
    return _table(("transport, beside", "idle p50", "loaded p50", "loaded p99.9", "floor p99.9",
                   "× floor p50 (95 %)", "× floor p99.9 (95 %)"), [
        [_title({"floor": "udp sockets" if row.get("floor") else "its own floor"} | {
            name: row.get(name) for name in ("transport", "marks")}, "transport", "floor"),
         *_figures(row, ("idle_p50_us", "p50_us", "p999_us", "floor_p999_us", "ratio_p50",
                         "ratio_p999"))] for row in found]) if found else []


def _events(rows):
    found = [row for row in records.select(rows, case="events", stopped=None, hosts=None)
             if "ratio_each_p50" in row]
    return _table(("transport, consumers", "each p50", "each p99", "last p50", "floor last p50",
                   "× floor each p50 (95 %)"), [
        [_title(row, "transport", "consumers"), *_figures(row, (
            "each_p50_us", "each_p99_us", "last_p50_us", "floor_last_p50_us", "ratio_each_p50"))]
        for row in found]) if found else []


def _peers(others):
    found = records.select(others, case="call", rtpm_wait="block")
    return _table(("peer / RTPM's transport", "peer p50", "peer p99.9", "RTPM p50", "RTPM p99.9",
                   "RTPM ÷ peer p50 (95 %)", "RTPM ÷ peer p99.9 (95 %)"), [
        [f"{row['peer']} {row['transport']} / {row['rtpm_transport']}"
         + (f" {MARK}" if row.get("marks") else ""), *_figures(row, (
             "p50_us", "p999_us", "rtpm_p50_us", "rtpm_p999_us", "rtpm_over_peer_p50",
             "rtpm_over_peer_p999"))] for row in found]) if found else []


# (what, its rows, its figure)
_COSTS = (
    ("calls a second, 64 in flight", {"case": "throughput"}, "calls_per_second"),
    ("events a second to one consumer", {"case": "events", "wait": None}, "events_per_s"),
    ("10 kHz loop while 1000 HELLOs a second come, p99.9, µs",
     {"case": "isolation-sealed", "hello_storms": 1}, "p999_us"),
    ("server's memory, no client, MiB", {"case": "memory", "clients": 0}, "rss_mib"),
    ("server's memory, 100 clients, MiB", {"case": "memory", "clients": 100}, "rss_mib"),
    ("% of a CPU, idle", {"case": "idle", "wait": "adaptive"}, "cpu_percent"),
    ("start to first reply, µs", {"case": "startup"}, "p50_us"),
    ("p50 with 1000 silent clients, µs", {"case": "scale", "clients": 1000}, "p50_us"),
    ("periodic wait at 1 kHz, p50, µs",
     {"case": "paced", "wait": "periodic", "rate_hz": 1000}, "p50_us"),
    ("force loop at 1 kHz, p50, µs", {"case": "device", "wait": "periodic"}, "p50_us"),
)


def _costs(rows):
    found = []
    for what, wanted, figure in _COSTS:
        of = {row["transport"]: records.figure(row, figure) for row in records.select(rows, **wanted)
              if records.figure(row, figure) is not None}
        if of:
            found.append([what, *(number(of.get(name)) for name in ("udp", "tcp", "shm"))])
    return _table(("", "udp", "tcp", "shm"), found) if found else []


_AGAINST_PEERS = {
    "rtpm_over_peer_p50": "p50", "rtpm_over_peer_p999": "p99.9",
    "rtpm_over_peer_each_p50": "p50 of all deliveries",
    "rtpm_over_peer_each_p999": "p99.9 of all deliveries",
    "rtpm_over_peer_last_p50": "p50 of the last consumer"}


def _furthest(rows, count=3):
    found = [row for row in rows
             if row["case"] != "throughput" and (records.figure(row, "ratio_p50") or 0) > 1.5]
    found.sort(key=lambda row: -row["ratio_p50"])
    return ["Furthest above the raw floor, at the median:", "", *(
        f"- {records.name_of(records.key_of(row))}: {number(row['ratio_p50'])} ×, "
        f"{number(row['p50_us'])} instead of {number(row['floor_p50_us'])} µs"
        for row in found[:count]), ""] if found else []


def _losses(rows, others):
    verdicts = [each for each in targets.judge(rows) if each.value is not None]
    missed = [each for each in verdicts if not each.is_met]
    lines = [f"RTPM meets {len(verdicts) - len(missed)} of {len(verdicts)} targets. Missed:", ""]
    lines += [f"- {each.name}: {each.target.figure} {number(each.value)} {each.target.unit}, target "
              f"{'at most' if each.target.is_most else 'at least'} {number(each.target.limit)}"
              for each in missed] or ["- none"]
    lines += ["", *_furthest(rows)]
    judged = [(row, figure) for row in others for figure in _AGAINST_PEERS
              if records.figure(row, figure) is not None and records.interval(row, figure)
              and not ("last_" in figure and row.get("consumers") == 1)]
    if not judged:
        return lines
    first = sum(records.interval(row, figure)[1] <= 1 for row, figure in judged)
    lost = [pair for pair in judged if records.interval(*pair)[0] > 1]
    lines += [f"Beside peers, RTPM is surely quicker in {first} of {len(judged)} figures (95 % "
              f"confidence), surely slower in {len(lost)}:", ""]
    lines += [f"- {row['case']}, {row['peer']} {row['transport']} beside RTPM {row['rtpm_transport']}"
              + (f", {row['consumers']} consumer{'s' * (row['consumers'] > 1)}" if "consumers" in row
                 else "")
              + (", hub in the supplier's program" if row.get("hub") else "")
              + f": {_ratio(row, figure)} × the peer's {_AGAINST_PEERS[figure]}"
              for row, figure in lost] or ["- none"]
    return [*lines, ""]


def _missing(results):
    parts = list(records.by_key(records.select(results, case="part")).values())
    head = next(iter(records.select(results, case="report")), {})
    lines = []
    for part in parts:
        if part["outcome"] != "done":
            lines.append(f"- `{part['part']}` ({part['arguments']}): {part['outcome']}")
        lines += [f"- {text.removeprefix('rtpm-bench: ')}" for text in part["said"]]
    done = {part["part"] for part in parts}
    lines += [f"- `{name}`: not begun" for name in head.get("parts", []) if name not in done]
    return ["## Not measured", "", *dict.fromkeys(lines), ""] if lines else []


def _head(results, rows):
    head = next(iter(records.select(results, case="report")), {})
    machine = next((row["environment"] for row in rows if "environment" in row), {})
    return [
        "# Results", "",
        "RTPM beside its raw floor: plain sockets or rings that move the same bytes with the same "
        "wait,", "priority and CPUs, by turns in one run. Times in µs belong to this machine; quote "
        "the ratios.", "[README.md](README.md) says how it is measured; [PYTHON.md](PYTHON.md) has the Python "
        "package.", "",
        f"Commit {head.get('commit') or 'unknown'}, {head.get('date', 'date unknown')}, "
        f"{head.get('form', 'part of a')} run; {machine.get('cpu', 'unknown CPU')}, "
        f"{machine.get('cpu_count', '?')} CPUs{', virtual' if machine.get('virtualised') else ''}; "
        f"Linux {machine.get('kernel', '?')};",
        f"{'SCHED_FIFO' if machine.get('realtime') else 'time-shared'}; compiler "
        f"{machine.get('compiler', '?')}. {MARK}: disturbed by other machines on the host.",
        "–: fewer than ten samples beyond it.", ""]


_TITLES = {"peers": "RTPM among other middleware, calls of 48 bytes",
           "isolation": "The urgent caller beside an idle and a saturated server",
           "paper-one-node": "The paper's Figure 6 again", "paper-two-nodes": "Figure 7 again"}


def _picture(name, drawn):
    if name not in drawn:
        return []
    return ["<picture>",
            f'  <source media="(prefers-color-scheme: dark)" srcset="results/{name}-dark.svg">',
            f'  <img alt="{_TITLES[name]}" src="results/{name}-light.svg">', "</picture>", ""]


def page(results, drawn):
    """The page as text. `drawn`: the names of the plots that there are."""
    rows, others = own_rows(results), peer_rows(results)
    sections = (
        ("Calls", "48 bytes there and back, one call after the other.", _calls(rows), ()),
        ("Isolation", "A caller of high priority at 1 kHz; 4 callers of low priority saturate the "
         "server's CPU.\nIdle, each call wakes a sleeping CPU: so the loaded median may be lower.",
         _isolation(rows), ("isolation",)),
        ("Events", "32 bytes at 1 kHz through a hub; the floor is a raw UDP relay.", _events(rows),
         ()),
        ("Other middleware", "Calls of 48 bytes; all block while they wait, on the same CPUs and "
         "priorities.", _peers(others), ("peers",)),
        ("What it costs", "", _costs(rows), ()),
    )
    lines = [*_head(results, rows), "## Where RTPM loses", "", *_losses(rows, others)]
    for heading, text, table, pictures in sections:
        if table:
            lines += [f"## {heading}", "", *([text, ""] if text else [])]
            lines += [line for name in pictures for line in _picture(name, drawn)] + table
    paper = [line for name in plots.PAPER_MARKS for line in _picture(name, drawn)]
    if paper:
        lines += ["## The paper's section 5 again", "", *paper]
    return "\n".join(lines + _missing(results)).rstrip() + "\n"
