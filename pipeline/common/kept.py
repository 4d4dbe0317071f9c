"""Finished results as bytes that hold numbers and words, never code: who reads them need not trust who wrote them.

An .npz archive of the arrays, read with allow_pickle=False, and a JSON document of everything else. A dataclass is
named by its module; only one of this package that is loaded already can come back. A digest of it all stands behind.
"""

from __future__ import annotations

import hashlib
import io
import json
import sys
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

DOCUMENT = "document"
PACKAGE = __name__.partition(".")[0]
_DIGEST = hashlib.sha256().digest_size


def dumps(value: Any) -> bytes:
    """A value made of None, booleans, numbers, text, arrays, lists, tuples, tables and the package's dataclasses."""
    arrays: list[Any] = []
    document = json.dumps(_plain(value, arrays)).encode()
    file = io.BytesIO()
    named = {f"array_{index}": array for index, array in enumerate(arrays)}
    np.savez(file, allow_pickle=False, **{DOCUMENT: np.frombuffer(document, np.uint8)}, **named)
    return file.getvalue() + hashlib.sha256(file.getvalue()).digest()


def loads(whole: bytes) -> Any:
    """The same value again, to the last bit; raises ValueError for anything that `dumps` did not write."""
    content, digest = whole[:-_DIGEST], whole[-_DIGEST:]
    if hashlib.sha256(content).digest() != digest:
        raise ValueError("not what was written")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            return _value(json.loads(archive[DOCUMENT].tobytes()), archive)
    except Exception as error:  # whatever a strange archive does, it is no result
        raise ValueError(f"no result: {error}") from error


def _plain(value: Any, arrays: list[Any]) -> Any:
    """As JSON: whatever is not plain there is a table of its kind and its content."""
    match value:
        case np.ndarray() | np.generic():
            if value.dtype.hasobject:
                raise TypeError("an array of objects is no result")
            arrays.append(value)
            return {"scalar" if isinstance(value, np.generic) else "array": len(arrays) - 1}
        case None | bool() | int() | float() | str():
            return value
        case list():
            return [_plain(entry, arrays) for entry in value]
        case tuple():
            return {"tuple": [_plain(entry, arrays) for entry in value]}
        case dict():
            return {"table": [[_plain(key, arrays), _plain(entry, arrays)] for key, entry in value.items()]}
    if not is_dataclass(value) or type(value).__module__.partition(".")[0] != PACKAGE:
        raise TypeError(f"a {type(value).__name__} is no result")
    name = [type(value).__module__, type(value).__qualname__]
    return {"of": name, "has": {one.name: _plain(getattr(value, one.name), arrays) for one in fields(value)}}


def _value(plain: Any, archive: Any) -> Any:
    if isinstance(plain, list):
        return [_value(entry, archive) for entry in plain]
    if not isinstance(plain, dict):
        return plain
    match plain:
        case {"array": index}:
            return archive[f"array_{int(index)}"]
        case {"scalar": index}:
            return archive[f"array_{int(index)}"][()]
        case {"tuple": entries}:
            return tuple(_value(entry, archive) for entry in entries)
        case {"table": rows}:
            return {_value(key, archive): _value(entry, archive) for key, entry in rows}
    module, name = plain["of"]
    found = getattr(sys.modules[module], name) if module.partition(".")[0] == PACKAGE else None
    if not (isinstance(found, type) and is_dataclass(found)):
        raise ValueError(f"{module}.{name} is no dataclass of {PACKAGE}")
    return found(**{key: _value(entry, archive) for key, entry in plain["has"].items()})
