"""A wall behind a slow link: delay makes it feed energy to the hand, until it throws the hand out.

A spring gives back the energy that pressing it took. With a delay its force is that of a moment
ago, when the hand was deeper: on its way out the hand gets more than it gave, until the device's
passivity guard brakes. The device's own loop renders the same wall without a delay. First, in
another terminal: rtpm up examples/laboratory.toml

    python examples/remote_wall.py --delays 0 10 20 40
"""

import argparse
import collections
import sys
import time
from typing import NamedTuple

import rtpm

STIFFNESS = 600.0  # N/m
BRAKED = 1 << 17  # Of a sample's faults: the device's passivity guard brakes.


class Wall(NamedTuple):
    """How a wall felt."""

    deepest_m: float
    stiffness: float  # N/m: the straight line through 0 that fits force over depth best.
    energy_j: float  # That the hand got from it; below 0: that it took from the hand.
    braked: float  # The part of the time in which the device's passivity guard braked.


def feel(tip: rtpm.Tip, seconds: float, delay: float | None) -> Wall:
    """Lets the hand press into a wall whose link has that delay; None: in the device's own loop."""
    link: collections.deque[tuple[float, float]] = collections.deque()
    force = deepest = energy = moment = square = braked = total = 0.0
    begin = time.monotonic()
    before_ns = time.monotonic_ns()
    if delay is None:
        tip.set_models(rtpm.Wall(normal=rtpm.Vector3(0, 0, 1), stiffness_newton_per_m=STIFFNESS))
    for sample in tip.loop(rate=1000):
        now = time.monotonic()
        depth = max(0.0, -sample.position_m.z)
        if delay is not None:
            link.append((now, STIFFNESS * depth))
            while link and now - link[0][0] >= delay:
                force = link.popleft()[1]
            tip.force = (0, 0, force)
        period = (sample.host_time_ns - before_ns) / 1e9
        before_ns = sample.host_time_ns
        if now > begin + seconds:
            break
        if now > begin + 0.5:  # Until then the device begins softly.
            applied = sample.force_newton.z
            deepest = max(deepest, depth)
            energy += applied * sample.linear_m_per_s.z * period
            moment += applied * depth
            square += depth * depth
            total += period
            braked += period * bool(sample.faults & BRAKED)
    tip.set_models()
    return Wall(deepest, moment / square if square else 0.0, energy, braked / total)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--device", default="lab/arm0", help="its name, or its URL")
    parser.add_argument(
        "--delays",
        type=float,
        nargs="+",
        default=[0, 10, 20, 40],
        metavar="MS",
        help="of the link, there and back",
    )
    parser.add_argument("--seconds", type=float, default=6.5, help="how long each wall is felt")
    options = parser.parse_args()
    print("link        deepest    felt as     energy to the hand  braked")
    try:
        with rtpm.device(options.device) as arm:
            for ms in [*options.delays, None]:
                with arm.command(hold=0.020) as tip:
                    wall = feel(tip, options.seconds, None if ms is None else ms / 1000)
                name = "own loop" if ms is None else f"{ms:g} ms"
                print(
                    f"{name:8}  {1000 * wall.deepest_m:5.1f} mm  {wall.stiffness:5.0f} N/m  "
                    f"{1000 * wall.energy_j:+8.1f} mJ          {wall.braked:4.0%}",
                    flush=True,
                )
    except rtpm.Error as error:
        print(f"remote_wall: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
