//! Response of a nonlinear system to a band-limited force, and its derivatives.

use mechid_estimate::EstimateError;
use mechid_model::{InitialState, Matrix, NonlinearSystem, Parameter, Term};
use mechid_signal::resample::refine;
use mechid_signal::{Extent, Interpolation, Record};
use nalgebra::DMatrix;

use crate::limits::{
    FEWEST_STEPS, MOST_STEPS, SIMULATION_SETTLED, SIMULATION_STEP, SIMULATION_TURN,
};

/// Parameter with respect to which a response is differentiated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Direction {
    /// Entry of the initial state: displacements, then velocities.
    Initial(usize),
    /// Entry of M, C or K.
    Entry(Parameter),
    /// Coefficient of a term.
    Term(usize),
    /// Constant inside the law of a term.
    Constant(usize, usize),
}

/// Force at the instants of all stages of the steps.
pub(super) struct FineForce {
    /// Degrees of freedom × instants; a sampling interval has twice as many instants as steps.
    values: DMatrix<f64>,
    steps: usize,
    samples: usize,
    dt: f64,
}

impl FineForce {
    /// Interpolates a band-limited force, by the Fourier series of a period or, for an open record,
    /// of the record and its mirror image, which has no jump. It uses as many steps as the response
    /// from `start` needs.
    pub(super) fn sufficient(
        force: &Record,
        system: &NonlinearSystem,
        extent: Extent,
        start: &InitialState,
    ) -> Result<Self, EstimateError> {
        let dt = force.sampling().dt();
        let modes = system.linear().modes()?;
        let rate = modes.iter().map(|mode| mode.eigenvalue().norm()).fold(0.0, f64::max);
        let needed = (rate * dt / SIMULATION_TURN).ceil();
        if needed > MOST_STEPS as f64 {
            return Err(EstimateError::TooStiff { rate, dt });
        }
        let period = match extent {
            Extent::WholePeriod => force.clone(),
            Extent::Open => mirrored(force)?,
        };
        let mut grid = Self::new(force.len(), &period, FEWEST_STEPS.max(needed as usize))?;
        let mut tangent = Tangent::new(system, &[]);
        let mut before = tangent.run(&grid, start);
        while 2 * grid.steps <= MOST_STEPS {
            grid = Self::new(force.len(), &period, 2 * grid.steps)?;
            let after = tangent.run(&grid, start);
            if let (Some(before), Some(after)) = (&before, &after) {
                let n = system.dof();
                let displacement = |course: &Course| course.state.columns(0, n).into_owned();
                if (displacement(before) - displacement(after)).amax()
                    <= SIMULATION_SETTLED * displacement(after).amax()
                {
                    break;
                }
            }
            before = after;
        }
        Ok(grid)
    }

    fn new(samples: usize, period: &Record, steps: usize) -> Result<Self, EstimateError> {
        let fine = refine(period, 2 * steps, Interpolation::BandLimited)?;
        // The last instant is the first of the next period.
        let instants = 2 * steps * samples + 1;
        let data = fine.data();
        let values =
            DMatrix::from_fn(period.channels(), instants, |dof, k| data[(k % data.nrows(), dof)]);
        Ok(Self { values, steps, samples, dt: period.sampling().dt() })
    }
}

/// Returns the record followed by its mirror image.
fn mirrored(record: &Record) -> Result<Record, EstimateError> {
    let len = record.len();
    let sampling = record.sampling().with_len(2 * len)?;
    let data = DMatrix::from_fn(2 * len, record.channels(), |k, c| {
        record.data()[(if k < len { k } else { 2 * len - 1 - k }, c)]
    });
    Ok(Record::new(sampling, data)?)
}

/// Linearised motion about a response, from one sample to the next.
pub(super) struct Transition {
    /// Derivatives of the state at the next sample with respect to the state at this one, 2n × 2n.
    pub(super) state: DMatrix<f64>,
    /// Derivatives of the acceleration with respect to the state at this sample, n × 2n.
    pub(super) acceleration: DMatrix<f64>,
}

/// Rates of change at the stages of a step, and the first rate of a sampling interval.
struct Stages {
    first: Vec<f64>,
    rates: [Vec<f64>; 4],
    at: Vec<f64>,
}

impl Stages {
    fn new(len: usize) -> Self {
        let zeros = || vec![0.0; len];
        Self { first: zeros(), rates: [zeros(), zeros(), zeros(), zeros()], at: zeros() }
    }
}

/// Integration of a nonlinear system by the classical Runge–Kutta method, together with the
/// derivatives of the computed response by the tangent of the same method.
///
/// # Source
/// Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sections
/// II.1 (the rule) and I.14 (derivatives with respect to parameters and initial values).
pub(super) struct Tangent<'a> {
    system: &'a NonlinearSystem,
    directions: &'a [Direction],
    /// Inverse M⁻¹, n×n, computed once and applied at every stage.
    inverse_mass: DMatrix<f64>,
    /// Term with one changed constant, and the change, for the derivatives with respect to the
    /// constants of each law.
    moved: Vec<Vec<(f64, Term)>>,
    /// Work arrays of a stage.
    acceleration: Vec<f64>,
    force: Vec<f64>,
    slopes: Vec<[f64; 2]>,
}

/// Displacement, velocity and acceleration at the samples, and their derivatives.
pub(super) struct Course {
    /// Samples × 3n: displacement, velocity, acceleration.
    pub(super) state: DMatrix<f64>,
    /// Derivatives with respect to each direction, samples × 3n.
    pub(super) derivatives: Vec<DMatrix<f64>>,
    /// State and derivatives one sampling interval after the last sample.
    pub(super) end: Vec<f64>,
}

impl<'a> Tangent<'a> {
    pub(super) fn new(system: &'a NonlinearSystem, directions: &'a [Direction]) -> Self {
        let n = system.dof();
        let lu = system.linear().mass().clone().lu();
        let inverse_mass =
            lu.solve(&DMatrix::identity(n, n)).expect("the mass of a system is invertible");
        let moved = system.terms().iter().map(|term| {
            let constants: Vec<f64> = term.law().constants().iter().map(|c| c.value).collect();
            (0..constants.len())
                .filter_map(|at| {
                    let step = SIMULATION_STEP * constants[at].abs();
                    let mut changed = constants.clone();
                    changed[at] += step;
                    Some((step, term.with_constants(&changed)?))
                })
                .collect()
        });
        Self {
            moved: moved.collect(),
            system,
            directions,
            inverse_mass,
            acceleration: vec![0.0; n],
            force: vec![0.0; n],
            slopes: vec![[0.0; 2]; system.terms().len()],
        }
    }

    /// Returns the response from an initial state; `None` if it overflows.
    pub(super) fn run(&mut self, force: &FineForce, start: &InitialState) -> Option<Course> {
        let (n, width) = (self.system.dof(), 1 + self.directions.len());
        let mut z = self.initial(start, width);
        let mut state = DMatrix::zeros(force.samples, 3 * n);
        let mut derivatives = vec![DMatrix::zeros(force.samples, 3 * n); self.directions.len()];
        let (mut stages, mut before) = (Stages::new(z.len()), z.clone());
        for sample in 0..force.samples {
            before.copy_from_slice(&z);
            if !self.interval(force, sample, &mut z, &mut stages) {
                return None;
            }
            let outputs = std::iter::once(&mut state).chain(&mut derivatives).enumerate();
            for (column, course) in outputs {
                let start = 2 * n * column;
                for entry in 0..2 * n {
                    course[(sample, entry)] = before[start + entry];
                }
                for dof in 0..n {
                    course[(sample, 2 * n + dof)] = stages.first[start + n + dof];
                }
            }
        }
        Some(Course { state, derivatives, end: z })
    }

    /// Returns state and derivatives at the first sample.
    fn initial(&self, start: &InitialState, width: usize) -> Vec<f64> {
        let n = self.system.dof();
        let mut z = vec![0.0; 2 * n * width];
        z[..n].copy_from_slice(start.displacement().as_slice());
        z[n..2 * n].copy_from_slice(start.velocity().as_slice());
        for (at, direction) in self.directions.iter().enumerate() {
            if let Direction::Initial(entry) = direction {
                z[2 * n * (1 + at) + entry] = 1.0;
            }
        }
        z
    }

    /// Returns the linearised motion about the response, from sample to sample; the directions must
    /// be the initial state. `None` if the response overflows.
    pub(super) fn transitions(
        &mut self,
        force: &FineForce,
        start: &InitialState,
    ) -> Option<Vec<Transition>> {
        let n = self.system.dof();
        let mut z = self.initial(start, 1 + self.directions.len());
        let at_start = z[2 * n..].to_vec();
        let mut stages = Stages::new(z.len());
        let mut transitions = Vec::with_capacity(force.samples);
        for sample in 0..force.samples {
            z[2 * n..].copy_from_slice(&at_start);
            if !self.interval(force, sample, &mut z, &mut stages) {
                return None;
            }
            let rates = DMatrix::from_column_slice(2 * n, 2 * n, &stages.first[2 * n..]);
            transitions.push(Transition {
                state: DMatrix::from_column_slice(2 * n, 2 * n, &z[2 * n..]),
                acceleration: rates.rows(n, n).into_owned(),
            });
        }
        Some(transitions)
    }

    /// Integrates state and derivatives over a sampling interval; false if they overflow.
    fn interval(
        &mut self,
        force: &FineForce,
        sample: usize,
        z: &mut [f64],
        stages: &mut Stages,
    ) -> bool {
        let h = force.dt / force.steps as f64;
        let Stages { first, rates: [k1, k2, k3, k4], at } = stages;
        for step in 0..force.steps {
            let instant = 2 * (sample * force.steps + step);
            self.rate(z, force.values.column(instant).as_slice(), k1);
            if step == 0 {
                first.copy_from_slice(k1);
            }
            let middle = force.values.column(instant + 1);
            towards(z, 0.5 * h, k1, at);
            self.rate(at, middle.as_slice(), k2);
            towards(z, 0.5 * h, k2, at);
            self.rate(at, middle.as_slice(), k3);
            towards(z, h, k3, at);
            self.rate(at, force.values.column(instant + 2).as_slice(), k4);
            for (i, z) in z.iter_mut().enumerate() {
                *z += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
        }
        z.iter().all(|value| value.is_finite())
    }

    /// Computes ż of state and derivatives (columns of 2n entries) under a force.
    fn rate(&mut self, z: &[f64], force: &[f64], rate: &mut [f64]) {
        let n = self.system.dof();
        let (x, v) = z[..2 * n].split_at(n);
        self.system.restoring_force(x, v, &mut self.force);
        self.force.iter_mut().zip(force).for_each(|(sum, force)| *sum = force - *sum);
        rate[..n].copy_from_slice(v);
        apply(&self.inverse_mass, &self.force, &mut rate[n..2 * n]);
        if self.directions.is_empty() {
            return;
        }
        self.acceleration.copy_from_slice(&rate[n..2 * n]);
        let (terms, coefficients) = (self.system.terms(), self.system.coefficients());
        for ((term, coefficient), slopes) in terms.iter().zip(coefficients).zip(&mut self.slopes) {
            let at = term.coordinate();
            *slopes = term.law().slopes(at.value(x), at.value(v)).map(|slope| coefficient * slope);
        }
        let (damping, stiffness) =
            (self.system.linear().damping(), self.system.linear().stiffness());
        for (d, direction) in self.directions.iter().enumerate() {
            let columns = 2 * n * (1 + d)..2 * n * (2 + d);
            let (dx, dv) = z[columns.clone()].split_at(n);
            let (rate_x, rate_v) = rate[columns].split_at_mut(n);
            rate_x.copy_from_slice(dv);
            for (row, force) in self.force.iter_mut().enumerate() {
                let linear = |column: usize| {
                    damping[(row, column)] * dv[column] + stiffness[(row, column)] * dx[column]
                };
                *force = -(0..n).map(linear).sum::<f64>();
            }
            for (term, slopes) in terms.iter().zip(&self.slopes) {
                let at = term.coordinate();
                let value = slopes[0] * at.value(dx) + slopes[1] * at.value(dv);
                spread(term, value, &mut self.force);
            }
            match *direction {
                Direction::Initial(_) => {}
                Direction::Entry(entry) => {
                    let quantity = match entry.matrix() {
                        Matrix::Mass => &self.acceleration[..],
                        Matrix::Damping => v,
                        Matrix::Stiffness => x,
                    };
                    self.force[entry.row()] -= quantity[entry.column()];
                }
                Direction::Term(which) => {
                    if let Some(term) = terms.iter().nth(which) {
                        spread(term, term.value(x, v), &mut self.force);
                    }
                }
                Direction::Constant(which, constant) => {
                    let moved = self.moved[which].get(constant);
                    if let (Some(term), Some((step, other))) = (terms.iter().nth(which), moved) {
                        let slope = (other.value(x, v) - term.value(x, v)) / step;
                        spread(term, coefficients[which] * slope, &mut self.force);
                    }
                }
            }
            apply(&self.inverse_mass, &self.force, rate_v);
        }
    }
}

/// Subtracts the force of a term from the forces on its degrees of freedom.
fn spread(term: &Term, value: f64, force: &mut [f64]) {
    for (dof, force) in force.iter_mut().enumerate() {
        *force -= term.coordinate().sign(dof) * value;
    }
}

fn towards(z: &[f64], h: f64, rate: &[f64], to: &mut [f64]) {
    for ((to, z), rate) in to.iter_mut().zip(z).zip(rate) {
        *to = z + h * rate;
    }
}

fn apply(matrix: &DMatrix<f64>, vector: &[f64], to: &mut [f64]) {
    for (row, to) in to.iter_mut().enumerate() {
        *to = (0..vector.len()).map(|column| matrix[(row, column)] * vector[column]).sum();
    }
}
