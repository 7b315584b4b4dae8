"""Universal files: dataset 58, time histories of modal-analysis programs, read with pyuff."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Spool

_TIME_RESPONSE: Final = 1
_EVEN: Final = 1
_DIRECTIONS: Final = {1: "x", 2: "y", 3: "z", -1: "-x", -2: "-y", -3: "-z"}


class UffReader:
    """See `Reader`. Time responses only, at even spacing; a channel is called by node and direction."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        del source
        import pyuff

        self.findings = Findings()
        self.time_channel = self.time_hint = None
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                file = pyuff.UFF(str(path))
                places = [int(place) for place in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
                sets: list[dict[str, Any]] = [file.read_sets(place) for place in places]
        except OSError as error:
            raise RunFileError(
                f"{path} cannot be read ({error.strerror})", advice="Check the name."
            ) from error
        except Exception as error:
            raise RunFileError(f"{path} is no universal file that pyuff reads ({error})") from error
        self._sets = [
            one for one in sets if one["func_type"] == _TIME_RESPONSE and one["abscissa_spacing"] == _EVEN
        ]
        if not self._sets:
            raise RunFileError(f"{path} holds no evenly spaced time histories (dataset 58, function type 1)")
        if len(self._sets) < len(sets):
            self.findings.doubts.append(
                f"{len(sets) - len(self._sets)} datasets are no time histories: passed over"
            )
        names = [_name(one) for one in self._sets]
        self._names = [
            name if names.count(name) == 1 else f"{name} (set {k + 1})" for k, name in enumerate(names)
        ]
        self.channels = tuple(
            ForeignChannel(
                name,
                unit=str(one.get("ordinate_axis_units_lab", "")).strip().replace("NONE", ""),
                increment_s=float(one["abscissa_inc"]),
                n_declared=int(one["num_pts"]),
                aliases=(str(one.get("id1", "")).strip(),),
            )
            for name, one in zip(self._names, self._sets, strict=True)
        )

    def copy(self, spool: Spool) -> None:
        for name in spool.names:
            spool.append(name, np.asarray(self._sets[self._names.index(name)]["data"], dtype=np.float64))

    def close(self) -> None:
        """Nothing stays open between the calls."""


def _name(one: dict[str, Any]) -> str:
    direction = _DIRECTIONS.get(int(one.get("rsp_dir", 0)), "")
    return f"node {int(one.get('rsp_node', 0))} {direction}".strip()
