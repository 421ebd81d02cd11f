//! Bearings of a flexible rotor with gyroscopic terms are identified from probes that are not at
//! the bearings.

use std::f64::consts::{PI, TAU};

use mechid_estimate::likelihood::machine::{MachineEstimate, identify_machine};
use mechid_estimate::likelihood::{LikelihoodError, LikelihoodEstimate, Settings};
use mechid_model::ResponseQuantity;
use mechid_model::elements::{
    Coefficient, Element, FreeCoefficient, Input, Instruments, Machine, MatrixElement, Sensor,
    Speed,
};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix, DVector};

use super::generator::{measured, random_phases};
use super::judge::judge;

/// Stiffness (N/m) and damping (N·s/m) of the two bearings, xx, xy, yx, yy.
pub const BEARINGS: [[[f64; 4]; 2]; 2] = [
    [[1.0e7, 2.0e6, -1.5e6, 1.3e7], [2.0e3, 2.0e2, 1.5e2, 3.0e3]],
    [[1.5e7, -1.0e6, 3.0e6, 0.9e7], [1.5e3, 1.0e2, 3.0e2, 2.0e3]],
];

/// Steel shaft with a length of 1.3 m, a diameter of 50 mm and three discs. Each node of its beam
/// elements has x, ∂x/∂z, y and ∂y/∂z.
pub struct Rotor {
    pub nodes: usize,
    pub mass: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
    pub gyroscopic: DMatrix<f64>,
}

impl Rotor {
    /// Creates a rotor whose Young's modulus is that of steel times `modulus_factor`.
    pub fn new(nodes: usize, modulus_factor: f64) -> Self {
        let n = 4 * nodes;
        let zero = || DMatrix::<f64>::zeros(n, n);
        let (mut mass, mut stiffness, mut gyroscopic) = (zero(), zero(), zero());
        let (e, rho, d) = (2.1e11 * modulus_factor, 7850.0, 0.05);
        let l = 1.3 / (nodes - 1) as f64;
        let (area, inertia) = (PI * d * d / 4.0, PI * d.powi(4) / 64.0);
        let k = nalgebra::dmatrix![
            12.0, 6.0 * l, -12.0, 6.0 * l;
            6.0 * l, 4.0 * l * l, -6.0 * l, 2.0 * l * l;
            -12.0, -6.0 * l, 12.0, -6.0 * l;
            6.0 * l, 2.0 * l * l, -6.0 * l, 4.0 * l * l
        ] * (e * inertia / l.powi(3));
        let m = nalgebra::dmatrix![
            156.0, 22.0 * l, 54.0, -13.0 * l;
            22.0 * l, 4.0 * l * l, 13.0 * l, -3.0 * l * l;
            54.0, 13.0 * l, 156.0, -22.0 * l;
            -13.0 * l, -3.0 * l * l, -22.0 * l, 4.0 * l * l
        ] * (rho * area * l / 420.0);
        for element in 0..nodes - 1 {
            for plane in 0..2 {
                let dof = |at: usize| 4 * (element + at / 2) + 2 * plane + at % 2;
                for i in 0..4 {
                    for j in 0..4 {
                        mass[(dof(i), dof(j))] += m[(i, j)];
                        stiffness[(dof(i), dof(j))] += k[(i, j)];
                    }
                }
            }
        }
        for (node, weight, polar) in
            [(nodes / 4, 12.0, 0.05), (nodes / 2, 20.0, 0.1), (3 * nodes / 4, 9.0, 0.03)]
        {
            for plane in 0..2 {
                mass[(4 * node + 2 * plane, 4 * node + 2 * plane)] += weight;
                mass[(4 * node + 2 * plane + 1, 4 * node + 2 * plane + 1)] += 0.5 * polar;
            }
            gyroscopic[(4 * node + 1, 4 * node + 3)] += polar;
            gyroscopic[(4 * node + 3, 4 * node + 1)] -= polar;
        }
        Self { nodes, mass, stiffness, gyroscopic }
    }

    pub fn bearing_nodes(&self) -> [usize; 2] {
        [1, self.nodes - 2]
    }

    pub fn dofs(&self) -> Vec<String> {
        let names = |node: usize| ["x", "a", "y", "b"].map(|letter| format!("{letter}{node}"));
        (0..self.nodes).flat_map(names).collect()
    }

    /// Returns the response of all degrees of freedom to a load at the angular frequency `omega`
    /// and the rotor speed `speed` (rad/s).
    fn response(
        &self,
        omega: f64,
        speed: f64,
        load: &DVector<Complex<f64>>,
    ) -> DVector<Complex<f64>> {
        let mut dynamic = self.stiffness.zip_zip_map(&self.mass, &self.gyroscopic, |k, m, g| {
            // The damping matrix of the shaft is 2 µs times its stiffness matrix.
            Complex::new(k - omega * omega * m, omega * (speed * g + 2e-6 * k))
        });
        for (node, [stiffness, damping]) in self.bearing_nodes().into_iter().zip(BEARINGS) {
            for (at, (k, c)) in stiffness.into_iter().zip(damping).enumerate() {
                let (row, column) = (4 * node + 2 * (at / 2), 4 * node + 2 * (at % 2));
                dynamic[(row, column)] += Complex::new(k, omega * c);
            }
        }
        dynamic.lu().solve(load).unwrap()
    }

    /// Returns the machine; all bearings have the same initial values of stiffness and damping.
    pub fn machine(&self) -> Machine {
        let shaft = MatrixElement::new(
            self.dofs(),
            self.mass.clone(),
            &self.stiffness * 2e-6,
            self.stiffness.clone(),
        );
        let shaft = shaft.with_gyroscopic(self.gyroscopic.clone());
        let mut machine =
            Machine::new(self.dofs()).with("shaft", Element::Matrices(Box::new(shaft)));
        for (name, node) in ["A", "B"].into_iter().zip(self.bearing_nodes()) {
            let start = |direct: f64, cross: f64| {
                [direct, cross, cross, direct]
                    .map(|value| Coefficient::Free(FreeCoefficient::from_start(value)))
            };
            let at = [format!("x{node}"), format!("y{node}")];
            let at = [at[0].as_str(), at[1].as_str()];
            machine =
                machine.with(name, Element::bearing(at, start(1.1e7, 1e5), start(2.5e3, 50.0)));
        }
        machine
    }

    fn probes(&self) -> [usize; 4] {
        let (one, other) = (self.nodes / 4 + 1, self.nodes - 4);
        [4 * one, 4 * one + 2, 4 * other, 4 * other + 2]
    }

    pub fn instruments(&self, inputs: Vec<Input>, speed: Speed) -> Instruments {
        let dofs = self.dofs();
        let sensor = |at: usize| Sensor::new(&dofs[at], ResponseQuantity::Displacement);
        Instruments { sensors: self.probes().map(sensor).to_vec(), inputs, speed }
    }

    pub fn shaker(&self) -> (Input, usize) {
        let node = self.nodes / 2 - 1;
        (Input::force(&format!("x{node}")), 4 * node)
    }
}

/// Returns data of one shaker at a constant speed of the rotor, with four probes that have 0.5 %
/// noise.
pub fn shaken(rotor: &Rotor, lines: usize, seed: u64) -> LineData {
    let omega: Vec<f64> =
        (0..lines).map(|line| TAU * (10.0 + 240.0 * line as f64 / lines as f64)).collect();
    // The seed differs from that of the noise, which must not be coherent with the force.
    let force = random_phases(lines, 1, 5000 + seed) * Complex::from(10.0);
    let outputs = response_rows(rotor, &omega, |row| {
        let mut load = DVector::zeros(4 * rotor.nodes);
        load[rotor.shaker().1] = force[(row, 0)];
        (300.0, load)
    });
    measured(&omega, force, outputs, 0.005, seed)
}

fn response_rows(
    rotor: &Rotor,
    omega: &[f64],
    load: impl Fn(usize) -> (f64, DVector<Complex<f64>>),
) -> DMatrix<Complex<f64>> {
    let mut outputs = DMatrix::zeros(omega.len(), 4);
    for (row, w) in omega.iter().enumerate() {
        let (speed, load) = load(row);
        let all = rotor.response(*w, speed, &load);
        for (at, dof) in rotor.probes().into_iter().enumerate() {
            outputs[(row, at)] = all[dof];
        }
    }
    outputs
}

pub fn truth() -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (name, coefficients) in ["A", "B"].into_iter().zip(BEARINGS) {
        for (letter, values) in ["k", "c"].into_iter().zip(coefficients) {
            for (place, value) in ["xx", "xy", "yx", "yy"].into_iter().zip(values) {
                all.push((format!("{name}.{letter}{place}"), value));
            }
        }
    }
    all
}

pub fn fit(data: &LineData, rotor: &Rotor) -> Result<MachineEstimate, LikelihoodError> {
    let instruments = rotor.instruments(vec![rotor.shaker().0], Speed::Constant(300.0));
    identify_machine(data, &rotor.machine(), &instruments, &Settings::default())
}

#[test]
fn sixteen_coefficients_from_four_probes() {
    let rotor = Rotor::new(13, 1.0);
    let judged =
        judge(&truth(), 6, |seed| Some(fit(&shaken(&rotor, 120, seed), &rotor).ok()?.likelihood));
    // The errors of the coefficients in one experiment are correlated, so 96 intervals have less
    // information than 96 independent intervals.
    assert!(judged.failed == 0 && judged.coverage >= 0.85, "{judged:?}");
    assert!((0.75..1.25).contains(&judged.scatter), "{judged:?}");
}

#[test]
fn a_rotor_that_is_too_soft_by_a_percent_shows_in_the_misfit() {
    let data = shaken(&Rotor::new(13, 1.0), 120, 1);
    let estimate = fit(&data, &Rotor::new(13, 0.99)).unwrap().likelihood;
    let ratio = estimate.misfit_ratio.unwrap();
    assert!(estimate.misfit_p_value.unwrap() < 1e-6 && ratio > 1.5, "{ratio}");
    assert_eq!(estimate.error_scale, ratio.sqrt());
}

/// The data show which coefficient of the model is wrong, and intervals that include the effect of
/// this error contain the truth.
#[test]
fn a_wrong_modulus_is_found_and_allowed_for() {
    let soft = Rotor::new(13, 0.99);
    let instruments = soft.instruments(vec![soft.shaker().0], Speed::Constant(300.0));
    let judged = judge(&truth(), 3, |seed| {
        let data = shaken(&Rotor::new(13, 1.0), 60, seed);
        let estimate = fit(&data, &soft).ok()?;
        let (machine, settings) = (soft.machine(), Settings::default());
        let freed = estimate.freed_coefficient(&data, (&machine, &instruments), None, &settings)?;
        assert_eq!(freed.name, "shaft.stiffness");
        assert!((freed.value - 1.0 / 0.99).abs() < 4.0 * freed.standard_error);
        assert!(freed.p_value < 1e-6 && freed.misfit_p_value.unwrap() > 1e-3, "{freed:?}");
        Some(estimate.with_parameter_errors(&freed.changes).likelihood)
    });
    assert!(judged.failed == 0 && judged.coverage >= 0.85, "{judged:?}");
}

/// Residual unbalance in kg·m, in addition to the trial weights.
const RESIDUAL: Complex<f64> = Complex::new(-1e-4, 2e-4);

/// Identifies the bearings and the residual unbalance from three runs at eight speeds each: two
/// runs with a trial weight, which is at a different node in each run, and one run without a
/// weight.
pub fn fit_unbalance(rotor: &Rotor, seed: u64) -> Option<LikelihoodEstimate> {
    let omega: Vec<f64> = (0..8).map(|at| 100.0 + 60.0 * f64::from(at)).collect();
    let trial = Complex::new(4e-4, 0.0);
    let node = rotor.nodes / 2;
    let runs: [(usize, Complex<f64>); 3] =
        [(node, trial), (rotor.nodes / 4, trial), (node, Complex::default())];
    let mut data: Option<LineData> = None;
    for (run, (place, weight)) in runs.into_iter().enumerate() {
        let outputs = response_rows(rotor, &omega, |row| {
            let mut load = DVector::zeros(4 * rotor.nodes);
            let square = omega[row] * omega[row];
            for (at, unbalance) in [(place, weight), (node, RESIDUAL)] {
                load[4 * at] += unbalance * square;
                load[4 * at + 2] += unbalance * Complex::new(0.0, -square);
            }
            (omega[row], load)
        });
        let mut inputs = DMatrix::zeros(omega.len(), 2);
        inputs.column_mut(usize::from(place != node)).fill(weight);
        let one = measured(&omega, inputs, outputs, 0.002, 3 * seed + run as u64);
        data = Some(match data {
            None => one,
            Some(before) => before.followed_by(&one).ok()?,
        });
    }
    let at = |node: usize| [format!("x{node}"), format!("y{node}")];
    let unbalance = |name: &str, node: usize| Input::Unbalance { name: name.into(), at: at(node) };
    let inputs = vec![unbalance("trial 1", node), unbalance("trial 2", rotor.nodes / 4)];
    let instruments = rotor.instruments(inputs, Speed::Synchronous);
    let machine = rotor.machine().with(
        "residual",
        Element::Unbalance {
            at: at(node),
            real: FreeCoefficient::from_start(0.0).into(),
            imaginary: FreeCoefficient::from_start(0.0).into(),
        },
    );
    let settings = Settings::default();
    Some(identify_machine(&data?, &machine, &instruments, &settings).ok()?.likelihood)
}

/// Truth of [`fit_unbalance`].
pub fn truth_of_unbalance() -> Vec<(String, f64)> {
    let residual = [("residual.real", RESIDUAL.re), ("residual.imaginary", RESIDUAL.im)];
    let residual = residual.map(|(name, value)| (name.to_owned(), value)).to_vec();
    [truth(), residual].concat()
}

#[test]
fn bearings_and_residual_unbalance_from_eight_speeds() {
    let rotor = Rotor::new(13, 1.0);
    let judged = judge(&truth_of_unbalance(), 6, |seed| fit_unbalance(&rotor, seed));
    assert!(judged.failed == 0 && judged.coverage >= 0.85, "{judged:?}");
    let estimate = fit_unbalance(&rotor, 0).unwrap();
    for (name, truth) in [("residual.real", RESIDUAL.re), ("residual.imaginary", RESIDUAL.im)] {
        let p = estimate.parameter(name).unwrap();
        let error = p.standard_error.unwrap();
        assert!((p.value - truth).abs() < 4.0 * error && error < 2e-5, "{name}: {p:?}");
    }
}
