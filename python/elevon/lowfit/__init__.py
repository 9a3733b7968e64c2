"""Fit the reduced-order model's free numbers to the switching model over scenarios and faults."""

from elevon.lowfit.cases import FitCase, default_cases, named_cases
from elevon.lowfit.fit import FREE, LowFit, fit_low
from elevon.lowfit.write import fitted_parameters, write_fit

__all__ = [
    "FREE",
    "FitCase",
    "LowFit",
    "default_cases",
    "fit_low",
    "fitted_parameters",
    "named_cases",
    "write_fit",
]
