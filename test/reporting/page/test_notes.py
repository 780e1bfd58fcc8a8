"""Notes to the reader of a map."""

from __future__ import annotations

from dataclasses import replace

from soilmoist_ros.reporting.page.notes import notes
from soilmoist_ros.reporting.run import Note, NoteCode


def codes(run):
    return [note.code for note in notes(run)]


def test_a_guessed_calibration_is_noted_by_its_mark_not_by_words(make_run):
    run = make_run(notes=())
    said = replace(run, calibration=replace(run.calibration, source="not illustrative: 6 cores"))
    assert NoteCode.ILLUSTRATIVE_CALIBRATION not in codes(said)
    guessed = replace(run, calibration=replace(run.calibration, illustrative=True))
    assert codes(guessed)[0] is NoteCode.ILLUSTRATIVE_CALIBRATION


def test_moisture_that_no_soil_has_is_noted(make_run, steep, uncalibrated):
    assert NoteCode.RATE_BELOW_CURVE in codes(make_run(soil_map=steep))
    assert NoteCode.ABOVE_PORE_VOLUME in codes(make_run(soil_map=steep))
    assert codes(make_run(soil_map=uncalibrated, notes=(), calibration=None)) == []


def test_few_samples_are_noted_once(make_run, map_of):
    run = make_run(soil_map=map_of(curve=None, n=4), notes=[Note(NoteCode.NOT_MAPPED, "salt is not mapped")])
    assert codes(replace(run, calibration=None)) == [NoteCode.NOT_MAPPED, NoteCode.FEW_SAMPLES]
    assert "With 4 places measured" in str(notes(run)[-1])
