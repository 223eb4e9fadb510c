"""Figures: one job draws all declared figures of the same cubes, which it reads once; each figure is a target."""

_SHOWN_CUBES = {one.stem: one.cubes or ((one.cube,) if one.cube else ()) for one in FIGURES}

for _cubes in dict.fromkeys(_SHOWN_CUBES.values()):
    _figures = [one for one in FIGURES if _SHOWN_CUBES[one.stem] == _cubes]
    _together = "_and_".join(_cubes) or "substeps"

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
