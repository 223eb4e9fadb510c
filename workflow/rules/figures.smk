"""Figures: one job draws all declared figures of the same cubes, which it reads once; each figure is a target.

The figures of the paper in the width of a column of text are drawn by jobs of their own, for the target ``columns``.
"""

_JOBS = {}  # figures of a job: of the same cubes and width, and each that is not drawn by default
for _one in FIGURES:
    _cubes = _one.cubes or ((_one.cube,) if _one.cube else ())
    _JOBS.setdefault((_cubes, "", "" if _one.by_default else _one.stem), []).append(_one)
    if _one in PAPER_FIGURES and _one.by_default:
        _JOBS.setdefault((_cubes, "_column", ""), []).append(_one)

for (_cubes, _width, _apart), _figures in _JOBS.items():
    _together = (_apart or "_and_".join(_cubes) or "substeps") + _width

    rule:
        name:
            f"draw_{_together}"
        input:
            **({"cubes": map(CUBE, _cubes)} if _cubes else {}),
        output:
            **{
                one.stem: FIGURE(f"{one.stem}_column") if _width else shown(one.stem, one.category, one.target)
                for one in _figures
            },
        log:
            LOG(f"figures/{_together}"),
        params:
            **LOOK,
            **({"width": "column"} if _width else {}),
            tasks=lambda wildcards, figures=_figures, width=_width: {
                one.stem: task(one.draw, **{**one.settings, **(one.column if width else {})}) for one in figures
            },
            captions={one.stem: f"{one.title}\n{one.caption}" for one in _figures},
        script:
            "../scripts/draw.py"


for _figure in FIGURES:

    rule:
        name:
            _figure.target
        input:
            FIGURE(_figure.stem),


for _figure in FIGURES:
    if _figure.profile and _figure.target != f"{_figure.cube}_energy_error":

        rule:  # the figure of energy errors of any system has a target of this name
            name:
                f"{_figure.cube}_energy_error"
            input:
                FIGURE(_figure.stem),


rule columns:
    input:
        [FIGURE(f"{one.stem}_column") for one in PAPER_FIGURES if one.by_default],
