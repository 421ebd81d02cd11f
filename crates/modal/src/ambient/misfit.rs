//! Test whether the fitted spectrum describes the record at all frequencies.

use std::f64::consts::TAU;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::likelihood::{noise, positive_factor};
use super::limits::MISFIT_GROUP;
use super::lines::PooledLines;
use super::parameters::{Parameters, Span};
use super::spectrum::Coefficients;

/// Power of the record relative to the fitted spectrum, over the band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectrumMisfit {
    /// Sum of squares of the normal deviates of the groups of lines.
    pub statistic: f64,
    /// Number of groups of lines.
    pub groups: usize,
    /// Probability of a larger statistic if the spectrum is right.
    pub p_value: f64,
    /// Lowest and highest frequency of the group with the largest deviate, in Hz.
    pub worst_hz: [f64; 2],
    /// Power of the group with the largest deviate, relative to the fitted spectrum.
    pub worst_ratio: f64,
}

impl SpectrumMisfit {
    /// Returns the factor for standard errors due to the misfit, a pure number; it is 1 if the
    /// statistic is at most its expected value.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    pub fn error_scale(&self) -> f64 {
        (self.statistic / self.groups.max(1) as f64).sqrt().max(1.0)
    }
}

/// A group of neighbouring lines.
#[derive(Clone, Copy)]
struct Group {
    omega: [f64; 2],
    /// Number of squared amplitudes: lines times outputs.
    count: f64,
    /// Sum of Yᴴ S⁻¹ Y, whose expectation is `count`.
    power: f64,
}

impl Group {
    /// Returns the normal deviate with the same probability as the power, which has the gamma
    /// distribution with the shape `count`.
    ///
    /// # Source
    /// Wilson & Hilferty (1931), Proceedings of the National Academy of Sciences 17, 684–688.
    fn deviate(&self) -> f64 {
        let ninth = 1.0 / (9.0 * self.count);
        ((self.power / self.count).cbrt() - 1.0 + ninth) / ninth.sqrt()
    }
}

/// Compares the power of the lines with the spectrum S of the parameters, in groups of at least
/// [`MISFIT_GROUP`] squared amplitudes; `None` where S is not positive definite.
///
/// # Source
/// Yᴴ S⁻¹ Y of a line has the gamma distribution with the number of outputs as shape: Brillinger,
/// *Time Series: Data Analysis and Theory* (2001), section 4.4.
pub(super) fn misfit(
    parameters: &Parameters,
    lines: &[PooledLines],
    span: Span,
) -> Option<SpectrumMisfit> {
    let coefficients = Coefficients::new(parameters);
    let outputs = parameters.layout.outputs as f64;
    let mut groups: Vec<Group> = Vec::new();
    for line in lines {
        let kernels = coefficients.kernels(line.omega, span);
        let spectrum = coefficients.spectrum(&kernels, &noise(parameters, &line.terms));
        let power = positive_factor(spectrum)?.solve(&line.periodogram).trace().re;
        let (count, power) = (outputs * line.count, line.count * power);
        match groups.last_mut().filter(|group| group.count < MISFIT_GROUP) {
            Some(group) => {
                group.omega[1] = line.omega;
                group.count += count;
                group.power += power;
            }
            None => groups.push(Group { omega: [line.omega; 2], count, power }),
        }
    }
    let statistic: f64 = groups.iter().map(|group| group.deviate().powi(2)).sum();
    let size = |group: &&Group| group.deviate().abs();
    let worst = groups.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let p_value = ChiSquared::new(groups.len() as f64).ok()?.sf(statistic);
    Some(SpectrumMisfit {
        statistic,
        groups: groups.len(),
        p_value,
        worst_hz: worst.omega.map(|omega| omega / TAU),
        worst_ratio: worst.power / worst.count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The deviate of a gamma quantile is nearly the normal quantile of the same probability.
    /// Reference: quantiles of the gamma distribution with shape 64 at probabilities of 1, 50, 99
    /// and 99.9 % (`gamma.ppf` of SciPy).
    #[test]
    fn deviates_of_a_gamma_variable_are_normal() {
        let quantiles = [
            (46.87040639, -2.32635),
            (63.66697707, 0.0),
            (84.06660153, 2.32635),
            (91.5932187, 3.09023),
        ];
        for (power, exact) in quantiles {
            let deviate = Group { omega: [0.0; 2], count: 64.0, power }.deviate();
            assert!((deviate - exact).abs() < 5e-3, "{power}: {deviate}");
        }
    }
}
