"""The tables: cost and error of each value of each field; settings for games."""

from __future__ import annotations

import math
from typing import Any

from ...bench.report import digits
from ...cli.choices import PRESETS
from ...reporting.text_tables import TextTable
from ...trading import code_line as settings_line
from ...wording import NOTHING
from .records import Choice, GameChoices, GamesStudy, SettingsStudy

ROUNDING = 1e-6  # smaller errors are shown as this limit
LARGE = 1000.0  # beyond this margin the target is irrelevant


def tables(study: SettingsStudy) -> list[TextTable]:
    """Tables of cost and errors, and of what the errors mean."""
    return [values(study), meanings(study)]


def values(study: SettingsStudy) -> TextTable:
    """One row per value."""
    rows = []
    for setting in study.settings:
        for place, sample in enumerate(setting.samples):
            own = sample.value == setting.default and type(sample.value) is type(setting.default)
            errors = ", ".join(_amount(sample.errors[name], unit) for name, unit in setting.errors.items())
            rows.append((
                *((setting.field, setting.scene) if place == 0 else ("", "")),
                value(setting.field, sample.value) + " (default)" * own,
                ratio(sample.time.median),
                ratio(sample.work),
                errors,
            ))  # fmt: skip
    title = "each field alone: time and work per simulated second, the default value's being 1; what goes wrong"
    return TextTable(title, ("field", "scene", "value", "time", "work", "error"), rows, words=3)


def meanings(study: SettingsStudy) -> TextTable:
    """The meaning of the errors, each once."""
    rows, said = [], {}
    for setting in study.settings:
        rows.append((
            setting.field,
            setting.scene,
            digits(setting.milliseconds.median),
            ", ".join(f"{name}={value(name, of)}" for name, of in setting.others.items()) or NOTHING,
            said.get(setting.words, setting.words),
        ))  # fmt: skip
        said.setdefault(setting.words, f"as for {setting.field}, {setting.scene}")
    title = "what the errors are; ms per simulated second with the default value; fields that are set otherwise there"
    return TextTable(title, ("field", "scene", "ms", "set otherwise", "the error"), rows, words=5)


def remarks(study: SettingsStudy) -> list[str]:
    """How and where it was timed."""
    spread = max(
        (sample.time.high - sample.time.low) / sample.time.median for of in study.settings for sample in of.samples
    )
    return [
        f"time: {study.machine['clock']}, medians of {_repeats(study.repeats)}, in which the values take turns; the "
        f"repeats of one value lie at most {100 * spread:.0f} % apart; no compiling is in it; "
        f"{study.machine['processor']}",
        "work: weighted sum of steps, evaluations of forces, pairs, impacts and loops of the solver, the same on every "
        "machine",
    ]


def game_tables(study: GamesStudy) -> list[TextTable]:
    """The settings for each game, and its requirement."""
    return [choices(study), needs(study)]


def choices(study: GamesStudy) -> TextTable:
    """The tuned settings first, then the presets."""
    rows = []
    for game in study.games:
        for place, choice in enumerate(game.choices):
            rows.append((
                *((game.game, game.scene) if place == 0 else ("", "")),
                f"Settings.{choice.name}()" if choice.name in PRESETS else choice.line,
                error(game, choice),
                margin(game, choice),
                digits(choice.work / 1e6),
                digits(choice.milliseconds.median) if choice.milliseconds is not None else NOTHING,
            ))  # fmt: skip
    title = "the cheapest settings that meet the target, and the presets; work in millions and ms per simulated second"
    return TextTable(title, ("game", "scene", "settings", "error", "margin", "work", "ms"), rows, words=3)


def needs(study: GamesStudy) -> TextTable:
    """The requirement of each scene."""
    rows = [
        (game.game, game.scene, game.needs, _amount(game.target, game.unit), f"{game.how}, {game.tried} tried")
        for game in study.games
    ]
    return TextTable("what each game asks for", ("game", "scene", "needs", "at most", "how"), rows, words=5)


def game_remarks(study: GamesStudy) -> list[str]:
    """Scenes without a choice that meets the target, and the machine."""
    missing = [f"{game.game} ({game.scene})" for game in study.games if game.tuned is None]
    lines = [f"nothing that was tried meets the target of {', '.join(missing)}"] if missing else []
    return [
        *lines,
        "margin: how many times smaller than the target the error is, in the worst of all start phases; steps up to "
        f"1/60 s; ms: {study.machine['clock']}, {study.machine['processor']}",
        "the presets keep what a scene sets otherwise and the search does not vary: max_impacts_per_step=32 of the "
        "crates",
    ]


def error(game: GameChoices, choice: Choice) -> str:
    """The error with its unit, or the failure."""
    if not math.isfinite(choice.error):
        return choice.failure
    return ", ".join([_amount(choice.error, game.unit), *(_amount(more, unit) for unit, more in choice.also.items())])


def margin(game: GameChoices, choice: Choice) -> str:
    """Target over error."""
    if not choice.met:
        return "misses"
    if not choice.error or game.target / choice.error > LARGE:
        return "met" if not choice.error else f"> {LARGE:,.0f}"
    return digits(game.target / choice.error)


def ratio(of: float) -> str:
    """Two decimals, because ratios are compared with 1."""
    return f"{of:.2f}" if of < 10 else digits(of)


def value(field: str, of: Any) -> str:
    """The value as Python source; a step as a fraction."""
    return settings_line.seconds(of) if field == "dt" else settings_line.quoted(of)


def _amount(amount: float, unit: str) -> str:
    text = f"{amount:.0f}" if amount == round(amount) and abs(amount) < 1e6 else digits(amount)
    if 0 < abs(amount) < ROUNDING:
        text = f"< {ROUNDING:g}"
    return f"{text} {unit}".strip()


def _repeats(count: int) -> str:
    return f"{count} repeats" if count > 1 else "one repeat"


