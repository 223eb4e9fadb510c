"""Energy errors of one step of leapfrog, against exact arithmetic."""

from fractions import Fraction

import pytest
from nearharmonic_paper.experiments.added.reductions import reduction
from nearharmonic_paper.experiments.added.run import measure
from nearharmonic_paper.experiments.added.settings import AddedSettings

from nearharmonic.output.store import assembled


def test_one_step_of_leapfrog_errs_as_its_polynomial():
    variables = measure(("leapfrog",), AddedSettings(steps=2))["run"].variables
    cube = reduction.of(assembled(variables, ["label"], {}), over="tau")
    for i, tau in enumerate((Fraction(1, 2), Fraction(1, 4))):
        assert cube.energy_error[0, i].item() == pytest.approx(float(tau**4 / 4), abs=1e-15)
