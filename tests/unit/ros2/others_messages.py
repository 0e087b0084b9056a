"""The example messages of example.hpp, by others' code.

With rosbags (PyPI) it prints type, hash and bytes of each: others_messages.txt. With rclpy of ROS 2
it reads that file and compares every value and hash.
"""

import importlib
import itertools
import json
import pathlib
import sys

FILE = pathlib.Path(__file__).with_suffix(".txt")
TYPES = """diagnostic_msgs/msg/DiagnosticArray geometry_msgs/msg/PoseStamped
    geometry_msgs/msg/TwistStamped geometry_msgs/msg/WrenchStamped
    rmw_dds_common/msg/ParticipantEntitiesInfo sensor_msgs/msg/CompressedImage sensor_msgs/msg/Imu
    sensor_msgs/msg/JointState sensor_msgs/msg/Joy std_msgs/msg/Bool std_msgs/msg/Empty
    std_msgs/msg/String tf2_msgs/msg/TFMessage""".split()
SEQUENCE_SIZE = 3


def counter():
    return (number % 100 for number in itertools.count(1))


def scalar(kind, count):
    """Numbers count up by one, below 100, and every second truth value holds."""
    number = next(count)
    if kind == "string":
        return f"text {number}"
    if kind in ("bool", "boolean"):
        return number % 2 == 1
    return float(number) if kind in ("float", "double", "float32", "float64") else number


def with_rosbags():
    import numpy
    from rosbags.interfaces import Nodetype
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    # Its Gid is that of ROS 2 Humble.
    gid = get_types_from_msg("uint8[16] data", "rmw_dds_common/msg/Gid")
    store.register(get_typestore(Stores.ROS2_JAZZY).fielddefs | gid)

    def value_of(node, count):
        kind, rest = node
        if kind == Nodetype.BASE:
            return scalar(rest[0], count)
        if kind == Nodetype.NAME:
            return filled(rest, count)
        element, size = rest
        values = [value_of(element, count) for _ in range(size or SEQUENCE_SIZE)]
        if element[0] == Nodetype.BASE and element[1][0] != "string":
            return numpy.array(values, dtype=element[1][0].replace("byte", "uint8"))
        return values

    def filled(name, count):
        fields = store.get_msgdef(name).fields
        return store.types[name](**{field: value_of(node, count) for field, node in fields})

    for name in TYPES:
        empty = name == "std_msgs/msg/Empty"
        message = store.types[name]() if empty else filled(name, counter())
        data = bytes(store.serialize_cdr(message, name))
        print(name, store.hash_rihs01(name), data.hex())


def with_rclpy():
    from rclpy.serialization import deserialize_message

    def class_of(name):
        package, _, short = name.replace("/msg/", "/").partition("/")
        return getattr(importlib.import_module(package + ".msg"), short)

    def check(value, kind, count):
        base, size = kind, None
        if kind.startswith("sequence"):
            base, size = kind.removeprefix("sequence<").removesuffix(">"), SEQUENCE_SIZE
        elif kind.endswith("]"):
            base, _, number = kind.removesuffix("]").partition("[")
            size = int(number)
        if size is not None:
            assert len(value) == size, (kind, value)
            for element in value:
                check(element, base, count)
        elif "/" in base:
            for name, part in value.get_fields_and_field_types().items():
                check(getattr(value, name), part, count)
        else:
            base = "string" if base.startswith("string") else base
            expected = scalar(base, count)
            value = value[0] if base == "octet" else value
            assert value == expected, (kind, value, expected)

    def hash_of(name):
        file = pathlib.Path(sys.prefix) / "share" / (name + ".json")
        return json.loads(file.read_text())["type_hashes"][0]["hash_string"]

    checked = 0
    for line in FILE.read_text().splitlines():
        name, type_hash, data = (line + " ").split(" ")[:3]
        try:
            kind = class_of(name)
        except ImportError:
            print(f"{name}: this ROS 2 does not have it")
            continue
        message = deserialize_message(bytes.fromhex(data), kind)
        if name != "std_msgs/msg/Empty":
            count = counter()
            for field, part in message.get_fields_and_field_types().items():
                check(getattr(message, field), part, count)
        assert type_hash == hash_of(name), name
        checked += 1
    print(f"rclpy reads {checked} messages as they were written")


if sys.argv[1:] == ["rclpy"]:
    with_rclpy()
else:
    with_rosbags()
