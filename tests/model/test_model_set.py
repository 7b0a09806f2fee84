"""Sets of models over wind speed: one turbine, one file, each model read when it is asked for."""

import contextlib
import os
from dataclasses import replace

import numpy as np
import pytest
import safetensors

from flapgym.model import ModelSet, load_model_set, model_set, save_model, save_model_set
from tests.synthetic import synthetic_model


def at(wind_speed, **changes):
    return replace(synthetic_model(), wind_speed=wind_speed, name=f"at {wind_speed:g}", **changes)


@pytest.fixture
def several():
    return ModelSet.of([at(11.0), at(7.0), at(9.0)])


def test_models_stand_by_wind_speed_and_are_found_by_it(several):
    assert several.wind_speeds == (7.0, 9.0, 11.0)
    assert [model.wind_speed for model in several] == [7.0, 9.0, 11.0]
    assert several.at(9.0).name == "at 9"
    assert [several.nearest(speed).wind_speed for speed in (0.0, 8.0, 8.1, 60.0)] == [7.0, 7.0, 9.0, 11.0]


def test_a_wind_speed_that_is_not_there_is_told_which_are(several):
    with pytest.raises(
        ValueError,
        match="^model_set.at: expected one of the wind speeds 7, 9, 11 m/s, got 8 m/s; or take the nearest",
    ):
        several.at(8.0)
    with pytest.raises(ValueError, match="^model_set.wind_speed: expected"):
        several.nearest(float("nan"))


def test_a_set_comes_back_from_its_file_model_by_model(several, tmp_path, monkeypatch):
    path = tmp_path / "set.safetensors"
    save_model_set(several, path)
    again = load_model_set(path)
    assert again.wind_speeds == several.wind_speeds
    read = []
    whole = model_set.unpacked
    monkeypatch.setattr(model_set, "unpacked", lambda *given: read.append(given) or whole(*given))
    assert again.at(9.0).hash == several.at(9.0).hash
    assert again.at(9.0) is again.nearest(9.2)
    assert len(read) == 1
    np.testing.assert_array_equal(again.at(7.0).turbine.A, several.at(7.0).turbine.A)


@pytest.mark.parametrize(
    "models, said",
    [
        ((), "model_set: expected one or more models, got none"),
        (
            (at(7.0), at(7.0)),
            "model_set.wind_speed: expected one model a wind speed, ascending, got 7 m/s then 7 m/s",
        ),
        (
            (at(7.0), at(9.0, case=at(9.0).case | {"turbine": {"name": "other"}})),
            "model_set.turbine: expected the same in all models, got others at 7 and 9 m/s; build them from one case",
        ),
        (
            (at(7.0), at(9.0, flaps=(replace(at(9.0).flaps[0], angle_limit=0.1),))),
            "model_set.flaps: expected the same in all models",
        ),
    ],
)
def test_what_is_no_set_is_refused(models, said):
    with pytest.raises(ValueError, match=said):
        ModelSet.of(models)


def test_files_that_are_none_are_refused(several, tmp_path):
    with pytest.raises(FileNotFoundError, match="^model set .*none: no such file"):
        load_model_set(tmp_path / "none")
    save_model(several.at(7.0), tmp_path / "one")
    with pytest.raises(ValueError, match="one: not a file of several models; one model is for load_model"):
        load_model_set(tmp_path / "one")
    (tmp_path / "text").write_text("no model")
    with pytest.raises(ValueError, match="text: damaged or not a file of models"):
        load_model_set(tmp_path / "text")


def test_a_damaged_member_is_refused_when_it_is_asked_for_and_the_others_are_not(several, tmp_path):
    path = tmp_path / "set.safetensors"
    save_model_set(several, path)
    content = bytearray(path.read_bytes())
    content[-5] ^= 1
    path.write_bytes(bytes(content))
    found = load_model_set(path)
    with safetensors.safe_open(path, framework="numpy") as file:
        last = file.offset_keys()[-1]
    damaged = found.wind_speeds[int(last.partition(".")[0])]
    for speed in found.wind_speeds:
        with (
            pytest.raises(ValueError, match="damaged, its content does not match its checksum")
            if speed == damaged
            else contextlib.nullcontext()
        ):
            found.at(speed)


def test_an_interrupted_write_leaves_the_file_that_was_there(several, tmp_path, monkeypatch):
    path = tmp_path / "set.safetensors"
    save_model_set(several, path)
    before = path.read_bytes()

    def interrupted(*paths):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_model_set(ModelSet.of([at(7.0)]), path)
    assert path.read_bytes() == before
