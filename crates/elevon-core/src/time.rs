//! Time as a count of fixed steps.

pub type Steps = u64;

/// First step at or after time `t`; a time within a thousandth of a step of a step falls on it.
pub fn step_at(t: f64, dt: f64) -> Steps {
    if t <= 0.0 {
        return 0;
    }
    let steps = (t / dt - 1e-3).ceil();
    if steps < 9.0e18 {
        steps.max(0.0) as Steps
    } else {
        Steps::MAX
    }
}
