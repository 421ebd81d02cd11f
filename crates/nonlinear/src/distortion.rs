//! Distortion: evidence against a linear system at the level of the force, before any model of it.

use std::fmt;

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{Coordinate, Power, QuadraticDamping, ResponseQuantity, Term, Terms};
use mechid_numerics::least_squares::LeastSquares;
use mechid_signal::Record;
use mechid_spectra::{Lines, Pooling, RepeatedPeriods};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::equation_error::weighted;
use super::equations::Equations;
use super::shape::{Shape, ShapeConstants};
use super::weighting::as_response;
use super::{SteadyExperiments, Weighting};
use crate::limits::{DISTORTION_DRIVEN, DISTORTION_PAIRS, DISTORTION_SIGNIFICANT};

/// Response on lines without force, against that on lines with force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Level {
    /// Ratio of the RMS on these lines, less what noise puts there, to that on the driven lines, in
    /// dB; −∞ if there is no more than noise.
    pub db: f64,
    /// Number of lines.
    pub lines: usize,
    /// Power on these lines over that of the noise, a pure number; `None` of a single period.
    pub over_noise: Option<f64>,
}

/// Share of the residual of a linear model that a term of one kind explains.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// The term.
    pub term: Term,
    /// Name in words, such as `cubic stiffness of x1`.
    pub name: String,
    /// Coefficient if the term is the only one, in the unit of the term.
    pub coefficient: f64,
    /// Part of the squared equation error of a linear model that it explains, a ratio.
    pub explained: f64,
    /// Probability that noise alone makes one of the kinds explain as much.
    pub p_value: f64,
}

/// Evidence against a linear system in steady periods.
#[derive(Debug, Clone, PartialEq)]
pub struct Distortion {
    /// Level on even lines, where odd ones alone are driven: even nonlinearities, such as x².
    pub even: Option<Level>,
    /// Level on odd lines that are not driven: odd nonlinearities, such as x³.
    pub odd: Option<Level>,
    /// Part of the force, a ratio, that a linear model leaves on the lines of the band, each weighted
    /// as the response of the linear model to it.
    pub linear_leaves: f64,
    /// The kinds of terms, the one that explains most first.
    pub kinds: Vec<Kind>,
}

/// Kinds of terms that are looked for: exponents of displacement and velocity, and their name;
/// quadratic damping has none.
const KINDS: [(Option<[u32; 2]>, &str); 4] = [
    (Some([2, 0]), "quadratic stiffness"),
    (Some([3, 0]), "cubic stiffness"),
    (None, "quadratic damping"),
    (Some([0, 3]), "cubic damping"),
];

/// Looks for even and odd distortion, and for the one term that explains most of what a linear model
/// leaves, in whole periods of force (N) and response of one or several experiments at the lines of a band.
///
/// The linear model is one for all experiments, none of which need determine it alone. The levels are those of the
/// experiment where they are largest.
///
/// What a nonlinear system adds stands on the sums and differences of the driven lines: of odd lines
/// an even power fills the even ones, an odd power the odd ones. Where all odd lines are driven, odd
/// distortion hides beneath the linear response; there the squares and cubes of displacement and
/// velocity, as columns of the equation error, show it all the same.
///
/// # Errors
/// As [`equation_error`](super::equation_error), and as [`RepeatedPeriods::new`].
///
/// # Source
/// Schoukens, Vaes & Pintelon (2016), IEEE Control Systems 36(3), 38–69 (detection lines); Kerschen,
/// Worden, Vakakis & Golinval (2006), Mechanical Systems and Signal Processing 20, 505–592.
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
    let (linear_leaves, kinds) = kinds(&data, unknowns)?;
    let lines = Lines::new(lines.sampling(), data.lines().iter().copied())?;
    let [mut even, mut odd] = [None::<Level>; 2];
    for [force, response] in experiments {
        let found = levels(&lines, force, response, measured)?;
        for (most, found) in [&mut even, &mut odd].into_iter().zip(found) {
            if most.is_none_or(|most| found.is_some_and(|found| found.db > most.db)) {
                *most = found;
            }
        }
    }
    Ok(Distortion { even, odd, linear_leaves, kinds })
}

/// Levels on even lines, and on odd ones that are not driven, where odd lines alone are driven.
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
    let level = |parity: usize| match odd_only {
        true => level(lines, force, response, measured, &driven, &free(parity)),
        false => Ok(None),
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
            let of = |row: usize| (0..n).map(|i| noise.covariance(row)[(i, i)].re).sum::<f64>();
            Some((0..free.len()).map(of).sum::<f64>())
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

/// Returns the part of the force that a linear model leaves, and the kinds of terms by what they explain of it.
fn kinds(data: &SteadyExperiments, unknowns: &Unknowns) -> Result<(f64, Vec<Kind>), EstimateError> {
    let (terms, names) = candidates(data.dof())?;
    // As responses for how much a kind explains; as likely as can be for whether that is chance.
    let size = OneByOne::new(data, unknowns, &terms, Weighting::Response)?;
    let chance = OneByOne::new(data, unknowns, &terms, Weighting::Automatic)?;
    let spare = chance.spare as f64;
    let fisher = FisherSnedecor::new(1.0, spare).expect("positive degrees of freedom");
    let mut kinds = Vec::new();
    for (at, (term, name)) in terms.iter().zip(names).enumerate() {
        let (after, _) = chance.with(at)?;
        let fall = (chance.without - after).max(0.0);
        let ratio = if after > 0.0 { fall / after * spare } else { 0.0 };
        let p_value = (terms.len() as f64 * fisher.sf(ratio)).min(1.0);
        let (after, coefficient) = size.with(at)?;
        let before = size.without;
        let explained = if before > 0.0 { (1.0 - after / before).max(0.0) } else { 0.0 };
        kinds.push(Kind { term: term.clone(), name, coefficient, explained, p_value });
    }
    kinds.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    Ok(((size.without / size.all).sqrt(), kinds))
}

/// A linear fit that one term after the other joins.
struct OneByOne {
    /// \[A | b\] of the linear columns, the terms and the force.
    rows: LeastSquares,
    linear: Vec<usize>,
    /// Weighted squares of the force, and what the linear columns leave of them.
    all: f64,
    without: f64,
    /// Equations less parameters of a fit with one term.
    spare: usize,
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
        let of_rows = match weighting {
            // Between the equations of motion, too: a term is part of one of them, or of two.
            Weighting::Response => as_response(&base, &fit.coefficients),
            _ => None,
        };
        let of_rows = of_rows.as_ref().unwrap_or(&fit.weights.of_rows);
        let equations = Equations::new(data, unknowns, terms)?;
        let mut rows = LeastSquares::new(equations.count(), 1);
        for columns in equations.columns(terms, &none.channels()) {
            equations.push(&mut rows, &columns, of_rows, &[])?;
        }
        let linear: Vec<usize> = (0..equations.free.len()).collect();
        let all = rows.triangle().column(equations.count()).norm_squared();
        let spare = equations.equations().saturating_sub(linear.len() + 1).max(1);
        let mut sizes = Self { rows, linear, all, without: 0.0, spare };
        sizes.without = sizes.solve(&sizes.linear)?.0;
        Ok(sizes)
    }

    /// Returns the part that is left with one of the terms, and its coefficient.
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

fn candidates(dof: usize) -> Result<(Terms, Vec<String>), EstimateError> {
    let single = (0..dof).map(Coordinate::Dof);
    let pairs = (0..dof).flat_map(|i| (i + 1..dof).map(move |j| Coordinate::Difference(i, j)));
    let (mut terms, mut names) = (Vec::new(), Vec::new());
    for place in single.chain(pairs.filter(|_| dof <= DISTORTION_PAIRS)) {
        for (exponents, name) in KINDS {
            let coefficient = format!("t_{}", terms.len() + 1);
            terms.push(match exponents {
                Some([p, r]) => Term::new(coefficient, place, Power::new(p, r)?)?,
                None => Term::new(coefficient, place, QuadraticDamping)?,
            });
            names.push(match place {
                Coordinate::Dof(i) => format!("{name} of x{}", i + 1),
                Coordinate::Difference(i, j) => format!("{name} between x{} and x{}", i + 1, j + 1),
            });
        }
    }
    Ok((Terms::new(terms)?, names))
}

impl Distortion {
    /// The kind of term that a linear model lacks most; `None` if what it leaves is consistent with
    /// noise.
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
                "no square or cube of displacement or velocity explains what a linear model leaves: \
                 consistent with a linear system",
            )?,
            Some(kind) => write!(
                f,
                "nonlinear: {kind} explains {:.1} % of the power that a linear model leaves",
                100.0 * kind.explained
            )?,
        }
        let mut write_level = |name: &str, level: Option<Level>| match level {
            Some(level) if level.db.is_finite() => {
                write!(f, "; {name} distortion {:.0} dB against the response", level.db)
            }
            Some(_) => write!(f, "; no {name} distortion above the noise"),
            None => Ok(()),
        };
        write_level("even", self.even)?;
        write_level("odd", self.odd)
    }
}
