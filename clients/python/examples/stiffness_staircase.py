"""Stiffness discrimination: a staircase finds the smallest difference of two walls that a subject feels.

python stiffness_staircase.py            # a simulated subject in a simulated laboratory
python stiffness_staircase.py --person   # you, at this host's lab/arm0
"""

import argparse
import contextlib
import math
import random
import statistics
import tempfile
from collections.abc import Iterator
from pathlib import Path

import rtpm

REFERENCE = 300.0  # N/m
WEBER = 0.1  # The simulated subject's error of a stiffness, as a fraction of it.
REVERSAL_COUNT = 12


def touch(tip: rtpm.Tip, samples: Iterator[rtpm.Sample], stiffness: float) -> float:
    """Waits for one touch of a wall; returns the stiffness that the hand met: force by depth."""
    wall = rtpm.Wall(normal=rtpm.Vector3(0, 0, 1), stiffness_newton_per_m=stiffness)
    force = depth = 0.0
    is_set = False
    for sample in samples:
        above_m = sample.position_m.z
        if not is_set and above_m > 0.001:  # A wall that changes under pressure is not passive.
            tip.set_models(wall)
            is_set = True
        elif is_set and above_m < 0:
            force += sample.force_newton.z
            depth -= above_m
        elif depth and above_m > 0.001:
            break
    return force / depth


def run_trials(tip: rtpm.Tip, is_person: bool) -> tuple[list[tuple[float, bool]], list[float]]:
    """Two right answers make it harder, a wrong one easier: it settles at 71 % right (Levitt 1971)."""
    difference, right_count, direction = 0.5, 0, 0
    trials: list[tuple[float, bool]] = []
    reversals: list[float] = []
    samples = tip.loop(rate=500)
    for _ in range(2):
        touch(tip, samples, REFERENCE)  # The device begins softly.
    while len(reversals) < REVERSAL_COUNT:
        walls = random.sample((REFERENCE, REFERENCE * (1 + difference)), 2)
        # `rtpm record` has each trial beside the samples.
        with rtpm.trial(len(trials) + 1, f"{walls[0]:.1f} and {walls[1]:.1f} N/m") as trial:
            first, second = (touch(tip, samples, wall) * random.gauss(1, WEBER) for wall in walls)
            if is_person:
                tip.set_models()
                while (answer := input("Which was stiffer, 1 or 2? ")) not in ("1", "2"):
                    pass
                is_first = answer == "1"
            else:
                is_first = first > second
            trial.response = "1" if is_first else "2"
        is_right = is_first == (walls[0] > walls[1])
        trials.append((difference, is_right))
        right_count = right_count + 1 if is_right else 0
        if not is_right or right_count == 2:
            step = -1 if is_right else 1
            if step == -direction:
                reversals.append(difference)
            direction, right_count = step, 0
            difference = min(1.0, difference * (1.5 if len(reversals) < 4 else 1.25) ** step)
    return trials, reversals


def plot(file: str, trials: list[tuple[float, bool]], threshold: float) -> None:
    from matplotlib import pyplot

    pyplot.semilogy(range(1, len(trials) + 1), [100 * d for d, _ in trials], color="lightgray")
    for is_right, marker in ((True, "o"), (False, "x")):
        seen = [(n, 100 * d) for n, (d, right) in enumerate(trials, 1) if right == is_right]
        pyplot.semilogy(*zip(*seen, strict=True), marker, label="right" if is_right else "wrong")
    pyplot.axhline(100 * threshold, linestyle="--", color="gray", label="threshold")
    pyplot.minorticks_off()
    pyplot.yticks([5, 10, 20, 50], ["5", "10", "20", "50"])
    pyplot.xlabel("trial")
    pyplot.ylabel(f"difference (% of {REFERENCE:g} N/m)")
    pyplot.legend()
    pyplot.savefig(file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--person", action="store_true", help="a person answers at lab/arm0")
    parser.add_argument("--seed", type=int, help="of the order, and of the simulated subject")
    parser.add_argument("--plot", metavar="FILE", help="draws the staircase (needs matplotlib)")
    options = parser.parse_args()
    random.seed(options.seed)
    with contextlib.ExitStack() as stack:
        if not options.person:
            # The simulated hand taps eight times a second, from 14 mm above the wall to 10 mm below.
            hand = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "hand.csv"
            times = [n / 16 / 60 for n in range(61)]
            rows = [f"{t},0,0,{0.002 + 0.012 * math.cos(16 * math.pi * t)}" for t in times]
            hand.write_text("\n".join(rows))
            stack.enter_context(rtpm.demo(hand))
        # A person may take a minute to answer; without that, half a second of silence ends the lease.
        arm = stack.enter_context(rtpm.device("lab/arm0", stall=60 if options.person else 0.5))
        tip = stack.enter_context(arm.command())
        if options.person:
            print(
                "Press on each wall once from above, and lift the hand: two to begin with, then pairs"
            )
        trials, reversals = run_trials(tip, options.person)
    threshold = statistics.geometric_mean(reversals[4:])
    print(
        f"{len(trials)} trials, threshold at 71 % right: {100 * threshold:.1f} % of {REFERENCE:g} N/m"
    )
    if options.plot:
        plot(options.plot, trials, threshold)


if __name__ == "__main__":
    main()
