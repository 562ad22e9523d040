"""The tools of a window: the hand that picks and drags, the panel, words, milliseconds, the way back in time, and what
compiles beside the window. None of them opens a window itself.
"""
