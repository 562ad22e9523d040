"""Studies that measure what the tables and charts of carom's docs show: ``python -m studies NAME`` in a clone.

Beside them two tools of a clone: :mod:`studies.site` builds the site, :mod:`studies.release` makes a release.

A study is a table of axes (:mod:`studies.runner`) and a report. ``make figures`` runs those that fill docs/tables. They
are not installed, and nothing that is installed imports them.
"""
