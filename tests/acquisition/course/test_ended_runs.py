"""Which of the runs that are over is spoken of."""

from __future__ import annotations

from daq_app.acquisition.course.ended_runs import EndedRuns


def test_only_the_run_that_ended_last_is_spoken_of() -> None:
    runs = EndedRuns()
    runs.end()
    assert not runs.all_saved
    assert runs.close()
    runs.end()
    runs.save()
    assert not runs.all_saved, "the first is saved, the second not even closed"
    assert runs.close()
    assert not runs.all_saved
    runs.save()
    assert runs.all_saved


def test_a_run_that_the_recorder_gives_up_has_no_course_that_was_over() -> None:
    runs = EndedRuns()
    assert not runs.close()
    runs.save()
    assert runs.all_saved


def test_an_answer_that_comes_twice_silences_no_later_run() -> None:
    runs = EndedRuns()
    for answers in (2, 1):
        runs.end()
        assert runs.close()
        for _ in range(answers):
            runs.save()
        assert runs.all_saved
