"""Sphinx builds all Markdown of the tree as one site, whose index is docs/index.md."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

TREE = Path(__file__).resolve().parents[1]
BUILD = TREE / "build" / "dev"
sys.path.insert(0, str(TREE / "docs" / "_extensions"))
# The package beside its extension module, as the tests import it.
sys.path.insert(0, os.environ.get("RTPM_PYTHON_PACKAGE", str(BUILD / "python")))

project = "RTPM"
author = "The authors of RTPM"
copyright = "The authors of RTPM, Apache License 2.0"
version = release = re.search(  # type: ignore[union-attr]
    r"project\(rtpm VERSION ([0-9.]+)", (TREE / "CMakeLists.txt").read_text()
).group(1)

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_design",
    "breathe",
    "rtpm_docs",
]
root_doc = "docs/index"
# READMEs stay beside what they describe, and are pages of this site.
include_patterns = ["*.md", "**/*.md"]
exclude_patterns = [
    "build",
    ".git",
    "**/node_modules",
    "**/__pycache__",
    "debian",
    "clients/console/page/work",
]

# The programs that say their own options.
rtpm_programs = os.environ.get("RTPM_PROGRAMS", str(BUILD / "bin"))

# ---- Markdown -----------------------------------------------------------------------------------
myst_enable_extensions = ["attrs_block", "colon_fence"]
myst_heading_anchors = 4
myst_heading_slug_func = "rtpm_docs.slug"
highlight_language = "none"
suppress_warnings = [
    # A README is read on its own, too; its first heading may be of any level.
    "myst.header",
    # docs/reference/parts.md lists all READMEs, and a test that the others are reached.
    "toc.not_included",
    # Code is shortened by `…`.
    "misc.highlighting_failure",
    # The built-in `type`, beside attributes of this name.
    "ref.python",
]

# ---- Python and C++ -----------------------------------------------------------------------------
nitpicky = True
nitpick_ignore_regex = [
    # Types of other libraries, and those that no page describes.
    (r"py:.*", r"(?!rtpm\.).*"),
    (r"py:.*", r"rtpm\.(_core|idl)\..*|rtpm\.\w+\._.*"),
    (r"cpp:.*", r".*"),
]
autodoc_member_order = "bysource"
default_role = "literal"  # A single pair of backticks in docstrings.
smartquotes = False
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
breathe_projects = {
    "rtpm": os.environ.get("RTPM_DOXYGEN_XML", str(TREE / "build/docs/doxygen/xml"))
}
breathe_default_project = "rtpm"
breathe_default_members = ("members",)
breathe_show_include = False
cpp_id_attributes = ["nodiscard"]

# ---- HTML ---------------------------------------------------------------------------------------
html_theme = "furo"
pygments_dark_style = "a11y-high-contrast-dark"
html_title = f"RTPM {version}"
html_static_path = ["_static"]
html_css_files = ["rtpm.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_extra_path = ["_extra"]
html_theme_options = {
    "navigation_with_keys": True,
    "light_css_variables": {
        "color-brand-primary": "#0b5cad",
        "color-brand-content": "#0b5cad",
        "font-stack": "system-ui, 'Liberation Sans', Arial, sans-serif",
        "font-stack--monospace": "'DejaVu Sans Mono', 'Liberation Mono', monospace",
    },
    "dark_css_variables": {
        "color-brand-primary": "#7db8f0",
        "color-brand-content": "#7db8f0",
    },
}
copybutton_exclude = ".linenos, .gp, .go"
linkcheck_timeout = 15
linkcheck_retries = 2
linkcheck_anchors = False
linkcheck_ignore = [r"http://(localhost|127\.0\.0\.1).*", r"rtpm://.*"]
