//! Information of the measured channels on the force at each frequency.

use std::f64::consts::{PI, TAU};

use mechid_model::SecondOrderSystem;
use nalgebra::{Complex, DMatrix};

use crate::error::ForceError;
use crate::force_model::{ForceModel, LowPass};
use crate::limits;
use crate::measurement::Measurement;
use crate::transfer::Transfer;

/// The information HᴴH about the forces in the scaled channels, at frequencies from 0 to Nyquist.
pub(crate) struct ForceInformation {
    terms: Vec<Term>,
    channels: f64,
    dt: f64,
    /// Lowest frequency that a record of this length distinguishes from a constant force, in Hz; 0
    /// if the channels show a constant force.
    least_hz: f64,
}

/// Information of the measured channels on the forces, in one interval of angular frequencies.
struct Term {
    omega: f64,
    width: f64,
    /// HᴴH of the scaled channels; `None` at an undamped resonance, where the response is infinite
    /// and would show any force.
    information: Option<DMatrix<Complex<f64>>>,
}

/// Error variance that each force has after the measurement, by frequency.
pub(crate) struct ErrorSpectrum {
    /// Lower and upper end of each interval, in Hz.
    edges: Vec<[f64; 2]>,
    /// Error variance of each force in each interval, forces × intervals, in N².
    pub variance: DMatrix<f64>,
    /// True if the measurement determines every force in this interval better than the force model
    /// does.
    is_determined: Vec<bool>,
    least_hz: f64,
}

impl ForceInformation {
    pub fn new(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        scale: &[f64],
    ) -> Result<Self, ForceError> {
        let sampling = measured.sampling();
        let transfer = Transfer { system, channels: measured.channels(), forced, scale };
        let (count, nyquist) =
            (sampling.len().min(limits::INFORMATION_FREQUENCIES), PI / sampling.dt());
        // The frequencies are half a line spacing apart if there are few lines; otherwise they
        // become denser towards 0.
        let lowest = 0.5 * sampling.omega0();
        let bend = if sampling.len() > limits::INFORMATION_FREQUENCIES { 3 } else { 1 };
        let at = |i: usize| {
            let part = (i as f64 / count as f64).powi(bend);
            (part * nyquist).max(i as f64 * lowest / count as f64)
        };
        let terms = (0..count)
            .map(|i| {
                let (low, high) = (at(i), at(i + 1));
                let omega = 0.5 * (low + high);
                let information = transfer.scaled(0, omega).ok().map(|h| h.ad_mul(&h));
                Term { omega, width: high - low, information }
            })
            .collect();
        // A system without springs has no static response; its acceleration is used instead.
        let constant =
            transfer.scaled(0, 0.0).map_or(true, |h| h.column_iter().all(|f| f.camax() > 0.0));
        let least_hz =
            if constant { 0.0 } else { limits::SLOWEST_PERIODS * sampling.line_spacing_hz() };
        Ok(Self { terms, channels: scale.len() as f64, dt: sampling.dt(), least_hz })
    }

    /// Returns the root mean square of the response to force `f` alone, over time and all scaled
    /// channels; the force has the spectrum of this model.
    pub fn gain(&self, model: &ForceModel, process: &LowPass, f: usize) -> f64 {
        let shown = self.terms.iter().filter_map(|Term { omega, width, information }| {
            let power = information.as_ref()?[(f, f)].re / self.channels;
            Some(power * model.density(f, *omega, process) * width / PI)
        });
        shown.sum::<f64>().sqrt()
    }

    /// Returns the remaining uncertainty S_e = (S_f⁻¹ + Hᴴ S_n⁻¹ H)⁻¹ of each force, far from the
    /// ends of a record, for the spectrum S_f of a model and the spectrum S_n of a noise (in
    /// channel scales).
    ///
    /// # Source
    /// Wiener (1949), the smoother of stationary processes.
    pub fn errors(&self, model: &ForceModel, process: &LowPass, noise: f64) -> ErrorSpectrum {
        let forces = model.rms.len();
        let mut variance = DMatrix::zeros(forces, self.terms.len());
        let mut is_determined = Vec::with_capacity(self.terms.len());
        let mut edges = Vec::with_capacity(self.terms.len());
        for (i, Term { omega, width, information }) in self.terms.iter().enumerate() {
            edges.push([(omega - 0.5 * width) / TAU, (omega + 0.5 * width) / TAU]);
            let Some(information) = information else {
                is_determined.push(true);
                continue;
            };
            // If each force is divided by the root of its spectral density S_f, the spectral
            // density of its error is a diagonal entry of (I + D HᴴH D)⁻¹, with D² = S_f/S_n.
            let density: Vec<f64> =
                (0..forces).map(|f| model.density(f, *omega, process)).collect();
            let root = |f: usize| (density[f] / (noise * noise * self.dt)).sqrt();
            let mut matrix = information.map_with_location(|f, g, h| h * root(f) * root(g));
            (0..forces).for_each(|f| matrix[(f, f)] += 1.0);
            let inverse = matrix.lu().try_inverse();
            let remaining = |f: usize| inverse.as_ref().map_or(1.0, |inverse| inverse[(f, f)].re);
            is_determined.push((0..forces).all(|f| remaining(f) <= 0.5));
            for f in 0..forces {
                variance[(f, i)] = remaining(f).clamp(0.0, 1.0) * density[f] * width / PI;
            }
        }
        ErrorSpectrum { edges, variance, is_determined, least_hz: self.least_hz }
    }
}

impl ErrorSpectrum {
    /// Returns the frequency, in Hz, below which the noise of the channels exceeds the force; 0 if
    /// the channels show even a constant force, `None` if they show the force at no frequency.
    pub fn lowest_hz(&self) -> Option<f64> {
        let first = self.is_determined.iter().position(|is| *is)?;
        Some(self.edges[first][0].max(self.least_hz))
    }

    /// Returns the mean square rate of change of the error of force `f` below a frequency, in
    /// N²/s².
    pub fn rate_below(&self, f: usize, low_hz: f64) -> f64 {
        let parts = self.edges.iter().enumerate().map(|(i, [from, to])| {
            let inside = (to.min(low_hz) - from).max(0.0) / (to - from);
            (PI * (from + to)).powi(2) * self.variance[(f, i)] * inside
        });
        parts.sum()
    }

    /// Returns the error variance of force `f` between two frequencies, in N².
    pub fn within(&self, f: usize, [low_hz, high_hz]: [f64; 2]) -> f64 {
        let parts = self.edges.iter().enumerate().map(|(i, [from, to])| {
            let inside = (to.min(high_hz) - from.max(low_hz)).max(0.0);
            self.variance[(f, i)] * inside / (to - from)
        });
        parts.sum()
    }
}
