"""What a field of a data class may hold, and the strict reading of a parsed TOML table into such a class.

A field is declared once, `radius: Annotated[float, Quantity("length", above=0.0)]`; from that follow the unit accepted
in files, the range, and the message that names the field, the value and what to write instead. The classes check
themselves on construction (`check_fields` in `__post_init__`), so `dataclasses.replace` cannot slip in what a file may
not say.

    one value        Quantity, Count, Flag, Text, Choice, FilePath
    several          TupleOf, OneOrMore, PerBlade; Column, TextColumn and Numbers for arrays
    none or one      OrNone
    one of classes   Kind; a nested data class is its own specification, `tuple[Flap, ...]` one or more of them

A class is made from a TOML table, whose numbers carry units, by `read`, and from plain SI numbers by `from_plain`. Both
refuse keys they do not know and take a field's default where it has one.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array
from flapgym.core.units import article, parse_quantity, show, si_unit, unit_size
from flapgym.core.wording import one_line, shown

T = TypeVar("T")

LONGEST_TEXT = 1000
"""Characters of a text in a file, which may be the path of another."""


class Specification(Protocol):
    """What a field may hold. One whose values stand otherwise in a file also has `parse(value, name)`."""

    def check(self, value: object, name: str) -> Any:
        """Return the value in its canonical type; a ValueError that begins with `name` if the field cannot hold it."""
        ...


@dataclass(frozen=True, kw_only=True)
class _Bounded:
    above: float = -np.inf
    at_least: float = -np.inf
    below: float = np.inf
    at_most: float = np.inf

    def holds(self, value: Array) -> NDArray[np.bool_]:
        """Whether each value lies in the range; false for NaN."""
        inside = (
            (value > self.above) & (value >= self.at_least) & (value < self.below) & (value <= self.at_most)
        )
        return inside & np.isfinite(value)

    def describe(self, dimension: str) -> str:
        """Return the range in words: "an angle from 0 to 30 deg", "0 deg < angle <= 30 deg"."""
        if self._closed:
            return f"{article(dimension)} {self._from_to(dimension)}"
        left = [
            f"{show(b, dimension)} {s} " for b, s in ((self.above, "<"), (self.at_least, "<=")) if b > -np.inf
        ]
        right = [
            f" {s} {show(b, dimension)}" for b, s in ((self.below, "<"), (self.at_most, "<=")) if b < np.inf
        ]
        plain = "" if left or right else "a finite "
        return plain + "".join(left) + dimension + "".join(right)

    @property
    def _closed(self) -> bool:
        """Whether both ends belong to the range."""
        return self.above == -np.inf and self.at_least > -np.inf and self.below == np.inf > self.at_most

    def _from_to(self, dimension: str) -> str:
        """The closed range with its unit said once: "from 0 to 30 deg"."""
        low, high = show(self.at_least, dimension), show(self.at_most, dimension)
        return f"from {low.partition(' ')[0]} to {high}"


@dataclass(frozen=True)
class Quantity(_Bounded):
    """One number of a dimension of `units.UNITS`, or one of a few words in its place."""

    dimension: str
    words: tuple[str, ...] = ()

    def parse(self, value: object, name: str) -> float | str:
        """Read a TOML value, in SI."""
        if isinstance(value, str) and value in self.words:
            return value
        try:
            return parse_quantity(value, self.dimension, name)
        except ValueError as error:
            if not self.words:
                raise
            raise ValueError(f"{error}; or write {' or '.join(map(repr, self.words))}") from None

    def check(self, value: object, name: str) -> float | str:
        """Refuse a value out of range."""
        if isinstance(value, str) and value in self.words:
            return value
        if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
            unit = si_unit(self.dimension)
            what = f"{article(self.dimension)} as a number in {unit}" if unit else article(self.dimension)
            words = "".join(f" or {word!r}" for word in self.words)
            raise ValueError(f"{name}: expected {what}{words}, got {shown(value)}")
        number = as_float(value)
        if not self.holds(np.asarray(number)):
            given = show(number, self.dimension)
            raise ValueError(f"{name}: expected {self.describe(self.dimension)}, got {given}")
        return number


@dataclass(frozen=True)
class PerBlade(_Bounded):
    """One number of a dimension of `units.UNITS` for each of the three blades."""

    dimension: str

    def parse(self, value: object, name: str) -> tuple[object, ...]:
        """Read a TOML array, in SI."""
        each = self._three(value, name)
        return tuple(parse_quantity(item, self.dimension, f"{name}[{b}]") for b, item in enumerate(each))

    def check(self, value: object, name: str) -> tuple[float, float, float]:
        """Refuse what is not three values in range."""
        one = Quantity(
            self.dimension, above=self.above, at_least=self.at_least, below=self.below, at_most=self.at_most
        )
        each = [one.check(item, f"{name}[{b}]") for b, item in enumerate(self._three(value, name))]
        return typing.cast(tuple[float, float, float], tuple(each))

    def _three(self, value: object, name: str) -> tuple[object, ...]:
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise ValueError(f"{name}: expected three values, one a blade, got {shown(value)}")
        return tuple(value)


@dataclass(frozen=True)
class Count(_Bounded):
    """A whole number."""

    def check(self, value: object, name: str) -> int:
        """Refuse what is not a whole number in range."""
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not whole or not self.holds(np.asarray(as_float(value))):
            raise ValueError(f"{name}: expected a whole number{self._range()}, got {shown(value)}")
        return int(typing.cast(int, value))

    def _range(self) -> str:
        if self._closed:
            return f" {self._from_to('number')}"
        if self == Count(at_least=self.at_least):
            return "" if self.at_least == -np.inf else f" of at least {show(self.at_least, 'number')}"
        return f", {self.describe('number')}"


@dataclass(frozen=True)
class Flag:
    """True or False."""

    def check(self, value: object, name: str) -> bool:
        """Refuse what is no truth value."""
        if not isinstance(value, bool | np.bool_):
            raise ValueError(f"{name}: expected True or False, got {shown(value)}")
        return bool(value)


@dataclass(frozen=True)
class Text:
    """A text of one line that is not empty."""

    def check(self, value: object, name: str) -> str:
        """Refuse what is not a text."""
        if not isinstance(value, str) or not value.strip():
            raise ValueError(f"{name}: expected a text, got {shown(value)}")
        # Names go to terminals, tables and figures.
        if not value.isprintable() or len(value) > LONGEST_TEXT:
            raise ValueError(
                f"{name}: expected a text of one line and at most {LONGEST_TEXT} characters, got {shown(value)}"
            )
        return value


@dataclass(frozen=True)
class Words:
    """A row of words, none twice, each of which a regular expression of a few matches in full."""

    patterns: tuple[str, ...]
    example: str
    """What messages say to write."""

    def parse(self, value: object, name: str) -> tuple[str, ...]:
        """Read a TOML array."""
        return self.check(value, name)

    def check(self, value: object, name: str) -> tuple[str, ...]:
        """Refuse what is no row of such words."""
        if not isinstance(value, list | tuple):
            raise ValueError(f"{name}: expected a row of names ({self.example}), got {shown(value)}")
        for place, word in enumerate(value):
            known = isinstance(word, str) and any(re.fullmatch(pattern, word) for pattern in self.patterns)
            if not known or word in value[:place]:
                wanted = self.example if not known else "each name once"
                raise ValueError(f"{name}[{place}]: expected {wanted}, got {shown(word)}")
        return tuple(value)


@dataclass(frozen=True)
class Choice:
    """One of a few words."""

    words: tuple[str, ...]

    def check(self, value: object, name: str) -> str:
        """Refuse what is none of the words."""
        if not isinstance(value, str) or value not in self.words:
            raise ValueError(f"{name}: expected {_one_of(self.words)}, got {shown(value)}")
        return str(value)  # NumPy has texts of its own


@dataclass(frozen=True)
class FilePath:
    """The path of a file, which need not exist yet."""

    what: str

    def check(self, value: object, name: str) -> str:
        """Refuse what is no path; return it as text."""
        path = os.fspath(value) if isinstance(value, str | os.PathLike) else None
        if not isinstance(path, str) or not path:
            raise ValueError(f"{name}: expected the path of {self.what}, got {shown(value)}")
        return path


@dataclass(frozen=True)
class OrNone:
    """None, where something else then decides, or a value of another specification."""

    item: Specification | type
    """A data class for a table that may be left out."""

    def parse(self, value: object, name: str) -> object:
        """Read a TOML value."""
        return _read_value(self.item, value, name)

    def check(self, value: object, name: str) -> Any:
        """Refuse what is neither None nor such a value."""
        return None if value is None else _plain_value(self.item, value, name)


@dataclass(frozen=True)
class TupleOf:
    """One or more values, each held to the same specification.

    Attributes
    ----------
    item : Specification
    length : int or None
        How many, where that is fixed.
    distinct : bool
        Whether none may stand there twice.
    """

    item: Specification
    length: int | None = None
    distinct: bool = False

    def parse(self, value: object, name: str) -> object:
        """Read a TOML array, its numbers in SI."""
        if not _is_row(value):
            return value
        return tuple(_parsed(self.item, entry, f"{name}[{i}]") for i, entry in enumerate(value))

    def check(self, value: object, name: str) -> tuple[Any, ...]:
        """Refuse another number of values, or one that does not fit."""
        if not _is_row(value) or not len(value) or self.length not in (None, len(value)):
            wanted = "one or more" if self.length is None else self.length
            raise ValueError(f"{name}: expected a list of {wanted} values, got {shown(value)}")
        checked = tuple(self.item.check(entry, f"{name}[{i}]") for i, entry in enumerate(value))
        if self.distinct and len(set(checked)) < len(checked):
            raise ValueError(f"{name}: expected each value once, got {', '.join(map(str, checked))}")
        return checked


@dataclass(frozen=True)
class OneOrMore:
    """One value for all, or a tuple of one for each; all held to the same specification."""

    item: Specification

    def parse(self, value: object, name: str) -> object:
        """Read a TOML value or array, in SI."""
        return TupleOf(self.item).parse(value, name) if _is_row(value) else _parsed(self.item, value, name)

    def check(self, value: object, name: str) -> Any:
        """Refuse a value that does not fit."""
        return TupleOf(self.item).check(value, name) if _is_row(value) else self.item.check(value, name)


@dataclass(frozen=True)
class Kind:
    """An object of one of several data classes, or the mapping that describes it: its `kind` and its fields.

    Attributes
    ----------
    interface : type
        A runtime-checkable protocol; what has it already passes as it is, whoever wrote its class. So does an object of
        one of the classes.
    classes : dict of str to type
        Data classes by the kind that a mapping can name, which is their class attribute `kind`, too.
    example : dict
        Such a mapping, for messages.
    """

    interface: type
    classes: Mapping[str, type[Any]]
    example: Mapping[str, Any]

    def check(self, value: object, name: str) -> Any:
        """Return the object that a mapping describes; refuse an unknown kind, and entries its class does not have."""
        if isinstance(value, (self.interface, *self.classes.values())) and not isinstance(value, type):
            return value
        if not isinstance(value, Mapping):
            raise ValueError(
                f"{name}: expected a mapping such as {dict(self.example)}, or an object with "
                f"{self.interface.__name__}'s attributes, got {shown(value)}"
            )
        kind = Choice(tuple(self.classes)).check(value.get("kind"), f"{name}.kind")
        return from_plain(self.classes[kind], {key: value[key] for key in value if key != "kind"}, name)


@dataclass(frozen=True)
class Column(_Bounded):
    """A column of numbers over the stations of a table, shape (n,)."""

    dimension: str
    increasing: bool = False

    def check(self, value: object, name: str) -> Array:
        """Refuse a column with a value out of range or out of order; return it read-only."""
        try:
            column = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{name}: expected a row of numbers, got {shown(value)}") from None
        if column.ndim != 1 or column.size < 2:
            raise ValueError(f"{name}: expected two or more stations in one row, got shape {column.shape}")
        outside = np.flatnonzero(~self.holds(column))
        if outside.size:
            station, given = outside[0] + 1, show(column[outside[0]], self.dimension)
            raise ValueError(
                f"{name}: expected {self.describe(self.dimension)}, got {given} at station {station}"
            )
        fall = np.flatnonzero(np.diff(column) <= 0.0)
        if self.increasing and fall.size:
            before, after = (show(v, self.dimension) for v in column[fall[0] : fall[0] + 2])
            raise ValueError(
                f"{name}: expected values that increase along the stations, got {before} then {after} "
                f"at stations {fall[0] + 1} and {fall[0] + 2}"
            )
        column.flags.writeable = False
        return column


@dataclass(frozen=True)
class Numbers(_Bounded):
    """One or more finite numbers in an array: none masked, none left out, no text."""

    dimension: str = "number"
    axes: int | None = None

    def check(self, value: object, name: str) -> Array:
        """Refuse an array with an entry that is no number of the range; return it as float."""
        if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
            raise ValueError(f"{name}: expected every number, got a masked array; fill it or leave those out")
        try:
            found = np.asarray(value)
        except ValueError:  # rows of different lengths
            found = np.empty(0, dtype=object)
        if found.dtype.kind not in "iuf":
            raise ValueError(f"{name}: expected real numbers, got {shown(value)}")
        if not found.size or self.axes not in (None, found.ndim):
            axes = "" if self.axes is None else f" along {self.axes} {'axis' if self.axes == 1 else 'axes'}"
            raise ValueError(f"{name}: expected one or more numbers{axes}, got shape {found.shape}")
        numbers = found.astype(np.float64)
        outside = ~self.holds(numbers)
        if outside.any():
            place, given = np.argwhere(outside)[0].tolist(), show(numbers[outside][0], self.dimension)
            raise ValueError(f"{name}: expected {self.describe(self.dimension)}, got {given} at {place}")
        return numbers


@dataclass(frozen=True)
class TextColumn:
    """A column of texts over the stations of a table."""

    def check(self, value: object, name: str) -> tuple[str, ...]:
        """Refuse what is not one text per station."""
        if not isinstance(value, Iterable) or isinstance(value, str):
            raise ValueError(f"{name}: expected one text per station, got {shown(value)}")
        return tuple(Text().check(item, name) for item in value)


def as_float(value: Any) -> float:
    """The number in double precision; infinite where it has no room there."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def is_number(value: object) -> bool:
    """Whether it is a finite real number, Python's or NumPy's, and no truth value."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    return isinstance(value, int) or math.isfinite(value)  # any int is; those past a double have no float


def one_or_more(table: str) -> dict[str, str]:
    """Metadata of a field of several data classes: in files ``[table]`` for one alone, or ``[[table]]`` for each."""
    return {"table": table}


def specification(cls: type) -> dict[str, Any]:
    """Return what each field of a data class may hold: a specification of this module, or a (nested) type."""
    hints = typing.get_type_hints(cls, include_extras=True)
    return {f.name: getattr(hints[f.name], "__metadata__", (hints[f.name],))[0] for f in fields(cls)}


def check_fields(instance: Any, section: str = "") -> None:
    """Check every declared field of a frozen data class and store it in its canonical type.

    Called from `__post_init__`; `section` is the table's name in a file, for messages. Values are SI numbers; a nested
    data class may be given as the mapping of its fields.
    """
    lengths = {}
    for key, spec in specification(type(instance)).items():
        value = _plain_value(spec, getattr(instance, key), _dotted(section, key))
        object.__setattr__(instance, key, value)
        if isinstance(spec, Column | TextColumn):
            lengths[key] = len(value)
    if len(set(lengths.values())) > 1:
        raise ValueError(f"{section}: expected as many stations in each column, got {lengths}")


def read(cls: type[T], table: object, section: str = "") -> T:
    """Read a parsed TOML table into a data class; refuse a key that is unknown, or missing without a default.

    Parameters
    ----------
    cls : type
        A data class whose fields carry specifications, or are such data classes or tuples of them.
    table : dict
        As `tomllib` returns it.
    section : str
        Dotted name of the table, for messages.
    """
    if not isinstance(table, Mapping):
        raise ValueError(f"{section}: expected a table [{section}], got {shown(table)}")
    specs = specification(cls)
    if any(isinstance(spec, Column) for spec in specs.values()):
        return cls(**_read_columns(specs, table, section))
    given = _present(cls, table, section)
    return cls(
        **{
            f.name: _read_value(specs[f.name], _listed(f, table[key]), _dotted(section, key))
            for key, f in given.items()
        }
    )


def _read_value(spec: Any, value: object, name: str) -> Any:
    if hasattr(spec, "check"):
        return spec.check(_parsed(spec, value, name), name)
    if is_dataclass(spec):
        cls = typing.cast(type, spec)
        return value if isinstance(value, cls) else read(cls, value, name)
    if not isinstance(value, list) or not value:
        raise ValueError(f"{name}: expected one or more tables [[{name}]], got {shown(value)}")
    (item, _) = typing.get_args(spec)
    return tuple(
        read(item, entry, place) for place, entry in zip(_places(name, len(value)), value, strict=True)
    )


def _parsed(spec: Any, value: object, name: str) -> Any:
    """A value as a file holds it, in SI."""
    return spec.parse(value, name) if hasattr(spec, "parse") else value


def to_plain(value: Any) -> Any:
    """A data class as nested dictionaries, lists and SI numbers, which JSON can hold and `from_plain` reads.

    A field at its default is left out: one that comes later changes nothing in what was written before it.
    """
    if is_dataclass(value):
        kind = {"kind": value.kind} if hasattr(value, "kind") else {}
        given = {f: getattr(value, f.name) for f in fields(value)}
        return kind | {
            _key(f): _unlisted(f, to_plain(v))
            for f, v in given.items()
            if f.default is MISSING or v != f.default
        }
    if isinstance(value, np.ndarray | tuple):
        return [to_plain(item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    return value


def from_plain(cls: type[T], values: object, section: str = "") -> T:
    """Make a data class of a mapping of its fields to plain values: SI numbers, texts, lists, mappings.

    It reads what `to_plain` wrote, and what people give as keywords.

    Parameters
    ----------
    cls : type
        A data class whose fields carry specifications, or are such data classes or tuples of them.
    values : mapping
        Fields with a default may be left out.
    section : str
        Dotted name of the mapping, for messages.

    Raises
    ------
    ValueError
        If a key is unknown or missing, or a value out of range; the message names it.
    """
    if not isinstance(values, Mapping):
        raise ValueError(
            f"{section}: expected a mapping of {', '.join(specification(cls))}, got {shown(values)}"
        )
    specs = specification(cls)
    given = _present(cls, values, section)
    return cls(
        **{
            f.name: _plain_value(specs[f.name], _listed(f, values[key]), _dotted(section, key))
            for key, f in given.items()
        }
    )


def _plain_value(spec: Any, value: Any, name: str) -> Any:
    """A value in the canonical type of its field; one of a type that specifies nothing as it is."""
    if hasattr(spec, "check"):
        return spec.check(value, name)
    if is_dataclass(spec):
        cls = typing.cast(type, spec)
        return value if isinstance(value, cls) else from_plain(cls, value, name)
    item, *_ = typing.get_args(spec) or (None,)
    if typing.get_origin(spec) is tuple and is_dataclass(item):
        if not isinstance(value, list | tuple):
            raise ValueError(f"{name}: expected a list of mappings, got {shown(value)}")
        places = _places(name, len(value))
        return tuple(_plain_value(item, entry, place) for place, entry in zip(places, value, strict=True))
    return value


def _places(name: str, count: int) -> list[str]:
    """What messages call the entries of a list; one by itself needs no number."""
    return [f"{name}[{i}]" for i in range(count)] if count != 1 else [name]


def _key(of: Field[Any]) -> str:
    """What a field is called in files."""
    return str(of.metadata.get("table", of.name))


def _listed(of: Field[Any], value: Any) -> Any:
    """One table that stands for a list of one, as that list."""
    return [value] if "table" in of.metadata and isinstance(value, Mapping) else value


def _unlisted(of: Field[Any], value: Any) -> Any:
    """A list of one as the table that stands for it."""
    return value[0] if "table" in of.metadata and len(value) == 1 else value


def _present(cls: type, table: Mapping[str, object], section: str) -> dict[str, Field[Any]]:
    """Fields of a data class by the keys that a table gives; refuses what is unknown, and missing without default."""
    known = {_key(f): f for f in fields(cls)}
    optional = [
        key for key, f in known.items() if f.default is not MISSING or f.default_factory is not MISSING
    ]
    check_keys(table, known, section, optional)
    return {key: f for key, f in known.items() if key in table}


def check_keys(
    table: Mapping[str, object], known: Iterable[str], section: str, optional: Iterable[str] = ()
) -> None:
    """Refuse unknown keys, and missing ones unless they are optional; the message names the nearest known key."""
    known, optional = list(known), set(optional)
    for key in table:
        if key not in known:
            raise ValueError(f"{one_line(_dotted(section, key), 100)}: unknown key; {_suggest(key, known)}")
    for key in known:
        if key not in table and key not in optional:
            raise ValueError(f"{_dotted(section, key)}: missing; give it a value")


def _suggest(key: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(key, list(known), n=1)
    return f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(known)}"


def _dotted(section: str, key: str) -> str:
    return f"{section}.{key}" if section else key


def _one_of(words: Sequence[str]) -> str:
    """A few words as a choice: "'a' or 'b'", "one of 'a', 'b', 'c'"."""
    quoted = [repr(word) for word in words]
    return " or ".join(quoted) if len(quoted) < 3 else f"one of {', '.join(quoted)}"


def _is_row(value: object) -> typing.TypeGuard[Sequence[object]]:
    """Whether it is an ordered row of values, not a text."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


_HEADER = re.compile(r"\s*(\w+)\s*(?:\[(.*)\])?\s*")


def _read_columns(specs: dict[str, Any], table: Mapping[str, Any], section: str) -> dict[str, Any]:
    """Read `stations = n`, `columns = ["radius [m]", ...]`, `rows = [[...], ...]` into columns in SI."""
    check_keys(table, ("stations", "columns", "rows"), section)
    count = Count(at_least=2).check(table["stations"], f"{section}.stations")
    headers, rows = table["columns"], table["rows"]
    if not isinstance(headers, list) or not all(isinstance(header, str) for header in headers):
        raise ValueError(f'{section}.columns: expected texts such as "radius [m]", got {shown(headers)}')
    matches = [_HEADER.fullmatch(header) for header in headers]
    units = {match[1]: match[2] or "" for match in matches if match}
    if len(units) < len(headers):
        raise ValueError(
            f'{section}.columns: expected each column once, as "radius [m]", got {shown(headers)}'
        )
    check_keys(units, specs, section)
    if not isinstance(rows, list) or len(rows) != count:
        given = len(rows) if isinstance(rows, list) else shown(rows)
        raise ValueError(
            f"{section}.rows: expected the {count} stations declared by {section}.stations, got {given}"
        )
    for station, row in enumerate(rows, 1):
        if not isinstance(row, list) or len(row) != len(units):
            raise ValueError(
                f"{section}.rows: expected {len(units)} values at station {station}, got {shown(row)}"
            )
    columns = dict(zip(units, zip(*rows, strict=True), strict=True))
    return {
        key: _read_column(spec, columns[key], units[key], f"{section}.{key}") for key, spec in specs.items()
    }


def _read_column(spec: Any, values: tuple[object, ...], unit: str, name: str) -> Any:
    if isinstance(spec, TextColumn):
        return spec.check(values, name)
    size = unit_size(spec.dimension, unit, name)
    for station, value in enumerate(values, 1):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{name}: expected a number, got {shown(value)} at station {station}")
    return spec.check(np.array([as_float(value) for value in values]) * size, name)
