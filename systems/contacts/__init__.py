"""The response to contacts: which are at rest, how they are solved (``solving``), and the events of contacts.

Reads the contacts of the narrow phase and the state at the start of the step. Writes positions and velocities of bodies
in contact, the impulses kept for the next step, and contact events.
"""
