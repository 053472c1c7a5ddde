"""TOML files checked against a pydantic model, with errors that name file, place and remedy."""

from __future__ import annotations

import reprlib
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from algid.errors import SettingError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

ModelT = TypeVar("ModelT", bound="BaseModel")


def read_toml(path: Path, model: type[ModelT]) -> ModelT:
    """Read `path` as a `model`.

    Raises
    ------
    SettingError
        If the file is missing, is not TOML, or does not fit the model (the first misfit is named).
    """
    from pydantic import ValidationError

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingError(f"{path}: cannot read it ({error.strerror}); check the name") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SettingError(f"{path}: not TOML ({error}); mend that line") from error
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise SettingError(f"{path}: {first_misfit(error)}") from error


def first_misfit(error: ValidationError) -> str:
    """Where a pydantic model was not met, what was expected and what was found, in one line."""
    first, *others = error.errors(include_url=False, include_context=False)
    place = ".".join(str(part) for part in first["loc"]) or "top level"
    more = f" (and {len(others)} more)" if others else ""
    return f"{place}: {first['msg'].lower()}, found {reprlib.repr(first['input']):.60}{more}"
