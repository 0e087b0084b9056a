"""rtpm-ros2 beside the real rclpy (Fast DDS)."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from conftest import PROGRAMS, wait_until
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, Empty, String

ARM = "/rtpm/lab/arm0"
KNOB = "/rtpm/lab/knob0"

# From public captures of ROS 2's own programs.
HASHES = {
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/TwistStamped": "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    "geometry_msgs/msg/WrenchStamped": "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "sensor_msgs/msg/Joy": "0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5",
    "std_msgs/msg/Bool": "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
TOPICS = {
    f"{ARM}/pose": "geometry_msgs/msg/PoseStamped",
    f"{ARM}/twist": "geometry_msgs/msg/TwistStamped",
    f"{ARM}/applied_wrench": "geometry_msgs/msg/WrenchStamped",
    f"{ARM}/joy": "sensor_msgs/msg/Joy",
    f"{ARM}/stopped": "std_msgs/msg/Bool",
    f"{ARM}/description": "std_msgs/msg/String",
    f"{KNOB}/joint_states": "sensor_msgs/msg/JointState",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/tf": "tf2_msgs/msg/TFMessage",
}


def stamp_ns(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def wall_offset_ns():
    """CLOCK_REALTIME minus CLOCK_MONOTONIC, by the best of some measurements."""

    def measure():
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        return after - before, wall - (before + after) // 2

    return min(measure() for _ in range(100))[1]


def stamped(ros, kind, offset_s=0.0):
    message = kind()
    now = ros.node.get_clock().now().nanoseconds + int(offset_s * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 1_000_000_000)
    return message


def force(ros, newton, offset_s=0.0, frame=""):
    message = stamped(ros, WrenchStamped, offset_s)
    message.header.frame_id = frame
    message.wrench.force.x = newton
    return message


def test_graph(laboratory, ros):
    laboratory.start_devices()
    laboratory.start_bridge("--tf")
    node = ros.node
    names = ros.wait_until(
        lambda: (
            set(TOPICS) <= {n for n, _ in node.get_topic_names_and_types()}
            and dict(node.get_topic_names_and_types())
        ),
        "all topics are there",
    )
    for topic, kind in TOPICS.items():
        assert names[topic] == [kind]
        (info,) = node.get_publishers_info_by_topic(topic)
        assert str(info.topic_type_hash) == f"RIHS01_{HASHES[kind]}", topic
        assert info.qos_profile.reliability.name == "RELIABLE"
    ros.wait_until(lambda: ("rtpm", "/") in node.get_node_names_and_namespaces(), "its node")
    # By the endpoints' ids, which the bridge sends in ros_discovery_info.
    ros.wait_until(
        lambda: set(TOPICS) <= set(dict(node.get_publisher_names_and_types_by_node("rtpm", "/"))),
        "the node has all topics",
    )
    taken = dict(node.get_subscriber_names_and_types_by_node("rtpm", "/"))
    assert sorted(taken[f"{ARM}/stop"]) == ["std_msgs/msg/Bool", "std_msgs/msg/Empty"]
    assert f"{ARM}/command/wrench" not in taken, "no command without --command"


def test_values_are_those_that_rtpm_reads(laboratory, ros):
    laboratory.start_devices()
    laboratory.start_bridge()
    poses = ros.collect(PoseStamped, f"{ARM}/pose")
    twists = ros.collect(TwistStamped, f"{ARM}/twist")
    ros.wait_until(lambda: poses and twists, "poses arrive")
    echo = laboratory.start("rtpm", "echo", "lab/arm0", "--json")
    start = len(poses)
    ros.wait_until(lambda: len(poses) > start + 400, "two seconds of poses")
    echo.end(signal.SIGINT)
    lines = [json.loads(line) for line in echo.text().splitlines() if line.startswith("{")]
    offset = wall_offset_ns()
    by_time = {line["host_time_ns"]: line["sample"] for line in lines if "sample" in line}
    same = 0
    for pose in poses:
        nearest = min(by_time, key=lambda ns: abs(ns + offset - stamp_ns(pose)))
        if abs(nearest + offset - stamp_ns(pose)) > 5_000:
            continue  # The echo shows other samples, too.
        same += 1
        position, sample = pose.pose.position, by_time[nearest]["position_m"]
        assert (position.x, position.y, position.z) == pytest.approx(
            (sample["x"], sample["y"], sample["z"]), abs=1e-11
        )
        assert pose.header.frame_id == "arm0/base"
    assert same > 5, "stamps are the devices' times, on the other clock"
    stamps = [stamp_ns(pose) for pose in poses]
    assert stamps == sorted(stamps)


def test_edges_of_buttons_survive_the_decimation(laboratory, ros):
    laboratory.start_devices()
    laboratory.start_bridge("--rate", "1")
    joys = ros.collect(Joy, f"{ARM}/joy")
    # The simulated hand presses for 0.2 s every 2 s: samples at 1 Hz alone would show half of that at best.
    ros.wait_until(lambda: joys, "joy arrives")
    before = laboratory.read("lab/arm0")["button_edges"][0]
    del joys[:]
    ros.spin(6.0)
    shown = [joy.buttons[0] for joy in joys]
    edges = sum(a != b for a, b in zip(shown, shown[1:], strict=False))
    after = laboratory.read("lab/arm0")["button_edges"][0]
    assert edges >= 4
    assert abs((after - before) % 65536 - edges) <= 2, "each press and release has a message"


def test_description_and_devices_that_come_and_go(laboratory, ros):
    bridge = laboratory.start_bridge()
    devices = laboratory.start_devices()
    texts = ros.collect(String, f"{ARM}/description", is_latched=True)
    ros.wait_until(lambda: texts, "the description is latched")
    assert 'model: "RTPM simulated arm"' in texts[0].data
    devices.end()
    bridge.wait_for("no longer showing lab/arm0")
    # The test's own subscription keeps its topic alive.
    ros.wait_until(
        lambda: not ros.node.get_publishers_info_by_topic(f"{ARM}/pose"), "the topics are gone"
    )
    laboratory.start_devices()
    ros.wait_until(lambda: ros.node.get_publishers_info_by_topic(f"{ARM}/pose"), "they are back")


def test_commands_move_the_arm_and_lapse_with_their_sender(laboratory, ros):
    laboratory.start_devices()
    bridge = laboratory.start_bridge("--command", "lab/arm0", "--report", "1s")
    wrenches = ros.collect(WrenchStamped, f"{ARM}/applied_wrench")
    ros.wait_until(lambda: wrenches, "wrenches arrive")
    source = f"""
import sys, time
import rclpy
from geometry_msgs.msg import WrenchStamped
rclpy.init()
node = rclpy.create_node("sender")
publisher = node.create_publisher(WrenchStamped, "{ARM}/command/wrench", 1)
while True:
    message = WrenchStamped()
    message.header.stamp = node.get_clock().now().to_msg()
    message.wrench.force.y = 1.5
    publisher.publish(message)
    time.sleep(0.01)
"""
    sender = subprocess.Popen([sys.executable, "-c", source])
    try:
        ros.wait_until(
            lambda: abs(wrenches[-1].wrench.force.y - 1.5) < 0.01, "the arm applies the force"
        )
        assert laboratory.read("lab/arm0")["force_newton"]["y"] == pytest.approx(1.5, abs=0.01)
    finally:
        sender.kill()
        sender.wait()
    ros.wait_until(lambda: wrenches[-1].wrench.force.y == 0, "the force ends with its sender")
    # The bridge has released the lease, so another client gets it.
    wait_until(
        lambda: json.loads(laboratory.rtpm("call", "lab/arm0", "acquire", "--json"))["id"] != 0,
        "the lease is free",
    )
    assert "passed " in bridge.text()


def test_commands_that_are_dropped(laboratory, ros):
    laboratory.start_devices()
    bridge = laboratory.start_bridge("--command", "lab/arm0", "--report", "1s")
    publisher = ros.node.create_publisher(WrenchStamped, f"{ARM}/command/wrench", 10)
    ros.wait_until(lambda: publisher.get_subscription_count() == 1, "the bridge listens")
    dropped = {
        "stale stamp": lambda: force(ros, 1.0, offset_s=-5),
        "stamp in the future": lambda: force(ros, 1.0, offset_s=5),
        "other frame": lambda: force(ros, 1.0, frame="map"),
        "not finite": lambda: force(ros, float("nan")),
        "unreadable": lambda: force(ros, 1.0, frame="x" * 20_000),
    }
    for why, make in dropped.items():

        def is_counted(why=why, make=make):
            publisher.publish(make())
            return why in bridge.text()

        ros.wait_until(is_counted, why)
        assert laboratory.read("lab/arm0")["force_newton"]["x"] == 0
    publisher.publish(force(ros, 0.5, frame="arm0/base"))
    ros.wait_until(lambda: "passed 1" in bridge.text(), "the right frame passes")


def test_joints_are_commanded_by_name(laboratory, ros):
    bridge = laboratory.start_bridge("--command", "lab/knob0", "--report", "1s")
    bridge.wait_for("lab/knob0 is not there; waiting for it")
    laboratory.start_devices()
    states = ros.collect(JointState, f"{KNOB}/joint_states")
    publisher = ros.node.create_publisher(JointState, f"{KNOB}/command/joints", 10)
    ros.wait_until(lambda: states and publisher.get_subscription_count() == 1, "the bridge listens")
    assert states[-1].name == ["dial"]

    def send(name):
        message = stamped(ros, JointState)
        message.name, message.effort = [name], [0.02]
        publisher.publish(message)

    def is_refused():
        send("elbow")
        return "odd joints" in bridge.text()

    ros.wait_until(is_refused, "another joint is refused")

    def is_applied():
        send("dial")
        return abs(states[-1].effort[0] - 0.02) < 1e-9

    ros.wait_until(is_applied, "the knob's motor applies the effort")


@pytest.mark.parametrize("kind", [Bool, Empty])
@pytest.mark.parametrize("reliability", ["RELIABLE", "BEST_EFFORT"])
def test_stop_from_ros(laboratory, ros, kind, reliability):
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    laboratory.start_devices()
    laboratory.start_bridge()
    stopped = ros.collect(Bool, f"{KNOB}/stopped", is_latched=True)
    quality = QoSProfile(depth=1, reliability=getattr(ReliabilityPolicy, reliability))
    publisher = ros.node.create_publisher(kind, "/rtpm/stop", quality)
    ros.wait_until(
        lambda: stopped and publisher.get_subscription_count() >= 1, "the bridge listens"
    )
    # The bridge may know the publisher a little later than this one knows the bridge.
    ros.spin(0.5)
    assert not stopped[-1].data
    if kind is Bool:
        publisher.publish(Bool(data=False))
        ros.spin(0.3)
        assert not stopped[-1].data
        publisher.publish(Bool(data=True))
    else:
        publisher.publish(Empty())
    ros.wait_until(lambda: stopped[-1].data, "the latched topic shows the stop")
    for device in ("lab/arm0", "lab/knob0"):
        assert laboratory.read(device)["faults"] & 1 << 13, device


def test_stop_of_one_device_and_from_rtpm(laboratory, ros):
    laboratory.start_devices()
    laboratory.start_bridge()
    arm = ros.collect(Bool, f"{ARM}/stopped", is_latched=True)
    knob = ros.collect(Bool, f"{KNOB}/stopped", is_latched=True)
    publisher = ros.node.create_publisher(Empty, f"{ARM}/stop", 1)
    ros.wait_until(lambda: arm and knob and publisher.get_subscription_count(), "it listens")
    ros.spin(0.5)
    publisher.publish(Empty())
    ros.wait_until(lambda: arm[-1].data, "the arm is stopped")
    assert not knob[-1].data
    laboratory.rtpm("estop", "lab/knob0")
    ros.wait_until(lambda: knob[-1].data, "a stop by RTPM is shown")


def test_topics_become_events(laboratory, ros):
    from rclpy.serialization import serialize_message

    laboratory.start_devices()
    bridge = laboratory.start_bridge("--event", "/chatter:std_msgs/msg/String", "--report", "1s")
    echo = laboratory.start("rtpm", "echo", "--filter", "type(1380978482)", "--json")
    publisher = ros.node.create_publisher(String, "/chatter", 10)
    ros.wait_until(lambda: publisher.get_subscription_count() == 1, "the bridge listens")
    message = String(data="trial 7 äöü")

    def has_arrived():
        publisher.publish(message)
        return "/chatter" in echo.text()

    ros.wait_until(has_arrived, "the event")
    line = next(line for line in echo.text().splitlines() if "/chatter" in line)
    event = json.loads(line)
    payload = event.get("payload", event)
    assert payload["topic"] == "/chatter" and payload["type"] == "std_msgs/msg/String"
    assert bytes(payload["cdr"]).rstrip(b"\0") == serialize_message(message).rstrip(b"\0")
    assert abs(payload["stamp_ns"] - time.time_ns()) < 60e9
    # Larger ones than an event can be are lost, and counted.
    publisher.publish(String(data="x" * 70_000))
    ros.wait_until(lambda: "lost_to_hub 1" in bridge.text(), "it is counted")
    assert "deserialization" not in bridge.text()


def test_no_thread_is_real_time(laboratory, ros, monkeypatch):
    monkeypatch.delenv("RTPM_REALTIME")
    laboratory.start_devices()
    bridge = laboratory.start_bridge("--command", "lab/arm0", "--event", "/a:std_msgs/msg/String")
    joys = ros.collect(Joy, f"{ARM}/joy")
    ros.wait_until(lambda: joys, "the bridge works")
    for thread in os.listdir(f"/proc/{bridge.process.pid}/task"):
        assert os.sched_getscheduler(int(thread)) == os.SCHED_OTHER
    assert "SCHED_FIFO" not in bridge.text(), "nor does it try"


def test_domain_must_be_valid(laboratory):
    for name, value in (("ROS_DOMAIN_ID", "102"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")):
        done = subprocess.run(
            [PROGRAMS / "rtpm-ros2"],
            env={**os.environ, name: value},
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 1 and f"{name} is '{value}'" in done.stderr


def test_one_command_starts_all(laboratory, ros):
    program = laboratory.start("rtpm", "ros2", "--seconds", "0")
    poses = ros.collect(PoseStamped, f"{ARM}/pose")
    ros.wait_until(lambda: len(poses) > 10, "the demo's arm is seen from ROS")
    assert program.end(signal.SIGINT) in (0, 130)


def test_loopback_only(laboratory, monkeypatch):
    from conftest import Ros

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    laboratory.start_devices()
    laboratory.start_bridge()
    node = Ros()
    try:
        poses = node.collect(PoseStamped, f"{ARM}/pose")
        node.wait_until(lambda: len(poses) > 10, "poses arrive without multicast")
    finally:
        node.end()
