"""Settings of the documentation: ``sphinx-build notebooks out/site``.

Pages that say what the code says already (settings, commands, all names, measured figures) are
written by `generate` before each build; see CONTRIBUTING.md.
"""

import sys
import warnings
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from generate import docstrings, lines, pages  # noqa: E402

project, author = "jbeamshell", "The jbeamshell developers"
copyright = "the jbeamshell developers, MIT licence"
release = version = version_of("jbeamshell")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",  # equations without a network
]
exclude_patterns = ["generate", "pictures", "**.ipynb_checkpoints", "_build"]
html_theme = "furo"
html_title = "jbeamshell"
html_theme_options = {"navigation_with_keys": True}
html_static_path = ["static"]
html_css_files = ["site.css"]
pygments_style = "friendly"

nb_execution_mode = "off"  # notebooks are shown with the outputs that they keep
nb_merge_streams = True
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
suppress_warnings = ["mystnb.unknown_mime_type"]

default_role = "py:obj"
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_generate = False
napoleon_attr_annotations = False
napoleon_google_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]
napoleon_use_param = False
napoleon_use_rtype = False

warnings.filterwarnings("ignore", "JAXopt is no longer maintained", DeprecationWarning)


def setup(app) -> None:
    """Write the generated pages, read this project's docstrings its way, and mark what is wide."""
    pages.write(HERE / "pages" / "generated", HERE.parent)
    app.connect("autodoc-process-docstring", docstrings.descriptions_on_lines, priority=400)
    app.connect("autodoc-skip-member", docstrings.skipped)
    app.connect("doctree-resolved", lines.mark)
    app.connect("html-page-context", lines.break_code)
