"""What a stage returns: OK, or why the step cannot go on before Python has done something.

Below AFTERWARDS the stage runs again; the others have done their work, and the next stage follows.
"""

from __future__ import annotations

OK = 0
# More rows: ``state.needed`` says how many.
NEED_CANDIDATES, NEED_PAIRS, NEED_EVENTS, NEED_CONTACTS, NEED_SOLVER, NEED_WARM_START, NEED_CELLS = range(1, 8)
REFRESH_PAIRS = 8  # a body has left its search bounds: pairs for the rest of the step
NEED_MERGED, NEED_SWEEPS, NEED_ORDER = 9, 10, 13
NEED_COLUMNS = 14  # columns of the bodies that few scenes need: which ones follows from the stage, see room.COLUMNS_OF
NEED_IMPACTS = 15  # parts of it are not linked yet
NEED_STATIC_CELLS = 18  # rows of the grid of what does not move
NEED_OWN_ROWS = 19  # of records that a plugin's stage has
WAKE, WAKE_TOUCHED = 16, 17  # bodies that are marked as disturbed, before the broad phase and after the narrow one
RUN_BROAD, RUN_NARROW = 11, 12  # the phase before has not run: a phase is run alone, or its system was removed
AFTERWARDS = 32
FIND_IN_PYTHON = 33  # candidate pairs from a tree, or from the broad phase of a plugin
ROTATE = 34  # axes of rotated bodies
LOOK = 37  # code of the game may have changed what sleeps
CHECK_COLUMNS, CHECK_FLIGHT = 35, 36  # name bodies that cannot be right, and take them out, or in again
