"""Closed forms against the numbers the project must reproduce, and bad input in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.config import load_rig
from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.block import RigidBlock

TABLE_3_1 = {
    # name: weight N, inertia, R0, alpha0, p printed, mass, base width, I_G
    "Original": (48.2e3, 15426.0, 1.535, 0.213, 2.19, 4913, 0.649, 3849),
    "FR1": (51.3e3, 16107.0, 1.525, 0.215, 2.20, 5229, 0.651, 3945),
    "FR2": (52.8e3, 17652.0, 1.574, 0.208, 2.17, 5382, 0.650, 4318),
}


@pytest.mark.parametrize("name", TABLE_3_1)
def test_table_3_1(name):
    weight, inertia, r0, alpha, p, mass, width, inertia_g = TABLE_3_1[name]
    block = RigidBlock(weight, r0, inertia, alpha)
    assert block.p_rad_s == pytest.approx(p, abs=0.006)
    assert block.mass_kg == pytest.approx(mass, abs=1)
    assert block.base_width_m == pytest.approx(width, abs=6e-4)
    assert block.centroid_inertia_kg_m2 == pytest.approx(inertia_g, abs=1.5)


@pytest.mark.parametrize(
    ("name", "p", "rectangular", "any_block"),
    [("FR1", 2.204, 0.9317, 0.9313), ("FR2", 2.170, 0.9360, 0.9356)],
)
def test_p_and_r_max(name, p, rectangular, any_block):
    weight, inertia, r0, alpha = TABLE_3_1[name][:4]
    block = RigidBlock(weight, r0, inertia, alpha)
    assert block.p_rad_s == pytest.approx(p, abs=5e-4)
    assert block.r_max_rectangular == pytest.approx(rectangular, abs=5e-5)
    assert block.r_max == pytest.approx(any_block, abs=5e-5)


def test_shipped_rigs_are_the_table(configs):
    for name in ("fr1", "fr2"):
        block = RigidBlock.from_specimen(load_rig(configs / f"{name}.toml").specimen)
        weight, inertia, r0, alpha = TABLE_3_1[name.upper()][:4]
        assert (block.weight_n, block.inertia_kg_m2) == (weight, inertia)
        assert (block.r0_m, block.alpha0_rad) == (r0, alpha)


def test_a_homogeneous_rectangle_meets_both_bounds_at_once():
    block = RigidBlock.rectangular(base_width_m=0.6, height_m=2.8, weight_n=50e3)
    assert block.r_max == pytest.approx(block.r_max_rectangular, rel=1e-14)


def test_period_4_1():
    periods = theory.period([0.15, 0.25, 0.35, 0.40], 2.20)
    np.testing.assert_allclose(periods, [1.065, 1.446, 1.811, 1.997], atol=5e-4)
    np.testing.assert_allclose(periods, 4 / 2.2 * np.arccosh(1 / (1 - np.array([0.15, 0.25, 0.35, 0.40]))))


@pytest.mark.parametrize(
    ("r", "impacts", "time_s"), [(0.819, 11, 3.43), (0.895, 19, 6.05), (0.931, 29, 9.31)]
)
def test_number_of_impacts_and_duration(r, impacts, time_s):
    assert theory.impacts_until(0.005, 0.35, r) == impacts
    assert theory.amplitude_after(impacts, 0.35, r) < 0.005 <= theory.amplitude_after(impacts - 1, 0.35, r)
    assert theory.time_to_decay(0.005, 0.35, r, 2.20) == pytest.approx(time_s, abs=5e-3)


def test_semi_rigid_fr1():
    weight, inertia, r0, alpha = TABLE_3_1["FR1"][:4]
    shifted = RigidBlock(weight, r0, inertia, alpha).semi_rigid(1.28e6, 1.2)
    assert shifted.a_m == pytest.approx(0.033, abs=5e-4)
    assert shifted.alpha0_rad == pytest.approx(0.194, abs=5e-4)
    assert shifted.p_rad_s == pytest.approx(2.206, abs=5e-4)


phis = st.floats(1e-6, 0.95)
rs = st.floats(0.3, 1.0)


@given(phis, rs, st.integers(0, 30))
def test_decay_is_consistent(phi0, r, n):
    """(4.2), (4.3) and (4.1) say the same of the half-cycle after impact n; CRT inverts (4.3)."""
    phi_n = theory.amplitude_after(n, phi0, r)
    assert theory.period_after(n, phi0, r, 2.2) == pytest.approx(theory.period(phi_n, 2.2), rel=1e-9)
    assert theory.energy(phi_n) == pytest.approx(r ** (2 * n) * theory.energy(phi0), rel=1e-9)
    if n:
        assert theory.restitution_from_peaks(phi0, phi_n, n) == pytest.approx(r, rel=1e-9)


@given(phis, rs, st.integers(1, 20))
def test_eav_inverts_the_impact_speeds(phi0, r, n):
    before = theory.impact_speed(theory.amplitude_after(n - 1, phi0, r), 2.2, 0.215)
    later = theory.impact_speed(theory.amplitude_after(n + 1, phi0, r), 2.2, 0.215)
    assert theory.restitution_from_speeds(before, -later) == pytest.approx(r, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: theory.period(1.0, 2.2), "amplitude"),
        (lambda: theory.period([0.1, -0.2], 2.2), r"-0\.2"),
        (lambda: theory.period(0.2, 0.0), "parameter p"),
        (lambda: theory.period(float("nan"), 2.2), "amplitude"),
        (lambda: theory.amplitude_after(1.5, 0.2, 0.9), "whole number"),
        (lambda: theory.amplitude_after(2, 0.2, 1.1), "restitution"),
        (lambda: theory.impacts_until(0.01, 0.35, 1.0), "never decays"),
        (lambda: theory.time_of_impact(0, 0.3, 0.9, 2.2), "counted from 1"),
        (lambda: theory.restitution_from_peaks(0.3, 0.2, 0), "at least one impact"),
        (lambda: theory.restitution_from_speeds(0.0, 0.1), "speed at impact n"),
        (lambda: RigidBlock(51300, 1.525, 12000, 0.215), "inertia about the corner"),
        (lambda: RigidBlock(51300, 1.525, 16107, 2.0), "angle"),
        (lambda: RigidBlock(51300, 1.525, 16107, 0.215).semi_rigid(1e5, 1.2), "crush"),
    ],
)
def test_bad_input_is_refused_in_words(call, words):
    with pytest.raises(ValueError, match=words):
        call()
