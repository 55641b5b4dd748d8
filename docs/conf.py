# SPDX-License-Identifier: Apache-2.0
"""Sphinx settings of the site: `make site`. A broken link or a public name without text fails."""
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.util import logging

project = 'uav_task_alloc'
copyright = 'uav_task_alloc developers'
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx.ext.viewcode']
source_suffix = {'.md': 'markdown', '.rst': 'restructuredtext'}
myst_heading_anchors = 3
autodoc_member_order = 'bysource'
autodoc_typehints = 'description'
autodoc_default_options = {'members': True, 'undoc-members': True, 'show-inheritance': True}
html_theme_options = {'description': 'Tasks for several UAVs, as they arrive, around no-fly zones'}
CHECKED = ('module', 'function', 'class', 'exception', 'method', 'property')


def require_docstring(app: Sphinx, what: str, name: str, obj: object, options: object,
                      lines: list[str]) -> None:
    """Warn, which fails the build, where a public name has no docstring."""
    if what in CHECKED and not any(lines):
        logging.getLogger(__name__).warning('%s %s has no docstring', what, name)


def skip_imported(app: Sphinx, what: str, name: str, obj: object, skip: bool,
                  options: object) -> bool | None:
    """Leave out what a module has imported; None: as autodoc decides."""
    module = getattr(obj, '__module__', None)
    return True if module and not module.startswith('uav_task_alloc') else None


def link_readme(app: Sphinx, page: str, source: list[str]) -> None:
    """Point links to the README, which lies outside this folder, to the first page."""
    source[0] = source[0].replace('](../README.md', '](index.rst')


def setup(app: Sphinx) -> None:
    """Connect the checks."""
    app.connect('autodoc-process-docstring', require_docstring)
    app.connect('autodoc-skip-member', skip_imported)
    app.connect('source-read', link_readme)
    app.add_lexer('mermaid', TextLexer)
