"""Joints in the solver: ``bodies`` finds those that take part and where they hold, ``rows`` solves them, ``given`` and
``linked`` are what a plugin's joint says. The kinds of joints are plugins, see plugins/joints."""
