"""Plots by gnuplot, each as PNG and as SVG."""

import shutil
import subprocess
from typing import NamedTuple

import records


# What a label names decides the colour, so that RTPM and its floor are seen to belong together.
_COLOURS = {"udp": "#1f6fb4", "tcp": "#2c8a3c", "shm": "#c8372d"}


class Series(NamedTuple):
    """A line of a plot: its points (x, y), and gnuplot's words for how they are drawn."""

    label: str
    points: list
    style: str = "linespoints pointtype 7 pointsize 0.6"


class Plot(NamedTuple):
    """A plot; `name` is that of its files. `ticks`: labels of the x axis, by their place."""

    name: str
    title: str
    x_label: str
    y_label: str
    series: list
    x_is_logarithmic: bool = False
    y_is_logarithmic: bool = False
    ticks: tuple = ()


def draw(plot, folder):
    """Writes folder/NAME.png and folder/NAME.svg. A Fault: gnuplot is missing or refuses."""
    program = shutil.which("gnuplot")
    if program is None:
        raise records.Fault("the plots take gnuplot (Debian's package gnuplot-nox)")
    for terminal, suffix in (("pngcairo size 900,540 font 'sans,11'", "png"),
                             ("svg size 900,540 dynamic font 'sans,13'", "svg")):
        script = _script(plot, terminal, f"{plot.name}.{suffix}")
        done = subprocess.run([program], input=script, cwd=folder, capture_output=True, text=True,
                              check=False)
        if done.returncode != 0:
            raise records.Fault(f"gnuplot does not draw {plot.name}: {done.stderr.strip()}")


def _script(plot, terminal, output):
    lines = [f"set terminal {terminal}", f"set output {_quoted(output)}",
             "set termoption noenhanced",
             f"set title {_quoted(plot.title)}", f"set xlabel {_quoted(plot.x_label)}",
             f"set ylabel {_quoted(plot.y_label)}", "set grid", "set key below maxrows 3",
             "set encoding utf8"]
    if plot.x_is_logarithmic:
        lines.append("set logscale x")
    if plot.y_is_logarithmic:
        lines.append("set logscale y")
    if plot.ticks:
        ticks = ", ".join(f"{_quoted(label)} {place}" for place, label in plot.ticks)
        lines.append(f"set xtics ({ticks}) rotate by -40")
        lines.append(f"set xrange [-0.5:{len(plot.ticks) - 0.5}]")
        lines.append("set rmargin 16")
    for number, series in enumerate(plot.series):
        lines.append(f"$data{number} << EOD")
        lines += [f"{x} {y}" for x, y in series.points]
        lines.append("EOD")
    lines.append("plot " + ", ".join(
        f"$data{number} using 1:2 with {series.style}{_colour_of(series.label)} "
        f"title {_quoted(series.label)}"
        for number, series in enumerate(plot.series)))
    return "\n".join(lines) + "\n"


def _colour_of(label):
    named = [colour for word, colour in _COLOURS.items() if f" {word}" in label]
    return f" linecolor rgb {_quoted(named[0])}" if named else ""


def _quoted(text):
    return "'" + text.replace("'", "''") + "'"
