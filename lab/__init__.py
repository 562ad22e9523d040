"""carom.lab: the ``carom`` command: running scenes, measuring them, drawing them."""
