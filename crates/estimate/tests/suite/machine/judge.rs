//! Coverage and scatter over many seeds.

use mechid_estimate::likelihood::LikelihoodEstimate;
use rayon::prelude::*;

/// Quality of the intervals and standard errors of many experiments.
#[derive(Debug)]
pub struct Judged {
    /// Share of the intervals that contain the truth, over all parameters.
    pub coverage: f64,
    /// Smallest share, among the parameters, of intervals that contain the truth.
    pub worst_coverage: f64,
    /// Root mean square, over all parameters, of the ratio of RMS error to RMS standard error.
    pub scatter: f64,
    /// Largest ratio of RMS error to RMS standard error of a parameter.
    pub worst_scatter: f64,
    /// Largest absolute mean error of a parameter, divided by the standard error of this mean.
    pub bias: f64,
    /// Number of experiments whose search failed.
    pub failed: usize,
}

/// Runs `experiment` for the seeds from 0 to `seeds` − 1 and compares the estimates with the true
/// values. `truth` pairs the name of each parameter with its true value.
pub fn judge(
    truth: &[(String, f64)],
    seeds: u64,
    experiment: impl Fn(u64) -> Option<LikelihoodEstimate> + Sync + Send,
) -> Judged {
    let estimates: Vec<_> = (0..seeds).into_par_iter().map(experiment).collect();
    let failed = estimates.iter().filter(|estimate| estimate.is_none()).count();
    let estimates: Vec<LikelihoodEstimate> = estimates.into_iter().flatten().collect();
    let runs = estimates.len() as f64;
    let (mut coverage, mut scatter): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut bias = 0.0_f64;
    for (name, truth) in truth {
        let (mut inside, mut errors, mut variances, mut sum) = (0.0, 0.0_f64, 0.0_f64, 0.0_f64);
        for estimate in &estimates {
            let p = estimate.parameter(name).unwrap();
            inside += f64::from(u8::from((p.interval[0]..=p.interval[1]).contains(truth)));
            errors += (p.value - truth).powi(2);
            sum += p.value - truth;
            variances += p.standard_error.map_or(0.0, |error| error * error);
        }
        coverage.push(inside / runs);
        scatter.push((errors / variances).sqrt());
        bias = bias.max((sum / variances.sqrt()).abs());
    }
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    Judged {
        coverage: mean(&coverage),
        worst_coverage: coverage.iter().copied().fold(1.0, f64::min),
        scatter: mean(&scatter.iter().map(|s| s * s).collect::<Vec<_>>()).sqrt(),
        worst_scatter: scatter.iter().copied().fold(0.0, f64::max),
        bias,
        failed,
    }
}
