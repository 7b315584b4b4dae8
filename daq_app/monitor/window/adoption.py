"""What a window takes over from the acquisition as it comes: rig, folder, zero, check, state, the past."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from daq_app.acquisition.messages.published import UNARMED, CheckMessage, EventMessage, StateMessage
from daq_app.campaign.summaries.store import SUFFIX as RESULT_SUFFIX
from daq_app.config import ConfigError, parse_rig
from daq_app.config.rig import Rig
from daq_app.monitor.data.session import Session
from daq_app.monitor.pages.gap_page import GapPage
from daq_app.monitor.pages.prepare_page import PreparePage, Zero
from daq_app.monitor.widgets.notices import NoticeLine
from daq_app.monitor.window.what_to_tell import trouble_of


class Adoption:
    """Hands what the acquisition says of itself to session and pages."""

    def __init__(
        self, session: Session, prepare: PreparePage, gap: GapPage, notices: NoticeLine, *, may_command: bool
    ) -> None:
        """`may_command`: whether this window may give orders, and work a simulated wall."""
        prepare.may_command = may_command
        self._session, self._prepare, self._gap, self._notices = session, prepare, gap, notices
        self._may_command = may_command
        self._rig_text = ""
        self._told_past = False
        self.runs_folder: Path | None = None
        self.makes_results = False
        """Whether the recorder makes the result of a run."""

    def awaits_result(self, run: Path) -> bool:
        """Whether the recorder will tell when the result of a run is there: it makes that of every test."""
        made = run.with_suffix(RESULT_SUFFIX).is_file()
        return self.makes_results and not made and not run.stem.startswith(f"{UNARMED}_")

    def take_rig(self, about: Mapping[str, Any]) -> Rig | None:
        """The rig, if it is another one than before; a file that cannot be read here is told."""
        text = str(about.get("rig_text", ""))
        if not text or text == self._rig_text:
            return None
        try:
            rig = parse_rig(text, str(about.get("rig_name", "rig")))
        except ConfigError as error:
            self._notices.tell("error", f"The acquisition's rig file cannot be read here: {error}")
            return None
        self._rig_text = text
        self._session.set_rig(rig, float(about.get("rate_hz", 0.0) or 0.0) or rig.acquisition.rate_hz)
        self._prepare.set_rig(rig)
        return rig

    def take(self, about: Mapping[str, Any]) -> StateMessage | None:
        """Everything but the rig; returns the state, if one is known."""
        ours = about.get("simulated") and self._may_command
        self._prepare.wall.set_address(str(about.get("connection", "")) if ours else "")
        folder = str(about.get("folder", ""))
        self.runs_folder = Path(folder) if folder else None
        if self.runs_folder is not None and self.runs_folder != self._gap.folder:
            self._gap.set_folder(self.runs_folder)
        self._prepare.planned_rate_hz = float(about.get("planned_rate_hz", 0.0) or 0.0)
        if "tare" in about:
            self._prepare.set_zero(Zero(dict(about["tare"]), dict(about.get("tare_record", {}))))
            self._session.set_zeroed(bool(about["tare"]))
        if "check" in about:
            self._prepare.show_check(CheckMessage.model_validate({"check": about["check"]}).check)
        self.makes_results = bool(about.get("makes_results"))
        self._take_past(about.get("events", []))
        return StateMessage.model_validate(about["state"]) if about.get("state") else None

    def _take_past(self, events: Sequence[Any]) -> None:
        """What was said before this window came: warnings are told now, the arming dates the run."""
        if self._told_past:
            return
        self._told_past = True
        past = [EventMessage.model_validate(event) for event in events]
        self._session.adopt_past(past)
        for event in past:
            trouble = trouble_of(event)
            if event.severity != "info":
                self._notices.tell(event.severity, event.text, trouble)
            elif trouble:
                self._notices.settle(trouble)
