//! Tests of residuals in time: whiteness, and correlation with the forces.

use mechid_estimate::EstimateError;
use mechid_numerics::check_size;
use mechid_signal::Record;
use mechid_signal::correlation::{
    Correlation, autocorrelation, centred, cross_correlation_of_coloured, whiteness,
    whiteness_beyond,
};

use super::cross_correlation::CrossCorrelation;
use super::finding::Finding;
use super::limits::{ROUNDING, SIGNIFICANCE};
use super::p_value::CorrelationTest;
use super::whiteness::{NoiseSpan, Residual, Whiteness};

/// Tests every channel of a residual for whiteness and for correlation with the forces that act
/// (N).
///
/// `fitted` is the fitted signal on the same time axis; a residual that is only rounding always
/// passes. `noise_span` is the number of lags over which noise on the response correlates the
/// residual: 0 if each sample contains the noise of one sample, 1 if it contains the noise of two
/// consecutive samples ([`missing_force`](mechid_estimate::missing_force())), the window length
/// minus one after a sliding polynomial. If a residual is correlated over this span only, the
/// finding states this. The test of the correlation with a force allows for the autocorrelation of
/// the residual.
///
/// # Errors
/// As [`whiteness_beyond`], and [`EstimateError::Signal`] or
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if the records do not match.
///
/// # Source
/// As [`whiteness_beyond`] and the cross-correlation.
pub fn after_fit(
    residual: &Record,
    fitted: &Record,
    force: &Record,
    lags: usize,
    noise_span: usize,
) -> Result<Vec<Finding>, EstimateError> {
    residual.check_same_sampling(fitted)?;
    residual.check_same_sampling(force)?;
    check_size("channels of the residual", fitted.channels(), residual.channels())?;
    let mut findings = Vec::new();
    for channel in 0..residual.channels() {
        let e = residual.channel(channel);
        let rounding = residual.column(channel).norm() <= ROUNDING * fitted.column(channel).norm();
        let white = whiteness(e, lags)?;
        let beyond = whiteness_beyond(e, noise_span, lags)?;
        let span = (noise_span > 0 && is_noise(&beyond) && !is_noise(&white)).then(|| NoiseSpan {
            lags: noise_span,
            first_coefficient: white.coefficients[0],
            beyond: CorrelationTest::new(&beyond, rounding),
        });
        let (residual, test) =
            (Residual::Samples { residual: channel }, CorrelationTest::new(&white, rounding));
        findings.push(Finding::Whiteness(Whiteness { residual, test, span }));
        let residual_autocorrelation =
            residual_autocorrelation(e, lags, noise_span, [&white, &beyond].map(is_noise))?;
        let acts =
            |input: &usize| force.channel(*input).iter().any(|f| *f != force.data()[(0, *input)]);
        for input in (0..force.channels()).filter(acts) {
            let cross = cross_correlation_of_coloured(
                e,
                force.channel(input),
                lags,
                &residual_autocorrelation,
            )?;
            let test = CorrelationTest::new(&cross, rounding);
            findings.push(Finding::CrossCorrelation(CrossCorrelation {
                residual: channel,
                force: input,
                test,
            }));
        }
    }
    Ok(findings)
}

fn is_noise(correlation: &Correlation) -> bool {
    correlation.p_value >= SIGNIFICANCE
}

/// Returns the autocorrelation of a residual from lag 0 to its largest relevant lag.
fn residual_autocorrelation(
    residual: &[f64],
    lags: usize,
    span: usize,
    [white, spanned]: [bool; 2],
) -> Result<Vec<f64>, EstimateError> {
    if white {
        return Ok(vec![1.0]);
    }
    let e = centred(residual, lags, span)?;
    let mut coefficients = if spanned {
        autocorrelation(&e, span)
    } else {
        // The taper reduces coefficients at long lags, which are the least certain.
        let taper = |lag: usize| 1.0 - lag as f64 / (lags + span + 1) as f64;
        let estimate = autocorrelation(&e, lags + span);
        estimate.iter().enumerate().map(|(lag, c)| c * taper(lag)).collect()
    };
    // The added term covers the estimation error of the coefficients. Without this term, the error
    // would exceed the variance of the correlation with the force if the spectra of residual and
    // force hardly overlap.
    coefficients[0] += 2.0 / (e.len() as f64).sqrt();
    Ok(coefficients)
}
