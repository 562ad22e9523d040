"""Stages of plugins in a step.

``placement`` checks where they may run and puts them between the built-in stages, ``plugin_stages`` follows for one
world which plugins and columns there are. Reads the registry and the list of stages; writes ``state.plugin_stages``,
and makes the columns that the stages name.
"""
