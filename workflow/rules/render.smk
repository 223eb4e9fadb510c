import ast

from nearharmonic import render

# Figure -> its module in nearharmonic.render, and the cube it shows. Figure 6 takes a few steps of its own.
FIGURES = {
    "fig1": ("fig1_sho", "sho"),
    "fig2": ("fig2_decomposition", "sho_terms"),
    "fig3": ("fig3_henon_heiles", "henon_heiles"),
    "fig4": ("fig4_perihelion", "kepler"),
    "fig5": ("fig5_kepler", "kepler"),
    "fig6": ("fig6_substeps", None),
}
FIGURES = {name: (module, cube) for name, (module, cube) in FIGURES.items() if cube in {*SWEEPS, "sho_terms", None}}
FIGURE_FILES = []
SUBSTEPS = [
    *(integrators.module_of(name) for name in ("yoshida_s7o6a", "babs7o7h")),
    *(systems.module_of(name) for name in ("sho", "henon_heiles")),
]


def caption_of(module):
    """The CAPTION of a figure's module, read without loading matplotlib."""
    tree = ast.parse(Path(render.__path__[0], f"{module}.py").read_text(encoding="utf-8"))
    assigned = {ast.unparse(node.targets[0]): node.value for node in tree.body if isinstance(node, ast.Assign)}
    return ast.literal_eval(assigned["CAPTION"])


for _figure, (_module, _cube) in FIGURES.items():
    _stem = f"{RESULTS}/figures/{_module}"
    FIGURE_FILES += multiext(_stem, ".pdf", ".svg", ".png")

    rule:
        name:
            _figure
        input:
            [f"{RESULTS}/cubes/{_cube}.h5"] if _cube else [],
        output:
            multiext(_stem, ".pdf", ".svg"),
            png=report(f"{_stem}.png", caption="../report/figure.rst", category="Figures", labels={"figure": _figure}),
        log:
            f"{RESULTS}/logs/render/{_module}.log",
        params:
            module=_module,
            caption=caption_of(_module),
            code=code_digest(f"nearharmonic.render.{_module}", "nearharmonic.store", *([] if _cube else SUBSTEPS)),
        script:
            "../scripts/render.py"
