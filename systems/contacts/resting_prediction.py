"""What bodies at rest will do in this step, before anything is known about it: their supports still push.

Free flight lets a resting body fall by g dt. A ball that bounces on such a body would see its support give way. So the
impulses of the last step act on the prediction once more; where they push bodies apart they are taken back, so that a
shock is not played again, and they never pull.
"""

from __future__ import annotations

from ...framework.compilation import kernel
from ...framework.vectors import add_scaled, dot, row, store, sub


@kernel
def predict_support(
    dt, travels, first, second, count, normal, total, impulse, inverse_mass, moving, position, velocity, path,
    path_second, curved, supported, change, like,
):  # fmt: skip
    """Correct velocity, position and path of the bodies that were held in the last step.

    first, second (count,): rows of the pairs, -1 for one that is gone; normal (count, d); total (count,): the impulses
    of last step's contacts, canonical order; impulse (count,): room. They act like a force throughout the step, which
    displaces by ``travels`` times dt times the change of velocity: what the integrator makes of a force. supported (n,)
    is set, change (n, d) is that of the velocity.
    """
    for m in range(count):
        a, b = first[m], second[m]
        impulse[m] = 0.0
        if a < 0 or b < 0 or total[m] <= 0.0:
            continue
        impulse[m] = total[m]
        for side in range(2):
            i = a if side == 0 else b
            if inverse_mass[i] > 0.0 and not supported[i]:
                supported[i] = True
                store(change, i, row(velocity, i, like))
        n = row(normal, m, like)
        store(velocity, a, add_scaled(row(velocity, a, like), n, -impulse[m] * inverse_mass[a]))
        store(velocity, b, add_scaled(row(velocity, b, like), n, impulse[m] * inverse_mass[b]))
    for m in range(count):
        if impulse[m] > 0.0:
            a, b = first[m], second[m]
            n = row(normal, m, like)
            parting = dot(sub(row(velocity, b, like), row(velocity, a, like)), n)
            if parting > 0.0:
                back = min(impulse[m], parting / (inverse_mass[a] + inverse_mass[b]))
                store(velocity, a, add_scaled(row(velocity, a, like), n, back * inverse_mass[a]))
                store(velocity, b, add_scaled(row(velocity, b, like), n, -back * inverse_mass[b]))
    for i in range(moving):
        if supported[i]:
            dv = sub(row(velocity, i, like), row(change, i, like))
            store(change, i, dv)
            store(position, i, add_scaled(row(position, i, like), dv, travels * dt))
            if curved:
                store(path_second, i, add_scaled(row(path_second, i, like), dv, travels / dt))
            else:
                store(path, i, add_scaled(row(path, i, like), dv, travels))


@kernel
def drop_support(dt, travels, moving, supported, held, stopped, position, velocity, change, like):
    """Bodies whose supports have not pushed after all (``held`` (n,) False) fly as the integrator said; those that are
    ``stopped`` (n,) stay where they are."""
    for i in range(moving):
        if supported[i] and not held[i]:
            dv = row(change, i, like)
            if not stopped[i]:
                store(position, i, add_scaled(row(position, i, like), dv, -travels * dt))
            store(velocity, i, sub(row(velocity, i, like), dv))
