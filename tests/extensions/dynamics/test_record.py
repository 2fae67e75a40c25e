"""Records: areas, units, and tables that are none. No engine is needed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import builtin_scene, pulse, read_record, shake
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.dynamics.record import Record


@pytest.mark.parametrize(
    ("shape", "area"), [("rectangle", 1.0), ("half-sine", 2.0 / np.pi), ("sine", 0.0)]
)
def test_areas_of_pulses(shape: str, area: float) -> None:
    made = pulse(shape, 0.5, 2.0)  # type: ignore[arg-type]
    assert made.velocity(2.0) == pytest.approx(area * 0.5 * 9.81 * 2.0, rel=1e-5, abs=1e-9)
    assert made.velocity(9.0) == made.velocity(2.0)
    assert made.scaled(-2.0).velocity(0.7) == pytest.approx(-2.0 * made.velocity(0.7))


def test_velocity_is_the_integral_also_across_jumps() -> None:
    record = Record(np.array([0.5, 1.0, 1.0, 2.0]), np.array([0.0, 2.0, 1.0, 1.0]))
    assert [record.velocity(t) for t in (0.0, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)] == pytest.approx(
        [0.0, 0.0, 0.125, 0.5, 1.0, 1.5, 1.5]
    )


@pytest.mark.parametrize(
    ("unit", "size"), [("g", 9.81), ("m/s2", 1.0), ("cm/s²", 0.01), ("gal", 0.01)]
)
@pytest.mark.parametrize("sign", [",", ";", "\t", "  "])
def test_tables(unit: str, size: float, sign: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("\n".join(sign.join(row) for row in (("t", "a"), ("0", "1"), ("0.5", "-3"))))
    record = read_record(file, unit)
    assert record.acceleration.tolist() == [size, -3.0 * size]
    assert record.times.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,a\n0,1\n0.1,b\n", "line 3 must be two numbers"),
        ("t;a\n0;1\n0,1;2\n", "line 3"),
        ("0,1,2\n", "line 1"),
        ("t,a\n0,1\n", "no rows"),
        ("0,1\n1,2\n0.5,3\n", "not fall, got 0.5 s in row 3"),
        ("0,1\n1,nan\n", "finite"),
    ],
)
def test_tables_that_are_none(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=said):
        read_record(file, "g")


HEADERS = {
    "g": ["t (s),a (g)", "time;Acc [g]", "t a/g"],
    "gal": ["t,a (gal)", "t,Acc[Gals]", "t;a in cm/s^2", "t,a cm/s/s", "t,a (cm s-2)", "t,cm/sec²"],
    "m/s2": ["t,a (m/s2)", "t,a (M/S**2)", "t,a [m s⁻²]", "t,a [m·s^-2]", "t;a m/sec/sec"],
    "mm/s2": ["t,a (mm/s2)", "t,a mm/s²"],
    "": ["t,a", "t,a_g", "Time (s),ground motion", "t (s),velocity (m/s)", "sec,ug"],
}


@pytest.mark.parametrize("header", [text for texts in HEADERS.values() for text in texts])
def test_a_unit_in_the_header_is_the_one_given(header: str, tmp_path: Path) -> None:
    """Otherwise it is refused, showing both; a header without one says nothing."""
    file = tmp_path / "a.csv"
    sign = next((x for x in ";," if x in header), " ")
    file.write_text(f"{header}\n0{sign}0\n1{sign}3\n2{sign}0\n")
    own = next(unit for unit, texts in HEADERS.items() if header in texts)
    for unit, size in {"g": 29.43, "gal": 0.03, "m/s2": 3.0, "mm/s2": 0.003}.items():
        if own in ("", unit):
            assert read_record(file, unit).largest == pytest.approx(size)
        else:
            with pytest.raises(InputError, match=rf"header says .*unit given is '{unit}'"):
                read_record(file, unit)


@pytest.mark.parametrize(
    ("largest", "unit", "question"),
    [
        (300.0, "g", "4.1 g: is the record in gal?"),
        (980.0, "m/s2", "4.1 g: is the record in gal?"),
        (0.3, "gal", "is the record in g?"),
        (0.8, "mm/s2", "is the record in g?"),
        (300.0, "gal", ""),
        (0.3, "g", ""),
        (4.0, "g", ""),
    ],
)
def test_accelerations_that_no_ground_has_are_asked_about(
    largest: float, unit: str, question: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.csv"
    file.write_text(f"0,0\n1,{largest}\n2,0\n")
    record = read_record(file, unit)
    assert record.doubt.endswith(question)
    assert bool(record.doubt) is bool(question)
    assert question in repr(record)


def test_what_is_asked_wrongly() -> None:
    with pytest.raises(InputError, match="did you mean 'sine'"):
        pulse("sin", 1.0, 1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="unit of an acceleration"):
        pulse("sine", 1.0, 1.0, "m")
    with pytest.raises(InputError, match="duration"):
        pulse("sine", 1.0, 0.0)


def test_without_the_engine_one_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ModelError, match=r'need mujoco: pip install "cvxlimit\[dynamics\]"'):
        shake(builtin_scene("single-block"), pulse("sine", 0.5, 1.0))
