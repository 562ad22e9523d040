"""How long frames take, physics, rules and drawing, without a display: python examples/games/measure.py swarm

Swarm with 2,000 enemies and 600 bullets a second. Pin it to a core that nothing else uses: taskset -c 1 python ...
"""

from __future__ import annotations

import gc
import os
import sys
from time import perf_counter, process_time

import numpy as np

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")


def swarm():
    import swarm as game

    world = game.build(keys=None)
    of = game.game_of(world)

    def hold(frame):
        of.health, of.rate = 1e9, game.FASTEST
        if of.state == "play":
            game.come(world, of, np.zeros(game.MOST, int))  # as many as are missing
        world.get_processor(game.Act).held = {"space", ("right", "up", "left", "down")[frame // 90 % 4]}

    return game, world, hold


def measure(name, frames=1200, before=300):
    game, world, hold = globals()[name]()
    pictures, taken = game.Pictures(), []
    gc.freeze()
    for frame in range(before + frames):
        start = perf_counter(), process_time()
        hold(frame)
        world.advance(1 / 60)
        pictures.draw(world, 1 / 60)
        game.pygame.display.flip()
        taken.append((1000 * (perf_counter() - start[0]), 1000 * (process_time() - start[1])))
    print(f"{name}: {frames} frames, at last of {len(world.bodies)} bodies: ms a frame, median, p99 and worst")
    for label, times in zip(("by the clock", "of the processor"), np.array(taken[before:]).T, strict=True):
        print(f"{label:>16}  {np.percentile(times, 50):5.1f}  {np.percentile(times, 99):5.1f}  {times.max():5.1f}")


if __name__ == "__main__":
    measure(*sys.argv[1:2])
