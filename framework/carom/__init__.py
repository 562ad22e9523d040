"""carom: a physics framework for games on the esper entity-component-system.

The parts live in sub-packages: :mod:`carom.framework` (World, Settings, systems, registry),
:mod:`carom.components`, :mod:`carom.systems`, :mod:`carom.plugins`, :mod:`carom.scenes` and
:mod:`carom.lab` (command line and measuring). This package itself stays bare.
"""

__version__ = "0.1.0"
