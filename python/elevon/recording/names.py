"""What a channel or a clock may be called: one rule that Python, MATLAB and FMI all accept."""

import keyword
import re

from elevon.errors import InputError

LONGEST_NAME = 31
"""MATLAB's limit for the fields of a version 5 file."""

_FORM = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MATLAB = (
    "break case catch classdef continue else elseif end for function global if otherwise "
    "parfor persistent return spmd switch try while"
)
_RESERVED = frozenset({"time", "clock", "units", "elevon"})


def check_name(name: str, what: str = "channel") -> str:
    """Check the name of a channel or a clock.

    Parameters
    ----------
    name : str
        The name.
    what : str
        What it names; used in the error.

    Returns
    -------
    str
        The same name.

    Raises
    ------
    InputError
        Not an ASCII identifier of at most 31 characters starting with a letter, or a word that
        Python, MATLAB or the file formats reserve.
    """
    if not _FORM.fullmatch(str(name)):
        raise InputError(
            f"{what} {name!r}: a name is a letter followed by letters, digits and underscores"
        )
    if len(name) > LONGEST_NAME:
        raise InputError(
            f"{what} {name!r}: {len(name)} characters; the limit is {LONGEST_NAME} (MATLAB)"
        )
    if keyword.iskeyword(name) or name in _MATLAB.split() or name in _RESERVED:
        raise InputError(f"{what} {name!r}: the word is reserved")
    return name
