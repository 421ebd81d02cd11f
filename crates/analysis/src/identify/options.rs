//! Settings of an identification, as values that can be saved and repeated.

use std::fmt;
use std::str::FromStr;

use mechid_estimate::derivatives::SavitzkyGolay;
use mechid_model::{Discretisation, Terms};
use mechid_nonlinear::{Criterion, ShapeConstants, Weighting};
use mechid_signal::{Extent, HitRule, Interpolation};
use mechid_spectra::Pooling;
use serde::{Deserialize, Serialize};

use super::acquisition::Acquisition;
use super::keywords::Keywords;
use super::left_out::{LeftOut, LineRule};
use super::lines::LineChoice;
use super::mass::KnownMass;
use super::structure::Structure;
use crate::AnalysisError;
use crate::frf::{Estimator, Segmentation};
use crate::words;

/// Settings of an identification: what is fitted and how, and what is known of the machine.
///
/// Invalid combinations of settings cannot be expressed. Settings are saved as the flat
/// [`Keywords`] of the program and of Python.
///
/// ```
/// use mechid_analysis::{Identify, identify::Method};
///
/// let how = Identify::spectra(Method::MaximumLikelihood);
/// let saved = serde_json::to_string(&how)?;
/// assert_eq!(saved, r#"{"method":"maximum-likelihood"}"#);
/// assert_eq!(serde_json::from_str::<Identify>(&saved)?, how);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keywords", into = "Keywords")]
pub struct Identify {
    /// Data that are fitted, and the estimator.
    pub source: Source,
    /// Known masses.
    pub mass: KnownMass,
    /// Form of M, C and K, for instance a chain.
    pub structure: Structure,
}

/// Data that are fitted, and the estimator.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Spectral lines of windows. The data decide whether the windows count as whole periods, or as
    /// open records whose transients are estimated.
    Spectra(SpectralFit),
    /// Spectral lines of whole periods.
    Periods(PeriodFit),
    /// Spectral lines of open records, by maximum likelihood: the transients are estimated together
    /// with the system.
    Open(OpenFit),
    /// Hits of a hammer, each a separate open record.
    Hits(HitFit),
    /// Whole periods or open records, with nonlinear springs and dampers in addition to M, C and K.
    Terms(TermFit),
    /// Frequency responses, averaged over segments.
    Segments(SegmentFit),
    /// Samples in time, of any record.
    Samples(SampleFit),
}

impl Default for Source {
    fn default() -> Self {
        Self::Spectra(SpectralFit::default())
    }
}

/// Fit of spectral lines; the data decide whether the windows count as whole periods or as open
/// records.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SpectralFit {
    /// Noise spectrum of maximum likelihood. `None`: the data decide on the estimator, which is
    /// maximum likelihood if at least two periods determine the noise or if noise biases least
    /// squares, otherwise least squares.
    pub likelihood: Option<Pooling>,
    /// Spectral lines.
    pub lines: SpectralLines,
}

/// Fit of the spectral lines of whole periods.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PeriodFit {
    /// Estimator; `None`: maximum likelihood if at least two periods determine the noise or if
    /// noise biases least squares, otherwise least squares.
    pub estimator: Option<PeriodEstimator>,
    /// Spectral lines.
    pub lines: SpectralLines,
}

/// Estimator of the parameters from whole periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PeriodEstimator {
    /// Least squares on the equation of motion; biased by noise on the response.
    LeastSquares,
    /// Instrumental variables from the two halves of the periods; not biased.
    Instrumental,
    /// Maximum likelihood on the response, not biased, with the smallest scatter; weighted by a
    /// noise spectrum from the scatter of the periods or, with one period, from the residual.
    MaximumLikelihood(Pooling),
}

/// Fit of the spectral lines of open records.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OpenFit {
    /// Noise that weights the lines.
    pub noise: OpenNoise,
    /// Spectral lines.
    pub lines: SpectralLines,
    /// Properties of the acquisition of the records.
    pub acquisition: Acquisition,
}

/// Noise of open records.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OpenNoise {
    /// Form of the noise spectrum of the response; the noise is estimated from the residual.
    pub response: Pooling,
    /// Standard deviation of the white noise on the samples of the force, in N: one level for all
    /// forces, or one for each degree of freedom. `None`: estimated above the band that the force
    /// drives or, for hits, from the samples between the hits.
    pub force: Option<Vec<f64>>,
}

/// Fit of the hits of a hammer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HitFit {
    /// Rule for dividing the records into hits.
    pub rule: HitRule,
    /// Noise that weights the lines.
    pub noise: OpenNoise,
    /// Spectral lines.
    pub lines: SpectralLines,
    /// Properties of the acquisition of the records.
    pub acquisition: Acquisition,
}

/// Fit of nonlinear terms.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TermFit {
    /// Springs and dampers.
    pub terms: Nonlinear,
    /// Estimator for whole periods; open records use output error.
    pub estimator: TermEstimator,
    /// Extent of the windows; `None`: whole periods if their length is given or a setting needs
    /// them, otherwise open records.
    pub extent: Option<Extent>,
    /// Spectral lines; for open records, the lines of the linear fit that starts the search.
    pub lines: SpectralLines,
}

/// Estimator of nonlinear terms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TermEstimator {
    /// Least squares on the equation of motion.
    #[default]
    EquationError,
    /// Least squares on the simulated response, started from the solution of the equation error.
    OutputError,
}

/// Spectral lines to use.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SpectralLines {
    /// Lines to use.
    pub choice: LineChoice,
    /// Lines to exclude from the chosen lines.
    pub without: LeftOut,
}

impl SpectralLines {
    pub(crate) fn rule(&self) -> LineRule<'_> {
        LineRule { choice: &self.choice, without: &self.without }
    }
}

/// Estimator of the parameters from spectra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Least squares on the equation of motion; biased by noise on the response.
    LeastSquares,
    /// Instrumental variables from the two halves of the periods; not biased.
    Instrumental,
    /// Maximum likelihood on the response, weighted by the noise estimated from the periods; not
    /// biased, with the smallest scatter.
    MaximumLikelihood,
}

/// Nonlinear springs and dampers to identify in addition to M, C and K.
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
    /// Candidate terms; those that improve the fit are added; none by default.
    #[serde(skip_serializing_if = "Terms::is_empty")]
    pub candidates: Terms,
    /// Criterion for adding a candidate.
    pub criterion: Criterion,
    /// Constants that enter nonlinearly and are to be estimated; none by default.
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
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SegmentFit {
    /// Frequency response estimator.
    pub estimator: Estimator,
    /// Segments that are averaged.
    pub segments: Segmentation,
    /// Estimator of the parameters; `None`: maximum likelihood, weighted by the coherence.
    pub method: Option<Method>,
    /// Spectral lines.
    pub lines: SpectralLines,
}

/// Fit in the time domain.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SampleFit {
    /// Assumption on the force between samples; `None`: the equation of motion at the samples if
    /// there is an acceleration, otherwise a force that is linear between samples.
    pub between_samples: Option<Discretisation>,
    /// Extent of the window; `None`: open, or whole periods with spectral derivatives.
    pub extent: Option<Extent>,
    /// Derivation of the velocity and acceleration that were not measured.
    pub derivatives: Option<Derivatives>,
    /// Additional steps between the samples.
    pub refine: Option<Refinement>,
}

/// Additional steps in every sampling interval, which reduce the error of a [`Discretisation`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refinement {
    /// Number of steps per interval.
    pub factor: usize,
    /// Interpolation between the samples.
    pub interpolation: Between,
}

impl FromStr for Refinement {
    type Err = String;

    /// Reads `FACTOR:INTERPOLATION`, such as `8:band-limited`.
    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(':').and_then(|(factor, way)| {
            let factor = factor.parse().ok().filter(|factor| *factor > 0)?;
            Some(Self { factor, interpolation: words::read(way).ok()? })
        });
        parsed.ok_or_else(|| {
            format!("write FACTOR:linear, FACTOR:spline or FACTOR:band-limited, such as 8:band-limited, not {text}")
        })
    }
}

/// Interpolation between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// Straight lines.
    Linear,
    /// A cubic spline.
    Spline,
    /// The Fourier series of the window, which must contain whole periods.
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

/// Derivation of the responses that were not measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Derivatives {
    /// Multiplication of the lines of whole periods by iω.
    Spectral,
    /// A sliding polynomial.
    SavitzkyGolay {
        /// Number of samples in the window, odd.
        window: usize,
        /// Order of the polynomial: at least 2, and less than the number of samples in the window.
        order: usize,
    },
}

impl Derivatives {
    /// Returns the sliding polynomial; `None` for the spectral derivation.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if window and order are inconsistent.
    pub(crate) fn filter(self) -> Result<Option<SavitzkyGolay>, AnalysisError> {
        let Self::SavitzkyGolay { window, order } = self else { return Ok(None) };
        let wrong = |why: String| AnalysisError::Setting { setting: "derivatives", why };
        if window % 2 == 0 {
            return Err(wrong(format!(
                "the window must have an odd number of samples, not {window}"
            )));
        }
        if order < 2 {
            return Err(wrong(format!(
                "two derivatives need a polynomial of order 2 or more, not {order}"
            )));
        }
        SavitzkyGolay::new(window / 2, order).map(Some).map_err(|error| wrong(error.to_string()))
    }

    /// Returns the number of samples in the sliding window; 0 if all samples are used at once.
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
    /// Fits spectral lines by this method: maximum likelihood for periodic or open windows, the
    /// other methods for whole periods.
    pub fn spectra(method: Method) -> Self {
        let lines = SpectralLines::default();
        let periods = |estimator| {
            Source::Periods(PeriodFit { estimator: Some(estimator), ..PeriodFit::default() })
        };
        Self::from(match method {
            Method::LeastSquares => periods(PeriodEstimator::LeastSquares),
            Method::Instrumental => periods(PeriodEstimator::Instrumental),
            Method::MaximumLikelihood => {
                Source::Spectra(SpectralFit { likelihood: Some(Pooling::Automatic), lines })
            }
        })
    }

    /// Fits frequency responses averaged over segments.
    pub fn responses(estimator: Estimator, segments: Segmentation) -> Self {
        Self::from(Source::Segments(SegmentFit { estimator, segments, ..SegmentFit::default() }))
    }

    /// Fits samples in time. If there is an acceleration, the equation of motion at the samples is
    /// fitted; otherwise the transition from sample to sample, which is exact for a force that is
    /// linear between samples.
    pub fn samples() -> Self {
        Self::from(Source::Samples(SampleFit::default()))
    }

    /// Divides the records of a hammer test into hits, and fits each as a separate record.
    pub fn hits(rule: HitRule) -> Self {
        Self::from(Source::Hits(HitFit { rule, ..HitFit::default() }))
    }

    /// Fits nonlinear springs and dampers in addition to M, C and K by least squares on the
    /// equation of motion.
    pub fn nonlinear(terms: Nonlinear) -> Self {
        Self::from(Source::Terms(TermFit { terms, ..TermFit::default() }))
    }

    /// Returns whether least squares are requested for the lines of whole periods.
    pub(crate) fn is_least_squares(&self) -> bool {
        let estimator = Some(PeriodEstimator::LeastSquares);
        matches!(&self.source, Source::Periods(fit) if fit.estimator == estimator)
    }

    /// Uses these spectral lines; has no effect on a fit of samples in time.
    #[must_use]
    pub fn lines(mut self, choice: LineChoice) -> Self {
        if let Some(lines) = self.source.lines_mut() {
            lines.choice = choice;
        }
        self
    }

    /// Excludes lines with contributions other than the response to the force; has no effect on a
    /// fit of samples in time.
    #[must_use]
    pub fn without(mut self, without: LeftOut) -> Self {
        if let Some(lines) = self.source.lines_mut() {
            lines.without = without;
        }
        self
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

impl From<Source> for Identify {
    fn from(source: Source) -> Self {
        Self { source, ..Self::default() }
    }
}

impl Source {
    /// Returns the spectral lines to use; `None` for samples in time.
    pub fn lines(&self) -> Option<&SpectralLines> {
        match self {
            Self::Spectra(fit) => Some(&fit.lines),
            Self::Periods(fit) => Some(&fit.lines),
            Self::Open(fit) => Some(&fit.lines),
            Self::Hits(fit) => Some(&fit.lines),
            Self::Terms(fit) => Some(&fit.lines),
            Self::Segments(fit) => Some(&fit.lines),
            Self::Samples(_) => None,
        }
    }

    fn lines_mut(&mut self) -> Option<&mut SpectralLines> {
        match self {
            Self::Spectra(fit) => Some(&mut fit.lines),
            Self::Periods(fit) => Some(&mut fit.lines),
            Self::Open(fit) => Some(&mut fit.lines),
            Self::Hits(fit) => Some(&mut fit.lines),
            Self::Terms(fit) => Some(&mut fit.lines),
            Self::Segments(fit) => Some(&mut fit.lines),
            Self::Samples(_) => None,
        }
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
        let force = Some(vec![0.5, 0.1]);
        let noise = OpenNoise { response: Pooling::Neighbours(3), force };
        let terms: Nonlinear = "k3: x1^3, c2: |v1| v1".parse().unwrap();
        let periods = |estimator| Source::Periods(PeriodFit { estimator, ..PeriodFit::default() });
        let all = [
            Identify::default(),
            Identify::spectra(Method::Instrumental).lines("odd".parse().unwrap()),
            Identify::spectra(Method::MaximumLikelihood),
            Identify::from(periods(None)),
            Identify::from(periods(Some(PeriodEstimator::MaximumLikelihood(Pooling::PerLine)))),
            Identify::from(Source::Open(OpenFit {
                noise: noise.clone(),
                acquisition: Acquisition {
                    between_samples: Some(Discretisation::FirstOrderHold),
                    ac_coupling: vec!["a1=0.5".parse().unwrap()],
                },
                ..OpenFit::default()
            })),
            Identify::from(Source::Hits(HitFit { noise, ..HitFit::default() })),
            Identify::responses(Estimator::Hv, Segmentation::default()),
            Identify::from(Source::Samples(samples)).mass("2.5,unknown".parse().unwrap()),
            Identify::default().structure("chain k12=-5".parse().unwrap()),
            Identify::hits(HitRule { samples: Some(512), ..HitRule::default() }),
            Identify::nonlinear(terms.clone()),
            Identify::from(Source::Terms(TermFit {
                terms: Nonlinear {
                    candidates: terms.terms,
                    criterion: Criterion::HeldOut,
                    ..Nonlinear::default()
                },
                estimator: TermEstimator::OutputError,
                ..TermFit::default()
            })),
        ];
        for how in all {
            let saved = serde_json::to_string(&how).unwrap();
            assert_eq!(serde_json::from_str::<Identify>(&saved).unwrap(), how, "{saved}");
        }
        assert_eq!(serde_json::from_str::<Identify>("{}").unwrap(), Identify::default());
        assert!(serde_json::from_str::<Identify>("{\"methd\": 1}").is_err());
        assert_eq!(
            "8:spline".parse(),
            Ok(Refinement { factor: 8, interpolation: Between::Spline })
        );
        for text in ["8", "0:linear", "8:cubic", ":linear"] {
            assert!(text.parse::<Refinement>().is_err(), "{text}");
        }
    }
}
