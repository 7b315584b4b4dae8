"""A ball that bounces: which loss does it have beyond a constant restitution? Change what is yours.

Recording: a CSV file with one line of heading and the time of each bounce in seconds.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq_app.gap.own_model import (
    Effect,
    Library,
    Measured,
    Parameter,
    Prediction,
    Scatter,
    measured,
    model_of,
    positive,
    signed,
)

G = 9.81


def load(path: Path) -> Measured:
    """One recording → one run: the features are the times between bounces."""
    flights = np.diff(np.loadtxt(path, delimiter=",", skiprows=1))
    return measured(
        path.stem, flights, sd=1e-3, channel="microphone", observable="flight", unit="s", amplitude=flights
    )


def simulate(run: Measured, q: Mapping[str, float]) -> Prediction:
    """Each flight from the one measured before it: down with drag, a bounce, up and down again."""
    drag = q.get("air_drag.c", 0.0) + 1e-9  # deceleration is drag · v²
    before = G * run.values[:-1] / 2
    before *= 1 + drag * before**2 / (4 * G)  # with drag a ball has to start faster to fly as long
    landing = before / np.sqrt(1 + drag * before**2 / G)
    e = q["e"] + q.get("speed_dependent_loss.k", 0.0) * (landing - 2.0)
    root = np.sqrt(drag / G)
    up = root * np.concatenate([[G * q["first"] / 2], e * landing])
    flights = (np.arctan(up) + np.arcsinh(up)) / (root * G) + q.get("contact.tau", 0.0)
    return Prediction(flights, {"scatter of e": flights * (np.arange(flights.size) > 0)})


model = model_of(
    "bouncing ball",
    simulate,
    unknowns=[Parameter("e", 0.8, 0.1, "1", 0.1, 1.0, meaning="restitution")],
    per_run=[Parameter("first", 0.5, 0.5, "s", 0.01, 5.0, meaning="first flight")],
    scatters=[Scatter("scatter of e", 0.005, 1.0, "1", "relative, from bounce to bounce")],
)
library = Library(
    [
        Effect("air_drag", "air", (positive("c", 0.1, "1/m"),), "v̇ = −c v|v|", "drag of a sphere"),
        Effect("speed_dependent_loss", "bounce", (signed("k", 0.05, "s/m"),), "e + k (v − 2)", "yielding"),
        Effect("contact", "bounce", (signed("tau", 0.01, "s"),), "flight + τ", "time on the floor"),
    ]
)
