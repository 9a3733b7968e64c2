"""Errors planted for the checks of real machines: in what a fit determined and predicted."""

from functools import partial

from elevon_cases.real.machines import DeterminedRow, PredictedRow, RealMachineResult, machines


def real(name, factor=1.0, error=0.5, aside=0.0):
    """Return the checks of a machine whose numbers are the authors', times a factor.

    The errors on held-out logs are a share of their limits; one file's inertia lies aside.
    """
    machine = machines()[name]
    rows, predictions = [], []
    for number, fit in enumerate(machine.fits):
        values = {item.quantity: factor * item.value for item in machine.printed}
        if fit.group:
            values = {"inertia": 4.7e-4 + aside * number}
        for quantity, value in values.items():
            theirs = next((p.value for p in machine.printed if p.quantity == quantity), None)
            off = None if theirs is None else 100.0 * (value / theirs - 1.0)
            low, high = sorted((0.99 * value, 1.01 * value))
            rows.append(DeterminedRow(fit.name, quantity, value, low, high, "", theirs, off, False))
        for wanted in machine.predicted if fit.held_out else ():
            size = error * wanted.limit
            row = PredictedRow(fit.name, "log", wanted.signal, True, size, wanted.unit, size)
            predictions.append(row)
    return RealMachineResult(rows, predictions, {}, "", "", {}, machine).checks


REAL_GOOD = {f"real-{name}": partial(real, name) for name in machines()}
REAL_PLANTED = {
    **{(f"real-{name}", "*: * less the authors'"): partial(real, name, 1.3) for name in machines()},
    **{
        (f"real-{name}", "*: * on held-out logs, the worst"): partial(real, name, error=1.5)
        for name in machines()
    },
    ("real-dynamometer", "*: *, intervals apart"): partial(real, "dynamometer", aside=1e-4),
}
