"""Records of the broad phase: uniform grids, which stages use, and the tree, which Python drives."""

from __future__ import annotations

from ...framework.jit.records.schema import Schema, Section, flag, floats, integer, ints, number, table, vectors

# Places in ``state.frame``, apart by 3: one value per axis. The largest is the longest edge of any box of what moves.
LOWEST, HIGHEST, LARGEST_EXTENT = 0, 3, 6
FRAME_SIZE = 7

# A uniform grid of boxes, see :mod:`.uniform_grid`; one of what moves, one of what does not.
GRID_BOXES = Section(  # one entry per box
    "body", "broad phase, grid", "more bodies than are tested pair by pair",
    keys=ints("int32"),  # its cell
    order=ints("int32"),  # rows in the order of their cells
    cells=ints("int32"),  # these cells
    codes=ints(),  # the boxes in small integers
)  # fmt: skip
GRID_STATICS = Section(  # static grid alone: the rows in the grid with copies of their boxes
    "body", "broad phase, grid", "more bodies than are tested pair by pair",
    rows=ints("int32"),
    lower=vectors(unit="m"),
    upper=vectors(unit="m"),
)  # fmt: skip
GRID = Schema(
    "Grid", GRID_BOXES, GRID_STATICS,
    suits=flag(),  # the boxes are even enough for a grid, and these are in it
    serves=flag(),  # queries look into it
    version=integer(),  # ``state.version`` when it was built; static grid: ``state.statics_version``, -1: never
    first=integer(),  # the first row that moves; static grid: the first static row, of which the others are counted
    # cells are numbered x + y * row + z * layer, with one empty cell around the outermost
    inverse_cell=number(unit="1/m"),
    row=integer(),
    layer=integer(),
    total=integer(),
    frame=floats(unit="m"),  # extent of the boxes in the grid, as ``state.frame``
    scale=vectors(unit="1/m"),  # one row; integers of a code per metre
    directory=ints("int32"),  # where each cell begins in ``order``
    notes=table("int32", 4),  # what has to be tested, see uniform_grid.look_around
    longest=floats(unit="m"),  # static grid: the longest edges, ascending
    outside_count=integer(),
    outside=ints("int32"),  # rows that are not in the grid: static ones that are too long, moving ones that have left
)  # fmt: skip

# A loose quadtree or octree, see :mod:`.tree`. Columns named level_* have one row per level: level 0 is the finest, row
# ``levels`` the top level, row ``levels + 1`` the boxes that are in no level because they are empty or nan.
TREE = Schema(
    "Tree",
    count=integer(),  # boxes in the tree: those given, without empty and nan ones
    levels=integer(),  # the top level, whose only cell takes boxes of any size anywhere
    # the boxes to build it of: rows start..stop-1 of these columns, which belong to the caller
    start=integer(),
    stop=integer(),
    lower=vectors(unit="m"),
    upper=vectors(unit="m"),
    # cells of level 0
    finest_cell=number(unit="m"),  # 0 for a tree of one cell
    inverse_cell=number(unit="1/m"),
    origin=vectors(unit="m"),  # one row; m
    extent=vectors(unit="m"),  # one row; what the directory covers from there, m
    width=vectors(unit="1"),  # one row; the same in cells
    lowest=vectors(unit="1"),  # one row; the centres' bounds in cells from the origin, boxes of the top level aside
    highest=vectors(unit="1"),
    smallest_box=number(unit="m"),  # of the sample
    crowding=number(unit="1"),  # sum of squared numbers of boxes in a cell
    extremes=table("float64", 3),  # of the sample: the lowest values of each quantity and of its negative
    # levels
    level_base=ints(),  # first cell in the directory
    level_cells=ints(),
    level_shift=ints(),  # number of the cell at the origin
    level_stride=table("int64", 3),  # what a cell's number grows by per axis
    level_scale=floats(unit="1"),  # size of a cell of level 0 over that of this level; 0: top
    level_begin=ints(),  # in ``order``
    level_end=ints(),
    directory=ints("int32"),  # where each cell begins in ``order``
    # boxes, in the order of their cells; ``keys`` in the order of rows
    keys=ints("int32"),
    order=ints("int32"),  # rows
    cells=ints("int32"),
    # boxes[i, k] the lower corner, boxes[i, d + k] the upper one
    boxes=table("float64", 2, per_dimension=True, unit="m"),
    codes=ints(),  # boxes in small integers
    # pairs: owner, begin, end of what may overlap it
    range_count=integer(),
    range_middle=integer(),  # from here on ranges are of this tree, owned by boxes of the other
    candidates=integer(),
    ranges=table("int32", 3),
    next_range=integer(),
    chunk_owners=ints("int32"),
    chunk_members=ints("int32"),
    pair_count=integer(),
    first=ints("int32"),
    second=ints("int32"),
)
