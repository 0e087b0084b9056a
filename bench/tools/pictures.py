"""The report's plots, from the rows of a run."""

import plots
import records

RTPM_STYLE = "linespoints pointtype {} pointsize 0.8"
FLOOR_STYLE = RTPM_STYLE + " dashtype 2"
# Of the first figure of a plot and of the second: filled and hollow for RTPM and the floor.
POINTS = ((7, 6), (5, 4))


def _curve(rows, x_name, y_name):
    points = [(record[x_name], records.figure(record, y_name)) for record in rows]
    return sorted((x, y) for x, y in points if y is not None)


def _both(rows, x_name, figures, label):
    """RTPM's curves and the floor's, for each (figure, what it is called)."""
    series = []
    for (figure, called), (filled, hollow) in zip(figures, POINTS):
        for prefix, who, style in (("", "RTPM", RTPM_STYLE.format(filled)),
                                   ("floor_", "floor", FLOOR_STYLE.format(hollow))):
            points = _curve(rows, x_name, prefix + figure)
            if len(points) > 1:
                series.append(plots.Series(f"{who}, {label}, {called}", points, style))
    return series


def consumers(rows):
    """How long the last consumer waits, by how many there are."""
    fan_out = [record for record in records.select(rows, case="events", hosts=None, stopped=None)
               if "last_p50_us" in record]
    series = []
    for transport in ("udp", "tcp", "shm"):
        series += _both(records.select(fan_out, transport=transport), "consumers",
                        (("last_p50_us", "p50"), ("last_p99_us", "p99")), transport)
    return plots.Plot("consumers", "Events at 1 kHz: until the last consumer has one", "consumers",
                      "microseconds", series, True, True)


def isolation(rows):
    """The urgent caller's tail, by how many others saturate the server."""
    series = []
    for transport in ("udp", "tcp", "shm"):
        series += _both(records.select(rows, case="isolation", transport=transport, floor=None),
                        "low_callers", (("p50_us", "p50"), ("p999_us", "p99.9")), transport)
    return plots.Plot("isolation", "A 1 kHz caller of high priority beside callers of low priority",
                      "callers of low priority that saturate the server", "microseconds", series,
                      False, True)


def payload(rows):
    """How a call grows with what it carries."""
    series = []
    for transport in ("udp", "tcp", "shm"):
        found = [record for record in records.select(rows, case="call", transport=transport,
                                                     wait="adaptive") if record["payload"] > 0]
        series += _both(found, "payload", (("p50_us", "p50"),), transport)
    return plots.Plot("payload", "Calls by their payload, each way", "bytes", "microseconds", series,
                      True, True)


def tails(rows):
    """The distributions of 48-byte calls by their percentiles."""
    ticks = tuple((place, text) for place, text in
                  enumerate(("p50", "p90", "p99", "p99.9", "p99.99", "max")))
    series = []
    for record in records.select(rows, case="call", wait="adaptive", payload=48):
        for prefix, who, style in (("", "RTPM", RTPM_STYLE.format(7)),
                                   ("floor_", "floor", FLOOR_STYLE.format(6))):
            values = [records.figure(record, prefix + name) for name in
                      ("p50_us", "p90_us", "p99_us", "p999_us", "p9999_us", "max_us")]
            series.append(plots.Series(f"{who}, {record['transport']}",
                                       [pair for pair in enumerate(values) if pair[1]], style))
    return plots.Plot("tails", "Calls of 48 bytes, adaptive wait", "percentile", "microseconds",
                      series, False, True, ticks)


def peers(rows):
    """RTPM beside its peers: calls, at the median and at p99.9."""
    found = [record for record in rows if "peer" in record and record["case"] == "call"
             and record.get("rtpm_wait") == "block"]
    ticks = tuple((place, f"{record['peer']} {record['transport']} / {record['rtpm_transport']}")
                  for place, record in enumerate(found))
    series = [plots.Series(f"{who}, {called}",
                           [(place, records.figure(record, prefix + figure))
                            for place, record in enumerate(found)
                            if records.figure(record, prefix + figure)], f"points {shape}")
              for prefix, who, shape in (("", "peer", "pointtype 7"),
                                         ("rtpm_", "RTPM beside it", "pointtype 4"))
              for figure, called in (("p50_us", "p50"), ("p999_us", "p99.9"))]
    return plots.Plot("peers", "Calls of 48 bytes, all block: a peer's transport / RTPM's beside it", "",
                      "microseconds", [each for each in series if each.points], False, True, ticks)


def draw_all(rows, folder):
    """Draws what there are rows for. @return the names of the plots that were drawn."""
    drawn = []
    for make in (tails, payload, isolation, consumers, peers):
        plot = make(rows)
        if plot.series:
            plots.draw(plot, folder)
            drawn.append(plot.name)
    return drawn
