"""NAME: a particle in a plane well, H = p.p / 2 + k q.q / 2 + b (q.q)^2 / 4. Describe your system here.

The file runs without changes: nearharmonic recommend NAME.py --error 1e-6
In Python its path is its name: nearharmonic.integrate("NAME.py", "babps9o7h", tau=0.2)
In a config it is an entry of systems:
  NAME: {file: NAME.py, tau_per_stage: {lowest: 0.01, highest: 1, points_per_decade: 20}}
"""

from nearharmonic import Parameter, System

# Formulas take sin, cos, exp, log and others from nearharmonic.math; functions of math and numpy raise errors.
# from nearharmonic.math import cos


def V(q, k, b):
    """Potential energy: of the tuple of coordinates q, then of the parameters in the order in which they stand below.

    It may use + - * / **, loops and sum, but no branch on a value. The force is derived from it. If it depends on
    time, its arguments are (q, t, k, b), and time_dependent=True stands below.
    """
    x, y = q
    square = x * x + y * y
    return k * square / 2 + b * square**2 / 4


def angular_momentum(q, p, k, b):
    """A conserved function of positions, momenta and parameters."""
    (x, y), (u, v) = q, p
    return x * v - y * u


SYSTEM = System(
    name="NAME",
    label="NAME",  # the name in figures and tables
    V=V,
    # Numbers are decimals: "0.1" and 0.1 are one tenth in every precision, and strings keep all their digits.
    q0=(1, 0),
    p0=(0, 0.5),
    t_end=100,
    parameters={
        "k": Parameter(value=1, unit="N m-1", meaning="stiffness of the well"),
        "b": Parameter(value=0.1, unit="N m-3", meaning="strength of the quartic term"),
    },
    units={"q": "m", "p": "kg m s-1", "t": "s", "energy": "J"},
    # Every result has the drift of these, besides the energy error. Delete the line if there are none.
    invariants={"angular_momentum": angular_momentum},
    source="say here where the system comes from",
    # Further options; each line can be used alone:
    # The kinetic energy is p.p / 2. Other masses, one per coordinate (numbers or names of parameters), or a matrix:
    # masses=("2", "2"),
    # Any other kinetic energy, instead of masses:
    # T=lambda p, k, b: (1 + p[0] ** 2 + p[1] ** 2) ** 0.5,
    # Functions that are recorded at the samples of a run:
    # observables={"distance": lambda q, p, k, b: (q[0] ** 2 + q[1] ** 2) ** 0.5},
    # The energy, in its unit, to which errors are relative, instead of the energy at the start:
    # energy_scale="0.5",
    # V depends on time, see above:
    # time_dependent=True,
)
