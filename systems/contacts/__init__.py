"""The response to contacts: impacts at their times, then contacts at rest, then the events of contacts.

Reads the manifolds of the narrow phase, the path of the step and the state at its start. Writes positions and
velocities of bodies in contact, the impulses for the next step, and contact events. ``response.py`` has the stages:

1. ``begin_response``, ``predict_rest``: where the paths begin; what rested is held in the prediction too.
2. ``resolve_impacts`` (``systems/impacts``): impacts at their time.
3. ``find_resting``: pairs that are near and do not bounce are contacts at rest.
4. ``gather``, ``linearise``, ``match_warm_start``: their bodies and rows, the plane of each where the step starts, and
   the impulses of the last step.
5. ``solve_contacts``: the solver, see ``solving``.
6. ``put_back``, ``resolve_static_penetration``: results to the bodies; what was pushed into something fixed is put
   back.
7. ``store_warm_start``, ``find_touching``, ``publish_contacts``: impulses and contacts that the next step and the game
   read.

``constants.py`` has all constants of the solver, each with unit and reason.
"""
