"""The command line: help that teaches, one line for bad input, statuses as promised."""

import pytest

from radiation_ss.cli import main, parser

VERBS = ("demo", "check", "fit", "audit", "simulate", "identify", "plan", "diagnose", "blind")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb, capsys):
    with pytest.raises(SystemExit) as stop:
        parser().parse_args([verb, "--help"])
    assert stop.value.code == 0
    shown = capsys.readouterr().out
    assert "RECORD is a CSV file" in shown and verb in shown


@pytest.mark.parametrize("words", [[], ["fit"], ["no-such-verb"], ["fit", "x.nc", "--order", "two", "--out", "f.json"]])
def test_bad_words_are_one_line_and_status_two(words, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
