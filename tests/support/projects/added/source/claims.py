"""Statement of the experiment."""

from __future__ import annotations

from nearharmonic_paper.claims.claim import Decision, Results, either, finding


@finding(
    id="added-small-steps",
    paper="Section 4",
    sentence="Errors fall with the step size.",
    statement="The energy error after the smallest step is below that after the largest",
    threshold="a factor",
    bound=10.0,
    needs=("cubes/added.h5",),
)
def small_steps(results: Results, factor: float) -> Decision:
    """Decide on the first and the last step size."""
    errors = results.cube("added").energy_error
    found = float((errors.isel(tau=0) / errors.isel(tau=-1)).min())
    return either(found > factor, f"a factor of {found:.3g}")
