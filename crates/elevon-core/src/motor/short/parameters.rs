//! Parameters of the contacts that a winding can have: at the centre tap, with another phase, with the drive's ground.

use crate::variable::acts::When;
use crate::variables;

/// Some phases touch.
const PAIRED: When = When::Either(&[
    When::Away("motor.phase_short_ab", 0.0),
    When::Away("motor.phase_short_bc", 0.0),
    When::Away("motor.phase_short_ca", 0.0),
]);
/// Some phase touches ground.
const GROUNDED: When = When::Either(&[
    When::Away("motor.ground_short_a", 0.0),
    When::Away("motor.ground_short_b", 0.0),
    When::Away("motor.ground_short_c", 0.0),
]);
/// The contact is within the winding, which it parts in two.
const PARTED_BY_PAIR: When = When::Away("motor.phase_short_turns", 1.0);
const PARTED_BY_GROUND: When = When::Away("motor.ground_short_turns", 1.0);

variables! {
    /// Resistors between terminals and centre tap: the stand's means to seed a short (N 4.3).
    TapParameter, TAP {
        TapLevelA => "tap_level_a", "f_a", "1", Between(0.0, 0.9), Plant, Some(0.0), "healthy 0; level f of the resistor R = ref (1 - f)/f from terminal a to the centre",
            high_only("the resistor draws its own current from the link and leaves the winding's alone");
        TapLevelB => "tap_level_b", "f_b", "1", Between(0.0, 0.9), Plant, Some(0.0), "healthy 0; level f of the resistor R = ref (1 - f)/f from terminal b to the centre",
            high_only("the resistor draws its own current from the link and leaves the winding's alone");
        TapLevelC => "tap_level_c", "f_c", "1", Between(0.0, 0.9), Plant, Some(0.0), "healthy 0; level f of the resistor R = ref (1 - f)/f from terminal c to the centre",
            high_only("the resistor draws its own current from the link and leaves the winding's alone");
        TapReference => "tap_reference", "ref", "ohm", Positive, Plant, Some(25.0), "resistance that stands for a level of one half",
            high_only("the resistor draws its own current from the link and leaves the winding's alone").when(&[Either(&[
                Away("motor.tap_level_a", 0.0), Away("motor.tap_level_b", 0.0), Away("motor.tap_level_c", 0.0),
            ])]);
    }
}

variables! {
    /// Failed insulation between phases and to the drive's ground. 1000 S, a milliohm, is the stiffest contact.
    ShortParameter, SHORT {
        PhaseShortAb => "phase_short_ab", "G_ab", "S", Between(0.0, 1e3), Plant, Some(0.0), "healthy 0; conductance of a contact between the windings of phases a and b",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none");
        PhaseShortBc => "phase_short_bc", "G_bc", "S", Between(0.0, 1e3), Plant, Some(0.0), "healthy 0; conductance of a contact between the windings of phases b and c",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none");
        PhaseShortCa => "phase_short_ca", "G_ca", "S", Between(0.0, 1e3), Plant, Some(0.0), "healthy 0; conductance of a contact between the windings of phases c and a",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none");
        PhaseShortTurns => "phase_short_turns", "mu_p", "1", Unit, Plant, Some(1.0), "where the windings touch: fraction of the turns between neutral and contact; 1: at the terminals",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none").when(&[PAIRED]);
        GroundShortA => "ground_short_a", "G_ga", "S", Between(0.0, 1e3), Plant, Some(0.0), "healthy 0; conductance of a contact from the winding of phase a to ground",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none");
        GroundShortB => "ground_short_b", "G_gb", "S", Between(0.0, 1e3), Plant, Some(0.0), "healthy 0; conductance of a contact from the winding of phase b to ground",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none");
        GroundShortC => "ground_short_c", "G_gc", "S", Between(0.0, 1e3), Plant, Some(0.0), "healthy 0; conductance of a contact from the winding of phase c to ground",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none");
        GroundShortTurns => "ground_short_turns", "mu_g", "1", Unit, Plant, Some(1.0), "where the winding touches ground: fraction of the turns between neutral and contact; 1: at the terminal",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none").when(&[GROUNDED]);
        GroundPotential => "ground_potential", "-", "1", Unit, Plant, Some(0.0), "where ground stands in the DC link: 0 the lower rail (the drive's ground), 0.5 the middle, 1 the upper rail",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none").when(&[GROUNDED]);
        ContactCoupling => "contact_coupling", "kappa_c", "1", Unit, Plant, Some(0.9), "magnetic coupling of the two parts into which a contact with another phase or with ground divides a winding",
            high_only("the contact draws its own current from the link, phase by phase: its one phase has none").when(&[
                // (paired and parted by it) or (grounded and parted by it), as sums that must all hold
                Either(&[PAIRED, GROUNDED]), Either(&[PAIRED, PARTED_BY_GROUND]), Either(&[PARTED_BY_PAIR, GROUNDED]), Either(&[PARTED_BY_PAIR, PARTED_BY_GROUND]),
            ]);
    }
}
