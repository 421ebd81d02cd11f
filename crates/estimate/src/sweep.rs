//! One estimator over a range of settings, such as time steps, and the best setting.

use mechid_model::SecondOrderSystem;
use rayon::prelude::*;

use crate::Estimate;

/// Outcome of the estimator at one setting of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPoint<S, E> {
    /// Setting, such as a time step or a number of natural periods per record (NPI).
    pub setting: S,
    /// The estimate with its intervals, or the error.
    pub outcome: Result<Estimate, E>,
    /// Relative error of the outcome, a pure number; `None` if there is no complete estimate.
    ///
    /// With a reference it is the largest error of an entry of M, C or K, relative to the largest
    /// entry of the matrix that has this entry. Without a reference, standard errors replace the
    /// errors; standard errors do not include bias.
    pub error: Option<f64>,
}

/// All points of a sweep, in the order of the settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep<S, E> {
    points: Vec<SweepPoint<S, E>>,
}

/// Runs `estimate` at every setting, in parallel, and rates the results.
///
/// The result does not depend on the number of threads. `progress` is called after every setting,
/// from any thread, with the number of settings done.
///
/// ```
/// use mechid_estimate::time_domain::TimeDomain;
/// use mechid_estimate::{Unknowns, sweep};
/// use mechid_model::{Discretisation, npi_sampling};
/// use mechid_problems::{dissertation_sdof, exact_zoh_periodic};
/// use mechid_signal::{Extent, Multisine, Phases};
///
/// let machine = dissertation_sdof();
/// let system = machine.system();
/// let unknowns = Unknowns::known_mass(system.mass())?;
/// let euler = TimeDomain::new(Discretisation::Euler, Extent::WholePeriod);
/// let settings: Vec<f64> = (1..=8).map(f64::from).collect();
/// let points = sweep(&settings, Some(&system), |npi| {
///     let sampling = npi_sampling(*npi, 256, machine.natural_frequency())?;
///     let force = Multisine::flat(1..=127, 50.0, Phases::Schroeder)?.sample(sampling)?;
///     let motion = exact_zoh_periodic(&system, &force)?;
///     let fit = euler.fit(motion.displacement(), motion.velocity(), &force, &unknowns)?;
///     Ok::<_, Box<dyn std::error::Error + Send + Sync>>(fit.into_estimate())
/// }, |_done| {});
/// assert_eq!(points.best().map(|point| point.setting), Some(1.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn sweep<S, E>(
    settings: &[S],
    reference: Option<&SecondOrderSystem>,
    estimate: impl Fn(&S) -> Result<Estimate, E> + Sync,
    progress: impl Fn(usize) + Sync,
) -> Sweep<S, E>
where
    S: Clone + Send + Sync,
    E: Send,
{
    let done = std::sync::atomic::AtomicUsize::new(0);
    let point = |setting: &S| {
        let outcome = estimate(setting);
        let error = outcome.as_ref().ok().and_then(|estimate| rate(estimate, reference));
        progress(1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed));
        SweepPoint { setting: setting.clone(), outcome, error }
    };
    Sweep { points: settings.par_iter().map(point).collect() }
}

impl<S, E> Sweep<S, E> {
    /// Every setting, in the order given.
    pub fn points(&self) -> &[SweepPoint<S, E>] {
        &self.points
    }

    /// Returns the point with the smallest error; if several points have this error, the first of
    /// them. `None` if no setting has a complete estimate.
    pub fn best(&self) -> Option<&SweepPoint<S, E>> {
        let rated = self.points.iter().filter_map(|point| Some((point, point.error?)));
        rated.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(point, _)| point)
    }
}

fn rate(estimate: &Estimate, reference: Option<&SecondOrderSystem>) -> Option<f64> {
    estimate.system().ok()?;
    let [mass, damping, stiffness] = [estimate.mass(), estimate.damping(), estimate.stiffness()];
    let error = match reference {
        Some(system) => {
            [(&mass, system.mass()), (&damping, system.damping()), (&stiffness, system.stiffness())]
                .iter()
                .map(|(estimate, known)| {
                    (*estimate - *known).amax() / known.amax().max(f64::MIN_POSITIVE)
                })
                .fold(0.0, f64::max)
        }
        None => estimate
            .parameters()
            .map(|p| {
                let whole = match p.parameter.matrix() {
                    mechid_model::Matrix::Mass => &mass,
                    mechid_model::Matrix::Damping => &damping,
                    mechid_model::Matrix::Stiffness => &stiffness,
                };
                p.standard_error / whole.amax().max(f64::MIN_POSITIVE)
            })
            .fold(0.0, f64::max),
    };
    error.is_finite().then_some(error)
}
