"""Offers devices and all events to Lab Streaming Layer until Ctrl-C: python lsl_bridge.py lab/arm0"""

from __future__ import annotations

import argparse
import contextlib
import threading

import rtpm.lsl


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("devices", nargs="+", help="their names, such as lab/arm0")
    with contextlib.ExitStack() as streams, contextlib.suppress(KeyboardInterrupt):
        for name in options.parse_args().devices:
            streams.enter_context(rtpm.lsl.outlet(name))
        streams.enter_context(rtpm.lsl.markers())
        print("LabRecorder sees the streams until Ctrl-C", flush=True)
        threading.Event().wait()


if __name__ == "__main__":
    main()
