//! Operator of a whole period: one small problem per line.

use mechid_model::SecondOrderSystem;
use mechid_numerics::linear_algebra::svd;
use mechid_signal::{Sampling, Spectrum};
use nalgebra::{Complex, DMatrix, DVector};

use crate::band::{empty_band, is_within};
use crate::components::{Components, Operator};
use crate::error::ForceError;
use crate::lines::{check_lines, noise_weight};
use crate::measurement::Measurement;
use crate::transfer::Transfer;

/// Operator of a whole period. Amplitudes are scaled by √(N/2), at DC by √N: white noise of
/// variance σ² in time then has the variance σ² in each real part, and ‖F‖² is the same in time and
/// over the lines.
pub(crate) struct PeriodOperator {
    components: Components,
    /// Line, coefficient and force shape of each component.
    places: Vec<Place>,
    sampling: Sampling,
    forces: usize,
}

struct Place {
    line: usize,
    /// Undamped coefficient of the force: y_i with its phase, divided by s_i.
    coefficient: Complex<f64>,
    shape: DVector<Complex<f64>>,
}

impl PeriodOperator {
    pub fn new(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        lines: &[usize],
        scale: &[f64],
    ) -> Result<Self, ForceError> {
        let spectrum = Spectrum::from_record(measured.record());
        check_lines(&spectrum, lines)?;
        let sampling = measured.sampling();
        let transfer = Transfer { system, channels: measured.channels(), forced, scale };
        let mut terms = Vec::new();
        let (mut outside_energy, mut outside_weight) = (0.0, 0.0);
        for &n in lines {
            let unit = noise_weight(sampling.len(), n).sqrt();
            let weight = if unit * unit * sampling.len() as f64 > 1.5 { 2.0 } else { 1.0 };
            let svd = svd(transfer.scaled(n, spectrum.omega(n))?)?;
            let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
            let data =
                DVector::from_fn(scale.len(), |c, _| spectrum.line(n, c) / (scale[c] * unit));
            let parts = u.ad_mul(&data);
            outside_energy += (data.norm_squared() - parts.norm_squared()).max(0.0);
            outside_weight += weight * (scale.len() - parts.len()) as f64;
            for (i, part) in parts.iter().enumerate() {
                let s = svd.singular_values[i];
                let coefficient = if s > 0.0 { part / s } else { Complex::ZERO };
                let shape = v_t.row(i).adjoint();
                terms.push((s, part.norm_sqr(), weight, Place { line: n, coefficient, shape }));
            }
        }
        terms.sort_by(|a, b| b.0.total_cmp(&a.0));
        let components = Components {
            singular: terms.iter().map(|term| term.0).collect(),
            energy: terms.iter().map(|term| term.1).collect(),
            frequency: terms.iter().map(|term| frequency(term.3.line, sampling.len())).collect(),
            lowest_hz: terms
                .iter()
                .map(|term| (term.3.line as f64 - 0.5).max(0.0) * sampling.line_spacing_hz())
                .collect(),
            weight: terms.iter().map(|term| term.2).collect(),
            outside_energy,
            outside_weight,
        };
        let places = terms.into_iter().map(|term| term.3).collect();
        Ok(Self { components, places, sampling, forces: forced.len() })
    }
}

/// Returns the frequency of a line as a line number: N/2π times the RMS change from sample to
/// sample, relative to the RMS value, with N samples per period. Line 0 has the frequency of line
/// 1: the mean is assumed to be as strong as the first line.
fn frequency(line: usize, len: usize) -> f64 {
    let half = std::f64::consts::PI / len as f64;
    (half * line.max(1) as f64).sin() / half
}

impl Operator for PeriodOperator {
    fn components(&self) -> &Components {
        &self.components
    }

    fn force(&self, factors: &[f64]) -> Result<DMatrix<f64>, ForceError> {
        let mut lines = DMatrix::zeros(self.sampling.lines(), self.forces);
        for (place, factor) in self.places.iter().zip(factors) {
            let unit = factor * noise_weight(self.sampling.len(), place.line).sqrt();
            for (f, shape) in place.shape.iter().enumerate() {
                lines[(place.line, f)] += shape * place.coefficient * unit;
            }
        }
        Ok(Spectrum::from_lines(self.sampling, lines)?.to_record()?.into_data())
    }

    fn keep(&mut self, band_hz: [f64; 2]) -> Result<(), ForceError> {
        let spacing = self.sampling.line_spacing_hz();
        let mut is_in_band = false;
        for place in &mut self.places {
            let inside = is_within(band_hz, place.line as f64 * spacing, spacing);
            is_in_band |= inside;
            if !inside {
                place.shape.fill(Complex::ZERO);
            }
        }
        if is_in_band { Ok(()) } else { Err(empty_band(band_hz, self.sampling)) }
    }

    fn variance(&self, components: &[f64]) -> DMatrix<f64> {
        let mut sums = vec![0.0; self.forces];
        for (place, variance) in self.places.iter().zip(components) {
            let unit = variance * noise_weight(self.sampling.len(), place.line);
            for (sum, shape) in sums.iter_mut().zip(&place.shape) {
                *sum += unit * shape.norm_sqr();
            }
        }
        DMatrix::from_fn(self.sampling.len(), self.forces, |_, f| sums[f])
    }
}
