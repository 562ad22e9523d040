"""How good the states of an engine are: energy, overlaps, gaps of hinges, bodies that escaped, how far piles sank."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from carom.framework import Settings, World
from carom.plugins.joints import KINDS, Hinge

from .engines import State, moving_rows
from .plain import Floats, bodies_of, joints_of

PROBED = Settings(dt=1e-9)  # a step in which nothing moves


class Quality:
    """One measure for every engine: its states are laid into a world of carom in which all shapes are sensors, which
    report contacts and push nothing. build: makes the scene, at its start."""

    def __init__(self, build: Callable[[Settings], World]) -> None:
        self.probe = build(PROBED)
        bodies = [body for body in bodies_of(self.probe) if body.kind != "static"]
        self.mass, self.moment, angle = np.array([(body.mass, body.moment, body.angle) for body in bodies]).T
        self.start = np.array([body.position for body in bodies])
        places = self.probe.bodies.position
        self.lower, self.upper = places.min(axis=0), places.max(axis=0)
        joints = joints_of(self.probe)
        apart = [sorted((joint.a or 0, joint.b or 0)) for joint in joints if not joint.collide_connected]
        self.apart = {tuple(pair) for pair in apart}
        hinges = [joint for joint in joints if isinstance(joint, Hinge)]
        rows: dict[int | None, int] = {body.entity: row for row, body in enumerate(bodies)}
        sides = [[rows.get(entity, len(bodies)) for entity in (joint.a, joint.b)] for joint in hinges]
        self.rows = np.array(sides, int).reshape(-1, 2)  # of what does not move: one more row, for the world
        position, axes = self._placed(self.start, angle)
        anchors = np.array([joint.anchor for joint in hinges]).reshape(-1, 1, 2)
        self.arms = np.einsum("ksij,ksi->ksj", axes, anchors - position)
        for kind in KINDS:
            for entity, _ in list(self.probe.get_component(kind)):
                self.probe.delete_entity(entity)
        self.probe.bodies.linear_velocity[:] = 0.0
        for name in self.probe.bodies.column_names():
            if name.endswith(".sensor"):
                getattr(self.probe.bodies, name.partition(".")[0]).sensor[:] = True

    def _placed(self, position: Floats, angle: Floats) -> tuple[Floats, Floats]:
        """(k, 2, 2) and (k, 2, 2, 2): the positions and the axes, in columns, of both bodies of each hinge."""
        position, angle = np.vstack([position, np.zeros(2)])[self.rows], np.append(angle, 0.0)[self.rows]
        cosine, sine = np.cos(angle), np.sin(angle)
        return position, np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)

    def overlaps(self, state: State) -> Floats:
        """(k,) m, how deep pairs of bodies are in each other, of which one moves freely."""
        bodies, rows = self.probe.bodies, moving_rows(self.probe)
        bodies.position[rows] = state.position
        if state.angle.any():
            bodies.rotation[rows] = state.angle
        self.probe.step()
        contacts, free = self.probe.contacts, bodies.dynamic.entity
        of_free = np.isin(contacts.entity_a, free) | np.isin(contacts.entity_b, free)
        pairs = zip(contacts.entity_a.tolist(), contacts.entity_b.tolist(), strict=True)
        meet = np.array([pair not in self.apart for pair in pairs], bool)
        return np.asarray(contacts.depth)[of_free & meet & (contacts.depth > 0.0)]

    def figures(self, state: State) -> dict[str, float]:
        """``energy``: kinetic, J; ``gap``: of the worst hinge, m; ``sinks``: how far a body is below its start at most,
        m; ``escaped``: bodies outside the places that all had at the start."""
        inside = (state.position >= self.lower) & (state.position <= self.upper)  # false for NaN
        free, turns = np.isfinite(self.mass), np.isfinite(self.moment)
        energy = self.mass[free] @ (state.velocity[free] ** 2).sum(axis=1) + self.moment[turns] @ state.spin[turns] ** 2
        position, axes = self._placed(state.position, state.angle)
        ends = position + np.einsum("ksij,ksj->ksi", axes, self.arms)
        return {
            "energy": 0.5 * float(energy),
            "gap": float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0)),
            "sinks": float((self.start - state.position)[:, 1].max(initial=0.0)),
            "escaped": float((~inside.all(axis=1)).sum()),
        }
