"""What `rtpm bag export` writes is read by others' code, and each value is the recording's."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
import rtpm
from conftest import PROGRAMS, Laboratory
from rtpm import schemas

TEXT = """
attribute "rtpm_event";
attribute "rtpm_unit";
namespace lab;
enum Phase : ubyte { Training, Test }
struct Force { x:double; y:double; z:double; }
table Pressed (rtpm_event: 7021) { force:Force (required); }
table Answered (rtpm_event: 7022) {
  number:uint; phase:Phase; answer:string; force:double (rtpm_unit: "N"); seed:ulong;
  path:[double]; picture:[ubyte]; late:int = null;
}
"""
_names = schemas.Schema(TEXT).names()
ANSWERS = ['yes, "quoted"', "=1+2", "two\nlines", "ü \u202e", ""]


#: Others' packages by which the tests below read exports, by the option of the export.
READERS: dict[str, list[str]] = {}
_SOURCES = Path(__file__).parents[3]
_Test = TypeVar("_Test", bound=Callable[..., None])


def _reads_by(package: str, option: str) -> Callable[[_Test], _Test]:
    def noted(test: _Test) -> _Test:
        READERS.setdefault(option, []).append(package)
        return test

    return noted


@pytest.fixture(scope="module")
def file(laboratory: Laboratory, node: rtpm.Node, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("exports") / "run.mcap"
    with (
        rtpm.supplier(_names["Pressed"], node=node, source=3) as pressed,
        rtpm.supplier(_names["Answered"], node=node) as answered,
    ):
        recorder = subprocess.Popen(
            _rtpm(laboratory, "record", str(path), "--hub", "rtpm/events", "--for", "1s"),
            stdout=subprocess.DEVNULL,
            env=_environment(laboratory),
        )
        number = 0
        while recorder.poll() is None:
            number += 1
            # The recorder has begun, and has not ended.
            if number == 30:
                trial = rtpm.trial(1, "soft, then hard", seed=7, node=node)
            if number == 33:
                trial.mark("touch")
            if number == 36:
                trial.response = "yes"
                trial.close()
            pressed.push(_names["Force"](0.1 * number, -1e-300, number))
            answered.push(
                _names["Answered"](
                    number=number,
                    phase=_names["Phase"].Test,
                    answer=ANSWERS[number % len(ANSWERS)],
                    force=number / 3,
                    seed=2**64 - number,
                    path=[0.1, number],
                    picture=b"\0\xff",
                    late=None if number % 2 else -number,
                )
            )
            try:
                recorder.wait(0.01)
            except subprocess.TimeoutExpired:
                continue
    assert recorder.returncode == 0
    return path


def _rtpm(laboratory: Laboratory, *words: str) -> list[str]:
    return [str(PROGRAMS / "rtpm"), "--registry", laboratory.registry.url, *words]


def _environment(laboratory: Laboratory) -> dict[str, str]:
    # `python3` is this one, and finds the package as it does.
    return os.environ | {
        "RTPM_RUNTIME_FOLDER": str(laboratory.folder),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }


def _exported(laboratory: Laboratory, file: Path, target: Path, kind: str, *options: str) -> Path:
    done = subprocess.run(
        _rtpm(laboratory, "bag", "export", str(file), str(target), f"--{kind}", *options),
        env=_environment(laboratory),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return target


@pytest.fixture(scope="module")
def recording(file: Path) -> Any:
    with rtpm.open(file) as opened:
        yield opened


@pytest.fixture(scope="module")
def ros2(laboratory: Laboratory, file: Path) -> Path:
    return _exported(laboratory, file, file.with_name("ros2.mcap"), "ros2")


def _check_samples(recording: Any, poses: list[Any], wrenches: list[Any], joys: list[Any]) -> None:
    samples = recording["lab/arm0"].array()
    assert len(samples) == len(poses) == len(wrenches) == len(joys) > 10
    description = next(recording["lab/arm0/description"].values())
    for sample, pose, wrench, joy in zip(samples, poses, wrenches, joys, strict=True):
        stamp = pose.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == sample["time_ns"]
        assert pose.header.frame_id == description.frame
        for axis in "xyz":
            assert getattr(pose.pose.position, axis) == sample["position_m"][axis]
            assert getattr(wrench.wrench.force, axis) == sample["force_newton"][axis]
        for part in "xyzw":
            assert getattr(pose.pose.orientation, part) == sample["orientation"][part]
        bits = [sample["buttons"] >> i & 1 for i in range(len(description.buttons))]
        assert list(joy.buttons) == bits


def _check_texts(recording: Any, texts: list[str]) -> None:
    values = list(recording["lab.Answered/0"].values())
    assert len(texts) == len(values) > 10
    for text, value in zip(texts, values, strict=True):
        read = json.loads(text)
        assert read["number"] == value.number
        assert read["phase"] == value.phase.name
        assert read.get("answer", "") == value.answer.replace("\u202e", "\\u{202e}")
        assert read["force"] == value.force
        assert read["seed"] == value.seed
        assert read["path"] == list(value.path)
        assert read["picture"] == "AP8="
        assert read.get("late") == value.late


@_reads_by("rosbags", "--ros2")
def test_rosbags_reads_the_export_for_ros2(recording: Any, ros2: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from rosbags.rosbag2.metadata import parse_qos
    from rosbags.rosbag2.storage_mcap import McapReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    ours, theirs = get_typestore(Stores.EMPTY), get_typestore(Stores.ROS2_JAZZY)
    read: dict[str, list[Any]] = {}
    with rtpm.open(ros2) as opened:
        channels = opened.topics
    reader = McapReader(ros2)
    reader.open()
    for connection in reader.connections:
        # The types as the file defines them are those of ROS 2.
        ours.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        assert ours.hash_rihs01(connection.msgtype) == theirs.hash_rihs01(connection.msgtype)
        metadata = channels[connection.topic].metadata
        assert metadata["topic_type_hash"] == theirs.hash_rihs01(connection.msgtype)
        (qos,) = parse_qos(metadata["offered_qos_profiles"])
        is_latched = connection.topic.endswith("/description")
        assert (qos.durability.value, qos.depth) == ((1, 1) if is_latched else (2, 10))
    for connection, _, data in reader.messages(reader.connections):
        message = ours.deserialize_cdr(data, connection.msgtype)
        read.setdefault(connection.topic, []).append(message)
    reader.close()
    base = "/rtpm/lab/arm0/"
    _check_samples(
        recording, read[base + "pose"], read[base + "applied_wrench"], read[base + "joy"]
    )
    _check_texts(recording, [text.data for text in read["/rtpm/lab_Answered/_0"]])


@_reads_by("mcap-ros2-support", "--ros2")
def test_mcap_ros2_reads_the_export_for_ros2(recording: Any, ros2: Path) -> None:
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    read: dict[str, list[Any]] = {}
    with ros2.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for _, channel, _, message in reader.iter_decoded_messages():
            read.setdefault(channel.topic, []).append(message)
    base = "/rtpm/lab/arm0/"
    _check_samples(
        recording, read[base + "pose"], read[base + "applied_wrench"], read[base + "joy"]
    )
    _check_texts(recording, [text.data for text in read["/rtpm/lab_Answered/_0"]])
    twists = read[base + "twist"]
    velocities = recording["lab/arm0"].array()["linear_m_per_s"]["x"]
    assert [twist.twist.linear.x for twist in twists] == list(velocities)
    assert read["/diagnostics"][0].status[0].name == "lab/arm0"


@_reads_by("pandas", "--csv")
def test_pandas_reads_the_csv(laboratory: Laboratory, recording: Any, file: Path) -> None:
    import pandas as pd

    folder = _exported(laboratory, file, file.with_name("csv"), "csv")
    frame = pd.read_csv(folder / "lab_arm0_sampled.csv", engine="python")
    samples = recording["lab/arm0"].array()
    assert len(frame) == len(samples)
    times = pd.to_datetime(frame["time [UTC]"]).astype("int64")
    assert list(times) == list(samples["time_ns"])
    for axis in "xyz":
        assert list(frame[f"position_m.{axis}"]) == list(samples["position_m"][axis])
        assert list(frame[f"force_newton.{axis}"]) == list(samples["force_newton"][axis])
    assert list(frame["host_time_ns"]) == list(samples["host_time_ns"])
    assert not [name for name in frame if name.endswith(".1")]  # None of them twice.
    answers = pd.read_csv(folder / "lab.Answered_0.csv", engine="python", keep_default_na=False)
    values = list(recording["lab.Answered/0"].values())
    assert list(answers["force [N]"]) == [value.force for value in values]
    assert list(answers["seed"]) == [value.seed for value in values]
    assert [json.loads(text) for text in answers["path"]] == [list(value.path) for value in values]
    shown = {"=1+2": "'=1+2", "ü \u202e": "ü \\u{202e}"}
    assert list(answers["answer"]) == [shown.get(v.answer, v.answer) for v in values]
    summary = json.loads((folder / "recording.json").read_text())
    assert {entry["topic"] for entry in summary["channels"]} <= set(recording.topics)


@_reads_by("pandas", "--parquet")
def test_pandas_reads_the_parquet_files(laboratory: Laboratory, recording: Any, file: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    import pandas as pd

    folder = _exported(laboratory, file, file.with_name("parquet"), "parquet")
    frame = pd.read_parquet(folder / "lab_arm0_sampled.parquet")
    samples = recording["lab/arm0"].array()
    assert list(frame["time [UTC]"].astype("int64")) == list(samples["time_ns"])
    for axis in "xyz":
        assert np.array_equal(frame[f"position_m.{axis}"], samples["position_m"][axis])
    csv = _exported(laboratory, file, file.with_name("csv2"), "csv")
    header = (csv / "lab_arm0_sampled.csv").read_text().partition("\n")[0].split(",")
    assert list(frame) == [name for name in header if name != "message"]
    answers = pd.read_parquet(folder / "lab.Answered_0.parquet")
    values = list(recording["lab.Answered/0"].values())
    for name, expected in {
        "number": [value.number for value in values],
        "phase": [value.phase.name for value in values],
        "answer": [value.answer for value in values],
        "force [N]": [value.force for value in values],
        "seed": [value.seed for value in values],
        "picture": [b"\0\xff" for _ in values],
    }.items():
        assert list(answers[name]) == expected
    assert answers["seed"].dtype == np.uint64


def test_the_readme_names_the_readers() -> None:
    peer = json.loads((_SOURCES / "tests/system/recording/peer/package.json").read_text())
    expected = {option: list(packages) for option, packages in READERS.items()}
    expected["--ros2"] += [name for name in peer["dependencies"] if "rosmsg2" in name]
    text = (_SOURCES / "gvd/recording/README.md").read_text()
    rows = re.findall(r"^\| `(--\w+)`: [^|]*\| ([^|]*) \|$", text, re.MULTILINE)
    named = {option: re.findall(r"[^`, ]+", cell) for option, cell in rows}
    assert {option: sorted(names) for option, names in named.items()} == {
        option: sorted(names) for option, names in expected.items()
    }


def test_parquet_files_have_the_notes(laboratory: Laboratory, file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    import pyarrow.parquet as pq
    from rtpm import parquet

    run = shutil.copy(file, tmp_path / "run.mcap")
    with rtpm.open(run) as recording:
        begin_ns = recording.start_ns
    beside = tmp_path / "run.mcap.notes.json"
    notes = [{"time_ns": begin_ns + 500_000_000, "text": "slipped, left", "made_ns": 1}]
    beside.write_text(json.dumps({"notes": notes}))
    parquet.export(run, tmp_path / "out")
    rows = pq.read_table(tmp_path / "out" / "notes.parquet").to_pylist()
    assert [(row["seconds [s]"], row["note"]) for row in rows] == [(0.5, "slipped, left")]
    beside.write_text("[]")
    with pytest.raises(rtpm.RecordingError, match="can't be read"):
        parquet.export(run, tmp_path / "second")
    assert not (tmp_path / "second").exists()


def test_an_export_refuses_what_exists(laboratory: Laboratory, file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    from rtpm import parquet

    with pytest.raises(FileExistsError, match="exists already"):
        parquet.export(file, tmp_path)
    assert parquet.main([str(tmp_path / "none.mcap"), str(tmp_path / "out")]) == 1
    assert not list(tmp_path.iterdir())


def test_a_missing_package_is_named(laboratory: Laboratory, file: Path, tmp_path: Path) -> None:
    """Without the package the tool says what is missing, and how to get it."""
    (tmp_path / "pyarrow.py").write_text("raise ImportError('no pyarrow here')\n")
    done = subprocess.run(
        _rtpm(laboratory, "bag", "export", str(file), str(tmp_path / "out"), "--parquet"),
        env=_environment(laboratory)
        | {"PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert "no pyarrow here" in done.stderr
    assert "pip install" in done.stderr


@pytest.fixture(scope="module")
def joined(laboratory: Laboratory, file: Path) -> Path:
    """All topics in one table as recorded, and the trials."""
    return _exported(laboratory, file, file.with_name("joined"), "csv", "--joined")


def test_pandas_reads_a_joined_table(recording: Any, joined: Path) -> None:
    import pandas as pd

    frame = pd.read_csv(joined / "joined.csv", low_memory=False)
    assert list(frame.columns[:5]) == ["time [UTC]", "seconds [s]", "trial", "condition", "marker"]
    times = pd.to_datetime(frame["time [UTC]"]).astype("int64")
    assert times.is_monotonic_increasing
    assert times.is_unique
    samples = recording["lab/arm0"].array()
    rows = frame.set_index(times)["lab/arm0.position_m.x"]
    assert list(rows.loc[samples["time_ns"]]) == list(samples["position_m"]["x"])
    # Between its samples a device's last one is held.
    assert rows.loc[samples["time_ns"][0] :].notna().all()
    assert list(frame["marker"].dropna()) == ["touch"]
    trial = frame[frame["trial"] == 1]
    assert set(trial["condition"]) == {"soft, then hard"}
    (only,) = pd.read_csv(joined / "trials.csv").to_dict("records")
    assert (only["number"], only["response"], only["seed"]) == (1, "yes", 7)
    assert trial["seconds [s]"].min() == pytest.approx(only["seconds [s]"], abs=1e-9)
    assert only["end [s]"] - only["seconds [s]"] == pytest.approx(only["duration [s]"], abs=1e-3)


@_reads_by("R", "--csv")
def test_r_reads_a_joined_table(joined: Path) -> None:
    import pandas as pd

    if shutil.which("Rscript") is None:
        pytest.skip("R is not installed (Debian's r-base-core)")
    program = """
    all <- read.csv("joined.csv", check.names = FALSE)
    x <- all[["lab/arm0.position_m.x"]]
    time <- as.POSIXct(all[["time [UTC]"]], format = "%Y-%m-%dT%H:%M:%OSZ", tz = "UTC")
    trials <- read.csv("trials.csv", check.names = FALSE)
    cat(nrow(all), ncol(all), is.numeric(x), sum(is.na(time)), trials[["condition"]], sep = "\\n")
    cat("\\n", format(sum(x, na.rm = TRUE), digits = 15), sep = "")
    """
    done = subprocess.run(
        ["Rscript", "--vanilla", "-e", program], cwd=joined, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    rows, columns, is_number, lacking, condition, total, *_ = (
        line for line in done.stdout.split("\n") if line
    )
    frame = pd.read_csv(joined / "joined.csv", low_memory=False)
    assert (int(rows), int(columns)) == frame.shape
    assert (is_number, lacking, condition) == ("TRUE", "0", "soft, then hard")
    assert float(total) == pytest.approx(frame["lab/arm0.position_m.x"].sum(), rel=1e-12)


def test_joined_parquet_has_the_values_of_the_csv(
    laboratory: Laboratory, joined: Path, file: Path
) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    import pandas as pd

    folder = _exported(laboratory, file, file.with_name("joined2"), "parquet", "--joined")
    assert not file.with_name("joined2.tables").exists()
    frame = pd.read_parquet(folder / "joined.parquet")
    text = pd.read_csv(joined / "joined.csv", low_memory=False)
    assert list(frame) == list(text)
    assert str(frame["time [UTC]"].dtype) == "datetime64[ns, UTC]"
    for name in ("seconds [s]", "lab/arm0.position_m.x", "lab.Pressed/3.x"):
        assert np.array_equal(frame[name], text[name], equal_nan=True), name
    assert list(frame["marker"].dropna()) == ["touch"]
    assert len(pd.read_parquet(folder / "trials.parquet")) == 1


def test_a_part_of_chosen_columns(laboratory: Laboratory, file: Path, joined: Path) -> None:
    import pandas as pd

    folder = _exported(
        laboratory, file, file.with_name("part"), "csv", "--joined", "--trial", "1",
        "--columns", "position_m.*", "--topics", "lab/arm0", "--rate", "1000",
    )  # fmt: skip
    frame = pd.read_csv(folder / "joined.csv")
    assert [name for name in frame if "." in name] == [f"lab/arm0.position_m.{i}" for i in "xyz"]
    assert set(frame["trial"]) == {1}
    steps = np.diff(frame["seconds [s]"])
    assert np.allclose(steps, 1e-3)
    done = subprocess.run(
        _rtpm(laboratory, "bag", "export", str(file), str(folder) + "2", "--csv", "--joined",
              "--columns", "position_n.x"),
        env=_environment(laboratory), capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 1
    assert "no column is like 'position_n.x' (did you mean 'position_m.x'?)" in done.stderr
    assert not Path(str(folder) + "2").exists()
