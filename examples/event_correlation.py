"""Gaze and touch, correlated by the hub: which touches did the person look at?

The hub compares the events and sends only those pairs that this program asks for. A timeout shows
that there was none for a while. First, in another terminal: rtpm up examples/laboratory.toml

    python examples/event_correlation.py --seconds 20
"""

import argparse
import contextlib
import sys
import time

import rtpm
from rtpm.events import source_of

#: Events of a device have the hash of its name as their source.
ARM, GAZE = source_of("lab/arm0"), source_of("lab/gaze0")
#: The arm begins to push its user.
TOUCHED = rtpm.Filter(f"source({ARM}) and rtpm.device.ContactChanged:is_touching == true")
#: Below eye level; the x of the orientation's quaternion is the sine of half of the elevation.
LOOKS_DOWN = rtpm.Filter(f"source({GAZE}) and rtpm.device.Sampled:orientation.x < -0.02")
#: Both within 20 ms. A second and a half without such a pair is an event, too.
WHERE = rtpm.correlate(TOUCHED, LOOKS_DOWN, within=0.020) | rtpm.silence(1.5)


def show(begin_ns: int, received: rtpm.Received | tuple[rtpm.Received, ...]) -> bool:
    """Prints a pair or a timeout; returns whether it was a pair."""
    if isinstance(received, rtpm.Received):
        print(
            f"{(received.time_ns - begin_ns) / 1e9:6.2f} s  no touch that was looked at", flush=True
        )
        return False
    touch, gaze = received
    down = -2 * gaze.value.orientation.x * 180 / 3.1416
    print(
        f"{(touch.time_ns - begin_ns) / 1e9:6.2f} s  touch with {touch.value.force_newton:.2f} N, "
        f"looked at {down:.1f} degrees down, {(touch.time_ns - gaze.time_ns) / 1e6:+.1f} ms apart",
        flush=True,
    )
    return True


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="how long to run")
    options = parser.parse_args()
    pairs = timeouts = 0
    try:
        with (
            rtpm.events(WHERE) as events,
            rtpm.device("lab/arm0") as arm,
            arm.command() as tip,
            contextlib.suppress(KeyboardInterrupt, rtpm.Timeout),
        ):
            # The wall that is touched; a native loop renders it beside this one.
            tip.render(rtpm.Wall(normal=rtpm.Vector3(0, 0, 1), stiffness_newton_per_m=500))
            begin_ns = time.monotonic_ns()
            while (left := options.seconds - (time.monotonic_ns() - begin_ns) / 1e9) > 0:
                if show(begin_ns, events.next(timeout=left)):
                    pairs += 1
                else:
                    timeouts += 1
    except rtpm.Error as error:
        print(f"event_correlation: {error}", file=sys.stderr)
        return 1
    print(f"{pairs} touches were looked at; {timeouts} timeouts")
    return 0


if __name__ == "__main__":
    sys.exit(main())
