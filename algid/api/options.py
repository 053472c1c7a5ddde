"""What a verb takes: logs, a profile in any form, settings by their names; and as a command has it.

A verb's signature and docstring state of each keyword its type, its bounds and its help: the
command line and the guide are made from them, and the verb checks its values by them.
"""

from __future__ import annotations

import builtins
import inspect
import re
import sys
from collections import ChainMap, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from difflib import get_close_matches
from functools import cache, wraps
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    TypedDict,
    TypeVar,
    get_args,
    get_origin,
)

from pydantic import TypeAdapter, ValidationError

from algid.base.errors import SettingError
from algid.base.files import misfit, parsed_toml, whole_folder
from algid.base.limits import KNOWN_LENGTH, KNOWN_MASS, within
from algid.options import (
    ADVANCED,
    ARGUMENTS,
    EVERYDAY,
    EVERYDAY_FIELDS,
    SELDOM,
    TYPED,
    Option,
    flag,
    refuse_moved,
)
from algid.profile import Effort, Profile, lasting, load_profile, over, with_settings
from algid.settings import OF_BOTH, Settings

if TYPE_CHECKING:
    from algid.identification.recordings import LogLike
    from algid.results import Result

Verb = TypeVar("Verb", bound=Callable[..., Any])
CALLERS = ("settings", "progress", "complain", "command", "sensors", "labels")
"""Keywords that no command line has."""

ProfileLike = Annotated["Profile | str | Path | Mapping[str, Any]", Option(kind=Path)]
"""A profile, the path of its file, or what would stand in that."""
AnyLog = Annotated["LogLike", Option(kind=Path)]
"""A path, a `Log`, a pandas or polars frame, or a dict of arrays."""
Logs = Annotated["LogLike | Iterable[LogLike]", Option(kind=list[Path])]
AnyResult = Annotated["Result | str | Path", Option(kind=Path)]
"""A result, or the path of one."""
Folder = Annotated[str | Path, Option(default=Path())]
"""Where a command writes: the working folder by default."""
Length = Annotated[float, within(KNOWN_LENGTH)]
Mass = Annotated[float, within(KNOWN_MASS)]
Seed = Annotated[int, within((0, 2**63))]
Export = bool | Literal["mcap"]
"""Whether what is shown over time is also written as MCAP."""
CASES = ("case1", "case2")
"""The cases that algid knows, for completion."""
Channel = Mapping[str, Any]


class LogOptions(TypedDict, total=False):
    """Keywords of a verb that reads logs: the fields of `Profile` but for the arm's prior."""

    topic: str | None
    joints: Sequence[str] | None
    clock: Literal["header", "log"] | None
    time: str | None
    time_unit: Literal["s", "ms", "us", "ns"] | None
    rate: float | None
    columns: Iterable[str] | None
    angle_unit: str
    torque_unit: str
    zero: Literal["horizontal", "hanging", "upright"]
    second_angle: Literal["relative", "absolute"]
    drive: Literal["joint", "base"]
    passive: Literal[1, 2] | None
    gravity: float
    effort: Effort | None
    velocity: Literal["observer", "measured"] | None
    signs: Sequence[int]
    offsets: Sequence[float]
    start: float | None
    end: float | None
    torque_file: str | Path | None
    segment: int | None
    accept: Iterable[str]
    theta1: Channel
    theta2: Channel
    tau1: Channel
    tau2: Channel
    omega1: Channel
    omega2: Channel
    q_des1: Channel
    q_des2: Channel


class Options(LogOptions, total=False):
    """Keywords of a verb that identifies: the fields of `Settings` beside those of `Profile`."""

    estimator: Literal["refined", "weak", "instruments", "paper"]
    observer: Literal["luenberger", "zero-phase"] | None
    poles: Iterable[complex] | str | None
    window: float | None
    bandwidth: float
    prior: str | Path | None
    prior_error: float | None
    model: str
    torque_hold: Literal["auto", "foh", "zoh"]
    delay: float
    l1: float | None
    l2: float | None
    payload_mass: float | None
    constrain: bool
    cross_validate: bool


@cache
def options_of(taker: Callable[..., Any], of: str = "") -> Mapping[str, Option]:
    """What a verb, `Settings` or `Profile` takes that a command line has, by name.

    Of ``**options`` that is what it takes of `Profile` and `Settings`; `of` is a channel, whose
    fields are the profile's.
    """
    # what is imported for type checkers alone is typed as a path
    module = vars(sys.modules[taker.__module__])
    names = ChainMap(module, vars(builtins), defaultdict[str, Any](lambda: Path))
    helps, found = described(taker)[1], dict[str, Option]()
    for own, one in inspect.signature(taker).parameters.items():
        hint, name = one.annotation, of + own
        if own in CALLERS:
            continue
        if isinstance(hint, str):
            hint = eval(hint, module, names)  # our own source
        if one.kind is one.VAR_KEYWORD:
            every = {**options_of(Profile), **options_of(Settings)}
            taken = get_args(hint)[0].__annotations__
            found |= {key: every[key] for key in every if key.partition(".")[0] in taken}
            continue
        if hasattr(hint, "model_fields"):
            found |= options_of(hint, f"{name}.")
            continue
        stated, check, words, kinds = Option(), None, dict[str, None](), set[type]()
        for part in _parts(hint):
            if isinstance(part, Option):
                stated = part
            elif isinstance(part, type):
                kinds.add(part)
            elif get_origin(part) is Literal:
                words |= dict.fromkeys(map(str, get_args(part)))
                check = Literal[*words]
            elif get_origin(part) is Annotated:
                check = check or part
        # text where Python takes several forms
        kind = kinds.pop() if len(kinds) == 1 and not words else Path if Path in kinds else str
        panel, default = EVERYDAY, stated.default if one.default is None else one.default
        if hasattr(taker, "model_fields"):  # a field that is not typed is not said
            panel = EVERYDAY if name in EVERYDAY_FIELDS else ADVANCED
            default = False if kind is bool else None
        elif name in SELDOM:
            panel = ADVANCED
        elif one.kind is not one.KEYWORD_ONLY and name not in TYPED:
            panel = ARGUMENTS
        found[name] = replace(
            stated,
            name=name,
            kind=stated.kind or kind,
            check=check if stated == Option() else stated.check,
            default=default,
            panel=panel,
            help=helps.get(own) or f"{', '.join(words)}.",
            words=list(words),
        )
    return found


def _parts(hint: Any) -> Iterator[Any]:
    """All that a type is made of."""
    yield hint
    for part in get_args(hint):
        if part is not type(None):
            yield from _parts(part)


def verb(function: Verb) -> Verb:
    """A function that is called with what pydantic makes of its keywords.

    One that is out of its bounds, none of the words that are known, or of a name that has moved is
    refused.
    """

    @wraps(function)
    def called(*args: Any, **given: Any) -> Any:
        refuse_moved(" ".join(f"{function.__name__}({name}=…)" for name in given))
        bound = inspect.signature(function).bind(*args, **given)
        for name, one in options_of(function).items():
            value = bound.arguments.get(name)
            if one.check is None or value is None or isinstance(value, bool):
                continue
            try:
                bound.arguments[name] = TypeAdapter(one.check).validate_python(value)
            except ValidationError as error:
                why = f"{misfit(error)[1]} ({one.help.rstrip('.')})"
                raise SettingError(f"{one.flag}: {why}") from None
        return function(*bound.args, **bound.kwargs)

    return called  # type: ignore[return-value]  # it takes and gives the same


def described(taker: Callable[..., Any]) -> tuple[list[str], dict[str, str]]:
    """What a docstring says: paragraphs, the example of a command the last, and of each parameter.

    Of a parameter that is the first sentence.
    """
    text, helps = inspect.cleandoc(taker.__doc__ or ""), dict[str, str]()
    for names, body in re.findall(r"(?m)^\**(\w[\w, ]*) : .*\n((?:    .*\n)*)", text):
        first = re.split(r"(?<=\.)\s", " ".join(body.split()))[0]
        helps |= dict.fromkeys(names.split(", "), first)
    shown = re.sub(r"(?s)\nParameters\n.*\nExamples\n-+\n", "\n", text).replace("$", "Example:")
    above = shown.partition("\n\n>>> ")[0].split("\n\n")
    return [" ".join(one.split()) for one in above], helps


def refuse_unknown(options: Iterable[str], known: Collection[str]) -> None:
    """Raise `SettingError` at a name that is none of the known ones."""
    for name in options:
        top = name.partition(".")[0]
        if top not in known:
            near = get_close_matches(top, known, n=1) or known
            raise SettingError(f"{name}: no setting has this name; expected {', '.join(near)}")


def settings_of(
    settings: Settings | None, options: Mapping[str, Any]
) -> tuple[Settings, dict[str, Any]]:
    """The settings with options over them, as flags are over a file; and the profile's options.

    Raises
    ------
    SettingError
        If an option is none of `Settings` or of `Profile`, or a setting's value is wrong.
    """
    refuse_unknown(options, Options.__annotations__)
    own = {name: options[name] for name in options if name in Settings.model_fields}
    asked = (settings or Settings()).but(**own)
    of_profile = {name: options[name] for name in options if name not in own or name in OF_BOTH}
    shared = asked.model_dump(include={*OF_BOTH}, exclude_defaults=True)
    return asked, of_profile | shared


def meant(
    profile: ProfileLike | None,
    options: Mapping[str, Any],
    *logs: Any,
    earlier: AnyResult | None = None,
) -> Any:
    """The profile with single settings over it; and the logs, those in memory as it has them.

    Parameters
    ----------
    profile : Profile, path of one, mapping or None
    options : mapping
        By the names of the fields of `Profile`.
    *logs : as a verb takes them
    earlier : Result or path of one
        What was said of its logs in memory holds of these, where the profile is silent.

    Raises
    ------
    LogError
        If arrays of a log are not such as `Log` promises.
    SettingError
        If an option is not known or wrong, the profile's file cannot be read, or the profile says
        of a log in memory what only holds of a file.
    """
    refuse_unknown(options, Profile.model_fields)
    own: Any = profile
    if isinstance(profile, str | Path):
        own = load_profile(Path(profile))
    elif isinstance(profile, Mapping):
        own = with_settings(Profile(), profile)
    elif not isinstance(profile, Profile | None):
        raise SettingError(
            f"profile: expected a path, a dict or a Profile, found {type(profile).__name__}"
        )
    if options:
        own = with_settings(own or Profile(), options)
    if not logs:
        return own
    return own, *(_in_memory(one, own, earlier) for one in logs)


def _in_memory(given: Any, profile: Profile | None, earlier: AnyResult | None) -> Any:
    """A log or several, those in memory as the profile, or else the earlier result, has them."""
    from algid.log import ARRAYS, Log
    from algid.readers.memory import with_profile

    if isinstance(given, Log):
        if earlier is not None and not given.origin.reading.channels:
            before = opened(earlier)
            # of files nothing is known of arrays, which are in SI units unless something is said
            if before.log.format == ARRAYS:
                profile = over(profile, lasting(before.profile))
        return with_profile(given, profile)
    if isinstance(given, Sequence | Iterator) and not isinstance(given, str):
        return [_in_memory(one, profile, earlier) for one in given]
    return given


def set_by(lines: Iterable[str], known: Collection[str]) -> dict[str, Any]:
    """What ``NAME=VALUE`` sets, each a line of TOML; a bare word is text.

    Raises
    ------
    SettingError
        If a line is none, or sets what is not known.
    """
    found = dict[str, Any]()
    for line in lines:
        name, equals, text = line.partition("=")
        if not equals or not name.strip():
            raise SettingError(f"{flag('set')} {line}: expected KEY=VALUE like tau1.sign=-1")
        value: Any = text.strip()
        with suppress(ValueError, RecursionError):
            value = parsed_toml(f"value = {text}")["value"]
        found[name.strip()] = value
    refuse_unknown(found, known)
    return found


def opened(given: Result | str | Path) -> Result:
    """A result, read where its file or folder is given."""
    from algid.results import Result, read_result

    return given if isinstance(given, Result) else read_result(given)


def called(given: Result | str | Path) -> str:
    """What a result is called where it is wrong: its file, or its log."""
    return str(given) if isinstance(given, str | Path) else given.log.path


def stem_of(result: Result | str | Path) -> str:
    """What a result is called: its folder, given by that or by its result.json, or its log."""
    place = Path(called(result)).resolve()
    return (place.parent if place.name == "result.json" else place).stem


def folder_or_none(folder: Path | None, force: bool) -> AbstractContextManager[Path | None]:
    """A folder to write into, whole or not at all; None where nothing is to be written."""
    return nullcontext() if folder is None else whole_folder(folder, force)
