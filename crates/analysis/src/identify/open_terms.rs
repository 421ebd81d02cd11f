//! Fits of open records, such as sweeps, with nonlinear terms in addition to M, C and K.

use mechid_checks::{Verdict, steady_periods};
use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::Discretisation;
use mechid_nonlinear::{NonlinearEstimate, SteppedRecord, output_error_of_open_records};
use mechid_signal::Extent;

use super::acquisition::Acquisition;
use super::disagreement::Disagreement;
use super::fitted::{Fitted, WithTerms};
use super::further_terms::FurtherTerms;
use super::keywords::Domain;
use super::nonlinear::white_residuals;
use super::open_records::{self, Excitation};
use super::options::{Nonlinear, OpenNoise, TermFit};
use super::prediction::Prediction;
use super::remarks::one_motion_of;
use crate::AnalysisError;
use crate::measurement::Windowed;

/// Fits the samples of open records by output error. The search starts from the linear fit of the
/// driven lines, or of the lines that `how` chooses.
pub(super) fn fit(
    records: &[Windowed],
    unknowns: &Unknowns,
    how: &TermFit,
) -> Result<Fitted, AnalysisError> {
    let TermFit { terms: Nonlinear { terms, candidates, search, .. }, lines, .. } = how;
    let refuse = |setting, why: &str| Err(AnalysisError::Setting { setting, why: why.into() });
    if !candidates.is_empty() {
        return refuse(
            "candidates",
            "terms are chosen from whole periods, and an open record has no whole periods",
        );
    }
    if search.delay || search.phase {
        return refuse("search", "delay and phase of the channels need whole periods");
    }
    terms.check_dof(unknowns.dof()).map_err(EstimateError::from)?;
    let how = open_records::How {
        rule: lines.rule(),
        noise: &OpenNoise::default(),
        acquisition: &Acquisition::default(),
        excitation: Excitation::Lasting,
    };
    let linear = open_records::fit(records, unknowns, how)?.fitted;
    let stepped: Vec<SteppedRecord> = records.iter().map(stepped_record).collect();
    let kind = records[0].held.response().1;
    let fit = output_error_of_open_records(&stepped, kind, &linear.estimate, terms)?;
    let further = FurtherTerms::from_open_records(&stepped, kind, &fit);
    let (omitted, squared_change) =
        further.map(|further| (further.finding, further.squared_change)).unzip();
    let residuals = white_residuals(records, &fit.residuals);
    let estimate = fit.estimate;
    let prediction = Prediction::Sampled {
        discretisation: Discretisation::FirstOrderHold,
        extent: Extent::Open,
    };
    let of_start = "the windows are not whole periods: the simulated response was fitted to the samples of each \
                    window, with its own initial state";
    Ok(Fitted {
        equations: estimate.equations() / unknowns.dof(),
        before_all: linear.before_all,
        before: linear.before,
        after: vec![Vec::new(); records.len()],
        after_all: omitted.into_iter().collect(),
        residuals,
        disagreement: Disagreement::new(squared_change, None),
        remarks: one_motion_of(&records[0].held).into_iter().chain([of_start.to_owned()]).collect(),
        frequency: linear.frequency,
        drawn: linear.drawn,
        ..Fitted::new(
            Domain::Time,
            "output error on open records, started from a linear fit",
            prediction,
            estimate.linear().clone(),
        )
    }
    .with_terms(estimate))
}

fn stepped_record(Windowed { held, .. }: &Windowed) -> SteppedRecord {
    SteppedRecord {
        force: held.force.clone(),
        response: held.response().0.clone(),
        extent: Extent::Open,
        periods: 1,
    }
}

impl Fitted {
    /// Returns the fit with nonlinear terms estimated from open records.
    fn with_terms(mut self, estimate: NonlinearEstimate) -> Self {
        self.nonlinear =
            Some(WithTerms { estimate, distortion: None, restoring: None, selection: None });
        self
    }
}

/// Returns the reason why windows whose extent is not given cannot be treated as periods.
pub(super) fn no_period(records: &[Windowed]) -> Result<Option<AnalysisError>, AnalysisError> {
    for Windowed { held, .. } in records {
        let looked = steady_periods(&held.force, held.response().0, held.period)?;
        if looked.iter().any(|finding| finding.verdict() > Verdict::Good) {
            let why = format!(
                "candidates, delay, phase and weights of lines need whole periods, but {} does not consist of \
                 whole periods: its end does not meet its beginning",
                held.file
            );
            return Ok(Some(AnalysisError::Setting { setting: "nonlinear", why }));
        }
    }
    Ok(None)
}
