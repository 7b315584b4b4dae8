"""What the operator orders: arming, notes and markers, the next test of the campaign, verdicts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.checks.check_model import Verdict
from daq_app.acquisition.course.tare import UNZEROED
from daq_app.campaign.plan import Campaign
from daq_app.campaign.verdicts import give_verdict
from daq_app.config import ConfigError
from daq_app.monitor.data.link import Link
from daq_app.monitor.data.session import RECORDING, Session
from daq_app.monitor.pages.campaign_page import CampaignPage
from daq_app.monitor.pages.prepare_page import PreparePage
from daq_app.monitor.pages.result_page import ResultPage
from daq_app.monitor.widgets.notices import NoticeLine
from daq_app.runfile import RunFileError, open_run

ARM_AGAIN_WITHIN_S: Final = 10.0


class Orders(QObject):
    """Turns keys and buttons into requests; what cannot be done is said in the notice line."""

    def __init__(
        self,
        link: Link | None,
        session: Session,
        pages: tuple[PreparePage, CampaignPage, ResultPage],
        notices: NoticeLine,
        show_page: Callable[[QWidget], None],
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._link = link
        self._session = session
        self._prepare, self._campaign, self._result = pages
        self._notices = notices
        self._show_page = show_page
        self._arm_asked_s = -math.inf
        self._campaign.take.connect(self._take)
        self._campaign.scanned.connect(self._propose_after_scan)
        self._result.judge.connect(self.judge)
        self._result.next_wanted.connect(self.next_test)

    def request(self, name: str, arguments: Mapping[str, float | str] | None = None) -> None:
        """Send a command to the acquisition, if there is one."""
        if self._link is not None:
            self._link.request(name, arguments)

    def order(self, name: str) -> None:
        """Carry out an order of the action bar (not ``note``, which the window asks for first)."""
        match name:
            case "arm":
                self.arm()
            case "next":
                self.next_test()
            case "marker":
                self.request("marker", {"text": "marker"})
            case _:
                self.request(name)

    def note(self, text: str) -> None:
        """Write a note into the record."""
        self.request("note", {"text": text})

    # -- arming ----------------------------------------------------------------------------------

    def arm(self) -> None:
        """Arm the chosen test; a no-go of the sensor check must be overruled by asking twice."""
        choice = self._prepare.card.choice
        if not choice.name:
            self._show_page(self._prepare)
            self._notices.tell("warning", "Give the test a name before arming.")
            return
        check = self._prepare.check
        if check is not None and check.verdict is Verdict.NO_GO and not self._arm_insisted():
            self._notices.tell(
                "warning", f"The sensor check says no-go. {check.summary} Press F5 again to arm all the same."
            )
            return
        if self._session.zeroed is False:
            self._notices.tell("warning", UNZEROED)
        looked = (
            f"Sensor check: {check.verdict.value}. {check.summary}" if check else "Sensor check: not done."
        )
        self.request("arm", {"test": choice.name, "notes": f"{choice.notes}\n{looked}".strip()})

    def _arm_insisted(self) -> bool:
        """Whether arming was asked for a second time within some seconds."""
        before, self._arm_asked_s = self._arm_asked_s, time.monotonic()
        return self._arm_asked_s - before <= ARM_AGAIN_WITHIN_S

    # -- the campaign ----------------------------------------------------------------------------

    def set_campaign(self, campaign: Campaign, folder: Path | None) -> None:
        """Follow a campaign whose runs lie in `folder`."""
        if folder is None:
            self._notices.tell(
                "warning", "The folder of the runs is not known: the campaign cannot be followed."
            )
            return
        rig = self._session.rig
        self._campaign.set_campaign(campaign, folder, rig.specimen.name if rig is not None else "")

    def next_test(self) -> None:
        """Take the next test of the campaign."""
        if self._campaign.status is None:
            self._show_page(self._prepare)
            self._notices.tell("info", "No campaign is open: type the name of the next test.")
            return
        self._campaign.take_next()

    def _take(self, name: str, ratio: float) -> None:
        self._prepare.card.propose(name, ratio)
        self._show_page(self._prepare)

    def _propose_after_scan(self) -> None:
        """A name that has been used is replaced by the next one, so that no test is armed under it again."""
        proposal, status = self._campaign.proposal, self._campaign.status
        if proposal is None or status is None or self._session.current_state in RECORDING:
            return
        used = {str(test.name) for place in status.places for test in place.tests}
        if self._prepare.card.choice.name in used | {""}:
            self._prepare.card.propose(str(proposal.name), proposal.theta0_over_alpha)

    def judge(self, name: str, verdict: str) -> None:
        """The operator's verdict on the result that is shown; the run itself stays as it is."""
        run = Path(name)
        reason = "rejected on the result page" if verdict == "bad" else ""
        try:
            with open_run(run) as opened:
                run_id = opened.header.run_id
            give_verdict(run.parent, run_id, "bad" if verdict == "bad" else "good", reason)
        except (RunFileError, ConfigError, OSError) as error:
            self._notices.tell("error", str(error))
            return
        self._result.open(run)
        self._campaign.scan()
