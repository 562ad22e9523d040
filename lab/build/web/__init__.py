"""A game as a page: what stands in its folder beside the library, and how it runs without a browser.

``index.html`` is a template (:class:`string.Template`: title, pyodide, module), ``loader.mjs`` starts Python on the
page and under node, ``run.mjs`` runs such a folder under node. A folder holds the first two and ``game.zip``: the game,
carom's sources with the library of platform wasm32, and esper.
"""
