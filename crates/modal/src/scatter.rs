//! Scatter of the residual along the shapes of the modes, relative to the scatter from independent
//! sensor noise.

use mechid_spectra::LineData;
use nalgebra::Complex;

use crate::limits::LEAST_SCATTER_LINES;
use crate::{IdentifiedMode, ModalError, ModalEstimate};

impl ModalEstimate {
    /// Returns, for each mode, a ratio of powers near its resonance: the residual power along its
    /// shape, divided by the mean power from independent noise of the outputs and from the
    /// unmeasured force on the mode. The ratio is corrected for the residual power that the
    /// unknowns of the fit absorb. It is `None` with too few lines at the resonance.
    ///
    /// Leakage of averaged responses has the same relative effect on all outputs, along the shape
    /// of the mode. In this case the variance of frequency and damping ratio is this ratio times
    /// the variance for independent outputs.
    ///
    /// # Errors
    /// As [`ModalEstimate::synthesis`].
    ///
    /// # Source
    /// White (1980), Econometrica 48, 817–838 (variance from the residuals).
    pub fn scatter_along_shapes(&self, data: &LineData) -> Result<Vec<Option<f64>>, ModalError> {
        let residual = data.outputs() - self.synthesis(data)?;
        let noise = self.noise_spectra();
        let ratio = |(mode, unmeasured): (&IdentifiedMode, &f64)| {
            let (mut sum, mut weights, mut squares) = (0.0, 0.0, 0.0);
            for (row, omega) in data.omega().iter().enumerate() {
                let force: Complex<f64> = (0..data.inputs().ncols())
                    .map(|q| mode.participation[q] * data.inputs()[(row, q)])
                    .sum();
                let gain = (Complex::new(0.0, *omega) - mode.pole).norm_sqr().recip();
                let outputs = mode.shape.iter().enumerate();
                let along: Complex<f64> = outputs
                    .clone()
                    .map(|(k, shape)| shape.conj() * residual[(row, k)] / noise[k][row])
                    .sum();
                let size: f64 = outputs.map(|(k, shape)| shape.norm_sqr() / noise[k][row]).sum();
                // Information of the line about the pole.
                let weight = force.norm_sqr() * gain * gain * size;
                sum += weight * along.norm_sqr() / (size * (1.0 + unmeasured * gain * size));
                weights += weight;
                squares += weight * weight;
            }
            let lines = weights * weights / squares;
            // The fit of the pole and of the scale of the shape uses two complex degrees of
            // freedom.
            (lines > LEAST_SCATTER_LINES).then(|| sum / weights / (1.0 - 2.0 / lines))
        };
        Ok(self.modes().iter().zip(self.unmeasured_variance()).map(ratio).collect())
    }
}
