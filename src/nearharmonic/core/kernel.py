"""The kernel for all tableaus, systems and precisions, and for one trajectory or many in SIMD lanes.

:func:`build` turns a system's formulas into compiled code for one choice of ``precision``, ``summation`` and lane
``width``. The tableau is data (coefficient arrays), so one compilation serves all methods.

The row block of the lanes has ``width`` doubles in a row. Its rows are: d positions, their d carries, d momenta, their
d carries; then the tally: maximum and sum of |H - H0| over the block, the carry of the sum, the latest H - H0, H0 as a
pair, the largest |H - H0| allowed, and two bounds of the rounding error of H
(:func:`nearharmonic.core.tracing.rounding_of`); then each parameter as a pair; then the running state, laid out as the
first 4 d rows, and the d rests that its next move adds (:mod:`nearharmonic.core.step`). In extended precision the
carries are the low halves of double-doubles.

Formulas of many coordinates are compiled as loops, for one lane (:mod:`nearharmonic.core.large`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from llvmlite import binding, ir
from numpy.typing import NDArray

from nearharmonic.core.emission import clocks, fingerprint, kinds_of, maps_module, module_of, moving
from nearharmonic.core.layout import ADVANCE, BEGIN, LAND, RUN, STEP, Form, Signature, workspace
from nearharmonic.core.native import (
    NativeFunction,
    PreparedCall,
    code_key,
    join,
    native,
    object_code,
    run_passes,
)
from nearharmonic.core.tracing import Physics, Rules
from nearharmonic.core.values import PREFIX, Kinds, write_numbers

#: Instructions of a function of numba per unit of cost; loops in it are counted once.
INSTRUCTIONS = 8


@dataclass(frozen=True)
class Kernel:
    """Compiled code for one system, precision and number of lanes ``width``, with the layout of its arrays.

    ``advance`` is the inner kernel alone, for benchmarks and ensembles that schedule their own lanes:
    ``advance(count, stages, kick_first, moves, rows) -> steps done``: ``moves`` is float64 (stages + 2, columns,
    width), the rows of coefficients; the kernel replaces the first row by the second. ``rows`` is float64 (4 d +
    TALLY + parameter_rows + 5 d, width) with names of :mod:`nearharmonic.core.layout`, changed in place, with
    :func:`room` more doubles behind them. It returns before ``count`` steps if the energy error of a lane exceeds its
    limit.

    ``workspace(stages)`` returns the arrays that a queue of runs works in.

    ``prepared`` returns a call that passes a queue of runs through the lanes and can be repeated. Its arguments are
    :data:`nearharmonic.core.layout.RUN` without the addresses at the beginning and without the workspace at the end,
    which belongs to the returned call.
    """

    width: int
    advance: NativeFunction
    workspace: Callable[[int], tuple[NDArray[Any], ...]]
    prepared: Callable[..., PreparedCall]


def build(physics: Physics, *, extended: bool, compensated: bool, width: int, energy: str = "every") -> Kernel:
    """Load the kernel of ``width`` SIMD lanes from the cache, or compile it into the cache.

    ``extended``: states are double-doubles; ``compensated``: sums are compensated. The energy is measured at "every"
    step, at the "samples", which are the ends of stretches of steps, or never ("none").
    """
    rules = Rules(physics, extended, compensated)

    def make() -> tuple[str, bytes]:
        return linked_code(written("run", RUN, Kinds(1, 1, 1)))

    def space(stages: int) -> tuple[NDArray[Any], ...]:
        more = room(physics, extended=extended)
        return workspace(
            physics.dimension, stages, parameters=physics.parameters, width=width, room=more, columns=rules.columns,
            stages=physics.stage_count,
        )  # fmt: skip

    advance, begin = _advance(rules, width, energy), _begin(rules, width, energy)
    run, place = native(f"run-{code_key()}", RUN, make), _place_of_stages(RUN)

    def prepared(*given: Any) -> PreparedCall:
        return run.prepared(advance, begin, *given, *space(given[place - 2]))

    return Kernel(width, advance, space, prepared)


def build_landing(
    physics: Physics, maps: Any, *, extended: bool, compensated: bool, energy: str
) -> Callable[..., PreparedCall]:
    """Load the function that integrates runs of a regularised system, like :func:`build`; ``maps`` are to its states.

    It returns a prepared call for the arguments of :data:`nearharmonic.core.layout.LAND` but for the three addresses at
    the beginning and the arrays of one state at the end.
    """
    rules = Rules(physics, extended, compensated)
    main, look = _advance(rules, 1, energy), _advance(rules, 1, "none" if energy == "none" else "samples")
    begin, place = _begin(rules, 1, energy), _place_of_stages(LAND)
    module = maps_module(rules, maps)

    def make() -> tuple[str, bytes]:
        land = written("land", LAND, kinds_of(rules, 1), extended=extended, compensated=compensated)
        return linked_code(land, module)

    # The formulas of the steps do not determine the maps, so the key covers the code of the maps.
    land = native(f"land-{code_key(str(module), f'{extended} {compensated}')}", LAND, make)

    def prepared(*given: Any) -> PreparedCall:
        rows, trial, lanes, *_ = workspace(
            physics.dimension, given[place - 3], parameters=physics.parameters, width=1, stages=physics.stage_count
        )
        return land.prepared(main, look, begin, *given, rows, lanes, trial, lanes.copy())

    return prepared


def build_step(physics: Physics, *, compensated: bool) -> NativeFunction:
    """Load the function of a single step in double precision, without loops over coordinates, or compile it."""
    rules = Rules(physics, False, compensated)

    def make() -> tuple[str, bytes]:
        kinds = kinds_of(rules, 1)
        return _linked(written("single_step", STEP, kinds, form=form_of(rules, "none")), rules, kinds)

    return native(f"step-{_key(rules, 1)}", STEP, make)


def _place_of_stages(signature: Signature) -> int:
    return [argument.name for argument in signature.arguments].index("stages")


def room(physics: Physics, *, extended: bool) -> int:
    """Return the number of doubles of working memory behind the rows of a kernel of ``physics``."""
    if physics.loops is None:
        return 0
    from nearharmonic.core import large

    return large.room(physics, extended=extended)


def cost(physics: Physics, *, extended: bool) -> int:
    """Return the time of a force in units of at most a few nanoseconds; without loops, the time of all pairs."""
    if physics.loops is None:
        force = physics.dimension * (physics.dimension + 4) // 2
        if physics.numba is not None:
            return force + physics.numba.instructions // INSTRUCTIONS
        return force if physics.modified is None else 2 * force
    # A double-double operation takes about 16 operations on doubles.
    return 1 + sum(energy.work_of_loops for energy in physics.loops) * (16 if extended else 1) // 50


def _key(rules: Rules, width: int, *more: str) -> str:
    return code_key(fingerprint(rules), f"{rules.extended} {rules.compensated} {width} {rules.physics.stages}", *more)


def _advance(rules: Rules, width: int, energy: str) -> NativeFunction:
    def make() -> tuple[str, bytes]:
        kinds = kinds_of(rules, width)
        return _linked(written("advance", ADVANCE, kinds, form=form_of(rules, energy)), rules, kinds, energy)

    return native(f"advance-{_key(rules, width, energy)}", ADVANCE, make)


def _begin(rules: Rules, width: int, energy: str) -> NativeFunction | int:
    """The function that resets tallies, 0 if the energy is never measured."""
    if energy == "none":
        return 0

    def make() -> tuple[str, bytes]:
        kinds, large = kinds_of(rules, width), rules.physics.loops is not None
        return _linked(written("begin", BEGIN, kinds, large=large, quick=rules.quick_energy), rules, kinds)

    return native(f"begin-{_key(rules, width)}", BEGIN, make)


def form_of(rules: Rules, energy: str) -> Form:
    plain = not (rules.extended or rules.compensated)
    physics, large = rules.physics, rules.physics.loops is not None
    return Form(
        extended=rules.extended, compensated=rules.compensated,
        ahead=rules.looks_ahead and (physics.unit_masses or not large), modified=physics.modified is not None,
        turning=physics.turning is not None, resting=not large and not all(moving(rules)),
        quick=rules.quick_energy and energy == "every", large=large,
        unit_masses=large and physics.unit_masses, stages=physics.stages is not None,
        timed=plain and physics.timed if large else any(clocks(rules)),
    )  # fmt: skip


def written(entry: str, signature: Signature, kinds: Kinds, **options: Any) -> ir.Module:
    """Return a module with a function of loops, for the options of its form."""
    from nearharmonic.core import loops, reals  # a process that finds its kernels on disk needs neither

    return reals.written(getattr(loops, entry)(**options), signature, kinds)


def _linked(module: ir.Module, rules: Rules, kinds: Kinds, energy: str = "every") -> tuple[str, bytes]:
    """Name and object code of a function of loops with the formulas of a system."""
    numba = rules.physics.numba
    return linked_code(module, formulas_of(module, rules, kinds, energy), "" if numba is None else numba.text)


def formulas_of(module: ir.Module, rules: Rules, kinds: Kinds, energy: str) -> ir.Module:
    """Return a module with the formulas of a system that a function of loops calls."""
    needed = {name.removeprefix(PREFIX) for name in module.globals}
    if rules.physics.loops is None:
        write = module_of
    else:
        from nearharmonic.core.large import module_of as write
    formulas = write(rules, kinds, needed - {"energy"} if energy == "none" else needed)
    write_numbers(formulas, {"measuring": energy != "none", "at_every_step": energy == "every"})
    return formulas


def joined_code(module: ir.Module, *texts: str) -> Any:
    """Return the module of a function of loops, the first of its module, with the functions that it calls inlined."""
    joined = join(binding.parse_assembly(str(module)), *texts)
    for function in joined.functions:
        if not function.is_declaration and function.name != module.name:
            function.linkage = "internal"
    run_passes(joined, "always_inliner", "global_dead_code_eliminate")
    return joined


def linked_code(module: ir.Module, formulas: ir.Module | None = None, given: str = "") -> tuple[str, bytes]:
    """Name and object code of a function of loops, the first of its module, linked with the formulas of a system.

    ``given`` is the LLVM text of functions that the formulas call; LLVM may inline them.
    """
    joined = joined_code(module, *([] if formulas is None else [str(formulas)]))
    if given:
        names = [function.name for function in binding.parse_assembly(given).functions if not function.is_declaration]
        join(joined, given)
        for own in names:
            joined.get_function(own).linkage = "internal"
    return module.name, object_code(joined)
