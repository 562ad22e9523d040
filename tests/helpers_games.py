"""The games of examples/games, played without a window."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from carom.lab import Inputs

FOLDER = Path(__file__).resolve().parent.parent / "examples" / "games"
DT = 1 / 60


def load(name):
    """The module of a game."""
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def recorded(name):
    """The keys of each frame, without end, as they were recorded."""
    keys, frame = Inputs.read(FOLDER / name), 0
    while True:
        yield keys.held(frame * DT, DT)
        frame += 1


def pressed_at_random(random, names, frames):
    """Keys that go down and up at random, some of them for long."""
    held = set()
    for _ in range(frames):
        for name in names:
            if random.random() < (0.05 if name in held else 0.03):
                held ^= {name}
        yield frozenset(held)


def fuzz(game, seconds, check, seed=0, **how):
    """Plays so long with random keys, games that end begin again; every other 2 s twice, with the same bits."""
    random = np.random.default_rng(seed)
    left, worlds, world = round(seconds / DT), 0, None
    while left > 0:
        if world is None:
            world = game.play([set(game.KEYS), set()], seed=seed + worlds, **how)
            worlds += 1
        start, frames = world.snapshot(), list(pressed_at_random(random, game.KEYS, min(left, 120)))
        game.play(frames, world)
        check(world)
        assert not world.faults
        left -= len(frames)
        if left // 120 % 2:
            first = world.state_hash()
            world.restore(start)
            assert game.play(frames, world).state_hash() == first
        if game.game_of(world).state not in ("title", "play"):
            world.close()
            world = None
    return worlds
