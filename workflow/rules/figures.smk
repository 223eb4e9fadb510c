"""Figures: one job draws all declared figures of the same cubes, which it reads once; each figure is a target."""

_JOBS = {}  # figures by their cubes, apart from those that are not drawn by default
for _one in FIGURES:
    _cubes = _one.cubes or ((_one.cube,) if _one.cube else ())
    _JOBS.setdefault((_cubes, "" if _one.by_default else _one.stem), []).append(_one)

for (_cubes, _apart), _figures in _JOBS.items():
    _together = _apart or "_and_".join(_cubes) or "substeps"

    rule:
        name:
            f"draw_{_together}"
        input:
            **({"cubes": map(CUBE, _cubes)} if _cubes else {}),
        output:
            **{one.stem: shown(one.stem, one.category, one.target) for one in _figures},
        log:
            LOG(f"figures/{_together}"),
        params:
            **LOOK,
            tasks=lambda wildcards, figures=_figures: {one.stem: task(one.draw, **one.settings) for one in figures},
            captions={one.stem: one.caption for one in _figures},
        script:
            "../scripts/draw.py"


for _figure in FIGURES:

    rule:
        name:
            _figure.target
        input:
            FIGURE(_figure.stem),
