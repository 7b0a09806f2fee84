"""Specifications of fields: what they take, what they refuse and in which words, from TOML and from Python alike."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import pytest

from flapgym.core.fields import (
    Choice,
    Count,
    FilePath,
    Flag,
    Kind,
    OneOrMore,
    OrNone,
    Quantity,
    TupleOf,
    check_fields,
    from_plain,
    read,
    to_plain,
)

Angle = Quantity("angle", at_least=-np.pi / 18, at_most=np.pi / 18)


@runtime_checkable
class Shape(Protocol):
    kind: ClassVar[str]

    def area(self) -> float: ...


@dataclass(frozen=True)
class Square:
    kind: ClassVar[str] = "square"
    side: Annotated[float, Quantity("length", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "shape")

    def area(self) -> float:
        return self.side**2


@dataclass(frozen=True)
class Actuators:
    lag: Annotated[float, Quantity("time", at_least=0.0, at_most=60.0)] = 0.0
    stuck: Annotated[tuple[float | None, ...], TupleOf(OrNone(Angle), length=3)] = (None, None, None)

    def __post_init__(self) -> None:
        check_fields(self, "actuators")


@dataclass(frozen=True)
class Settings:
    steps: Annotated[int, Count(at_least=1, at_most=100)]
    observe: Annotated[tuple[str, ...], TupleOf(Choice(("rbm", "rate", "tip")), distinct=True)] = ("rbm",)
    intensity: Annotated[
        float | tuple[float, ...], OneOrMore(Quantity("fraction", at_least=0.0, below=1.0))
    ] = 0.1
    full: Annotated[bool, Flag()] = False
    log: Annotated[str | None, OrNone(FilePath("a log"))] = None
    actuators: Actuators = Actuators()
    more: tuple[Actuators, ...] = ()
    shape: Annotated[
        Any, OrNone(Kind(Shape, {"square": Square}, example={"kind": "square", "side": 1.0}))
    ] = None

    def __post_init__(self) -> None:
        check_fields(self)


def test_what_is_left_out_has_its_default():
    assert from_plain(Settings, {"steps": 5}) == Settings(5) == read(Settings, {"steps": 5})


def test_plain_values_of_numpy_and_python_end_in_one_type():
    settings = from_plain(
        Settings,
        {
            "steps": np.int8(5),
            "observe": np.array(["rbm", "tip"]),
            "intensity": np.array([0.1, 0.2], dtype=np.float16),
            "full": np.True_,
            "actuators": {"stuck": [None, np.float32(0.125), 0]},
            "more": [{"lag": 1}, {}],
            "shape": {"kind": "square", "side": 2},
        },
    )
    assert settings.actuators == Actuators(0.0, (None, 0.125, 0.0))
    assert settings.more == (Actuators(1.0), Actuators())
    assert settings.shape == Square(2.0)
    # JSON holds all of it, and it comes back as it was.
    assert from_plain(Settings, json.loads(json.dumps(to_plain(settings)))) == settings


def test_a_table_of_a_file_carries_units_wherever_there_are_numbers():
    table = {
        "steps": 5,
        "intensity": ["10 %", 0.2],
        "actuators": {"lag": "20 ms", "stuck": ["5 deg", "0 rad", "-10 deg"]},
    }
    settings = read(Settings, table)
    assert settings.intensity == (0.1, 0.2)
    assert settings.actuators.lag == pytest.approx(0.02)
    assert settings.actuators.stuck == pytest.approx(np.deg2rad([5.0, 0.0, -10.0]))


def test_an_object_of_another_s_class_passes_where_it_has_what_is_asked_for():
    class Circle:
        kind = "circle"

        def area(self) -> float:
            return 3.0

    circle = Circle()
    assert Settings(1, shape=circle).shape is circle


@pytest.mark.parametrize(
    "given, message",
    [
        ({}, "steps: missing; give it a value"),
        ({"steps": 0}, "steps: expected a whole number from 1 to 100, got 0"),
        ({"steps": True}, "steps: expected a whole number from 1 to 100, got True"),
        ({"stepz": 1}, "stepz: unknown key; did you mean 'steps'?"),
        ({"observe": "rbm"}, "observe: expected a list of one or more values, got 'rbm'"),
        ({"observe": {"rbm"}}, "observe: expected a list of one or more values, got {'rbm'}"),
        ({"observe": []}, r"observe: expected a list of one or more values, got \[\]"),
        ({"observe": ["rbm", "rbm"]}, "observe: expected each value once, got rbm, rbm"),
        ({"observe": ["rpm"]}, r"observe\[0\]: expected one of 'rbm', 'rate', 'tip', got 'rpm'"),
        ({"intensity": 1.0}, "intensity: expected 0 <= fraction < 1, got 1"),
        ({"intensity": "10 %"}, "intensity: expected a fraction, got '10 %'"),
        ({"intensity": [0.1, np.nan]}, r"intensity\[1\]: expected 0 <= fraction < 1, got nan"),
        ({"full": 1}, "full: expected True or False, got 1"),
        ({"log": 3}, "log: expected the path of a log, got 3"),
        ({"log": b"a"}, "log: expected the path of a log, got 1 bytes"),
        ({"actuators": 3}, "actuators: expected a mapping of lag, stuck, got 3"),
        ({"actuators": {"leg": 1}}, "actuators.leg: unknown key; did you mean 'lag'?"),
        ({"actuators": {"lag": "1 s"}}, "actuators.lag: expected a time as a number in s, got '1 s'"),
        ({"actuators": {"lag": 61}}, "actuators.lag: expected a time from 0 to 60 s, got 61 s"),
        ({"actuators": {"stuck": [0.0]}}, r"actuators.stuck: expected a list of 3 values, got \[0\]"),
        (
            {"actuators": {"stuck": [0, 1, 0]}},
            r"actuators.stuck\[1\]: expected an angle from -10 to 10 deg, got 57",
        ),
        ({"more": {}}, "more: expected a list of mappings, got {}"),
        ({"more": [{"lag": -1}]}, r"more.lag: expected a time from 0 to 60 s, got -1 s"),
        ({"more": [{}, {"lag": -1}]}, r"more\[1\].lag: expected a time from 0 to 60 s, got -1 s"),
        (
            {"shape": "square"},
            "shape: expected a mapping such as {'kind': 'square', 'side': 1.0}, or an object with Shape's "
            "attributes, got 'square'",
        ),
        ({"shape": Square}, "shape: expected a mapping such as"),
        ({"shape": {"side": 1.0}}, "shape.kind: expected 'square', got None"),
        ({"shape": {"kind": "square"}}, "shape.side: missing"),
    ],
)
def test_a_mistake_is_told_by_field_value_and_fix(given, message):
    given = given if not given or "stepz" in given else {"steps": 1} | given
    with pytest.raises(ValueError, match=f"^{message}"):
        from_plain(Settings, given)
    if "steps" in given:  # as keywords of the class, but for those Python itself refuses
        with pytest.raises(ValueError, match=f"^{message}"):
            Settings(**given)


@pytest.mark.parametrize(
    "given, message",
    [
        ("12 m", "intensity: expected a fraction without a unit or in '%', got the unit 'm'"),
        ("much", "intensity: expected a fraction such as 0.5, got 'much'"),
    ],
)
def test_a_number_in_a_file_is_told_by_what_may_stand_there(given, message):
    with pytest.raises(ValueError, match=message):
        read(Settings, {"steps": 1, "intensity": given})
