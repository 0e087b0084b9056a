"""Values: the classes of a schema's structs, tables, enums and unions.

A struct is a buffer of its wire bytes; a table has one attribute per field. The classes are made from
a schema's layout, for generated modules and for objects that describe themselves.
"""

from __future__ import annotations

import array
import ctypes
import enum
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, ClassVar, Protocol, TypeVar, cast

from . import errors

__all__ = ["Buffer", "Event", "Struct", "Table", "Vector", "replace"]

# Numbered as schema::BaseType.
_CTYPES: dict[int, Any] = {
    2: ctypes.c_bool,
    3: ctypes.c_int8,
    4: ctypes.c_uint8,
    5: ctypes.c_int16,
    6: ctypes.c_uint16,
    7: ctypes.c_int32,
    8: ctypes.c_uint32,
    9: ctypes.c_int64,
    10: ctypes.c_uint64,
    11: ctypes.c_float,
    12: ctypes.c_double,
}
_BOOL, _DOUBLE, _STRING, _VECTOR, _OBJECT, _UNION, _ARRAY = 2, 12, 13, 14, 15, 16, 17
_CODES = {
    "bool": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float": "f",
    "double": "d",
}


class Buffer(Protocol):
    """Anything with the buffer protocol, such as bytes, array.array or a numpy array."""

    def __buffer__(self, flags: int, /) -> memoryview: ...


_S = TypeVar("_S", bound="Struct")
_T = TypeVar("_T", bound="Table")
_V = TypeVar("_V", bound="Vector")

#: The classes made so far, by name and layout: equal types of several schemas are one class.
_classes: dict[tuple[str, str], type] = {}


class Struct(ctypes.Structure):
    """A value of fixed size. It is a buffer: `numpy.asarray(value)` is a view of it."""

    __slots__ = ()
    _rtpm_names_: ClassVar[tuple[str, ...]] = ()
    _rtpm_units_: ClassVar[dict[str, str]] = {}
    _rtpm_key_: ClassVar[tuple[str, str]] = ("", "")
    _rtpm_origin_: ClassVar[Any] = None
    __match_args__: ClassVar[tuple[str, ...]] = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            _plain(getattr(self, name)) == _plain(getattr(other, name))
            for name in self._rtpm_names_
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={_plain(getattr(self, name))!r}" for name in self._rtpm_names_)
        return f"{type(self).__name__}({fields})"

    def _repr_html_(self) -> str:
        from .display import value_html

        return value_html(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore_struct, (self._rtpm_key_, bytes(self))

    def __replace__(self: _S, **changes: Any) -> _S:
        copy = type(self).from_buffer_copy(bytes(self))
        for name, value in changes.items():
            if name not in self._rtpm_names_:
                raise TypeError(f"{type(self).__name__} has no field '{name}'")
            setattr(copy, name, value)
        return copy


class Vector(Struct):
    """A struct of numbers only, such as a position: it adds, scales and has a length."""

    __slots__ = ()

    def __iter__(self) -> Iterator[float]:
        return (getattr(self, name) for name in self._rtpm_names_)

    def __len__(self) -> int:
        return len(self._rtpm_names_)

    def __getitem__(self, index: int) -> float:
        value: float = getattr(self, self._rtpm_names_[index])
        return value

    def __add__(self: _V, other: Any) -> _V:
        return cast(_V, self._each(other, float.__add__))

    __radd__ = __add__

    def __sub__(self: _V, other: Any) -> _V:
        return cast(_V, self._each(other, float.__sub__))

    def __rsub__(self: _V, other: Any) -> _V:
        return cast(_V, self._each(other, float.__rsub__))

    def __mul__(self: _V, factor: float) -> _V:
        if not isinstance(factor, (int, float)):
            return NotImplemented
        kind: type[_V] = type(self)
        return kind(*(value * factor for value in self))

    __rmul__ = __mul__

    def __truediv__(self: _V, divisor: float) -> _V:
        return self * (1 / divisor)

    def __neg__(self: _V) -> _V:
        return self * -1.0

    def __abs__(self) -> float:
        """The length."""
        return math.hypot(*self)

    def dot(self, other: Vector) -> float:
        """The scalar product."""
        return math.fsum(a * b for a, b in zip(self, other, strict=True))

    def _each(self, other: Any, operation: Callable[[float, float], float]) -> Any:
        try:
            if len(other) != len(self):
                raise ValueError(f"{type(self).__name__} has {len(self)} numbers, not {len(other)}")
        except TypeError:
            return NotImplemented
        kind: Any = type(self)
        return kind(*(operation(float(a), float(b)) for a, b in zip(self, other, strict=True)))


class Table:
    """A message with named fields, all given by keyword."""

    __slots__ = ()
    _rtpm_key_: ClassVar[tuple[str, str]] = ("", "")
    _rtpm_origin_: ClassVar[Any] = None
    _rtpm_fields_: ClassVar[dict[str, Callable[[], Any] | None]] = {}
    _rtpm_units_: ClassVar[dict[str, str]] = {}
    __match_args__: ClassVar[tuple[str, ...]] = ()

    def __init__(self, **fields: Any) -> None:
        for name, default in self._rtpm_fields_.items():
            if name in fields:
                setattr(self, name, fields.pop(name))
            elif default is None:
                raise TypeError(f"{type(self).__name__} needs the field '{name}'")
            else:
                setattr(self, name, default())
        if fields:
            known = ", ".join(self._rtpm_fields_)
            raise TypeError(
                f"{type(self).__name__} has no field '{next(iter(fields))}'; it has {known}"
            )

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            _plain(getattr(self, name)) == _plain(getattr(other, name))
            for name in self._rtpm_fields_
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={_plain(getattr(self, name))!r}" for name in self._rtpm_fields_)
        return f"{type(self).__name__}({fields})"

    def _repr_html_(self) -> str:
        from .display import value_html

        return value_html(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore_table, (
            self._rtpm_key_,
            {name: _pickled(getattr(self, name)) for name in self._rtpm_fields_},
        )

    def __replace__(self: _T, **changes: Any) -> _T:
        return type(self)(**({name: getattr(self, name) for name in self._rtpm_fields_} | changes))


class Event(Table):
    """A table that is an event."""

    __slots__ = ()
    #: The event's number in its schema, and the schema's fingerprint.
    _rtpm_event_: ClassVar[tuple[int, int]] = (0, 0)


_Value = TypeVar("_Value", Struct, Table)


def replace(value: _Value, /, **changes: Any) -> _Value:
    """A copy of a struct or table with some fields changed, as copy.replace() makes it."""
    return value.__replace__(**changes)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, (ctypes.Array, array.array)) else value


def _pickled(value: Any) -> Any:
    return list(value) if isinstance(value, ctypes.Array) else value


def _known(key: tuple[str, str]) -> Any:
    try:
        return _classes[key]
    except KeyError:
        raise errors.Error(
            f"the class {key[0]} is unknown here; import its generated module, or connect to its server, first"
        ) from None


def _restore_enum(key: tuple[str, str], number: int) -> Any:
    return _known(key)(number)


def _restore_struct(key: tuple[str, str], data: bytes) -> Any:
    return _known(key).from_buffer_copy(data)


def _restore_table(key: tuple[str, str], fields: dict[str, Any]) -> Any:
    return _known(key)(**fields)


# ---- what the extension calls -------------------------------------------------------------------


def number_bytes(kind: str, values: Any, path: str) -> bytes:
    """The packed numbers of a sequence or buffer."""
    if kind in ("uint8", "int8") and isinstance(values, (bytes, bytearray)):
        return bytes(values)
    try:
        view = memoryview(values)
    except TypeError:
        pass
    else:
        if view.format.lstrip("<@=") == _CODES[kind] and view.ndim == 1:
            return view.tobytes()
        if view.ndim != 1:
            raise ValueError(f"{path} takes one dimension, not {view.ndim}")
        values = view.tolist()
    try:
        return array.array(_CODES[kind], values).tobytes()
    except TypeError as error:
        raise TypeError(f"{path} takes a sequence of {kind}: {error}") from None
    except OverflowError as error:
        raise ValueError(f"{path} takes a sequence of {kind}: {error}") from None


def numbers_from(kind: str, data: bytes) -> Any:
    """The numbers of packed bytes."""
    if kind == "bool":
        return [number != 0 for number in data]
    return array.array(_CODES[kind], data)


def struct_bytes(kind: type[Struct], values: Any, path: str) -> bytes:
    """The packed structs of a sequence or buffer."""
    if isinstance(values, (list, tuple, ctypes.Array)):
        for number, value in enumerate(values):
            if not isinstance(value, kind):
                raise TypeError(
                    f"{path}[{number}] takes a {kind.__name__}, not {type(value).__name__}"
                )
        return b"".join(bytes(value) for value in values)
    data = memoryview(values).tobytes()
    if len(data) % ctypes.sizeof(kind):
        raise ValueError(
            f"{path} takes {ctypes.sizeof(kind)} bytes per {kind.__name__}, not {len(data)} in all"
        )
    return data


# ---- making classes -----------------------------------------------------------------------------


def _quantity(field: dict[str, Any]) -> str:
    parts = [field["unit"]] if field["unit"] else []
    if field["range"]:
        low, high = field["range"]
        parts.append(f"{low:g} to {high:g}")
    if field["frame"]:
        parts.append(f"in the frame {field['frame']}")
    return ", ".join(parts)


def _quantities(item: dict[str, Any]) -> dict[str, str]:
    return {field["attribute"]: _quantity(field) for field in item["fields"]}


def _documentation(item: dict[str, Any]) -> str:
    """The comment of a type, and a line for each field that has a comment or a unit."""
    lines = [item["doc"].strip()] if item["doc"].strip() else []
    fields = []
    for field in item["fields"]:
        texts = [text for text in (" ".join(field["doc"].split()), _quantity(field)) if text]
        if texts:
            fields.append(f"{field['attribute']}: {'; '.join(texts)}")
    if fields:
        lines.append("\n".join(fields))
    return "\n\n".join(lines)


class Classes:
    """The classes of one schema, by the index of the schema's objects and enums."""

    def __init__(self, layout: dict[str, Any], module: str) -> None:
        self._layout = layout
        self._module = module
        self.enums: list[Any] = [self._enum(item) for item in layout["enums"]]
        self.objects: list[Any] = [None] * len(layout["objects"])
        self._keys: dict[int, str] = {}
        for index in range(len(self.objects)):
            self._object(index)

    def for_extension(self) -> list[tuple[Any, list[str | None]]]:
        """Each object's class, and its attribute for each field's id; None for a hidden field."""
        result = []
        for kind, item in zip(self.objects, self._layout["objects"], strict=True):
            names: list[str | None] = [None] * len(item["fields"])
            for field in item["fields"]:
                if not field["is_hidden"]:
                    names[field["id"]] = field["attribute"]
            result.append((kind, names))
        return result

    def public(self) -> Iterable[tuple[str, Any]]:
        """All classes by their names; a union is that of its members' types."""
        for kind, item in zip(self.objects, self._layout["objects"], strict=True):
            if not item["is_hidden"]:
                yield item["class"], kind
        for kind, item in zip(self.enums, self._layout["enums"], strict=True):
            if not item["is_union"]:
                yield item["class"], kind
                continue
            members = [
                str if base == _STRING else self.objects[index]
                for _, _, base, index, _ in item["values"]
                if base
            ]
            union = members[0]
            for member in members[1:]:
                union = union | member
            yield item["class"], union

    def _enum(self, item: dict[str, Any]) -> Any:
        if item["is_union"]:
            return None
        key = (item["name"], repr([value[:2] for value in item["values"]]) + str(item["base"]))
        if key not in _classes:
            names = {name: value for name, value, *_ in item["values"]}
            make: Any = _Flags if item["is_bit_flags"] else _Enumeration
            kind = make(item["class"], names, module=self._module)
            kind.__doc__ = item["doc"].strip() or None
            kind._rtpm_key_ = key
            _classes[key] = kind
        return _classes[key]

    def _object(self, index: int) -> Any:
        if self.objects[index] is not None:
            return self.objects[index]
        item = self._layout["objects"][index]
        if item["is_struct"]:
            for field in item["fields"]:
                if _is_object(field):
                    self._object(field["index"])
        key = (item["name"], self._key(index))
        if key not in _classes:
            _classes[key] = self._struct(item, key) if item["is_struct"] else self._table(item, key)
        self.objects[index] = _classes[key]
        return self.objects[index]

    def _key(self, index: int) -> str:
        """The layout of an object as text."""
        item = self._layout["objects"][index]
        parts = [str(item["size"])]
        for field in item["fields"]:
            of = field["index"]
            name = ""
            if of is not None:
                name = self._layout["objects" if _is_object(field) else "enums"][of]["name"]
            parts.append(
                f"{field['name']}:{field['base']}.{field['element']}.{field['length']}.{name}"
                f"@{field['id']}+{field['offset']}={field['default']!r},{field['unit']},{field['frame']},{field['range']}"
            )
        return ";".join(parts)

    def _struct(self, item: dict[str, Any], key: tuple[str, str]) -> Any:
        names = tuple(field["attribute"] for field in item["fields"])
        fields: list[tuple[str, Any]] = []
        position = 0
        for name, field in zip(names, item["fields"], strict=True):
            kind = self._ctype(field)
            gap = field["offset"] - position
            if gap >= ctypes.alignment(kind):  # Only where the schema has its own alignment.
                fields.append((f"_padding_{position}", ctypes.c_uint8 * gap))
            fields.append((name, kind))
            position = field["offset"] + ctypes.sizeof(kind)
        natural = max(ctypes.alignment(kind) for _, kind in fields)
        if item["size"] - position >= natural:
            fields.append((f"_padding_{position}", ctypes.c_uint8 * (item["size"] - position)))
        struct = type(
            item["class"],
            (Vector if all(field["base"] in (11, 12) for field in item["fields"]) else Struct,),
            {
                "__slots__": (),
                "__module__": self._module,
                "__doc__": _documentation(item) or None,
                "__match_args__": names,
                "_rtpm_names_": names,
                "_rtpm_units_": _quantities(item),
                "_rtpm_key_": key,
                "_fields_": fields,
                "__init__": _initializer(item["class"], names),
            },
        )
        if ctypes.sizeof(struct) != item["size"]:
            raise AssertionError(
                f"{item['name']} has {item['size']} bytes, but ctypes makes {ctypes.sizeof(struct)}"
            )
        for name, field in zip(names, item["fields"], strict=True):
            raw = struct.__dict__[name]
            if raw.offset != field["offset"]:
                raise AssertionError(
                    f"{item['name']}.{name} is at {field['offset']}, but ctypes puts it at {raw.offset}"
                )
            setattr(struct, name, _checked(item["class"], field, name, raw, self.enums))
        return struct

    def _ctype(self, field: dict[str, Any]) -> Any:
        base = field["element"] if field["base"] == _ARRAY else field["base"]
        kind = self.objects[field["index"]] if base == _OBJECT else _CTYPES[base]
        return kind * field["length"] if field["base"] == _ARRAY else kind

    def _table(self, item: dict[str, Any], key: tuple[str, str]) -> Any:
        fields = {}
        for field in item["fields"]:
            if not field["is_hidden"]:
                fields[field["attribute"]] = self._default(field)
        body: dict[str, Any] = {
            "__slots__": tuple(fields),
            "__module__": self._module,
            "__doc__": _documentation(item) or None,
            "__match_args__": tuple(fields),
            "_rtpm_key_": key,
            "_rtpm_fields_": fields,
            "_rtpm_units_": _quantities(item),
        }
        if item["event"] is None:
            return type(item["class"], (Table,), body)
        body["_rtpm_event_"] = (item["event"], item["fingerprint"])
        return type(item["class"], (Event,), body)

    def _default(self, field: dict[str, Any]) -> Callable[[], Any] | None:
        """What makes a field's default; None for a required field."""
        if field["is_required"]:
            return None
        if field["base"] <= _DOUBLE:
            default = field["default"]
            if field["index"] is not None and default is not None:
                default = self.enums[field["index"]](default)
            return lambda: default
        if field["base"] == _STRING:
            return str
        if field["base"] != _VECTOR:
            return lambda: None
        if field["element"] in (3, 4) and field["index"] is None:
            return bytes
        if _BOOL < field["element"] <= _DOUBLE and field["index"] is None:
            code = array.array(_code(field["element"])).typecode
            return lambda: array.array(code)
        return list


class _Enumeration(enum.IntEnum):
    """An enum of a schema. A number that a newer schema has named is kept."""

    @classmethod
    def _missing_(cls, value: object) -> Any:
        if not isinstance(value, int):
            return None
        member = int.__new__(cls, value)
        member._name_ = f"unknown_{value}"
        member._value_ = value
        return member

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return _restore_enum, (type(self)._rtpm_key_, int(self))  # type: ignore[attr-defined]


class _Flags(enum.IntFlag):
    """An enum of bits; a number may be a sum of its values."""

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return _restore_enum, (type(self)._rtpm_key_, int(self))  # type: ignore[attr-defined]


def _code(base: int) -> str:
    return {3: "b", 4: "B", 5: "h", 6: "H", 7: "i", 8: "I", 9: "q", 10: "Q", 11: "f", 12: "d"}[base]


def _is_object(field: dict[str, Any]) -> bool:
    return _OBJECT in (field["base"], field["element"] if field["base"] in (_VECTOR, _ARRAY) else 0)


def _checked(owner: str, field: dict[str, Any], name: str, raw: Any, enums: list[Any]) -> Any:
    """The property of a struct's field: it checks what it is given, and names the field in its errors."""
    path = f"{owner}.{name}"
    base = field["base"]
    named: Any = enums[field["index"]] if field["index"] is not None and base <= _DOUBLE else None

    def get_enum(self: Any) -> Any:
        return named(raw.__get__(self))

    def set_real(self: Any, value: Any) -> None:
        try:
            raw.__set__(self, value)
        except TypeError:
            raise TypeError(f"{path} takes a number, not {type(value).__name__}") from None

    bits = raw.size * 8
    low, high = (
        (-(1 << bits - 1), (1 << bits - 1) - 1) if base in (3, 5, 7, 9) else (0, (1 << bits) - 1)
    )

    def set_integer(self: Any, value: Any) -> None:
        try:
            number = value.__index__()
        except AttributeError:
            raise TypeError(f"{path} takes an integer, not {type(value).__name__}") from None
        if not low <= number <= high:
            raise ValueError(f"{path} takes {low} to {high}, not {number}")
        raw.__set__(self, number)

    def set_array(self: Any, values: Any) -> None:
        target = raw.__get__(self)
        values = list(values)
        if len(values) != len(target):
            raise ValueError(f"{path} takes {len(target)} values, not {len(values)}")
        try:
            target[:] = values
        except TypeError as error:
            raise TypeError(f"{path}: {error}") from None

    def set_struct(self: Any, value: Any) -> None:
        kind = type(raw.__get__(self))
        try:
            # A vector also takes its numbers: (0, 0, 1).
            plain = isinstance(value, kind) or not issubclass(kind, Vector)
            raw.__set__(self, value if plain else kind(*value))
        except TypeError:
            raise TypeError(f"{path} takes a {kind.__name__}, not {type(value).__name__}") from None

    set_value = {
        _ARRAY: set_array,
        _OBJECT: set_struct,
        11: set_real,
        12: set_real,
        _BOOL: raw.__set__,
    }
    doc = (
        "; ".join(text for text in (" ".join(field["doc"].split()), _quantity(field)) if text)
        or None
    )
    return property(get_enum if named else raw.__get__, set_value.get(base, set_integer), doc=doc)


def _initializer(kind: str, names: tuple[str, ...]) -> Callable[..., None]:
    known = frozenset(names)
    base = ctypes.Structure.__init__

    def __init__(self: Any, *values: Any, **named: Any) -> None:
        if len(values) > len(names):
            raise TypeError(f"{kind} takes {len(names)} values, not {len(values)}")
        if not known.issuperset(named):
            unknown = next(name for name in named if name not in known)
            raise TypeError(f"{kind} has no field '{unknown}'; it has {', '.join(names)}")
        base(self, **dict(zip(names, values, strict=False)), **named)

    return __init__
