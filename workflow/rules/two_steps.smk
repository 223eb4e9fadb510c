"""Work in two steps: one job integrates all problems and writes a run file, another makes a cube or a table from it.

A change of what is made of the runs integrates nothing again. Each experiment adds its own to TWO_STEPS.
"""

for _name, _steps in TWO_STEPS.items():

    rule:
        name:
            f"{_name}_run"
        output:
            run=_steps["run"],
        log:
            LOG(_steps["logs"][0]),
        params:
            task=_steps["measure"],
        script:
            "../scripts/task.py"

    rule:
        name:
            f"{_name}_{'cube' if 'cube' in _steps['results'] else 'table'}"
        input:
            run=_steps["run"],
        output:
            **_steps["results"],
        log:
            LOG(_steps["logs"][1]),
        params:
            task=_steps["reduce"],
        script:
            "../scripts/task.py"
