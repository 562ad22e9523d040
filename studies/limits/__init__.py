"""Where carom fails: one quantity is increased until the error passes 1 % and 10 %, and until the simulation breaks.

:mod:`worlds` has the quantities, :mod:`search` finds where they pass a level, and shows it.
"""
