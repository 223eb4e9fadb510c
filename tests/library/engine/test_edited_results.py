"""Continued runs from edited results."""

import dataclasses
import json
import re
from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError, SystemDefinitionError
from nearharmonic.math import cos
from support.methods.own_systems import spring

HOW = {"carry": {}, "plain": {"summation": "plain"}, "dd": {"precision": "extended"}}
LAST = {"sample": -1}


def first(system="henon_heiles", tau=0.1, **how):
    return nh.integrate(system, "aba864", tau, t_end=5, samples=6, **how)


def rest(start, system="henon_heiles", tau=0.1, **how):
    return nh.integrate(system, "aba864", tau, t_end=5, samples=6, start=start, **how)


def edited(result, **values):
    """A copy whose last samples are others."""
    copy = result.copy(deep=True)
    for name, value in values.items():
        copy[name].values[-1] = value
    return copy


def assert_equal(a, b, names=("q", "p")):
    for name in names:
        assert np.array_equal(a[name].values, b[name].values), name


@pytest.mark.parametrize("how", HOW.values(), ids=HOW)
@pytest.mark.parametrize("change", [{"q": (0.1, 0.2)}, {"p": (0.2, 0.1)}, {"q": (0.1, 0.2), "p": (0.2, 0.1)}])
def test_an_edited_state_is_where_the_run_goes_on(change, how):
    """A run that begins at the edited doubles, with no digits below them."""
    run = first(**how)
    end = {name: change.get(name, run[name].values[-1]) for name in ("q", "p")}
    no_digits = {} if "summation" in how else {"q_low": 0.0, "p_low": 0.0}
    expected = nh.integrate("henon_heiles", "aba864", 0.1, t_end=5, samples=6, q0=end["q"], p0=end["p"], **how)
    assert_equal(rest(edited(run, **change, **no_digits), **how), expected)


def test_the_digits_below_an_edited_state_count():
    run = first(precision="extended")
    there, elsewhere = rest(run, precision="extended"), rest(edited(run, q_low=1e-20), precision="extended")
    assert np.abs((elsewhere.q - there.q) + (elsewhere.q_low - there.q_low)).max() > 1e-21


@pytest.mark.slow
def test_a_force_that_depends_on_time_takes_the_edited_time():
    """V = q^2/2 - q cos t, with the time set back to 0: a run that begins anew at the last q and p."""
    driven = spring("driven", V=lambda q, t: q[0] * q[0] / 2 - q[0] * cos(t), grad_V=None, time_dependent=True)
    run = first(driven)
    found = rest(edited(run, clock=0.0, clock_low=0.0, q_low=0.0, p_low=0.0), driven)
    expected = nh.integrate(driven, "aba864", 0.1, t_end=5, samples=6, q0=run.q.values[-1], p0=run.p.values[-1])
    assert_equal(found, expected)
    assert np.abs(found.q[-1] - rest(run, driven).q[-1]).item() > 1e-2


@pytest.mark.parametrize("how", HOW.values(), ids=HOW)
def test_result_edited_elsewhere_continues_with_bits_of_one_run(how):
    whole = nh.integrate("henon_heiles", "aba864", 0.1, t_end=10, samples=2, **how)
    run = first(**how)
    other = run.copy(deep=True)
    other.q.values[:-1] = np.nan
    other.energy_error.values[:] = 7
    for start in (other, run.isel(sample=[-1]), run.isel(sample=slice(1, None)), run.drop_vars("energy_error")):
        assert_equal(rest(start, **how)[LAST], whole[LAST])


def test_result_read_from_file_continues_with_bits_of_one_run(tmp_path):
    import xarray as xr

    run, whole = first(), nh.integrate("henon_heiles", "aba864", 0.1, t_end=10, samples=2)
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as read:
        assert_equal(rest(read)[LAST], whole[LAST])


@pytest.mark.parametrize("unit", ["days", pytest.param("microseconds", marks=pytest.mark.slow)])
def test_file_with_units_of_time_continues_at_any_xarray(unit, tmp_path):
    """Versions of xarray before 2025.4 decode such units without being asked to, as this reader does."""
    import xarray as xr

    clock = spring("clock", units={"t": unit, "q": unit, "p": "1", "energy": "1"})
    run = first(clock)
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf", decode_timedelta=True) as read:
        assert {read[name].dtype for name in ("t", "q", "tau")} == {np.dtype(float)}
        assert read.t.attrs["units"] == unit.removesuffix("s")
        assert_equal(rest(read, clock), rest(run, clock))


@pytest.mark.parametrize("where", ["t", "distance"])
def test_unit_that_is_read_as_a_date_is_refused(where):
    date, units = "days since 2000-01-01", {"t": "1", "q": "1", "p": "1", "energy": "1"}
    observable = nh.Observable(function=lambda q, p: q[0], unit=date if where != "t" else "1", meaning="distance")
    units |= {"t": date} if where == "t" else {}
    with pytest.raises(
        SystemDefinitionError, match=f"'{where}'.* = '{date}' is not allowed: a string without the word"
    ):
        spring("clock", units=units, observables={"distance": observable})


def test_a_result_cut_short_goes_on_from_its_last_sample():
    run = first()
    half = run.isel(sample=slice(0, 3))
    found, expected = rest(half), nh.integrate("henon_heiles", "aba864", 0.1, t_end=7, samples=8)
    # Rounding: 50 steps of seven stages of 2^-53, grown by less than 10.
    assert found.q.values == pytest.approx(expected.q.values[2:], abs=50 * 7 * 2**-53 * 10)
    assert found.initial_energy == run.initial_energy


def test_edited_parameters_hold_from_the_first_force_on():
    run = nh.integrate("kepler", "aba864", 100, t_end=2000)
    other = run.copy()
    other.attrs["parameters"] = json.dumps({"GM": "1.6"})
    expected = nh.integrate("kepler", "aba864", 100, t_end=2000, start=run, parameters={"GM": "1.6"})
    assert_equal(nh.integrate("kepler", "aba864", 100, t_end=2000, start=other), expected)


@pytest.mark.parametrize("tau", [0.1, 0.2])
@pytest.mark.parametrize("running", [[1.0], np.full(10, np.nan), ["a"] * 10, np.zeros((2, 5)), 3.0], ids=str)
def test_state_of_last_force_that_is_garbage_is_not_used(running, tau):
    run = first()
    dims = ("running_component", "more")[: np.ndim(running)]
    without = run.drop_vars(["running", "running_component"])
    assert_equal(rest(without.assign(running=(dims, running)), tau=tau), rest(without, tau=tau))


@pytest.mark.parametrize("value", [np.zeros(3), 3, "x"], ids=str)
@pytest.mark.parametrize("name", ["moves", "end"])
def test_digests_that_are_garbage_leave_last_sample_as_start(name, value):
    run = first()
    assert_equal(rest(run.assign_attrs({name: value})), rest(run.drop_vars("running")))


GARBAGE = {
    "NaN in q": (lambda run: edited(run, q=np.nan), "start.q[-1] = [nan, nan] is not allowed: finite numbers"),
    "infinite p": (lambda run: edited(run, p=np.inf), "start.p[-1] = [inf, inf] is not allowed: finite numbers"),
    "NaN below q": (lambda run: edited(run, q_low=np.nan), "start.q_low[-1] = [nan, nan]"),
    "NaN as time": (lambda run: edited(run, t=np.nan), "start.t[-1] = nan"),
    "words as p": (lambda run: run.assign(p=run.p.astype(str)), "start.p = '<U"),
    "p over nothing": (lambda run: run.assign(p=("x", [1.0, 2.0])), "start.p = 'float64 of shape (2,) over x"),
    "p of one component": (lambda run: run.assign(p=("sample", run.t.values)), "start.p = "),
    "words as time": (lambda run: run.assign_coords(t=("sample", list("abcdef"))), "start.t = '<U1 of shape (6,)"),
    "word as energy": (lambda run: run.assign(initial_energy="x"), "start.initial_energy = 'x'"),
    "NaN as energy": (lambda run: run.assign(initial_energy=np.nan), "start.initial_energy = nan"),
    "infinite energy": (lambda run: run.assign(initial_energy=np.inf), "start.initial_energy = inf"),
    "list as energy": (lambda run: run.assign(initial_energy=("x", [1.0, 2.0])), "start.initial_energy = [1.0, 2.0]"),
    "NaN below energy": (lambda run: run.assign(initial_energy_low=np.nan), "start.initial_energy_low = nan"),
    "status": (lambda run: run.assign(status=3), "start = 'a run that diverged at step 0' is not allowed"),
    "text as parameters": (lambda run: run.assign_attrs(parameters="{"), "start.attrs['parameters'] = '{'"),
    "list as parameters": (lambda run: run.assign_attrs(parameters="[1]"), "start.attrs['parameters'] = '[1]'"),
    "number as parameters": (lambda run: run.assign_attrs(parameters=3), "start.attrs['parameters'] = 3"),
    "bytes as parameters": (lambda run: run.assign_attrs(parameters=b"{}"), "start.attrs['parameters'] = b'{}'"),
    "list of a parameter": (lambda run: run.assign_attrs(parameters='{"a": [1]}'), "of names to decimals in JSON"),
    "unknown parameter": (lambda run: run.assign_attrs(parameters='{"a": "1"}'), "unknown parameter of henon"),
    "array as system": (lambda run: run.assign_attrs(system=np.zeros(2)), "a result of henon_heiles"),
    "array as formulas": (lambda run: run.assign_attrs(formulas=np.zeros(2)), "a result of another system of the"),
    "no Dataset": (lambda run: run.to_dataframe(), "start = 'DataFrame' is not allowed"),
}  # fmt: skip


@pytest.mark.parametrize("tau", [0.1, 0.2])
@pytest.mark.parametrize(("edit", "words"), GARBAGE.values(), ids=GARBAGE)
def test_a_result_edited_to_garbage_is_refused_in_a_sentence(edit, words, tau):
    with pytest.raises(nh.NearharmonicError, match=re.escape(words)) as caught:
        rest(edit(first()), tau=tau)
    assert "\n" not in str(caught.value)


def test_an_edited_orbit_that_is_not_bound_is_refused():
    run = nh.integrate("kepler_regularised", "aba864", 100, t_end=2000)
    with pytest.raises(SettingError, match="a state of kepler_regularised with an energy below 0"):
        nh.integrate("kepler_regularised", "aba864", 100, t_end=2000, start=edited(run, p=(10.0, 10.0)))


def test_a_result_without_energies_can_be_continued():
    run = first(energy="none")
    whole = nh.integrate("henon_heiles", "aba864", 0.1, t_end=10, samples=2, energy="none")
    assert_equal(rest(run, energy="none")[LAST], whole[LAST])


def test_member_of_ensemble_goes_on_with_its_own_parameters():
    """An array is found by its coordinate, a common parameter by its exact text: a tenth is not a double."""
    oscillator = nh.System(
        name="two_parameters", V=lambda q, k, m: k * m * q[0] ** 2 / 2, q0=["1"], p0=["0"], t_end="5",
        parameters={"k": "1", "m": "1"},
    )  # fmt: skip
    given = {"k": np.array([1.0, 4.0]), "m": "0.1"}
    members = nh.ensemble(oscillator, "aba864", 0.1, t_end=5, parameters=given, precision="extended")
    for i, k in enumerate(given["k"]):
        own = {"k": k, "m": "0.1"}
        there = nh.integrate(oscillator, "aba864", 0.1, t_end=5, parameters=own, precision="extended")
        expected, found = (
            nh.integrate(oscillator, "aba864", 0.1, t_end=5, start=start, precision="extended")
            for start in (there.drop_vars("running", errors="ignore"), members.isel(member=i))
        )
        assert_equal(found, expected, ("q", "q_low", "p", "p_low", "energy_error"))
        assert json.loads(found.attrs["parameters"]) == json.loads(expected.attrs["parameters"])


@pytest.mark.parametrize("precision", ["double", "extended"])
def test_member_of_a_driven_ensemble_keeps_its_clock(precision):
    """Bits of the run of this member alone, continued from its last sample."""
    driven = spring("driven", V=lambda q, t: q[0] * q[0] / 2 - q[0] * cos(2 * t), grad_V=None, time_dependent=True)
    how = {"t_end": 4, "precision": precision}
    alone = nh.integrate(driven, "ruth", 0.1, q0=["0.3"], **how).drop_vars("running")
    members = nh.ensemble(driven, "ruth", 0.1, q0=[["0.1"], ["0.3"]], **how)
    for member in (members.isel(member=1), members.isel(member=1, drop=True), members.transpose().isel(member=1)):
        found, expected = (nh.integrate(driven, "ruth", 0.1, start=start, **how) for start in (member, alone))
        assert_equal(found, expected, ("t", "q", "q_low", "p", "p_low", "energy_error"))
    with pytest.raises(SettingError, match="start = 'a Dataset without clock' is not allowed"):
        nh.integrate(driven, "ruth", 0.1, start=members.isel(member=1).drop_vars("clock"), **how)


def test_member_has_its_parameters_in_all_digits_or_is_refused():
    """1.8 is no double: the digits below it are 1.8 minus its double, exactly."""
    how = {"t_end": 400, "precision": "extended"}
    members = nh.ensemble("kepler", "ruth", 20, parameters={"GM": ["1.7", "1.8"]}, **how)
    member = members.isel(member=1)
    assert Fraction(member.parameters_low.item()) == Fraction(float(Fraction(18, 10) - Fraction(1.8)))
    alone = nh.integrate("kepler", "ruth", 20, parameters={"GM": "1.8"}, **how).drop_vars("running")
    found, expected = (nh.integrate("kepler", "ruth", 20, start=start, **how) for start in (member, alone))
    assert_equal(found, expected, ("t", "q", "q_low", "p", "p_low", "energy_error"))
    for start in (members.isel(member=1, drop=True), member.drop_vars("parameters_low")):
        with pytest.raises(SettingError, match=r"without parameter_GM or parameters_low' is not allowed: as"):
            nh.integrate("kepler", "ruth", 20, start=start, **how)
    other = dataclasses.replace(nh.systems["kepler"], V=lambda q, GM: -GM / (q[0] ** 2 + q[1] ** 2), grad_V=None)
    with pytest.raises(SettingError, match="a result of another system of the name kepler"):
        nh.integrate(other, "ruth", 20, start=member, **how)


@pytest.mark.parametrize("how", HOW.values(), ids=HOW)
def test_transposed_results_go_on_and_single_precision_is_refused(how):
    run, whole = first(**how), nh.integrate("henon_heiles", "aba864", 0.1, t_end=10, samples=2, **how)
    assert_equal(rest(run.transpose("component", ...), **how)[LAST], whole[LAST])
    single = run.map(lambda x: x.astype("f4") if x.dtype == float else x, keep_attrs=True)
    with pytest.raises(SettingError, match=r"start\.q = 'float32 of shape \(6, 2\).* is not allowed: float64 of shape"):
        rest(single, **how)


@pytest.mark.parametrize("how", HOW.values(), ids=HOW)
@pytest.mark.parametrize("method", ["rowlands", "ruth"])
def test_errors_of_continued_run_cover_its_own_samples(method, how):
    """15 steps in 5 samples and 15 more: the maximum of one run of 30 steps if it has the same samples."""
    how = how | {"energy": "samples"}
    half = nh.integrate("kepler", method, 74, t_end=15 * 74, samples=6, **how)
    run = nh.integrate("kepler", method, 74, t_end=15 * 74, samples=6, start=half, **how)
    assert run.max_energy_error == abs(run.energy_error[1:]).max()
    assert "behind t_start alone" in run.attrs["continued"]
    whole = nh.integrate("kepler", method, 74, t_end=30 * 74, samples=11, **how)
    assert max(half.max_energy_error, run.max_energy_error).item() == pytest.approx(whole.max_energy_error.item())
