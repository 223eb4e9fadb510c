"""Samplers of BlackJAX and mici with methods of this package: gains over leapfrog in gradients per effective sample.

Run: ``python benchmarks/samplers_in_libraries.py`` (about a quarter of an hour on one core; needs the extras blackjax
and mici); ``--page`` writes the table to ``docs/results/samplers.md``, ``--short`` takes few proposals, for a trial.
"""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
from timing import parser_of, show

import nearharmonic as nh
from nearharmonic.math import exp
from nearharmonic.output.table import pipes
from nearharmonic_studies.samplers.targets import costs, error_of, student

PAGE = "docs/results/samplers.md"
METHODS = ("leapfrog", "bcss_s2", "bcss_s3", "bcss_s4", "predescu_s3", "babs7o7h")
TARGETS = {
    "gaussian": "Gaussian, 1000 dimensions",
    "quartic": "quartic posterior, 256 dimensions",
    "eight_schools": "eight schools",
    "gp_regr": "Gaussian process",
    "mesquite": "regression",
}
#: Class of the chains, name on the page, and the level of which the step size is chosen: the acceptance, and for MCLMC
#: the mean squared energy error of a step for each dimension. Both are the defaults of the libraries.
SAMPLERS = {
    "Nuts": ("NUTS, BlackJAX", 0.8),
    "Mclmc": ("MCLMC, BlackJAX", 5e-4),
    "Metropolis": ("HMC, mici", 0.8),
    "Dynamic": ("dynamic HMC, mici", 0.8),
}
#: Proposals of a block and blocks on products of many modes and on posteriors; of MCLMC gradients in place of blocks.
SIZES = {
    "Nuts": ((15, 8), (100, 20)), "Mclmc": ((200, 4000), (200, 12000)),
    "Metropolis": ((30, 5), (60, 10)), "Dynamic": ((8, 10), (15, 16)),
}  # fmt: skip
#: Chains, halvings of the range of steps.
CHAINS, HALVINGS = 12, 7
#: Target and sampler whose trajectories are too long with BCSS 3.
OMITTED = ("gaussian", "Dynamic")
MISSING = "the samplers need BlackJAX and mici: pip install 'nearharmonic[blackjax,mici]'"


def measured(short):
    """Gradients of leapfrog and gains with intervals, by target and sampler; versions of the libraries."""
    try:
        import chains_of_libraries as chains
    except ImportError as error:
        raise SystemExit(f"{MISSING} ({error})") from None
    found = {}
    for target in TARGETS:
        found |= on_target(chains, target, short)
    names = {"BlackJAX": "blackjax", "JAX": "jax", "mici": "mici"}
    return found, ", ".join(f"{name} {version(package)}" for name, package in names.items())


def on_target(chains, target, short):
    """Gradients of leapfrog and gains on one target, by target and sampler."""
    problem, found = chains.Problem(target, CHAINS), {}
    for kind, (_, level) in SAMPLERS.items():
        if (target, kind) == OMITTED:
            continue
        count, blocks = SIZES[kind][target not in chains.PRODUCTS]
        values = {}
        for name in METHODS:
            method = nh.integrators[name]
            sampler = getattr(chains, kind)(problem, method if method.first == "kick" else method.role("kick"), 1)
            tau = chains.with_level(sampler, level, count, HALVINGS)
            size = -(-blocks // (count * method.stages)) if kind == "Mclmc" else blocks
            block = chains.measured_with(sampler, tau, count, 2 if short else size)
            values[name] = costs(block.observed, block.gradients)
            text = f"{target} {kind} {name}: step {tau:.3f}, level {block.level:.3g}"
            print(f"{text}, gradients {exp(values[name][0]):.3g}", flush=True)
        found[target, kind] = gains(values)
    return found


def gains(values):
    """Gradients of leapfrog, and gains with 95 % intervals, from logarithms of gradients (chains + 1,) by method."""
    first = values["leapfrog"]
    found = {"gradients": float(exp(first[0]))}
    for name in METHODS[1:]:
        middle, half = first[0] - values[name][0], error_of(first - values[name]) * student(len(first) - 2)
        found[name] = tuple(float(exp(np.clip(one, -9, 9))) for one in (middle, middle - half, middle + half))
    return found


def parts(found, libraries):
    """The table of the page."""
    rows = []
    for (target, kind), values in found.items():
        cells = ("{:.2f} ({:.2f} to {:.2f})".format(*values[name]) for name in METHODS[1:])
        rows.append([TARGETS[target], SAMPLERS[kind][0], f"{values['gradients']:.1f}", *cells])
    head = ["target", "sampler", "gradients, leapfrog", *(nh.integrators[name].label for name in METHODS[1:])]
    return {"libraries": "\n".join([*pipes(head, rows, align="llr"), "", f"Versions: {libraries}."])}


def main() -> None:
    parser = parser_of(__doc__, PAGE)
    parser.add_argument("--short", action="store_true", help="few proposals: a trial of some minutes")
    options = parser.parse_args()
    show(parts(*measured(options.short)), PAGE, options.page)


if __name__ == "__main__":
    main()
