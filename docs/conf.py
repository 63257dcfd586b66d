"""How the manual is built: ``make docs``. Nothing is fetched, to build it or to read it."""

import sys
from pathlib import Path

import uavrt

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "uavrt"
author = "The uavrt authors"
copyright = "The uavrt authors, Apache-2.0"
version = release = uavrt.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "notebook",  # docs/_ext: notebooks with their stored outputs, without Jupyter
    "mathml",  # docs/_ext: equations as MathML, because MathJax is fetched from a host
    "settings",  # docs/_ext: uavrt.toml from the code
    "ros_graph",  # docs/_ext: the ROS 2 topics from the code
]
exclude_patterns = ["_build", "_ext"]

myst_enable_extensions = ["deflist", "dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3

# `name` in a docstring is a link where there is something to link to, and code otherwise.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = "uavrt"
html_static_path = ["_static"]
html_css_files = ["uavrt.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navigation_with_keys": True,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
