"""Projects of LDtk, made by code in the form of its JSON."""

from __future__ import annotations

import json

import numpy as np

GRID = 16


def field(name, kind, value):
    return {"__identifier": name, "__type": kind, "__value": value}


def entity(iid, kind, x, y, w=16, h=16, pivot=(0, 0), fields=(), uid=1, tile=None):
    return {
        "__identifier": kind, "__grid": [x // GRID, y // GRID], "__pivot": [*pivot], "__tags": [], "__tile": tile,
        "iid": iid, "width": w, "height": h, "defUid": uid, "px": [x, y], "fieldInstances": [*fields],
    }  # fmt: skip


def layer(kind, name, columns, rows, **fields):
    whole = {"__cWid": columns, "__cHei": rows, "__gridSize": GRID, "__opacity": 1, "__pxTotalOffsetX": 0}
    more = {"__pxTotalOffsetY": 0, "layerDefUid": 7, "visible": True, "__tilesetDefUid": 3, "intGridCsv": []}
    lists = {"autoLayerTiles": [], "gridTiles": [], "entityInstances": []}
    return {"__identifier": name, "__type": kind, **whole, **more, **lists, **fields}


def project(*levels, **fields):
    names = (None, "ice", "one_way", "Decoration", "Spring")
    values = [{"value": k, "identifier": name} for k, name in enumerate(names, 1)]
    modes = ("Rectangle", "Ellipse", "Cross", "Tile")
    defs = {
        "layers": [{"uid": 7, "intGridValues": values, "parallaxFactorX": 0, "parallaxFactorY": 0}],
        "entities": [{"uid": k + 1, "renderMode": mode} for k, mode in enumerate(modes)],
        "tilesets": [{"uid": 3, "relPath": "tiles.png", "tileGridSize": 16}],
    }
    return {"jsonVersion": "1.5.3", "defs": defs, "defaultGridSize": 16, "levels": [*levels], **fields}


def level(name, cells, *entities, **fields):
    rows, columns = np.shape(cells)
    tiles = [{"px": [16, 32], "src": [48, 16], "f": 3, "t": 7, "d": [], "a": 1}]
    layers = [
        layer("Entities", "Things", columns, rows, entityInstances=[*entities]),
        layer("IntGrid", "Ground", columns, rows, intGridCsv=np.ravel(cells).tolist(), autoLayerTiles=tiles),
    ]
    size = {"pxWid": columns * GRID, "pxHei": rows * GRID, "worldX": 0, "worldY": 0, "__bgColor": "#40465b"}
    return {"identifier": name, "iid": name, **size, "fieldInstances": [], "layerInstances": layers, **fields}


def write(path, node):
    path.write_text(json.dumps(node))
    return path


CELLS = np.array(((0, 0, 0, 0, 0, 0), (0, 3, 3, 0, 5, 0), (4, 0, 0, 0, 0, 0), (1, 1, 2, 2, 1, 1)))
