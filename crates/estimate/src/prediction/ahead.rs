//! One-step prediction errors: from one measured sample to the next.

use mechid_model::{Discretisation, Matrix};
use mechid_numerics::least_squares::solve_compressed;
use mechid_numerics::triangular::TriangularFactor;
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::Extent;
use mechid_signal::resample::refine;
use mechid_signal::{Interpolation, Record};
use nalgebra::{DMatrix, DVector};

use super::{At, Step};
use crate::{Estimate, EstimateError};

/// Returns the mean missing force (N) of each measured interval, and the inertia force (N) for a
/// comparison. Each is intervals × degrees of freedom, on the time axis of the records.
///
/// From each measured state (displacement in m, velocity in m/s) the motion of the identified
/// system under the force (N) is predicted one interval ahead; M (ẋ measured − ẋ predicted)/Δt is
/// the force that is missing for the measured velocity. Least squares remove, equation by equation,
/// the part of this force that a change of the free parameters explains, so that the uncertainty of
/// the parameters does not appear as a missing force. The remaining force shows a wrong known mass
/// or a wrong type of model.
///
/// For a correct model the remaining force is white if random forces disturb the motion. White
/// noise on the measured motion affects two neighbouring intervals, so it makes the remaining force
/// correlated at lag 1 only.
///
/// `between` is the factor and the interpolation of a refined fit: the prediction takes `factor`
/// steps per interval, under the interpolated force. Motions between the samples are not used, so
/// each interval has one missing force for any `factor`. The discretisation defines the force
/// between points; for Euler's rule the force is held.
///
/// # Errors
/// [`NumericsError::Size`] or [`EstimateError::Signal`] if the sizes or time axes of the records do
/// not agree with the machine or with each other, or if the records cannot be refined;
/// [`EstimateError::Undetermined`] if the data do not determine the machine;
/// [`NumericsError::TooFewRows`].
///
/// # Source
/// Dissertation Appendix B for the refinement.
pub fn missing_force(
    estimate: &Estimate,
    [displacement, velocity, force]: [&Record; 3],
    discretisation: Discretisation,
    extent: Extent,
    between: Option<(usize, Interpolation)>,
) -> Result<[Record; 2], EstimateError> {
    let (n, system) = (estimate.dof(), estimate.system()?);
    for record in [displacement, velocity, force] {
        check_size("channels of a record", n, record.channels())?;
        displacement.check_same_sampling(record)?;
    }
    let (factor, way) = between.unwrap_or((1, Interpolation::Linear));
    let finer = refine(force, factor, way)?;
    let step = Step::new(&system, finer.sampling().dt(), discretisation)?;
    // Band-limited interpolation is a Fourier series, so it also gives the force after the last
    // sample; the other interpolations do not.
    let goes_on = between.is_none_or(|(_, way)| way == Interpolation::BandLimited);
    let (samples, dt) = (force.len(), force.sampling().dt());
    let closes = extent == Extent::WholePeriod && goes_on;
    let intervals = if closes { samples } else { samples - 1 };
    let [x, v] = [displacement, velocity].map(|record| record.data().rows(0, intervals));
    let ahead = step.ahead(&finer, factor, x.into_owned(), v.into_owned());
    let mass = system.mass().transpose();
    let rise = |from: &dyn Fn(usize, usize) -> f64| {
        let next = |k: usize, c: usize| velocity.data()[((k + 1) % samples, c)];
        DMatrix::from_fn(intervals, n, |k, c| (next(k, c) - from(k, c)) / dt) * &mass
    };
    let inertia = rise(&|k, c| v[(k, c)]);
    let mut missing = rise(&|k, c| ahead[(k, c)]);
    let predicted = (ahead - v) / dt;
    for equation in 0..n {
        let regressor = |parameter: &mechid_model::Parameter| match parameter.matrix() {
            Matrix::Mass => predicted.column(parameter.column()).into_owned(),
            Matrix::Damping => v.column(parameter.column()).into_owned(),
            Matrix::Stiffness => x.column(parameter.column()).into_owned(),
        };
        let parameters = estimate.unknowns().free().into_iter().filter(|p| p.row() == equation);
        let columns: Vec<DVector<f64>> =
            parameters.map(|parameter| regressor(&parameter)).collect();
        if !columns.is_empty() {
            let regressors = DMatrix::from_columns(&columns);
            let unexplained = remainder(regressors, missing.column(equation).into())?;
            missing.set_column(equation, &unexplained);
        }
    }
    let sampling = force.sampling().with_len(intervals)?;
    Ok([Record::new(sampling, missing)?, Record::new(sampling, inertia)?])
}

/// Returns the residual of a target after a least-squares fit of the columns.
fn remainder(columns: DMatrix<f64>, target: DVector<f64>) -> Result<DVector<f64>, EstimateError> {
    let mut factor = TriangularFactor::new(columns.ncols() + 1);
    let right = DMatrix::from_columns(&[target]);
    if !factor.push(&[columns.as_view(), right.as_view()]) {
        return Err(NumericsError::Overflow.into());
    }
    let (regressors, targets) = factor.r().columns_range_pair(..columns.ncols(), columns.ncols()..);
    let solution = solve_compressed(regressors, targets, factor.rows())?;
    Ok((right - columns * (solution.inverse * targets)).column(0).into_owned())
}

impl Step {
    /// Returns the velocities (intervals × n) that are predicted `steps` steps after the start of
    /// each interval, from the state at the start.
    fn ahead(
        &self,
        force: &Record,
        steps: usize,
        displacement: DMatrix<f64>,
        velocity: DMatrix<f64>,
    ) -> DMatrix<f64> {
        let (intervals, n) = displacement.shape();
        let mut predicted = DMatrix::zeros(intervals, n);
        let mut at = At::new(&vec![0.0; 2 * n]);
        for k in 0..intervals {
            let velocities = velocity.row(k) * self.dt;
            at.set_state(displacement.row(k).iter().chain(velocities.iter()).copied());
            for sample in k * steps..(k + 1) * steps {
                self.advance(force, sample, &mut at);
            }
            for (column, z) in at.state()[n..].iter().enumerate() {
                predicted[(k, column)] = z / self.dt;
            }
        }
        predicted
    }
}
