//! Settings of an identification, as values that can be saved and repeated.

use std::fmt;
use std::str::FromStr;

use mechid_estimate::derivatives::SavitzkyGolay;
use mechid_model::{Discretisation, Terms};
use mechid_nonlinear::{Criterion, ShapeConstants, Weighting};
use mechid_signal::{Extent, HitRule, Interpolation};
use mechid_spectra::Pooling;
use serde::{Deserialize, Serialize};

use super::left_out::LeftOut;
use super::lines::LineChoice;
use super::mass::KnownMass;
use super::structure::Structure;
use crate::AnalysisError;
use crate::frf::{Estimator, Segmentation};

/// Settings of an identification.
///
/// ```
/// use mechid_analysis::{Identify, identify::Method};
///
/// let how = Identify::spectra(Method::MaximumLikelihood);
/// let saved = serde_json::to_string(&how)?;
/// assert_eq!(serde_json::from_str::<Identify>(&saved)?, how);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Identify {
    /// Data that are fitted: spectra, averaged frequency responses, or samples.
    pub fit: Fit,
    /// Spectral lines to use, of spectra and frequency responses.
    pub lines: LineChoice,
    /// Spectral lines to leave out of these.
    pub without: LeftOut,
    /// Known masses.
    pub mass: KnownMass,
    /// Form of M, C and K, such as that of a chain.
    #[serde(skip_serializing_if = "Structure::is_empty")]
    pub structure: Structure,
    /// Rule by which the records of a hammer test are cut into hits, each of which is fitted as a record of
    /// its own; `None`: no hammer test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hits: Option<HitRule>,
    /// Nonlinear springs and dampers, fitted to the spectra of whole periods; `None`: a linear system.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinear: Option<Nonlinear>,
}

/// Data that are fitted, and the estimator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "domain", rename_all = "kebab-case")]
pub enum Fit {
    /// Spectral lines of whole periods.
    Spectra {
        /// Estimator; `None`: maximum likelihood where two periods or more show the noise or it biases least
        /// squares, otherwise least squares.
        #[serde(default)]
        method: Option<Method>,
        /// Spectrum of the noise that weighs maximum likelihood and by which the residual is tested: from
        /// the scatter of the periods or, of one period, from the residual.
        #[serde(default)]
        noise: Pooling,
        /// Extent of the window, for maximum likelihood: of an open record the loads of its ends are found
        /// with the machine. `None`: whole periods where a period is given; otherwise open if the ends show.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        extent: Option<Extent>,
        /// Standard deviation of the white noise on the samples of the force, in N, of records that do not show
        /// it by the scatter of periods, which are fitted as open ones then: one level for all forces, or one for
        /// each degree of freedom. `None`: of open records that above the band that the force drives, of hits
        /// that between them.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        force_noise: Option<Vec<f64>>,
    },
    /// Frequency responses, averaged over segments.
    Responses(ResponseFit),
    /// Samples in time, of any record.
    Samples(SampleFit),
}

impl Default for Fit {
    fn default() -> Self {
        Fit::Spectra { method: None, noise: Pooling::Automatic, extent: None, force_noise: None }
    }
}

/// Estimator of the parameters from spectra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Least squares on the equation of motion; biased by noise on the response.
    LeastSquares,
    /// Instrumental variables, one half of the periods against the other; not biased.
    Instrumental,
    /// Maximum likelihood on the response, weighted by the noise estimated from the periods; not
    /// biased, of least scatter.
    MaximumLikelihood,
}

/// Nonlinear springs and dampers to identify beside M, C and K.
///
/// ```
/// use mechid_analysis::identify::Nonlinear;
///
/// let springs: Nonlinear = "k2: x1^2, k3: x1^3".parse()?;
/// assert_eq!(springs.terms.len(), 2);
/// # Ok::<(), mechid_analysis::AnalysisError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Nonlinear {
    /// Terms as they are written, such as `k3: x1^3, c2: |v1| v1`.
    pub terms: Terms,
    /// Terms of which those are added that the data ask for; none by default.
    #[serde(skip_serializing_if = "Terms::is_empty")]
    pub candidates: Terms,
    /// Criterion by which a candidate is added.
    pub criterion: Criterion,
    /// Constants that do not enter linearly, to search for; none by default.
    pub search: ShapeConstants,
    /// Weighting of the lines.
    pub weighting: Weighting,
}

impl FromStr for Nonlinear {
    type Err = AnalysisError;

    fn from_str(text: &str) -> Result<Self, AnalysisError> {
        Ok(Self { terms: text.parse()?, ..Self::default() })
    }
}

/// Fit of averaged frequency responses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResponseFit {
    /// Frequency response estimator.
    pub estimator: Estimator,
    /// Segments that are averaged.
    pub segments: Segmentation,
    /// Estimator of the parameters; `None`: maximum likelihood, weighted by the coherence.
    pub method: Option<Method>,
}

/// Fit in the time domain.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SampleFit {
    /// Assumption on the force between samples; `None`: the equation of motion at the samples if
    /// there is an acceleration, otherwise linear.
    pub between_samples: Option<Discretisation>,
    /// Extent of the window; `None`: open, or whole periods with spectral derivatives.
    pub extent: Option<Extent>,
    /// Derivation of the velocity and acceleration that were not measured.
    pub derivatives: Option<Derivatives>,
    /// Steps between the samples.
    pub refine: Option<Refinement>,
}

/// Additional steps in every sampling interval, which make the error of a [`Discretisation`] smaller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refinement {
    /// Number of steps per interval.
    pub factor: usize,
    /// Interpolation between the samples.
    pub interpolation: Between,
}

/// Interpolation between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// Straight lines.
    Linear,
    /// A cubic spline.
    Spline,
    /// The Fourier series of the window, which must hold whole periods.
    BandLimited,
}

impl Between {
    fn interpolation(self) -> Interpolation {
        match self {
            Between::Linear => Interpolation::Linear,
            Between::Spline => Interpolation::NotAKnotSpline,
            Between::BandLimited => Interpolation::BandLimited,
        }
    }
}

/// Derivation of the kinds of response that were not measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Derivatives {
    /// Multiplication of the lines of whole periods by iω.
    Spectral,
    /// A sliding polynomial.
    SavitzkyGolay {
        /// Number of samples in the window, odd.
        window: usize,
        /// Order of the polynomial, at least 2 and less than the window.
        order: usize,
    },
}

impl Derivatives {
    /// Returns the sliding polynomial, if it is one.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if window and order do not make one.
    pub(crate) fn filter(self) -> Result<Option<SavitzkyGolay>, AnalysisError> {
        let Self::SavitzkyGolay { window, order } = self else { return Ok(None) };
        let wrong = |why: String| AnalysisError::Setting { setting: "derivatives", why };
        if window % 2 == 0 {
            return Err(wrong(format!(
                "the window has a middle: an odd number of samples, not {window}"
            )));
        }
        if order < 2 {
            return Err(wrong(format!(
                "two derivatives need a polynomial of order 2 or more, not {order}"
            )));
        }
        SavitzkyGolay::new(window / 2, order).map(Some).map_err(|error| wrong(error.to_string()))
    }

    /// Returns the number of samples in the sliding window; 0 where all samples are used at once.
    pub(crate) fn window(self) -> usize {
        match self {
            Self::Spectral => 0,
            Self::SavitzkyGolay { window, .. } => window,
        }
    }
}

impl FromStr for Derivatives {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "spectral" {
            return Ok(Self::Spectral);
        }
        let numbers: Option<Vec<usize>> = text
            .strip_prefix("savitzky-golay:")
            .and_then(|rest| rest.split(':').map(|n| n.parse().ok()).collect());
        let Some([window, order]) = numbers.as_deref() else {
            return Err("write spectral or savitzky-golay:WINDOW:ORDER, such as \
                        savitzky-golay:11:4"
                .into());
        };
        let parsed = Self::SavitzkyGolay { window: *window, order: *order };
        match parsed.filter() {
            Ok(_) => Ok(parsed),
            Err(AnalysisError::Setting { why, .. }) => Err(why),
            Err(other) => Err(other.to_string()),
        }
    }
}

impl fmt::Display for Derivatives {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spectral => f.write_str("spectral"),
            Self::SavitzkyGolay { window, order } => write!(f, "savitzky-golay:{window}:{order}"),
        }
    }
}

impl Identify {
    /// Fits spectral lines of whole periods.
    pub fn spectra(method: Method) -> Self {
        let (noise, method) = (Pooling::Automatic, Some(method));
        let fit = Fit::Spectra { method, noise, extent: None, force_noise: None };
        Self { fit, ..Self::default() }
    }

    /// Fits frequency responses averaged over segments.
    pub fn responses(estimator: Estimator, segments: Segmentation) -> Self {
        let fit = ResponseFit { estimator, segments, method: None };
        Self { fit: Fit::Responses(fit), ..Self::default() }
    }

    /// Fits samples in time: the equation of motion at the samples if there is an acceleration,
    /// otherwise exactly for a force that is linear between them.
    pub fn samples() -> Self {
        Self { fit: Fit::Samples(SampleFit::default()), ..Self::default() }
    }

    /// Uses these spectral lines.
    #[must_use]
    pub fn lines(self, lines: LineChoice) -> Self {
        Self { lines, ..self }
    }

    /// Leaves out the lines that carry something else than the response to the force.
    #[must_use]
    pub fn without(self, without: LeftOut) -> Self {
        Self { without, ..self }
    }

    /// Cuts the records of a hammer test into hits.
    #[must_use]
    pub fn hits(self, rule: HitRule) -> Self {
        Self { hits: Some(rule), ..self }
    }

    /// Fits nonlinear springs and dampers, too.
    #[must_use]
    pub fn nonlinear(self, nonlinear: Nonlinear) -> Self {
        Self { nonlinear: Some(nonlinear), ..self }
    }

    /// Takes these masses as known.
    #[must_use]
    pub fn mass(self, mass: KnownMass) -> Self {
        Self { mass, ..self }
    }

    /// Takes the form of M, C and K as known.
    #[must_use]
    pub fn structure(self, structure: Structure) -> Self {
        Self { structure, ..self }
    }
}

impl SampleFit {
    pub(crate) fn extent(&self) -> Extent {
        match (self.extent, self.derivatives) {
            (Some(Extent::WholePeriod), _) | (None, Some(Derivatives::Spectral)) => {
                Extent::WholePeriod
            }
            _ => Extent::Open,
        }
    }

    pub(crate) fn refinement(&self) -> Option<(usize, Interpolation)> {
        let Refinement { factor, interpolation } = self.refine?;
        Some((factor, interpolation.interpolation()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_written_out() {
        assert_eq!("spectral".parse(), Ok(Derivatives::Spectral));
        let polynomial = Derivatives::SavitzkyGolay { window: 11, order: 4 };
        assert_eq!("savitzky-golay:11:4".parse(), Ok(polynomial));
        assert_eq!(polynomial.to_string(), "savitzky-golay:11:4");
        for text in [
            "",
            "savitzky-golay",
            "savitzky-golay:11",
            "savitzky-golay:10:4",
            "euler:3:2",
            "savitzky-golay:11:4:1",
            "savitzky-golay:11:1",
            "savitzky-golay:3:4",
            "savitzky-golay:1:2",
        ] {
            assert!(text.parse::<Derivatives>().is_err(), "{text}");
        }
    }

    #[test]
    fn settings_survive_json() {
        let samples = SampleFit {
            between_samples: Some(Discretisation::ZeroOrderHold),
            extent: Some(Extent::WholePeriod),
            derivatives: Some(Derivatives::SavitzkyGolay { window: 11, order: 4 }),
            refine: Some(Refinement { factor: 8, interpolation: Between::BandLimited }),
        };
        let all = [
            Identify::default(),
            Identify::spectra(Method::Instrumental).lines("odd".parse().unwrap()),
            Identify {
                fit: Fit::Spectra {
                    method: None,
                    noise: Pooling::Neighbours(3),
                    extent: Some(Extent::Open),
                    force_noise: Some(vec![0.5, 0.1]),
                },
                ..Identify::default()
            },
            Identify::responses(Estimator::Hv, Segmentation::default()),
            Identify { fit: Fit::Samples(samples), ..Identify::default() }
                .mass("2.5,unknown".parse().unwrap()),
            Identify::default().structure("chain k12=-5".parse().unwrap()),
            Identify::default().hits(HitRule { samples: Some(512), ..HitRule::default() }),
            Identify::default().nonlinear("k3: x1^3, c2: |v1| v1".parse().unwrap()),
            Identify::default().nonlinear(Nonlinear {
                candidates: "k3: x1^3, c2: |v1| v1".parse().unwrap(),
                criterion: Criterion::HeldOut,
                ..Nonlinear::default()
            }),
        ];
        for how in all {
            let saved = serde_json::to_string(&how).unwrap();
            assert_eq!(serde_json::from_str::<Identify>(&saved).unwrap(), how, "{saved}");
        }
        assert_eq!(serde_json::from_str::<Identify>("{}").unwrap(), Identify::default());
        assert!(serde_json::from_str::<Identify>("{\"methd\": 1}").is_err());
    }
}
