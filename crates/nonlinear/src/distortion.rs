//! Nonlinear distortion: evidence that, at this level of the force, the system is not linear. No
//! nonlinear model is fitted.

use std::fmt;

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{ResponseQuantity, Term, Terms};
use mechid_numerics::least_squares::LeastSquares;
use mechid_signal::Record;
use mechid_spectra::{Lines, Pooling, RepeatedPeriods};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::equation_error::weighted;
use super::equations::Equations;
use super::kinds::tested_kinds;
use super::shape::{Shape, ShapeConstants};
use super::weighting::as_response;
use super::{SteadyExperiments, Weighting};
use crate::limits::{DISTORTION_DRIVEN, DISTORTION_SIGNIFICANT};

/// Response on lines without force, relative to the response on lines with force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Level {
    /// Ratio of the RMS value of the response on the lines without force, after subtraction of the
    /// noise power, to the RMS value on the driven lines, in dB; −∞ if there is only noise.
    pub db: f64,
    /// Number of lines.
    pub lines: usize,
    /// Ratio of the power on the lines without force to the noise power; `None` for a single
    /// period.
    pub over_noise: Option<f64>,
}

/// Kind of term, with the fraction of the residual of a linear model that such a term explains.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// The term.
    pub term: Term,
    /// Name in words, such as `cubic stiffness of x1`.
    pub name: String,
    /// Coefficient of the term, in its SI unit, in a fit in which it is the only nonlinear term.
    pub coefficient: f64,
    /// Fraction of the squared equation error of a linear model that the term explains.
    pub explained: f64,
    /// Probability that noise alone makes at least one of the kinds explain this fraction or more.
    pub p_value: f64,
}

/// Evidence against a linear system in steady periods.
#[derive(Debug, Clone, PartialEq)]
pub struct Distortion {
    /// Level on even lines if only odd lines are driven; it shows even nonlinearities, such as x².
    pub even: Option<Level>,
    /// Level on odd lines that are not driven; it shows odd nonlinearities, such as x³.
    pub odd: Option<Level>,
    /// Fraction (RMS) of the force that a linear model does not explain, on the lines of the band.
    /// Each line is weighted by the receptance of the linear model.
    pub linear_unexplained: f64,
    /// Kinds of terms, in descending order of the explained fraction.
    pub kinds: Vec<Kind>,
}

/// Detects even and odd distortion, and finds the single term that explains most of the residual of
/// a linear model. The data are whole periods of force (N) and response of one or several
/// experiments, on the lines of a band.
///
/// All experiments have the same linear model. It is sufficient that all experiments together
/// determine this model; a single experiment need not. The levels are those of the experiment with
/// the largest level.
///
/// A nonlinear system responds at sums and differences of the driven lines: if odd lines are
/// driven, an even power responds at even lines and an odd power at odd lines. If all odd lines are
/// driven, odd distortion coincides with the linear response; the squares and cubes of displacement
/// and velocity, as regressors of the equation error, still detect it.
///
/// # Errors
/// As [`equation_error`](super::equation_error), and as [`RepeatedPeriods::new`].
///
/// # Source
/// Schoukens, Vaes & Pintelon (2016), IEEE Control Systems 36(3), 38–69 (detection lines);
/// Kerschen, Worden, Vakakis & Golinval (2006), Mechanical Systems and Signal Processing 20,
/// 505–592.
pub fn distortion(
    lines: &Lines,
    experiments: &[[&Record; 2]],
    measured: ResponseQuantity,
    unknowns: &Unknowns,
) -> Result<Distortion, EstimateError> {
    let mut data = SteadyExperiments::new(lines, unknowns.dof(), measured);
    for [force, response] in experiments {
        data.push(force, response)?;
    }
    let (linear_unexplained, kinds) = kinds(&data, unknowns)?;
    let lines = Lines::new(lines.sampling(), data.lines().iter().copied())?;
    let [mut even, mut odd] = [None::<Level>; 2];
    for [force, response] in experiments {
        let experiment = levels(&lines, force, response, measured)?;
        for (most, level) in [&mut even, &mut odd].into_iter().zip(experiment) {
            if most.is_none_or(|most| level.is_some_and(|level| level.db > most.db)) {
                *most = level;
            }
        }
    }
    Ok(Distortion { even, odd, linear_unexplained, kinds })
}

/// Returns the level on even lines without force and the level on odd lines without force. Both are
/// `None` unless only odd lines are driven.
fn levels(
    lines: &Lines,
    force: &Record,
    response: &Record,
    measured: ResponseQuantity,
) -> Result<[Option<Level>; 2], EstimateError> {
    let mean = force.period_mean(lines.sampling().len())?;
    let driven = Lines::excited(&mean, DISTORTION_DRIVEN)?.as_slice().to_vec();
    let odd_only = !driven.is_empty() && driven.iter().all(|line| line % 2 == 1);
    let free = |parity: usize| -> Vec<usize> {
        let chosen = lines.as_slice().iter().filter(|n| **n % 2 == parity && !driven.contains(n));
        chosen.copied().collect()
    };
    let level = |parity: usize| {
        if odd_only {
            level(lines, force, response, measured, &driven, &free(parity))
        } else {
            Ok(None)
        }
    };
    Ok([level(0)?, level(1)?])
}

fn level(
    band: &Lines,
    force: &Record,
    response: &Record,
    measured: ResponseQuantity,
    driven: &[usize],
    free: &[usize],
) -> Result<Option<Level>, EstimateError> {
    let last = driven.last().copied().unwrap_or(0);
    let free: Vec<usize> = free.iter().filter(|line| **line <= last).copied().collect();
    if free.is_empty() {
        return Ok(None);
    }
    let read = |chosen: &[usize]| {
        let lines = Lines::new(band.sampling(), chosen.iter().copied())?;
        RepeatedPeriods::new(&lines, force, response, measured)
    };
    let (on, off) = (read(driven)?, read(&free)?);
    let power = |periods: &RepeatedPeriods| -> Result<f64, EstimateError> {
        Ok(periods.mean()?.displacement().norm_squared())
    };
    let noise = match off.count() {
        1 => None,
        _ => {
            let (noise, n) = (off.noise(Pooling::PerLine)?, response.channels());
            let variance =
                |row: usize| (0..n).map(|i| noise.covariance(row)[(i, i)].re).sum::<f64>();
            Some((0..free.len()).map(variance).sum::<f64>())
        }
    };
    let total = power(&off)?;
    let above = (total - noise.unwrap_or(0.0)).max(0.0);
    Ok(Some(Level {
        db: 10.0 * (above / power(&on)?).log10(),
        lines: free.len(),
        over_noise: noise.map(|noise| if noise > 0.0 { total / noise } else { f64::INFINITY }),
    }))
}

/// Returns the fraction of the force that a linear model does not explain, and the kinds of terms
/// in descending order of the fraction that each of them explains.
fn kinds(data: &SteadyExperiments, unknowns: &Unknowns) -> Result<(f64, Vec<Kind>), EstimateError> {
    let (terms, names) = tested_kinds(data.dof())?;
    // The explained share is computed with the weighting `Response`, its p-value with the most
    // likely weights.
    let size = OneByOne::new(data, unknowns, &terms, Weighting::Response)?;
    let chance = OneByOne::new(data, unknowns, &terms, Weighting::Automatic)?;
    let residual_freedom = chance.residual_freedom as f64;
    let fisher = FisherSnedecor::new(1.0, residual_freedom).expect("positive degrees of freedom");
    let mut kinds = Vec::new();
    for (at, (term, name)) in terms.iter().zip(names).enumerate() {
        let (after, _) = chance.with(at)?;
        let fall = (chance.linear_residual - after).max(0.0);
        let ratio = if after > 0.0 { fall / after * residual_freedom } else { 0.0 };
        let p_value = (terms.len() as f64 * fisher.sf(ratio)).min(1.0);
        let (after, coefficient) = size.with(at)?;
        let before = size.linear_residual;
        let explained = if before > 0.0 { (1.0 - after / before).max(0.0) } else { 0.0 };
        kinds.push(Kind { term: term.clone(), name, coefficient, explained, p_value });
    }
    kinds.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    Ok(((size.linear_residual / size.total).sqrt(), kinds))
}

/// Linear fit to which one term at a time is added.
struct OneByOne {
    /// Least-squares rows \[A | b\]: A has the linear columns and one column for each term, b is
    /// the force.
    rows: LeastSquares,
    linear: Vec<usize>,
    /// Sum of the weighted squares of the force (`total`), and of the residual of the linear fit
    /// (`linear_residual`).
    total: f64,
    linear_residual: f64,
    /// Number of equations minus number of parameters, in a fit with one term.
    residual_freedom: usize,
}

impl OneByOne {
    fn new(
        data: &SteadyExperiments,
        unknowns: &Unknowns,
        terms: &Terms,
        weighting: Weighting,
    ) -> Result<Self, EstimateError> {
        let base = Equations::new(data, unknowns, &Terms::none())?;
        let none = Shape::new(&Terms::none(), ShapeConstants::default());
        let fit = weighted(&base, &none, weighting, None)?;
        let row_weights = match weighting {
            // The weights of this kind also scale the equations of motion relative to one another.
            // This is necessary because a term can act in two equations.
            Weighting::Response => as_response(&base, &fit.coefficients),
            _ => None,
        };
        let row_weights = row_weights.as_ref().unwrap_or(&fit.weights.of_rows);
        let equations = Equations::new(data, unknowns, terms)?;
        let mut rows = LeastSquares::new(equations.count(), 1);
        for columns in equations.columns(terms, &none.channels()) {
            equations.push(&mut rows, &columns, row_weights, &[])?;
        }
        let linear: Vec<usize> = (0..equations.free.len()).collect();
        let total = rows.triangle().column(equations.count()).norm_squared();
        let residual_freedom = equations.equations().saturating_sub(linear.len() + 1).max(1);
        let mut sizes = Self { rows, linear, total, linear_residual: 0.0, residual_freedom };
        sizes.linear_residual = sizes.solve(&sizes.linear)?.0;
        Ok(sizes)
    }

    /// Returns the sum of squares of the residual of a fit with one of the terms, and the
    /// coefficient of this term.
    fn with(&self, term: usize) -> Result<(f64, f64), EstimateError> {
        self.solve(&[&self.linear[..], &[self.linear.len() + term]].concat())
    }

    fn solve(&self, chosen: &[usize]) -> Result<(f64, f64), EstimateError> {
        let r = self.rows.triangle();
        let target = r.columns(r.ncols() - 1, 1);
        let mut rows = LeastSquares::new(chosen.len(), 1);
        rows.push_rows(r.select_columns(chosen).as_view(), target.as_view())?;
        let solution = rows.solve()?;
        let last = chosen.len().checked_sub(1).map_or(0.0, |at| solution.coefficients[(at, 0)]);
        Ok((solution.residuals.norm_squared(), last))
    }
}

impl Distortion {
    /// Returns the kind of term that explains most of the residual of a linear model; `None` if the
    /// explained fraction is consistent with noise.
    pub fn kind(&self) -> Option<&Kind> {
        self.kinds.first().filter(|kind| kind.p_value < DISTORTION_SIGNIFICANT)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        let [metre, second] = self.term.law().dimension();
        match (second == 0 && metre == 3, self.coefficient > 0.0) {
            (true, true) => f.write_str(" (hardening)"),
            (true, false) => f.write_str(" (softening)"),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Distortion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind() {
            None => f.write_str(
                "no square or cube of displacement or velocity explains the residual of a linear model: \
                 consistent with a linear system",
            )?,
            Some(kind) => write!(
                f,
                "nonlinear: {kind} explains {:.1} % of the residual power of a linear model",
                100.0 * kind.explained
            )?,
        }
        let mut write_level = |name: &str, level: Option<Level>| match level {
            Some(level) if level.db.is_finite() => {
                write!(f, "; {name} distortion {:.0} dB relative to the response", level.db)
            }
            Some(_) => write!(f, "; no {name} distortion above the noise"),
            None => Ok(()),
        };
        write_level("even", self.even)?;
        write_level("odd", self.odd)
    }
}
