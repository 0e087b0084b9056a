"""Camera frames and the arm's positions on one clock, in a folder: where was the arm in each frame?

Each frame's file stands in frames.csv beside the arm's position at the instant of its capture.
First, in another terminal: rtpm up examples/laboratory.toml

    python examples/camera_beside_arm.py frames --seconds 10
"""

import argparse
import contextlib
import csv
import sys
import time
from pathlib import Path

import rtpm
from rtpm.events import source_of

#: The time is that of this host's monotonic clock, as in the samples of its devices.
FIELDS = ["time_s", "file", "x_m", "y_m", "z_m", "button", "uncertainty_s"]


class Track:
    """The arm's samples from the hub; they wait there until a frame needs them."""

    def __init__(self, device: str) -> None:
        where = f"source({source_of(device)}) and type(rtpm.device.Sampled)"
        self.events = rtpm.events(where)
        self.before = self.after = self.events.next(timeout=2)

    def at(self, time_ns: int) -> tuple[list[float], bool]:
        """Position, interpolated between two samples, and button. Raises rtpm.Timeout without."""
        while self.after.time_ns < time_ns:
            self.before, self.after = self.after, self.events.next(timeout=2)
        span_ns = self.after.time_ns - self.before.time_ns
        share = (time_ns - self.before.time_ns) / span_ns if span_ns else 0.0
        pairs = zip(self.before.value.position_m, self.after.value.position_m, strict=True)
        return [a + share * (b - a) for a, b in pairs], bool(self.before.value.buttons)


def record(folder: Path, camera: str, device: str, seconds: float) -> int:
    """Returns how many frames it has recorded."""
    count = 0
    with (
        rtpm.connect(camera) as medium,
        open(folder / "frames.csv", "w", newline="") as file,
        contextlib.suppress(KeyboardInterrupt),
    ):
        if not hasattr(medium, "frames"):
            raise rtpm.Error(f"{camera} is no camera; `rtpm list` shows the names")
        table = csv.writer(file)
        table.writerow(FIELDS)
        track = Track(device)
        begin_ns = time.monotonic_ns()
        for frame in medium.frames():
            if frame.problem:
                raise rtpm.Error(f"{camera} has no pictures: {frame.problem}")
            stamp = frame.stamp
            if stamp.capture_ns < begin_ns:
                continue  # Older than the first sample.
            position, button = track.at(stamp.capture_ns)
            name = f"{stamp.sequence:06}.jpg"
            (folder / name).write_bytes(frame.bytes)
            row = [f"{stamp.capture_ns / 1e9:.6f}", name, *(f"{each:.6f}" for each in position)]
            table.writerow([*row, int(button), stamp.uncertainty_ns / 1e9])
            count += 1
            if stamp.capture_ns - begin_ns > seconds * 1e9:
                break
    return count


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="for the frames, JPEG, and frames.csv")
    parser.add_argument("--camera", default="lab/cam0", help="its name, or its URL")
    parser.add_argument("--device", default="lab/arm0", help="its name")
    parser.add_argument("--seconds", type=float, default=10.0, help="how long to record")
    options = parser.parse_args()
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        count = record(options.folder, options.camera, options.device, options.seconds)
    except (rtpm.Error, OSError) as error:
        print(f"camera_beside_arm: {error}", file=sys.stderr)
        return 1
    print(f"{count} frames are in {options.folder}, with the arm's position at each in frames.csv")
    return 0


if __name__ == "__main__":
    sys.exit(main())
