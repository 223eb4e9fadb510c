"""Settings of the site, which `sphinx-build -W -j auto docs build/site` makes from the pages here, without network."""

import sys
from importlib.util import find_spec
from pathlib import Path

import nearharmonic
from nearharmonic_paper.record.workflow_run import package_digest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

project = "nearharmonic"
author = "The nearharmonic developers"
version = release = nearharmonic.__version__
copyright = author

extensions = [
    "paper_results",
    "generated_reference",
    "glossary_links",
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_extensions", "_templates", "reference/generated/parts", "**/.jupyter_cache", "jupyter_execute"]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4  # links to headings, as in the pages of the repository
nb_execution_mode = "cache"
# Cells are kept by their text alone: other code of the package is another cache.
nb_execution_cache_path = str(HERE.parent / "build/notebooks" / package_digest()[:16])
nb_execution_raise_on_error = True
nb_execution_timeout = 300
suppress_warnings = [
    "mystnb.unknown_mime_type",
    "bibtex.duplicate_citation",  # each page lists its own sources, numbered from 1
    "bibtex.duplicate_label",
]

bibtex_bibfiles = ["../paper.bib"]
bibtex_default_style = "unsrt"

templates_path = ["_templates"]
autosummary_generate = ["reference/api.md"]
autodoc_typehints = "none"
nitpicky = True  # a reference in a docstring is to a name of the site
numpydoc_show_class_members = False

html_theme = "furo"
# The package only brings the files of MathJax: loaded as an extension it would make Sphinx read the pages one by one.
html_static_path = ["_static", str(Path(find_spec("sphinx-mathjax-offline").origin).parent / "static")]
mathjax_path = "mathjax/tex-chtml.js"
html_css_files = ["site.css"]
html_title = f"nearharmonic {release}"
html_theme_options = {
    "source_repository": "https://github.com/nearharmonic/nearharmonic",
    "source_branch": "main",
    "source_directory": "docs/",
}
html_copy_source = False
