"""Whether a result file is whole, by its kind."""

import json
import tomllib
import zipfile

import pyarrow.parquet as pq
from scipy.io import loadmat


def readable(path):
    """Whether a file can be read to its end; a log may end in a line cut short."""
    read = _READERS.get(path.suffix)
    if read is None:
        return False
    try:
        return read(path)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return False


def _log(path):
    """Lines with a checksum; the last may be cut, which every reader passes over."""
    from elevon.worklog import WorkLog

    return WorkLog.read(path) is not None


def _json(path):
    json.loads(path.read_text("utf-8"))
    return True


def _toml(path):
    tomllib.loads(path.read_text("utf-8"))
    return True


def _page(path):
    return path.read_text("utf-8").rstrip().endswith("</html>")


def _parquet(path):
    return pq.read_table(path).num_rows >= 0


def _text(path):
    text = path.read_text("utf-8")
    return bool(text) and text.endswith("\n")


def _npz(path):
    return zipfile.ZipFile(path).testzip() is None


def _mat(path):
    return bool(loadmat(path))


def _png(path):
    return path.read_bytes().rstrip(b"\0").endswith(b"IEND\xaeB`\x82")


_READERS = {
    ".log": _log, ".json": _json, ".toml": _toml, ".html": _page, ".parquet": _parquet,
    ".csv": _text, ".md": _text, ".npz": _npz, ".png": _png, ".svg": _text, ".txt": _text,
    ".mat": _mat,
}  # fmt: skip
