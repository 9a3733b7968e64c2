"""Sphinx's settings; `build.py` prepares the folder that it reads."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import gallery
import mathml

import elevon

project = "Elevon"
author = "The Elevon developers"
copyright = "The Elevon developers, Apache-2.0"  # noqa: A001 - Sphinx's name
version = release = elevon.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_examples/**", "examples/gallery/**.ipynb", "**/sg_execution_times.rst"]
exclude_patterns += ["sg_execution_times.rst", "images/README.md"]
highlight_language = "none"
default_role = "code"
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
suppress_warnings = ["config.cache"]

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

sphinx_gallery_conf = {
    "examples_dirs": [str(HERE.parents[1] / "out" / "site" / "_examples")],
    "gallery_dirs": ["examples/gallery"],
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"__",
    "image_scrapers": (gallery.pictures,),
    "reset_modules": (),
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "min_reported_time": 1_000_000,
    "plot_gallery": "True",
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
}

html_theme = "pydata_sphinx_theme"
html_title = "Elevon"
html_static_path = [str(HERE / "static")]
html_css_files = ["elevon.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "Elevon"},
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
    "navigation_with_keys": False,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}


def each_by_itself(_app, _what, _name, _thing, _options, lines):
    """Write `a, b : float` as two entries: under Attributes napoleon takes it for one."""
    if "Attributes" not in lines:
        return
    start = lines.index("Attributes")
    found, index = lines[:start], start
    while index < len(lines):
        end = index + 1
        while end < len(lines) and lines[end].startswith("    "):
            end += 1
        several = re.fullmatch(r"(\w+(?:, \w+)+) : (.*)", lines[index])
        heads = (
            [f"{n} : {several[2]}" for n in several[1].split(", ")] if several else [lines[index]]
        )
        for head in heads:
            found += [head, *lines[index + 1 : end]]
        index = end
    lines[:] = found


def setup(app):
    """Formulas as MathML: they need no script and no network, and are read aloud."""
    app.connect("autodoc-process-docstring", each_by_itself, priority=400)
    app.add_html_math_renderer(
        "mathml", inline_renderers=(mathml.inline, None), block_renderers=(mathml.block, None)
    )
