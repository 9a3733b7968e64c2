//! A gear of several bodies, a backlash in each mesh (docs/explanation/theory/gear-train.md): stages in a row, or the
//! compound planetary gear of Wolfrom (T1 3.1.5 names the single backlash as the limit of its model).
//!
//! A mesh is a dead zone with stiffness and damping between bodies. Its displacement is linear in their angles, with one row
//! of numbers; by virtual work the same row gives the torque on each of them.

use crate::scalar::Scalar;
use crate::transmission::backlash::Backlash;
use crate::{choices, variables};

choices! {
    GearModel { Lumped "lumped", Stages "stages", Wolfrom "wolfrom" }
}

/// Most meshes between motor and output.
pub const MESHES: usize = 3;
/// Bodies between the motor's shaft and the output.
pub const BODIES: usize = 2;
/// The motor's shaft, the bodies, the output.
const ENDS: usize = BODIES + 2;
const OUTPUT: usize = ENDS - 1;

const STEPS: &str = "it lumps the gear's bodies on the motor's shaft and the backlash of its meshes at the output";

variables! {
    /// Bodies and meshes of the gear.
    GearTrainParameter, GEAR_TRAIN {
        Model => "model", "-", "1", Choice(GearModel::NAMES), Plant, Some(0.0), "one inertia on the motor's shaft and one backlash at the output; stages in a row, a body behind each and a backlash in each mesh; or the compound planetary gear of Wolfrom with a backlash between sun and planets, planets and fixed ring, planets and output ring. The reduced-order model lumps them: their inertias on the motor's shaft, their lost motion and their compliance at the output";
        Stages => "stages", "-", "1", Count(1.0, MESHES as f64), Plant, Some(2.0), "stages in a row, a mesh each; the ratio of the last follows from gear.ratio",
            when(&[Chosen("gear.model", &["stages"])]);
        Ratio1 => "ratio_1", "i_1", "1", Positive, Plant, Some(4.0), "ratio of the first of several stages",
            when(&[Chosen("gear.model", &["stages"]), Away("gear.stages", 1.0)]);
        Ratio2 => "ratio_2", "i_2", "1", Positive, Plant, Some(4.0), "ratio of the second of three stages",
            when(&[Chosen("gear.model", &["stages"]), Away("gear.stages", 1.0), Away("gear.stages", 2.0)]);
        SunTeeth => "sun_teeth", "z_A", "1", Count(5.0, 1000.0), Plant, Some(21.0), "teeth of the sun on the motor's shaft (T3 Table 3.5)",
            when(&[Chosen("gear.model", &["wolfrom"])]);
        PlanetTeeth => "planet_teeth", "z_S1", "1", Count(5.0, 1000.0), Plant, Some(21.0), "teeth of a planet in the mesh with sun and fixed ring (T3 Table 3.5)",
            when(&[Chosen("gear.model", &["wolfrom"])]);
        FixedRingTeeth => "fixed_ring_teeth", "z_C", "1", Count(5.0, 1000.0), Plant, Some(63.0), "teeth of the fixed ring (T3 Table 3.5)",
            when(&[Chosen("gear.model", &["wolfrom"])]);
        OutputPlanetTeeth => "output_planet_teeth", "z_S2", "1", Count(5.0, 1000.0), Plant, Some(20.0), "teeth of a planet in the mesh with the output ring (T3 Table 3.5)",
            when(&[Chosen("gear.model", &["wolfrom"])]);
        OutputRingTeeth => "output_ring_teeth", "z_B", "1", Count(5.0, 1000.0), Plant, Some(62.0), "teeth of the output ring (T3 Table 3.5)",
            when(&[Chosen("gear.model", &["wolfrom"])]);
        Inertia1 => "inertia_1", "J_1", "kg m2", Positive, Plant, Some(4.1e-4), "inertia of the body behind the first of several stages; of all planets about the gear's axis (wolfrom); not in gear.inertia. ASSUMED: three planets of 77 g on 42 mm",
            when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)])]);
        Inertia2 => "inertia_2", "J_2", "kg m2", Positive, Plant, Some(5.1e-5), "inertia of the body behind the second of three stages; of all planets about their own axes (wolfrom); not in gear.inertia. ASSUMED: three solid planets of 77 g and 21 mm",
            when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 2.0)])]);
        MeshBacklash1 => "mesh_backlash_1", "b_1", "rad", NonNegative, Plant, Some(9.4192e-3), "total backlash of the first mesh, as an angle of the wheel it drives (stages) or of the sun (wolfrom)",
            when(&[Chosen("gear.model", &["stages", "wolfrom"])]);
        MeshBacklash2 => "mesh_backlash_2", "b_2", "rad", NonNegative, Plant, Some(3.1397e-3), "total backlash of the second mesh, as an angle of the wheel it drives (stages) or of the fixed ring (wolfrom)",
            when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)])]);
        MeshBacklash3 => "mesh_backlash_3", "b_3", "rad", NonNegative, Plant, Some(3.1904e-3), "total backlash of the third mesh, at the output",
            when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 2.0)])]);
        MeshStiffness1 => "mesh_stiffness_1", "K_1", "N m/rad", Positive, Plant, Some(234.0), "stiffness of the first mesh, at the wheel of its backlash",
            when(&[Chosen("gear.model", &["stages", "wolfrom"])]);
        MeshStiffness2 => "mesh_stiffness_2", "K_2", "N m/rad", Positive, Plant, Some(2108.0), "stiffness of the second mesh, at the wheel of its backlash",
            when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)])]);
        MeshStiffness3 => "mesh_stiffness_3", "K_3", "N m/rad", Positive, Plant, Some(2041.0), "stiffness of the third mesh, at the output",
            when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 2.0)])]);
        MeshDamping1 => "mesh_damping_1", "C_1", "N m s/rad", NonNegative, Plant, Some(0.195), "damping of the first mesh while it carries",
            high_only(STEPS).when(&[Chosen("gear.model", &["stages", "wolfrom"])]);
        MeshDamping2 => "mesh_damping_2", "C_2", "N m s/rad", NonNegative, Plant, Some(1.755), "damping of the second mesh while it carries",
            high_only(STEPS).when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)])]);
        MeshDamping3 => "mesh_damping_3", "C_3", "N m s/rad", NonNegative, Plant, Some(1.7), "damping of the third mesh while it carries",
            high_only(STEPS).when(&[Chosen("gear.model", &["stages", "wolfrom"]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 1.0)]), Either(&[Chosen("gear.model", &["wolfrom"]), Away("gear.stages", 2.0)])]);
    }
}

/// Which bodies there are; equal over a lane block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GearLayout {
    Lumped,
    /// In a row, so many.
    Stages(u8),
    Wolfrom,
}

impl GearLayout {
    pub fn read(raw: &[f64]) -> Self {
        match GearModel::read(raw[GearTrainParameter::Model as usize]) {
            GearModel::Lumped => Self::Lumped,
            GearModel::Stages => Self::Stages(raw[GearTrainParameter::Stages as usize] as u8),
            GearModel::Wolfrom => Self::Wolfrom,
        }
    }

    /// Are there bodies between motor and output?
    pub fn bodies(self) -> bool {
        self != Self::Lumped
    }
}

/// How the bodies hang together.
#[derive(Clone, Copy, Debug)]
struct Kinematics<S> {
    /// Displacement of each mesh over the angles of motor, bodies and output.
    rows: [[S; ENDS]; MESHES],
    /// Turns of each body per turn of the motor, without backlash.
    turns: [S; BODIES],
    /// Displacement of the output per displacement of each mesh, the motor at rest, without its sign.
    output: [S; MESHES],
    /// The mesh at the output.
    last: usize,
}

impl<S: Scalar> Kinematics<S> {
    /// Nothing between motor and output.
    fn none() -> Self {
        let zero = S::zero();
        Self { rows: [[zero; ENDS]; MESHES], turns: [zero; BODIES], output: [zero; MESHES], last: 0 }
    }

    /// `stages` in a row of the whole `ratio`: each mesh lies between the body before it and the one behind it.
    fn stages(ratio: S, raw: &[S], stages: usize) -> Self {
        use GearTrainParameter as P;
        let mut all = Self::none();
        let (mut left, mut turns) = (ratio, S::one());
        let mut per_ratio = [S::one(); MESHES];
        for k in 0..stages {
            let own = if k + 1 == stages { left } else { raw[P::Ratio1 as usize + k] };
            per_ratio[k] = S::one() / own;
            left = left * per_ratio[k];
            let behind = if k + 1 == stages { OUTPUT } else { k + 1 };
            all.rows[k][k] = per_ratio[k];
            all.rows[k][behind] = -S::one();
            turns = turns * per_ratio[k];
            if behind != OUTPUT {
                all.turns[k] = turns;
            }
        }
        all.last = stages - 1;
        for k in 0..stages {
            all.output[k] = per_ratio[k + 1..stages].iter().fold(S::one(), |product, x| product * *x);
        }
        all
    }

    /// Sun, planets (about the gear's axis, about their own) and output ring; displacements as angles of sun, fixed ring and
    /// output ring.
    fn wolfrom(raw: &[S]) -> Self {
        use GearTrainParameter as P;
        let z = |p: P| raw[p as usize];
        let (zero, one) = (S::zero(), S::one());
        let sun = z(P::PlanetTeeth) / z(P::SunTeeth);
        let fixed = z(P::PlanetTeeth) / z(P::FixedRingTeeth);
        let output = z(P::OutputPlanetTeeth) / z(P::OutputRingTeeth);
        let (rings, basic) = (sun / fixed, output / fixed);
        let orbit = one / (one + rings);
        Self {
            rows: [[one, -(one + sun), sun, zero], [zero, one - fixed, fixed, zero], [zero, one - output, output, -one]],
            turns: [orbit, orbit * (one - one / fixed)],
            output: [((one - basic) * orbit).abs(), (basic + (one - basic) * rings * orbit).abs(), one],
            last: MESHES - 1,
        }
    }
}

/// Bodies and meshes between motor and output.
#[derive(Clone, Copy, Debug)]
pub struct GearTrain<S> {
    rows: [[S; ENDS]; MESHES],
    flanks: [Backlash<S>; MESHES],
    /// 1 for the mesh at the output, whose teeth wear.
    worn: [S; MESHES],
    pub turns: [S; BODIES],
    pub inertia: [S; BODIES],
    per_inertia: [S; BODIES],
    /// Lost motion of all meshes at the output, and their compliance there.
    pub lost_motion: S,
    pub compliance: S,
    /// Inertia of the bodies on the motor's shaft, without backlash.
    pub reflected: S,
}

impl<S: Scalar> GearTrain<S> {
    pub fn none() -> Self {
        let zero = S::zero();
        Self {
            rows: [[zero; ENDS]; MESHES],
            flanks: [Backlash::of(zero, zero, zero); MESHES],
            worn: [zero; MESHES],
            turns: [zero; BODIES],
            inertia: [zero; BODIES],
            per_inertia: [zero; BODIES],
            lost_motion: zero,
            compliance: zero,
            reflected: zero,
        }
    }

    /// `extra` is what wear adds to the backlash at the output.
    pub fn derive(raw: &[S], layout: GearLayout, ratio: S, extra: S) -> Self {
        use GearTrainParameter as P;
        let kinematics = match layout {
            GearLayout::Lumped => return Self::none(),
            GearLayout::Stages(stages) => Kinematics::stages(ratio, raw, stages as usize),
            GearLayout::Wolfrom => Kinematics::wolfrom(raw),
        };
        let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
        let mut all = Self { rows: kinematics.rows, turns: kinematics.turns, ..Self::none() };
        for j in 0..=kinematics.last {
            let at = |p: P| raw[p as usize + j];
            let last = j == kinematics.last;
            let total = at(P::MeshBacklash1) + if last { extra } else { zero };
            all.flanks[j] = Backlash::of(half * total, at(P::MeshStiffness1), at(P::MeshDamping1));
            all.worn[j] = if last { one } else { zero };
            all.lost_motion = all.lost_motion + kinematics.output[j] * total;
            // By virtual work a torque at the output is that share of it in each mesh.
            all.compliance = all.compliance + kinematics.output[j] * kinematics.output[j] / all.flanks[j].stiffness;
        }
        for k in 0..kinematics.last.min(BODIES) {
            all.inertia[k] = raw[P::Inertia1 as usize + k];
            all.per_inertia[k] = one / all.inertia[k];
            all.reflected = all.reflected + all.inertia[k] * all.turns[k] * all.turns[k];
        }
        all
    }

    /// Torque of each mesh at the wheel of its backlash, positive drives the output forwards; `at` and `speed` of motor,
    /// bodies and output, `lag` is what worn teeth add at the output.
    #[inline(always)]
    pub fn torques(&self, at: [S; ENDS], speed: [S; ENDS], lag: S) -> [S; MESHES] {
        std::array::from_fn(|j| {
            let row = &self.rows[j];
            self.flanks[j].contact(along(row, &at), along(row, &speed), self.worn[j] * lag)
        })
    }

    /// Torque that the meshes take from the motor's shaft, and that they give to the output.
    #[inline(always)]
    pub fn ends(&self, torques: &[S; MESHES]) -> [S; 2] {
        [-self.on(0, torques), self.on(OUTPUT, torques)]
    }

    /// Torque of the meshes on one of motor, bodies and output.
    #[inline(always)]
    fn on(&self, body: usize, torques: &[S; MESHES]) -> S {
        -(self.rows[0][body] * torques[0] + self.rows[1][body] * torques[1] + self.rows[2][body] * torques[2])
    }

    /// Torque of the meshes on each body, and its acceleration.
    #[inline(always)]
    pub fn accelerations(&self, torques: &[S; MESHES]) -> [[S; 2]; BODIES] {
        std::array::from_fn(|k| {
            let torque = self.on(k + 1, torques);
            [torque, torque * self.per_inertia[k]]
        })
    }
}

#[inline(always)]
fn along<S: Scalar>(row: &[S; ENDS], x: &[S; ENDS]) -> S {
    row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * x[3]
}

impl GearTrain<f64> {
    /// Square of the fastest natural frequency while all meshes carry, rate of the fastest damping, smallest damping over
    /// stiffness; `motor` and `output` are the inertias of the ends.
    pub fn fastest(&self, motor: f64, output: f64) -> [f64; 3] {
        let per_inertia = [1.0 / motor, self.per_inertia[0], self.per_inertia[1], 1.0 / output];
        let [stiffness, damping] = [self.flanks.map(|f| f.stiffness), self.flanks.map(|f| f.damping)];
        let carrying = (0..MESHES).filter(|&j| stiffness[j] > 0.0);
        let ratio = carrying.map(|j| damping[j] / stiffness[j]).fold(f64::INFINITY, f64::min);
        [self.largest(stiffness, per_inertia), self.largest(damping, per_inertia), ratio]
    }

    /// Largest root of `weight A M^-1 A^T`, by iteration.
    fn largest(&self, weight: [f64; MESHES], per_inertia: [f64; ENDS]) -> f64 {
        let cell = |i: usize, j: usize| -> f64 {
            let sum: f64 = (0..ENDS).map(|k| self.rows[i][k] * per_inertia[k] * self.rows[j][k]).sum();
            (weight[i] * weight[j]).sqrt() * sum
        };
        let (mut x, mut size) = ([1.0, -0.7, 0.4], 0.0);
        for _ in 0..200 {
            let y: [f64; MESHES] = std::array::from_fn(|i| (0..MESHES).map(|j| cell(i, j) * x[j]).sum());
            size = y.iter().map(|v| v * v).sum::<f64>().sqrt();
            if size == 0.0 {
                return 0.0;
            }
            x = y.map(|v| v / size);
        }
        size
    }
}

/// Ratio of the compound planetary gear by Willis (T3 3.1.5).
pub fn wolfrom_ratio(raw: &[f64]) -> f64 {
    use GearTrainParameter as P;
    let z = |p: P| raw[p as usize];
    (1.0 + z(P::FixedRingTeeth) / z(P::SunTeeth))
        / (1.0 - z(P::FixedRingTeeth) * z(P::OutputPlanetTeeth) / (z(P::PlanetTeeth) * z(P::OutputRingTeeth)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use GearTrainParameter as P;

    fn raw(changes: &[(P, f64)]) -> Vec<f64> {
        let mut raw: Vec<f64> = GEAR_TRAIN.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        for &(p, x) in changes {
            raw[p as usize] = x;
        }
        raw
    }

    #[test]
    fn every_default_is_in_its_range() {
        for v in GEAR_TRAIN {
            assert!(v.default.is_some_and(|x| v.range.contains(x)), "{}", v.path);
        }
    }

    #[test]
    fn the_teeth_of_the_bench_give_its_ratio() {
        assert!((wolfrom_ratio(&raw(&[])) - 124.0).abs() < 1e-9);
    }

    /// Whatever the layout: turning everything as the motor does leaves every mesh as it is.
    #[test]
    fn no_mesh_moves_where_all_turn_together() {
        for layout in [GearLayout::Stages(1), GearLayout::Stages(2), GearLayout::Stages(3), GearLayout::Wolfrom] {
            let train = GearTrain::<f64>::derive(&raw(&[]), layout, 124.0, 0.0);
            let at = [1.0, train.turns[0], train.turns[1], 1.0 / 124.0];
            for row in &train.rows {
                assert!(along(row, &at).abs() < 1e-14, "{layout:?} {row:?}");
            }
        }
    }

    /// b_1 / (i_2 i_3) + b_2 / i_3 + b_3.
    #[test]
    fn lost_motion_of_stages_passes_the_following_ratios() {
        let (b, i) = ([0.01, 0.02, 0.03], [4.0, 5.0, 6.2]);
        let raw =
            raw(&[(P::Ratio1, i[0]), (P::Ratio2, i[1]), (P::MeshBacklash1, b[0]), (P::MeshBacklash2, b[1]), (P::MeshBacklash3, b[2])]);
        let train = GearTrain::<f64>::derive(&raw, GearLayout::Stages(3), 124.0, 0.005);
        let expected = b[0] / (i[1] * i[2]) + b[1] / i[2] + b[2] + 0.005;
        assert!((train.lost_motion - expected).abs() < 1e-15, "{} against {expected}", train.lost_motion);
    }

    /// The planets between sun, fixed ring and output ring, solved by hand for each mesh alone: the sun's backlash passes the
    /// whole ratio, that of the fixed ring reaches the output nearly whole.
    #[test]
    fn lost_motion_of_the_planets_is_that_of_their_geometry() {
        let train = GearTrain::<f64>::derive(&raw(&[]), GearLayout::Wolfrom, 124.0, 0.0);
        for j in 0..MESHES {
            let (solved, stated) = (by_hand(&train.rows, j), Kinematics::<f64>::wolfrom(&raw(&[])).output[j]);
            assert!((solved.abs() - stated).abs() < 1e-12, "{solved} against {stated}");
        }
        assert!((by_hand(&train.rows, 0).abs() * 124.0 - 1.0).abs() < 1e-12);
    }

    /// Angle of the output at a unit displacement of one mesh, the motor at rest: Cramer's rule.
    fn by_hand(rows: &[[f64; ENDS]; MESHES], one: usize) -> f64 {
        let cell = |i: usize, k: usize, last: [f64; 3]| if k == 2 { last[i] } else { rows[i][k + 1] };
        let det = |last: [f64; 3]| {
            let m = |i: usize, k: usize| cell(i, k, last);
            m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) - m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0))
                + m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0))
        };
        let unit = std::array::from_fn(|i| if i == one { 1.0 } else { 0.0 });
        det(unit) / det(std::array::from_fn(|i| rows[i][OUTPUT]))
    }

    /// Virtual work: what the meshes take of all bodies is their torque times the rate of their displacement.
    #[test]
    fn meshes_exchange_the_work_of_their_displacement() {
        let train = GearTrain::<f64>::derive(&raw(&[]), GearLayout::Wolfrom, 124.0, 0.0);
        let speed = [3.0, -0.2, 0.7, 0.05];
        let torques = train.torques([0.4, 0.01, -0.05, 0.02], speed, 0.0);
        assert!(torques.iter().any(|t| *t != 0.0), "{torques:?}");
        let [taken, given] = train.ends(&torques);
        let bodies = train.accelerations(&torques).map(|x| x[0]);
        let power = -taken * speed[0] + bodies[0] * speed[1] + bodies[1] * speed[2] + given * speed[3];
        let wound: f64 = (0..MESHES).map(|j| torques[j] * along(&train.rows[j], &speed)).sum();
        assert!((power + wound).abs() < 1e-12 * wound.abs().max(1.0), "{power} {wound}");
    }

    /// One mesh between two inertias: K (1/J + 1/J_u) and C (1/J + 1/J_u), with the motor's inertia at the output.
    #[test]
    fn the_fastest_pole_of_one_mesh_is_that_of_two_masses() {
        let raw = raw(&[(P::MeshStiffness1, 1000.0), (P::MeshDamping1, 0.5)]);
        let train = GearTrain::<f64>::derive(&raw, GearLayout::Stages(1), 100.0, 0.0);
        let per_mass = 1.0 / (1e-3 * 1e4) + 1.0 / 2e-3;
        let [square, damping, ratio] = train.fastest(1e-3, 2e-3);
        assert!((square / (1000.0 * per_mass) - 1.0).abs() < 1e-12, "{square}");
        assert!((damping / (0.5 * per_mass) - 1.0).abs() < 1e-12, "{damping}");
        assert!((ratio - 5e-4).abs() < 1e-15);
    }
}
