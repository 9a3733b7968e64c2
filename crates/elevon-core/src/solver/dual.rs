//! Runs with exact derivatives: dual numbers whose slopes are lanes, so that one pass carries several derivatives.

use super::batch::{recorded, Monitor};
use super::block::Block;
use super::kernels::Lift;
use super::spec::{Clock, RunOutput, RunSpec};
use crate::actuator::Wiring;
use crate::fault::FaultLanes;
#[cfg(all(target_arch = "x86_64", not(feature = "physics")))]
use crate::scalar::{fused, Avx2x4};
use crate::scalar::{Dual, Scalar};

/// Slopes on a processor without the vectors below.
#[cfg(not(any(feature = "physics", feature = "widest")))]
type Slopes = crate::scalar::Portable;
#[cfg(any(feature = "physics", feature = "widest"))]
type Slopes = f64;

/// Seeds of a dual run: parameters and faults whose derivatives are wanted.
struct Seeds {
    parameters: Vec<usize>,
    faults: Vec<usize>,
}

impl<V: Scalar> Lift<Dual<V>> for Seeds {
    const SLOPES: bool = true;
    fn parameter(&self, runs: &[&RunSpec], first: usize, index: usize) -> Dual<V> {
        let value = runs[first].parameters[index];
        match self.parameters.iter().position(|&p| p == index) {
            Some(slot) => Dual::variable(value, slot),
            None => Dual::splat(value),
        }
    }
    fn severity(&self, faults: &FaultLanes, lane: usize, fault: usize) -> Dual<V> {
        let value = faults.severity(lane, fault);
        match self.faults.iter().position(|&f| f == fault) {
            Some(slot) => Dual::variable(value, self.parameters.len() + slot),
            None => Dual::splat(value),
        }
    }
    fn emit(&self, x: Dual<V>, _lane: usize, out: &mut Vec<f64>) {
        out.push(x.value);
        out.extend((0..self.parameters.len() + self.faults.len()).map(|slot| x.slope.lane(slot)));
    }
    fn width(&self) -> usize {
        1 + self.parameters.len() + self.faults.len()
    }
}

/// Derivatives that one pass carries on this processor.
pub fn derivatives() -> usize {
    #[cfg(all(target_arch = "x86_64", not(feature = "physics")))]
    if fused() {
        return Avx2x4::LANES;
    }
    Slopes::LANES
}

/// One run with exact derivatives, in passes of `derivatives()`: each value is followed by its derivatives with respect to
/// the chosen parameters, then to the severities of the chosen faults.
pub fn sensitivities<W: Wiring>(
    run: &RunSpec,
    parameters: &[usize],
    faults: &[usize],
    clocks: &[Clock],
    monitor: &Monitor,
) -> Vec<RunOutput> {
    #[cfg(all(target_arch = "x86_64", not(feature = "physics")))]
    if fused() {
        return passes::<W, Avx2x4>(run, parameters, faults, clocks, monitor);
    }
    passes::<W, Slopes>(run, parameters, faults, clocks, monitor)
}

/// The run with everything in its structure whose derivative is wanted: what is neutral may have one, and all passes share
/// their equations.
fn differentiated(run: &RunSpec, parameters: &[usize], faults: &[usize]) -> RunSpec {
    let mut all = run.clone();
    all.tunable.extend_from_slice(parameters);
    let writes = faults.iter().filter_map(|&fault| run.faults.get(fault)).flat_map(|fault| &fault.writes);
    all.tunable.extend(writes.map(|write| write.index));
    all
}

fn passes<W: Wiring, V: Scalar>(
    run: &RunSpec,
    parameters: &[usize],
    faults: &[usize],
    clocks: &[Clock],
    monitor: &Monitor,
) -> Vec<RunOutput> {
    let recorded = recorded(clocks);
    let run = &differentiated(run, parameters, faults);
    let mut chosen: Vec<(bool, usize)> = parameters.iter().map(|&p| (true, p)).collect();
    chosen.extend(faults.iter().map(|&f| (false, f)));
    let pass = |pass: &[(bool, usize)]| {
        let of = |kind: bool| pass.iter().filter(|x| x.0 == kind).map(|x| x.1).collect();
        let seeds = Seeds { parameters: of(true), faults: of(false) };
        Block::<W, Dual<V>, Seeds>::new(&[run], 1, seeds, clocks, &recorded).run(monitor).remove(0)
    };
    chosen.chunks(V::LANES).map(pass).collect()
}
