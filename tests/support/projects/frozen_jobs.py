"""Jobs of a target in the form in which a cluster gets them, as lines of JSON: rule, outputs, file if frozen."""

import json
import sys

from planned_jobs import planned

from nearharmonic_paper.tasks.job import frozen

if __name__ == "__main__":
    config, target, folder = sys.argv[1:]
    for job in planned(config, target):
        place = str(frozen(job).write(folder)) if {"task", "tasks"} & dict(job.params.items()).keys() else None
        print(json.dumps({"rule": job.name, "output": list(job.output), "norun": job.is_norun, "place": place}))
