"""Settings of the site: `sphinx-build -W -j auto docs build/site` reads the pages of this folder, without network."""

import sys
from pathlib import Path

import nearharmonic

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

project = "nearharmonic"
author = "The nearharmonic developers"
version = release = nearharmonic.__version__
copyright = author

extensions = [
    "generated_reference",
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx-mathjax-offline",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_extensions", "_templates", "reference/generated/parts", "**/.jupyter_cache", "jupyter_execute"]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4  # links to headings as those of the repository's own pages
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build/notebooks")
nb_execution_raise_on_error = True
nb_execution_timeout = 300
suppress_warnings = ["mystnb.unknown_mime_type"]

bibtex_bibfiles = ["../paper.bib"]
bibtex_default_style = "unsrt"

templates_path = ["_templates"]
autosummary_generate = ["reference/api.md"]
autodoc_typehints = "none"
nitpicky = True  # a reference in a docstring is to a name of the site
numpydoc_show_class_members = False

html_theme = "furo"
html_title = f"nearharmonic {release}"
html_theme_options = {
    "source_repository": "https://github.com/nearharmonic/nearharmonic",
    "source_branch": "main",
    "source_directory": "docs/",
}
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_copy_source = False
