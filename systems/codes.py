"""What a stage returns: OK, or why the step cannot go on before Python has done something.

Below AFTERWARDS the stage runs again; the others have done their work, and the next stage follows.
"""

from __future__ import annotations

from ..framework.schedule.stages import NEED_ROOM as NEED_ROOM  # more rows, as ``Stage.room`` says

OK = 0
NEED_SWEEPS = 2
NEED_IMPACTS = 3  # parts of it are not linked yet
REFRESH_PAIRS = 4  # a body has left its search bounds: pairs for the rest of the step
RUN_BROAD, RUN_NARROW = 5, 6  # the phase before has not run: a phase is run alone, or its system was removed
WAKE, WAKE_TOUCHED = 7, 8  # bodies that are marked as disturbed, before the broad phase and after the narrow one
NEED_TOGETHER = 9  # what several impacts at one time need is not linked yet
AFTERWARDS = 32
FIND_IN_PYTHON = 33  # candidate pairs from a tree, or from the broad phase of a plugin
ROTATE = 34  # axes of rotated bodies
CHECK_COLUMNS, CHECK_FLIGHT = 35, 36  # name bodies that cannot be right, and take them out, or in again
LOOK = 37  # code of the game may have changed what sleeps
INDEX = 38  # grids and trees of where the bodies are now
NEED_REST = 39  # contacts at rest were not expected, and what they need is not linked yet
FAULTS = 40  # to be told; where code of the game runs in the step events are told with them
