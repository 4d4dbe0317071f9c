"""Completion by TAB for `python -m pipeline`: Hydra's own knows scripts and installed commands, but not `python -m`.

eval "$(python -m pipeline -sc install=bash)"
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence

MODULE = r"^\s*\S*python[\d.]*\s+-m\s+(pipeline[\w.]*)"

# The whole line goes to Hydra; what begins with an underscore is only there to be inherited from. Where the shell
# breaks words at `=` it replaces only what stands behind it.
BASH = r"""_pipeline_completion() {
    local line=${COMP_LINE:0:COMP_POINT} word command
    local module='[^[:space:]]*python[0-9.]*[[:space:]]+-m[[:space:]]+pipeline[a-z.]*'
    if [[ $line =~ ^[[:space:]]*($module|[^[:space:]]*selfmotion)[[:space:]] ]]; then
        command=${BASH_REMATCH[1]}
    else
        return
    fi
    word=${line##*[[:space:]]}
    COMPREPLY=($(compgen -X '*[=/]_*' -W "$(COMP_LINE=$line $command -sc query=bash 2>/dev/null)" -- "$word"))
    if [[ $word == *=* && $COMP_WORDBREAKS == *=* ]]; then
        COMPREPLY=("${COMPREPLY[@]#"${word%=*}="}")
    fi
}
complete -o nospace -o default -F _pipeline_completion python python3 selfmotion"""


FLAGS = ("-sc", "--shell-completion")


def installs(words: Sequence[str]) -> bool:
    """Whether the command line asks for the script; `complete -r python python3 selfmotion` takes it back."""
    return len(words) == 2 and words[0] in FLAGS and words[1] == "install=bash"


def completes(words: Sequence[str]) -> bool:
    """Whether the command line asks what may follow; Hydra then reads the line as that of an installed command."""
    asked = bool(set(FLAGS) & set(words))
    if asked and "COMP_LINE" in os.environ:
        os.environ["COMP_LINE"] = re.sub(MODULE, r"\1", os.environ["COMP_LINE"])
    return asked
