"""Configuration of Sphinx: `python -m sphinx -W -b html docs site` builds the site offline (extra `docs`)."""

import sys
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))  # the camopt of this checkout, and docs.generators

project = "camopt"
author = "the camopt developers"
version = release = metadata.version("camopt")
html_title = "camopt"

extensions = ["myst_nb", "sphinx.ext.doctest", "docs.generators"]
exclude_patterns = ["*.py", "generators", "_build"]
nitpicky = True
smartquotes = False  # d' is a derivative, and --out an option

myst_enable_extensions = ["deflist", "colon_fence", "attrs_block"]
myst_heading_anchors = 4
suppress_warnings = ["misc.highlighting_failure"]  # the output of a terminal has no language

nb_custom_formats = {".py": "docs.generators.notebook.notebook"}
nb_execution_mode = "off"  # the outputs are stored: `python -m docs.record_notebooks`
nb_ipywidgets_js = {}  # no page has a live widget, and the scripts would be loaded from another host

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
pygments_style = "default"
