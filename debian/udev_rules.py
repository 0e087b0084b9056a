#!/usr/bin/env python3
"""Prints 60-rtpm.rules: the rights to the devices whose ids the drivers falcon and hid name."""

import re
from pathlib import Path

DEVICES = Path(__file__).resolve().parent.parent / "devices"
HEAD = """\
# The devices that RTPM knows by their ids. Their nodes belong to the group rtpm, as which the
# service rtpm-deviced runs, and to the user at the machine. For others, such as boards at serial
# ports and game pads, `rtpm-deviced --probe` prints the rule."""


def rule(subsystem: str, attribute: str, vendor: str, product: str) -> str:
    return (
        f'SUBSYSTEM=="{subsystem}", {attribute}{{idVendor}}=="{vendor}", '
        f'{attribute}{{idProduct}}=="{product}", MODE="0660", GROUP="rtpm", TAG+="uaccess"'
    )


def constants(text: str) -> dict[str, str]:
    return dict(re.findall(r"(k\w+) = 0x([0-9a-f]{4});", text))


falcon = constants((DEVICES / "falcon/include/rtpm/device_falcon/ftdi.hpp").read_text())
profile = (DEVICES / "hid/src/profile.cpp").read_text()
vendors = constants(profile)
products = re.findall(r"Product\{(?:0x)?(\w+), 0x([0-9a-f]{4}), Kind::k\w+\}", profile)
if not products:
    raise SystemExit(
        "udev_rules.py: devices/hid/src/profile.cpp has no line `Product{…}`; where its "
        "ids are now, read them here"
    )
print(HEAD)
print(rule("usb", "ATTR", falcon["kVendor"], falcon["kProduct"]))
for vendor, product in products:
    print(rule("hidraw", "ATTRS", vendors.get(vendor, vendor), product))
