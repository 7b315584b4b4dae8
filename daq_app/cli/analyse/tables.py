"""The analysis of a test as tables for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from daq_app.config.wording import plus_minus
from daq_app.rocking.families.verdict_words import verdict_sentence

if TYPE_CHECKING:
    from daq_app.rocking.analysis.results import Bias, TestAnalysis, ValueWithSigma
    from daq_app.rocking.estimators import RestitutionEstimate

_ZERO_WORDS = {
    "tare": "the tare before the test",
    "rest": "the rest after the test",
    "certificates": "the offsets of the certificates (no tare, and no other zero was taken)",
}
_TRUST_STYLES = {"good": "bold green", "remarks": "bold yellow", "doubtful": "bold red"}
_METHODS = {
    "eav": "EAV (4.4), one-sided fits",
    "crt": "CRT (4.5)",
    "fit": "fit of the whole motion",
    "crt_exact": "CRT, exact potential",
    "eav_filtered": "EAV, filtered peaks (as the paper)",
    "eav_filtered_corrected": "EAV, filtered peaks, loss corrected",
    "eav_best": "EAV, wires and LVDTs fused",
    "crt_best": "CRT, wires and LVDTs fused",
    "eav_lvdts": "EAV, LVDTs alone",
    "crt_lvdts": "CRT, LVDTs alone",
    "eav_wires": "EAV, wires alone",
    "crt_wires": "CRT, wires alone",
}


def analysis_tables(analysis: TestAnalysis) -> Iterator[RenderableType]:
    """Heading, θ0, half-cycles, r by method, joint and residuals, notes."""
    yield Text(f"{analysis.label or 'run'}: {_headline(analysis)}", style="bold")
    if analysis.found:
        yield Text(f"Zero of every sensor: {_ZERO_WORDS[analysis.zero]}.")
        yield Text(verdict_sentence(analysis.verdict), style=_TRUST_STYLES[analysis.verdict.trust])
        yield _families_table(analysis)
        yield _theta0_table(analysis)
        yield _cycle_table(analysis)
        yield Text(
            "θ̇⁻, θ̇⁺: one-sided fits of each half-cycle. Filtered: " + analysis.filter_statement, style="dim"
        )
        yield _restitution_table(analysis)
        yield _base_table(analysis)
    for note in analysis.notes:
        style = "bold yellow" if note.severity == "warning" else "dim"
        yield Text(f"{note.severity}: {note.text}", style=style)


def _families_table(analysis: TestAnalysis) -> Table:
    table = _table(
        "What each family says", "family", "θ0 mrad", "EAV", "CRT", "α rad", "p rad/s", "impacts", "late ms",
        "remarks",
    )  # fmt: skip
    for view in analysis.families:
        table.add_row(
            view.family + (" *" if view.used else ""),
            _value(view.theta0_rad, view.sigma_theta0_rad, 3, 1e3),
            _value(view.eav, view.sigma_eav, 4),
            _value(view.crt, view.sigma_crt, 4),
            _value(view.alpha_rad, view.sigma_alpha_rad, 4),
            _value(view.p_rad_s, view.sigma_p_rad_s, 4),
            str(view.impacts or "–"),
            _number(view.late_s, 2, 1e3),
            ", ".join(view.remarks),
        )
    return table


def _value(value: float, sigma: float, digits: int, scale: float = 1.0) -> str:
    return f"{_number(value, digits, scale)} {plus_minus(sigma * scale, digits)}".rstrip()


def _headline(analysis: TestAnalysis) -> str:
    if not analysis.found:
        return "no release test found"
    impacts = len(analysis.half_cycles) - 1
    span = analysis.half_cycles[-1].start_s - analysis.release_s
    where = "+x" if analysis.side > 0 else "−x"
    return (
        f"θ0/α = {analysis.theta0_over_alpha:.4f} towards {where}, released at {analysis.release_s:.4f} s, "
        f"{impacts} impacts in {span:.2f} s"
    )


def _number(value: float, digits: int, scale: float = 1.0) -> str:
    return f"{value * scale:.{digits}f}" if math.isfinite(value) else "–"


def _pm(value: ValueWithSigma | None, digits: int, scale: float) -> str:
    if value is None or not math.isfinite(value.value):
        return "–"
    return _value(value.value, value.sigma, digits, scale)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", header_style="bold", pad_edge=False)
    for index, name in enumerate(columns):
        whole = index == 0 or name == "plain mean"  # a mean and its error belong on one line
        table.add_column(name, justify="left" if index == 0 else "right", no_wrap=whole)
    return table


def _theta0_table(analysis: TestAnalysis) -> Table:
    table = _table("Release rotation θ0", "from", "mrad", "θ0/α")
    for name, value in analysis.theta0_by_family.items():
        name = "LVDTs" if name == "lvdts" else name
        table.add_row(name, _pm(value, 3, 1e3), _pm(value, 5, 1.0 / analysis.theory.alpha_rad))
    return table


def _cycle_table(analysis: TestAnalysis) -> Table:
    table = _table(
        "Half-cycles: n is the impact that begins it, 0 the release",
        "n", "t s", "θ/α peak", "T/2 s", "T/2 (4.1)", "θ̇⁻ rad/s", "θ̇⁺", "filtered", "θ̇⁺/θ̇⁻",
        "EAV", "CRT", "shock ms",
    )  # fmt: skip
    eav = {point.impact: point.r for point in analysis.estimates["eav"].points}
    crt = {point.last: point.r for point in analysis.estimates["crt"].points}
    for cycle in analysis.half_cycles:
        shock = (cycle.accelerometer_s - cycle.start_s) * 1e3
        table.add_row(
            str(cycle.n),
            _number(cycle.start_s - analysis.release_s, 4),
            _number(cycle.phi, 4),
            _number(cycle.duration_s, 4),
            _number(cycle.period_theory_s, 4),
            _number(cycle.speed_before_rad_s, 4),
            _number(cycle.speed_after_rad_s, 4),
            _number(cycle.speed_filtered_rad_s, 4),
            _number(cycle.jump_ratio, 3),
            _number(eav.get(cycle.n, math.nan), 4),
            _number(crt.get(cycle.n, math.nan), 4),
            _number(shock, 2),
        )
    return table


def _restitution_table(analysis: TestAnalysis) -> Table:
    table = _table(
        f"Coefficient of restitution; r_max = {analysis.theory.r_max:.4f} (1.2), "
        f"{analysis.theory.r_max_block:.4f} for this block",
        "method", "r", "std error", "95 % interval", "r/r_max", "plain mean", "bias, simulated", "points",
    )  # fmt: skip
    for key, name in _METHODS.items():
        bias = _bias(analysis.bias.get(key))
        if key == "fit":
            if analysis.fit is not None:
                r, error = analysis.fit.r, analysis.fit.standard_error
                interval = "{:.4f} … {:.4f}".format(*analysis.fit.interval95())
                share = _number(r / analysis.theory.r_max, 3)
                table.add_row(
                    name, f"{r:.4f}", f"{error:.5f}", interval, share, "", bias, str(analysis.fit.impacts)
                )
            continue
        estimate = analysis.estimates.get(key)
        if estimate is not None and estimate.r is not None:
            table.add_row(
                name, *_estimate_cells(estimate, analysis.theory.r_max), bias, str(len(estimate.points))
            )
    return table


def _estimate_cells(estimate: RestitutionEstimate, r_max: float) -> tuple[str, ...]:
    assert estimate.r is not None and estimate.standard_error is not None
    interval = estimate.interval95()
    plain = estimate.plain_mean if estimate.plain_mean is not None else math.nan
    error = estimate.plain_standard_error
    return (
        f"{estimate.r:.4f}",
        f"{estimate.standard_error:.5f}",
        "–" if interval is None else f"{interval[0]:.4f} … {interval[1]:.4f}",
        _number(estimate.r / r_max, 3),
        _number(plain, 4) + ("" if error is None else f" {plus_minus(error)}"),
    )


def _bias(bias: Bias | None) -> str:
    return "" if bias is None else f"{bias.mean:+.5f}"


def _base_table(analysis: TestAnalysis) -> Table:
    table = _table("Wall and base joint", "quantity", "value", "theory")
    theory, fit, joint, left = analysis.theory, analysis.fit, analysis.joint, analysis.residuals
    if fit is not None:
        for name, value, sigma, survey in (
            ("p fitted, rad/s", fit.p_rad_s, fit.sigma_p_rad_s, theory.p_rad_s),
            ("α fitted, rad", fit.alpha_rad, fit.sigma_alpha_rad, theory.alpha_rad),
        ):
            error = plus_minus(sigma) or "(nearest block; no error is known)"
            table.add_row(name, f"{value:.4f} {error}", f"{survey:.4f}")
        inset = f"{fit.inset_rad * 1e3:.2f} {plus_minus(fit.sigma_inset_rad * 1e3, 2)}"
        table.add_row("what the edges yield by, mrad of α", inset, "0")
        table.add_row(
            "misfit of the fit, mrad rms", f"{fit.residual_rad * 1e3:.4f}", f"noise {fit.noise_rad * 1e3:.4f}"
        )
    if joint is not None:
        inset = f"0 rigid, {joint.inset_theory_m * 1e3:.1f} semi-rigid"
        table.add_row("pivot inset, leaning to −x, mm", _number(joint.inset_left_m, 2, 1e3), inset)
        table.add_row("pivot inset, leaning to +x, mm", _number(joint.inset_right_m, 2, 1e3), inset)
        table.add_row("length in contact, median, mm", _number(joint.contact_m, 2, 1e3), "")
        table.add_row("twist in the hold, mrad/m", _number(joint.twist_hold_rad_per_m, 3, 1e3), "0")
        table.add_row("largest twist, mrad/m", _number(joint.twist_peak_rad_per_m, 3, 1e3), "0")
        table.add_row("LVDT rotation / wire rotation", _number(joint.gain_to_wires, 4), "1")
    if left is not None:
        table.add_row("residual rotation, wires, mrad", _pm(left.rotation_wires_rad, 3, 1e3), "0")
        table.add_row("residual rotation, LVDTs, mrad", _pm(left.rotation_lvdts_rad, 3, 1e3), "0")
        table.add_row("residual rotation, tiltmeters, mrad", _pm(left.rotation_tilt_rad, 3, 1e3), "0")
        table.add_row("sliding of the base, mm", _pm(left.sliding_m, 3, 1e3), "0")
    table.add_row("noise of the rotation, mrad rms", f"{analysis.noise_rad * 1e3:.4f}", "")
    return table
