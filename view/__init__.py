"""A window on a world: it is shown, stopped, taken apart, and recorded."""
