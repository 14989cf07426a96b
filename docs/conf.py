"""The site of the documents, built by `make site`."""

import cspr_jax

project = "cspr_jax"
author = "the authors of cspr_jax"
release = version = cspr_jax.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["examples", "_build"]
html_theme = "furo"
html_title = "cspr_jax"
# Notebooks are shown as they ran; `make gallery` runs them.
nb_execution_mode = "off"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
# Names of types and errors in docstrings are words: what is linked is pages, sections and functions.
nitpick_ignore_regex = [("py:(exc|class|obj)", ".*")]
suppress_warnings = ["mystnb.unknown_mime_type"]
# Shapes, units and errors are in the docstrings; types in the signatures.
napoleon_google_docstring = True
napoleon_custom_sections = [("Fields", "params_style")]
autodoc_typehints = "none"
autodoc_member_order = "bysource"


def setup(app):
    """Formulas as MathML, which browsers draw themselves: the pages need no network."""
    from docutils.nodes import SkipNode
    from docutils.utils.math.latex2mathml import tex2mathml

    def formula(*, block):
        def visit(writer, node):
            markup = tex2mathml(node.astext(), as_block=block)
            writer.body.append(f'<div class="math">{markup}</div>\n' if block else markup)
            raise SkipNode

        return visit, None

    app.add_html_math_renderer("mathml", formula(block=False), formula(block=True))


html_math_renderer = "mathml"
