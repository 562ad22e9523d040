"""What turns bodies within an integrator of several stages, where force systems give torques: the record that the stage
of a plugin works on, and what it is to do beside which stage of an integrator."""

from __future__ import annotations

from ...framework.jit.records.schema import Schema, flag, flags, floats, integer, table

ROTATION_DRIFT, ROTATION_KICK, RUNGE_KUTTA = 1, 2, 3
ROTATION_STAGES = {
    "verlet_drift": ROTATION_DRIFT, "first_half_kick": ROTATION_DRIFT,
    "verlet_kick": ROTATION_KICK, "second_half_kick": ROTATION_KICK,
    "runge_kutta_stage": RUNGE_KUTTA,
}  # fmt: skip
# part: of these; begins: it is the first of the step; within: bodies turn with these parts; torque: of force systems,
# N m, one or three numbers for each row, no rows where no force system has a Spin in what it requires; lifting: of
# stages of plugins, three numbers, no rows where there is no such stage beside sum_forces. The others have
# three numbers, of which a plane uses the first: what the step began with, torque and momentum at the start of the
# part, sums of RK4; and whether torques have changed within the step, and a body turns fast.
TURNS = Schema(
    "Turns", part=integer(), begins=flag(), within=flag(), torque=floats(unit="N m"),
    lifting=table("float64", 3, unit="N m"),
    start_rotation=table("float64", 4, unit="rad or 1"), start_spin=table("float64", 3, unit="rad/s"),
    pushed=table("float64", 3, unit="rad/s"), gained=floats(unit="rad/s"), changed=flags(), fast=flags(),
    turned=table("float64", 3), momentum=table("float64", 3), middle=table("float64", 3), speeds=table("float64", 3),
    kicks=table("float64", 3),
)  # fmt: skip
ROTATION_COLUMNS = tuple(name for name in TURNS.fields if name not in ("part", "begins", "within", "torque", "lifting"))
