"""Rollback: a world that is played ahead of inputs which come late."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from ..errors import CaromError
from .entities import whole_number
from .world import World

if TYPE_CHECKING:
    from .snapshots import Snapshot

CHECKED = 30  # frames from one hash to the next
KEPT = 10  # hashes


class Rollback:
    """Steps a world with the inputs of several players, some of whom are far away::

        rollback = Rollback(world, apply)
        rollback.give(me, rollback.frame, [keys])       # one's own, at once
        rollback.give(other, frame, [keys, more])       # of that frame and those that follow, when they arrive
        rollback.step()

    As long as an input is not known, the last one of that player is taken for it. When it comes, and is another, the
    world goes back to its frame and is stepped forward again in the next :meth:`step` or :meth:`settle`. The worlds of
    all players then have the same bits, if the world holds all state of the game. If a step or ``apply`` raises, the
    world is as it was before that frame, which the next call plays.

    world
        the World; nothing else may step it
    apply
        is called before each step with the inputs, a list with one of each player, and writes them into the world; it
        takes no step itself. Inputs are anything that compares with ``==``, such as numbers and tuples; arrays do not
    players
        how many
    most
        frames that the world may be ahead of the inputs of the slowest player
    idle
        what is taken for an input before the first one of a player is known

    ValueError unless ``players`` and ``most`` are whole numbers from 1, TypeError for another ``world`` or ``apply``.
    """

    def __init__(
        self, world: World, apply: Callable[[list[Any]], object], players: int = 2, most: int = 8, idle: Any = 0
    ) -> None:
        players = whole_number("Rollback: players", players, 1)
        if not isinstance(world, World):
            raise TypeError(f"Rollback: world must be a World, got {world!r}")
        if not callable(apply):
            raise TypeError(f"Rollback: apply must be callable, got {apply!r}")
        self.world, self.most = world, whole_number("Rollback: most", most, 1)
        self.frame, self.replayed = 0, 0  # the next frame; steps that were taken again
        self._apply, self._idle = apply, idle
        self._inputs: list[list[Any]] = [[] for _ in range(players)]
        self._used: dict[int, list[Any]] = {}  # by frame, with guesses
        self._snapshots: dict[int, Snapshot] = {}  # before each frame that is not confirmed
        self._hashes: dict[int, str] = {}
        self._wrong: int | None = None  # the first frame with a guess that was wrong
        self._reached = 0  # the frame to play again up to
        self._playing = False

    def inputs(self, player: int) -> list[Any]:
        """All inputs of a player that are known, from frame 0 on; not to be changed. ValueError if there is no such
        player."""
        player = whole_number("Rollback: player", player)
        if player >= len(self._inputs):
            raise ValueError(f"Rollback: player must be from 0 to {len(self._inputs) - 1}, got {player!r}")
        return self._inputs[player]

    @property
    def confirmed(self) -> int:
        """The first frame of which not all inputs are known."""
        return min(map(len, self._inputs))

    def give(self, player: int, frame: int, inputs: Iterable[Any]) -> None:
        """The inputs of a player in ``frame`` and those that follow. What is known already is skipped, and what leaves
        a gap is ignored: send all that the other may lack. ValueError for a player or a frame that cannot be, TypeError
        for inputs that are no list or do not compare with ``==``; nothing of them is known then."""
        known, frame = self.inputs(player), whole_number("Rollback.give: frame", frame)
        try:
            new = list(inputs)
        except TypeError as error:
            raise TypeError(f"Rollback.give: inputs must be a list, one for each frame, got {inputs!r}") from error
        new = new[len(known) - frame :] if frame <= len(known) else []
        wrong = [] if self._wrong is None else [self._wrong]
        for at, each in enumerate(new, len(known)):
            guess = self._used[at][player] if at in self._used else each
            try:
                differs = bool(guess != each)
            except ValueError as error:
                what = "inputs must compare with ==, as numbers and tuples do, and arrays do not"
                raise TypeError(f"Rollback.give: {what}, got {each!r}") from error
            if differs and at in self._used:
                wrong.append(at)
        self._wrong = min(wrong, default=None)
        known += new

    def step(self) -> bool:
        """One frame more; False, and none is played, if a player is too far behind."""
        self.settle()
        if self.frame - self.confirmed >= self.most:
            return False
        self._play()
        return True

    def settle(self) -> None:
        """Play again what was played with wrong guesses; what raises is played once more by the next call. CaromError
        in ``apply`` and in a step."""
        if self._playing:
            raise CaromError("Rollback: apply, and what is in a step, must not call step, settle, checksum or differs")
        if self._wrong is not None:
            self.world.restore(self._snapshots[self._wrong])
            self._reached = max(self._reached, self.frame)
            self._used = {frame: used for frame, used in self._used.items() if frame < self._wrong}
            self.frame, self._wrong = self._wrong, None
        while self.frame < self._reached:
            self._play()
            self.replayed += 1

    def _play(self) -> None:
        frame, confirmed = self.frame, self.confirmed
        if frame % CHECKED == 0:
            self._hashes[frame] = self.world.state_hash()
        before = self.world.snapshot()
        if frame >= confirmed:  # else nothing leads back to here
            self._snapshots[frame] = before
        used = [known[frame] if frame < len(known) else known[-1] if known else self._idle for known in self._inputs]
        self._playing = True
        try:
            self._call(used)
            self.world.step()
        except BaseException:
            self.world.restore(before)  # of a step that fails the inputs are not undone
            raise
        finally:
            self._playing = False
        self._used[frame] = used
        self.frame += 1
        for kept, oldest in (
            (self._used, confirmed), (self._snapshots, confirmed), (self._hashes, confirmed - KEPT * CHECKED),
        ):  # fmt: skip
            for old in [old for old in kept if old < oldest]:
                del kept[old]

    def _call(self, used: list[Any]) -> None:
        try:
            self._apply(used)
        except Exception as error:
            unknown = [player for player, known in enumerate(self._inputs) if not known]
            if unknown:
                got = f"apply got {self._idle!r} for player {unknown[0]}, of whom no input is known yet"
                error.add_note(f"Rollback: {got}; Rollback(..., idle=...) says what it gets then")
            raise

    def checksum(self) -> tuple[int, str]:
        """A frame whose start depends on no guess, the newest one of every 30th, and the hash of the world there; to be
        sent to the others. (0, "") before the first."""
        self.settle()
        frame = max((frame for frame in self._hashes if frame <= self.confirmed), default=0)
        return frame, self._hashes.get(frame, "")

    def differs(self, frame: int, checksum: str) -> bool | None:
        """Whether another player's ``checksum`` of a ``frame`` is not the hash that this world had there; None if that
        is not known here, or the other has not begun. ValueError for a frame that cannot be, TypeError for what is no
        checksum."""
        frame = whole_number("Rollback.differs: frame", frame)
        if not isinstance(checksum, str):
            raise TypeError(f"Rollback.differs: checksum must be text, got {checksum!r}")
        self.settle()
        if not checksum or frame > self.confirmed or frame not in self._hashes:
            return None
        return self._hashes[frame] != checksum
