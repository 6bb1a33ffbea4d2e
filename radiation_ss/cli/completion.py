"""Completion of verbs, options and file names in bash and zsh."""

from __future__ import annotations

import argparse

BASH = """\
_radiation_ss() {{
  local words cur=${{COMP_WORDS[COMP_CWORD]}}
  case $COMP_CWORD/${{COMP_WORDS[1]}} in
    1/*) words="{verbs}" ;;
{cases}
  esac
  COMPREPLY=($(compgen -W "$words" -- "$cur"))
  if [[ $COMP_CWORD -gt 1 && $cur != -* ]]; then COMPREPLY+=($(compgen -f -- "$cur")); fi
}}
complete -o filenames -F _radiation_ss radiation-ss
"""


def script(top: argparse.ArgumentParser, shell: str) -> str:
    """Return the completion script of a parser with verbs."""
    verbs = next(a for a in top._actions if isinstance(a, argparse._SubParsersAction)).choices
    cases = "\n".join(f'    */{name}) words="{" ".join(sorted(words(one)))}" ;;' for name, one in verbs.items())
    text = BASH.format(verbs=" ".join(verbs), cases=cases)
    return text if shell == "bash" else f"autoload -U +X bashcompinit && bashcompinit\n{text}"


def words(one: argparse.ArgumentParser) -> set[str]:
    """Return the options of a verb and the words that it chooses from."""
    found = {option for action in one._actions for option in action.option_strings if option.startswith("--")}
    return found | {str(choice) for action in one._actions for choice in action.choices or ()}
