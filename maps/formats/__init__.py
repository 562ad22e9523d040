"""Files of editors as plain data: ``tiled`` and ``ldtk`` read what ``reading`` makes of XML and JSON into ``model``.

Nothing here knows worlds; lengths are pixels, y is down.
"""
