"""The campaign: what is done, what is missing, what must be repeated, and which test is next."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from daq_app.campaign.plan import Campaign
from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import CampaignStatus, Place, PlaceState, Proposal
from daq_app.campaign.verdicts import give_verdict
from daq_app.config import ConfigError
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.child import said_by
from daq_app.monitor.look.labels import PlainLabel, Tile, role_label
from daq_app.monitor.look.theme import Colours
from daq_app.monitor.widgets.banner import keyed_button
from daq_app.monitor.widgets.campaign_table import CampaignModel, StateDelegate, release_text
from daq_app.monitor.widgets.opening import open_outside
from daq_app.runfile import RunFileError, open_run

_WIDTHS_PX = (138, 52, 108, 92, 60, 89, 106, 87)
"""Least widths of the columns before the notes, pixels."""
_OPERATOR = 7
"""The column of the operator's name, which may be of any length."""
_REPORT_LIMIT_S = 3600.0


class NoReport(Exception):
    """The report could not be made: why, in words."""


def make_report(campaign: Campaign, folder: Path) -> Path:
    """Make the report of a folder of runs in another process; its page. Raises `NoReport`."""
    out = folder / "report"
    arguments = [campaign.model_dump_json(), str(folder), str(out)]
    ok, said = said_by("daq_app.campaign.report.job", arguments, _REPORT_LIMIT_S)
    if not ok:
        raise NoReport(said or "The report could not be made; it ended without a word.")
    return out / "report.html"


class CampaignPage(QWidget):
    """Emits `take(name, ratio)`, `open_run(path)` and `told(severity, text)`."""

    take = Signal(str, float)
    run_chosen = Signal(str)
    told = Signal(str, str)
    scanned = Signal()
    reported = Signal(str)

    def __init__(self, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._background = background
        self._scans_under_way = 0
        self._take_after_scan = False
        self._reports = Background(self)
        """A report takes minutes: nothing else waits for it."""
        self.campaign: Campaign | None = None
        self.folder: Path | None = None
        self.status: CampaignStatus | None = None
        self._model = CampaignModel(self)
        self._delegate = StateDelegate(self)
        self.table = QTableView()
        self.table.setModel(self._model)
        self.table.setItemDelegateForColumn(2, self._delegate)
        self._model.modelReset.connect(self._fit_columns)
        self.table.verticalHeader().hide()
        self.table.verticalHeader().setDefaultSectionSize(24)
        self.table.setShowGrid(False)
        self.table.setSelectionBehavior(QTableView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QTableView.SelectionMode.SingleSelection)
        header = self.table.horizontalHeader()
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setSectionResizeMode(len(_WIDTHS_PX), QHeaderView.ResizeMode.Stretch)
        self._specimen = QComboBox()
        self._specimen.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self._specimen.currentTextChanged.connect(lambda _text: self._show())
        self._title = role_label("No campaign is open", "title")
        captions = {
            PlaceState.DONE: "Done",
            PlaceState.TO_REPEAT: "To repeat",
            PlaceState.MISSING: "Missing",
        }
        self._tiles = {state: Tile(caption, 19) for state, caption in captions.items()}
        self._next_name = PlainLabel("–")
        self._next_name.setProperty("scale", "state")
        self._next_reason = role_label("", "muted")
        self._next_reason.setWordWrap(True)
        self.take_button = QPushButton("Take this test  F6")
        self.take_button.setProperty("role", "primary")
        self._chosen = QPlainTextEdit("Choose a row to see its runs.")
        self._chosen.setReadOnly(True)
        # It takes what is left: on a small screen no more than two lines.
        self._chosen.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self._reason = QLineEdit()
        self._reason.setPlaceholderText("Why (needed to reject)")
        self.accept_button = keyed_button(self, "Good", "Ctrl+G", lambda: self._judge("good"))
        self.reject_button = keyed_button(self, "Repeat it", "Ctrl+R", lambda: self._judge("bad"))
        self.open_button = QPushButton("Open its run")
        self.report_button = QPushButton("Campaign report")
        self.report_button.setToolTip("Analyse every run of the folder into its report/")
        self._build()
        self.take_button.clicked.connect(self.take_next)
        self.open_button.clicked.connect(self._open_chosen)
        self.report_button.clicked.connect(self._make_report)
        self.table.selectionModel().selectionChanged.connect(lambda *_: self._show_chosen())
        self.table.activated.connect(lambda _index: self._open_chosen())

    def _build(self) -> None:
        top = QHBoxLayout()
        top.addWidget(self._title, 1)
        top.addWidget(role_label("Specimen", "heading"))
        top.addWidget(self._specimen)
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addLayout(top)
        left.addWidget(self.table, 1)
        tiles = QHBoxLayout()
        tiles.setSpacing(6)
        for tile in self._tiles.values():
            tiles.addWidget(tile, 1)
        following = QFrame()
        following.setObjectName("card")
        next_layout = QVBoxLayout(following)
        next_layout.setContentsMargins(14, 12, 14, 12)
        for widget in (
            role_label("Next test", "heading"),
            self._next_name,
            self._next_reason,
            self.take_button,
        ):
            next_layout.addWidget(widget)
        chosen = QFrame()
        chosen.setObjectName("card")
        chosen_layout = QVBoxLayout(chosen)
        chosen_layout.setContentsMargins(14, 12, 14, 12)
        chosen_layout.addWidget(role_label("Chosen test", "heading"))
        chosen_layout.addWidget(self._chosen, 1)
        chosen_layout.addWidget(self._reason)
        buttons = QHBoxLayout()
        for button in (self.accept_button, self.reject_button, self.open_button):
            buttons.addWidget(button)
        chosen_layout.addLayout(buttons)
        right = QVBoxLayout()
        right.setSpacing(8)
        right.addLayout(tiles)
        right.addWidget(following)
        right.addWidget(chosen, 1)
        right.addWidget(self.report_button)
        content = QWidget()
        content.setLayout(right)
        right.setContentsMargins(0, 0, 0, 0)
        # A long reason in large type needs more than the smallest screen has.
        holder = QScrollArea()
        holder.setWidget(content)
        holder.setWidgetResizable(True)
        holder.setFrameShape(QFrame.Shape.NoFrame)
        holder.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._holder = holder
        layout = QHBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.setSpacing(8)
        layout.addLayout(left, 1)
        layout.addWidget(holder)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._delegate.colours = colours
        bar_px = self._holder.verticalScrollBar().sizeHint().width()
        self._holder.setFixedWidth(colours.side_px(400) + bar_px)
        self._chosen.setMinimumHeight(colours.px(56))
        self.table.verticalHeader().setDefaultSectionSize(colours.px(24))
        self._fit_columns()
        self.table.viewport().update()

    def _fit_columns(self) -> None:
        """What is measured is whole in any type; operator and notes share what is left."""
        colours = self._delegate.colours
        for column, width in enumerate(_WIDTHS_PX):
            needed = self.table.sizeHintForColumn(column) if column < _OPERATOR else 0
            self.table.setColumnWidth(column, max(colours.px(width), needed))

    def set_campaign(self, campaign: Campaign, folder: Path, specimen: str = "") -> None:
        """Follow a campaign whose runs lie in `folder`; `specimen` is the one on the rig."""
        self.campaign, self.folder = campaign, folder
        self._title.setText(f"Campaign {campaign.name}")
        self._specimen.blockSignals(True)
        self._specimen.clear()
        self._specimen.addItems(["all", *campaign.specimens])
        if specimen in campaign.specimens:
            self._specimen.setCurrentText(specimen)
        self._specimen.blockSignals(False)
        self.scan()

    @property
    def specimen(self) -> str:
        """The specimen that is shown; empty for all."""
        text = self._specimen.currentText()
        return "" if text in ("", "all") else text

    @property
    def proposal(self) -> Proposal | None:
        """The test to make next."""
        return self.status.next_test(self.specimen) if self.status is not None else None

    def scan(self) -> None:
        """Read the folder of the runs again, off the window's thread."""
        campaign, folder = self.campaign, self.folder
        if campaign is None or folder is None:
            return

        def read() -> CampaignStatus:
            recorded = read_recorded(folder) if folder.is_dir() else []
            return CampaignStatus(campaign, recorded)

        if self.status is None:
            self._chosen.setPlainText("The runs of the folder are being read …")
        self._scans_under_way += 1
        self._background.run(read, self._on_status, self._on_trouble)

    def _on_status(self, status: CampaignStatus) -> None:
        self.status = status
        self._show()
        self.scanned.emit()
        self._on_scan_over()

    def _on_scan_over(self) -> None:
        self._scans_under_way -= 1
        if self._take_after_scan and not self._scans_under_way:
            self._take_after_scan = False
            self.take_next()

    def _on_trouble(self, error: Exception) -> None:
        self._on_scan_over()
        if not isinstance(error, (ConfigError, RunFileError, OSError)):
            raise error
        self.told.emit("error", f"The runs cannot be read: {error}")

    def _show(self) -> None:
        if self.status is None:
            return
        self._model.show_status(self.status, self.specimen)
        for state, tile in self._tiles.items():
            count = len(self.status.in_state(state, self.specimen))
            tile.show_value(str(count))
        proposal = self.proposal
        self._next_name.setText(str(proposal.name) if proposal else "All done")
        self._next_reason.setText(
            f"{proposal.reason[:1].upper()}{proposal.reason[1:]}."
            if proposal
            else "Every planned test is done."
        )
        self.take_button.setEnabled(proposal is not None)
        row = self._model.next_row()
        if row >= 0:
            self.table.selectRow(row)
            self.table.scrollTo(self._model.index(row, 0), QTableView.ScrollHint.PositionAtCenter)
        self._show_chosen()

    def take_next(self) -> None:
        """Fill in the proposed test; a verdict just given, or a run just saved, is read first."""
        if self._scans_under_way:
            self._take_after_scan = True
            return
        if self.status is None:
            self.told.emit("warning", "The runs cannot be read: type the name of the next test.")
            return
        proposal = self.proposal
        if proposal is None:
            self.told.emit("info", "Every planned test is done; type a name for a further one.")
            return
        self.take.emit(str(proposal.name), proposal.theta0_over_alpha)

    # -- the report ------------------------------------------------------------------------------

    def _make_report(self) -> None:
        campaign, folder = self.campaign, self.folder
        if campaign is None or folder is None:
            self.told.emit("info", "No campaign is open: there is nothing to report.")
            return
        self.report_button.setEnabled(False)
        self.told.emit("info", "The campaign report is being made; this takes about two seconds a test.")
        self._reports.run(lambda: make_report(campaign, folder), self._on_report, self._on_report)

    def _on_report(self, made: Path | Exception) -> None:
        self.report_button.setEnabled(True)
        if isinstance(made, (NoReport, OSError)):
            self.told.emit("error", str(made))
        elif isinstance(made, Exception):
            raise made
        else:
            self.told.emit("info", f"The campaign report is saved as {made}")
            open_outside(self, made)
            self.reported.emit(str(made))

    # -- one place -------------------------------------------------------------------------------

    def _chosen_place(self) -> Place | None:
        rows = self.table.selectionModel().selectedRows()
        return self._model.place(rows[0].row()) if rows else None

    def _show_chosen(self) -> None:
        place = self._chosen_place()
        tests = place.tests if place is not None else []
        for widget in (self.accept_button, self.reject_button, self.open_button, self._reason):
            widget.setEnabled(bool(tests))
        if place is None:
            self._chosen.setPlainText("Choose a row to see its runs.")
        elif not tests:
            lost = " It was lost in the original campaign." if place.planned.lost_originally else ""
            self._chosen.setPlainText(f"{place.planned.name}: no release yet.{lost}")
        else:
            self._chosen.setPlainText(release_text(place))

    def _open_chosen(self) -> None:
        place = self._chosen_place()
        if place is not None and place.tests and place.tests[-1].path is not None:
            self.run_chosen.emit(str(place.tests[-1].path))

    def _judge(self, verdict: str) -> None:
        """Accept or reject the newest release of the chosen place; the run itself stays as it is."""
        place = self._chosen_place()
        if place is None or not place.tests or place.tests[-1].path is None or self.folder is None:
            return
        reason = self._reason.text().strip()
        if verdict == "bad" and not reason:
            self.told.emit(
                "warning", "Say why the test must be repeated; the reason is kept with the verdict."
            )
            self._reason.setFocus()
            return
        try:
            with open_run(place.tests[-1].path) as run:
                run_id = run.header.run_id
            give_verdict(self.folder, run_id, "good" if verdict == "good" else "bad", reason)
        except (RunFileError, ConfigError, OSError) as error:
            self.told.emit("error", str(error))
            return
        self._reason.clear()
        self.scan()
