"""Ground accelerations over time: pulses by formula, and records from tables."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from cvxlimit.base.arrays import FloatArray, ReadOnlyArrays
from cvxlimit.base.checks import is_number, meant, positive
from cvxlimit.errors import InputError
from cvxlimit.io.fields import file_prefix
from cvxlimit.scene import METRES
from cvxlimit.scene.units import G

Shape = Literal["rectangle", "half-sine", "sine"]

ACCELERATIONS = {f"{name}/s2": metre for name, metre in METRES.items()} | {"gal": 0.01}
"""Units of acceleration beside g, in m/s2."""

RECORDED, FELT = 40.22, 0.01
"""Largest acceleration of the ground that was recorded (m/s2; 4,022 gal, the three components
together, Iwate-Miyagi 2008), and one that nobody feels (1 gal): records outside are in another unit
than was said, as a rule."""

PIECES = 1000
"""Straight pieces of a pulse. The area of half a sine is short by pi^2 / (12 n^2) of itself with n
of them: 8e-7 where half a sine has all, 3.3e-6 for either half of a full sine."""


@dataclass(frozen=True, eq=False)
class Record(ReadOnlyArrays):
    """An acceleration of the ground over time, straight between its points, zero before and after.

    Attributes
    ----------
    times : (n,) array
        In s, from 0 on; two equal ones are a jump.
    acceleration : (n,) array
        In m/s2.
    name : str

    Raises
    ------
    InputError
        If times or accelerations are not finite, of different number, fewer than two, or times
        fall.

    Example
    -------
    >>> Record([0.0, 1.0], [2.0, 2.0]).velocity(0.5)
    1.0
    """

    times: FloatArray
    acceleration: FloatArray
    name: str = "record"

    def __post_init__(self) -> None:
        for name in ("times", "acceleration"):
            try:
                values = np.array(getattr(self, name), dtype=float)
            except (TypeError, ValueError) as error:
                raise InputError(f"{name} of a record must be numbers") from error
            if values.ndim != 1 or not np.isfinite(values).all():
                raise InputError(f"{name} of record {self.name!r} must be a row of finite numbers")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if len(self.times) != len(self.acceleration) or len(self.times) < 2:
            raise InputError(
                f"record {self.name!r} has {len(self.times)} times and {len(self.acceleration)} "
                "accelerations: give as many of both, and two or more"
            )
        if self.times[0] < 0.0 or (np.diff(self.times) < 0.0).any():
            bad = 0 if self.times[0] < 0.0 else int(np.argmax(np.diff(self.times) < 0.0)) + 1
            raise InputError(
                f"times of record {self.name!r} must start at 0 or later and not fall, got "
                f"{self.times[bad]:g} s in row {bad + 1}"
            )

    def __repr__(self) -> str:
        doubt = f"; {self.doubt}" if self.doubt else ""
        return f"Record({self.name!r}: {self.duration:g} s, largest {self.largest:g} m/s2{doubt})"

    @property
    def duration(self) -> float:
        """Time of the last point, s."""
        return float(self.times[-1])

    @property
    def largest(self) -> float:
        """Largest acceleration, m/s2."""
        return float(np.abs(self.acceleration).max())

    @property
    def doubt(self) -> str:
        """A question after the unit, where no ground moves like this; else empty.

        >>> Record([0.0, 1.0], [300.0 * G, 0.0]).doubt
        'the largest acceleration is 300 g, and the largest recorded on earth is 4.1 g: is the \
record in gal?'
        """
        if self.largest > RECORDED:
            told = f"the largest recorded on earth is {RECORDED / G:.1f} g: is the record in gal?"
        elif 0.0 < self.largest < FELT:
            told = "nobody feels less than 0.001 g: is the record in g?"
        else:
            return ""
        return f"the largest acceleration is {self.largest / G:.3g} g, and {told}"

    def scaled(self, factor: float) -> Record:
        """The record with accelerations times a factor."""
        if not (is_number(factor) and np.isfinite(factor)):
            raise InputError(f"factor on a record must be a finite number, got {factor!r}")
        name = f"{factor:g} x {self.name}"
        return replace(self, acceleration=factor * self.acceleration, name=name)

    @cached_property
    def _velocities(self) -> FloatArray:
        means = 0.5 * (self.acceleration[1:] + self.acceleration[:-1])
        return np.concatenate([[0.0], np.cumsum(means * np.diff(self.times))])

    def velocity(self, time: float) -> float:
        """Velocity of the ground (m/s) at a time: the integral up to there, exactly."""
        t = min(max(time, float(self.times[0])), self.duration)
        i = min(int(np.searchsorted(self.times, t, side="right")) - 1, len(self.times) - 2)
        length, since = float(self.times[i + 1] - self.times[i]), t - float(self.times[i])
        if not length > 0.0:
            return float(self._velocities[i])
        a, b = self.acceleration[i : i + 2].tolist()
        return float(self._velocities[i] + since * (a + 0.5 * (b - a) * since / length))


def pulse(shape: Shape, amplitude: float, duration: float, unit: str = "g") -> Record:
    """A pulse: a rectangle, half a sine, or one full sine.

    Parameters
    ----------
    shape : {"rectangle", "half-sine", "sine"}
    amplitude : float
        Largest acceleration, in ``unit``.
    duration : float
        Of the whole pulse, s.
    unit : str
        ``"g"`` (9.81 m/s2), ``"gal"``, or a unit of length per s2, as ``"m/s2"``.

    Raises
    ------
    InputError
        For another shape or unit, a duration that is not above 0, an amplitude that is no finite
        number.

    Example
    -------
    >>> round(pulse("half-sine", 0.8, 0.5).velocity(0.5), 4)  # 2/pi of 0.8 x 9.81 x 0.5
    2.4981
    """
    if shape not in get_args(Shape):
        known = get_args(Shape)
        raise InputError(
            f"a pulse is one of {', '.join(known)}, got {shape!r}"
            + meant(str(shape), known, before="; ")
        )
    duration, factor = positive(duration, "duration of a pulse"), _factor(unit)
    if not (is_number(amplitude) and np.isfinite(amplitude)):
        raise InputError(f"amplitude of a pulse must be a finite number, got {amplitude!r}")
    name = f"{shape} of {amplitude:g} {unit} over {duration:g} s"
    if shape == "rectangle":
        return Record(np.array([0.0, duration]), np.full(2, factor * amplitude), name)
    times = np.linspace(0.0, duration, PIECES + 1)
    turns = np.pi if shape == "half-sine" else 2.0 * np.pi
    return Record(times, factor * amplitude * np.sin(turns * times / duration), name)


def read_record(path: str | os.PathLike[str], unit: str, scale: float = 1.0) -> Record:
    """A record from a table of time (s) and acceleration, two columns with or without a header.

    Columns are parted by commas, semicolons, tabs or spaces; decimals have a point. A unit of
    acceleration in the header must be the one that is given: ``t (s), a (gal)``.

    Parameters
    ----------
    path : path
    unit : str
        Of the acceleration, as for :func:`pulse`.
    scale : float
        Factor on all accelerations.

    Raises
    ------
    InputError
        If the file cannot be read, a row is not two numbers, or the header has another unit.

    Example
    -------
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "record.csv"
    >>> _ = file.write_text("t (s),a (g)\\n0,0\\n0.1,0.5\\n0.2,0\\n")
    >>> read_record(file, "g")
    Record('record.csv': 0.2 s, largest 4.905 m/s2)
    """
    factor, name = _factor(unit), os.path.basename(os.fspath(path))
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            text = file.read()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file_prefix(path)}cannot be read: {error}") from error
    rows = list[Sequence[float]]()
    sign = next((x for x in ";,\t" if x in text), None)
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        cells = line.split() if sign is None else next(csv.reader([line], delimiter=sign), [])
        if not any(cell.strip() for cell in cells):
            continue
        try:
            time, acceleration = (float(cell) for cell in cells)
        except ValueError as error:
            if not rows and not any(_is_number(cell) for cell in cells):
                _check_header(path, line, unit)
                continue
            raise InputError(
                f"{file_prefix(path)}line {number} must be two numbers, time in s and acceleration "
                f"in {unit}, with decimal points, got {line!r:.60}"
            ) from error
        rows.append((time, acceleration))
    if len(rows) < 2:
        raise InputError(f"{file_prefix(path)}has no rows of time and acceleration")
    table = np.array(rows)
    record = Record(table[:, 0], factor * table[:, 1], name)
    return record if scale == 1.0 else record.scaled(scale)


_UNIT = re.compile(
    r"(?<!\w)((?:mm|cm|dm|km|m|in|ft)\s*(?:/\s*s(?:ec)?\s*(?:2|²|\^2|\*\*2|/\s*s(?:ec)?)"
    r"|[*·. ]?\s*s(?:\^?[-−]2|⁻²))|gals?|%\s*g|m?g)(?!\w)",
    re.IGNORECASE,
)
"""Units of acceleration in a header, whatever is about them: ``a (cm/s^2)``, ``Acc[gal]``."""


def _check_header(path: str | os.PathLike[str], line: str, unit: str) -> None:
    """Refuses a header that has units of acceleration, and not the one given."""
    said = dict.fromkeys(_UNIT.findall(line))
    if said and _plain(unit) not in map(_plain, said):
        raise InputError(
            f"{file_prefix(path)}the header says {' and '.join(said)}, and the unit given is "
            f"{unit!r}: one of {', '.join(['g', *ACCELERATIONS])} is to be given as the file has "
            "it, others with a factor"
        )


def _plain(unit: str) -> str:
    """A unit of acceleration, however it is spelt: ``cm/s2``."""
    text = re.sub(r"\s|\^|\*\*", "", unit.lower()).replace("sec", "s").replace("²", "2")
    text = re.sub(r"[*·.]?s(?:[-−]2|⁻2)$", "/s2", text).replace("s/s", "s2")
    return "cm/s2" if text in ("gal", "gals") else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _factor(unit: str) -> float:
    """The unit of acceleration in m/s2."""
    units = {"g": G, **ACCELERATIONS}
    name = str(unit).replace("²", "2").replace("^2", "2")
    if name not in units:
        raise InputError(
            f"unit of an acceleration must be one of {', '.join(units)}, got {unit!r}"
            + meant(name, units, before="; ")
        )
    return units[name]
