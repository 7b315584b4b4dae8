"""θ0 is the rotation that the wall is let go from, also where it sways on what holds it."""

from __future__ import annotations

import pytest

from daq_app.rocking import AnalysisOptions, TestRecord, analyse_record


@pytest.mark.parametrize("frequency_hz", [0.4, 1.0])
def test_theta0_of_a_wall_that_sways_is_what_it_is_let_go_from(made, frequency_hz):
    """The mean of the last half second is 0.2 to 0.4 % off, and tiltmeters show it 0.3 s late."""
    test = made(phi=0.35, r=0.895, seed=8, full=True, sway_share=0.003, sway_hz=frequency_hz)
    record = TestRecord.from_array(test.rig, test.rate_hz, test.si, time_offsets_s=test.offsets_s)

    theta0 = analyse_record(record, AnalysisOptions(bias_runs=0, fit=False)).theta0_by_family

    assert set(theta0) == {"tiltmeters", "wires", "lvdts", "best"}
    for family, value in theta0.items():
        assert value.value == pytest.approx(test.motion.peaks_rad[0], rel=5e-4), family
