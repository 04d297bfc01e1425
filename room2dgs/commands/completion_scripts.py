"""Scripts for three shells. They hold all words, so that a TAB starts no Python.

Settings come a part at a time: `tr` gives `train.`, then its keys. Behind a comma values start anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from shlex import quote

from room2dgs.commands.completion_words import WITHOUT_SETTINGS, Words

BASH = r"""# room2dgs: completion for bash
_room2dgs() {
  local line=${COMP_LINE:0:COMP_POINT} IFS=$' \t\n' settings="@SETTINGS@"
  local word verb key value done known keys candidate rest
  local -a words
  read -ra words <<< "$line"
  [[ $line == *[[:space:]] ]] && words+=("")
  word=${words[${#words[@]}-1]} verb=${words[1]}
  COMPREPLY=()
  if (( ${#words[@]} == 2 )); then
    COMPREPLY=($(compgen -W "@VERBS@" -- "$word"))
    return
  fi
  if (( ${#words[@]} == 3 )); then
    case $verb in
@SECOND@
    esac
  fi
  if [[ $word == *=* ]]; then
    key=${word%%=*} value=${word#*=}
    case $verb:$key in
@VALUES@
    esac
    [[ $known ]] || return
    done=${value%"${value##*,}"}
    COMPREPLY=($(compgen -W "$known" -P "$done" -- "${value##*,}"))
    # what stands before "=" is a word of its own, unless somebody set it otherwise
    [[ $COMP_WORDBREAKS == *=* ]] || COMPREPLY=("${COMPREPLY[@]/#/$key=}")
    return
  fi
  case $verb in
@KEYS@
  esac
  for candidate in $keys; do
    [[ $candidate == "$word"* ]] || continue
    rest=${candidate#"$word"}
    if [[ $rest == *.* ]]; then candidate=$word${rest%%.*}.; else candidate+="="; fi
    [[ " ${COMPREPLY[*]} " == *" $candidate "* ]] || COMPREPLY+=("$candidate")
  done
  (( ${#COMPREPLY[@]} )) && compopt -o nospace 2> /dev/null
}
complete -o default -F _room2dgs room2dgs"""

ZSH = r"""#compdef room2dgs
# room2dgs: completion for zsh
_room2dgs() {
  local settings="@SETTINGS@" verb=$words[2] key known keys candidate rest
  local -a verbs found
  verbs=(
@VERBS@
  )
  if (( CURRENT == 2 )); then
    _describe command verbs
    return
  fi
  if (( CURRENT == 3 )); then
    case $verb in
@SECOND@
    esac
  fi
  if compset -P 1 '*='; then
    key=${${words[CURRENT]}%%=*}
    case $verb:$key in
@VALUES@
    esac
    if [[ -z $known ]]; then
      _files
      return
    fi
    compset -P '*,'
    compadd -- ${=known}
    return
  fi
  case $verb in
@KEYS@
  esac
  for candidate in ${=keys}; do
    [[ $candidate == "$PREFIX"* ]] || continue
    rest=${candidate#"$PREFIX"}
    if [[ $rest == *.* ]]; then found+=("$PREFIX${rest%%.*}."); else found+=("$candidate="); fi
  done
  if (( $#found )); then compadd -S '' -- ${(u)found}; else _files; fi
}
if [[ $funcstack[1] == _room2dgs ]]; then _room2dgs "$@"; else compdef _room2dgs room2dgs; fi"""

FISH = r"""# room2dgs: completion for fish
function __room2dgs_words
  set -l typed (commandline -opc)
  set -l word (commandline -ct)
  set -l verb $typed[2]
  set -l settings @SETTINGS@
  set -l known
  set -l keys
  if test (count $typed) -eq 2
    switch $verb
@SECOND@
    end
  end
  if string match -q '*=*' -- $word
    set -l key (string replace -r '=.*' '' -- $word)
    set -l done (string replace -r '[^=,]*$' '' -- $word)
    switch $verb:$key
@VALUES@
    end
    for value in $known
      echo $done$value
    end
    return
  end
  switch $verb
@KEYS@
  end
  for candidate in $keys
    if test "$word" = (string sub -l (string length -- "$word") -- $candidate)
      set -l rest (string sub -s (math (string length -- "$word") + 1) -- $candidate)
      if string match -q '*.*' -- $rest
        echo $word(string replace -r '\..*' '.' -- $rest)
      else
        echo $candidate=
      end
    end
  end
end
function __room2dgs_has_words
  test (count (commandline -opc)) -gt 1; and test (count (__room2dgs_words)) -gt 0
end
complete -c room2dgs -f -n __room2dgs_has_words -a '(__room2dgs_words)'
@VERBS@"""


def bash(words: Words) -> str:
    second = [
        f'      {verb}) COMPREPLY=($(compgen -W "{_line(them)}" -- "$word")); return ;;'
        for verb, them in words.second.items()
    ]
    return _filled(
        BASH, SETTINGS=_line(words.settings), VERBS=_line(words.verbs), SECOND="\n".join(second),
        VALUES=_cases(words), KEYS=_key_cases(words),
    )  # fmt: skip


def zsh(words: Words) -> str:
    second = [f"      {verb}) compadd -- {_line(them)}; return ;;" for verb, them in words.second.items()]
    verbs = [f"    {quote(verb + ':' + what.replace(':', chr(92) + ':'))}" for verb, what in words.verbs.items()]
    return _filled(
        ZSH, SETTINGS=_line(words.settings), VERBS="\n".join(verbs), SECOND="\n".join(second),
        VALUES=_cases(words), KEYS=_key_cases(words),
    )  # fmt: skip


def fish(words: Words) -> str:
    second = [
        f"      case {verb}\n        printf '%s\\n' {_line(them)}\n        return"
        for verb, them in words.second.items()
    ]
    values = [
        f"      case '{verb or '*'}:{key}'\n        set -- known {_line(them)}"
        for (verb, key), them in _specific_first(words)
    ]
    keys = [f"    case {verb}\n      set keys {_keys(words, verb)}" for verb in words.verbs]
    verbs = [
        f"complete -c room2dgs -f -n 'test (count (commandline -opc)) -eq 1' -a {verb} -d {quote(what)}"
        for verb, what in words.verbs.items()
    ]
    return _filled(
        FISH, SETTINGS=_line(words.settings), VERBS="\n".join(verbs), SECOND="\n".join(second),
        VALUES="\n".join(values), KEYS="\n".join(keys),
    )  # fmt: skip


SCRIPTS: dict[str, Callable[[Words], str]] = {"bash": bash, "zsh": zsh, "fish": fish}


def _keys(words: Words, verb: str) -> str:
    return _line((*words.own[verb], *(() if verb in WITHOUT_SETTINGS else ("$settings",))))


def _key_cases(words: Words) -> str:
    """Cases of the keys, in the syntax that bash and zsh share."""
    return "\n".join(f'    {verb}) keys="{_keys(words, verb)}" ;;' for verb in words.verbs)


def _cases(words: Words) -> str:
    """Cases of the values, in the syntax that bash and zsh share."""
    return "\n".join(
        f'      {verb or "*"}:{key}) known="{_line(them)}" ;;' for (verb, key), them in _specific_first(words)
    )


def _specific_first(words: Words) -> list[tuple[tuple[str, str], tuple[str, ...]]]:
    return sorted(words.values.items(), key=lambda item: not item[0][0])


def _line(words: Iterable[str]) -> str:
    return " ".join(words)


def _filled(template: str, **parts: str) -> str:
    for name, text in parts.items():
        template = template.replace(f"@{name}@", text)
    return template
