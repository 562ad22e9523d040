"""The record of a batch of queries: what is asked, what is found, and the memory of the kernels."""

from __future__ import annotations

from ...framework.jit.records.schema import Schema, Section, flag, floats, integer, ints, number, vectors
from ..shapes.query import QUERY

# Queries are rows 0..m-1. Overlaps and neighbours write any number of hits per query, those of query q before
# ``end[q]``. So does a cast of one shape for all that it meets. Nearest surfaces and first hits are in row q.
QUERIES = Section(
    centre=vectors(unit="m"),
    half=vectors(unit="m"),  # overlaps: half extents
    direction=vectors(unit="1"),  # casts: unit vector, 0 if the shape does not move
    limit=floats(unit="m"),  # how far to look
    search_limit=floats(unit="m"),  # of a cast: limit, or distance of the nearest hit so far
    mask=ints(),  # layers to look for
    layer=ints(),  # of a collider that asks, as its group
    group=ints(),
    body=ints(),  # neighbours: the row of the body itself
    end=ints(),
)
RESULTS = Section(
    row=ints(),  # -1: nothing found
    entity=ints(),
    distance=floats(unit="m"),
    fraction=floats(unit="1"),
    normal=vectors(unit="1"),
    point=vectors(unit="m"),
)
QUERY_BATCH = Schema(
    "QueryBatch",
    QUERIES,
    RESULTS,
    query=QUERY,  # functions and parameters of the query shape
    # options, for all queries
    excluded=ints(),  # entities to leave out, ``excluded_count`` for each query; -1: none
    excluded_count=integer(),
    one_way=flag(),  # overlaps: also with what is solid from one side only
    selects=flag(),  # some have a layer that is looked for, and are not wanted all the same
    only_nearest=flag(),  # casts
    against=flag(),  # only what opposes the motion
    is_ray=flag(),
    radius=number(unit="m"),  # neighbours, m
    # memory of a cast
    hit_count=integer(),
    slice_level=ints(),  # levels of the tree in use
    slice_begin=floats(unit="m"),  # and where the next slice of each begins, m
)
