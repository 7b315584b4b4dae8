"""The operator's window: pages around one session, fed by one link.

The window is a client. It may be closed, killed or opened twice; the acquisition does not notice.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent, QKeySequence, QShortcut, QShowEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QPushButton, QWidget

from daq_app.acquisition.messages.published import (
    RECORDING,
    Call,
    CheckMessage,
    EventMessage,
    Reply,
    State,
    StateMessage,
)
from daq_app.campaign.plan import Campaign
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.link import Link
from daq_app.monitor.data.moment import Moment
from daq_app.monitor.data.session import Session
from daq_app.monitor.data.settings import TYPE_SIZES, WindowSettings
from daq_app.monitor.look.theme import THEMES, Colours, apply_theme
from daq_app.monitor.pages.campaign_page import CampaignPage
from daq_app.monitor.pages.channel_window import ChannelWindows
from daq_app.monitor.pages.gap_page import GapPage
from daq_app.monitor.pages.live_page import LivePage
from daq_app.monitor.pages.messages_page import MessagesPage
from daq_app.monitor.pages.prepare_page import PreparePage, Zero
from daq_app.monitor.pages.replay_page import ReplayPage
from daq_app.monitor.pages.result_page import ResultPage
from daq_app.monitor.pages.test_page import TestPage
from daq_app.monitor.widgets.notices import NoticeLine
from daq_app.monitor.window import what_to_tell
from daq_app.monitor.window.adoption import Adoption
from daq_app.monitor.window.orders import Orders
from daq_app.monitor.window.placement import keep_on_screen
from daq_app.monitor.window.test_display import TestDisplay
from daq_app.monitor.window.window_frame import WindowFrame

FRAME_MS: Final = 16
SLOW_MS: Final = 160


class MainWindow(QMainWindow):
    """Everything on screen. `link` None: a window for looking at runs only."""

    def __init__(self, link: Link | None, settings: WindowSettings, *, started_here: bool = False) -> None:
        """`started_here`: this window started the acquisition and ends it again when nothing is recorded."""
        super().__init__()
        self._started_here = started_here
        self.setWindowTitle("Rocking-test recorder")
        self.link = link
        self.settings = settings
        self.moment = Moment()
        self.session = Session(self.moment)
        self.background = Background(self)
        self._analyses = Background(self)
        """Its own queue: an analysis takes seconds, a sensor check must not wait for it."""
        self.colours: Colours = THEMES[settings.theme]
        self.longest_stall_s = 0.0
        """Longest time between two frames so far: how long the window was deaf at worst."""
        self._last_frame_s = math.nan
        self._state_before: State | None = None
        self._was_live: tuple[bool, ...] = ()
        self._released = False
        """Whether the wall was let go since the last arming: an aborted arming has no result."""

        self._make_pages()
        self._lay_out()
        ordered = (self.prepare, self.campaign, self.result)
        self.orders = Orders(link, self.session, ordered, self.notices, self.show_page, self)
        self.restyle()
        self._connect()
        self.resize(1366, 768)
        settings.restore_layout(self, self.splitters)
        if link is not None:
            self._meet(link)
        self._frame_timer = QTimer(self)
        self._frame_timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._frame_timer.timeout.connect(self._on_frame)
        self._frame_timer.start(FRAME_MS)
        self._slow_timer = QTimer(self)
        self._slow_timer.timeout.connect(self._on_slow)
        self._slow_timer.start(SLOW_MS)

    def _make_pages(self) -> None:
        """Every page, and those that a window has with and without an acquisition."""
        self.live = LivePage(self.session)
        self.prepare = PreparePage(self.session, self.background)
        self.campaign = CampaignPage(self.background)
        self.replay = ReplayPage(self.background)
        self.result = ResultPage(self._analyses)
        self._diagnoses = Background(self)
        self.gap = GapPage(self._diagnoses)
        self.test = TestPage(self.session)
        self.notices = NoticeLine()
        self.messages = MessagesPage(self.notices)
        live_pages: dict[str, QWidget] = {"Prepare": self.prepare, "Test": self.test, "Live": self.live}
        self.pages: dict[str, QWidget] = {
            **(live_pages if self.link is not None else {}),
            "Campaign": self.campaign,
            "Result": self.result,
            "Replay": self.replay,
            "Gap": self.gap,
            "Messages": self.messages,
        }

    def _lay_out(self) -> None:
        """Header, rail, pages and order bar in one frame; the full screen beside it."""
        link = self.link
        self.frame = WindowFrame(self.session, self.pages, self.notices, live=link is not None)
        self.header, self.note_entry = self.frame.header, self.frame.note_entry
        self.actions_bar, self.health = self.frame.actions_bar, self.frame.health
        self.stack, self.rail = self.frame.stack, self.frame.rail
        self.setCentralWidget(self.frame)
        self.display = TestDisplay(self.session, self.test, self.frame, self.settings, self)
        self.channels = ChannelWindows(self.session, lambda: self.prepare.zero.readings)
        may_command = link is not None and link.may_command
        self.adoption = Adoption(self.session, self.prepare, self.gap, self.notices, may_command=may_command)
        self.splitters = {
            "live_upper": self.live.upper,
            "live_whole": self.live.whole,
            "replay": self.replay.splitter,
        }
        self.show_page(self.prepare if link is not None else self.replay)

    def _meet(self, link: Link) -> None:
        """Hear what the acquisition says, and take over what it knows already."""
        link.replied.connect(self._on_reply)
        link.urgent.connect(self._on_urgent)
        self._adopt(link.about)
        if not link.may_command:
            self.notices.tell("info", "This window may watch, not command: it was opened without the token.")

    def _connect(self) -> None:
        self.actions_bar.ordered.connect(self._on_order)
        self.actions_bar.refused.connect(self._on_refused)
        self.actions_bar.told.connect(self.notices.tell)
        self.rail.page_wanted.connect(lambda place: self.show_page(list(self.pages.values())[place]))
        self.rail.theme_wanted.connect(self.toggle_theme)
        self.rail.size_wanted.connect(self.change_type_size)
        self.note_entry.noted.connect(self.orders.note)
        self.prepare.tare_wanted.connect(lambda: self.orders.request("tare"))
        for page in (self.prepare, self.campaign, self.replay, self.gap, self.result):
            page.told.connect(self.notices.tell)
        for verdict_given in (self.campaign.scanned, self.result.shown):
            verdict_given.connect(self.gap.list_again)
        self.prepare.check_wanted.connect(lambda: self.orders.request("check"))
        self.prepare.pull_wanted.connect(lambda: self.orders.request("pull"))
        self.campaign.run_chosen.connect(lambda name: self.open_run(Path(name)))
        if self.link is None:
            self.replay.opened.connect(lambda name: self.gap.set_folder(Path(name).parent))
        self.result.replay.connect(lambda name: self.open_run(Path(name)))
        for key, button in self.prepare.keys.items() if self.link is not None else ():
            QShortcut(QKeySequence(key), self).activated.connect(lambda b=button: self._prepare_by_key(b))
        self.live.strips.channel_opened.connect(self.open_channel)
        QShortcut(QKeySequence("T"), self.live).activated.connect(self.live.theory_button.toggle)
        QShortcut(QKeySequence("C"), self.live).activated.connect(self.live.strips_button.toggle)

    def _prepare_by_key(self, button: QPushButton) -> None:
        """Check, pull test and zero from any page; their answer is on the page that comes to the front."""
        self.prepare.refresh()
        self.show_page(self.prepare)
        if not button.isEnabled():
            self._on_refused(button.text())
        button.click()

    def show_page(self, page: QWidget) -> None:
        """Bring a page to the front; one that this window does not have stays away."""
        self.frame.show_page(page)

    # -- look ------------------------------------------------------------------------------------

    def open_channel(self, name: str) -> None:
        """Show one channel large, in a window of its own."""
        self.channels.open(name, self.colours)

    def restyle(self) -> None:
        """Apply theme and type size to everything."""
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        self.colours = replace(THEMES[self.settings.theme], points=self.settings.type_size)
        apply_theme(app, self, self.colours, self.settings.type_size)
        self.frame.rail.fit()
        self.frame.fit_footer()
        pages = (self.prepare, self.live, self.campaign, self.result, self.replay, self.gap, self.messages)
        for page in pages:
            page.restyle(self.colours)
        self.display.restyle(self.colours)
        self.channels.restyle(self.colours)
        self.notices.restyle(self.colours)

    def toggle_theme(self) -> None:
        """Change between light and dark."""
        self.settings.theme = "light" if self.settings.theme == "dark" else "dark"
        self.restyle()

    def change_type_size(self, steps: int) -> None:
        """Make the type larger or smaller by steps."""
        place = TYPE_SIZES.index(self.settings.type_size) + steps
        self.settings.type_size = TYPE_SIZES[max(0, min(len(TYPE_SIZES) - 1, place))]
        self.restyle()

    # -- flow ------------------------------------------------------------------------------------

    def _adopt(self, about: Mapping[str, Any]) -> None:
        """Take over what the acquisition says of itself."""
        rig = self.adoption.take_rig(about)
        if rig is not None:
            self.setWindowTitle(f"{rig.name} – Rocking-test recorder")
        state = self.adoption.take(about)
        if state is not None:
            self._after(state)

    def _on_frame(self) -> None:
        now = time.monotonic()
        if math.isfinite(self._last_frame_s):
            self.longest_stall_s = max(self.longest_stall_s, now - self._last_frame_s)
        self._last_frame_s = now
        self._take_in()
        if self.stack.currentWidget() is self.live:
            self.live.draw_frame()
        self.display.frame()

    def _take_in(self) -> None:
        if self.link is not None:
            for published in self.link.take():
                self.session.feed(published)
                self._after(published.message)
        self.moment.renew()
        live = self.session.what_is_live
        if live != self._was_live:
            # What has just gone stale must not stand as live until the next slow tick.
            self._was_live = live
            self._on_slow()

    def _on_urgent(self) -> None:
        """r has come: it is on screen before the next frame is drawn."""
        self._take_in()
        if self.stack.currentWidget() is self.live:
            self.live.show_estimate()
        self.display.show_estimate()

    def _after(self, message: object) -> None:
        match message:
            case StateMessage():
                self.orders.adopt_plan(message)
                self._show_target(message)
                self._on_state(message)
                # All at once: strip, gauge and picture never show the words of two different moments.
                self.header.refresh(self.colours)
                self.prepare.gauge.update()
                self.display.show_state()
            case CheckMessage():
                self.prepare.show_check(message.check)
                self.notices.settle(*what_to_tell.found_good(message.check))
            case EventMessage():
                if message.kind == "tare" and self.link is not None:
                    self.link.request("hello")
                if message.kind == "result" and self.result.run is not None:
                    self.result.open_if_shown(Path(str(message.data.get("run", ""))))
                trouble = what_to_tell.trouble_of(message)
                if trouble and message.severity == "info":
                    self.notices.settle(trouble)
                if what_to_tell.is_told(message):
                    self.notices.tell(message.severity, message.text, trouble)

    def _on_state(self, message: StateMessage) -> None:
        before, self._state_before = self._state_before, message.state
        if before is message.state:
            return
        self.gap.set_recording(message.state in RECORDING | {State.SAVING})
        if message.state is State.ARMED:
            self._released = False
        # A window that came later than the release knows it from what the recorder asks to look at.
        looks = message.state is State.SAVED and message.judgement.call is Call.LOOK
        if message.state in (State.RELEASED, State.ROCKING, State.AT_REST) or looks:
            self._released = True
        # An operator who chose Live keeps it.
        if what_to_tell.brings_gauge(before, message.state) and self.stack.currentWidget() is not self.live:
            self.show_page(self.test)
        if message.state is State.PREVIEWING and before in (State.IDLE, None) and self.link is not None:
            self.link.request("hello")
        if message.state is State.SAVED and before in (State.SAVING, None) and message.run_path:
            self._on_saved(Path(message.run_path))
        self._on_slow()

    def _on_saved(self, run: Path) -> None:
        """A run has just been closed."""
        self.campaign.scan()
        if not run.is_file():
            self.notices.tell("info", f"The run is saved on the recording machine: {run}")
            return
        self.replay.open(run)
        if self._released:
            self.show_page(self.result)
            self.result.open(run, soon=self.adoption.awaits_result(run))
            self.gap.after_run(run)

    def _on_slow(self) -> None:
        self.header.refresh(self.colours)
        self.health.refresh()
        self.frame.fit_footer()
        self.display.refresh()
        may_command = self.link is not None and self.link.may_command
        self.actions_bar.refresh(
            self.session.current_state, sampling=self.session.sampling, may_command=may_command
        )
        page = self.stack.currentWidget()
        if page is self.live:
            self.live.draw_slow()
        elif page is self.prepare:
            self.prepare.refresh()

    def _show_target(self, message: StateMessage) -> None:
        """The target of the recorder's plan, wherever one is drawn."""
        target = message.judgement.target
        ratio = math.nan if target is None else target
        self.prepare.wall.target_ratio = ratio
        target_rad = ratio * self.session.alpha_rad
        if target_rad != self.live.motion.target_rad and not (
            math.isnan(target_rad) and math.isnan(self.live.motion.target_rad)
        ):
            self.live.motion.set_target(target_rad)

    # -- orders ----------------------------------------------------------------------------------

    def _on_refused(self, text: str) -> None:
        """A key was pressed whose order makes no sense now: silence would look as if it had been obeyed."""
        may_command = self.link is not None and self.link.may_command
        self.notices.tell("info", what_to_tell.refusal(text, self.session, may_command=may_command))

    def _on_order(self, name: str) -> None:
        if name == "note":
            self.note_entry.ask()
        else:
            self.orders.order(name)

    def next_test(self) -> None:
        """Take the next test of the campaign."""
        self.orders.next_test()

    def open_run(self, path: Path) -> None:
        """Show a run on the replay page."""
        self.show_page(self.replay)
        self.replay.open(path)

    def set_campaign(self, campaign: Campaign, folder: Path | None = None) -> None:
        """Follow a campaign; the runs lie in `folder`, else where the acquisition puts them."""
        self.orders.set_campaign(campaign, folder or self.adoption.runs_folder)

    def _on_reply(self, name: str, reply: Reply) -> None:
        self.orders.on_reply(name, reply)
        if not reply.ok:
            return
        if name == "hello":
            self._adopt(reply.data)
        elif name == "tare":
            self.notices.tell("info", reply.text)
            self.prepare.set_zero(Zero(what_to_tell.numbers(reply.data.get("tare")), {}))
            self.session.set_zeroed(True)
            self.orders.request("hello")
        elif name in ("marker", "note"):
            self.notices.tell("info", f"Written: {reply.text}.")

    def showEvent(self, event: QShowEvent) -> None:
        """The window is whole on its screen, with the frame that it gets."""
        super().showEvent(event)
        keep_on_screen(self)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Remember the layout and hang up; a run under way goes on without the window."""
        self._frame_timer.stop()
        self._slow_timer.stop()
        self.display.close()
        self.channels.close()
        self.settings.save_layout(self, self.splitters)
        if self.link is not None:
            idle = self.session.current_state not in RECORDING | {State.SAVING}
            if self._started_here and idle:
                self.link.request("shutdown")  # refused if a test was armed this very moment
            self.link.close()
        self.gap.close_down()
        self.background.finish()
        self._analyses.finish(0)
        self._diagnoses.finish(2000)
        super().closeEvent(event)
