"""Stiffness discrimination: a staircase finds the smallest difference of two walls that is felt.

python examples/stiffness_experiment.py            # a simulated subject and laboratory
python examples/stiffness_experiment.py --person   # you, at this host's lab/arm0
"""

import argparse
import contextlib
import random
import statistics
from collections.abc import Iterator
from pathlib import Path

import rtpm

REFERENCE = 300.0  # N/m
WEBER = 0.1  # The simulated subject's error of a stiffness, as a fraction of it.
HAND = Path(__file__).resolve().with_name("tapping_hand.csv")  # Eight times a second.


def touch(tip: rtpm.Tip, samples: Iterator[rtpm.Sample], stiffness: float) -> float:
    """Waits for one touch of a wall; returns the stiffness that the hand met: force by depth."""
    next(each for each in samples if each.position_m.z > 0.001)  # No wall changes under pressure.
    tip.set_models(rtpm.Wall(normal=rtpm.Vector3(0, 0, 1), stiffness_newton_per_m=stiffness))
    force = depth = 0.0
    for sample in samples:
        above_m = sample.position_m.z
        if above_m < 0:
            force += sample.force_newton.z
            depth -= above_m
        elif depth and above_m > 0.001:
            break
    return force / depth


def run_trials(tip: rtpm.Tip, is_person: bool) -> tuple[list[tuple[float, bool]], float]:
    """Two right answers make it harder, a wrong one easier: 71 % right in the end (Levitt 1971)."""
    difference, right_count, direction = 0.5, 0, 0
    trials: list[tuple[float, bool]] = []
    reversals: list[float] = []
    samples = tip.loop(rate=500)
    for _ in range(2):
        touch(tip, samples, REFERENCE)  # The device begins softly.
    while len(reversals) < 12:
        walls = random.sample((REFERENCE, REFERENCE * (1 + difference)), 2)
        with rtpm.trial(len(trials) + 1, f"{walls[0]:.1f} and {walls[1]:.1f} N/m") as trial:
            felt = [touch(tip, samples, wall) * random.gauss(1, WEBER) for wall in walls]
            tip.set_models()
            answer = "1" if felt[0] > felt[1] else "2"
            while is_person and (answer := input("Which was stiffer, 1 or 2? ")) not in ("1", "2"):
                pass
            trial.response = answer
        is_right = (answer == "1") == (walls[0] > walls[1])
        trials.append((difference, is_right))
        right_count = right_count + 1 if is_right else 0
        if not is_right or right_count == 2:
            step = -1 if is_right else 1
            if step == -direction:
                reversals.append(difference)
            direction, right_count = step, 0
            difference = min(1.0, difference * (1.5 if len(reversals) < 4 else 1.25) ** step)
    return trials, 100 * statistics.geometric_mean(reversals[4:])


def plot(file: str, trials: list[tuple[float, bool]], threshold: float) -> None:
    from matplotlib import pyplot

    numbers, differences = range(1, len(trials) + 1), [100 * each for each, _ in trials]
    pyplot.step(numbers, differences, where="mid", color="lightgray")
    pyplot.scatter(numbers, differences, c=["C0" if right else "C3" for _, right in trials])
    pyplot.axhline(threshold, linestyle="--", color="gray")
    pyplot.gca().set(xlabel="trial (red: wrong)", ylabel=f"difference (% of {REFERENCE:g} N/m)")
    pyplot.savefig(file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--person", action="store_true", help="presses twice, then once on each wall"
    )
    parser.add_argument("--seed", type=int, help="of the order, and of the simulated subject")
    parser.add_argument("--plot", metavar="FILE", help="draws the staircase (needs matplotlib)")
    options = parser.parse_args()
    random.seed(options.seed)
    with contextlib.ExitStack() as stack:
        if not options.person:
            stack.enter_context(rtpm.demo(HAND))
        # A person may take a minute to answer; else half a second of silence ends the lease.
        arm = stack.enter_context(rtpm.device("lab/arm0", stall=60 if options.person else 0.5))
        trials, threshold = run_trials(stack.enter_context(arm.command()), options.person)
    print(f"{len(trials)} trials, threshold at 71 % right: {threshold:.1f} % of {REFERENCE:g} N/m")
    if options.plot:
        plot(options.plot, trials, threshold)


if __name__ == "__main__":
    try:
        main()
    except rtpm.Error as error:
        raise SystemExit(f"stiffness_experiment: {error}") from None
