"""A recording in the packages of MCAP and Foxglove: what viewers draw is what was sampled."""

from __future__ import annotations

import os
import re
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import rtpm
from conftest import PROGRAMS, Laboratory


@pytest.fixture(scope="module")
def file(laboratory: Laboratory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewers") / "run.mcap"
    subprocess.run(
        [
            str(PROGRAMS / "rtpm"),
            "--registry",
            laboratory.registry.url,
            "record",
            str(path),
            "--for",
            "1s",
        ],
        check=True,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"RTPM_RUNTIME_FOLDER": str(laboratory.folder)},
    )
    return path


def test_mcap_reads_each_message(file: Path) -> None:
    reader: Any = pytest.importorskip("mcap.reader")
    counts: Counter[str] = Counter()
    encodings = set()
    with file.open("rb") as stream:
        for schema, channel, message in reader.make_reader(
            stream, validate_crcs=True
        ).iter_messages():
            counts[channel.topic] += 1
            encodings.add((channel.message_encoding, schema.encoding))
            assert message.publish_time <= message.log_time
    assert encodings == {("flatbuffer", "flatbuffer")}
    with rtpm.open(file) as recording:
        assert counts == {
            name: len(topic) for name, topic in recording.topics.items() if len(topic)
        }
        assert {"lab/arm0/pose", "lab/arm0/force", "rtpm/tf"} <= set(counts)


def test_poses_are_those_of_the_samples(file: Path) -> None:
    with rtpm.open(file) as recording:
        samples = {message.time_ns: message.value for message in recording["lab/arm0"]}
        poses = list(recording["lab/arm0/pose"])
        assert len(poses) > 10
        for pose in poses:
            sample = samples[pose.time_ns]
            position = pose.value.pose.position
            assert (position.x, position.y, position.z) == (
                sample.position_m.x,
                sample.position_m.y,
                sample.position_m.z,
            )
            stamp = pose.value.timestamp
            assert stamp.sec * 10**9 + stamp.nsec == pose.time_ns


def test_samples_keep_their_arrays(file: Path) -> None:
    with rtpm.open(file) as recording:
        assert recording["lab/arm0"].array()["joints"].shape[1] == 8
        assert len(next(recording["lab/arm0"].values()).button_edges) == 16


def test_schemas_are_those_of_foxglove(file: Path) -> None:
    messages: Any = pytest.importorskip("foxglove.messages")
    descriptors: Any = pytest.importorskip("google.protobuf.descriptor_pb2")
    fields = {}
    for name in ("PoseInFrame", "FrameTransforms", "SceneUpdate"):
        data = getattr(messages, name).get_schema().data
        for part in descriptors.FileDescriptorSet.FromString(data).file:
            for kind in part.message_type:
                fields[kind.name] = [field.name for field in kind.field]
    compared = set()
    with rtpm.open(file) as recording:
        for topic in ("lab/arm0/pose", "lab/arm0/force", "rtpm/tf"):
            number = recording.topics[topic]._channels[0].number
            text, problem = recording.core.schema_of(number)
            assert not problem
            for name, body in re.findall(r"table (\w+) \{(.*?)\}", text, re.DOTALL):
                assert re.findall(r"(\w+):", body) == fields[name], name
                compared.add(name)
    assert {"PoseInFrame", "FrameTransform", "SceneEntity", "ArrowPrimitive"} <= compared
