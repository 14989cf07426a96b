"""JSON in a run directory: its record, the lines of its log, the headers of its shards; one schema for all.

Anybody can write a text with a matching checksum. This module checks types and sizes, so that code that uses documents
need not check them again.
"""

import json
import math
import os
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from pydantic.functional_validators import PlainValidator

from cspr_jax.errors import printable
from cspr_jax.schema.identity import FORMAT_VERSION, digest
from cspr_jax.schema.tiles import LARGEST_TILE, Tiling
from cspr_jax.store.files.checksum import DamagedError, read_regular
from cspr_jax.store.files.disk import READ_ONLY, Disk
from cspr_jax.store.files.guard import LARGEST_CHUNKS, LARGEST_RANK
from cspr_jax.store.files.publishing import publish

# Largest depth of nesting: settings have some six levels, and recursive functions walk through them.
DEEPEST = 32
LONGEST_NAME = 255
LARGEST_RECORD = 64 << 20
_LARGEST_COUNT = 10_000_000
_LARGEST_CELLS = 1 << 46

AnyDocument = TypeVar("AnyDocument", bound="Document")


class Document(BaseModel):
    """A JSON object with checked types and finite numbers; unknown keys, such as of later versions, are ignored."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


def _text(value: Any) -> str:
    # pydantic's own type would refuse names of files that are not UTF-8.
    if not isinstance(value, str):
        raise ValueError("must be a text")
    return value


def _file_name(value: Any) -> str:
    name = _text(value)
    if name in ("", ".", "..") or "/" in name or "\0" in name or len(os.fsencode(name)) > LONGEST_NAME:
        raise ValueError("must be the name of a file")
    return name


Text = Annotated[str, PlainValidator(_text)]
FileName = Annotated[str, PlainValidator(_file_name)]
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Count = Annotated[int, Field(ge=0, le=_LARGEST_CELLS)]


class Header(Document):
    """Header of a shard.

    Fields:
        identity: identity of the sweep.
        tile: index of the tile.
        environment: hash of the environment that computed it.
        near_zero: number of cells whose margin is within 1e-9 of zero.
        undecided: number of cells whose answer is not proved; None: the map proves nothing, or the file is older.
    """

    identity: Digest
    tile: Count
    environment: Digest
    near_zero: Count
    undecided: Count | None = None


class Entry(Document):
    """A line of the log, which may have further keys.

    Fields:
        time: time of the wall clock.
        event: kind of the event.
    """

    model_config = ConfigDict(extra="allow")

    time: Text
    event: Text


class _Range(Document):
    count: Annotated[int, Field(ge=1, le=_LARGEST_COUNT)]


class _Divisions(Document):
    divisions: Annotated[int, Field(ge=4, le=128)] = 32


class _Run(Document):
    tile: Annotated[list[Annotated[int, Field(ge=1, le=LARGEST_TILE)]], Field(min_length=1, max_length=LARGEST_RANK)]
    store: Annotated[list[Text], Field(min_length=1, max_length=1000)]
    dtype: Literal["float64", "float32"]


class Settings(Document):
    """The part of resolved settings that determines the layout of a run.

    Fields:
        axes: axes of the sweep file, each a list, a range with a count, or "all" arrangements of the cables.
        dimensions: names of all axes in the order of the result.
        orientations: settings of a map over all orientations, whose axes follow from divisions.
        run: shape of a tile, names of the quantities, and their type.
        arrangements: number of arrangements of the cables, if the axis has all of them.
    """

    axes: dict[str, _Range | Literal["all"] | Annotated[list[Any], Field(min_length=1, max_length=_LARGEST_COUNT)]]
    dimensions: Annotated[list[Text], Field(min_length=1, max_length=LARGEST_RANK)]
    orientations: _Divisions = _Divisions()
    run: _Run
    arrangements: Annotated[int, Field(ge=1, le=_LARGEST_COUNT)] = 1

    @property
    def tiling(self) -> Tiling:
        """Tiles of the grid."""
        file_counts = {
            name: self.arrangements if axis == "all" else axis.count if isinstance(axis, _Range) else len(axis)
            for name, axis in self.axes.items()
        }
        step = self.orientations.divisions
        counts = {"torsion": 2 * step, "tilt_azimuth": 2 * step, "tilt": step} | file_counts
        return Tiling(tuple(counts[name] for name in self.dimensions), tuple(self.run.tile))

    @model_validator(mode="after")
    def _fits(self) -> "Settings":
        if len({*self.dimensions}) < len(self.dimensions) or len(self.dimensions) != len(self.run.tile):
            raise ValueError("dimensions and tiles do not fit")
        try:
            tiling = self.tiling
        except KeyError as error:
            raise ValueError("dimensions must be axes") from error
        if len(tiling) > LARGEST_CHUNKS or math.prod(tiling.shape) > _LARGEST_CELLS:
            raise ValueError(f"more than {LARGEST_CHUNKS} tiles")
        return self


class Source(Document):
    """Origin of a run, for information only.

    Fields:
        file: name of the sweep file.
        text: text of the sweep file.
        command: words of the command.
    """

    file: FileName
    text: Text = ""
    command: list[Text] = []


class Record(Document):
    """Content of run.json, without its checksum.

    Fields:
        identity: identity of the sweep, the hash of its settings.
        settings: resolved settings.
        environment: environment of the computation.
        source: name and text of the sweep file, and the command, for information only.
    """

    identity: Digest
    settings: dict[str, Any]
    environment: dict[str, Any]
    source: dict[str, Any]

    @field_validator("settings")
    @classmethod
    def _laid_out(cls, settings: dict[str, Any]) -> dict[str, Any]:
        Settings.model_validate(settings)
        return settings

    @field_validator("source")
    @classmethod
    def _named(cls, source: dict[str, Any]) -> dict[str, Any]:
        return Source.model_validate(source).model_dump()

    @model_validator(mode="after")
    def _is_identity(self) -> "Record":
        formats = range(1, FORMAT_VERSION + 1)
        if self.identity not in [digest({"format": version, **self.settings}) for version in formats]:
            raise ValueError("its settings and its identity do not fit")
        return self


def plain_json(text: str | bytes) -> Any:
    """Parse JSON, and refuse numbers that are not finite, and deep nesting."""
    try:
        value = json.loads(text, parse_constant=_not_finite, parse_float=_finite)
    except RecursionError as error:
        raise DamagedError("it is nested too deeply") from error
    except ValueError as error:
        raise DamagedError(printable(f"it is not JSON: {error}")) from error
    level: list[Any] = [value]
    for _ in range(DEEPEST):
        nested = [one for one in level if isinstance(one, dict | list)]
        if not nested:
            return value
        level = [inner for one in nested for inner in (one.values() if isinstance(one, dict) else one)]
    raise DamagedError("it is nested too deeply")


def document(kind: type[AnyDocument], value: Any, what: str) -> AnyDocument:
    """Check parsed JSON against the schema of a document."""
    try:
        return kind.model_validate(value)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        location = ".".join(map(str, first["loc"]))
        raise DamagedError(printable(f"{what} is not of cspr: {location or 'it'}: {first['msg']}"[:300])) from error


def write_record(disk: Disk, path: Path, record: Record) -> None:
    """Write run.json, which says to what sweep a run directory belongs, with a checksum."""
    content = record.model_dump()
    text = json.dumps({**content, "checksum": digest(content)}, indent=1, allow_nan=False)
    publish(disk, path, (text + "\n").encode(), mode=READ_ONLY)


def read_record(path: Path) -> Record:
    """Read run.json."""
    content = plain_json(read_regular(path, LARGEST_RECORD))
    if not isinstance(content, dict) or content.keys() != Record.model_fields.keys() | {"checksum"}:
        raise DamagedError("it is not a record of cspr")
    checksum = content.pop("checksum")
    if digest(content) != checksum:
        raise DamagedError("its content has changed")
    return document(Record, content, "its content")


def _not_finite(word: str) -> float:
    raise ValueError(f"{word} is not a number")


def _finite(word: str) -> float:
    number = float(word)
    return number if math.isfinite(number) else _not_finite(word)
