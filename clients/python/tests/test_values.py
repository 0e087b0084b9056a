"""Values of every kind go to bytes and back, and wrong ones name their field."""

from __future__ import annotations

import gc
import pickle
from typing import Any

import numpy as np
import pytest
import rtpm
from rtpm import schemas

TEXT = """
attribute "rtpm_id";
attribute "rtpm_unit";
attribute "rtpm_range";
attribute "rtpm_event";
namespace rtpm;
table Empty {}
namespace values;
enum Mode : ubyte { Off = 0, Follow = 3 }
/// A force.
struct Force {
  x:double (rtpm_unit: "newton", rtpm_range: "-20..20");
  y:double;
  z:double;
}
struct Mixed {
  flag:bool;
  small:byte;
  mode:Mode;
  count:uint;
  big:ulong;
  ratio:float;
  force:Force;
  counts:[ushort:4];
  from:short;
}
table Circle { radius:double; }
table Square { side:double; name:string; }
union Shape { Circle, Square }
table Part { name:string (required); force:Force; }
table Everything {
  title:string (required);
  note:string;
  flag:bool = true;
  tiny:byte = -3;
  huge:ulong;
  rate_hz:double = 2.5;
  mode:Mode = Follow;
  maybe:int = null;
  force:Force;
  part:Part;
  parts:[Part];
  shape:Shape;
  shapes:[Shape];
  bytes:[ubyte];
  numbers:[double];
  flags:[bool];
  names:[string];
  forces:[Force];
  modes:[Mode];
}
table Moved (rtpm_event: 7) { force:Force (required); }
rpc_service Arm { echo(Everything):Everything (rtpm_id: 1); }
"""


@pytest.fixture(scope="module")
def lab() -> Any:
    schema = schemas.Schema(TEXT)
    return type("Lab", (), schema.names() | {"schema": schema})


def through_the_wire(lab: Any, value: Any) -> Any:
    index = lab.schema.classes.objects.index(type(value))
    return lab.schema.core.decode(index, lab.schema.core.encode(index, value))


def everything(lab: Any) -> Any:
    return lab.Everything(
        title="täst",
        note="n",
        flag=False,
        tiny=-128,
        huge=2**64 - 1,
        rate_hz=float("inf"),
        mode=lab.Mode.Off,
        maybe=0,
        force=lab.Force(1, 2, 3),
        part=lab.Part(name="p"),
        parts=[lab.Part(name="a", force=lab.Force(z=1)), lab.Part(name="b")],
        shape=lab.Square(side=2, name="s"),
        shapes=[lab.Circle(radius=1), lab.Square(side=2)],
        bytes=b"\x00\xff",
        numbers=[1.5, 2.5],
        flags=[True, False],
        names=["a", ""],
        forces=[lab.Force(1, 2, 3), lab.Force()],
        modes=[lab.Mode.Follow, lab.Mode.Off],
    )


def test_a_table_of_every_kind_comes_back_equal(lab: Any) -> None:
    value = everything(lab)
    back = through_the_wire(lab, value)
    assert back == value
    assert back.huge == 2**64 - 1
    assert back.mode is lab.Mode.Off
    assert back.shapes[0].radius == 1
    assert list(back.forces)[0] == lab.Force(1, 2, 3)


def test_absent_fields_have_their_defaults(lab: Any) -> None:
    back = through_the_wire(lab, lab.Everything(title="t"))
    assert (back.flag, back.tiny, back.rate_hz, back.mode, back.maybe) == (
        True,
        -3,
        2.5,
        lab.Mode.Follow,
        None,
    )
    assert (back.note, back.force, back.part, back.shape) == ("", None, None, None)
    assert (list(back.numbers), back.bytes, back.names) == ([], b"", [])


def test_structs_are_buffers_of_their_wire_bytes(lab: Any) -> None:
    force = lab.Force(1, 2, 3)
    assert bytes(force) == np.array([1.0, 2.0, 3.0]).tobytes()
    view = np.asarray(force)
    force.x = 9
    assert view["x"] == 9
    mixed = lab.Mixed(
        flag=True,
        small=-1,
        mode=lab.Mode.Follow,
        big=2**64 - 1,
        force=force,
        counts=[1, 2, 3, 4],
        from_=-2,
    )
    assert (mixed.force, mixed.mode, list(mixed.counts), mixed.from_) == (
        force,
        lab.Mode.Follow,
        [1, 2, 3, 4],
        -2,
    )
    assert rtpm.replace(mixed, count=5).count == 5


def test_vectors_take_buffers_and_sequences(lab: Any) -> None:
    numbers = np.linspace(0, 1, 1000)
    back = through_the_wire(
        lab, lab.Everything(title="t", numbers=numbers, forces=np.zeros((2, 3)).view(np.uint8))
    )
    assert np.array_equal(np.asarray(back.numbers), numbers)
    assert len(back.forces) == 2
    assert np.frombuffer(back.forces, dtype=np.float64).shape == (6,)


def test_wrong_values_name_their_field(lab: Any) -> None:
    cases = [
        (lambda: lab.Force(x="1"), TypeError, r"Force\.x takes a number, not str"),
        (lambda: lab.Force(w=1), TypeError, r"Force has no field 'w'; it has x, y, z"),
        (lambda: lab.Mixed(count=-1), ValueError, r"Mixed\.count takes 0 to 4294967295, not -1"),
        (lambda: lab.Mixed(counts=[1]), ValueError, r"Mixed\.counts takes 4 values, not 1"),
        (lambda: lab.Everything(), TypeError, r"Everything needs the field 'title'"),
        (lambda: lab.Everything(title="t", tilte=1), TypeError, r"Everything has no field 'tilte'"),
        (
            lambda: through_the_wire(lab, lab.Everything(title=3)),
            TypeError,
            r"Everything\.title takes a str, not int",
        ),
        (
            lambda: through_the_wire(lab, lab.Everything(title="t", tiny=200)),
            ValueError,
            r"Everything\.tiny takes int8",
        ),
        (
            lambda: through_the_wire(lab, lab.Everything(title="t", force=3)),
            TypeError,
            r"Everything\.force takes a Force",
        ),
        (
            lambda: through_the_wire(lab, lab.Everything(title="t", shape=3)),
            TypeError,
            r"takes a Circle or Square, not int",
        ),
        (
            lambda: through_the_wire(lab, lab.Everything(title="t", numbers="ab")),
            TypeError,
            r"Everything\.numbers takes",
        ),
        (
            lambda: through_the_wire(lab, lab.Everything(title="t", names=[1])),
            TypeError,
            r"Everything\.names\[0\] takes a str",
        ),
    ]
    for make, kind, pattern in cases:
        with pytest.raises(kind, match=pattern):
            make()


def test_damaged_bytes_are_an_error(lab: Any) -> None:
    index = lab.schema.classes.objects.index(lab.Everything)
    whole = lab.schema.core.encode(index, everything(lab))
    for size in range(len(whole)):
        try:
            lab.schema.core.decode(index, whole[:size])
        except Exception as error:
            assert type(error).__name__ == "BadReply"


def test_values_pickle_match_and_explain_themselves(lab: Any) -> None:
    value = everything(lab)
    assert pickle.loads(pickle.dumps(value)) == value
    assert pickle.loads(pickle.dumps(lab.Mode(77))) == 77
    match lab.Force(1, 2, 3):
        case lab.Force(x, y=2):
            assert x == 1
        case _:
            pytest.fail("a struct does not match")
    match through_the_wire(lab, value).shape:
        case lab.Square(side=side):
            assert side == 2
        case _:
            pytest.fail("a union does not match")
    assert "A force." in lab.Force.__doc__
    assert "x: newton, -20 to 20" in lab.Force.__doc__
    assert repr(lab.Force(z=1.5)) == "Force(x=0.0, y=0.0, z=1.5)"


def test_equal_types_of_several_schemas_are_one_class(lab: Any) -> None:
    again = schemas.Schema(TEXT).names()
    assert again["Force"] is lab.Force
    assert again["Mode"] is lab.Mode


def test_a_table_that_contains_itself_is_refused(lab: Any) -> None:
    schema = schemas.Schema("table Tree { trees:[Tree]; } root_type Tree;")
    tree = schema.names()["Tree"]()
    tree.trees = [tree]
    with pytest.raises(ValueError, match="nested too deeply"):
        schema.core.encode(0, tree)


def test_a_text_that_is_no_schema_is_refused() -> None:
    with pytest.raises(ValueError, match="the schema can't be read"):
        schemas.Schema("table {")


def test_views_outlive_their_message(lab: Any) -> None:
    numbers = np.arange(10_000.0)
    back = through_the_wire(lab, lab.Everything(title="t", numbers=numbers, force=lab.Force(z=7)))
    view, force = np.asarray(back.numbers), np.asarray(back.force)
    del back
    gc.collect()
    others = [through_the_wire(lab, everything(lab)) for _ in range(100)]
    assert np.array_equal(view, numbers) and force["z"] == 7 and len(others) == 100
