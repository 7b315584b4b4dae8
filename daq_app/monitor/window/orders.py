"""What the operator orders: arming, notes and markers, the next test of the campaign, verdicts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.checks.check_model import Verdict
from daq_app.acquisition.course.tare import UNZEROED
from daq_app.acquisition.messages.published import RECORDING, Reply, StateMessage
from daq_app.campaign.plan import Campaign
from daq_app.campaign.verdicts import give_verdict
from daq_app.config import ConfigError
from daq_app.monitor.data.link import Link
from daq_app.monitor.data.session import Session
from daq_app.monitor.pages.campaign_page import CampaignPage
from daq_app.monitor.pages.prepare_page import PreparePage
from daq_app.monitor.pages.result_page import ResultPage
from daq_app.monitor.widgets.notices import NoticeLine
from daq_app.monitor.window.what_to_tell import MAY_BE_REFUSED
from daq_app.runfile import RunFileError, open_run

ARM_AGAIN_WITHIN_S: Final = 10.0
PLAN_AFTER_MS: Final = 250
"""Pause in the typing after which the recorder hears of the plan."""


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
        self._plan_timer = _single_shot(self, PLAN_AFTER_MS, self._send_plan)
        self._plan_sent = False
        """An order to change the plan is on its way: what the recorder says until then is older."""
        self._overrule_timer = _single_shot(self, round(1e3 * ARM_AGAIN_WITHIN_S), self._on_overrule_over)
        self._prepare.card.changed.connect(self._on_choice)
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

    # -- the plan --------------------------------------------------------------------------------

    def _on_choice(self) -> None:
        """The operator edits the plan; the recorder hears of it once the typing pauses."""
        self._plan_timer.start()

    def _send_plan(self) -> None:
        self._plan_sent = True
        self.request("plan", self._prepare.card.choice.as_order())

    def adopt_plan(self, message: StateMessage) -> None:
        """Show the recorder's plan, unless the operator is changing it at this moment."""
        if message.locked or not (self._plan_timer.isActive() or self._plan_sent):
            self._prepare.card.adopt(message.plan, locked=message.locked)

    # -- arming ----------------------------------------------------------------------------------

    def arm(self) -> None:
        """Arm the chosen test; a no-go of the sensor check must be overruled by asking twice."""
        choice = self._prepare.card.choice
        if not choice.name:
            self._show_page(self._prepare)
            self._notices.tell("warning", "Give the test a name before arming.", _order("arm"))
            return
        self._plan_timer.stop()
        overrule = self._overrule_timer.isActive()
        self._overrule_timer.stop()
        if self._session.zeroed is False:
            self._notices.tell("warning", UNZEROED, _order("tare"))
        self.request("arm", {**choice.as_order(), "overrule": float(overrule)})

    def on_reply(self, name: str, reply: Reply) -> None:
        """What became of an order; a refusal stands until the order is obeyed."""
        if name == "plan":
            self._plan_sent = False
        if reply.ok:
            self._notices.settle(_order(name))
        else:
            self._notices.tell("warning" if name in MAY_BE_REFUSED else "error", reply.text, _order(name))
        no_go = self._prepare.check is not None and self._prepare.check.verdict is Verdict.NO_GO
        if name == "arm" and not reply.ok and no_go:
            self._show_page(self._prepare)
            self._overrule_timer.start()

    def _on_overrule_over(self) -> None:
        text = f"Not armed: F5 was not pressed again within {ARM_AGAIN_WITHIN_S:.0f} s."
        self._notices.tell("warning", text, _order("arm"))

    # -- the campaign ----------------------------------------------------------------------------

    def set_campaign(self, campaign: Campaign, folder: Path | None) -> None:
        """Follow a campaign whose runs lie in `folder`."""
        if folder is None:
            self._notices.tell(
                "warning", "The folder of the runs is not known: the campaign cannot be followed."
            )
            return
        rig = self._session.rig
        self._result.list_tests(folder)
        self._campaign.set_campaign(campaign, folder, rig.specimen.name if rig is not None else "")

    def next_test(self) -> None:
        """Take the next test of the campaign."""
        if self._campaign.campaign is None:
            self._show_page(self._prepare)
            self._notices.tell("info", "No campaign is open: type the name of the next test.")
            return
        self._campaign.take_next()

    def _take(self, name: str, ratio: float) -> None:
        self._propose(name, ratio)
        self._show_page(self._prepare)

    def _propose(self, name: str, ratio: float) -> None:
        """Fill in a test; notes stay until the test that they were typed for has been taken."""
        card, status = self._prepare.card, self._campaign.status
        taken = status is not None and card.choice.name in status.names
        card.propose(name, ratio, keep_notes=not taken)

    def _propose_after_scan(self) -> None:
        """A name that has been used is replaced by the next one, so that no test is armed under it again."""
        proposal, status = self._campaign.proposal, self._campaign.status
        if proposal is None or status is None or self._session.current_state in RECORDING:
            return
        if self._prepare.card.choice.name in status.names | {""}:
            self._propose(str(proposal.name), proposal.theta0_over_alpha)

    def judge(self, name: str, verdict: str) -> None:
        """The operator's verdict on the result that is shown; the run itself stays as it is."""
        run, shown = Path(name), self._result.result
        if verdict == "bad" and shown is not None and not shown.test.good:
            # Its reason is the record's: a second rejection would put another one in its place.
            self._notices.tell("info", f"{shown.test.test} is to be repeated already: take it with F6.")
            return
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


def _order(name: str) -> str:
    """What a message about an order is about."""
    return f"order {name}"


def _single_shot(parent: QObject, after_ms: int, call: Callable[[], None]) -> QTimer:
    timer = QTimer(parent)
    timer.setSingleShot(True)
    timer.setInterval(after_ms)
    timer.timeout.connect(call)
    return timer
