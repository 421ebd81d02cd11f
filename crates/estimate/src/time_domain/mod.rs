//! M, C and K from sampled displacement, velocity and force.
//!
//! From one sample to the next the state z = (x, ẋ) of a machine changes by z⁺ = Φ z + Γ F. Φ and Γ
//! are fitted by least squares, with every entry free. An assumption about the force between the
//! samples ([`Discretisation`]) converts them to M, C and K. A force that is identically zero is
//! omitted.
//!
//! | Discretisation | The force between samples | Error on noise-free data |
//! |---|---|---|
//! | [`Discretisation::Euler`] | any: ẋ is a difference quotient | ∝ Δt, often some per cent |
//! | [`Discretisation::ZeroOrderHold`] | held, as by a digital converter | none if it is held |
//! | [`Discretisation::FirstOrderHold`] | linear | none if it is linear; ∝ Δt² if it is smooth |
//!
//! If the acceleration is measured, too, [`equation_of_motion`] needs no discretisation.
//!
//! Displacement and velocity are regressors, so noise on them biases all these estimates. For noisy
//! periodic records use the [frequency domain](crate::frequency_domain).
//!
//! ```
//! use mechid_estimate::Unknowns;
//! use mechid_estimate::time_domain::TimeDomain;
//! use mechid_model::Discretisation;
//! use mechid_problems::{dissertation_sdof, exact_zoh_periodic};
//! use mechid_signal::{Extent, Record, Sampling};
//!
//! let machine = dissertation_sdof().system();
//! let force = Record::from_fn(Sampling::new(0.02, 64)?, |t| 50.0 * (9.0 * t * t).sin())?;
//! let motion = exact_zoh_periodic(&machine, &force)?;
//!
//! let unknowns = Unknowns::known_mass(machine.mass())?;
//! let euler = TimeDomain::new(Discretisation::Euler, Extent::WholePeriod);
//! let exact = TimeDomain::new(Discretisation::ZeroOrderHold, Extent::WholePeriod);
//! let k = |method: TimeDomain| -> Result<f64, Box<dyn std::error::Error>> {
//!     let fit = method.fit(motion.displacement(), motion.velocity(), &force, &unknowns)?;
//!     Ok(fit.estimate().parameter("k")?.value)
//! };
//! assert!((k(euler)? / 5000.0 - 1.0).abs() > 0.1);
//! assert!((k(exact)? / 5000.0 - 1.0).abs() < 1e-10);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod continuous;
mod direct;
mod fit;
mod transitions;

use mechid_model::Discretisation;
use mechid_signal::{Extent, Interpolation, Record};

pub use direct::equation_of_motion;
pub use fit::TimeDomainFit;
pub use transitions::Transitions;

use crate::{EstimateError, Unknowns};

/// A time-domain estimator: a discretisation and the extent of the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeDomain {
    discretisation: Discretisation,
    extent: Extent,
}

impl TimeDomain {
    /// Creates an estimator for records of this extent.
    pub fn new(discretisation: Discretisation, extent: Extent) -> Self {
        Self { discretisation, extent }
    }

    /// Assumption about the force between samples.
    pub fn discretisation(&self) -> Discretisation {
        self.discretisation
    }

    /// Extent of the records.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Fits one record: displacement (m), velocity (m/s) and force (N), samples × degrees of
    /// freedom on one time axis.
    ///
    /// # Errors
    /// [`EstimateError::Signal`] or [`NumericsError::Size`](mechid_numerics::NumericsError::Size)
    /// if the records do not belong together, and the errors of [`Transitions::fit`].
    pub fn fit(
        &self,
        displacement: &Record,
        velocity: &Record,
        force: &Record,
        unknowns: &Unknowns,
    ) -> Result<TimeDomainFit, EstimateError> {
        let sampling = displacement.sampling();
        let mut rows = Transitions::new(displacement.channels(), sampling.dt())?;
        rows.push(displacement, velocity, force, self.extent)?;
        rows.fit(self.discretisation, unknowns)
    }

    /// Fits displacement, velocity and force with `factor − 1` interpolated points in every
    /// interval: the step is `factor` times smaller. If the interpolation is correct, the bias of
    /// Euler's rule is also `factor` times smaller.
    ///
    /// Band-limited interpolation assumes that the record is one whole period; after any other
    /// interpolation the refined record is open.
    ///
    /// Interpolated points are not new measurements: all equations within one measured interval
    /// have the same disturbance. The residual variance, the standard errors and the degrees of
    /// freedom therefore count one equation per measured interval; otherwise the standard errors
    /// would be too small by √factor.
    ///
    /// # Errors
    /// As [`TimeDomain::fit`], and [`EstimateError::Signal`] if the record cannot be refined.
    ///
    /// # Source
    /// Dissertation Appendix B.
    pub fn fit_refined(
        &self,
        records: [&Record; 3],
        unknowns: &Unknowns,
        factor: usize,
        interpolation: Interpolation,
    ) -> Result<TimeDomainFit, EstimateError> {
        let dt = records[0].sampling().dt() / factor.max(1) as f64;
        let mut rows = Transitions::new(records[0].channels(), dt)?;
        rows.push_refined(records, self.extent, factor, interpolation)?;
        rows.fit(self.discretisation, unknowns)
    }
}
