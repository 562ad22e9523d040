"""A game as a page: what stands in its folder beside ``game.zip`` and ``page.json``, see :mod:`..page`.

``loader.mjs`` starts Python in WebAssembly, in a browser (``index.html``) and under node (``run.mjs``), where it calls
``carom_page.py``.
"""
