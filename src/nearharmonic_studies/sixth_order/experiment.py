"""Declaration of the search for methods of order six."""

from nearharmonic_paper.tasks.experiment import Experiment
from nearharmonic_studies.sixth_order.settings import SixthOrderSettings

EXPERIMENT = Experiment(
    name="sixth_order",
    title="Methods of order six with a harmonic order",
    about="Search and ranking of methods of order six and harmonic order seven or eight.",
    place=2,
    duration="50 s",
    settings=SixthOrderSettings,
    key="beyond",
    effect="Effort of the search of `sixth_order`",
    tables=("sixth_order_counts", "sixth_order_measured", "sixth_order_ranking"),
    others=("derived/sixth_order.toml",),
)
