"""Anyone's simulator against anyone's recordings: what a model file imports.

A model file defines `load` (a recording → a run), `model` and `library`; `starter` is one to begin with.
``daq-app gap starter my_model.py`` writes it, ``daq-app gap diagnose --model my_model.py DATA…`` uses it.
"""

from daq_app.gap.core import (
    Confusion,
    Effect,
    FeatureSet,
    Label,
    Library,
    Model,
    Parameter,
    Prediction,
    Run,
    Scatter,
)
from daq_app.gap.core.parameters import between, positive, signed
from daq_app.gap.own_model.building import Measured, measured, model_of

__all__ = [
    "Confusion",
    "Effect",
    "FeatureSet",
    "Label",
    "Library",
    "Measured",
    "Model",
    "Parameter",
    "Prediction",
    "Run",
    "Scatter",
    "between",
    "measured",
    "model_of",
    "positive",
    "signed",
]
