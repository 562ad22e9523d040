"""Compiled code: how kernels compile, when, and where their machine code is kept or comes from.

``dispatchers`` and ``pipeline`` compile; ``linking``, ``link_all`` and ``background`` say when; ``hash``, ``cache`` and
``prebuilt`` find what is compiled already; ``late`` keeps numba out of imports; ``records`` is what kernels work on.
``compilation.py``, one folder up, has the decorators.
"""
