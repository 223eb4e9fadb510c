"""The jobs of targets as Snakemake plans them, as lines of JSON: what a rule gives to the function that it names."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from snakemake.api import SnakemakeApi
from snakemake.settings.types import ConfigSettings, DAGSettings, OutputSettings, Quietness, ResourceSettings

#: More than any job has that does not have all.
CORES = 5


def planned(config: str, *targets: str) -> list[Any]:
    """Return the jobs of Snakemake for ``targets``, whatever is there already."""
    from snakemake_executor_plugin_planned import JOBS  # beside this program, where Snakemake finds it too

    sys.argv = ["snakemake", "--configfile", config]  # as the Snakefile expects
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        workflow = api.workflow(
            resource_settings=ResourceSettings(cores=CORES),
            config_settings=ConfigSettings(configfiles=[Path(config)]),
            snakefile=Path("Snakefile"),
        )
        workflow.dag(DAGSettings(targets={*targets}, forceall=True)).execute_workflow(executor="planned")
    return JOBS


def _plain(files: Any) -> dict[str, list[str]]:
    return {name: [value] if isinstance(value, str) else list(value) for name, value in files.items()}


if __name__ == "__main__":
    for job in planned(*sys.argv[1:]):
        told = {
            "rule": job.name, "input": list(job.input), "inputs": _plain(job.input), "output": list(job.output),
            "outputs": _plain(job.output), "log": list(job.log), "params": dict(job.params.items()),
            "threads": job.threads,
        }  # fmt: skip
        print(json.dumps(told, default=asdict))
