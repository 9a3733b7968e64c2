"""What each fault of the landing gear does, against a law: motor, bridge, train, brake, lock.

A retraction at the high speed, seen over many electrical turns, unless a test says otherwise; the
samples drift through the carrier's period (80 us, 50 us). Faults of the control unit's sensors:
`test_landing_gear_sensor_signatures.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.physics.gear import gear, value

BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])
STEADY = 1.2  # s: the speed is reached
RATE = 12_500.0  # samples a second
LEGS = {(1, 0, 1): "ab", (1, 0, 0): "ac", (1, 1, 0): "bc", (0, 1, 0): "ba", (0, 1, 1): "ca",
        (0, 0, 1): "cb"}  # fmt: skip  # High and low leg of a positive demand by Hall code.
RECORDED = ("motor_torque", "current_line", "motor_position", "motor_speed", "hall_a", "hall_b",
         "hall_c", "nut_position", "friction_force", "load_force", "efficiency", "energy_friction",
         "energy_efficiency", "energy_brake", "brake_torque")  # fmt: skip
PHASES = ("current_a", "current_b", "current_c")


def retraction(
    fidelity: str,
    *faults: Any,
    factor: float = 2.5,
    chopping: str = "low_side",
    values: dict[str, Any] | None = None,
) -> dict[str, np.ndarray]:
    """Signals of the steady part of a retraction."""
    names = RECORDED + (PHASES if fidelity == "high" else ())
    settings = {"load.factor": factor, "inverter.chopping": chopping} | (values or {})
    rec = gear((0.0, "retract"), duration=1.4, start="200 mm", fidelity=fidelity,
               faults=list(faults), record=f"{','.join(names)}@{RATE} Hz",
               values=settings)  # fmt: skip
    late = rec["motor_torque"].time > STEADY
    return {name: rec[name].values[late] for name in names}


def of_the_pair(
    fidelity: str, *faults: Any, values: dict[str, Any] | None = None
) -> dict[str, np.ndarray]:
    """A retraction in which a sample may show the conducting pair alone.

    The switching model does between the pulses of the third phase; the reduced-order one has their
    mean in every sample with low-side chopping, and none with the other.
    """
    chopping = "low_side" if fidelity == "high" else "both"
    return retraction(fidelity, *faults, chopping=chopping, values=values)


def pairs(run: dict[str, np.ndarray]) -> np.ndarray:
    """Which two legs conduct, by the Hall code."""
    codes = np.stack([run[f"hall_{phase}"] for phase in "abc"], axis=1).astype(int)
    return np.array([LEGS[tuple(code)] for code in codes])


def per_ampere(run: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Torque over current, in units of 2 k, where exactly one pair conducts; and that mask."""
    current = np.abs(run["current_line"])
    conducting = current > 1.0
    if "current_a" in run:
        sizes = np.sort(np.abs([run[name] for name in PHASES]), axis=0)
        conducting = (sizes[0] < 1e-9) & (sizes[2] > 1.0)
        current = 0.5 * sizes.sum(axis=0)
    else:
        conducting &= settled(run, float(np.max(current)))
    size = np.abs(run["motor_torque"][conducting]) / current[conducting]
    return size / (2.0 * value("motor.emf_constant")), conducting


def settled(run: dict[str, np.ndarray], largest: float) -> np.ndarray:
    """Samples of the reduced-order model in which the phase that left the pair has no current any
    more.

    With both legs chopped it dies within 3 L I/(V + e), the pair's EMF e with the current or none.
    """
    overlap = 3.0 * value("motor.winding_inductance") * largest / value("inverter.supply_voltage")
    since = int(np.ceil(overlap * RATE))
    changed = np.r_[False, np.diff(run["hall_a"] + 2 * run["hall_b"] + 4 * run["hall_c"]) != 0.0]
    return np.convolve(changed, np.ones(since + 1))[: changed.size] == 0.0


def gaps(angle: np.ndarray, sign: float, zeta: float, phase: float) -> dict[str, np.ndarray]:
    """1 + zeta cos(angle - phase +- 2 pi (j-1)/3) of the phases."""
    turns = dict(zip("abc", 2.0 * np.pi * np.arange(3) / 3.0, strict=True))
    return {j: 1.0 + zeta * np.cos(angle - phase + sign * turn) for j, turn in turns.items()}


@pytest.mark.signature("demagnetisation", "motor")
@BOTH
def test_lost_magnets_give_less_torque_per_ampere(fidelity: str) -> None:
    """T = 2 k (1 - f) i of the conducting pair; nine samples in ten are on the flats."""
    ratio, _ = per_ampere(of_the_pair(fidelity, "demagnetisation@motor=0.3"))
    assert np.mean(np.abs(ratio - 0.7) < 1e-9) > 0.9


@pytest.mark.signature("short", "motor")
@BOTH
def test_shorted_turns_weaken_four_of_six_sectors(fidelity: str) -> None:
    """k_a = N k: a pair with phase a gives (1 + N)/2 of the torque per ampere, the third all."""
    run = of_the_pair(fidelity, "short@motor.phase_a=0.4")
    ratio, conducting = per_ampere(run)
    with_a = np.array(["a" in legs for legs in pairs(run)])
    assert with_a.mean() == pytest.approx(2 / 3, abs=0.02)
    expected = np.where(with_a, 0.8, 1.0)[conducting]
    assert np.mean(np.abs(ratio - expected) < 1e-9) > 0.9


@pytest.mark.signature("open_phase", "motor")
@BOTH
def test_an_open_phase_leaves_two_of_six_sectors(fidelity: str) -> None:
    """Open in full motion: torque comes from the pair b and c alone, phase a carries nothing.

    What the pair leaves dies in the first of the two dead sectors.
    """
    opened = {"kind": "open_phase", "place": "motor.phase_a", "severity": 1.0,
              "profile": {"kind": "step", "time": 1.15}}  # fmt: skip
    run = retraction(fidelity, opened)
    torque, legs = np.abs(run["motor_torque"]), pairs(run)
    # Backwards through the sectors: cb, ca, ba, bc, ac, ab.
    assert np.isin(legs, ["bc", "cb"]).mean() == pytest.approx(1 / 3, abs=0.02)
    assert torque[np.isin(legs, ["bc", "cb"])].mean() > 0.1
    assert np.max(torque[np.isin(legs, ["ba", "ab"])]) == 0.0
    if fidelity == "high":
        assert np.max(np.abs(run["current_a"])) == 0.0


@pytest.mark.signature("eccentricity_static", "motor")
@pytest.mark.signature("eccentricity_dynamic", "motor")
@BOTH
@pytest.mark.parametrize(("kind", "pole_pairs", "sign"), [("static", 3, 1.0), ("dynamic", 1, -1.0)])
def test_the_air_gap_modulates_the_coefficients(
    kind: str, pole_pairs: int, sign: float, fidelity: str
) -> None:
    """T/(2 k i) is the mean of the two gap factors, at p theta (static) or theta (dynamic)."""
    zeta, phase = 0.3, 0.5
    fault = {"kind": f"eccentricity_{kind}", "place": "motor", "severity": zeta, "phase": phase}
    run = of_the_pair(fidelity, fault)
    ratio, conducting = per_ampere(run)
    gap = gaps(pole_pairs * run["motor_position"], sign, zeta, phase)
    law = [0.5 * (gap[high][n] + gap[low][n]) for n, (high, low) in enumerate(pairs(run))]
    # The angle moves by less than p w dt within the low step.
    slip = 1e-9 if fidelity == "high" else zeta * pole_pairs * 600.0 * value("low.step")
    assert np.mean(np.abs(ratio - np.array(law)[conducting]) < slip) > 0.9
    assert np.ptp(law) > 0.2


@pytest.mark.signature("open_switch", "inverter")
def test_an_open_switch_carries_no_current_of_its_sign() -> None:
    """Upper switch of a open: nothing drives a current into phase a; two sectors lose torque."""
    opened = {"kind": "open_switch", "place": "inverter.a_high", "severity": 1.0,
              "profile": {"kind": "step", "time": 1.15}}  # fmt: skip
    run = retraction("high", opened)
    assert run["current_a"].max() < 1e-9
    assert run["current_a"].min() < -1.0
    # Retracting, the demand is negative and the legs change places: a is high in ba and ca.
    dead = np.array([legs in ("ba", "ca") for legs in pairs(run)])
    torque = np.abs(run["motor_torque"])
    assert torque[dead].mean() < 0.1 * torque[~dead].mean()


@pytest.mark.signature("sag", "supply")
@BOTH
def test_a_sag_is_the_share_of_the_link(fidelity: str) -> None:
    """At rest the link stands at (1 - s) of the supply."""
    rec = gear(duration=0.3, fidelity=fidelity, faults=["sag@supply=0.4"])
    assert rec.final["supply_voltage"] == pytest.approx(0.6 * 28.0, rel=1e-3)


def ram_lead() -> float:
    """Distance of the ram per motor radian, r; the lead is in metres per radian."""
    return value("screw.lead") / value("gear.ratio_first") / value("gear.ratio_second")


def lost(run: dict[str, np.ndarray], account: str, expected: np.ndarray) -> np.ndarray:
    """Torque in an account beyond `own`, by tenths of the run: growth over angle."""
    angle = np.abs(run["motor_position"] - run["motor_position"][0])
    mean = 0.5 * (expected[1:] + expected[:-1])
    beyond = np.diff(run[f"energy_{account}"]) - mean * np.diff(angle)
    parts = zip(np.array_split(beyond, 10), np.array_split(np.diff(angle), 10), strict=True)
    return np.array([work.sum() / turned.sum() for work, turned in parts])


@pytest.mark.signature("bearing_wear", "motor")
@pytest.mark.signature("brake_dragging", "brake")
@pytest.mark.signature("brake_not_releasing", "brake")
@BOTH
@pytest.mark.parametrize(
    ("fault", "account", "torque"),
    [
        ("bearing_wear@motor.bearing=0.3", "friction", 0.3),
        ("brake_dragging@brake=0.3", "brake", 0.3),
        ("brake_not_releasing@brake=1", "brake", 0.9),
    ],
)
def test_a_rub_on_the_motor_shaft_costs_its_torque_at_every_angle(
    fault: str, account: str, torque: float, fidelity: str
) -> None:
    """dE = T dtheta, beyond the tables' r F_f dtheta."""
    run = retraction(fidelity, fault, factor=0.0)
    expected = ram_lead() * run["friction_force"] * (account == "friction")
    assert lost(run, account, expected) == pytest.approx(torque, rel=1e-3)


@pytest.mark.signature("friction_growth", "screw")
@BOTH
def test_grown_friction_is_added_to_the_table(fidelity: str) -> None:
    """F_f = table(v) + growth within the harmonics' sum, and it is what the account pays."""
    run = retraction(fidelity, "friction_growth@screw=500")
    speed = np.abs(run["motor_speed"]) * ram_lead()

    def table(name: str) -> np.ndarray:
        knots = [[value(f"friction.{path}_{n}") for n in range(1, 9)] for path in ("speed", name)]
        return np.interp(speed, *knots)

    friction = table("ffm_retraction")
    ripple = sum(table(f"harmonic_{n}") for n in range(1, 6))
    assert np.all(np.abs(run["friction_force"] - friction - 500.0) < ripple + 1e-9)
    paid = lost(run, "friction", 0.0 * friction)
    assert paid == pytest.approx(ram_lead() * run["friction_force"].mean(), rel=0.03)


@pytest.mark.signature("jam", "screw")
@BOTH
def test_a_jam_resists_with_its_force_where_it_is(fidelity: str) -> None:
    """r F_jam per radian within its width, nothing outside."""
    jam = {"kind": "jam", "place": "screw", "severity": 3000.0, "position": "165 mm",
           "width": "4 mm"}  # fmt: skip
    run = retraction(fidelity, jam)
    nut, rub = run["nut_position"], ram_lead() * run["friction_force"]
    for within, torque in ((True, 3000.0 * ram_lead()), (False, 0.0)):
        there = (np.abs(nut - 0.165) < 1.9e-3) if within else (nut < 0.1625)
        part = {name: values[there] for name, values in run.items()}
        assert there.sum() > 400
        assert lost(part, "friction", rub[there]) == pytest.approx(torque, abs=1e-3)


@pytest.mark.signature("efficiency_loss", "screw")
@pytest.mark.signature("efficiency_loss", "gear_first")
@pytest.mark.signature("efficiency_loss", "gear_second")
@BOTH
@pytest.mark.parametrize("place", ["screw", "gear_first", "gear_second"])
def test_a_lost_efficiency_scales_the_train(place: str, fidelity: str) -> None:
    """eta = (1 - s) eta_g (eta_inf + (eta_0 - eta_inf) exp(-F/F_c)); it costs (1/eta - 1) F r."""
    run = retraction(fidelity, f"efficiency_loss@{place}=0.05")
    loaded, unloaded = value("screw.efficiency_loaded"), value("screw.efficiency_unloaded")
    force = np.abs(run["load_force"])
    screw = loaded + (unloaded - loaded) * np.exp(-force / value("screw.efficiency_force"))
    healthy = value("gear.efficiency_first") * value("gear.efficiency_second") * screw
    assert run["efficiency"] == pytest.approx(0.95 * healthy, rel=1e-6)
    expected = ram_lead() * force * (1.0 / (0.95 * healthy) - 1.0)
    assert lost(run, "efficiency", expected) == pytest.approx(0.0, abs=1e-3 * expected.mean())


@pytest.mark.signature("brake_slipping", "brake")
@BOTH
def test_a_slipping_brake_holds_what_it_has_left(fidelity: str) -> None:
    """3.5 g at rest: the brake is needed for r F - r (1/eta - 1) F - the breakaway friction."""
    values = {"load.factor": 3.5, "motor.detent_torque": 0.0}
    options: dict[str, Any] = {"start": "100 mm", "fidelity": fidelity, "values": values}
    final = gear(duration=0.05, **options).final
    aiding = (2.0 - 1.0 / final["efficiency"]) * final["load_force"]
    needed = ram_lead() * (aiding - value("friction.breakaway_ratio") * final["friction_force"])
    assert 0.05 < needed < 0.5
    for margin in (0.02, -0.02):
        severity = 1.0 - needed * (1.0 + margin) / value("brake.torque")
        rec = gear(duration=0.2, faults=[f"brake_slipping@brake={severity}"], **options)
        moved = rec.final["nut_position"] - 0.1
        assert bool(moved == 0.0) is (margin > 0.0)


@pytest.mark.signature("release_cable_failed", "release")
@BOTH
def test_a_failed_cable_leaves_the_leg_where_it_is(fidelity: str) -> None:
    """The stages stay together and the brake holds; without the fault the leg falls."""
    for faults, falls in (([], True), (["release_cable_failed@release=1"], False)):
        rec = gear((0.0, "free_fall"), duration=0.8, fidelity=fidelity, start="50 mm",
                   faults=faults)  # fmt: skip
        assert bool(rec.final["released"]) is falls
        assert bool(rec.final["nut_position"] > 0.051) is falls


@pytest.mark.signature("lock_spring_weak", "lock")
@BOTH
def test_a_weak_spring_pushes_with_its_share(fidelity: str) -> None:
    """F = (1 - s)(F_0 - k x), 1 mm behind the stroke."""
    rec = gear(
        duration=0.05, start="265 mm", fidelity=fidelity, faults=["lock_spring_weak@lock=0.3"]
    )
    beyond = rec.final["nut_position"] - value("lever.stroke")
    law = value("lock.spring_force") - value("lock.spring_rate") * beyond
    assert beyond == pytest.approx(1e-3, rel=0.01)
    assert rec.final["lock_force"] == pytest.approx(0.7 * law, rel=1e-9)


@pytest.mark.signature("lock_not_engaging", "lock")
@BOTH
def test_a_blocked_sleeve_stops_the_nut_before_the_lock(fidelity: str) -> None:
    """At lock.block_travel behind the stroke, where the healthy one goes on and engages."""
    for faults, locks in (([], True), (["lock_not_engaging@lock=1"], False)):
        rec = gear((0.0, "extend"), duration=1.4, start="258 mm", fidelity=fidelity, faults=faults)
        beyond = rec["nut_position"].values.max() - value("lever.stroke")
        assert bool(rec.final["locked"]) is locks
        assert bool(beyond > value("lock.engage_travel")) is locks
        assert locks or beyond == pytest.approx(value("lock.block_travel"), abs=2e-5)


@pytest.mark.signature("lock_not_releasing", "lock")
@BOTH
def test_stuck_segments_stop_the_nut_at_the_stroke(fidelity: str) -> None:
    """Engaged and stuck: retraction ends at s = 0; the healthy one leaves."""
    for faults, leaves in (([], True), (["lock_not_releasing@lock=1"], False)):
        rec = gear((0.0, "retract"), duration=1.2, start="267 mm", fidelity=fidelity, faults=faults)
        beyond = rec["nut_position"].values.min() - value("lever.stroke")
        assert bool(beyond < -1e-3) is leaves
        assert leaves or beyond == pytest.approx(0.0, abs=2e-5)
