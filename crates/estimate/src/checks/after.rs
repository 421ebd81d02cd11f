//! Whether residuals are noise: white, and unrelated to the input.

use mechid_signal::Record;

use super::correlation::{
    Correlation, autocorrelation, centred, cross_correlation_of_coloured, whiteness,
    whiteness_beyond,
};
use super::{Check, Subject, Verdict};
use crate::EstimateError;

/// A residual smaller than this share of what was fitted is rounding.
pub(super) const ROUNDING: f64 = 1e-9;

/// Noise has a larger statistic in one record of a hundred.
pub(super) const SIGNIFICANT: f64 = 0.01;

/// Whether every channel of a residual is white and has nothing in common with the forces that act,
/// in words; `fitted` is what the residual is left over from, on the same time axis.
///
/// `noise_span` is the number of lags over which noise on the motion correlates the residual: 0
/// where each sample of it holds the noise of one sample, 1 where it holds that of two which follow
/// one another ([`missing_force`](crate::missing_force())), the window less one after a sliding
/// polynomial. A residual correlated over that span and no further is told as such. Whether it has
/// anything in common with the force is judged with the colour it has.
///
/// A residual of rounding is good whatever its colour.
///
/// # Errors
/// As [`whiteness_beyond`], and [`EstimateError::Signal`] or [`EstimateError::Size`] if the records
/// do not belong together.
///
/// # Source
/// Those of [`whiteness_beyond`] and [`cross_correlation`](super::cross_correlation).
pub fn after_fit(
    residual: &Record,
    fitted: &Record,
    force: &Record,
    lags: usize,
    noise_span: usize,
) -> Result<Vec<Check>, EstimateError> {
    residual.check_same_sampling(fitted)?;
    residual.check_same_sampling(force)?;
    crate::least_squares::size("channels of the residual", fitted.channels(), residual.channels())?;
    let mut checks = Vec::new();
    for channel in 0..residual.channels() {
        let (e, number) = (residual.channel(channel), channel + 1);
        let size = fitted.column(channel).norm();
        let rounding = residual.column(channel).norm() <= ROUNDING * size;
        let white = whiteness(e, lags)?;
        let beyond = whiteness_beyond(e, noise_span, lags)?;
        let told =
            Told { subject: Subject::Whiteness, rounding, name: format!("residual {number}") };
        checks.push(if noise_span > 0 && is_noise(&beyond) && !is_noise(&white) {
            told.spanned(&white, &beyond, noise_span)
        } else {
            told.check(&white)
        });
        let colour = colour(e, lags, noise_span, [&white, &beyond].map(is_noise))?;
        let acts =
            |input: &usize| force.channel(*input).iter().any(|f| *f != force.data()[(0, *input)]);
        for input in (0..force.channels()).filter(acts) {
            let cross = cross_correlation_of_coloured(e, force.channel(input), lags, &colour)?;
            let name = format!("residual {number} with force {}", input + 1);
            let subject = Subject::CrossCorrelation;
            checks.push(Told { subject, rounding, name }.check(&cross));
        }
    }
    Ok(checks)
}

fn is_noise(correlation: &Correlation) -> bool {
    correlation.p_value >= SIGNIFICANT
}

/// The autocorrelation of a residual as far as it counts.
fn colour(
    residual: &[f64],
    lags: usize,
    span: usize,
    [white, spanned]: [bool; 2],
) -> Result<Vec<f64>, EstimateError> {
    if white {
        return Ok(vec![1.0]);
    }
    let e = centred(residual, lags, span)?;
    let mut own = if spanned {
        autocorrelation(&e, span)
    } else {
        // What is far apart is known least.
        let taper = |lag: usize| 1.0 - lag as f64 / (lags + span + 1) as f64;
        let own = autocorrelation(&e, lags + span);
        own.iter().enumerate().map(|(lag, c)| c * taper(lag)).collect()
    };
    // Where colours of residual and force hardly meet, what is left must not be smaller than the
    // error of these coefficients.
    own[0] += 2.0 / (e.len() as f64).sqrt();
    Ok(own)
}

/// What a check is about.
struct Told {
    subject: Subject,
    rounding: bool,
    name: String,
}

impl Told {
    fn check(self, found: &Correlation) -> Check {
        let Self { subject, rounding, name } = self;
        let value = found.p_value;
        if rounding {
            let text = format!("{name}: rounding, whatever its correlations");
            return Check { subject, verdict: Verdict::Good, value, text };
        }
        let (verdict, meaning) = match (subject, is_noise(found)) {
            (Subject::Whiteness, true) => (Verdict::Good, "white, as noise is"),
            (Subject::Whiteness, false) => (
                Verdict::Doubtful,
                "not white: the noise is coloured, or the model misses something",
            ),
            (_, true) => (Verdict::Good, "nothing in common"),
            (_, false) => {
                (Verdict::Doubtful, "the model leaves some of the force's doing unexplained")
            }
        };
        let text = format!("{name}: {}; {meaning}", counted(found));
        Check { subject, verdict, value, text }
    }

    /// Of a residual that is correlated over the span of the noise and no further.
    fn spanned(self, white: &Correlation, beyond: &Correlation, span: usize) -> Check {
        if self.rounding {
            return self.check(white);
        }
        let text = format!(
            "{}: correlated up to lag {span} ({:.2} at lag 1), and no further: beyond it {}; so \
             does noise on the measured motion, which least squares takes as exact: the parameters \
             are biased by it, more than their standard errors show",
            self.name,
            white.coefficients[0],
            counted(beyond),
        );
        Check { subject: self.subject, verdict: Verdict::Doubtful, value: white.p_value, text }
    }
}

pub(super) fn counted(found: &Correlation) -> String {
    let (outside, count) = (found.outside(), found.coefficients.len());
    let bound = found.bound;
    let p = p_told(found.p_value);
    format!("{outside} of {count} correlations beyond the 95 % bound of {bound:.3}, {p}")
}

pub(super) fn p_told(p_value: f64) -> String {
    // A distribution function does not resolve the rest.
    match p_value {
        p if p < 1e-15 => "p < 1e-15".to_owned(),
        p if p < 1e-3 => format!("p = {p:.1e}"),
        p => format!("p = {p:.3}"),
    }
}
