//! Test of a delay between force and response at a driving point.

use std::f64::consts::SQRT_2;

use mechid_io::derivative;
use mechid_modal::{DrivingPoint, IdentifiedMode};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::super::sources::Output;
use super::driving_point::{relative_error, turned_residue};
use super::tested::Tested;
use crate::text::significant;

/// Phase of the residue of a mode at a driving point.
struct Phase {
    /// Imaginary part of the pole, in rad/s.
    omega: f64,
    /// Damping ratio.
    damping_ratio: f64,
    /// Phase of the product of the residue and 2jω_d, in rad.
    phase: f64,
    /// Variance of `phase` due to the errors of the mode, in rad².
    variance: f64,
}

/// Returns, for each driving point with at least two modes, the test of a delay. A delay makes the
/// phases of the residues proportional to the frequency. Delays above half a period of a mode are
/// not found.
///
/// Modes can also be complex, with phases that differ from mode to mode. The scatter about the
/// proportional phases estimates the effects of the errors and of complex modes together.
pub(super) fn tests(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    driving_points: &[DrivingPoint],
) -> Vec<Tested> {
    let test = |&DrivingPoint { output, input, .. }: &DrivingPoint| {
        let power = derivative(outputs[output].quantity?) as i32;
        let residue = |mode: &IdentifiedMode| turned_residue(mode, output, input, power);
        // Another check reports a wrong sign of a channel, so the sign is corrected here.
        let negative = modes.iter().filter(|mode| residue(mode).re < 0.0).count();
        let sign = if 2 * negative > modes.len() { -1.0 } else { 1.0 };
        let phase = |mode: &IdentifiedMode| Phase {
            omega: mode.pole.im,
            damping_ratio: mode.damping_ratio.value,
            phase: (residue(mode) * sign).arg(),
            variance: (relative_error(mode, output, input) / SQRT_2).powi(2),
        };
        let phases: Vec<Phase> = modes.iter().map(phase).collect();
        let Delay { seconds, p_value } = delay(&phases)?;
        let direction = if seconds > 0.0 { "late" } else { "early" };
        let size = significant(1e3 * seconds.abs(), 3);
        Some(Tested {
            code: "delay",
            p_value,
            passes: format!(
                "the phases of the modes show no delay between force {} and {}",
                inputs[input], outputs[output].name
            ),
            fails: format!(
                "{} is {size} ms {direction} relative to force {}: at this point the phases of the modes are \
                 proportional to the frequency; a filter or a scanning converter delays one of \
                 the two channels",
                outputs[output].name, inputs[input]
            ),
        })
    };
    driving_points.iter().filter_map(test).collect()
}

/// Delay of a response.
struct Delay {
    /// Delay, in s.
    seconds: f64,
    /// Probability of an estimated delay at least as large as this one if there is no delay.
    p_value: f64,
}

/// Returns the delay that explains the phases best; `None` with fewer than two phases.
///
/// Without a delay the phases scatter about zero (viscous damping), about −ζ (structural damping),
/// or between the two. The p-value is the larger of the p-values for viscous and for structural
/// damping. It is 1 if these two cases give delays of opposite signs.
fn delay(phases: &[Phase]) -> Option<Delay> {
    let viscous = delay_about(phases, |_| 0.0)?;
    let structural = delay_about(phases, |phase| -phase.damping_ratio)?;
    let one_sign = viscous.seconds * structural.seconds > 0.0;
    let p_value = if one_sign { viscous.p_value.max(structural.p_value) } else { 1.0 };
    Some(Delay { p_value, ..viscous })
}

/// Returns the delay for modes with an `expected` phase, in rad.
///
/// The scatter between the modes is estimated by the method of moments and added to the variances
/// of the phases. The variance of the delay is computed from the residuals; if the variance that
/// follows from the weights is larger, the larger variance is used.
///
/// # Source
/// Knapp & Hartung (2003), Statistics in Medicine 22, 2693–2710.
fn delay_about(phases: &[Phase], expected: impl Fn(&Phase) -> f64) -> Option<Delay> {
    let freedom = phases.len().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    let fit = |between: f64| Proportional::new(phases, &expected, between);
    let fixed = fit(0.0);
    let between = ((fixed.square - freedom) / fixed.expected_square).max(0.0);
    let fitted = fit(between);
    let deviation = (fitted.variance * (fitted.square / freedom).max(1.0)).sqrt();
    let ratio = (fitted.delay / deviation).abs();
    let distribution = StudentsT::new(0.0, 1.0, freedom).ok()?;
    let p_value = 2.0 * distribution.sf(ratio);
    ratio.is_finite().then_some(Delay { seconds: fitted.delay, p_value })
}

/// Weighted fit of phases that are proportional to the frequency.
struct Proportional {
    /// Delay, in s.
    delay: f64,
    /// Variance of the delay, in s², if the variances that weight the phases are correct.
    variance: f64,
    /// Weighted sum of the squared residuals.
    square: f64,
    /// Derivative of the expected value of `square` with respect to a variance between the modes,
    /// in 1/rad²; the weights are constant.
    expected_square: f64,
}

impl Proportional {
    /// Fits the phases; the variance `between` the modes, in rad², is added to the variance of each
    /// phase.
    fn new(phases: &[Phase], expected: impl Fn(&Phase) -> f64, between: f64) -> Self {
        let weight = |p: &Phase| 1.0 / (p.variance + between);
        let sum = |term: &dyn Fn(&Phase) -> f64| -> f64 { phases.iter().map(term).sum() };
        let information = sum(&|p| weight(p) * p.omega.powi(2));
        let lag = |p: &Phase| expected(p) - p.phase;
        let delay = sum(&|p| weight(p) * p.omega * lag(p)) / information;
        Self {
            delay,
            variance: 1.0 / information,
            square: sum(&|p| weight(p) * (lag(p) - delay * p.omega).powi(2)),
            expected_square: sum(&|p| {
                weight(p) * (1.0 - weight(p) * p.omega.powi(2) / information)
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use rand::SeedableRng;
    use rand_chacha::ChaCha20Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Natural frequency (Hz), damping ratio, and standard deviation of the phase error (rad) of
    /// each simulated mode.
    const MODES: [(f64, f64, f64); 6] = [
        (10.0, 0.02, 1e-4),
        (23.0, 0.02, 1e-3),
        (31.0, 0.01, 2e-4),
        (55.0, 0.02, 1e-2),
        (80.0, 0.01, 3e-4),
        (121.0, 0.02, 1e-3),
    ];

    /// Returns simulated phases: each is the sum of the phase of the `delay` (s), of −`structural`
    /// · ζ, of the error of the mode, and of a scatter with the standard deviation `between` (rad).
    fn phases(delay: f64, structural: f64, between: f64, rng: &mut ChaCha20Rng) -> Vec<Phase> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut phase = |(hz, damping_ratio, error): (f64, f64, f64)| {
            let omega = TAU * hz;
            let scatter = error * normal() + between * normal();
            let phase = -delay * omega - structural * damping_ratio + scatter;
            Phase { omega, damping_ratio, phase, variance: error * error }
        };
        MODES.map(&mut phase).into()
    }

    /// The test must not report a delay too often: without a delay, at most about 5 % of the
    /// p-values are below 5 %. This is tested for real and complex modes, with viscous damping,
    /// structural damping, and half of each.
    #[test]
    fn p_values_are_right_with_complex_modes() {
        let mut rng = ChaCha20Rng::seed_from_u64(1);
        for structural in [0.0, 0.5, 1.0] {
            for between in [0.0, 3e-3, 0.1] {
                let mut is_small =
                    || delay(&phases(0.0, structural, between, &mut rng)).unwrap().p_value < 0.05;
                let count = (0..2000).filter(|_| is_small()).count();
                assert!(count <= 140, "{structural} {between}: {count}");
            }
        }
    }

    /// Equal phases at neighbouring frequencies may be due to a delay or to structural damping. The
    /// test with viscous damping alone reports a delay; the complete test does not.
    #[test]
    fn structural_damping_in_a_narrow_band_is_no_delay() {
        let mut rng = ChaCha20Rng::seed_from_u64(3);
        let mut phase = |hz: f64| {
            let scatter: f64 = StandardNormal.sample(&mut rng);
            let phase = -0.02 + 1e-4 * scatter;
            Phase { omega: TAU * hz, damping_ratio: 0.02, phase, variance: 1e-8 }
        };
        let phases: Vec<Phase> = [100.0, 108.0, 115.0, 126.0, 137.0].map(&mut phase).into();
        assert!(delay_about(&phases, |_| 0.0).unwrap().p_value < 1e-3);
        assert!(delay(&phases).unwrap().p_value > 0.05);
    }

    #[test]
    fn a_delay_is_found() {
        let mut rng = ChaCha20Rng::seed_from_u64(2);
        for structural in [0.0, 0.5, 1.0] {
            for between in [0.0, 3e-3] {
                let all = phases(5e-4, structural, between, &mut rng);
                let Delay { seconds, p_value } = delay(&all).unwrap();
                assert!((seconds - 5e-4).abs() < 1e-4 && p_value < 1e-3, "{seconds} {p_value}");
                assert!(delay(&all[..1]).is_none());
            }
        }
    }
}
