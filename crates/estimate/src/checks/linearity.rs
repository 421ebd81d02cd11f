//! Whether what a fit leaves goes with the square or the cube of the motion.

use mechid_model::ResponseQuantity;
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ContinuousCDF, Normal};

use super::after::{SIGNIFICANT, p_told};
use super::{Check, Subject, Verdict};
use crate::{Estimate, EstimateError, predict_periodic};

/// The powers of the displacement that are looked for, and what they are called.
const POWERS: [(i32, &str); 2] = [(2, "square"), (3, "cube")];

/// Whether the motion (samples × degrees of freedom) that a machine leaves unexplained under a random
/// force (N) goes with the square or the cube of its displacement, between two frequencies in Hz.
///
/// Frequency responses do not show that: under a random force a spring that hardens looks like a
/// stiffer one with more noise. So the displacement is predicted over the whole record, and its square
/// and its cube, less what is proportional to it, are taken as forces at each degree of freedom in
/// turn. What they would do must have nothing in common with the residual. In the noise of a linear
/// machine it has not; a random force that is Gaussian keeps errors of the linear model out of it, too.
///
/// # Errors
/// As [`predict_periodic`], and [`EstimateError::Undetermined`] if the estimate is no machine.
///
/// # Source
/// Bendat, *Nonlinear System Techniques and Applications* (1998), for the powers less their linear
/// part; Adams & Allemang (2000), Mechanical Systems and Signal Processing 14, 637–656, for the
/// nonlinearity as a force.
pub fn linearity(
    estimate: &Estimate,
    force: &Record,
    motion: &Record,
    measured: ResponseQuantity,
    band_hz: [f64; 2],
) -> Result<Check, EstimateError> {
    force.check_same_sampling(motion)?;
    let system = estimate.system()?;
    let (n, predicted) = (system.dof(), predict_periodic(&system, force)?);
    let spectra = [force, motion].map(Spectrum::of);
    let inside = |line: &usize| {
        let hz = *line as f64 * force.sampling().line_spacing_hz();
        band_hz[0] <= hz && hz <= band_hz[1] && 2 * line < force.len()
    };
    let lines: Vec<usize> = (1..spectra[0].len()).filter(inside).collect();
    let mut responses = Vec::with_capacity(lines.len());
    let mut left = DMatrix::zeros(n, lines.len());
    for (at, line) in lines.iter().enumerate() {
        let omega = spectra[0].omega(*line);
        let response = system.receptance(omega)? * measured.per_displacement(omega);
        let [f, x] = [0, 1].map(|s| spectra[s].lines().row(*line).transpose());
        left.set_column(at, &(x - &response * f));
        responses.push(response);
    }
    let mut strongest = Common { p_value: 1.0, power: POWERS[0].1, dof: 0 };
    for dof in 0..n {
        for (power, name) in POWERS {
            let forces = without_linear_part(predicted.displacement(), dof, power)?;
            let forces = Spectrum::of(&forces);
            let did = |at: usize| responses[at].column(dof) * forces.line(lines[at], 0);
            let effects = DMatrix::from_columns(&(0..lines.len()).map(did).collect::<Vec<_>>());
            let p_value = in_common(&left, &effects);
            if p_value < strongest.p_value {
                strongest = Common { p_value, power: name, dof };
            }
        }
    }
    Ok(strongest.check(n * POWERS.len()))
}

/// A power of a displacement, and how likely noise has as much in common with it.
struct Common {
    p_value: f64,
    power: &'static str,
    dof: usize,
}

impl Common {
    /// The most conspicuous of so many.
    fn check(self, of: usize) -> Check {
        // Each of them may be so by chance.
        let value = (of as f64 * self.p_value).min(1.0);
        let (power, number) = (self.power, self.dof + 1);
        let (verdict, text) = match value < SIGNIFICANT {
            false => (
                Verdict::Good,
                format!(
                    "the residual has nothing in common with what the square and the cube of the \
                     displacement would do as forces, {}",
                    p_told(value)
                ),
            ),
            true => (
                Verdict::Doubtful,
                format!(
                    "the residual goes with what the {power} of displacement {number} would do as a \
                     force, {}: the machine is not linear at this level of the force; its parameters \
                     belong to it",
                    p_told(value)
                ),
            ),
        };
        Check { subject: Subject::Linearity, verdict, value, text }
    }
}

/// A power of a channel, its mean and what is proportional to the channel taken away.
fn without_linear_part(
    displacement: &Record,
    dof: usize,
    power: i32,
) -> Result<Record, EstimateError> {
    let x = displacement.without_mean().channel(dof).to_vec();
    let size = (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
    let x: Vec<f64> = x.iter().map(|x| if size > 0.0 { x / size } else { 0.0 }).collect();
    let linear = x.iter().map(|x| x.powi(power + 1)).sum::<f64>() / x.len() as f64;
    let values = x.iter().map(|x| x.powi(power) - linear * x).collect();
    Ok(Record::from_channel(displacement.sampling(), values)?.without_mean())
}

/// The probability that noise of the spectrum of `left` (channels × lines) has as much in common with
/// the effects, each channel relative to its size.
fn in_common(left: &DMatrix<Complex<f64>>, effects: &DMatrix<Complex<f64>>) -> f64 {
    let (mut product, mut variance) = (0.0, 0.0);
    for (e, g) in left.row_iter().zip(effects.row_iter()) {
        let size = e.norm_squared();
        if size > 0.0 {
            product += e.dotc(&g).re / size;
            let lines = e.iter().zip(g.iter());
            let squares = lines.map(|(e, g)| 0.5 * e.norm_sqr() * g.norm_sqr());
            variance += squares.sum::<f64>() / (size * size);
        }
    }
    if variance > 0.0 {
        let normal = Normal::standard();
        2.0 * normal.sf(product.abs() / variance.sqrt())
    } else {
        1.0
    }
}
