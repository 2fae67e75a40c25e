"""The checker of Eq. 30: hand-made states with known answers, and what must not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvxlimit import Block, Load, Scene
from cvxlimit.extensions.interaction.restriction.lower_bound import rocking_excess
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.readings.pressure import Pressure, effective_arm
from helpers import interaction_excess

FloatArray = NDArray[np.float64]

MOMENTS = ("independent", "signed")
L1, L2, MU = 1.0, 0.5, 0.6
ARM = 0.296617
"""c_T(1, 0.5) of the design notes."""


def brick(l1: float = L1, l2: float = L2) -> Contacts:
    """One contact l1 x l2 with friction 0.6."""
    ground = Block.box("ground", (-9, -9, -1), (9, 9, 0))
    block = Block.box("block", (0, 0, 0), (l1, l2, 1), 20.0)
    scene = Scene([ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=MU)
    contacts = scene.contacts
    assert contacts.sides[0] == pytest.approx((l1, l2))
    return contacts


def as_polygon(contacts: Contacts) -> Contacts:
    """The same contacts, no longer known to be rectangles."""
    return replace(contacts, sides=np.full_like(contacts.sides, np.nan))


def forces(
    v: tuple[float, float] = (0.0, 0.0),
    normal: float = 1.0,
    e: tuple[float, float] = (0.0, 0.0),
    mt: float = 0.0,
) -> FloatArray:
    """One contact pressed at e: M1 = N e2, M2 = -N e1."""
    return np.array([[*v, normal, normal * e[1], -normal * e[0], mt]])


def excess(x: FloatArray, moments: str, contacts: Contacts | None = None) -> float:
    """In units of force x length, as Eq. 30 is written."""
    contacts = contacts or brick()
    return float(interaction_excess(x, contacts, moments)[0] * contacts.torsion_arm[0])


@pytest.mark.parametrize("moments", MOMENTS)
class TestKnownStates:
    def test_pure_torsion_uses_the_whole_arm(self, moments: str) -> None:
        assert excess(forces(mt=0.1), moments) == pytest.approx(0.1 - ARM * MU, abs=1e-6)
        assert excess(forces(mt=-0.1), moments) == pytest.approx(0.1 - ARM * MU, abs=1e-6)

    def test_pure_sliding_ends_at_friction(self, moments: str) -> None:
        assert excess(forces(v=(0.36, 0.48)), moments) == pytest.approx(0.0, abs=1e-15)
        assert interaction_excess(forces(v=(0.7, 0.0)), brick(), moments)[0] >= 0.1 - 1e-15

    def test_torsion_and_shear_share_friction(self, moments: str) -> None:
        mt = ARM * (MU - 0.5)
        assert excess(forces(v=(0.3, 0.4), mt=mt), moments) == pytest.approx(0.0, abs=1e-6)

    @pytest.mark.parametrize(("e", "arm"), [((0.5, 0.0), 0.5 / 4), ((0.0, -0.25), 1.0 / 4)])
    def test_pressed_on_an_edge_is_a_segment(
        self, moments: str, e: tuple[float, float], arm: float
    ) -> None:
        """Eq. 29: a quarter of the length of the edge."""
        assert Pressure.of(forces(e=e), brick()).arm[0] == pytest.approx(arm, rel=1e-12)
        assert excess(forces(e=e), moments) == pytest.approx(-arm * MU, rel=1e-12)

    def test_pressed_in_a_corner_carries_no_torque(self, moments: str) -> None:
        corner = (0.5, -0.25)
        assert excess(forces(e=corner), moments) == pytest.approx(0.0, abs=1e-15)
        assert excess(forces(e=corner, mt=1e-3), moments) == pytest.approx(1e-3, rel=1e-9)

    def test_effective_area_of_eq_26(self, moments: str) -> None:
        """Pressed at (0.25, 0): the effective area is 0.5 x 0.5, c = 0.5 x 0.382598."""
        x = forces(e=(0.25, 0.0), mt=0.05)
        assert excess(x, moments) == pytest.approx(0.05 - 0.5 * 0.382598 * MU, abs=1e-6)

    def test_no_force_is_admissible(self, moments: str) -> None:
        assert excess(np.zeros((1, 6)), moments) == 0.0

    @pytest.mark.parametrize("column", [0, 1, 5])
    def test_a_contact_that_does_not_press_carries_nothing(self, moments: str, column: int) -> None:
        x = np.zeros((1, 6))
        x[0, column] = 1e-3
        assert excess(x, moments) > 1e-4


def test_moment_conventions_differ_as_in_the_design_notes() -> None:
    """V2 = 0.3 at e1 = 0.25: 0.075 on top of abs(MT), or against it."""
    resisting = 0.5 * 0.382598 * (MU - 0.3)
    for mt, signed in ((0.05, 0.025), (-0.05, 0.125)):
        x = forces(v=(0.0, 0.3), e=(0.25, 0.0), mt=mt)
        assert excess(x, "signed") == pytest.approx(signed - resisting, abs=1e-6)
        assert excess(x, "independent") == pytest.approx(0.125 - resisting, abs=1e-6)
    x = forces(v=(0.3, 0.0), e=(0.0, 0.1), mt=-0.03)  # MT + e2 V1 = 0
    assert excess(x, "signed") < excess(x, "independent") - 0.05


COMPONENT = st.floats(-1.0, 1.0)


@st.composite
def pressed(draw: st.DrawFn) -> FloatArray:
    """Compression 1 anywhere in the brick's contact, any shear and torsion."""
    e = 0.499 * L1 * draw(COMPONENT), 0.499 * L2 * draw(COMPONENT)
    return forces((0.5 * draw(COMPONENT), 0.5 * draw(COMPONENT)), 1.0, e, 0.2 * draw(COMPONENT))


@given(pressed())
def test_signed_moments_are_never_stricter(x: FloatArray) -> None:
    assert excess(x, "signed") <= excess(x, "independent") + 1e-12


@given(pressed())
def test_clipped_polygons_give_eq_26(x: FloatArray) -> None:
    at = Pressure.of(x, brick())
    clipped = effective_arm(at.e1, at.e2, as_polygon(brick()))
    np.testing.assert_allclose(clipped, at.arm, rtol=1e-6)


@given(COMPONENT, COMPONENT)
def test_beyond_an_edge_the_arm_is_that_of_the_nearest_point(x: float, y: float) -> None:
    """As Eq. 26 has it by its sides, which end at zero: rounding at an edge takes no arm away."""
    e1, e2 = np.array([x * L1]), np.array([y * L2])
    expected = effective_arm(e1, e2, brick())
    np.testing.assert_allclose(effective_arm(e1, e2, as_polygon(brick())), expected, atol=1e-9)


@given(pressed(), st.floats(0.0, 2.0 * np.pi))
def test_signed_moments_do_not_depend_on_the_frame(x: FloatArray, angle: float) -> None:
    """t1 and t2 turned about n by ``angle``: corners and force components turn back."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    polygon = as_polygon(brick())
    turned = replace(polygon, corner_xy=polygon.corner_xy @ turn.T)
    y = x.copy()
    y[:, :2], y[:, 3:5] = x[:, :2] @ turn.T, x[:, 3:5] @ turn.T
    assert excess(y, "signed", turned) == pytest.approx(excess(x, "signed", polygon), abs=1e-7)


@given(pressed(), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
@pytest.mark.parametrize("moments", MOMENTS)
def test_units_do_not_matter(moments: str, x: FloatArray, force: float, length: float) -> None:
    """The excess is a force: it scales with the unit of force alone."""
    y = x * force * np.array([1.0, 1.0, 1.0, length, length, length])
    scaled = interaction_excess(y, brick().scaled(length), moments)[0]
    plain = interaction_excess(x, brick(), moments)[0]
    assert scaled == pytest.approx(force * plain, rel=1e-9, abs=1e-12 * force)


@pytest.mark.parametrize("polygon", [False, True])
def test_rocking_and_tension_in_force_units(polygon: bool) -> None:
    contacts = as_polygon(brick()) if polygon else brick()
    assert rocking_excess(forces(e=(0.5, 0.25)), contacts)[0] == pytest.approx(0.0, abs=1e-12)
    assert rocking_excess(forces(e=(0.55, 0.0)), contacts)[0] == pytest.approx(0.1, rel=1e-9)
    assert rocking_excess(forces(e=(0.0, -0.3)), contacts)[0] == pytest.approx(0.2, rel=1e-9)
    assert rocking_excess(forces(normal=-0.1), contacts)[0] == pytest.approx(0.1, rel=1e-9)
    assert rocking_excess(forces(), contacts)[0] < 0.0
