"""Settings of Sphinx for the site of the docs; `make site` runs it."""

from __future__ import annotations

from importlib.metadata import version as installed_version

project = "ldcs_ros"
author = "the authors of ldcs_ros"
release = version = installed_version("ldcs_ros")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
source_suffix = {".md": "markdown"}
html_theme = "furo"
html_title = "ldcs_ros"
html_copy_source = False
html_show_copyright = False

# Headings become anchors as on a git host, so that one link works in both places.
myst_heading_anchors = 4
# Markdown highlights `console` for indented blocks on a git host; here no language is guessed.
highlight_language = "none"

# Docstrings are plain sentences with names in single backquotes.
default_role = "code"
napoleon_use_ivar = True
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
# ROS and the viewer are no part of what builds the site.
autodoc_mock_imports = ["rclpy", "rerun"]
