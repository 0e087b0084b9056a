"""The page's plots, by matplotlib: each as NAME-light.svg and NAME-dark.svg."""

import os

import records

try:
    import matplotlib
    matplotlib.use("svg")
    from matplotlib import pyplot
    import numpy
except ImportError:
    pyplot = None

RTPM, QUIET = "#d1495b", "#8a929e"
INK = {"light": "#1f2328", "dark": "#e6edf3"}
BINS_PER_OCTAVE = 8
# What the paper states in its text; its figures have no numbers to read off.
PAPER_MARKS = {"paper-one-node": (58, "paper, Figure 6: 91 % of the calls within 58 µs"),
               "paper-two-nodes": (110, "paper, Figure 7: the network alone adds about 110 µs")}
PAPER_TITLES = {"paper-one-node": "1000 calls of 48 bytes, one node",
                "paper-two-nodes": "1000 calls of 48 bytes, two nodes"}


def _ranges(axes, rows):
    """Horizontal ranges from p50 to p99.9: rows of (label, p50, p999, is_rtpm), the first on top."""
    for place, (_, low, high, is_rtpm) in enumerate(rows):
        colour = RTPM if is_rtpm else QUIET
        axes.plot([low, high], [place, place], color=colour, linewidth=6, solid_capstyle="round")
        axes.annotate(f"{low:.0f}–{high:.0f}", (high, place), (7, 0), textcoords="offset points",
                      va="center", fontsize=8, color=colour if is_rtpm else None)
    axes.set_yticks(range(len(rows)), [row[0] for row in rows])
    for text, row in zip(axes.get_yticklabels(), rows):
        if row[3]:
            text.set(color=RTPM, weight="bold")
    axes.invert_yaxis()


def _microseconds(axes, ticks):
    axes.set_xscale("log")
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(axis="x", alpha=0.25)


def _peer_rows(results, transports):
    """RTPM and its peers over such transports of RTPM, the quickest median first."""
    rows = {}
    for record in records.select(results, case="call", rtpm_wait="block"):
        ours = record["rtpm_transport"]
        if ours not in transports or (record["transport"] == "tcp") != (ours == "tcp"):
            continue
        for name, prefix in ((f"RTPM {ours}", "rtpm_"),
                             (f"{record['peer']} {record['transport']}", "")):
            ends = [records.figure(record, prefix + end) for end in ("p50_us", "p999_us")]
            if None not in ends:
                rows.setdefault(name, (name, *ends, bool(prefix)))
    return sorted(rows.values(), key=lambda row: row[1])


def peers(results):
    """RTPM among its peers: calls of 48 bytes, all block."""
    network, host = (_peer_rows(results, each) for each in (("udp", "tcp"), ("shm",)))
    if not network or not host:
        return None
    figure, both = pyplot.subplots(2, 1, sharex=True, figsize=(8, 6.6), height_ratios=[
        len(network), len(host)])
    for axes, rows, title in zip(both, (network, host), (
            "Over the loopback interface", "Within the host: shared memory, Unix sockets")):
        _ranges(axes, rows)
        axes.set_title(title, loc="left", fontsize=10)
        _microseconds(axes, (10, 20, 50, 100, 200, 500))
        axes.set_xlim(10, 620)
    both[1].set_xlabel("µs for a call of 48 bytes, from p50 to p99.9")
    return figure


def isolation(results):
    """The urgent caller, the server idle and saturated."""
    found = [record for record in records.select(results, case="isolation", floor=None, low_callers=4)
             if "peer" not in record and "part" not in record]
    panels = []
    for prefix in ("idle_", ""):
        rows = []
        for record in found:
            for name, of in ((f"RTPM {record['transport']}", ""), ("raw floor", "floor_")):
                low, high = (record.get(f"{of}{prefix}{end}_us") for end in ("p50", "p999"))
                if low and high:
                    rows.append((name, low, high, not of))
        panels.append(rows)
    if not all(panels):
        return None
    figure, both = pyplot.subplots(1, 2, sharex=True, sharey=True, figsize=(8, 3.2))
    for axes, rows, title in zip(both, panels, (
            "Server idle", "Server saturated by 4 callers of low priority")):
        _ranges(axes, rows)
        axes.set_title(title, loc="left", fontsize=10)
        _microseconds(axes, (10, 20, 50, 100, 200))
        axes.set_xlim(8, 330)
        axes.set_xlabel("µs, from p50 to p99.9")
    both[1].invert_yaxis()  # Shared with the first panel: _ranges() inverted it twice.
    return figure


def _histogram(axes, values, **style):
    places = numpy.floor(numpy.log2(numpy.maximum(values, 0.01)) * BINS_PER_OCTAVE)
    edges = 2 ** (numpy.arange(places.min() - 1, places.max() + 3) / BINS_PER_OCTAVE)
    counts, _ = numpy.histogram(values, edges)
    axes.stairs(100 * counts / len(values), edges, **style)


def distributions(name, results):
    """A figure of the paper: a panel for each transport, RTPM above its floor."""
    found = [record for record in results if record.get("part") == {
        "paper-one-node": "paper-calls"}.get(name, name) and record.get("latencies_us")]
    found = list(records.by_key(found).values())
    if not found:
        return None
    figure, panels = pyplot.subplots(len(found), 1, sharex=True, squeeze=False,
                                     figsize=(8, 1.0 + 1.25 * len(found)))
    at, said = PAPER_MARKS[name]
    for axes, record in zip(panels[:, 0], found):
        _histogram(axes, record["floor_latencies_us"], color=QUIET, linewidth=1.5)
        _histogram(axes, record["latencies_us"], color=RTPM, alpha=0.85, fill=True)
        axes.axvline(at, linestyle="--", linewidth=1, color=QUIET)
        axes.set_ylabel(record["transport"], rotation=0, ha="right", va="center")
        axes.set_yticks([])
        _microseconds(axes, (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500))
    panels[0, 0].set_title(PAPER_TITLES[name], loc="left", fontsize=10)
    panels[0, 0].annotate(said, (at, 1), (0, 4), xycoords=("data", "axes fraction"), fontsize=8,
                          textcoords="offset points", ha="center", va="bottom")
    panels[-1, 0].set_xlabel("µs; filled: RTPM, outlined: its raw floor")
    return figure


def draw_all(results, folder):
    """Draws what there are results for. @return the names drawn. A Fault: matplotlib is missing."""
    if pyplot is None:
        raise records.Fault("the plots take matplotlib (Debian's package python3-matplotlib)")
    drawn = []
    made = {"peers": peers, "isolation": isolation} | {
        name: lambda rows, name=name: distributions(name, rows) for name in PAPER_MARKS}
    for name, make in made.items():
        for shade, ink in INK.items():
            with pyplot.rc_context({
                    "text.color": ink, "axes.labelcolor": ink, "xtick.color": ink,
                    "ytick.color": ink, "axes.edgecolor": ink, "font.size": 9,
                    "axes.spines.top": False, "axes.spines.right": False,
                    "axes.spines.left": False, "ytick.left": False,
                    "svg.fonttype": "none", "svg.hashsalt": name}):
                figure = make(results)
                if figure is None:
                    break
                figure.tight_layout()
                figure.savefig(os.path.join(folder, f"{name}-{shade}.svg"), transparent=True,
                               metadata={"Date": None})
                pyplot.close(figure)
        else:
            drawn.append(name)
    return drawn
