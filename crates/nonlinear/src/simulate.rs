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
    /// Constant inside the law of a term: index of the term, and index of the constant in its law.
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
    /// Interpolates a band-limited force by the Fourier series of one period. For an open record
    /// this period is the record followed by its mirror image, so that the force has no jump. The
    /// number of steps in a sampling interval is doubled until the response from `start` hardly
    /// changes.
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
        let mut before = tangent.simulate(&grid, start);
        while 2 * grid.steps <= MOST_STEPS {
            grid = Self::new(force.len(), &period, 2 * grid.steps)?;
            let after = tangent.simulate(&grid, start);
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
        // One instant is added at the end: the beginning of the next period.
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
    /// Derivatives of the state at the next sample with respect to the state at this sample, 2n ×
    /// 2n.
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
/// Each displacement and each velocity is a row: its value, followed by its derivatives with
/// respect to all directions. So a stage computes all directions of a row in one loop.
///
/// # Source
/// Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sections
/// II.1 (the rule) and I.14 (derivatives with respect to parameters and initial values).
pub(super) struct Tangent<'a> {
    system: &'a NonlinearSystem,
    directions: &'a [Direction],
    terms: Vec<TermTangent<'a>>,
    /// Inverse M⁻¹, n×n, computed once and applied at every stage.
    inverse_mass: DMatrix<f64>,
    /// Derivatives of the accelerations of the linear system with respect to displacements and
    /// velocities, 2n × n: −[K C]ᵀM⁻ᵀ.
    linear: DMatrix<f64>,
    /// Derivatives of the accelerations of the nonlinear system at a stage, in the layout of
    /// `linear`.
    slopes: DMatrix<f64>,
    /// Displacement, velocity, acceleration and force of a stage.
    displacement: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    force: Vec<f64>,
}

/// Term with the data for its derivatives.
struct TermTangent<'a> {
    term: &'a Term,
    coefficient: f64,
    /// Accelerations due to a unit force of the term.
    acceleration: Vec<f64>,
    /// The term with one changed constant, and the change, for each constant of its law.
    moved: Vec<(f64, Term)>,
}

impl<'a> TermTangent<'a> {
    fn new(term: &'a Term, coefficient: f64, inverse_mass: &DMatrix<f64>) -> Self {
        let constants: Vec<f64> = term.law().constants().iter().map(|c| c.value).collect();
        let moved = (0..constants.len()).filter_map(|at| {
            let step = SIMULATION_STEP * constants[at].abs();
            let mut changed = constants.clone();
            changed[at] += step;
            Some((step, term.with_constants(&changed)?))
        });
        let of_row = |row: usize| {
            let forces = term.coordinate().signs();
            -forces.map(|(dof, sign)| inverse_mass[(row, dof)] * sign).sum::<f64>()
        };
        Self {
            term,
            coefficient,
            acceleration: (0..inverse_mass.nrows()).map(of_row).collect(),
            moved: moved.collect(),
        }
    }
}

/// Displacement, velocity and acceleration at the samples, and their derivatives.
pub(super) struct Course {
    /// Samples × 3n: displacement, velocity, acceleration.
    pub(super) state: DMatrix<f64>,
    /// Derivatives with respect to each direction, samples × 3n.
    pub(super) derivatives: Vec<DMatrix<f64>>,
    /// State one sampling interval after the last sample, and its derivatives with respect to each
    /// direction, 2n × (1 + directions).
    pub(super) end: DMatrix<f64>,
}

impl<'a> Tangent<'a> {
    pub(super) fn new(system: &'a NonlinearSystem, directions: &'a [Direction]) -> Self {
        let n = system.dof();
        let lu = system.linear().mass().clone().lu();
        let inverse_mass =
            lu.solve(&DMatrix::identity(n, n)).expect("the mass of a system is invertible");
        let terms = system.terms().iter().zip(system.coefficients());
        let terms = terms
            .map(|(term, coefficient)| TermTangent::new(term, *coefficient, &inverse_mass))
            .collect();
        let mut linear = DMatrix::zeros(2 * n, n);
        let of_linear = [system.linear().stiffness(), system.linear().damping()];
        for (at, matrix) in of_linear.into_iter().enumerate() {
            linear.rows_mut(at * n, n).copy_from(&-(&inverse_mass * matrix).transpose());
        }
        Self {
            system,
            directions,
            terms,
            slopes: linear.clone(),
            linear,
            inverse_mass,
            displacement: vec![0.0; n],
            velocity: vec![0.0; n],
            acceleration: vec![0.0; n],
            force: vec![0.0; n],
        }
    }

    /// Number of entries of a row: the value and its derivatives.
    fn width(&self) -> usize {
        1 + self.directions.len()
    }

    /// Returns the response from an initial state; `None` if it overflows.
    pub(super) fn simulate(&mut self, force: &FineForce, start: &InitialState) -> Option<Course> {
        let (n, width) = (self.system.dof(), self.width());
        let mut z = self.initial(start);
        let mut state = DMatrix::zeros(force.samples, 3 * n);
        let mut derivatives = vec![DMatrix::zeros(force.samples, 3 * n); self.directions.len()];
        let (mut stages, mut before) = (Stages::new(z.len()), z.clone());
        for sample in 0..force.samples {
            before.copy_from_slice(&z);
            if !self.interval(force, sample, &mut z, &mut stages) {
                return None;
            }
            let accelerations = &stages.first[n * width..];
            let rows = before.chunks_exact(width).chain(accelerations.chunks_exact(width));
            for (entry, row) in rows.enumerate() {
                let outputs = std::iter::once(&mut state).chain(&mut derivatives);
                for (course, value) in outputs.zip(row) {
                    course[(sample, entry)] = *value;
                }
            }
        }
        Some(Course { state, derivatives, end: DMatrix::from_row_slice(2 * n, width, &z) })
    }

    /// Returns state and derivatives at the first sample.
    fn initial(&self, start: &InitialState) -> Vec<f64> {
        let (n, width) = (self.system.dof(), self.width());
        let mut z = vec![0.0; 2 * n * width];
        let values = start.displacement().iter().chain(start.velocity().iter());
        for (row, value) in z.chunks_exact_mut(width).zip(values) {
            row[0] = *value;
        }
        for (at, direction) in self.directions.iter().enumerate() {
            if let Direction::Initial(entry) = direction {
                z[width * entry + 1 + at] = 1.0;
            }
        }
        z
    }

    /// Returns the linearised motion about the response, from sample to sample; the directions must
    /// be the entries of the initial state. `None` if the response overflows.
    pub(super) fn transitions(
        &mut self,
        force: &FineForce,
        start: &InitialState,
    ) -> Option<Vec<Transition>> {
        let (n, width) = (self.system.dof(), self.width());
        let mut z = self.initial(start);
        let at_start = z.clone();
        let mut stages = Stages::new(z.len());
        let mut transitions = Vec::with_capacity(force.samples);
        for sample in 0..force.samples {
            for (row, start) in z.chunks_exact_mut(width).zip(at_start.chunks_exact(width)) {
                row[1..].copy_from_slice(&start[1..]);
            }
            if !self.interval(force, sample, &mut z, &mut stages) {
                return None;
            }
            let derivatives = |rows: &[f64]| {
                let all = DMatrix::from_row_slice(rows.len() / width, width, rows);
                all.columns(1, 2 * n).into_owned()
            };
            transitions.push(Transition {
                state: derivatives(&z),
                acceleration: derivatives(&stages.first[n * width..]),
            });
        }
        Some(transitions)
    }

    /// Integrates state and derivatives over a sampling interval; returns `false` if they overflow.
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
            let rates = k1.iter().zip(&*k2).zip(&*k3).zip(&*k4);
            for (z, (((k1, k2), k3), k4)) in z.iter_mut().zip(rates) {
                *z += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
            }
        }
        z.iter().all(|value| value.is_finite())
    }

    /// Computes the rates ż of state and derivatives (2n rows) under a force.
    fn rate(&mut self, z: &[f64], force: &[f64], rate: &mut [f64]) {
        let (n, width) = (self.system.dof(), self.width());
        let (displacements, velocities) = z.split_at(n * width);
        let (rates, accelerations) = rate.split_at_mut(n * width);
        rates.copy_from_slice(velocities);
        for (values, rows) in
            [(&mut self.displacement, displacements), (&mut self.velocity, velocities)]
        {
            for (value, row) in values.iter_mut().zip(rows.chunks_exact(width)) {
                *value = row[0];
            }
        }
        self.system.restoring_force(&self.displacement, &self.velocity, &mut self.force);
        self.force.iter_mut().zip(force).for_each(|(sum, force)| *sum = force - *sum);
        for (row, acceleration) in self.acceleration.iter_mut().enumerate() {
            let by_force = self.inverse_mass.row(row);
            *acceleration = by_force.iter().zip(&self.force).map(|(a, f)| a * f).sum();
            accelerations[row * width] = *acceleration;
        }
        if width > 1 {
            self.differentiate(z, accelerations);
        }
    }

    /// Computes the derivatives of the accelerations at a stage, n rows.
    fn differentiate(&mut self, z: &[f64], accelerations: &mut [f64]) {
        let (n, width) = (self.system.dof(), self.width());
        self.slopes.copy_from(&self.linear);
        for TermTangent { term, coefficient, acceleration, .. } in &self.terms {
            let at = term.coordinate();
            let [by_displacement, by_velocity] =
                term.law().slopes(at.value(&self.displacement), at.value(&self.velocity));
            for (dof, sign) in at.signs() {
                let [of_x, of_v] = [by_displacement, by_velocity].map(|by| coefficient * sign * by);
                for (row, acceleration) in acceleration.iter().enumerate() {
                    self.slopes[(dof, row)] += of_x * acceleration;
                    self.slopes[(n + dof, row)] += of_v * acceleration;
                }
            }
        }
        for (row, rates) in accelerations.chunks_exact_mut(width).enumerate() {
            let rates = &mut rates[1..];
            rates.fill(0.0);
            for (slope, state) in self.slopes.column(row).iter().zip(z.chunks_exact(width)) {
                for (rate, derivative) in rates.iter_mut().zip(&state[1..]) {
                    *rate += slope * derivative;
                }
            }
        }
        for (at, direction) in self.directions.iter().enumerate() {
            self.drive(*direction, accelerations[1 + at..].iter_mut().step_by(width));
        }
    }

    /// Adds the accelerations that a unit change of a parameter causes in a given motion.
    fn drive<'b>(&self, direction: Direction, accelerations: impl Iterator<Item = &'b mut f64>) {
        let (x, v) = (&self.displacement, &self.velocity);
        let (of_unit, force) = match direction {
            Direction::Initial(_) => return,
            Direction::Entry(entry) => {
                let quantity = match entry.matrix() {
                    Matrix::Mass => &self.acceleration,
                    Matrix::Damping => v,
                    Matrix::Stiffness => x,
                };
                let of_unit = &self.inverse_mass.as_slice()[entry.row() * x.len()..][..x.len()];
                (of_unit, -quantity[entry.column()])
            }
            Direction::Term(which) => {
                let TermTangent { term, acceleration, .. } = &self.terms[which];
                (&acceleration[..], term.value(x, v))
            }
            Direction::Constant(which, constant) => {
                let TermTangent { term, coefficient, acceleration, moved } = &self.terms[which];
                let Some((step, other)) = moved.get(constant) else { return };
                let slope = (other.value(x, v) - term.value(x, v)) / step;
                (&acceleration[..], coefficient * slope)
            }
        };
        for (acceleration, of_unit) in accelerations.zip(of_unit) {
            *acceleration += of_unit * force;
        }
    }
}

fn towards(z: &[f64], h: f64, rate: &[f64], to: &mut [f64]) {
    for ((to, z), rate) in to.iter_mut().zip(z).zip(rate) {
        *to = z + h * rate;
    }
}
