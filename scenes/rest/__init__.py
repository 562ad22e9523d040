"""Rest: bodies under gravity that come to rest on each other, or must stay as they are.

Piles in a bin, a pyramid and a tower. They show the solver of contacts: no sinking, no shaking, no drift.
"""
