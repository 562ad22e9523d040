"""How long frames take, physics, rules and drawing, without a display: python examples/games/measure.py swarm

Swarm with 2,000 enemies and 600 bullets a second; Siege with castles twice as large, random keys and a snapshot in each
frame, and how long it takes to go back by 8 frames; Cave run by its recorded keys. Pin it to a core that nothing else
uses: taskset -c 1 python ...
"""

from __future__ import annotations

import gc
import os
import sys
from time import perf_counter, process_time

import numpy as np

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
BEFORE, FRAMES = 300, 1200


def swarm():
    """Yields once a frame is over."""
    import swarm as game

    world, pictures = game.build(keys=None), game.Pictures()
    of = game.game_of(world)
    for frame in range(BEFORE + FRAMES):
        of.health, of.rate = 1e9, game.FASTEST
        if of.state == "play":
            game.come(world, of, np.zeros(game.MOST, int))  # as many as are missing
        world.get_processor(game.Act).held = {"space", ("right", "up", "left", "down")[frame // 90 % 4]}
        world.advance(1 / 60)
        pictures.draw(world, 1 / 60)
        game.pygame.display.flip()
        yield
    print(f"{len(world.bodies)} bodies at last")


def siege():
    import siege as game

    world = game.build(keys=None, rows=17)
    frames = iter(game.Pictures(world, real_time=False, prepare=False).view)
    random, held, times = np.random.default_rng(0), set(), []
    for frame in range(BEFORE + FRAMES):
        next(frames)  # draws the frame before
        held ^= {name for name in game.KEYS if random.random() < 0.03}
        start = process_time()
        snapshot = world.snapshot()
        times.append(process_time() - start)
        game.play([held], world)
        if frame % 100 == 99:
            for _ in range(7):
                game.play([held], world)
            start = process_time()
            world.restore(snapshot)
            for _ in range(8):
                world.snapshot()
                game.play([held], world)
            print(f"back by 8 frames: {1000 * (process_time() - start):.1f} ms, {len(world.bodies)} bodies")
        yield
    print("a snapshot: median {:.2f} ms, p99 {:.2f} ms".format(*1000 * np.percentile(times, (50, 99))))


def cave_run():
    import cave_run as game

    world = game.build(keys=None)
    frames, keys = iter(game.Pictures(world, real_time=False, prepare=False).view), game.Inputs.read(game.RECORDED)
    for _ in range(BEFORE + FRAMES):
        next(frames)  # draws the frame before
        game.play([keys.held(world.time, 1 / 60)], world)
        yield
    print(f"{len(world.bodies)} bodies, the hero at {world.bodies.position[world.bodies.has(game.Hero)][0].round(1)}")


def measure(name):
    taken, start = [], (0.0, 0.0)
    for _ in globals()[name]():
        taken.append((perf_counter() - start[0], process_time() - start[1]))
        if len(taken) == BEFORE:
            gc.freeze()
        start = perf_counter(), process_time()
    print(f"{name}: {FRAMES} frames, ms each: median, p99 and worst")
    for label, times in zip(("by the clock", "of the processor"), 1000 * np.array(taken[BEFORE:]).T, strict=True):
        print(f"{label:>16}  {np.percentile(times, 50):5.1f}  {np.percentile(times, 99):5.1f}  {times.max():5.1f}")


if __name__ == "__main__":
    measure(*sys.argv[1:2])
