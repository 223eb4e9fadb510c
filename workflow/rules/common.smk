"""The config, checked before any rule exists, and what the rules look up in it."""

from dataclasses import asdict
from functools import cache
from pathlib import Path

from snakemake.exceptions import WorkflowError

from nearharmonic.config import load, read_schema
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.plan import shards_of
from nearharmonic.provenance import code_digest, coefficients_digest
from nearharmonic.systems import systems

try:
    CONFIG = load(config, read_schema(Path(workflow.basedir) / "workflow/schemas/config.schema.yaml"))
except NearharmonicError as error:
    raise WorkflowError(str(error)) from None

RESULTS = f"results/{CONFIG.name}"
SWEEPS = {sweep.system: sweep for sweep in CONFIG.sweeps}
METHOD_MODULES = sorted({integrators.module_of(name) for name in CONFIG.integrators + CONFIG.decomposition})


wildcard_constraints:
    system="|".join(SWEEPS),
    integrator="|".join(CONFIG.integrators),
    shard="|".join(map(str, range(max(sweep.shards for sweep in CONFIG.sweeps)))),


@cache
def run_files(system, integrator):
    """The run files of one method on one system."""
    count = shards_of(SWEEPS[system], integrator)
    return [f"{RESULTS}/runs/{system}/{integrator}/{shard}.h5" for shard in range(count)]


@cache
def code_of(system, *layers):
    """Digest of the code of ``layers`` and of one system: editing another system leaves it as it is."""
    return code_digest(*(f"nearharmonic.{layer}" for layer in layers), systems.module_of(system))
