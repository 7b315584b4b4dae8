"""A simulated test straight into a run file: same wall, sensors, modules and analysis, no waiting."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from daq_app.acquisition.course.tare import NotSteady
from daq_app.acquisition.session.offline import Readings, record_offline
from daq_app.campaign.names import TestName
from daq_app.config import ConfigError, Problem, load_rig, plan_tasks
from daq_app.runfile import RunFileError
from sim_hardware.direct import synthesise_test
from sim_hardware.dynamics.spec import parse_effect


def simulate_run(
    rig_file: Path,
    out: Path,
    *,
    level: str,
    theta0_over_alpha: float,
    r: float | None,
    seed: int | None,
    test: str | None,
    effects: Sequence[str] = (),
) -> Path:
    """Simulate one test and write its run to `out`; `effects` such as ``viscous:zeta=0.006``.

    Raises `ConfigError` and `RunFileError` in words.
    """
    rig = load_rig(rig_file)
    plan = plan_tasks(rig, str(rig_file))
    try:
        simulated = synthesise_test(
            rig,
            plan,
            theta0_over_alpha,
            seed,
            restitution=r,
            effects=dict(parse_effect(effect) for effect in effects),
            post_rest_s=rig.acquisition.post_rest_s + 2.0,
        )
    except (ValueError, LookupError) as error:
        raise ConfigError(
            [Problem(str(rig_file), "simulation", str(error), "Correct the rig file or the option")]
        ) from error
    readings = Readings(simulated.readings, "simulated without real time", dict(simulated.truth))
    name = test or _test_named_by(out, rig.specimen.name, level)
    try:
        return record_offline(rig, rig_file.read_text(encoding="utf-8"), plan, readings, out, name)
    except NotSteady as error:
        raise RunFileError(
            str(error), advice="Give the simulated wall a longer simulation.upright_s in the rig file."
        ) from error


def _test_named_by(out: Path, specimen: str, level: str) -> str:
    """The test that the file's name is the name of, if it is one of this level; else the first of it."""
    try:
        named = TestName.parse(out.stem)
    except ValueError:
        named = None
    fits = named is not None and (named.specimen, named.level) == (specimen, level)
    return out.stem if fits else f"{specimen}-{level}-1"
