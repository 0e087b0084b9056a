"""A recording by `rtpm record` gives its samples, events and calls back, typed and as arrays."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtpm
from conftest import PROGRAMS, Laboratory
from rtpm import recordings, schemas

TEXT = """
attribute "rtpm_event";
namespace lab;
struct Force { x:double; y:double; z:double; }
table Pressed (rtpm_event: 7011) { force:Force (required); }
table Noted (rtpm_event: 7012) { name:string; level:int = 3; }
"""
_names = schemas.Schema(TEXT).names()
Force, Pressed, Noted = _names["Force"], _names["Pressed"], _names["Noted"]


@pytest.fixture(scope="module")
def file(laboratory: Laboratory, node: rtpm.Node, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "run.mcap"
    arguments = [
        "record",
        str(path),
        "--hub",
        "rtpm/events",
        "--calls",
        "lab/arm0",
        "--for",
        "700ms",
    ]
    with (
        rtpm.supplier(Pressed, node=node, source=3) as pressed,
        rtpm.supplier(Noted, node=node) as noted,
        rtpm.connect("lab/arm0", node=node) as arm,
    ):
        client: Any = arm
        recorder = subprocess.Popen(
            [str(PROGRAMS / "rtpm"), "--registry", laboratory.registry.url, *arguments],
            stdout=subprocess.DEVNULL,
            env=os.environ | {"RTPM_RUNTIME_FOLDER": str(laboratory.folder)},
        )
        for number in itertools.count():
            pressed.push(Force(0, 0, number))
            noted.push(Noted(name=f"trial {number}"))
            client.read()
            try:
                assert recorder.wait(0.01) == 0
                return path
            except subprocess.TimeoutExpired:
                pass
    raise AssertionError


def test_a_recording_tells_what_it_has(file: Path) -> None:
    with rtpm.open(file) as recording:
        assert recording.devices == ["lab/arm0"]
        assert recording.topics["lab.Pressed/3"].type == "lab.Pressed"
        assert recording.topics["lab.Pressed/3"].count > 1
        assert recording.topics["lab/arm0/description"].type == "rtpm.device.Description"
        assert recording.is_complete
        assert 0 < recording.duration < 60
        assert recording.end_ns - recording.start_ns == pytest.approx(recording.duration * 1e9)
        assert isinstance(recording.metadata, list)
        assert "lab.Pressed/3" in recording._repr_html_()
        with pytest.raises(
            KeyError, match="no topic or samples of a device 'lab/arm9'; it has lab"
        ):
            recording["lab/arm9"]


def test_samples_are_typed_and_an_array(file: Path) -> None:
    with rtpm.open(file) as recording:
        samples = recording["lab/arm0"]
        array = samples.array()
        assert len(array) == samples.count > 100
        assert isinstance(next(samples.values()), rtpm.Sample)
        assert [sample.sequence for sample in samples.values()] == array["sequence"].tolist()
        assert [sample.time_ns for sample in samples] == array["time_ns"].tolist()
        assert array["position_m"]["z"].tolist() == [
            sample.position_m.z for sample in samples.values()
        ]
        assert np.ptp(array["position_m"]["z"]) > 0
        assert array["joints"].shape == (len(array), 8)
        assert (np.diff(array["sequence"].astype(np.int64)) > 0).all()


def test_events_are_decoded(file: Path) -> None:
    with rtpm.open(file) as recording:
        notes = list(recording["lab.Noted/0"])
        first = int(notes[0].value.name.removeprefix("trial "))
        assert [note.value for note in notes] == [
            Noted(name=f"trial {first + n}") for n in range(len(notes))
        ]
        assert [note.sequence for note in notes] == [
            notes[0].sequence + n for n in range(len(notes))
        ]
        forces = recording["lab.Pressed/3"]
        assert forces.array()["z"].tolist() == [force.z for force in forces.values()]
        assert all(isinstance(force, Force) for force in forces.values())
        with pytest.raises(TypeError, match="array takes messages of one struct"):
            recording["lab.Noted/0"].array()


def test_calls_are_decoded(file: Path) -> None:
    with rtpm.open(file) as recording:
        replies = list(recording["lab/arm0/read/response"].values())
        assert replies and all(isinstance(reply, rtpm.Sample) for reply in replies)
        assert {call.method for call in recording["lab/arm0/calls"].values()} >= {"read"}


def test_all_messages_come_in_order_through_several_pages(file: Path) -> None:
    with rtpm.open(file) as recording:
        every = list(recording)
        times = [message.log_time_ns for message in every]
        assert times == sorted(times)
        assert len(every) == sum(topic.count for topic in recording.topics.values())


def test_a_frame_has_the_columns_of_an_analysis(file: Path) -> None:
    with rtpm.open(file) as recording:
        try:
            import pandas  # noqa: F401
        except ImportError:
            with pytest.raises(ImportError, match="pip install pandas"):
                recording["lab/arm0"].frame()
            return
        frame = recording["lab/arm0"].frame()
        assert list(frame.columns) == ["time", "x", "y", "z", "fx", "fy", "fz", "buttons"]
        assert -1 < frame.time.iloc[0] < frame.time.iloc[-1] <= recording.duration + 1
        forces = recording["lab.Pressed/3"]
        assert list(forces.frame().columns) == ["time", "x", "y", "z"]
        assert forces.frame().z.tolist() == [force.z for force in forces.values()]
        with pytest.raises(TypeError, match="array takes messages of one struct"):
            recording["lab.Noted/0"].frame()


def test_an_arrow_table_has_the_columns_of_a_frame(file: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    with rtpm.open(file) as recording:
        table = recording["lab/arm0"].arrow()
        assert table.column_names == ["time", "x", "y", "z", "fx", "fy", "fz", "buttons"]
        assert table.num_rows == recording["lab/arm0"].count
        assert recording["lab.Pressed/3"].arrow().column_names == ["time", "x", "y", "z"]


def test_fields_of_fields_and_of_arrays_are_columns() -> None:
    kind = np.dtype(
        [("force", [("x", "f8"), ("y", "f8")]), ("joints", "f4", (2,)), ("state", "u1")]
    )
    columns = recordings._leaves(np.zeros(3, kind), "")
    assert list(columns) == ["force.x", "force.y", "joints[0]", "joints[1]", "state"]
    assert all(len(column) == 3 for column in columns.values())


def test_a_part_is_read_alone(file: Path) -> None:
    with rtpm.open(file) as recording:
        samples = recording["lab/arm0"]
        whole = [sample.log_time_ns for sample in samples]
        middle = (whole[-1] - recording.start_ns) / 2e9
        early, late = samples.between(0, middle), samples.between(middle, 1e9)
        begin = [sample.log_time_ns for sample in early]
        assert whole == begin + [sample.log_time_ns for sample in late]
        assert len(early.array()) == len(begin) > 10
        assert max(begin) - recording.start_ns < middle * 1e9
        with pytest.raises(ValueError, match="begin takes a time before end"):
            samples.between(2, 1)


def test_a_schema_that_cannot_be_read_is_told(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    # Binary schemas lose their identifier, and the summary its checksum: 0 means that it has none.
    data = file.read_bytes().replace(b"BFBS", b"XXXX")
    broken = file.with_name("schema.mcap")
    broken.write_bytes(data[:-12] + bytes(4) + data[-8:])
    with rtpm.open(broken) as recording:
        assert isinstance(next(iter(recording["lab.Noted/0"])).value, bytes)
        assert (
            "the schema of lab.Noted/0 can't be read, so that its values are bytes" in caplog.text
        )


def test_a_file_that_was_not_ended_is_read_if_asked_for(file: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:-1000])
    with pytest.raises(rtpm.RecordingError, match="rtpm bag recover"):
        rtpm.open(cut)
    with rtpm.open(cut, incomplete=True) as recording:
        assert not recording.is_complete
        assert len(recording["lab/arm0"].array()) > 0


def test_damaged_files_are_one_kind_of_error(file: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        rtpm.open(tmp_path / "none.mcap")
    other = tmp_path / "other.mcap"
    other.write_bytes(b"no recording")
    with pytest.raises(rtpm.RecordingError, match="other.mcap"):
        rtpm.open(other)
    data = bytearray(file.read_bytes())
    data[1000:1100] = bytes(100)
    other.write_bytes(data)
    with pytest.raises(rtpm.RecordingError):
        _ = [message.value for message in rtpm.open(other)]


def test_a_closed_recording_says_so(file: Path) -> None:
    recording = rtpm.open(file)
    recording.close()
    with pytest.raises(rtpm.Error, match="is closed"):
        next(iter(recording))


def test_without_numpy_values_are_read(file: Path) -> None:
    code = (
        "import sys; sys.modules['numpy'] = None\n"
        f"import rtpm\nsamples = rtpm.open({str(file)!r})['lab/arm0']\n"
        "assert next(samples.values()).sequence > 0\n"
        "try: samples.array()\nexcept ImportError as error: assert 'pip install numpy' in str(error)\n"
        "else: raise AssertionError"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=30).returncode == 0
