//! Errors of prediction from one measured sample to the next.

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

/// The mean force (N) that is missing in each measured interval, and the inertia force (N) it is
/// left of: intervals × degrees of freedom, on the time axis of the records.
///
/// From each measured state (displacement in m, velocity in m/s) the machine found is led one
/// interval ahead by the force (N); M (ẋ measured − ẋ predicted)/Δt is the force that would have
/// led it where it was measured. What a change of the free parameters accounts for is then taken
/// out by least squares, equation by equation, so that their own uncertainty does not show.
/// So a wrong known mass does, and a machine of another kind.
///
/// A machine that is right leaves what disturbs its motion at random, which is white, and of white
/// noise on the measured motion that of two neighbouring samples, which is correlated at lag 1 and
/// no further.
///
/// With `between`, the factor and the interpolation of a refined fit, the machine goes in so many
/// steps under the force interpolated as there. The motions between the samples are not used: an
/// interval has one error however many points lie in it. The force between points is what the
/// discretisation says; Euler's is taken as held.
///
/// # Errors
/// [`NumericsError::Size`] or [`EstimateError::Signal`] if the records do not belong to the machine,
/// or together, or cannot be refined; [`EstimateError::Undetermined`] if the estimate is no machine;
/// [`NumericsError::TooFewRows`].
///
/// # Source
/// The refinement is that of Appendix B of the dissertation.
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
    // Of the interpolations only a Fourier series goes on after the last sample.
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
        let of = |parameter: &mechid_model::Parameter| match parameter.matrix() {
            Matrix::Mass => predicted.column(parameter.column()).into_owned(),
            Matrix::Damping => v.column(parameter.column()).into_owned(),
            Matrix::Stiffness => x.column(parameter.column()).into_owned(),
        };
        let parameters = estimate.unknowns().free().into_iter().filter(|p| p.row() == equation);
        let columns: Vec<DVector<f64>> = parameters.map(|parameter| of(&parameter)).collect();
        if !columns.is_empty() {
            let left = remainder(DMatrix::from_columns(&columns), missing.column(equation).into())?;
            missing.set_column(equation, &left);
        }
    }
    let sampling = force.sampling().with_len(intervals)?;
    Ok([Record::new(sampling, missing)?, Record::new(sampling, inertia)?])
}

/// Returns the remainder of a column once the others have been fitted to it.
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
    /// The velocities (intervals × n) that the states at the starts of the intervals lead to after
    /// `steps` steps of the force.
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
