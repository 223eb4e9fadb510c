"""The tables of docs/methods.md on methods with kicks of a modified potential, computed."""

from __future__ import annotations

import numpy as np

import nearharmonic as nh

#: Time of a force with the gradient of its square over that of a force, as the page has it.
FACTORS = {"henon_heiles": 2.1, "kepler": 1.3}
COSTS = {"henon_heiles": [0.05, 0.1, 0.2], "kepler": [10, 20, 40]}
PLAIN = ("ruth", "srkn_b6", "srkn_b11", "srkn_a14", "nystrom_6a8", "babps8o7h")


def methods_table():
    """Every registered method with its proved order."""
    lines = ["| name | label | composition | stages | gradients | order |", "|---|---|---|---:|---:|---:|"]
    for name, one in nh.modified_integrators.items():
        composition = {"drift": "ABA", "kick": "BAB"}[one.first]
        order = nh.order_of(name)
        lines.append(f"| `{name}` | {one.label} | {composition} | {one.stages} | {one.gradients} | {order} |")
    return "\n".join(lines)


def decades(system, tableau, factor):
    """log10 of the maximum energy error, each stage being charged with so many forces."""
    taus = [cost * tableau.stages * factor for cost in COSTS[system]]
    return np.log10(nh.sweep(system, tableau, taus).max_energy_error.values)


def errors_table():
    """Errors at equal numbers of evaluations, and at equal times."""
    labels = {"henon_heiles": "Hénon-Heiles, τ/s = {:g}", "kepler": "Kepler, {:g} h"}
    header = [labels[system].format(cost) for system, costs in COSTS.items() for cost in costs]
    lines = [f"| name | {' | '.join(header)} |", f"|---|{'---:|' * len(header)}"]
    for name in (*nh.modified_integrators, *PLAIN):
        modified = name in nh.modified_integrators
        tableau = nh.modified_integrators[name] if modified else nh.integrators[name]
        cells = []
        for system, factor in FACTORS.items():
            plain, charged = decades(system, tableau, 1), decades(system, tableau, factor)
            cells += [f"{a:.1f} ({b:.1f})" if modified else f"{a:.1f}" for a, b in zip(plain, charged, strict=True)]
        lines.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(lines)
