"""Writes a recording as Parquet files: `rtpm bag export run.mcap tables --parquet`."""

from __future__ import annotations

import csv
import ctypes
import enum
import json
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from . import errors, recordings, schemas
from .values import Struct, Table

_BASES = {
    2: pa.bool_(),
    3: pa.int8(),
    4: pa.uint8(),
    5: pa.int16(),
    6: pa.uint16(),
    7: pa.int32(),
    8: pa.uint32(),
    9: pa.int64(),
    10: pa.uint64(),
    11: pa.float32(),
    12: pa.float64(),
    13: pa.string(),
}
_OBJECT = 15
_FILE_NAME_MAX = 200


class Report(NamedTuple):
    """What an export wrote, and what it could not."""

    #: The messages that it wrote, and the files with them.
    message_count: int
    topic_count: int
    #: Topic, reason and number of messages of each channel that was left out.
    left_out: list[tuple[str, str, int]]


def export(path: str | os.PathLike[str], folder: str | os.PathLike[str]) -> Report:
    """Writes a folder with one Parquet file per channel, and `recording.json` about them all.

    Notes beside the recording become `notes.parquet`.

    The folder appears when it is complete; one that exists is an error.
    """
    target = Path(folder)
    draft = target.with_name(target.name + ".part")
    for taken in (target, draft):
        if taken.exists():
            raise FileExistsError(
                f"{taken} exists already. Remedy: choose another name, or remove it."
            )
    notes = _notes(path)
    with recordings.open(path) as recording:
        draft.mkdir()
        try:
            report = _export(recording, draft)
            if notes:
                times = np.array([time_ns for time_ns, _ in notes], np.int64)
                texts = pa.array([text for _, text in notes])
                table = _with_times(recording, times, {"note": texts})
                pq.write_table(table, draft / "notes.parquet")
            draft.rename(target)
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise
    return report


def _notes(path: str | os.PathLike[str]) -> list[tuple[int, str]]:
    """The notes that a person made beside the recording, by time."""
    file = Path(f"{os.fspath(path)}.notes.json")
    if not file.exists():
        return []
    try:
        notes = json.loads(file.read_text())["notes"]
        return sorted((int(note["time_ns"]), str(note["text"])) for note in notes)
    except (ValueError, LookupError, TypeError) as problem:
        raise errors.RecordingError(
            f"the notes {file} can't be read: {problem!r}. Remedy: repair or remove that file."
        ) from None


def convert(tables: str | os.PathLike[str], folder: str | os.PathLike[str]) -> Report:
    """Writes the CSV files of a folder, as `rtpm bag export --csv` made it, as Parquet files.

    A column has the narrowest of bool, int64, uint64, double and text that takes all its values.
    """
    source = Path(tables)
    target = Path(folder)
    draft = target.with_name(target.name + ".part")
    for taken in (target, draft):
        if taken.exists():
            raise FileExistsError(
                f"{taken} exists already. Remedy: choose another name, or remove it."
            )
    draft.mkdir()
    row_count = 0
    files = sorted(source.glob("*.csv"))
    try:
        for file in files:
            row_count += _convert(file, draft / (file.stem + ".parquet"))
        summary = json.loads((source / "recording.json").read_text())
        for channel in summary["channels"]:
            channel["file"] = channel["file"].removesuffix(".csv") + ".parquet"
        (draft / "recording.json").write_text(json.dumps(summary, indent=1) + "\n")
        draft.rename(target)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    return Report(row_count, len(files), [])


_NARROWEST = (pa.bool_(), pa.int64(), pa.uint64(), pa.float64())


def _texts(path: Path) -> Any:
    """Reads the file in blocks, with texts in all columns."""
    with path.open(newline="") as file:
        names = next(csv.reader(file))
    return pa_csv.open_csv(
        path,
        parse_options=pa_csv.ParseOptions(newlines_in_values=True),
        convert_options=pa_csv.ConvertOptions(
            column_types={name: pa.string() for name in names},
            null_values=[""],
            strings_can_be_null=True,
        ),
    )


def _convert(source: Path, target: Path) -> int:
    """Converts a table in two passes, for types and for values, a block at a time."""
    kinds: dict[str, list[Any]] = {}
    for batch in _texts(source):
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            known = kinds.setdefault(name, list(_NARROWEST))
            while known and column.null_count < len(column) and not _is(column, known[0]):
                del known[0]
    schema = pa.schema(
        [
            (
                name,
                pa.timestamp("ns", "UTC") if name == "time [UTC]" else (kind or [pa.string()])[0],
            )
            for name, kind in kinds.items()
        ]
    )
    row_count = 0
    with pq.ParquetWriter(target, schema) as writer:
        for batch in _texts(source):
            row_count += len(batch)
            columns = [
                _cast(column, kind)
                for column, kind in zip(batch.columns, schema.types, strict=True)
            ]
            writer.write_batch(pa.record_batch(columns, schema=schema))
    return row_count


def _is(column: Any, kind: Any) -> bool:
    if kind == pa.bool_():
        allowed = pa.array(["true", "false"])
        # Made at run time, so type checkers don't know them.
        is_in, every = getattr(pc, "is_in"), getattr(pc, "all")  # noqa: B009
        return bool(every(is_in(column.drop_null(), allowed)).as_py())
    try:
        column.cast(kind)
    except pa.ArrowInvalid:
        return False
    return True


def _cast(column: Any, kind: Any) -> Any:
    return column if kind == pa.string() else column.cast(kind)


def _export(recording: recordings.Recording, folder: Path) -> Report:
    left_out: list[tuple[str, str, int]] = []
    entries: list[dict[str, Any]] = []
    for channel in recording._channels.values():
        if channel.metadata.get("rtpm.kind") == "view":
            continue
        try:
            table = _table(recording, channel)
        except (errors.Error, pa.ArrowException) as problem:
            left_out.append((channel.topic, str(problem), channel.message_count))
            continue
        if table is None:
            left_out.append((channel.topic, "its schema can't be read", channel.message_count))
            continue
        name = _free_name(channel.topic, {"notes.parquet", *(entry["file"] for entry in entries)})
        pq.write_table(table, folder / name)
        entries.append(
            {
                "file": name,
                "topic": channel.topic,
                "type": channel.type,
                "message_count": str(len(table)),
                "values": channel.metadata,
            }
        )
    summary = {
        "begin": _time_text(recording.start_ns),
        "end": _time_text(recording.end_ns),
        "channels": entries,
        "metadata": [{"name": name, "values": values} for name, values in recording.metadata],
    }
    (folder / "recording.json").write_text(json.dumps(summary, indent=1) + "\n")
    return Report(
        sum(int(entry["message_count"]) for entry in entries), len(entries), sorted(left_out)
    )


def _table(recording: recordings.Recording, channel: Any) -> Any:
    """The channel's messages; None if they can't be read."""
    topic = recordings.Topic(recording, channel.topic, [channel])
    if recording._struct_of(channel) is not None:
        array = topic.array()
        columns = recordings._leaves(array[list(array.dtype.names[1:])], "")
        return _with_times(recording, array["time_ns"], _named(recording, channel, columns))
    known = recording._schema_of(channel)
    if known is None and channel.encoding != "json":
        return None
    times: list[int] = []
    rows: list[dict[str, Any]] = []
    for message in topic:
        times.append(message.time_ns)
        if known is None:
            rows.append({"json": message._data.decode(errors="replace")})
        else:
            rows.append(dict(_flat(message.value, "")))
    kinds = {} if known is None else dict(_kinds(known[0], known[1], "", []))
    names = [*kinds, *(name for row in rows for name in row if name not in kinds)]
    columns = {}
    for name in dict.fromkeys(names):
        kind, unit = kinds.get(name, (None, ""))
        values = [row.get(name) for row in rows]
        columns[f"{name} [{unit}]" if unit else name] = pa.array(values, kind)
    return _with_times(recording, np.array(times, np.int64), columns)


def _with_times(recording: recordings.Recording, times_ns: Any, columns: dict[str, Any]) -> Any:
    begin = {
        "time [UTC]": pa.array(times_ns, pa.timestamp("ns", "UTC")),
        "seconds [s]": (times_ns - recording.start_ns) * 1e-9,
    }
    return pa.table(begin | columns)


def _named(
    recording: recordings.Recording, channel: Any, columns: dict[str, Any]
) -> dict[str, Any]:
    """The columns of a device's samples by the names and units of its parts; others as they are."""
    device = channel.metadata.get("rtpm.device")
    described = recording.topics.get(f"{device}/description")
    first = next(iter(described.values()), None) if described else None
    if channel.type != recordings._SAMPLED or first is None:
        return columns
    names: dict[str, str | None] = {name: None for name in columns if name.endswith("]")}
    for index, joint in enumerate(first.joints):
        effort = "N" if joint.unit == "m" else "N m"
        names[f"joints[{index}]"] = f"joints.{joint.name} [{joint.unit}]"
        names[f"joint_velocities[{index}]"] = f"joint_velocities.{joint.name} [{joint.unit}/s]"
        names[f"efforts[{index}]"] = f"efforts.{joint.name} [{effort}]"
    for array, parts in (("outputs", first.outputs), ("analogs", first.analogs)):
        for index, part in enumerate(parts):
            names[f"{array}[{index}]"] = f"{array}.{part.name} [{part.unit}]"
    for index, button in enumerate(first.buttons):
        names[f"button_edges[{index}]"] = f"button_edges.{button}"
    kept = ((names.get(name, name), values) for name, values in columns.items())
    return {name: values for name, values in kept if name is not None}


def _flat(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """The values of a table by their paths; lists stay lists."""
    if isinstance(value, Table):
        for part in value._rtpm_fields_:
            yield from _flat(getattr(value, part), f"{name}.{part}" if name else part)
    elif isinstance(value, Struct):
        for part, *_ in value._fields_:
            if not part.startswith("_padding_"):
                yield from _flat(getattr(value, part), f"{name}.{part}" if name else part)
    elif isinstance(value, ctypes.Array):
        for index, element in enumerate(value):
            yield from _flat(element, f"{name}[{index}]")
    else:
        yield name, _plain(value)


def _plain(value: Any) -> Any:
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, (Table, Struct)):
        return dict(_flat(value, ""))
    if isinstance(value, (bytes, str)) or not isinstance(value, Sequence):
        return value
    return [_plain(element) for element in value]


def _kinds(
    schema: schemas.Schema, index: int, prefix: str, above: list[int]
) -> Iterator[tuple[str, tuple[Any, str]]]:
    """The type and unit of each number and text of a table by its path."""
    for field in schema.layout["objects"][index]["fields"]:
        name = prefix + field["attribute"]
        if field["base"] == _OBJECT and field["index"] not in above:
            yield from _kinds(schema, field["index"], name + ".", [*above, index])
        elif field["base"] in _BASES:
            is_named = field["index"] is not None
            yield name, (pa.string() if is_named else _BASES[field["base"]], field["unit"])


def _free_name(topic: str, taken: set[str]) -> str:
    """The file's name, as the CSV export makes it."""
    stem = "".join(
        c if c.isascii() and (c.isalnum() or c in "-.") else "_" * len(c.encode()) for c in topic
    )[:_FILE_NAME_MAX]
    if not stem or stem.startswith("."):
        stem = "_" + stem
    number, name = 1, stem + ".parquet"
    while name in taken:
        number += 1
        name = f"{stem}-{number}.parquet"
    return name


def _time_text(time_ns: int) -> str:
    return f"{np.datetime64(time_ns, 'ns')}Z"


def main(arguments: list[str]) -> int:
    """Exports and reports as `rtpm bag export` does; returns the exit code."""
    path, folder, *options = arguments
    is_json = "--json" in options
    try:
        if "--tables" in options:
            try:
                report = convert(path, folder)
            finally:
                shutil.rmtree(path, ignore_errors=True)
        else:
            report = export(path, folder)
    except (OSError, errors.Error) as problem:
        text = f"{path} can't be exported: {problem}"
        print(
            json.dumps({"error": {"what": text}}) if is_json else f"rtpm: {text}", file=sys.stderr
        )
        return 1
    if is_json:
        left_out = [
            {"topic": topic, "reason": reason, "message_count": count}
            for topic, reason, count in report.left_out
        ]
        print(
            json.dumps(
                {
                    "output": folder,
                    "message_count": report.message_count,
                    "topic_count": report.topic_count,
                    "left_out": left_out,
                }
            )
        )
    else:
        kind = "rows" if "--tables" in options else "messages"
        print(f"{folder} has {report.message_count} {kind} in {report.topic_count} files")
        for topic, reason, count in report.left_out:
            print(f"{topic}: {count} messages were left out: {reason}")
    return 1 if report.left_out else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
