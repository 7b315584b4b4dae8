"""The diagnosis itself, which knows nothing about rocking.

A `Model` predicts the features of a run from parameters; a `Library` holds the effects that the
model may lack; `diagnose` says where model and runs differ, which effect explains it and how much
of the gap it closes. The same core serves the rocking wall (`daq_app.gap.rocking_model`) and the
small models of `studies/real_gap`.
"""

from daq_app.gap.core.diagnose import diagnose
from daq_app.gap.core.effects import Confusion, Effect, Indistinguishable, Library
from daq_app.gap.core.features import FeatureSet, Label, Run
from daq_app.gap.core.findings import Finding
from daq_app.gap.core.fitting.fit import Fit, fit
from daq_app.gap.core.judging.hypotheses import Options
from daq_app.gap.core.model import Model, Prediction, Scatter
from daq_app.gap.core.parameters import Parameter
from daq_app.gap.core.result import CannotDiagnose, Diagnosis

__all__ = [
    "CannotDiagnose",
    "Confusion",
    "Diagnosis",
    "Effect",
    "FeatureSet",
    "Finding",
    "Fit",
    "Indistinguishable",
    "Label",
    "Library",
    "Model",
    "Options",
    "Parameter",
    "Prediction",
    "Run",
    "Scatter",
    "diagnose",
    "fit",
]
