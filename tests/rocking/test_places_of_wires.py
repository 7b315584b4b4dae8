"""A recording that is analysed with the rig of another set-up says which wires are elsewhere."""

from __future__ import annotations

from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record

OPTIONS = AnalysisOptions(bias_runs=0, fit=False, keep_series=False)


def analysed(made, places: dict[str, str]) -> TestAnalysis:
    """A sound test with the rig in which wires stand where others do."""
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    channels = []
    for channel in test.rig.channels:
        other = test.rig.channel(places.get(channel.id, channel.id))
        place = {"position_m": other.position_m, "anchor_m": other.anchor_m}
        channels.append(channel.model_copy(update=place))
    rig = test.rig.model_copy(update={"channels": tuple(channels)})
    return analyse_record(
        TestRecord.from_array(rig, test.rate_hz, test.si, time_offsets_s=test.offsets_s), OPTIONS
    )


def told(analysis: TestAnalysis) -> list[str]:
    return [note.text for note in analysis.notes if "other heights" in note.text]


def test_wires_of_another_set_up_are_told_with_both_levers(made):
    (text,) = told(analysed(made, {"WP-1": "WP-4", "WP-2": "WP-3", "WP-3": "WP-1", "WP-4": "WP-2"}))
    assert "WP-1 0.92 m (rig file 2.80 m), WP-2 1.5" in text and "WP-4 2.8" in text
    assert "WP-5" not in text


def test_one_wire_that_is_elsewhere_is_no_other_set_up(made):
    assert not told(analysed(made, {"WP-1": "WP-2"}))


def test_the_right_rig_is_not_doubted(made):
    assert not told(analysed(made, {}))
