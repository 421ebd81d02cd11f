//! Settings of an identification as flat keywords: options of the program, keywords of Python, and
//! fields of saved results.

use mechid_io::LineSpec;
use mechid_model::{Discretisation, Terms};
use mechid_nonlinear::{Criterion, ShapeConstants, Weighting};
use mechid_signal::{Extent, HitRule};
use mechid_spectra::Pooling;
use serde::{Deserialize, Serialize};

use super::acquisition::{AcCoupling, Acquisition};
use super::left_out::{Disturbance, LeftOut};
use super::lines::{Band, LineChoice};
use super::mass::KnownMass;
use super::options::{
    Derivatives, HitFit, Identify, Method, Nonlinear, OpenFit, OpenNoise, PeriodEstimator,
    PeriodFit, Refinement, SampleFit, SegmentFit, Source, SpectralFit, SpectralLines,
    TermEstimator, TermFit,
};
use super::structure::Structure;
use crate::AnalysisError;
use crate::frf::{Estimator, Segmentation};
use crate::words::written;

/// Keywords of an identification, all optional. Valid combinations convert to [`Identify`].
///
/// ```
/// use mechid_analysis::identify::{Domain, Identify, Keywords, Method};
///
/// let keywords = Keywords { method: Some(Method::LeastSquares), ..Keywords::default() };
/// assert_eq!(Identify::try_from(keywords.clone())?, Identify::spectra(Method::LeastSquares));
/// let refused = Identify::try_from(Keywords { domain: Domain::Time, ..keywords });
/// assert!(refused.is_err());
/// # Ok::<(), mechid_analysis::AnalysisError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Keywords {
    /// Domain of the fit.
    #[serde(skip_serializing_if = "is_default")]
    pub domain: Domain,
    /// Estimator of the parameters from spectra.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// Noise spectrum that weights the lines in maximum likelihood.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Pooling>,
    /// Standard deviation of the noise on the samples of the force, in N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_noise: Option<Vec<f64>>,
    /// Extent of the window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extent: Option<Extent>,
    /// Spectral lines to use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines: Option<LineSpec>,
    /// Frequency band to use.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "written::pair")]
    pub band_hz: Option<Band>,
    /// Spectral lines to exclude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_lines: Option<LineSpec>,
    /// Frequencies whose lines are excluded.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "written::list")]
    pub without_hz: Vec<Disturbance>,
    /// Known masses.
    #[serde(skip_serializing_if = "is_default", deserialize_with = "written::one")]
    pub mass: KnownMass,
    /// Known form of M, C and K.
    #[serde(skip_serializing_if = "is_default", deserialize_with = "written::one")]
    pub structure: Structure,
    /// Rule for dividing the records of a hammer test into hits.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "written::optional")]
    pub hits: Option<HitRule>,
    /// Estimator of the frequency responses that are fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_frf: Option<Estimator>,
    /// Segments over which the frequency responses are averaged.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "written::optional")]
    pub segment: Option<Segmentation>,
    /// Nonlinear springs and dampers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinear: Option<Terms>,
    /// Candidate terms; those that improve the fit are added.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidates: Option<Terms>,
    /// Criterion for adding a candidate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criterion: Option<Criterion>,
    /// Constants to estimate in addition to the coefficients of the terms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub search: Vec<Constant>,
    /// Weighting of the lines of a fit with nonlinear terms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighting: Option<Weighting>,
    /// Assumption on the force between samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between_samples: Option<Discretisation>,
    /// Channels behind a first-order high-pass.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "written::list")]
    pub ac_coupling: Vec<AcCoupling>,
    /// Derivation of the responses that were not measured.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "written::optional")]
    pub derivatives: Option<Derivatives>,
    /// Additional steps between the samples.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "written::optional")]
    pub refine: Option<Refinement>,
}

/// Domain of a fit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Domain {
    /// Lines of a spectrum.
    #[default]
    Frequency,
    /// Samples in time.
    Time,
}

/// Constants to estimate in addition to the coefficients of nonlinear terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Constant {
    /// Constants inside the laws of the nonlinear terms; the search begins at the values that the
    /// laws state.
    Laws,
    /// Delay of the force.
    Delay,
    /// Phase common to all channels, for instance from equal filters.
    Phase,
}

/// Kind of [`Source`] that the keywords request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Samples,
    Segments,
    Terms,
    Hits,
    Spectra,
}

impl Kind {
    const ALL: [Self; 5] = [Self::Samples, Self::Segments, Self::Terms, Self::Hits, Self::Spectra];

    /// Returns the setting that requests this kind.
    fn asked_by(self) -> &'static str {
        match self {
            Self::Samples => "`domain` time",
            Self::Segments => "`from_frf`",
            Self::Terms => "nonlinear terms",
            Self::Hits => "`hits`",
            Self::Spectra => "spectra",
        }
    }

    /// Returns whether this kind uses a keyword that only some fits have.
    fn uses(self, keyword: &str) -> bool {
        const LINES: [&str; 4] = ["lines", "band_hz", "without_lines", "without_hz"];
        const SPECTRA: [&str; 6] =
            ["method", "noise", "force_noise", "extent", "between_samples", "ac_coupling"];
        let of_lines = LINES.contains(&keyword);
        match self {
            Self::Samples => {
                ["extent", "between_samples", "derivatives", "refine"].contains(&keyword)
            }
            Self::Segments => of_lines || ["from_frf", "segment", "method"].contains(&keyword),
            Self::Terms => {
                let of_terms = ["nonlinear", "candidates", "criterion", "search", "weighting"];
                of_lines || of_terms.contains(&keyword) || ["method", "extent"].contains(&keyword)
            }
            Self::Hits => of_lines || keyword == "hits" || SPECTRA.contains(&keyword),
            Self::Spectra => of_lines || SPECTRA.contains(&keyword),
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn refused(setting: &'static str, why: impl Into<String>) -> AnalysisError {
    AnalysisError::Setting { setting, why: why.into() }
}

impl Keywords {
    /// Returns the requested kind of source.
    fn kind(&self) -> Kind {
        match self {
            Self { domain: Domain::Time, .. } => Kind::Samples,
            Self { from_frf: Some(_), .. } => Kind::Segments,
            Self { nonlinear: Some(_), .. } | Self { candidates: Some(_), .. } => Kind::Terms,
            Self { hits: Some(_), .. } => Kind::Hits,
            _ => Kind::Spectra,
        }
    }

    /// Returns the keywords that were given, except those that every fit uses.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        [
            ("method", self.method.is_some()),
            ("noise", self.noise.is_some()),
            ("force_noise", self.force_noise.is_some()),
            ("extent", self.extent.is_some()),
            ("lines", self.lines.is_some()),
            ("band_hz", self.band_hz.is_some()),
            ("without_lines", self.without_lines.is_some()),
            ("without_hz", !self.without_hz.is_empty()),
            ("hits", self.hits.is_some()),
            ("from_frf", self.from_frf.is_some()),
            ("segment", self.segment.is_some()),
            ("nonlinear", self.nonlinear.is_some()),
            ("candidates", self.candidates.is_some()),
            ("criterion", self.criterion.is_some()),
            ("search", !self.search.is_empty()),
            ("weighting", self.weighting.is_some()),
            ("between_samples", self.between_samples.is_some()),
            ("ac_coupling", !self.ac_coupling.is_empty()),
            ("derivatives", self.derivatives.is_some()),
            ("refine", self.refine.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, given)| given.then_some(name))
    }

    /// Returns an error if a keyword is given that this kind of source does not use, or if two
    /// keywords exclude each other.
    fn check(&self) -> Result<(), AnalysisError> {
        let kind = self.kind();
        if let Some(stray) = self.given().find(|name| !kind.uses(name)) {
            let users = Kind::ALL.into_iter().filter(|other| other.uses(stray));
            let users: Vec<&str> = users.map(Kind::asked_by).collect();
            let why = format!("it belongs to {}, not to {}", users.join(" or "), kind.asked_by());
            return Err(refused(stray, why));
        }
        if self.lines.is_some() && self.band_hz.is_some() {
            return Err(refused(
                "lines",
                "`lines` and `band_hz` exclude each other: leave one of them out",
            ));
        }
        if self.criterion.is_some() && self.candidates.is_none() {
            let why = "available only for the selection of terms: give `candidates`, or leave `criterion` out";
            return Err(refused("criterion", why));
        }
        let likelihood = matches!(self.method, None | Some(Method::MaximumLikelihood));
        if self.noise.is_some_and(|noise| noise != Pooling::Automatic) && !likelihood {
            return Err(refused("noise", "available only with `method` maximum-likelihood"));
        }
        Ok(())
    }

    /// Returns the source for spectral lines that are neither averaged nor fitted with nonlinear
    /// terms.
    fn spectra(self, lines: SpectralLines) -> Result<Source, AnalysisError> {
        let likelihood = match self.noise {
            Some(noise) if noise != Pooling::Automatic => Some(noise),
            _ => (self.method == Some(Method::MaximumLikelihood)).then_some(Pooling::Automatic),
        };
        let estimator = match self.method {
            Some(Method::LeastSquares) => Some(PeriodEstimator::LeastSquares),
            Some(Method::Instrumental) => Some(PeriodEstimator::Instrumental),
            _ => likelihood.map(PeriodEstimator::MaximumLikelihood),
        };
        let is_likelihood = matches!(estimator, None | Some(PeriodEstimator::MaximumLikelihood(_)));
        let acquisition =
            Acquisition { between_samples: self.between_samples, ac_coupling: self.ac_coupling };
        let is_open =
            self.force_noise.is_some() || self.hits.is_some() || !acquisition.is_default();
        match self.extent.or(is_open.then_some(Extent::Open)) {
            Some(Extent::Open) if !is_likelihood => {
                Err(refused("method", "open records and hits need maximum-likelihood"))
            }
            Some(Extent::WholePeriod) if self.force_noise.is_some() => Err(refused(
                "force_noise",
                "available only for open records: for whole periods, the scatter of the force shows its noise",
            )),
            Some(Extent::WholePeriod) if self.hits.is_some() => {
                Err(refused("extent", "a hit is not a whole period: leave `extent` or `hits` out"))
            }
            Some(Extent::WholePeriod) if !acquisition.is_default() => {
                let setting = match acquisition.between_samples {
                    Some(_) => "between_samples",
                    None => "ac_coupling",
                };
                Err(refused(setting, "available only for open records, hits and `domain` time"))
            }
            Some(Extent::Open) => {
                let response = likelihood.unwrap_or_default();
                let noise = OpenNoise { response, force: self.force_noise };
                Ok(match self.hits {
                    Some(rule) => Source::Hits(HitFit { rule, noise, lines, acquisition }),
                    None => Source::Open(OpenFit { noise, lines, acquisition }),
                })
            }
            None if is_likelihood => Ok(Source::Spectra(SpectralFit { likelihood, lines })),
            _ => Ok(Source::Periods(PeriodFit { estimator, lines })),
        }
    }

    fn terms(self, lines: SpectralLines) -> Result<Source, AnalysisError> {
        let estimator = match self.method {
            None | Some(Method::LeastSquares) => TermEstimator::EquationError,
            Some(Method::MaximumLikelihood) => TermEstimator::OutputError,
            Some(Method::Instrumental) => {
                return Err(refused(
                    "method",
                    "nonlinear terms need least-squares or maximum-likelihood",
                ));
            }
        };
        if self.extent == Some(Extent::Open) && self.method == Some(Method::LeastSquares) {
            return Err(refused("method", "open records need maximum-likelihood"));
        }
        let searched = |constant| self.search.contains(&constant);
        let search = ShapeConstants {
            laws: searched(Constant::Laws),
            delay: searched(Constant::Delay),
            phase: searched(Constant::Phase),
        };
        let terms = Nonlinear {
            terms: self.nonlinear.unwrap_or_default(),
            candidates: self.candidates.unwrap_or_default(),
            criterion: self.criterion.unwrap_or_default(),
            search,
            weighting: self.weighting.unwrap_or_default(),
        };
        // The default extent for least squares on the equation of motion is whole periods.
        let periods = (self.method == Some(Method::LeastSquares)).then_some(Extent::WholePeriod);
        Ok(Source::Terms(TermFit { terms, estimator, extent: self.extent.or(periods), lines }))
    }

    fn lines(&self) -> SpectralLines {
        let choice = match (&self.lines, self.band_hz) {
            (Some(lines), _) => LineChoice::Lines(lines.clone()),
            (None, Some(band)) => LineChoice::Band(band),
            (None, None) => LineChoice::Driven,
        };
        let without =
            LeftOut { lines: self.without_lines.clone(), frequencies: self.without_hz.clone() };
        SpectralLines { choice, without }
    }

    fn with_lines(self, SpectralLines { choice, without }: SpectralLines) -> Self {
        let (lines, band_hz) = match choice {
            LineChoice::Driven => (None, None),
            LineChoice::Band(band) => (None, Some(band)),
            LineChoice::Lines(lines) => (Some(lines), None),
        };
        let (without_lines, without_hz) = (without.lines, without.frequencies);
        Self { lines, band_hz, without_lines, without_hz, ..self }
    }
}

impl TryFrom<Keywords> for Identify {
    type Error = AnalysisError;

    fn try_from(keywords: Keywords) -> Result<Self, AnalysisError> {
        keywords.check()?;
        let lines = keywords.lines();
        let (mass, structure) = (keywords.mass.clone(), keywords.structure.clone());
        let source = match keywords.kind() {
            Kind::Samples => Source::Samples(SampleFit {
                between_samples: keywords.between_samples,
                extent: keywords.extent,
                derivatives: keywords.derivatives,
                refine: keywords.refine,
            }),
            Kind::Segments => {
                let estimator = keywords.from_frf.unwrap_or_default();
                let (segments, method) = (keywords.segment.unwrap_or_default(), keywords.method);
                Source::Segments(SegmentFit { estimator, segments, method, lines })
            }
            Kind::Terms => keywords.terms(lines)?,
            Kind::Hits | Kind::Spectra => keywords.spectra(lines)?,
        };
        Ok(Self { source, mass, structure })
    }
}

impl From<PeriodEstimator> for (Method, Option<Pooling>) {
    fn from(estimator: PeriodEstimator) -> Self {
        match estimator {
            PeriodEstimator::LeastSquares => (Method::LeastSquares, None),
            PeriodEstimator::Instrumental => (Method::Instrumental, None),
            PeriodEstimator::MaximumLikelihood(noise) => (Method::MaximumLikelihood, Some(noise)),
        }
    }
}

impl From<Source> for Keywords {
    fn from(source: Source) -> Self {
        let none = Self::default();
        let noise = |noise: Pooling| Some(noise).filter(|noise| *noise != Pooling::Automatic);
        match source {
            Source::Spectra(SpectralFit { likelihood, lines }) => {
                let method = likelihood.map(|_| Method::MaximumLikelihood);
                Self { method, noise: likelihood.and_then(noise), ..none }.with_lines(lines)
            }
            Source::Periods(PeriodFit { estimator, lines }) => {
                let (method, weights) = estimator.map(<(Method, Option<Pooling>)>::from).unzip();
                let noise = weights.flatten().and_then(noise);
                let extent = match method {
                    Some(Method::LeastSquares | Method::Instrumental) => None,
                    _ => Some(Extent::WholePeriod),
                };
                Self { method, noise, extent, ..none }.with_lines(lines)
            }
            Source::Open(OpenFit { noise: OpenNoise { response, force }, lines, acquisition }) => {
                let extent = Some(Extent::Open);
                Self { extent, noise: noise(response), force_noise: force, ..acquisition.into() }
                    .with_lines(lines)
            }
            Source::Hits(fit) => {
                let HitFit { rule, noise: OpenNoise { response, force }, lines, acquisition } = fit;
                let (hits, noise) = (Some(rule), noise(response));
                Self { hits, noise, force_noise: force, ..acquisition.into() }.with_lines(lines)
            }
            Source::Terms(TermFit { terms, estimator, extent, lines }) => {
                let method = match (estimator, extent) {
                    (_, Some(Extent::Open)) | (TermEstimator::EquationError, None) => None,
                    (TermEstimator::EquationError, _) => Some(Method::LeastSquares),
                    (TermEstimator::OutputError, _) => Some(Method::MaximumLikelihood),
                };
                Self { method, extent, ..Self::from(terms) }.with_lines(lines)
            }
            Source::Segments(SegmentFit { estimator, segments, method, lines }) => {
                let segment = Some(segments).filter(|segments| !is_default(segments));
                Self { from_frf: Some(estimator), segment, method, ..none }.with_lines(lines)
            }
            Source::Samples(SampleFit { between_samples, extent, derivatives, refine }) => {
                Self { domain: Domain::Time, between_samples, extent, derivatives, refine, ..none }
            }
        }
    }
}

impl From<Acquisition> for Keywords {
    fn from(how: Acquisition) -> Self {
        let Acquisition { between_samples, ac_coupling } = how;
        Self { between_samples, ac_coupling, ..Self::default() }
    }
}

impl From<Nonlinear> for Keywords {
    fn from(how: Nonlinear) -> Self {
        let Nonlinear { terms, candidates, criterion, search, weighting } = how;
        let has_candidates = !candidates.is_empty();
        let searched = [
            (search.laws, Constant::Laws),
            (search.delay, Constant::Delay),
            (search.phase, Constant::Phase),
        ];
        Self {
            nonlinear: Some(terms).filter(|terms| !terms.is_empty() || !has_candidates),
            candidates: Some(candidates).filter(|_| has_candidates),
            criterion: Some(criterion).filter(|criterion| has_candidates && !is_default(criterion)),
            search: searched
                .into_iter()
                .filter_map(|(on, constant)| on.then_some(constant))
                .collect(),
            weighting: Some(weighting).filter(|weighting| !is_default(weighting)),
            ..Self::default()
        }
    }
}

impl From<Identify> for Keywords {
    fn from(how: Identify) -> Self {
        Self { mass: how.mass, structure: how.structure, ..Self::from(how.source) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<Identify, String> {
        serde_json::from_str(json).map_err(|error| error.to_string())
    }

    /// Settings can be written in several forms, and the saved form gives the same settings again.
    #[test]
    fn settings_are_written_in_several_ways() {
        for (written, saved) in [
            (r#"{"hits": true}"#, Identify::hits(HitRule::default())),
            (r#"{"hits": false}"#, Identify::default()),
            (
                r#"{"hits": "double=8,samples=512"}"#,
                Identify::hits(HitRule {
                    double_percent: 8.0,
                    samples: Some(512),
                    ..HitRule::default()
                }),
            ),
            (
                r#"{"from_frf": "h1", "segment": 256}"#,
                Identify::responses(Estimator::H1, Segmentation::with_samples(256)),
            ),
            (
                r#"{"from_frf": "h1", "segment": "256:50:hann"}"#,
                Identify::responses(Estimator::H1, Segmentation::with_samples(256)),
            ),
            (
                r#"{"band_hz": [40, 120.5], "mass": 3}"#,
                Identify::default()
                    .lines(LineChoice::Band(Band { low_hz: 40.0, high_hz: 120.5 }))
                    .mass("3".parse().unwrap()),
            ),
            (
                r#"{"without_hz": [50, "24.5:multiples"]}"#,
                Identify::default().without(LeftOut {
                    lines: None,
                    frequencies: vec!["50".parse().unwrap(), "24.5:multiples".parse().unwrap()],
                }),
            ),
            (
                r#"{"structure": "chain k13=0"}"#,
                Identify::default().structure("chain k13=0".parse().unwrap()),
            ),
        ] {
            assert_eq!(read(written).unwrap(), saved, "{written}");
            let again = serde_json::to_string(&saved).unwrap();
            assert_eq!(read(&again).unwrap(), saved, "{again}");
        }
    }

    /// The error of a wrong combination of keywords names the keyword that cannot be combined with
    /// the others.
    #[test]
    fn keywords_that_do_not_go_together_are_refused() {
        let why = |json: &str| read(json).unwrap_err();
        let refused = why(r#"{"domain": "time", "method": "least-squares"}"#);
        assert!(
            refused.contains("`method`: it belongs to `from_frf` or nonlinear terms or `hits` or spectra, not to `domain` time"),
            "{refused}"
        );
        for (json, setting) in [
            (r#"{"segment": 256}"#, "segment"),
            (r#"{"from_frf": "h1", "noise": "smooth"}"#, "noise"),
            (r#"{"refine": "8:linear"}"#, "refine"),
            (r#"{"lines": "odd", "band_hz": [1, 2]}"#, "lines"),
            (r#"{"hits": true, "from_frf": "h1"}"#, "hits"),
            (r#"{"hits": true, "method": "least-squares"}"#, "method"),
            (r#"{"hits": true, "nonlinear": "k3: x1^3"}"#, "hits"),
            (r#"{"extent": "open", "method": "instrumental"}"#, "method"),
            (r#"{"extent": "period", "force_noise": [1]}"#, "force_noise"),
            (r#"{"method": "least-squares", "noise": "white"}"#, "noise"),
            (r#"{"nonlinear": "k3: x1^3", "noise": "white"}"#, "noise"),
            (r#"{"nonlinear": "k3: x1^3", "extent": "open", "method": "least-squares"}"#, "method"),
            (r#"{"nonlinear": "k3: x1^3", "criterion": "held-out"}"#, "criterion"),
            (r#"{"weighting": "response"}"#, "weighting"),
        ] {
            assert!(why(json).starts_with(&format!("`{setting}`")), "{json}: {}", why(json));
        }
    }
}
