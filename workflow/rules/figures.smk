"""Figures: one job draws all declared figures of a cube, which it reads once; each figure is a target."""

for _cube in dict.fromkeys(one.cube for one in FIGURES):
    _figures = [one for one in FIGURES if one.cube == _cube]

    rule:
        name:
            f"draw_{_cube or 'substeps'}"
        input:
            **({"cube": CUBE(_cube)} if _cube else {}),
        output:
            **{one.stem: shown(one.stem, one.category, one.target) for one in _figures},
        log:
            LOG(f"figures/{_cube or 'substeps'}"),
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
