"""rtpm-ros2 beside Cyclone DDS of another release, with types written by hand."""

import time
from dataclasses import dataclass

import pytest
from conftest import wait_until
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import byte, float64, int32, sequence, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

QUALITY = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1000))


@dataclass
@final
class Stamp(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Stamp
    frame_id: str


@dataclass
@final
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
@final
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: byte
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
@final
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
@final
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
@final
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
@final
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
@final
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
@final
class TfMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


class Reader:
    """All messages of a topic so far."""

    def __init__(self, participant, name, kind):
        self.reader = DataReader(participant, Topic(participant, name, kind), qos=QUALITY)
        self.messages = []

    def all(self):
        self.messages += self.reader.take(N=1000)
        return self.messages


@pytest.fixture
def participant():
    return DomainParticipant(17)


def test_transforms(laboratory, participant):
    laboratory.start_devices()
    laboratory.start_bridge("--tf")
    reader = Reader(participant, "rt/tf", TfMessage)
    wait_until(lambda: len(reader.all()) > 50, "transforms")
    for message in reader.messages:
        (transform,) = message.transforms
        assert transform.header.frame_id == "arm0/base"
        assert transform.child_frame_id == "lab/arm0"
        assert transform.transform.rotation.w == 1
        assert abs(transform.header.stamp.sec - time.time()) < 60


def test_diagnostics_each_second_and_at_a_change(laboratory, participant):
    laboratory.start_devices()
    laboratory.start_bridge("--command", "lab/arm0")
    reader = Reader(participant, "rt/diagnostics", DiagnosticArray)

    def newest(device):
        for array in reversed(reader.all()):
            for status in array.status:
                if status.name == device:
                    return status
        return None

    wait_until(lambda: (s := newest("lab/arm0")) and s.level == 0, "the arm is well")
    values = {each.key: each.value for each in newest("lab/arm0").values}
    assert values["commands: lease"] == "not held"
    assert values["commands dropped: stale stamp"] == "0"
    count = len(reader.all())
    wait_until(lambda: len(reader.all()) > count + 2, "one each second")
    laboratory.rtpm("estop", "lab/arm0")
    wait_until(lambda: newest("lab/arm0").level == 2, "the stop is an error")
