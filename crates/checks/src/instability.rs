//! Free responses that grow.

use mechid_estimate::IdentifiedMode;
use mechid_model::EIGENVALUE_ROUNDING;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::finding::{Finding, PValue};

/// Tells whether a mode of the estimate grows; `None` if all decay, but for rounding and the modes of a
/// rigid body.
///
/// The p-value is the probability that an estimate grows as many standard errors in any of its modes
/// though the true modes persist without growing: one-sided, Student's t times the number of modes. Of a pair of real
/// eigenvalues of which one grows their product decides, which is the stiffness over the mass.
pub fn instability(modes: &[IdentifiedMode]) -> Option<Finding> {
    let largest = modes.iter().map(|mode| mode.mode.natural_frequency()).fold(0.0, f64::max);
    let grows = |mode: &&IdentifiedMode| {
        !mode.is_rigid_body && mode.growth_rate.value > EIGENVALUE_ROUNDING * largest
    };
    let p_value = |mode: &IdentifiedMode| {
        let mut rate = mode.growth_rate;
        if mode.partner.is_some() && mode.squared_frequency.value < 0.0 {
            // The product of the two is smooth where they meet in zero.
            rate = mode.squared_frequency;
            rate.value = -rate.value;
        }
        let alone = match (rate.value / rate.standard_error, rate.degrees_of_freedom) {
            (ratio, 1..) if ratio.is_finite() => {
                StudentsT::new(0.0, 1.0, rate.degrees_of_freedom as f64)
                    .expect("positive degrees of freedom")
                    .sf(ratio)
            }
            (ratio, _) if ratio == f64::INFINITY => 0.0,
            _ => 1.0,
        };
        (alone * modes.len() as f64).min(1.0)
    };
    let growing = modes.iter().enumerate().filter(|(_, mode)| grows(mode));
    let (index, mode) = growing.min_by(|(_, a), (_, b)| p_value(a).total_cmp(&p_value(b)))?;
    Some(Finding::Instability {
        mode: index,
        frequency_hz: mode.damped_frequency_hz.value,
        growth_rate: mode.growth_rate.value,
        standard_error: mode.growth_rate.standard_error,
        p_value: PValue::of(p_value(mode)),
    })
}
