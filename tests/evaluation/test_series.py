"""Series leave the package with names and units, and come back the same without it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from flapgym.control import OpenLoop, PDGains, pd_agent
from flapgym.evaluation import as_dataset, compare, plan, run, simulate
from flapgym.evaluation.series import check_series
from tests.synthetic import synthetic_model

pytest.importorskip("xarray")
PAGE = (Path(__file__).parents[2] / "docs" / "evaluation.md").read_text(encoding="utf-8")
MODEL = synthetic_model()
PD = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "series.nc"
    comparison = compare([PD], MODEL, realisations=2, seed=5, duration=4.0, save_series=path)
    return path, comparison


def test_scipy_reads_every_sample_of_every_agent_with_its_unit(written):
    path, _ = written
    record = simulate(PD, MODEL, [5, 6], 4.0)
    with netcdf_file(path, "r", mmap=False) as file:
        agents = b"".join(file.variables["agent"][:].ravel()).replace(b"\0", b"").decode()
        assert agents == "open_looppd"
        assert list(file.variables["realisation"][:]) == [5, 6]
        np.testing.assert_allclose(
            file.variables["time"][:], MODEL.time_step * np.arange(1, record.wind.shape[1] + 1)
        )
        for name, unit in (("rbm", "N m"), ("tip_deflection", "m"), ("tower_fore_aft", "m")):
            variable = file.variables[name]
            assert variable.units.decode() == unit
            np.testing.assert_allclose(variable[1], getattr(record, name), rtol=1e-9, atol=1e-12)
        assert file.variables["rbm"].dimensions == ("agent", "realisation", "time", "blade")
        assert file.variables["flap_rate"].units == b"rad/s"
        np.testing.assert_allclose(file.variables["flap_angle"][1, ..., 0], record.flap_angle, atol=1e-12)
        assert file.variables["wind"].dimensions == ("realisation", "time")
        assert file.model.decode() == MODEL.name
        assert file.wind_speed_m_per_s == MODEL.wind_speed


def test_flap_motion_has_an_axis_of_flaps():
    """Blade by blade and flap by flap in a record."""
    record = simulate(OpenLoop(), synthetic_model(flaps=2), [1], 0.5)
    motion = np.arange(record.flap_angle.size, dtype=float).reshape(record.flap_angle.shape)
    record.flap_angle[:] = motion
    found = record.to_xarray()
    assert found.sizes == {"realisation": 1, "time": record.wind.shape[1], "blade": 3, "flap": 2}
    assert (found.flap_angle.sel(blade=2, flap=1) == motion[..., 2]).all()
    assert list(found.realisation) == [0]
    assert found.rbm.attrs["units"] == "N m"


def test_a_comparison_without_its_series_is_told_how_to_keep_them():
    with pytest.raises(
        ValueError, match="as_dataset: expected a comparison with its series, planned with series=True"
    ):
        as_dataset(run(plan([], MODEL, realisations=1, duration=2.0)))
    record = simulate(OpenLoop(), MODEL, [1], 0.5)
    with pytest.raises(ValueError, match="to_xarray.seeds: expected 1, one a realisation, got 2"):
        record.to_xarray([1, 2])


@pytest.mark.parametrize(
    ("asked", "name", "message"),
    [
        ({}, "series.csv", r"save_series: expected a file that ends in .nc, got '.*series.csv'"),
        ({"seed": 2**40}, "series.nc", "save_series: expected seeds up to 2147483647, got 1099511627776"),
        (
            {"realisations": 1000, "duration": 3600.0},
            "series.nc",
            r"save_series: expected series of at most 2 GB, got some \d+ GB; take fewer",
        ),
    ],
)
def test_series_that_no_file_can_hold_are_refused_before_any_work(tmp_path, asked, name, message):
    planned = plan([PD], MODEL, **({"realisations": 1, "duration": 2.0} | asked), series=True)
    with pytest.raises(ValueError, match=message):
        check_series(planned, tmp_path / name)


def test_without_xarray_one_is_told_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(
        ImportError, match=r"save_series: xarray is not installed \(pip install 'flapgym\[series\]'\)"
    ):
        compare([], MODEL, realisations=1, duration=2.0, save_series=tmp_path / "series.nc")


def test_what_the_page_shows_of_series_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(
        r"```python\n(.*?)```", PAGE.partition("## Every sample")[2].partition("\n## ")[0], flags=re.S
    )
    found = {}
    exec(block, found)
    assert (tmp_path / "lqg.nc").is_file()
    assert found["series"].rbm.dims == ("realisation", "time", "blade")
