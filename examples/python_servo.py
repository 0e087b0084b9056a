"""A 1 kHz force loop in Python: everything below z = 0 is a wall, which this program renders.

First, in another terminal: rtpm up examples/laboratory.toml

    python examples/python_servo.py --seconds 10
"""

import argparse
import contextlib
import sys
import time

import rtpm

STIFFNESS = 600.0  # N/m


def main() -> int:
    parser = argparse.ArgumentParser(description="Renders a virtual wall on a haptic device.")
    parser.add_argument("--device", default="lab/arm0", help="its name, or its URL")
    parser.add_argument("--seconds", type=float, default=10.0, help="how long to run")
    options = parser.parse_args()
    cycles = touches = 0
    deepest = greatest = 0.0
    try:
        # A force lasts for 20 ms without a newer one: longer than most pauses of Python.
        with rtpm.device(options.device) as arm, arm.command(hold=0.020) as tip:
            end = time.monotonic() + options.seconds
            with contextlib.suppress(KeyboardInterrupt):
                for sample in tip.loop(rate=1000):
                    depth = -sample.position_m.z
                    force = STIFFNESS * max(0.0, depth)  # A wall never pulls.
                    tip.force = (0, 0, force)
                    cycles += 1
                    touches += depth > 0
                    deepest, greatest = max(deepest, depth), max(greatest, force)
                    if time.monotonic() > end:
                        break
    except rtpm.Error as error:
        print(f"python_servo: {error}", file=sys.stderr)
        return 1
    print(
        f"{cycles} cycles; in the wall for {touches}, {1000 * deepest:.1f} mm deep "
        f"and {greatest:.2f} N at most"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
