"""The command line: help that teaches, one line for bad input, statuses as promised, completion."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from radiation_ss.cli import main, parser

ROOT = Path(__file__).parents[1]
VERBS = {"demo": "", "check": "HYDRO:", "fit": "HYDRO:", "model": "HYDRO:", "audit": "radiation model to score:",
         "simulate": "RECORD:", "identify": "RECORD:", "plan": "MODEL:", "diagnose": "RECORD:", "blind": "",
         "completion": ""}


def help_of(verb, capsys):
    with pytest.raises(SystemExit) as stop:
        parser().parse_args([verb, "--help"])
    assert stop.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb, capsys):
    shown = help_of(verb, capsys)
    assert VERBS[verb] in shown and "Exit status" in shown and verb in shown
    assert len(re.findall("^MODEL:", shown, re.MULTILINE)) <= 1


@pytest.mark.parametrize("words", [[], ["fit"], ["no-such-verb"], ["fit", "x.nc", "--order", "two", "--out", "f.json"]])
def test_bad_words_are_one_line_and_status_two(words, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_second_value_of_an_option_that_is_repeated_says_so(capsys):
    with pytest.raises(SystemExit):
        main(["diagnose", "m.nc", "a.csv", "--withhold", "b.csv", "c.csv", "--out", "x"])
    shown = capsys.readouterr().err
    assert "c.csv" in shown and "--withhold A --withhold B" in shown and shown.count("\n") == 1


def test_a_choice_that_is_none_names_the_choices(capsys):
    with pytest.raises(SystemExit):
        main(["fit", "x.nc", "--at-zero", "foo", "--out", "f.json"])
    assert "'foo'; choose free, zero or a number" in capsys.readouterr().err


def commands():
    """Return the commands that README and documents show, without the shell's own part."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if "generated" not in path.parts:
            text = re.sub(r" *\\\n *", " ", path.read_text(encoding="utf-8"))
            for found in re.findall(r"^(?: {4}|.*`)radiation-ss ([a-z][^`\n|]*)", text, re.MULTILINE):
                yield pytest.param(found.split("#")[0].split("  ")[0].split(), id=f"{path.stem}: {found}")


@pytest.mark.parametrize("words", list(commands()))
def test_commands_in_documents_are_understood(words):
    placeholders = [word for word in words if word in ("...", "…") or word[0] == "[" or word.isupper()]
    if words[1:] and not placeholders:
        assert parser().parse_args(words).verb == words[0]


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash absent")
@pytest.mark.parametrize("line, expected", [
    (["radiation-ss", "di"], {"diagnose"}), (["radiation-ss", "fit", "--at"], {"--at-zero"}),
    (["radiation-ss", "completion", "z"], {"zsh"})])
def test_bash_completes_verbs_and_options(line, expected, tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out + (
        f"\nCOMP_WORDS=({' '.join(line)}); COMP_CWORD={len(line) - 1}; _radiation_ss; echo ${{COMPREPLY[@]}}")
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == expected
