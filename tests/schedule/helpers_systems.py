"""Systems and plain processors that record their calls, of several types and phases."""

from __future__ import annotations

import esper

from carom.framework import System


class Note(System):
    """Writes its label into a log."""

    def __init__(self, log=None, label=""):
        self.log, self.label = [] if log is None else log, label

    def process(self, dt):
        self.log.append(self.label)


class PlainNote(esper.Processor):
    def __init__(self, log, label):
        self.log, self.label = log, label

    def process(self, dt):
        self.log.append(self.label)


class A(Note):
    pass


class B(Note):
    pass


class C(Note):
    pass


def in_phase(base, phase, **attributes):
    return type(base.__name__, (base,), {"phase": phase, **attributes})
