"""Every fault of the rotary actuator's catalogue has a test of its signature."""

import ast
from pathlib import Path

from elevon import _core

PHYSICS = Path(__file__).resolve().parents[1] / "physics"

# Kind and kind of place -> the test of what it does to the physics.
SIGNATURES = {
    ("short", "motor"): "test_short_ripples_at_twice_the_electrical_frequency",
    ("eccentricity_static", "motor"): (
        "test_static_eccentricity_shows_at_the_electrical_frequency"
    ),
    ("eccentricity_dynamic", "motor"): "test_dynamic_eccentricity_turns_with_the_shaft",
    ("open_phase", "motor"): "test_open_phase_leaves_one_loop_of_two_phases",
    ("open_switch", "inverter"): "test_open_switch_takes_one_half_wave_of_its_phase",
    ("shorted_switch", "inverter"): ("test_shorted_switch_trips_the_drive_and_the_status_says_so"),
    ("demagnetisation", "motor"): "test_demagnetisation_needs_more_current_for_the_same_torque",
    ("sag", "supply"): "test_supply_sag_lowers_the_speed_that_can_be_reached",
    ("connector_open", "supply"): (
        "test_at_constant_power_the_square_of_the_voltage_falls_straight"
    ),
    ("gain", "current"): "test_current_sensor_gain_changes_what_the_drive_delivers",
    ("offset", "current"): "test_current_sensor_offset_ripples_at_the_electrical_frequency",
    ("friction", "transmission"): "test_friction_raises_the_moving_current_by_the_torque_balance",
    ("lubrication", "transmission"): (
        "test_lubrication_raises_the_moving_current_in_proportion_to_speed"
    ),
    ("play", "transmission"): "test_play_widens_the_lost_motion_by_its_severity",
    ("jam", "transmission"): "test_jam_stops_the_output_at_its_place",
    ("gain_drift", "control"): "test_gain_drift_scales_the_loop_it_names",
    ("dropout", "resolver"): "test_lost_resolver_makes_the_position_jump_and_recover",
    ("mismatch", "resolver"): "test_mismatched_resolver_errs_at_twice_the_shaft_frequency",
    ("offset", "resolver"): (
        "test_resolver_offset_costs_torque_by_the_cosine_of_the_electrical_error"
    ),
    ("offset", "encoder"): "test_encoder_error_moves_the_output_the_other_way",
    ("gain", "encoder"): "test_encoder_error_moves_the_output_the_other_way",
    ("gain", "resolver"): "test_resolver_gain_shows_a_speed_off_by_it",
    ("unbalance", "motor"): "test_unbalance_swings_the_speed_once_a_turn",
    ("resistor_short", "motor"): "test_resistor_draws_the_phase_voltage_over_its_resistance",
    ("phase_short", "motor"): "test_phase_short_draws_the_voltage_between_the_windings",
    ("ground_short", "motor"): "test_ground_short_returns_by_the_link",
    ("local_demagnetisation", "motor"): (
        "test_local_demagnetisation_puts_sidebands_beside_the_emf"
    ),
    ("winding_short", "resolver"): (
        "test_shorted_resolver_winding_shows_the_angle_of_its_channels"
    ),
    ("winding_open", "resolver"): "test_open_resolver_winding_leaves_multiples_of_half_a_turn",
    ("dark_sectors", "encoder"): "test_dark_sector_takes_its_share_of_the_disc",
    ("stuck", "encoder"): "test_encoder_that_stood_still_comes_back",
    ("dead", "encoder"): "test_encoder_that_stood_still_comes_back",
    ("stuck", "resolver"): "test_stuck_resolver_holds_angle_and_speed",
    ("stuck", "current"): "test_current_sensor_that_stands_still_frees_its_leg",
    ("dead", "current"): "test_current_sensor_that_stands_still_frees_its_leg",
    ("missing_counts", "encoder"): "test_missing_counts_make_the_encoder_read_short",
    ("stator_rub", "motor"): "test_stator_rub_brakes_once_a_turn",
    ("bearing", "bearing"): "test_bearing_defect_shows_at_its_shaft_order",
    ("tooth_wear", "gear"): "test_tooth_wear_opens_the_play_over_each_mesh",
    ("chipped_tooth", "gear"): "test_chipped_tooth_opens_the_play_once_a_turn",
}


def _room(place: str) -> str:
    """`sensor.current_a` -> current, `inverter.a_high` -> inverter."""
    parts = place.split(".")
    return parts[1].split("_")[0] if parts[0] == "sensor" else parts[0]


def test_every_fault_has_a_signature_test() -> None:
    asked = {
        (record["kind"], _room(place))
        for record in _core.faults("rotary")
        for place in record["places"]
    }
    assert asked == set(SIGNATURES)


def test_the_signature_tests_exist() -> None:
    written = {
        node.name
        for path in PHYSICS.glob("test_*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
    }
    assert set(SIGNATURES.values()) <= written
