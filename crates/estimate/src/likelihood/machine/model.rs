//! Response of a machine: its known part, coupled to the unknown terms by a small system of
//! equations on every line.

use std::ops::AddAssign;

use mechid_model::elements::{Assembly, Pattern, Power};
use nalgebra::{Complex, DMatrix, DVector};

use super::nominal::{Nominal, NominalLine, Places, is_coupled, nominal_coefficient};
use super::state_loads::state_loads;
use super::{LikelihoodError, MeasuredPart};
use crate::elimination::solve_in_place;
use crate::likelihood::{Dimensions, LineResponse, ResponseModel};

/// A term of the dynamic stiffness between the joints (degrees of freedom of unknown terms). The
/// joints have the indices 0 to j − 1; index j is the support.
#[derive(Debug, Clone)]
struct JointTerm {
    entries: JointPattern,
    power: Power,
    /// Coefficient of this term in the nominal machine.
    nominal: Complex<f64>,
    /// Index of this term among the terms of the assembly.
    term: usize,
}

#[derive(Debug, Clone)]
enum JointPattern {
    Dyad { left: Vec<(usize, f64)>, right: Vec<(usize, f64)> },
    Block { dofs: Vec<usize>, matrix: DMatrix<f64>, support: Vec<f64> },
}

/// Entries (row, column, value) of a change Δ of the dynamic stiffness at the joints; a position
/// may occur more than once.
struct Change(Vec<(usize, usize, Complex<f64>)>);

impl Change {
    /// Adds the product of Δ and a matrix to `sum`; `entry` returns the entries of this matrix.
    fn add_product(
        &self,
        sum: &mut DMatrix<Complex<f64>>,
        entry: impl Fn(usize, usize) -> Complex<f64>,
    ) {
        for (row, column, value) in &self.0 {
            for at in 0..sum.ncols() {
                sum[(*row, at)] += value * entry(*column, at);
            }
        }
    }
}

const ONE: Complex<f64> = Complex::new(1.0, 0.0);

/// The [`ResponseModel`] of a machine.
///
/// With the receptance H₀ of the nominal machine and the change Δ of the dynamic stiffness at the
/// joints, the response is x = x₀ − H (Δ x₀ + Δ_g x_g) with H = H₀ (I + Δ H₀)⁻¹. x₀ is the nominal
/// response, x_g is the motion of the support, and Δ_g is the column of the support in the change.
/// This system of equations has one equation for each joint, for any number of known degrees of
/// freedom.
///
/// # Source
/// Hager (1989), SIAM Review 31, 221–239 (updating an inverse); Gordis, Bielawa & Flannelly (1991),
/// J. Sound and Vibration 150, 139–158 (structural synthesis in the frequency domain).
#[derive(Debug, Clone)]
pub struct MachineModel {
    assembly: Assembly,
    omega: Vec<f64>,
    places: Places,
    terms: Vec<JointTerm>,
    lines: Vec<NominalLine>,
    line_of: Vec<usize>,
    /// Weights of each sensor: pairs of an index in `places` and the weight there. The index of the
    /// support is r, the number of degrees of freedom in `places`.
    sensors: Vec<Vec<(usize, f64)>>,
    states: usize,
    measured: Option<MeasuredPart>,
}

/// Response of a machine at one line.
#[derive(Debug, Clone)]
pub struct MachineLine<'a> {
    model: &'a MachineModel,
    omega: f64,
    /// Receptance G, p × q.
    receptance: DMatrix<Complex<f64>>,
    /// Response of the sensors to a unit of each load of the machine, such as unbalance, p × loads.
    own_response: DMatrix<Complex<f64>>,
    /// Response of the sensors to all loads of the machine.
    own: Option<DVector<Complex<f64>>>,
    /// Values of the loads of the machine; 1 for known loads.
    own_values: Vec<f64>,
    /// Response S H of the sensors to forces at the joints, p × j.
    from_joints: DMatrix<Complex<f64>>,
    /// Response of the sensors to a unit of each state load, p × s; `None` without state loads.
    states: Option<DMatrix<Complex<f64>>>,
    /// Motion of joints and support (j + 1) per unit of each input, load of the machine and state
    /// load.
    joints: DMatrix<Complex<f64>>,
    /// Frequency factor, such as −ω² for a mass, of each term between the joints.
    factors: Vec<Complex<f64>>,
    /// Response S (I − H Δ) of the sensors to motions of a measured part, and the forces on this
    /// part per unit of each input.
    part: Option<[DMatrix<Complex<f64>>; 2]>,
}

impl MachineModel {
    /// Prepares a machine for lines at `omega` (rad/s). With `open` records, state loads act on the
    /// machine. They describe the difference between the initial and the final state of a record.
    ///
    /// # Errors
    /// [`LikelihoodError::NoResponse`] if the machine has no response at its initial values,
    /// [`LikelihoodError::LargeOpen`] for too many state loads.
    pub fn new(
        assembly: &Assembly,
        omega: &[f64],
        measured: Option<&MeasuredPart>,
        open: bool,
    ) -> Result<Self, LikelihoodError> {
        let places = Places::new(assembly, measured);
        let nominal = Nominal::new(assembly, measured, &places);
        let states = if open {
            state_loads(&nominal, assembly, &places, omega)?
        } else {
            DMatrix::zeros(assembly.dof(), 0)
        };
        let (lines, line_of) = nominal.lines(omega, &states)?;
        let n = assembly.dof();
        // The support, degree of freedom n, has no index in `places`.
        let joint = |dof: usize| places.index(dof).unwrap_or(places.joints);
        let start = assembly.start();
        let coupled = assembly.terms().iter().enumerate();
        let coupled = coupled.filter(|(_, term)| is_coupled(term, measured));
        let terms = coupled.map(|(at, term)| {
            let indexed = |entries: &[(usize, f64)]| -> Vec<(usize, f64)> {
                entries.iter().map(|(dof, value)| (joint(*dof), *value)).collect()
            };
            let entries = match &term.pattern {
                Pattern::Dyad { left, right } => {
                    // The support has no equation of motion.
                    let moving: Vec<_> = left.iter().filter(|(dof, _)| *dof < n).copied().collect();
                    JointPattern::Dyad { left: indexed(&moving), right: indexed(right) }
                }
                Pattern::Block { dofs, matrix, support } => JointPattern::Block {
                    dofs: dofs.iter().map(|dof| joint(*dof)).collect(),
                    matrix: matrix.clone(),
                    support: support.clone(),
                },
            };
            let nominal = nominal_coefficient(term, &start, measured);
            JointTerm { entries, power: term.power, nominal, term: at }
        });
        let terms = terms.collect();
        let sensors = assembly.sensors().iter().map(|sensor| {
            let index = |dof: usize| places.index(dof).unwrap_or(places.dofs.len());
            sensor.entries.iter().map(|(dof, weight)| (index(*dof), *weight)).collect()
        });
        let sensors = sensors.collect();
        Ok(Self {
            sensors,
            terms,
            lines,
            line_of,
            states: states.ncols(),
            places,
            omega: omega.to_vec(),
            assembly: assembly.clone(),
            measured: measured.cloned(),
        })
    }

    /// Returns the machine with its degrees of freedom by index.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// Returns the entries of Δ, j × (j + 1), and the frequency factors of its terms.
    fn change(&self, parameters: &[f64], omega: f64) -> (Change, Vec<Complex<f64>>) {
        let joints = self.places.joints;
        let speed = self.assembly.speed().at(omega);
        let mut change = Change(Vec::with_capacity(4 * self.terms.len()));
        let mut factors = Vec::with_capacity(self.terms.len());
        for term in &self.terms {
            let factor = term.power.factor(omega, speed);
            factors.push(factor);
            let value = self.assembly.terms()[term.term].value(parameters);
            let coefficient = factor * (Complex::from(value) - term.nominal);
            match &term.entries {
                JointPattern::Dyad { left, right } => {
                    for (row, a) in left {
                        for (column, b) in right {
                            change.0.push((*row, *column, coefficient * (a * b)));
                        }
                    }
                }
                JointPattern::Block { dofs, matrix, support } => {
                    for (i, row) in dofs.iter().enumerate() {
                        for (j, column) in dofs.iter().enumerate() {
                            change.0.push((*row, *column, coefficient * matrix[(i, j)]));
                        }
                        change.0.push((*row, joints, coefficient * support[i]));
                    }
                }
            }
        }
        (change, factors)
    }

    /// Returns two matrices of the machine with the change Δ: Hᵀ for forces at the joints, j × r,
    /// and the response to each load, r × loads. `None` if this machine is singular.
    fn coupled(
        &self,
        nominal: &NominalLine,
        change: &Change,
    ) -> Option<[DMatrix<Complex<f64>>; 2]> {
        let j = self.places.joints;
        // `from_joints` is H₀ᵀ before the solution of (I + Δ H₀)ᵀ Hᵀ = H₀ᵀ, and Hᵀ after it.
        let (mut from_joints, mut loads) = (nominal.from_joints.clone(), nominal.loads.clone());
        if j > 0 {
            let mut coupled = DMatrix::identity(j, j);
            for (row, column, value) in change.0.iter().filter(|entry| entry.1 < j) {
                let from = nominal.from_joints.column(*column);
                add_scaled(coupled.column_mut(*row).as_mut_slice(), *value, from.as_slice());
            }
            solve_in_place(&mut coupled, &mut from_joints).then_some(())?;
            let mut reaction = DMatrix::zeros(j, loads.ncols());
            change.add_product(&mut reaction, |row, load| {
                if row < j { nominal.loads[(row, load)] } else { nominal.support[load] }
            });
            loads.gemm_tr(-ONE, &from_joints, &reaction, ONE);
        }
        Some([from_joints, loads])
    }

    /// Returns the readings of the sensors, with their `factors`, for the motions under each of
    /// `columns` loads. `motion` returns the motion of a degree of freedom under a load. Its
    /// arguments are the index of the degree of freedom in `places` and the index of the load; the
    /// index of the support is r, the number of degrees of freedom in `places`.
    fn read(
        &self,
        factors: &[Complex<f64>],
        columns: usize,
        motion: impl Fn(usize, usize) -> Complex<f64>,
    ) -> DMatrix<Complex<f64>> {
        DMatrix::from_fn(self.sensors.len(), columns, |row, column| {
            let entries = self.sensors[row].iter();
            let sum = entries.map(|(index, weight)| motion(*index, column) * *weight);
            factors[row] * sum.sum::<Complex<f64>>()
        })
    }

    /// Returns S (I − H Δ) at the degrees of freedom of a measured part, and the forces f − Δ x on
    /// this part per unit of each input.
    fn part(
        &self,
        (omega, readings_of): (f64, &[Complex<f64>]),
        change: &Change,
        from_joints: &DMatrix<Complex<f64>>,
        joints: &DMatrix<Complex<f64>>,
    ) -> Option<[DMatrix<Complex<f64>>; 2]> {
        let part = self.measured.as_ref().filter(|part| part.variance.is_some())?;
        let (j, inputs) = (self.places.joints, self.assembly.inputs().len());
        let mut coupled = DMatrix::zeros(self.sensors.len(), j);
        for (row, column, value) in change.0.iter().filter(|entry| entry.1 < j) {
            coupled.column_mut(*column).axpy(*value, &from_joints.column(*row), ONE);
        }
        let mut reaction = DMatrix::zeros(j, inputs);
        change.add_product(&mut reaction, |row, load| joints[(row, load)]);
        let n = self.assembly.dof();
        let mut readings = DMatrix::zeros(self.sensors.len(), part.dofs.len());
        let mut forces = DMatrix::zeros(part.dofs.len(), inputs);
        for (at, dof) in part.dofs.iter().enumerate() {
            let index = self.places.index(*dof)?;
            for (row, (entries, factor)) in self.sensors.iter().zip(readings_of).enumerate() {
                let direct: f64 = entries.iter().filter(|(of, _)| *of == index).map(|e| e.1).sum();
                readings[(row, at)] = factor * direct;
                if index < j {
                    readings[(row, at)] -= coupled[(row, index)];
                }
            }
            for (column, input) in self.assembly.inputs().iter().enumerate() {
                let loads = input.load(n, omega, self.assembly.speed());
                let direct = loads.iter().filter(|(of, _)| of == dof).map(|(_, value)| value);
                forces[(at, column)] = direct.sum();
                if index < j {
                    forces[(at, column)] -= reaction[(index, column)];
                }
            }
        }
        Some([readings, forces])
    }
}

/// Adds a column, multiplied by a factor, to another column. This function is several times as fast
/// as the `axpy` of nalgebra, which multiplies every complex entry by two further factors.
fn add_scaled(to: &mut [Complex<f64>], factor: Complex<f64>, column: &[Complex<f64>]) {
    for (to, value) in to.iter_mut().zip(column) {
        *to += factor * value;
    }
}

impl ResponseModel for MachineModel {
    type Line<'a> = MachineLine<'a>;

    fn dimensions(&self) -> Dimensions {
        Dimensions {
            outputs: self.sensors.len(),
            inputs: self.assembly.inputs().len(),
            parameters: self.assembly.parameters().len(),
            states: self.states,
        }
    }

    fn omega(&self) -> &[f64] {
        &self.omega
    }

    fn at(&self, parameters: &[f64], row: usize) -> Option<MachineLine<'_>> {
        let (omega, nominal) = (self.omega[row], &self.lines[self.line_of[row]]);
        let (j, inputs) = (self.places.joints, self.assembly.inputs().len());
        let (change, factors) = self.change(parameters, omega);
        let load_count = nominal.loads.ncols();
        let [from_joints, loads] = self.coupled(nominal, &change)?;
        let joints = DMatrix::from_fn(j + 1, load_count, |row, load| {
            if row < j { loads[(row, load)] } else { nominal.support[load] }
        });
        let sensors = self.assembly.sensors().iter();
        let of_sensors: Vec<Complex<f64>> =
            sensors.map(|sensor| sensor.factor(parameters, omega)).collect();
        let places = loads.nrows();
        let motion = |place: usize, load: usize| {
            if place < places { loads[(place, load)] } else { nominal.support[load] }
        };
        let receptance = self.read(&of_sensors, inputs, motion);
        receptance.iter().all(|z| z.is_finite()).then_some(())?;
        let own_loads = self.assembly.own_loads(omega);
        let value = |parameter: &Option<usize>| parameter.map_or(1.0, |at| parameters[at]);
        let own_values: Vec<f64> = own_loads.iter().map(|(of, _)| value(of)).collect();
        let (own_count, first_state) = (own_values.len(), load_count - self.states);
        let own_response =
            self.read(&of_sensors, own_count, |place, load| motion(place, inputs + load));
        let own_sum = (!own_values.is_empty()).then(|| {
            let values = own_values.iter().map(|value| Complex::from(*value));
            &own_response * DVector::from_iterator(own_values.len(), values)
        });
        let state = |place: usize, load: usize| motion(place, first_state + load);
        let states = (self.states > 0).then(|| self.read(&of_sensors, self.states, state));
        let from_joints = self.read(&of_sensors, j, |place, joint| {
            if place < places { from_joints[(joint, place)] } else { Complex::default() }
        });
        let part = self.part((omega, &of_sensors), &change, &from_joints, &joints);
        Some(MachineLine {
            model: self,
            omega,
            receptance,
            own_response,
            own: own_sum,
            own_values,
            from_joints,
            states,
            joints,
            factors,
            part,
        })
    }

    /// Returns the covariance of the outputs due to the errors of a measured receptance: Σ var_ij
    /// |g_j|² P_i P_iᴴ, where g are the forces on the measured part and column P_i is the response
    /// of the sensors to a unit motion i of this part.
    fn covariance<'l>(
        &'l self,
        row: usize,
        line: &MachineLine<'l>,
        input: &DVector<Complex<f64>>,
    ) -> Option<DMatrix<Complex<f64>>> {
        let variance = self.measured.as_ref()?.variance.as_ref()?;
        let [readings, forces] = line.part.as_ref()?;
        let forces = forces * input;
        let mut covariance = DMatrix::zeros(self.sensors.len(), self.sensors.len());
        let power = forces.map(|force| force.norm_sqr());
        let by_row = &variance[row] * power;
        for (at, weight) in by_row.iter().enumerate() {
            let reading = readings.column(at);
            covariance += reading * reading.adjoint() * Complex::from(*weight);
        }
        Some(covariance)
    }
}

impl LineResponse for MachineLine<'_> {
    fn receptance(&self) -> &DMatrix<Complex<f64>> {
        &self.receptance
    }

    fn own_response(&self) -> Option<&DVector<Complex<f64>>> {
        self.own.as_ref()
    }

    fn state_response(&self) -> Option<&DMatrix<Complex<f64>>> {
        self.states.as_ref()
    }

    /// Writes ∂y = −S H ∂D x for every term, and the response to a unit of each load of the
    /// machine.
    fn sensitivity(
        &self,
        parameters: &[f64],
        input: &DVector<Complex<f64>>,
        states: &DVector<Complex<f64>>,
        to: &mut DMatrix<Complex<f64>>,
    ) {
        to.fill(Complex::default());
        let inputs = input.len();
        let mut motion = self.joints.columns(0, inputs) * input;
        for (value, column) in self.own_values.iter().zip(inputs..) {
            motion.axpy(Complex::from(*value), &self.joints.column(column), Complex::new(1.0, 0.0));
        }
        if !states.is_empty() {
            let first = self.joints.ncols() - states.len();
            motion.gemv(ONE, &self.joints.columns(first, states.len()), states, ONE);
        }
        let assembly = &self.model.assembly;
        let mut response = vec![Complex::default(); self.from_joints.nrows()];
        for (term, factor) in self.model.terms.iter().zip(&self.factors) {
            let source = &assembly.terms()[term.term];
            if source.is_known() {
                continue;
            }
            self.response_to(&term.entries, &motion, &mut response);
            response.iter_mut().for_each(|reading| *reading *= -*factor);
            for (parameter, slope) in source.derivatives(parameters) {
                let mut to = to.column_mut(parameter);
                add_scaled(to.as_mut_slice(), Complex::from(slope), &response);
            }
        }
        // A delay τ multiplies a reading y by e^{−iωτ}: ∂y/∂τ = −iω y.
        for (row, sensor) in assembly.sensors().iter().enumerate() {
            let Some(parameter) = sensor.delay_parameter else { continue };
            let mut reading = (self.receptance.row(row) * input)[0];
            reading += self.own.as_ref().map_or(Complex::default(), |own| own[row]);
            if let Some(of_states) = self.states.as_ref().filter(|_| !states.is_empty()) {
                reading += (of_states.row(row) * states)[0];
            }
            to[(row, parameter)] += reading * Complex::new(0.0, -self.omega);
        }
        for (column, (parameter, _)) in assembly.own_loads(1.0).iter().enumerate() {
            if let Some(parameter) = parameter {
                to.column_mut(*parameter).add_assign(&self.own_response.column(column));
            }
        }
    }
}

impl MachineLine<'_> {
    /// Writes the response of the sensors to the forces that a term with unit coefficient causes
    /// under `motion` (j + 1 entries).
    fn response_to(
        &self,
        entries: &JointPattern,
        motion: &DVector<Complex<f64>>,
        response: &mut [Complex<f64>],
    ) {
        response.fill(Complex::default());
        match entries {
            JointPattern::Dyad { left, right } => {
                let stretch: Complex<f64> = right.iter().map(|(at, b)| motion[*at] * *b).sum();
                for (at, a) in left {
                    add_scaled(response, stretch * *a, self.from_joints.column(*at).as_slice());
                }
            }
            JointPattern::Block { dofs, matrix, support } => {
                let ground = motion[motion.len() - 1];
                for (i, row) in dofs.iter().enumerate() {
                    let moved = dofs.iter().enumerate();
                    let force: Complex<f64> =
                        moved.map(|(j, column)| motion[*column] * matrix[(i, j)]).sum();
                    let force = force + ground * support[i];
                    add_scaled(response, force, self.from_joints.column(*row).as_slice());
                }
            }
        }
    }
}
