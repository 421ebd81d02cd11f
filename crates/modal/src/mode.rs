//! Results of an identification: modes with standard errors, and rejected candidates.

use mechid_numerics::Uncertain;
use nalgebra::Complex;

/// Identified mode with standard errors.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedMode {
    /// Pole λ = −ζω₀ + jω₀√(1 − ζ²), in rad/s.
    pub pole: Complex<f64>,
    /// Undamped natural frequency |λ|/2π, in Hz.
    pub natural_frequency_hz: Uncertain,
    /// Damping ratio −Re λ/|λ|.
    pub damping_ratio: Uncertain,
    /// Covariance of natural frequency (Hz) and damping ratio.
    pub frequency_damping_covariance: f64,
    /// Shape at the outputs; its largest entry is 1.
    pub shape: Vec<Complex<f64>>,
    /// Standard errors of each entry of `shape`: the real part is the error of the real part, the
    /// imaginary part the error of the imaginary part.
    pub shape_standard_error: Vec<Complex<f64>>,
    /// Participation of each input: the residue of output i and input j is the product of shape
    /// entry i and participation j.
    pub participation: Vec<Complex<f64>>,
    /// Standard errors of the real and imaginary part of each participation.
    pub participation_standard_error: Vec<Complex<f64>>,
    /// Fraction of the power of this mode that the measured forces cause; `None` without measured
    /// forces.
    pub driven_share: Option<f64>,
    /// Ratio of unmeasured to measured force of this mode (root-mean-square, modal); `None` without
    /// measured forces.
    pub unmeasured_ratio: Option<f64>,
    /// Decrease of −2 log L due to this mode.
    pub gain: f64,
    /// `true` if the mode is within a few half-widths of an edge of the band.
    pub near_edge: bool,
}

impl IdentifiedMode {
    /// Returns the same mode with all standard errors multiplied by `scale`.
    #[must_use]
    pub fn with_error_scale(mut self, scale: f64) -> Self {
        self.natural_frequency_hz.standard_error *= scale;
        self.damping_ratio.standard_error *= scale;
        self.frequency_damping_covariance *= scale * scale;
        let errors = self.shape_standard_error.iter_mut();
        errors.chain(&mut self.participation_standard_error).for_each(|error| *error *= scale);
        self
    }

    /// Returns the residue of an output and an input: the numerator over (jω − λ) in the frequency
    /// response between them, without the delay of the output ([`ModalEstimate::delays`]).
    ///
    /// [`ModalEstimate::delays`]: crate::ModalEstimate::delays
    pub fn residue(&self, output: usize, input: usize) -> Complex<f64> {
        self.shape[output] * self.participation[input]
    }

    /// Returns the shape at the inputs, with a largest entry of 1. If the inputs are forces at
    /// points of one structure (roving hammer), the participations are, by reciprocity, the shape
    /// at these points.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), section 3.5 (a row of a response matrix is as good
    /// as a column).
    pub fn shape_at_inputs(&self) -> Vec<Complex<f64>> {
        let norm = |z: &&Complex<f64>| z.norm();
        let largest = self.participation.iter().max_by(|a, b| norm(a).total_cmp(&norm(b)));
        let scale = largest.copied().unwrap_or(Complex::new(1.0, 0.0));
        self.participation.iter().map(|value| value / scale).collect()
    }
}

/// Reason why a candidate was rejected.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum DropReason {
    /// The decrease of −2 log L is less than the penalty of the parameters of a mode.
    Insignificant {
        /// Decrease of −2 log L.
        gain: f64,
        /// Required decrease.
        required: f64,
    },
    /// The damping ratio is not significantly larger than zero, as for a sinusoid (for example
    /// mains hum). The mode is part of the model.
    UndeterminedDamping {
        /// Standard error of the damping ratio.
        standard_error: f64,
    },
    /// The damping is too large for a resonance: the root represents modes outside the band.
    TooDamped,
    /// The data do not determine this mode in addition to the other modes: the likelihood does not
    /// change along one direction of its parameters.
    Undetermined,
    /// The root is outside the band and is not part of the model: it is too far from the band,
    /// insignificant, or not determined by the data.
    OutsideBand,
    /// Another mode within a half-width has the same shape and participations.
    Twin {
        /// Natural frequency, in Hz, of the mode with the same shape and participations.
        other_hz: f64,
    },
    /// The unmeasured force on the mode is too large relative to the measured force.
    Undriven {
        /// Ratio of unmeasured to measured force.
        ratio: f64,
    },
    /// The mode is part of the model, but was not requested: other modes are nearer to the stated
    /// frequencies, or the stated number of modes is reached by modes that explain more.
    NotRequested,
}

impl DropReason {
    /// Returns the reason in a few words, without its numbers.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Insignificant { .. } => "not significant",
            Self::UndeterminedDamping { .. } => "damping not above zero",
            Self::Undetermined => "not determined by the data",
            Self::TooDamped => "too much damping for a mode",
            Self::OutsideBand => "outside of the band",
            Self::Twin { .. } => "the same as another mode",
            Self::Undriven { .. } => "driven by unmeasured forces",
            Self::NotRequested => "not requested",
        }
    }
}

/// Rejected candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DroppedCandidate {
    /// Natural frequency, in Hz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Reason for the rejection.
    pub reason: DropReason,
}

impl DroppedCandidate {
    /// Creates the description of the rejected candidate with this pole (rad/s).
    pub(crate) fn new(pole: Complex<f64>, reason: DropReason) -> Self {
        let size = pole.norm();
        Self { frequency_hz: size / std::f64::consts::TAU, damping_ratio: -pole.re / size, reason }
    }
}
