"""The site of the documents, built by `make site`."""

import sys
from pathlib import Path

import cspr_jax

sys.path.insert(0, str(Path(__file__).parent))

project = "cspr_jax"
author = "the authors of cspr_jax"
release = version = cspr_jax.__version__
extensions = ["myst_nb"]
exclude_patterns = ["examples"]
html_theme = "furo"
html_title = "cspr_jax"
html_static_path = ["static"]
html_css_files = ["site.css"]
# Notebooks are shown as they ran; `make gallery` runs them.
nb_execution_mode = "off"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
highlight_language = "none"  # of blocks that name no language, such as formulas
suppress_warnings = ["mystnb.unknown_mime_type"]


def setup(app):
    """Write the pages that are built; show formulas as MathML, which browsers draw themselves without a network."""
    import build_pages
    from docutils.nodes import SkipNode
    from docutils.utils.math.latex2mathml import tex2mathml

    build_pages.write()

    def formula(*, block):
        def visit(writer, node):
            markup = tex2mathml(node.astext(), as_block=block)
            writer.body.append(f'<div style="overflow: auto hidden">{markup}</div>\n' if block else markup)
            raise SkipNode

        return visit, None

    app.add_html_math_renderer("mathml", formula(block=False), formula(block=True))


html_math_renderer = "mathml"
