"""Figures: one job draws all declared figures of a cube, which it reads once; each figure is a target.

The paper's figures in the width of a column of text are drawn by jobs of their own, for the target ``columns``.
"""


def _settings(figure, width):
    return {**figure.settings, **(figure.column if width else {})}


for _cube, _width in product(dict.fromkeys(one.cube for one in FIGURES), ("", "column")):
    _figures = [one for one in FIGURES if one.cube == _cube and (not _width or one in PAPER_FIGURES)]
    _name = f"{_cube or 'substeps'}{_width and '_column'}"
    if not _figures:
        continue

    rule:
        name:
            f"draw_{_name}"
        input:
            **({"cube": CUBE(_cube)} if _cube else {}),
        output:
            **{
                one.stem: FIGURE(f"{one.stem}_column") if _width else shown(one.stem, one.category, one.target)
                for one in _figures
            },
        log:
            LOG(f"figures/{_name}"),
        params:
            **LOOK,
            **({"width": _width} if _width else {}),
            tasks=lambda wildcards, figures=_figures, width=_width: {
                one.stem: task(one.draw, **_settings(one, width)) for one in figures
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
        [FIGURE(f"{one.stem}_column") for one in PAPER_FIGURES],
