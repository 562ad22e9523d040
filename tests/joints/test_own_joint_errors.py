"""Joints of plugins that are refused, and errors that name the joint and its entity."""

from __future__ import annotations

import math

import pytest
from joints.helpers_joints import at
from joints.helpers_machines import Gear, Pulley, body, machine_world, machines

from carom import Physics, Plugin, PluginError, StepError, Transform, World, column
from carom.framework.vectors import scale
from carom.plugins.joints import CUSTOM, HOLD, Distance, Joint, Joints, Row


def declared(returned):
    """A joint whose function returns that, registered."""

    def constraint(joint, a, b):
        return returned(a, b)

    fields = {"a": column(dtype=int), "b": column(dtype=int), "constraint": constraint, "__module__": __name__}
    return Plugin("wrong").joint(type("Wrong", (Joint,), fields))


@pytest.mark.plain
@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda a, b: 1.0, r"returned 1.0: return \(value, along_a"),
        (lambda a, b: (1.0, a.position), "or a tuple of such rows"),
        (lambda a, b: (1.0, a.position, (0.0,), a.position, a.position), r"turn_a.*\(in 2D a turn is \(turn, 0.0\)\)"),
        (lambda a, b: (math.nan, *(a.position,) * 4), "nan as value: return a number, or None"),
        (lambda a, b: (1.0 / a.position[0], *(a.position,) * 4), "raised ZeroDivisionError"),
    ],
)
def test_what_no_constraint_returns_is_refused_when_it_is_registered(returned, message):
    with pytest.raises(PluginError, match=f"plugin wrong: joint Wrong: constraint, tried in 2D, .*{message}"):
        declared(returned)


@pytest.mark.plain
def test_vectors_that_are_not_the_change_of_the_value_are_refused():
    """The height of an axis of b, which changes as b turns."""

    def height(factor):
        def row(a, b):
            axis, nothing = b.axes[0], scale(b.axes[0], 0.0)
            turn = (axis[0], 0.0) if len(axis) == 2 else (-axis[2], 0.0, axis[0])
            return axis[1], nothing, nothing, nothing, scale(turn, factor)

        return row

    assert issubclass(declared(height(1.0)), Joint)
    with pytest.raises(PluginError, match=r"2D, row 0: its value changes by -0.48, by its vectors -0.96: along_a"):
        declared(height(2.0))


def test_what_is_no_joint_is_refused():
    for thing, message in ((Transform, "derive a class from carom.plugins.joints.Joint"), (Distance, "no constraint")):
        with pytest.raises(PluginError, match=message):
            Plugin("wrong").joint(thing)
    with pytest.raises(ValueError, match=r"Gear does nothing without the plugin .* World\(.*, plugin\)"):
        World(Physics(), Joints()).create_entity(Gear(None, 1))
    with pytest.raises(ValueError, match=r"Gear does nothing without its plugin: World\(Physics\(...\), Joints\(\)\)"):
        World(Physics(), machines).create_entity(Gear(None, 1))


@pytest.mark.plain
def test_numbers_that_are_not_finite_name_joint_and_entity():
    world, _ = machine_world()
    a = body(world, (0, 0))
    pulley = Pulley(None, a, (1, 0), (0, 0))
    entity = world.create_entity(pulley)
    with pytest.raises(ValueError, match=f"entity {entity}: Pulley: where it takes hold .* not finite"):
        world.step()
    pulley.wheel_b = (0, 2)
    world.step()
    before = world.state_hash()
    pulley.wheel_b = at(world, a).position
    with pytest.raises(StepError, match=f"plugin machines: constraint of Pulley, entity {entity}: .* not finite"):
        world.step()
    assert world.state_hash() == before


@pytest.mark.plain
def test_rows_of_a_part_that_there_is_not_are_refused():
    class Half(Joint):
        a: int | None = column(dtype=int)
        b: int | None = column(dtype=int)

        @staticmethod
        def constraint(joint, a, b):
            return (None, *(scale(a.position, 0.0),) * 4)

        def rows(self, dimensions):
            return [Row(CUSTOM, HOLD, part=1)]

    half = Plugin("half")
    half.joint(Half)
    world, _ = machine_world()
    world.add_plugin(half)
    world.create_entity(Half(body(world, (0, 0)), body(world, (1, 0))))
    with pytest.raises(ValueError, match="speak of part 1, but its constraint returns 1"):
        world.step()
