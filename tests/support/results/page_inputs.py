"""Small inputs of generated pages, and a line of each part that is made of them."""

from __future__ import annotations

import importlib
import json

import numpy as np
import pytest
import xarray as xr

from nearharmonic.output import store
from nearharmonic.output.store import variable
from nearharmonic.recommendation.measure import variables
from support.cubes.figure_cubes import FACTS, timed
from support.results.stated_numbers import ROOT

#: Page -> tables of the results by their names.
TABLES: dict[str, dict[str, str]] = {
    "stability": {
        "stability_henon_heiles": "integrator,energy,linear_limit_tau_per_stage,share_of_linear_limit\n"
        "ruth,0.125,0.524,1.25\nruth,0.16666666666666666,0.524,nan\n",
        "stability_rounding": "integrator,source,quantity,exponent,interval_95,brouwer\n" + "".join(
            f"{name},{source},{what},{size},0.1,0.5\n"
            for source in ("plain", "compensated", "extended")
            for what in ("energy_error", "lag")
            for name, size in (("ruth", 0.45), ("aba104", 0.75))
        ),
        "kinetic_energy": """\
integrator,roles,error / Ruth's at A = 0.01,error / Ruth's at A = 0.1,error / Ruth's at A = 1
ruth,own,1,1,1
babps9o7h,own,2.5e-5,0.25,0.8
babps9o7h,exchanged,1,1,1
""",
    },
    "derivation": {
        "derived_counts": "stages,harmonic order,complex solutions,real solutions by Sturm\n5,6,20,8\n",
        "derived_solutions": """stages,solution,half of the outer row,half of the inner row
5,1,0.15585936 -0.00702550 0.35116614,-0.68591955 0.99662959 0.37857993
5,2,0.72146062 -0.33882062 0.11736000,1.46833461 -2.20334733 2.47002543
6,1,0.5 0,0.25 0.5
""",
        "derived_errors": "solution,tau/s,\"max error, harmonic oscillator\"\n1,0.05,1e-8\n2,0.05,2.5e-5\n2,0.1,1\n",
        "derived_families": """\
set,free parameters,members found,members with a smaller sum,members with a smaller next kappa
BABs7o7H,1,100,0.25,0.011
""",
        "derived_routes": "route,start,reached\n"
        + '"adaptive simplex, 2048 bits","random, one of 3 in 70",solution 1\n' * 2
        + '"adaptive simplex, 2048 bits","random, one of 3 in 70",not converged\n',
    },
    "trained": {
        "trained_gains": """ensemble,tau_per_stage,best published,log10_error,best trained,log10_error_trained,gain,\
gain_low,gain_high,verdict
"d = 2, 0.01 to 0.5",0.1,srkn_a14,-5,trained_light,-5.5,0.5,0.4,0.6,ahead
Morse,0.1,srkn_a14,-5,trained_light,-4.75,-0.25,-0.3,-0.2,behind
"Kepler, e 0.02",0.1,ruth,-3,trained_orbits,-4,1,0.9,1.1,ahead
""",
        "trained_methods": """method,ensemble,ahead_from,ahead_to,largest_gain
trained_light,"d = 2, 0.01 to 0.5",0.1,0.2,0.5
trained_light,Morse,nan,nan,nan
""",
        "trained_ideas": """tau_per_stage,anharmonicity,ahead,ahead with T + V,exact_gain,exact_gain_low,exact_gain_high
0.1,0.01,exact_oscillator,trained,0.5,0.25,0.75
0.1,0.1,exact_oscillator,general,-0.25,-0.5,0.25
0.2,0.01,exact_oscillator,trained,-0.5,-0.75,-0.25
0.2,0.1,exact_oscillator,general,nan,nan,nan
""",
        "trained_long": """system,method,sum of coefficients,max_energy_error,trend,trend_half_width,\
return_compensated,rounding_plain,rounding_ratio
morse,trained_light,3.5,1e-5,-1e-9,2e-9,1e-13,1e-14,1.25
""",
        "trained_times": """ensemble,tau_per_stage,ns_lanes,ns_single,charge_lanes,charge_single,gain,gain_lanes,\
gain_single
"d = 2, 0.001 to 0.01",0.1,0.5,7.5,2,0.8,0.5,0.5,0.5
"d = 2, 0.01 to 0.5",0.1,0.5,7.5,2,0.8,0.5,0.5,0.25
"Kepler, e 0.02",0.1,1,9,2,1,1,1.5,0.75
""",
    },
    "training": {
        "light": "composition,stages,squares,searches,methods tried,ended at the best,best from,least gain,mean gain\n"
        "BAB,6,,21,90340,13,refined,-0.281,0.43\n",
    },
}  # fmt: skip
#: Page -> lines of each of its parts.
LINES = {
    "stability": {
        "limits": "| Ruth | 0.524 | 1.25 | none |", "kinetic": "| BAB's9o7H | 4 × 10⁴ | 4 | 1.2 |",
        "rounding": "| double-double | phase | 0.5 | 0.45 | 0.60 | 0.75 | 1 of 2 |",
    },
    "derivation": {
        "counts": "| 5 | 6 | 20 | 8 |", "families": "| BABs7o7H | 1 | 100 | 25 % | 1.1 % |",
        "solutions": "| 0.7215, −0.3388 | 1.4683, −2.2033 |  | 2.5 × 10⁻⁵ |",
        "route": "A short run selects 3 of 70 starts. Of these 2 reach 10⁻¹²⁸. They find 1 of the 2 solutions: "
        "ABAs5o6H.",
    },
    "trained": {
        "gains": "| Morse | −0.25 |\n| mean | +0.12 |",
        "widest": "| 0.1 | SRKN 14a | −5.00 | trained_light | −5.50 | **+0.50** (+0.40 to +0.60) |",
        "orbits": "| 63 | Ruth | −3.00 | trained_orbits | −4.00 | **+1.00** (+0.90 to +1.10) | +1.50 | +0.75 |",
        "losses": "| Morse | 0.1 | SRKN 14a | +0.25 |",
        "windows": "| `trained_light` | 0.1 to 0.2, +0.50 | nowhere | nowhere | nowhere | nowhere | 1 of 2 |",
        "ideas": "| 0.1 | oscillator solved exactly 0.1 | trained 0.01, general 0.1 |",
        "exact": "| 0.01 | **+0.50** | −0.50 |\n| 0.1 | (−0.25) |  |",
        "long": "| morse | trained_light | 3.5 | 1.0e-05 | -1e-09 | 2e-09 | 1e-13 | 1e-14 | 1.2 |",
        "times": "| random potentials, d = 2 | 0.5 | 7.5 | 2 | 0.8 | 0.25 |",
    },
    "training": {"landscape": "| low accuracy | BAB | 6 | 21 | 90340 | 13 | refined | −0.28 | 0.43 |"},
    "exact_oscillator": {
        "leads": "| 0.1 | +1.0 | −1.0 |", "crossings": "| ABA864 | 0.1 | 0.2 (0.1 to 0.3) | nowhere |",
    },
    "samplers": {
        "gaussians": "| BCSS 4 | **4.00** |", "targets": "| BCSS 4 | **2.00 (1.80 to 2.20)** | 0.50 (0.45 to 0.55) |",
        "trained": "| φ⁴ field | BCSS 4 | 0.75 (0.68 to 0.83) |", "alone": "| b = 0.5 | 1.25 |",
        "ends": "The grid is 0.15 to 1.6 per stage, over the highest frequency. Best steps at its ends: 2 of 9.",
    },
    "timings": {
        "ratios": "| simple harmonic oscillator, each of an ensemble | 0.25 | 0.25 | – |",
        "implicit": "| simple harmonic oscillator, one trajectory | 2.5 (1) | 1.3 (1) | **0.56** (–) | – (–) |",
        "times": "| label of ruth | **0.01** | **0.02** | **0.04** | 0.09 (1.8) |",
    },
    "regularised": {
        "times": "| e = 0.206, energy | 10⁻⁶ | 10⁻⁹ | 10⁻¹² |\n|---|---:|---:|---:|\n"
        "| fastest method here, regularised | 0.002 (0.04) | 0.004 (0.08) | 0.005 |",
    },
    "files": {"runs": "| `t` | sample | unit of t | time |", "cube": "| `t` | sample | unit of t | time |"},
    "variables": {"variables": "| `x` | point | 1 | a\\|b\\_c |"},
}  # fmt: skip


def write_crossings(path):
    """A cube of one method that solves the oscillator exactly, ahead of another at the first of two energies."""
    amplitudes = np.array([[0.2, 0.1, 0.3], [0, 0, 0]])
    energy, bounds = amplitudes[:, 0] ** 2 / 2, amplitudes[:, 1:] ** 2 / 2
    over = ("tau_per_stage", "charge", "exact_integrator")
    cube = xr.Dataset(
        {
            "energy_error": (("tau_per_stage", "integrator", "energy", "quantile"), np.full((1, 1, 2, 1), 1e-5)),
            "exact_energy_error": ((*over, "energy", "quantile"), [[[[[1e-6], [1e-4]]], [[[1.0], [1.0]]]]]),
            "best_crossing": (over, energy[None, :, None]),
            "best_crossing_interval": ((*over, "bound"), bounds[None, :, None]),
            "crossing": ((*over, "integrator"), energy[None, :, None, None]),
            "crossing_interval": ((*over, "integrator", "bound"), bounds[None, :, None, None]),
        },
        {
            "tau_per_stage": [0.1], "charge": [1.0, 1.1], "exact_integrator": ["aba864"], "integrator": ["ruth"],
            "energy": [1 / 80_000, 1 / 6], "quantile": [0.5], "bound": ["low", "high"],
            "exact_label": ("exact_integrator", ["ABA864"]), "label": ("integrator", ["Ruth"]),
        },
    )  # fmt: skip
    for one in cube.variables.values():
        one.attrs = {"units": "1", "long_name": "number"}
    store.write_dataset(path, cube, {})


def write_samplers(path):
    """A cube of three methods on two targets: the one that is trained leads on the second, over leapfrog."""
    names = ["leapfrog", "bcss_s4", "searched_s4"]
    gain = np.array([[1, 2, 1.5], [1, 0.5, 1.25]])
    over_best = np.array([[0.5, 1, 0.75], [0.8, 0.4, 1]])
    bounds = {"": 1, "_low": 0.9, "_high": 1.1}
    over = ("target", "integrator")
    cube = xr.Dataset(
        {
            **{f"gain{end}": (over, factor * gain) for end, factor in bounds.items()},
            **{f"over_best{end}": (over, factor * over_best) for end, factor in bounds.items()},
            "best": ("target", ["bcss_s4", "leapfrog"]),
            "tau": (over, [[0.5, 1.0, 1.0], [1.6, 1.0, 1.0]]),
            "gaussian_tau": (("dimension", "integrator"), [[0.5, 0.15, 1.0]]),
            "gaussian_gain": (("dimension", "integrator"), [[1.0, 4.0, 3.0]]),
            "special_gain": (("strength", "trained_for"), [[1.25, 1.125]]),
            "special_half": (("strength", "trained_for"), [[0.125, 0.0625]]),
        },
        {
            "integrator": names, "label": ("integrator", ["Leapfrog", "BCSS 4", "searched, 4 stages"]),
            "target": ["lattice", "quartic"], "target_label": ("target", [r"$\phi^4$ field", "quartic posterior"]),
            "dimension": [100.0], "strength": [0.5], "trained_for": ["0.5", "searched_s4"],
        },
    )  # fmt: skip
    for one in cube.variables.values():
        one.attrs = {"units": "1", "long_name": "number"}
    store.write_dataset(path, cube, {})


def write_times(path, names):
    """Times of two methods here, and of heyoka to all errors but one on equations that are not regularised."""
    groups, errors, times = {}, [1e-3, 1e-6, 1e-9, 1e-12], [1e-5, 2e-5, 4e-5, 9e-5]
    for name in names:
        factor = 0.1 if name.endswith("regularised") else 1
        found = [timed("ruth", errors, [factor * time for time in times], lanes=[1e-6] * 4)]
        found.append(timed("gauss16", errors, [factor * 5e-5] * 4, lanes=[2e-6] * 4))
        found += [timed("heyoka", errors[:3], [5e-5] * 3, kind="peer", lanes=[4e-6] * 3)] * (factor == 1)
        groups[name] = variables(found, "h")
    problems = {name: {"system": name, "t_end": "20", "measures": ["max", "position"]} for name in names}
    store.write(path, {}, {**FACTS, "libraries": "heyoka 7", "problems": json.dumps(problems)}, groups=groups)


def write_variables(path, unit, meaning="time", name="t", dimension="sample"):
    """A file of one variable."""
    store.write(path, {name: variable(dimension, [0.0, 1.0], meaning, unit)}, {})


def benchmark(command):
    """Module of a command below benchmarks/."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "benchmarks")
        return importlib.import_module(command)
