"""Results of the settings studies, as plain records that convert to JSON and back."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from ...measure.timing import Spread
from ...plain import INFINITE, Plain


@dataclass
class Sample(Plain):
    """One value of a field in one scene.

    time
        processor time per simulated second relative to the default value, within each repeat
    work
        the weighted counts, see :mod:`carom.lab.engines.cost`, relative to the default value
    errors
        by name: see ``Setting.errors``
    """

    value: Any
    time: Spread
    work: float
    errors: dict[str, float]


@dataclass
class Setting(Plain):
    """One field varied in one scene; all other fields keep the scene's values.

    others
        the fields that are not the default ones in this scene
    default
        the value that the ratios are relative to
    milliseconds
        processor time per simulated second with that value
    errors
        units by name; ``words`` say what the errors are, and the reference
    """

    field: str
    scene: str
    others: dict[str, Any]
    default: Any
    seconds: float
    milliseconds: Spread
    errors: dict[str, str]
    words: str
    samples: list[Sample]

    def sample(self, value: Any) -> Sample:
        """The sample of that value; KeyError if it was not tried."""
        for sample in self.samples:
            if sample.value == value and type(sample.value) is type(value):
                return sample
        raise KeyError(f"{self.field}={value!r} was not tried in {self.scene}")


@dataclass
class SettingsStudy(Plain):
    """All fields, on one machine."""

    machine: dict[str, str]
    repeats: int
    settings: list[Setting]

    @property
    def fields(self) -> list[str]:
        """The names of the fields, each once."""
        return list(dict.fromkeys(setting.field for setting in self.settings))

    def setting(self, field: str, scene: str) -> Setting:
        """The record of that field and scene; KeyError if there is none."""
        for setting in self.settings:
            if (setting.field, setting.scene) == (field, scene):
                return setting
        raise KeyError(f"no {field} in {scene!r} in this study")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return _without_infinities(dataclasses.asdict(self))


@dataclass
class Choice(Plain):
    """Settings tried in a game's scene.

    name
        "tuned", a preset, or a description of the candidate
    line
        of Python, to paste
    error
        the worst of all repeats; inf if one failed, see ``failure``
    also
        other figures of interest, by name
    work
        per simulated second
    milliseconds
        processor time per simulated second; None if it was not timed
    """

    name: str
    line: str
    error: float
    met: bool
    work: float
    milliseconds: Spread | None = None
    failure: str = ""
    also: dict[str, float] = dataclasses.field(default_factory=dict)


@dataclass
class GameChoices(Plain):
    """One kind of game.

    scene
        the representative scene; ``needs`` describes the game's requirement in words
    target, unit
        the largest allowed error
    how
        how the choice was found: "search", or "all candidates"
    tried
        number of settings tried
    """

    game: str
    scene: str
    needs: str
    target: float
    unit: str
    how: str
    tried: int
    choices: list[Choice]

    @property
    def tuned(self) -> Choice | None:
        """The cheapest choice that meets the target; None if there is none."""
        return next((choice for choice in self.choices if choice.name == TUNED), None)

    def choice(self, name: str) -> Choice:
        """The choice of that name; KeyError if there is none."""
        for choice in self.choices:
            if choice.name == name:
                return choice
        raise KeyError(f"no choice {name!r} for {self.game}")


@dataclass
class GamesStudy(Plain):
    """All kinds of games, on one machine."""

    machine: dict[str, str]
    games: list[GameChoices]

    def game(self, name: str, scene: str = "") -> GameChoices:
        """The first of that name (and scene); KeyError if there is none."""
        for game in self.games:
            if game.game == name and scene in ("", game.scene):
                return game
        raise KeyError(f"no game {name!r} in this study")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return _without_infinities(dataclasses.asdict(self))


TUNED = "tuned"


def _without_infinities(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_infinities(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_infinities(one) for one in value]
    return INFINITE if isinstance(value, float) and value == math.inf else value
