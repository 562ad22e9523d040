"""What stops a build."""


class BuildError(RuntimeError):
    """A library cannot be built: the message says what is missing, in one sentence."""
