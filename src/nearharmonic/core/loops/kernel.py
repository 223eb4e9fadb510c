"""The one kernel: every tableau, every system, every precision, one trajectory or many in SIMD lanes.

:func:`build` turns a system's formulas into compiled code for one choice of ``precision``, ``summation`` and lane
``width``. The tableau is data (coefficient arrays), so one compilation serves all methods.

Layout of a lane's row block, ``width`` doubles a row: d positions, their d carries, d momenta, their d carries; then
the tally: largest and summed |H - H0| of the block, the sum's carry, the latest H - H0, H0 as a pair, the largest |H -
H0| allowed, and by how much the rounding of doubles changes H (:func:`nearharmonic.core.formulas.rules.rounding_of`);
then each parameter as a pair; then the state that runs, laid out as the first 4 d rows, and the d numbers that its next
move is late by (:mod:`nearharmonic.core.step`). In extended precision the carries are the low halves of double-doubles.

Formulas of many coordinates are compiled as loops (:mod:`nearharmonic.core.large`), for one lane.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nearharmonic.core.formulas.emission import fingerprint
from nearharmonic.core.formulas.physics import Physics
from nearharmonic.core.formulas.rules import Rules
from nearharmonic.core.layout import ADVANCE, BEGIN, LAND, RUN, STEP, Signature, workspace
from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.native import NativeFunction, PreparedCall, code_key, native

#: Instructions of a function of numba in a unit of cost, where none is repeated.
INSTRUCTIONS = 8

__all__ = ["Kernel", "Physics", "build", "build_landing", "build_step", "cost", "room"]


@dataclass(frozen=True)
class Kernel:
    """Compiled code for one system, precision and width, with the layout its arrays must have.

    ``advance()`` compiles the inner kernel by itself, for benchmarks and ensembles that schedule their own lanes:
    ``advance()(count, stages, kick_first, moves, rows) -> steps done``: ``moves`` is float64 (stages + 2, columns,
    width), the rows of coefficients, of which the first is replaced by the second; ``rows`` float64 (4 d +
    :data:`TALLY` + :func:`parameter_rows` + 5 d, width), changed in place, and ``room`` more behind them. It returns
    before ``count`` when a lane's energy error passes its limit.

    ``begin`` is the address of the function that begins tallies, 0 if the energy is never measured.

    ``prepared`` passes a queue of runs through the lanes, as often as what it returns is called: its arguments are
    :data:`nearharmonic.core.layout.RUN` without the addresses in front and without the workspace at the end, which
    belongs to the call that it returns.
    """

    width: int
    dimension: int
    parts: int
    parameters: int
    room: int
    columns: int
    begin: int
    advance: Callable[[], NativeFunction]
    prepared: Callable[..., PreparedCall]

    def run(self, *given: Any) -> None:
        """Pass a queue of runs through the lanes once."""
        self.prepared(*given)()


def build(physics: Physics, *, extended: bool, compensated: bool, width: int, energy: str = "every") -> Kernel:
    """Load the kernel from the cache, or compile it into the cache.

    Parameters
    ----------
    physics : Physics
        The system.
    extended, compensated : bool
        Arithmetic of the state, and of the sums.
    width : int
        Number of SIMD lanes.
    energy : {"every", "samples", "none"}
        Whether the energy is measured at every step, at the end of each stretch of steps, or never.
    """
    rules, more = Rules(physics, extended, compensated), room(physics, extended=extended)

    def make_begin() -> tuple[str, bytes]:
        choice = {"large": physics.loops is not None, "quick": rules.quick_energy}
        return _linked("begin", BEGIN, choice, rules, width)

    def make_run() -> tuple[str, bytes]:
        from nearharmonic.core.machine import link

        def compiled() -> tuple[str, bytes]:
            from nearharmonic.core.loops import scheduler

            return link.loops(scheduler.run, RUN)

        return link.alone(*link.kept("run", "", compiled))

    advance = _advance(rules, width, energy)
    begin = 0 if energy == "none" else native(f"begin-{_key(rules, width)}", BEGIN, make_begin).address
    run = native(f"run-{code_key()}", RUN, make_run)

    def prepared(
        measured: int, order: Any, marks: Any, scheme: Any, start: Any, resumed: Any, parameters: Any, limit: float,
        scale: float, reference: Any, stretch: int, stages: int, *others: Any,
    ) -> PreparedCall:  # fmt: skip
        shape = {"parameters": physics.parameters, "width": width, "room": more, "columns": rules.columns}
        own = workspace(physics.dimension, stages, **shape)
        first = advance.address, begin, measured, order, marks, scheme, start, resumed, parameters
        return run.prepared(*first, limit, scale, reference, stretch, stages, *others, *own)

    return Kernel(
        width=width,
        dimension=physics.dimension,
        parts=rules.parts,
        parameters=physics.parameters,
        room=more,
        columns=rules.columns,
        begin=begin,
        advance=lambda: advance,
        prepared=prepared,
    )


def build_landing(
    physics: Physics, maps: Any, *, extended: bool, compensated: bool, energy: str
) -> Callable[..., PreparedCall]:
    """Load the function that passes runs of a regularised system through their steps, or compile it into the cache.

    Parameters
    ----------
    physics, extended, compensated, energy
        As for :func:`build`.
    maps : RegularisedFormulas
        The maps from and to physical states.

    Returns
    -------
    callable
        Prepares a call, from the arguments of :data:`nearharmonic.core.layout.LAND` without the three addresses in
        front and the arrays of one state behind.
    """
    from nearharmonic.core.formulas import emission as formulas

    rules = Rules(physics, extended, compensated)
    kernel = build(physics, extended=extended, compensated=compensated, width=1, energy=energy)
    main = _advance(rules, 1, energy)
    look = _advance(rules, 1, "none" if energy == "none" else "samples")

    module = formulas.maps_module(rules, maps)

    def make() -> tuple[str, bytes]:
        from nearharmonic.core.machine import link

        def compiled() -> tuple[str, bytes]:
            from nearharmonic.core.loops import landing

            return link.loops(landing.land(extended=extended, compensated=compensated), LAND)

        loops = link.kept("land", f"{extended} {compensated}", compiled)
        return link.linked(*loops, module, formulas.kinds_of(rules, 1))

    # The formulas of the steps do not tell the maps: the text of these does.
    land = native(f"land-{code_key(str(module), f'{extended} {compensated}')}", LAND, make)

    def prepared(measured: int, *others: Any) -> PreparedCall:
        stages = others[_STAGES]
        arrays = workspace(physics.dimension, stages, parameters=physics.parameters, width=1)
        rows, trial, lanes, trial_lanes = arrays[0], arrays[1], arrays[2], arrays[2].copy()
        addresses = main.address, look.address, kernel.begin
        return land.prepared(*addresses, measured, *others, rows, lanes, trial, trial_lanes)

    return prepared


def build_step(physics: Physics, *, compensated: bool) -> NativeFunction:
    """Load the function of a single step in double precision, or compile it into the cache.

    Parameters
    ----------
    physics : Physics
        The system, whose formulas are not loops.
    compensated : bool
        Arithmetic of the sums.
    """
    rules = Rules(physics, False, compensated)
    return native(
        f"step-{_key(rules, 1)}", STEP, lambda: _linked("step", STEP, {"form": _form(rules, "none")}, rules, 1)
    )


#: Place of the number of stages among the arguments of :data:`LAND` from the queue on.
_STAGES = [argument.name for argument in LAND.arguments].index("stages") - 4


def room(physics: Physics, *, extended: bool) -> int:
    """Return the doubles behind the rows that a kernel of ``physics`` works in."""
    if physics.loops is None:
        return 0
    from nearharmonic.core.large import functions

    return functions.room(*physics.loops, extended=extended)


def cost(physics: Physics, *, extended: bool) -> int:
    """Return the time that a force takes, in units of a few nanoseconds at most: without loops, that of all pairs."""
    if physics.loops is None:
        force = physics.dimension * (physics.dimension + 4) // 2
        if physics.numba is not None:
            return force + physics.numba.instructions // INSTRUCTIONS
        return force if physics.modified is None else 2 * force
    # A double-double operation takes about 16 of doubles.
    return 1 + sum(energy.work_of_loops for energy in physics.loops) * (16 if extended else 1) // 50


def _key(rules: Rules, width: int, *more: str) -> str:
    return code_key(fingerprint(rules), f"{rules.extended} {rules.compensated} {width}", *more)


def _advance(rules: Rules, width: int, energy: str) -> Any:
    def make() -> tuple[str, bytes]:
        return _linked("advance", ADVANCE, {"form": _form(rules, energy)}, rules, width, energy)

    return native(f"advance-{_key(rules, width, energy)}", ADVANCE, make)


def _form(rules: Rules, energy: str) -> Form:
    from nearharmonic.core.formulas.emission import moving

    physics, large = rules.physics, rules.physics.loops is not None
    return Form(
        extended=rules.extended, compensated=rules.compensated,
        ahead=rules.looks_ahead and (physics.unit_masses or not large), modified=physics.modified is not None,
        turning=physics.turning is not None, resting=not large and not all(moving(rules)),
        quick=rules.quick_energy and energy == "every", large=large,
        unit_masses=large and physics.unit_masses,
    )  # fmt: skip


def _linked(
    entry: str, signature: Signature, choice: dict[str, Any], rules: Rules, width: int, energy: str = "every"
) -> tuple[str, bytes]:
    """Name and object code of a function that numba compiles for a choice, with the formulas of a system."""
    from nearharmonic.core.formulas import emission as formulas
    from nearharmonic.core.machine import link, operations

    def compiled() -> tuple[str, bytes]:
        from nearharmonic.core.loops import advance
        from nearharmonic.core.stepper import single_step

        made: dict[str, Callable[..., Any]] = {
            "advance": advance.advance,
            "begin": advance.begin,
            "step": single_step.step,
        }
        return link.loops(made[entry](**choice), signature)

    loops = link.kept(entry, repr(choice), compiled)
    given = "" if rules.physics.numba is None else rules.physics.numba.text
    needed = link.needed(loops[1])
    written = formulas.module_of(rules, width, needed - {"energy"} if energy == "none" else needed)
    operations.write_numbers(written, {"measuring": energy != "none", "at_every_step": energy == "every"})
    return link.linked(*loops, written, formulas.kinds_of(rules, width), given)
