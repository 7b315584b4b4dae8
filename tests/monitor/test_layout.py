"""Nothing is cut off: on no page, at the smallest screen that is promised, in the largest type."""

from __future__ import annotations

import datetime as dt

import pytest
from PySide6.QtWidgets import QApplication, QHeaderView, QLineEdit, QPushButton, QTableView

from daq_app.acquisition.messages.published import Judgement, State, StateMessage
from daq_app.campaign.names import TestName
from daq_app.campaign.plan import Campaign, Step
from daq_app.campaign.status import CampaignStatus, RecordedTest, TestFacts, TestVerdict
from daq_app.monitor.data.session import Published
from daq_app.monitor.plots.plot_base import Axis
from daq_app.monitor.widgets.campaign_table import HEADINGS
from daq_app.monitor.window.main_window import MainWindow
from tests.support.window.clipped_text import clipped_texts
from tests.support.window.quiet_link import QuietLink


@pytest.fixture
def rocking_window(qtbot, settings, configs, clock, stand_in):
    """A window on a wall that rocks, with the winch of a simulated wall."""
    window = MainWindow(QuietLink(configs / "fr1.toml"), settings)
    qtbot.addWidget(window)
    window._frame_timer.stop()
    window._slow_timer.stop()
    window.session.clock = clock
    start = clock.now
    for instant in stand_in.instants(stand_in.release_s + 3.0):
        clock.now = start + instant.time_s
        for message, readings in instant.messages:
            window.session.feed(Published(message, clock.now, readings))
    window.prepare.wall.set_address("grpc://127.0.0.1:1")
    window.show()
    return window


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize(("width", "height"), [(1366, 768), (1920, 1080)])
@pytest.mark.parametrize("larger", [0, 4])
def test_every_text_is_whole_on_every_page(rocking_window, theme, width, height, larger):
    window = rocking_window
    if window.settings.theme != theme:
        window.toggle_theme()
    for _ in range(larger):
        window.change_type_size(1)
    for name, page in window.pages.items():
        window.show_page(page)
        window.resize(width, height)
        window._on_slow()
        for _ in range(3):
            QApplication.processEvents()
        assert (window.width(), window.height()) == (width, height), f"{name} is larger than the screen"
        assert clipped_texts(window) == [], name


@pytest.mark.parametrize(
    ("word", "do"),
    [
        (
            "Live view",
            "Nothing is recorded but the ring of the last minutes. Choose, zero, check, then arm (F5).",
        ),
        ("Armed", "Do not release: no samples come in. Look at the chassis, its power and its network."),
        ("Rocking, not armed", "Keep clear. Nobody had armed: this release is kept from the ring."),
    ],
)
def test_what_to_do_next_is_whole_in_the_largest_type(rocking_window, clock, word, do):
    """Cut off it ended before "then arm"."""
    window = rocking_window
    for _ in range(4):
        window.change_type_size(1)
    judgement = Judgement(word=word, do=do, tone="text")
    window.session.feed(Published(StateMessage(state=State.PREVIEWING, judgement=judgement), clock.now))
    window.resize(1366, 743)
    window._on_slow()
    for _ in range(3):
        QApplication.processEvents()
    assert window.header.words["sentence"] == do
    assert clipped_texts(window.header) == []


@pytest.mark.parametrize("points", [10.0, 15.0])
def test_a_window_opens_in_the_type_that_was_chosen(qtbot, settings, points):
    """Buttons and tables had opened in the system's size, beside figures in the chosen one."""
    settings.type_size = points
    window = MainWindow(None, settings)
    qtbot.addWidget(window)
    window.show()
    kinds = (QPushButton, QTableView, QHeaderView, QLineEdit)
    parts = [part for kind in kinds for part in window.findChildren(kind)]
    assert {part.font().pointSizeF() for part in parts} == {points}


def test_axes_and_strips_grow_with_the_type(rocking_window):
    window = rocking_window
    axis = window.live.motion.rotation.plot_item.getAxis("left")
    before = axis.style["tickFont"].pointSizeF(), axis.fixedWidth
    for _ in range(4):
        window.change_type_size(1)
    assert axis.style["tickFont"].pointSizeF() == pytest.approx(1.5 * before[0])
    assert axis.fixedWidth > 1.4 * before[1]
    window.change_type_size(-1)
    window.change_type_size(-10)
    assert axis.style["tickFont"].pointSizeF() < before[0]


def test_the_second_axis_stands_at_the_rotation_alone(rocking_window):
    live = rocking_window.live
    shown = [
        plot.plot_item.getAxis("right").isVisible()
        for plot in (live.motion.rotation, live.phase, live.periods)
    ]
    assert shown == [True, False, False] and not live.restitution.plot.plot_item.getAxis("right").isVisible()


def test_the_headings_of_the_campaign_are_whole(rocking_window):
    window = rocking_window
    window.show_page(window.campaign)
    header = window.campaign.table.horizontalHeader()
    cut = [
        place
        for place in range(header.count() - 1)
        if header.sectionSizeHint(place) > header.sectionSize(place)
    ]
    assert cut == []


@pytest.mark.parametrize("larger", [0, 4])
@pytest.mark.parametrize("repeated_next", [False, True])
def test_what_was_measured_in_a_campaign_is_whole(rocking_window, larger, repeated_next):
    """The time of a release had ended in "25 Nov …"."""
    window = rocking_window
    for _ in range(larger):
        window.change_type_size(1)
    plan = Campaign(name="c", levels={"L1": 0.15}, sequence=(Step(specimen="FR1", level="L1", tests=2),))
    facts = TestFacts(0.1499, {"CRT": 0.895}, "", ())
    released_ns = int(dt.datetime(2026, 11, 30, 20, 48).timestamp() * 1e9)
    verdict = TestVerdict.BAD if repeated_next else TestVerdict.UNCHECKED
    test = RecordedTest(TestName.parse("FR1-L1-1"), verdict, released_ns, None, "", facts)
    window.show_page(window.campaign)
    table = window.campaign.table
    table.model().show_status(CampaignStatus(plan, [test]), "")
    assert ("next" in table.model().index(0, 0).data()) is repeated_next
    short = [place for place, heading in enumerate(HEADINGS) if heading not in ("Operator", "Notes")]
    assert [HEADINGS[c] for c in short if table.sizeHintForColumn(c) > table.columnWidth(c)] == []


def test_figures_below_zero_have_a_true_minus_sign(rocking_window):
    axis = rocking_window.live.motion.rotation.plot_item.getAxis("left")
    assert axis.tickStrings([-50.0, 0.0], 1.0, 50.0) == ["−50", "0"]


def test_figures_of_a_logarithmic_axis_keep_apart(qapp):
    axis = Axis("left")
    axis.setLogMode(True)
    decade = [-3.0, -2.69897, -2.522879, -2.39794, -2.30103, -2.221849, -2.154902, -2.09691, -2.045757]
    assert [bool(text) for text in axis.tickStrings(decade, 1.0, 1.0)] == [
        n in (1, 2, 5) for n in range(1, 10)
    ]
