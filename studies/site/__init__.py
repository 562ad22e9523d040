"""The site: ``make docs``, that is ``python -m studies.site``, builds docs/ as HTML into build/docs/site.

Everything happens in build/docs: :mod:`pages` copies the Markdown there and makes the navigation, Zensical builds it,
:mod:`reference` gives the API pages what the sources alone do not say, :mod:`check` looks at every link of the result.
"""
