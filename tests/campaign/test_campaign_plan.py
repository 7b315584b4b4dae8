"""The campaign file, names, and what is next after any history of releases."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.campaign.names import TestName
from daq_app.campaign.plan import Campaign, load_campaign
from daq_app.campaign.status import CampaignStatus, PlaceState, RecordedTest, TestVerdict
from daq_app.config import ConfigError

GOOD, BAD, LOST, UNCHECKED = TestVerdict.GOOD, TestVerdict.BAD, TestVerdict.LOST, TestVerdict.UNCHECKED
_PLAN = Path(__file__).parents[2] / "configs" / "campaigns" / "costa.toml"


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return load_campaign(_PLAN)


def history(*tests: tuple[str, TestVerdict]) -> list[RecordedTest]:
    return [RecordedTest(TestName.parse(n), v, released_ns=k) for k, (n, v) in enumerate(tests, 1)]


def next_name(campaign: Campaign, *tests: tuple[str, TestVerdict], specimen: str = "") -> str:
    proposal = CampaignStatus(campaign, history(*tests)).next_test(specimen)
    return str(proposal.name) if proposal else ""


def test_is_table_3_2(campaign: Campaign) -> None:
    names = [str(test.name) for test in campaign.tests]
    assert len(names) == len(set(names)) == 36
    assert sum(name.startswith("FR1") for name in names) == 21
    assert names[:6] == ["FR1-L1-1", "FR1-L1-2", "FR1-L1-3", "FR1-L1-4", "FR1-L1-5", "FR1-L2-1"]
    assert names[18:22] == ["FR1-L3-R", "FR1-L2-R", "FR1-L1-R", "FR2-L3-1"]
    assert names[-4:] == ["FR2-L1-R", "FR2-L4-1", "FR2-L4-2", "FR2-L4-3"]
    assert sum(test.lost_originally for test in campaign.tests) == 6
    assert {t.theta0_over_alpha for t in campaign.tests if t.name.level == "L4"} == {0.40}
    assert campaign.rig_path("FR2") == _PLAN.parent / "../fr2.toml"


@pytest.mark.parametrize("text", ["FR1-L3-2", "FR1-L3-R", "FR1-L3-R2", "FR2-L1-12"])
def test_names_read_back(text: str) -> None:
    assert str(TestName.parse(text)) == text


@pytest.mark.parametrize("text", ["", "FR1-L3", "FR1-L3-", "FR1-L3-0", "FR1 L3 2", "FR1-L3-2-1", "FR1-L3-r"])
def test_other_texts_are_no_names(text: str) -> None:
    with pytest.raises(ValueError, match="FR1-L3-2"):
        TestName.parse(text)


def test_starts_with_the_first_test(campaign: Campaign) -> None:
    assert next_name(campaign) == "FR1-L1-1"
    assert next_name(campaign, specimen="FR2") == "FR2-L3-1"


def test_goes_on_in_order(campaign: Campaign) -> None:
    assert next_name(campaign, ("FR1-L1-1", GOOD), ("FR1-L1-2", UNCHECKED)) == "FR1-L1-3"


def test_a_failed_test_is_offered_again_at_once_under_a_new_number(campaign: Campaign) -> None:
    status = CampaignStatus(campaign, history(("FR1-L1-1", GOOD), ("FR1-L1-2", BAD)))
    proposal = status.next_test()
    assert proposal is not None
    assert str(proposal.name) == "FR1-L1-6"
    assert str(proposal.planned.name) == "FR1-L1-2"
    assert "repeats FR1-L1-2" in proposal.reason
    assert next_name(campaign, ("FR1-L1-1", GOOD), ("FR1-L1-2", BAD), ("FR1-L1-6", GOOD)) == "FR1-L1-3"


def test_a_repetition_that_failed_is_numbered(campaign: Campaign) -> None:
    assert next_name(campaign, ("FR1-L3-R", LOST)) == "FR1-L3-R2"
    assert next_name(campaign, ("FR1-L3-R", LOST), ("FR1-L3-R2", BAD)) == "FR1-L3-R3"


def test_the_failed_test_of_another_specimen_is_not_offered(campaign: Campaign) -> None:
    assert next_name(campaign, ("FR2-L3-1", BAD), specimen="FR1") == "FR1-L1-1"
    assert next_name(campaign, ("FR2-L3-1", BAD)) == "FR2-L3-4"


def test_an_aborted_arming_burns_no_number(campaign: Campaign) -> None:
    """Nothing was released, so nothing is recorded, so the proposal stands."""
    assert next_name(campaign, ("FR1-L1-1", GOOD)) == next_name(campaign, ("FR1-L1-1", GOOD)) == "FR1-L1-2"


def test_states_of_places(campaign: Campaign) -> None:
    status = CampaignStatus(
        campaign,
        history(("FR1-L3-2", GOOD), ("FR1-L3-3", BAD), ("FR1-L9-1", GOOD), ("FR1-L4-9", GOOD)),
    )
    assert [str(p.planned.name) for p in status.in_state(PlaceState.DONE)] == ["FR1-L3-2", "FR1-L4-1"]
    assert [str(p.planned.name) for p in status.in_state(PlaceState.TO_REPEAT)] == ["FR1-L3-3"]
    assert len(status.in_state(PlaceState.MISSING)) == 33
    assert [str(test.name) for test in status.extra] == ["FR1-L9-1"]


def test_more_tests_than_planned_are_extra(campaign: Campaign) -> None:
    tests = [(f"FR2-L4-{n}", GOOD) for n in (1, 2, 3, 4)]
    assert [str(t.name) for t in CampaignStatus(campaign, history(*tests)).extra] == ["FR2-L4-4"]


def test_scan_takes_any_reader(campaign: Campaign, tmp_path: Path) -> None:
    asked: list[Path] = []

    def reader(folder: Path) -> list[RecordedTest]:
        asked.append(folder)
        return history(("FR1-L1-1", GOOD))

    status = CampaignStatus.scan(campaign, tmp_path, reader)
    assert asked == [tmp_path]
    assert len(status.in_state(PlaceState.DONE)) == 1


@given(st.data())
def test_following_the_proposals_fills_the_plan(data: st.DataObject) -> None:
    """Whatever fails on the way, each name is given once, and in the end every place is done."""
    campaign = load_campaign(_PLAN)
    recorded: list[RecordedTest] = []
    for moment in range(200):
        proposal = CampaignStatus(campaign, recorded).next_test()
        if proposal is None:
            break
        assert proposal.name not in {test.name for test in recorded}
        failures = sum(test.verdict in (BAD, LOST) for test in recorded)
        verdict = data.draw(st.sampled_from([GOOD, UNCHECKED] + ([BAD, LOST] if failures < 30 else [])))
        recorded.append(RecordedTest(proposal.name, verdict, moment))
    status = CampaignStatus(campaign, recorded)
    assert status.next_test() is None
    assert len(status.in_state(PlaceState.DONE)) == 36
    assert not status.extra


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ('level = "L4"', 'level = "L5"', "sequence[3] (FR1-L5).level", "Levels: L1, L2, L3, L4"),
        ("lost = [3, 4]", "lost = [6]", "sequence[1] (FR1-L2).lost", "from 1 to 5"),
        ("L4 = 0.40", "L4 = 1.4", "levels.L4", "less than 1"),
        ("tests = 3", 'tests = "3"', "sequence[3] (FR1-L4).tests", "whole number"),
        (
            "repetition = true",
            "repetitoin = true",
            "sequence[4] (FR1-L3).repetitoin",
            "Did you mean `repetition`",
        ),
        ("../fr2.toml", "../fr3.toml", "rigs.FR2", "from this file's folder"),
        ("FR2 = ", "FR9 = ", "rigs.FR9", "Specimens of the sequence: FR1, FR2"),
    ],
)
def test_faults_of_the_file_are_named(tmp_path: Path, old: str, new: str, key: str, words: str) -> None:
    (tmp_path / "campaigns").mkdir()
    for rig in ("fr1.toml", "fr2.toml"):
        (tmp_path / rig).touch()
    path = tmp_path / "campaigns" / "bad.toml"
    text = _PLAN.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_campaign(path)
    assert [p.key for p in caught.value.problems] == [key]
    assert words in caught.value.problems[0].right
