//! Restoring forces: measured points, and extrapolation beyond the data.

use mechid_estimate::EstimateError;
use mechid_model::{Coordinate, Matrix, Term};
use mechid_signal::Record;
use nalgebra::{Complex, DMatrix};

use super::SteadyExperiments;
use super::equations::{Equations, power};
use super::estimate::NonlinearEstimate;
use super::grid::Grid;
use crate::limits::{HIGHEST_ORDER, RESTORING_NEGLIGIBLE, RESTORING_POOR};

/// Points of the restoring-force surface: the measured force minus the inertia force, as a function
/// of displacement and velocity. All records are samples × degrees of freedom, over one period.
#[derive(Debug, Clone, PartialEq)]
pub struct RestoringForce {
    /// Displacement, in m.
    pub displacement: Record,
    /// Velocity, in m/s.
    pub velocity: Record,
    /// F − M̂ ẍ on the lines of the fit, in N.
    pub measured: Record,
    /// Part of `measured` that the identified springs and dampers do not explain, in N.
    pub residual: Record,
}

/// Growth of a term, and of the restoring force in its equation of motion, up to [`REACH`] times
/// the largest displacement and velocity in the data.
#[derive(Debug, Clone, PartialEq)]
pub struct Extrapolation {
    /// Name of the term.
    pub term: String,
    /// Exponent with which the force of the term grows from the edge of the data to [`REACH`] times
    /// the range of the data; 3 for a cubic spring.
    pub order: f64,
    /// Ratio of the standard error of the restoring force to the restoring force, at the edge of
    /// the data and at [`REACH`] times the range of the data.
    pub relative_error: [f64; 2],
    /// Ratio of the force of the term to the restoring force, at the edge of the data and at
    /// [`REACH`] times the range of the data.
    pub share: [f64; 2],
}

/// Multiple of the largest displacement and velocity in the data at which the extrapolation is
/// assessed.
pub const REACH: f64 = 1.5;

impl Extrapolation {
    /// Returns `true` if the restoring force is unreliable at [`REACH`] times the range of the
    /// data: its standard error exceeds 10 % of the force, or the term is of fourth or higher order
    /// and is more than 1 % of the force.
    pub fn is_poor(&self) -> bool {
        self.relative_error[1] > RESTORING_POOR || self.grows_fast()
    }

    /// Returns `true` if the term is of fourth or higher order and is more than 1 % of the
    /// restoring force at [`REACH`] times the range of the data.
    pub fn grows_fast(&self) -> bool {
        self.order > HIGHEST_ORDER && self.share[1].abs() > RESTORING_NEGLIGIBLE
    }
}

impl NonlinearEstimate {
    /// Returns the points of the restoring-force surface of each experiment, over one period.
    ///
    /// Force and acceleration contain only the lines of the fit, so that noise on other lines does
    /// not hide the surface; displacement and velocity contain all lines.
    ///
    /// # Errors
    /// As [`equation_error`](super::equation_error) if the data do not belong to this system.
    ///
    /// # Source
    /// Masri & Caughey (1979), Journal of Applied Mechanics 46, 433–447 (restoring force surface).
    pub fn restoring_forces(
        &self,
        data: &SteadyExperiments,
    ) -> Result<Vec<RestoringForce>, EstimateError> {
        let equations = Equations::new(data, self.linear.unknowns(), &self.terms)?;
        let columns = equations.columns(&self.terms, &self.channels);
        let free = equations.free.len();
        let entries = self.parameters[..free].iter().map(|parameter| parameter.estimate.value);
        let coefficients: Vec<f64> = entries.chain(self.coefficients.iter().copied()).collect();
        let residuals = equations.residuals(&columns, &coefficients);
        let lines = data.period().len().div_ceil(2);
        let grid = Grid::new(lines, data.period().len());
        let record = |of: &dyn Fn(usize, usize) -> Complex<f64>| -> Result<Record, EstimateError> {
            let channel = |dof: usize| grid.to_samples((0..lines).map(|line| of(line, dof)));
            let channels: Vec<Vec<f64>> = (0..data.dof()).map(channel).collect();
            Ok(Record::from_channels(data.period(), &channels)?)
        };
        // The function returns the value on a line of the fit, and zero on other lines.
        let row_value = |rows: &DMatrix<Complex<f64>>, line: usize, dof: usize| {
            equations.rows.binary_search(&line).map_or(Complex::ZERO, |row| rows[(row, dof)])
        };
        let mass = self.linear.mass();
        columns
            .iter()
            .zip(&residuals)
            .zip(data.displacements(&self.channels))
            .map(|((columns, residual), displacement)| {
                let omega = |line: usize| data.omega(line);
                let inertia = |line: usize, dof: usize| {
                    let of = |column: usize| {
                        row_value(&columns.displacement, line, column) * mass[(dof, column)]
                    };
                    let sum: Complex<f64> = (0..data.dof()).map(of).sum();
                    sum * power(Matrix::Mass, omega(line))
                };
                Ok(RestoringForce {
                    displacement: record(&|line, dof| displacement[(line, dof)])?,
                    velocity: record(&|line, dof| {
                        displacement[(line, dof)] * Complex::new(0.0, omega(line))
                    })?,
                    measured: record(&|line, dof| {
                        row_value(&columns.force, line, dof) - inertia(line, dof)
                    })?,
                    residual: record(&|line, dof| row_value(residual, line, dof))?,
                })
            })
            .collect()
    }

    /// Returns the growth of each term, and of the restoring force in its equation of motion, from
    /// the largest displacement and velocity in the data ([`NonlinearEstimate::ranges`]) to
    /// [`REACH`] times these values.
    ///
    /// A term of the displacement only is evaluated at zero velocity, a term of the velocity only
    /// at zero displacement. Constant forces are ignored.
    ///
    /// # Errors
    /// No error occurs; the type is that of [`NonlinearEstimate::restoring_force`].
    pub fn extrapolations(&self) -> Result<Vec<Extrapolation>, EstimateError> {
        let named = self.terms.iter().zip(&self.coefficients).zip(&self.ranges);
        named
            .filter(|((term, _), _)| !term.law().is_constant())
            .map(|((term, coefficient), range)| self.extrapolation(term, *coefficient, *range))
            .collect()
    }

    fn extrapolation(
        &self,
        term: &Term,
        coefficient: f64,
        [q, v]: [f64; 2],
    ) -> Result<Extrapolation, EstimateError> {
        let [dq, dv] = term.law().slopes(q, v);
        let (q, v) = (if dq == 0.0 { 0.0 } else { q }, if dv == 0.0 { 0.0 } else { v });
        let holds = |dof: &usize| term.coordinate().sign(*dof) != 0.0;
        let dof = (0..self.linear.dof()).find(holds).expect("a term belongs to its system");
        let at = |factor: f64| {
            let spread = |value: f64| spread(term.coordinate(), self.linear.dof(), factor * value);
            let (displacement, velocity) = (spread(q), spread(v));
            let force = self.restoring_force(&displacement, &velocity)?[dof];
            let share = coefficient * term.value(&displacement, &velocity);
            let whole = force.value.abs().max(f64::MIN_POSITIVE);
            Ok::<_, EstimateError>((force.standard_error / whole, share.abs() / whole, share))
        };
        let ((near_error, near_share, near), (far_error, far_share, far)) = (at(1.0)?, at(REACH)?);
        Ok(Extrapolation {
            term: term.name().to_owned(),
            order: if near == 0.0 { 0.0 } else { (far / near).abs().ln() / REACH.ln() },
            relative_error: [near_error, far_error],
            share: [near_share, far_share],
        })
    }
}

/// Returns displacements or velocities with this value of a coordinate. If the coordinate is a
/// difference, each of its two degrees of freedom has half of the value.
fn spread(coordinate: Coordinate, dof: usize, value: f64) -> Vec<f64> {
    let signs: Vec<f64> = (0..dof).map(|dof| coordinate.sign(dof)).collect();
    let moved: f64 = signs.iter().map(|sign| sign.abs()).sum();
    signs.iter().map(|sign| sign * value / moved).collect()
}
