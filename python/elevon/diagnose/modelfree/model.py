"""The model-free diagnosis of one actuator: trained on labelled recordings, saved as one file."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.modelfree.baseline import HealthyBaseline
from elevon.diagnose.modelfree.discriminant import Discriminant
from elevon.diagnose.modelfree.features import FULL, TRANSFER, FeatureTable, feature_table
from elevon.errors import FormatError, InputError, unknown
from elevon.recording import Recording

VIEWS = {"transfer": TRANSFER, "full": FULL}
SHRINKAGE = {"transfer": 0.2, "full": 0.6}
"""Many features of few recordings need a scatter close to its diagonal."""
_VERSION = 1
_MOST_BYTES = 50_000_000


@dataclass(frozen=True, slots=True)
class ModelFree:
    """Healthy baseline and classifier over one set of features.

    Attributes
    ----------
    view : str
        ``transfer``: features that keep their meaning at a load that was not trained;
        ``full``: all of them, the level of the current included, for the loads that were.
    rate : float
        Sample rate of the training recordings [Hz]; another one is refused.
    classifier : Discriminant
        Which condition.
    baseline : HealthyBaseline
        Healthy or not, at the loads with healthy recordings.
    """

    view: str
    rate: float
    classifier: Discriminant
    baseline: HealthyBaseline

    @classmethod
    def fit(
        cls,
        recordings: Sequence[Recording],
        labels: Sequence[str],
        *,
        healthy: str = "normal",
        view: str = "transfer",
    ) -> ModelFree:
        """Train on labelled recordings.

        Parameters
        ----------
        recordings : sequence of Recording
            As `feature_table` takes them.
        labels : sequence of str
            Condition of each.
        healthy : str
            The label of the healthy ones.
        view : str
            ``transfer`` or ``full``.

        Raises
        ------
        InputError
            No recording is healthy, too few of them, fewer than two conditions, lengths differ.
        FormatError
            As `feature_table`.
        """
        if view not in VIEWS:
            raise unknown("view", view, VIEWS)
        if len(labels) != len(recordings):
            raise InputError(f"{len(recordings)} recordings, but {len(labels)} labels")
        return cls.fit_table(feature_table(recordings), labels, healthy=healthy, view=view)

    @classmethod
    def fit_table(
        cls, table: FeatureTable, labels: Sequence[str], *, healthy: str = "normal",
        view: str = "transfer",
    ) -> ModelFree:  # fmt: skip
        """Train on features that are there already; as `fit`."""
        names, words = VIEWS[view], np.asarray(labels, dtype=np.str_)
        if healthy not in words:
            raise unknown("healthy label", healthy, np.unique(words).tolist())
        values, well = table.select(names), words == healthy
        # Calibrated on whole loads left out where there are several: the harder, honest question.
        single = len(np.unique(table.load)) == 1 or view == "full"
        groups = _rank_in_cell(words, table.load) if single else table.load
        classifier = Discriminant.fit(values, words.tolist(), groups, shrinkage=SHRINKAGE[view])
        baseline = HealthyBaseline.fit(names, values[well], table.load[well])
        return cls(view, table.rate, classifier, baseline)

    @property
    def classes(self) -> tuple[str, ...]:
        """Conditions, in the order of the probabilities."""
        return self.classifier.classes

    def predict_proba(self, recordings: Sequence[Recording]) -> npt.NDArray[np.float64]:
        """Return the probability of each condition, (recordings, conditions)."""
        return self.classifier.predict_proba(self._values(recordings)[0])

    def p_healthy(self, recordings: Sequence[Recording]) -> npt.NDArray[np.float64]:
        """Return for each recording how often a healthy one would deviate as much.

        Raises
        ------
        InputError
            A load has no healthy recording in the baseline.
        """
        values, load = self._values(recordings)
        return self.baseline.p_values(values, load)

    def outside(self, recordings: Sequence[Recording]) -> list[list[str]]:
        """Return for each recording the features that lie outside what was trained."""
        table = self.classifier.outside(self._values(recordings)[0])
        return [
            [n for n, out in zip(self.baseline.names, row, strict=True) if out] for row in table
        ]

    def _values(
        self, recordings: Sequence[Recording]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        table = feature_table(recordings)
        if abs(table.rate / self.rate - 1.0) > 0.02:
            raise FormatError(
                f"the recordings have {table.rate:g} Hz, the model was trained at {self.rate:g} Hz"
            )
        return table.select(self.baseline.names), table.load

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write the model as one NumPy archive: arrays, and a JSON text; nothing executable.

        Raises
        ------
        OutputExistsError, OutputError
            As `elevon.files.write_bytes`.
        """
        from elevon.files import write_bytes

        c, b = self.classifier, self.baseline
        about = {
            "format": "elevon-modelfree", "version": _VERSION, "view": self.view,
            "rate": self.rate, "classes": list(c.classes), "names": list(b.names),
            "shrinkage": c.shrinkage, "temperature": c.temperature, "freedom": b.freedom,
        }  # fmt: skip
        stream = io.BytesIO()
        np.savez(
            stream, about=np.array(json.dumps(about)), means=c.means, scale=c.scale,
            precision=c.precision, low=c.low, high=c.high, loads=b.loads, healthy=b.means,
            counts=b.counts, spread=b.spread,
        )  # fmt: skip
        return write_bytes(path, stream.getvalue(), force=force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ModelFree:
        """Read a model that `save` wrote.

        Raises
        ------
        FormatError
            The file is absent, damaged or something else.
        """
        try:
            _check_size(Path(path))
            with np.load(path, allow_pickle=False) as archive:
                data = {name: archive[name] for name in archive.files}
            return _assembled(data)
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise FormatError(f"{path}: not a model-free diagnosis: {error}") from error


def _rank_in_cell(
    words: npt.NDArray[np.str_], load: npt.NDArray[np.float64]
) -> npt.NDArray[np.int64]:
    """Number the recordings of each condition and load, as groups to leave out."""
    ranks, seen = np.zeros(len(words), np.int64), dict[tuple[str, float], int]()
    for index, cell in enumerate(zip(words.tolist(), load.tolist(), strict=True)):
        ranks[index] = seen[cell] = seen.get(cell, -1) + 1
    return ranks


def _check_size(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        size = sum(item.file_size for item in archive.infolist())
    if size > _MOST_BYTES:
        raise ValueError(f"{size} bytes, more than {_MOST_BYTES}")


def _assembled(data: dict[str, Any]) -> ModelFree:
    about = json.loads(str(data["about"]))
    if about.get("format") != "elevon-modelfree" or about.get("version") != _VERSION:
        raise ValueError(f"format {about.get('format')!r}, version {about.get('version')!r}")
    names, classes = tuple(map(str, about["names"])), tuple(map(str, about["classes"]))
    count = len(names)
    shapes = {"means": (len(classes), count), "precision": (count, count), "scale": (count,),
              "low": (count,), "high": (count,), "spread": (count,),
              "healthy": (len(data["loads"]), count), "counts": (len(data["loads"]),)}  # fmt: skip
    for name, shape in shapes.items():
        if data[name].shape != shape or not np.isfinite(data[name]).all():
            raise ValueError(f"array {name}: {data[name].shape} instead of {shape}, or not finite")
    classifier = Discriminant(
        classes, data["means"], data["scale"], data["precision"], data["low"], data["high"],
        float(about["shrinkage"]), float(about["temperature"]),
    )  # fmt: skip
    baseline = HealthyBaseline(
        names, data["loads"], data["healthy"], data["counts"], data["spread"], int(about["freedom"])
    )
    return ModelFree(str(about["view"]), float(about["rate"]), classifier, baseline)
