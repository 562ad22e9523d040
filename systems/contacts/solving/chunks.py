"""Many rows at once, where bodies spin.

A chunk is some pairs of which no two share a body that moves: in any order they do the same. What their rows need of
the bodies is brought side by side, so that one instruction works on several rows, and taken back after all points of
the pairs are solved.
"""

from __future__ import annotations

from ....framework.compilation import inlined, part
from ....framework.jit.records.schema import Schema, floats, vectors
from ....framework.jit.records.stack_record import stack_record
from ....framework.vectors import add, add_scaled, dot, scale, sub
from ...integration.turning import cross_spin, end_of_turn, symmetric, twist
from ...linking.parts import FOURS, call_fours
from .records import ROW_CHUNK
from .rows import ARMS, NO_ARMS, pull_along_surface, update_targets

SEVERAL = 1.0 + 1e-9  # times the masses that two points of a pair move: they are solved at once even if they are one

# What the rows of a chunk need of the bodies of its pairs.
CHUNK = Schema(
    "Chunk",
    unshared=True,
    velocity_a=vectors(apart=True, unit="m/s"),
    velocity_b=vectors(apart=True, unit="m/s"),
    spin_a=vectors(apart=True, flat=1, unit="rad/s"),
    spin_b=vectors(apart=True, flat=1, unit="rad/s"),
    impulse=floats(unit="N s"),  # at two points
    other=floats(unit="N s"),
    pull=vectors(apart=True, unit="N s"),  # along the surface at these
    other_pull=vectors(apart=True, unit="N s"),
    third_pull=vectors(apart=True, unit="N s"),
    fourth_pull=vectors(apart=True, unit="N s"),
    way=vectors(apart=True, unit="m"),  # of the second body since the step began, as the first one sees it
    turn_a=vectors(apart=True, flat=1, unit="rad"),
    turn_b=vectors(apart=True, flat=1, unit="rad"),
    sine_a=floats(unit="1"),  # shares of these, see shares_of_turn
    sine_b=floats(unit="1"),
    versine_a=floats(unit="1"),
    versine_b=floats(unit="1"),
)
make_chunk = stack_record(CHUNK, ROW_CHUNK)


@inlined
def chunk_of(solver):
    """Room for a chunk."""
    return make_chunk(scale(solver.velocity[0], 0.0))


@part
def find_chunks(solver, span):
    """The first chunk of a range, behind those of the one before."""
    c = solver.first_chunk if span[0] > 0 else 0
    while c < solver.chunks and solver.ends[c] <= span[0]:
        c += 1
    solver.first_chunk = c


@part
def load_masses(solver, span):
    """The masses of the bodies of the pairs of a range."""
    start, c = span[0], solver.first_chunk
    inverse_mass, inertia, products = solver.inverse_mass, solver.inverse_inertia, solver.inverse_products
    while start < span[1]:
        stop = solver.ends[c]
        for k in range(start, start + (stop - start) // solver.points[c]):
            a, b = solver.first[k], solver.second[k]
            solver.mass_a[k], solver.mass_b[k] = inverse_mass[a], inverse_mass[b]
            solver.inertia_a[k], solver.products_a[k] = inertia[a], products[a]
            solver.inertia_b[k], solver.products_b[k] = inertia[b], products[b]
        start, c = stop, c + 1


@inlined
def gather_motion(solver, chunk, start, pairs):
    """Bring the velocities of the bodies to the pairs of a chunk."""
    for q in range(pairs):
        a, b = solver.first[start + q], solver.second[start + q]
        store_motion(chunk, q, (solver.velocity[a], solver.spin[a], solver.velocity[b], solver.spin[b]))


@inlined
def gather_places(solver, chunk, start, pairs):
    """Bring what the bodies have moved and turned to the pairs of a chunk."""
    for q in range(pairs):
        a, b = solver.first[start + q], solver.second[start + q]
        chunk.way[q] = sub(solver.shift[b], solver.shift[a])
        chunk.turn_a[q], chunk.sine_a[q], chunk.versine_a[q] = solver.turn[a], solver.sine[a], solver.versine[a]
        chunk.turn_b[q], chunk.sine_b[q], chunk.versine_b[q] = solver.turn[b], solver.sine[b], solver.versine[b]


@inlined
def scatter_motion(solver, chunk, start, pairs):
    """Take them back to those that move."""
    for q in range(pairs):
        k, (v_a, s_a, v_b, s_b) = start + q, chunk_motion(chunk, q)
        if solver.mass_a[k] > 0.0:
            a = solver.first[k]
            solver.velocity[a], solver.spin[a] = v_a, s_a
        if solver.mass_b[k] > 0.0:
            b = solver.second[k]
            solver.velocity[b], solver.spin[b] = v_b, s_b


@inlined
def chunk_motion(chunk, q):
    """Velocities and spins of the bodies of pair q."""
    return chunk.velocity_a[q], chunk.spin_a[q], chunk.velocity_b[q], chunk.spin_b[q]


@inlined
def store_motion(chunk, q, motion):
    v_a, s_a, v_b, s_b = motion
    chunk.velocity_a[q], chunk.spin_a[q], chunk.velocity_b[q], chunk.spin_b[q] = v_a, s_a, v_b, s_b


@inlined
def parting_at(motion, arm_a, arm_b):
    """The velocity of the second body at a point, as the first one sees it there."""
    v_a, s_a, v_b, s_b = motion
    return sub(add(v_b, cross_spin(s_b, arm_b)), add(v_a, cross_spin(s_a, arm_a)))


@inlined
def spun(solver, k, torque_a, torque_b):
    """What torques change the spins of the bodies of the pair whose first row is k."""
    return (
        symmetric(solver.inertia_a[k], solver.products_a[k], torque_a),
        symmetric(solver.inertia_b[k], solver.products_b[k], torque_b),
    )


@inlined
def pushed(solver, k, motion, arm_a, arm_b, push):
    """The motion of the pair whose first row is k after an impulse at a point."""
    (v_a, s_a, v_b, s_b), (x_a, x_b) = motion, spun(solver, k, twist(arm_a, push), twist(arm_b, push))
    v_a, v_b = add_scaled(v_a, push, -solver.mass_a[k]), add_scaled(v_b, push, solver.mass_b[k])
    return v_a, sub(s_a, x_a), v_b, add(s_b, x_b)


@inlined
def softness(solver, k):
    """The share of its impulse that row k gives back in a pass that pushes: none where it is open."""
    return solver.soft[k] if solver.soft[k] > 0.0 else 0.0


@inlined
def terms_at(solver, one, k, motion, bias, softly):
    """Of row k of the pair whose first row is ``one``: (normal, what an impulse of 1 along it twists of each body, how
    that changes their spins, 1 / kg that it moves, what a soft row keeps, how much faster than it may it closes)."""
    n, (v_a, s_a, v_b, s_b), soft = solver.normal[k], motion, softly * softness(solver, k)
    t_a, t_b = twist(solver.arm_a[k], n), twist(solver.arm_b[k], n)
    x_a, x_b = spun(solver, one, t_a, t_b)
    own = SEVERAL * (solver.mass_a[one] + solver.mass_b[one] + (dot(t_a, x_a) + dot(t_b, x_b)))
    excess = dot(sub(v_a, v_b), n) + (dot(s_a, t_a) - dot(s_b, t_b)) - bias[k]
    keep = 1.0 - soft  # it gives a share of its impulse back: all of its equation times what it keeps
    return n, t_a, t_b, x_a, x_b, own, keep, keep * excess - soft * own * solver.impulse[k]


@inlined
def pull_at(solver, k, motion, old, share, push, runs):
    """The impulse along the surface at row k that stops a share of what slides there, where it is ``old`` so far, and
    the row pushes so much. runs: ARMS if some surface does, else NO_ARMS; two variants, as one with a branch would not
    solve several pairs together."""
    slip = parting_at(motion, solver.arm_a[k], solver.arm_b[k])
    if len(runs) > 0:
        slip = add(slip, solver.surface_slip[k])
    return pull_along_surface(old, slip, solver.normal[k], share * solver.tangent_mass[k], solver.friction[k] * push)


@inlined
def pulled(solver, one, k, motion, pull):
    """The motion with that impulse in place of the one so far, of the pair whose first row is ``one``."""
    return pushed(solver, one, motion, solver.arm_a[k], solver.arm_b[k], sub(pull, solver.tangent[k]))


@inlined
def rub_at(solver, one, k, motion, runs):
    """The motion after the impulse along the surface at row k, of the pair whose first row is ``one``."""
    pull = pull_at(solver, k, motion, solver.tangent[k], 1.0, solver.impulse[k], runs)
    motion = pulled(solver, one, k, motion, pull)
    solver.tangent[k] = pull
    return motion


@inlined
def rub_two(solver, k, m, motion, p, q, runs):
    """(motion, impulses) after the friction of two points k and m of a pair in a plane, which push by p and q. What
    slides at one slides at the other: they share the impulse as they share the load, both at once, so that neither is
    the first. Else what stands on both would rock on, and creep to one side."""
    both, first = add(solver.tangent[k], solver.tangent[m]), p / (p + q) if p + q > 0.0 else 0.5
    second = 1.0 - first
    pull = pull_at(solver, k, motion, scale(both, first), first, p, runs)
    other = pull_at(solver, m, motion, scale(both, second), second, q, runs)
    return pulled(solver, k, m, pulled(solver, k, k, motion, pull), other), pull, other


@inlined
def solve_two(solver, one, k, m, motion, bias, softly):
    """(motion, impulses) after two points k and m of the pair whose first row is ``one`` have been solved along their
    normals both at once, so that neither is the first: what falls flat stays so.

    With impulses p, q the points may close no faster than they may, and do so as fast where they push: of the four
    cases, each of the two pushes or not, one is right.
    """
    n, t_a, t_b, x_a, x_b, own, keep, e = terms_at(solver, one, k, motion, bias, softly)
    o, _, _, y_a, y_b, other, keeps, f = terms_at(solver, one, m, motion, bias, softly)
    w_a, w_b, old, before = solver.mass_a[one], solver.mass_b[one], solver.impulse[k], solver.impulse[m]
    mixed = (w_a + w_b) * dot(n, o) + (dot(t_a, y_a) + dot(t_b, y_b))
    on_first, on_second = keep * mixed, keeps * mixed
    share = 1.0 / (own * other - on_first * on_second)
    p, q = old + share * (other * e - on_first * f), before + share * (own * f - on_second * e)
    alone, single = old + solver.mass[k] * (e + on_first * before), before + solver.mass[m] * (f + on_second * old)
    alone, single = alone if alone > 0.0 else 0.0, single if single > 0.0 else 0.0
    if_first, if_second = 0.0 if q > 0.0 else alone, 0.0 if p > 0.0 else single
    both = (p > 0.0) & (q > 0.0)
    p, q = p if both else if_first, q if both else if_second
    more, less, (v_a, s_a, v_b, s_b) = p - old, q - before, motion
    push = add(scale(n, more), scale(o, less))
    s_a, s_b = sub(s_a, add(scale(x_a, more), scale(y_a, less))), add(s_b, add(scale(x_b, more), scale(y_b, less)))
    return (add_scaled(v_a, push, -w_a), s_a, add_scaled(v_b, push, w_b), s_b), p, q


@inlined
def solve_one(solver, one, motion, bias, softly, runs):
    """The only point of a pair, along its normal, then along its surface."""
    n, arm_a, arm_b, old = solver.normal[one], solver.arm_a[one], solver.arm_b[one], solver.impulse[one]
    excess = solver.mass[one] * (-dot(parting_at(motion, arm_a, arm_b), n) - bias[one])
    excess -= softly * softness(solver, one) * (excess + old)
    new = old + excess if old + excess > 0.0 else 0.0
    solver.impulse[one] = new
    return rub_at(solver, one, one, pushed(solver, one, motion, arm_a, arm_b, scale(n, new - old)), runs)


@part
def solve_rows(solver, chunk, bias, softly, start, pairs, layout, runs):
    """The rows of some pairs of a chunk, of one point, or of two in a plane. layout: (points of each pair, rows
    from one of these to the next); runs: see ``pull_at``."""
    if layout[0] == 1:
        for q in range(pairs):
            store_motion(chunk, q, solve_one(solver, start + q, chunk_motion(chunk, q), bias, softly, runs))
        return
    for q in range(pairs):  # it stores nothing where it reads: else no two pairs would be solved together
        k, m = start + q, start + layout[1] + q
        motion, p, o = solve_two(solver, k, k, m, chunk_motion(chunk, q), bias, softly)
        motion, chunk.pull[q], chunk.other_pull[q] = rub_two(solver, k, m, motion, p, o, runs)
        chunk.impulse[q], chunk.other[q] = p, o
        store_motion(chunk, q, motion)
    for q in range(pairs):
        k, m = start + q, start + layout[1] + q
        solver.impulse[k], solver.impulse[m] = chunk.impulse[q], chunk.other[q]
        solver.tangent[k], solver.tangent[m] = chunk.pull[q], chunk.other_pull[q]


@inlined
def solve_pairs(solver, chunk, bias, softly, start, pairs, layout):
    """The same, and the velocities of the bodies are brought before and taken back; those of four points are
    solved in ``fours``."""
    if layout[0] > 2:
        call_fours(solver.addresses[FOURS], solver, softly > 0.0, (start, pairs, layout[1]))
        return
    gather_motion(solver, chunk, start, pairs)
    if solver.surfaces_run:
        solve_rows(solver, chunk, bias, softly, start, pairs, layout, ARMS)
    else:
        solve_rows(solver, chunk, bias, softly, start, pairs, layout, NO_ARMS)
    scatter_motion(solver, chunk, start, pairs)


@part
def measure_rows(solver, chunk, ahead, dt, first, pairs):
    """What each row of one point of the pairs of a chunk asks, see ``update_targets``; returns whether the speed of
    some is far from that."""
    any_far = False
    for q in range(pairs):
        k, n = first + q, solver.normal[first + q]
        end_a = end_of_turn(chunk.turn_a[q], (chunk.sine_a[q], chunk.versine_a[q]), solver.core_a[k])
        end_b = end_of_turn(chunk.turn_b[q], (chunk.sine_b[q], chunk.versine_b[q]), solver.core_b[k])
        room = solver.gap[k] + dot(chunk.way[q], n) + dot(sub(end_b, end_a), n)
        closing = -dot(parting_at(chunk_motion(chunk, q), solver.arm_a[k], solver.arm_b[k]), n)
        any_far |= update_targets(solver, k, room, closing, ahead, dt)
    return any_far


@part
def measure_chunks(solver, ahead, dt, span):
    """The same of all rows of a range."""
    start, c, any_far = span[0], solver.first_chunk, False
    chunk = chunk_of(solver)
    while start < span[1]:
        points, stop = solver.points[c], solver.ends[c]
        pairs = (stop - start) // points
        gather_motion(solver, chunk, start, pairs)
        gather_places(solver, chunk, start, pairs)
        for e in range(points):
            any_far |= measure_rows(solver, chunk, ahead, dt, start + e * pairs, pairs)
        start, c = stop, c + 1
    return any_far


@part
def solve_chunks(solver, bias, pushes, span):
    """One pass over the rows of a range. bias, pushes: see ``solve_normals``; without a branch for the latter, or no
    two pairs would be solved together."""
    start, c, softly = span[0], solver.first_chunk, 1.0 if pushes else 0.0
    chunk = chunk_of(solver)
    while start < span[1]:
        points, stop = solver.points[c], solver.ends[c]
        pairs = (stop - start) // points
        solve_pairs(solver, chunk, bias, softly, start, pairs, (points, pairs))
        start, c = stop, c + 1


@part
def relax_pair(solver, k, start, c):
    """A pass over the pair of row k, of chunk c, which begins at ``start``; all its points as in a chunk, so that what
    lands flat stays so."""
    chunk = chunk_of(solver)
    points = solver.points[c]
    pairs = (solver.ends[c] - start) // points
    one = start + (k - start) % pairs
    solve_pairs(solver, chunk, solver.target_speed, 0.0, one, 1, (points, pairs))
