"""Settings of Sphinx: pages are Markdown (MyST), and a warning fails the build (`make docs`)."""

project = "touchstone"
author = "the authors of touchstone"
project_copyright = "the authors of touchstone"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
myst_heading_anchors = 4
html_theme = "furo"
html_title = "touchstone"
