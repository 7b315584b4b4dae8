"""Laboratories drawn for the study of r: a seed names one test."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from daq_app.config import load_rig
from studies.restitution.laboratory import draw_test

ROOT = Path(__file__).parents[2]
DRAWN = """
from daq_app.config import load_rig
from studies.restitution.laboratory import draw_test
test = draw_test(load_rig("configs/fr1.toml"), 5000)
print([float(value) for value in test.si.std(axis=1).round(9)])
"""


def test_a_seed_draws_the_same_test_in_every_process():
    elsewhere = subprocess.run(
        [sys.executable, "-c", DRAWN],
        cwd=ROOT,
        env=os.environ | {"PYTHONHASHSEED": "1"},
        capture_output=True,
        text=True,
        check=True,
    )

    here = draw_test(load_rig(ROOT / "configs" / "fr1.toml"), 5000)

    assert elsewhere.stdout.strip() == str([float(value) for value in here.si.std(axis=1).round(9)])
