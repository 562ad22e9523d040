"""Compiled code: how kernels compile, when, and where their machine code is kept or comes from.

``dispatchers`` and ``pipeline`` compile; ``linking``, ``link_all`` and ``background`` say when; ``hash``, ``names``,
``cache`` and ``libraries`` find what is compiled already; ``lazy`` keeps numba out of imports, ``kinds`` out of
signatures; ``records`` is what kernels work on.
``compilation.py``, one folder up, has the decorators.
"""
