//! The noise study of the book (`studies/force.md`): displacement only, noise of 1 % and 5 %, every method.
//!
//! Used by the example that writes the tables and by the test that checks them.

use mechid_force::{
    Filter, ForceUnknowns, IdentifiedForce, Measurement, Noise, Rule, Start, Tuning, continuous,
    discretised, frequency_domain, inner_lines, kalman, regularised,
};
use mechid_model::{
    Discretisation, KyxSign, Response, ResponseQuantity, SecondOrderSystem, npi_sampling,
};
use mechid_problems::{dissertation_bearing, dissertation_sdof, exact_harmonic_periodic};
use mechid_signal::{Extent, Multisine, NoiseLevel, Phases, Record, Sampling, Spectrum, noise};
use nalgebra::DMatrix;

pub mod accelerations;
pub mod coverage;

/// Returns the single oscillator or the bearing of the dissertation, and the time axis of its
/// period.
pub fn machine(bearing: bool) -> (SecondOrderSystem, Sampling) {
    if bearing {
        let sampling = npi_sampling(10.0, 256, 1.799248).unwrap();
        (dissertation_bearing(KyxSign::Minus).system(), sampling)
    } else {
        let machine = dissertation_sdof();
        let sampling = npi_sampling(20.0, 256, machine.natural_frequency()).unwrap();
        (machine.system(), sampling)
    }
}

/// Noise realisations per case.
pub const SEEDS: u64 = 10;

/// A machine in steady state under a flat multisine on its last degree of freedom.
pub struct Case {
    pub name: &'static str,
    pub system: SecondOrderSystem,
    pub force: Record,
    pub lines: Vec<usize>,
    pub level: f64,
    exact: Record,
}

impl Case {
    pub fn new(name: &'static str, bearing: bool, lines: Vec<usize>, level: f64) -> Self {
        let (system, sampling) = machine(bearing);
        let drive = Multisine::flat(lines.clone(), 50.0, Phases::Schroeder).unwrap();
        let drive = drive.sample(sampling).unwrap();
        let dof = system.dof();
        let force = DMatrix::from_fn(sampling.len(), dof, |k, i| {
            if i + 1 == dof { drive.channel(0)[k] } else { 0.0 }
        });
        let force = Record::new(sampling, force).unwrap();
        let response = exact_harmonic_periodic(&system, &force).unwrap();
        let exact = response.displacement().clone();
        Self { name, system, force, lines, level, exact }
    }

    pub fn forced(&self) -> [usize; 1] {
        [self.system.dof() - 1]
    }

    /// Standard deviation of the noise in each channel.
    fn noise(&self) -> Vec<f64> {
        let rms = |norm: f64| norm / (self.exact.len() as f64).sqrt();
        self.exact.data().column_iter().map(|x| self.level * rms(x.norm())).collect()
    }

    /// Displacements with noise.
    pub fn measured(&self, seed: u64) -> Measurement {
        let level = NoiseLevel::FractionOfRms(self.level);
        let noisy = noise::add_white(&self.exact, level, seed).unwrap();
        Measurement::from_record(ResponseQuantity::Displacement, noisy)
    }

    /// Returns ‖F̂ − F‖ / ‖F‖. A force that is held over a step has no value at the last sample;
    /// the value of the last step is used.
    pub fn error(&self, found: &IdentifiedForce) -> f64 {
        mechid_force::relative_error(found.record(), &self.force).unwrap()
    }

    /// Expected ‖F̂ − F‖ / ‖F‖ of the best unbiased estimate at the excited lines (Cramér-Rao).
    pub fn floor(&self) -> f64 {
        let len = self.force.len() as f64;
        let mut variance = 0.0;
        for n in &self.lines {
            let receptance =
                self.system.receptance(*n as f64 * self.force.sampling().omega0()).unwrap();
            let information: f64 = self
                .exact
                .data()
                .column_iter()
                .zip(receptance.column(self.forced()[0]).iter())
                .map(|(x, h)| h.norm_sqr() * len / (self.level * self.level * x.norm_squared()))
                .sum();
            // The real part of the amplitude has the variance 2/(N Σ|h|²/σ²), and so has the
            // imaginary part.
            variance += 2.0 / len / information;
        }
        (variance * len).sqrt() / self.force.data().norm()
    }
}

/// The four cases of the study: both machines, both levels, lines 1 to 40 of 127.
pub fn cases() -> Vec<Case> {
    [("SDOF, 1 %", false, 0.01), ("SDOF, 5 %", false, 0.05)]
        .into_iter()
        .chain([("bearing, 1 %", true, 0.01), ("bearing, 5 %", true, 0.05)])
        .map(|(name, bearing, level)| Case::new(name, bearing, (1..=40).collect(), level))
        .collect()
}

/// Returns cases with other sets of excited lines, for the comparison of the rules for λ.
pub fn rule_cases() -> Vec<Case> {
    let sets: [(&'static str, bool, Vec<usize>); 5] = [
        ("SDOF, lines 1–127", false, (1..=127).collect()),
        ("SDOF, lines 1–40", false, (1..=40).collect()),
        ("SDOF, lines 1–8", false, (1..=8).collect()),
        ("SDOF, every fifth to 61", false, (1..=61).step_by(5).collect()),
        ("bearing, lines 1–40", true, (1..=40).collect()),
    ];
    sets.into_iter()
        .flat_map(|(name, bearing, lines)| {
            [0.01, 0.05].map(|level| Case::new(name, bearing, lines.clone(), level))
        })
        .collect()
}

/// Returns the displacement of a period with velocity and acceleration by central differences, as a
/// practitioner computes them.
fn differenced(x: &Record) -> Response {
    let (len, dt) = (x.len(), x.sampling().dt());
    let at = |k: usize, c: usize| x.data()[(k % len, c)];
    let record = |f: &dyn Fn(usize, usize) -> f64| {
        Record::new(x.sampling(), DMatrix::from_fn(len, x.channels(), f)).unwrap()
    };
    let velocity = |k, c| (at(k + 1, c) - at(k + len - 1, c)) / (2.0 * dt);
    let acceleration = |k, c| (at(k + 1, c) - 2.0 * at(k, c) + at(k + len - 1, c)) / (dt * dt);
    Response::new(x.clone(), record(&velocity), record(&acceleration)).unwrap()
}

pub type Method = (&'static str, fn(&Case, &Measurement) -> IdentifiedForce);

fn discretised_from(case: &Case, m: &Measurement, how: Discretisation) -> IdentifiedForce {
    discretised(&case.system, &differenced(m.record()), how, Extent::WholePeriod).unwrap()
}

pub fn filtered(case: &Case, m: &Measurement, filter: Filter) -> IdentifiedForce {
    let (system, forced) = (&case.system, case.forced());
    regularised(system, m, &forced, &ForceUnknowns::EveryLine, filter, &Noise::Unknown)
        .unwrap()
        .force
}

fn at_lines(case: &Case, m: &Measurement, lines: &[usize]) -> IdentifiedForce {
    frequency_domain(&case.system, m, &case.forced(), lines, &Noise::Unknown).unwrap()
}

/// The methods that use the list of excited lines.
pub const KNOWN: [Method; 3] = [
    ("frequency domain, excited lines", |c, m| at_lines(c, m, &c.lines)),
    ("Tikhonov on the excited lines, likelihood", |c, m| {
        let (extent, filter) =
            (ForceUnknowns::Lines(c.lines.clone()), Filter::Tikhonov(Rule::Likelihood));
        let noise = Noise::Unknown;
        regularised(&c.system, m, &c.forced(), &extent, filter, &noise).unwrap().force
    }),
    ("truncated SVD on the excited lines, likelihood", |c, m| {
        let (extent, filter) =
            (ForceUnknowns::Lines(c.lines.clone()), Filter::TruncatedSvd(Rule::Likelihood));
        let noise = Noise::Unknown;
        regularised(&c.system, m, &c.forced(), &extent, filter, &noise).unwrap().force
    }),
];

/// The methods that do not use the list of excited lines.
pub const UNKNOWN: [Method; 13] = [
    ("continuous, differences for ẋ and ẍ", |c, m| {
        continuous(&c.system, &differenced(m.record())).unwrap()
    }),
    ("discretised, Euler, differences for ẋ", |c, m| {
        discretised_from(c, m, Discretisation::Euler)
    }),
    ("discretised, exact held, differences for ẋ", |c, m| {
        discretised_from(c, m, Discretisation::ZeroOrderHold)
    }),
    ("frequency domain, every line", |c, m| at_lines(c, m, &inner_lines(m))),
    ("Tikhonov, likelihood", |c, m| filtered(c, m, Filter::Tikhonov(Rule::Likelihood))),
    ("Tikhonov, GCV", |c, m| filtered(c, m, Filter::Tikhonov(Rule::Gcv))),
    ("Tikhonov, L-curve", |c, m| filtered(c, m, Filter::Tikhonov(Rule::LCurve))),
    ("truncated SVD, likelihood", |c, m| filtered(c, m, Filter::TruncatedSvd(Rule::Likelihood))),
    ("truncated SVD, GCV", |c, m| filtered(c, m, Filter::TruncatedSvd(Rule::Gcv))),
    ("truncated SVD, L-curve", |c, m| filtered(c, m, Filter::TruncatedSvd(Rule::LCurve))),
    ("shrinkage", |c, m| filtered(c, m, Filter::Shrinkage)),
    ("Kalman smoother, likelihood", |c, m| {
        kalman(&c.system, m, &c.forced(), Start::InMotion, &Tuning::Likelihood).unwrap().force
    }),
    ("Kalman smoother, likelihood, noise level known", |c, m| {
        let tuning = Tuning::NoiseKnown(c.noise());
        kalman(&c.system, m, &c.forced(), Start::InMotion, &tuning).unwrap().force
    }),
];

/// Returns the RMS value of the relative error over all seeds.
pub fn rms_error(case: &Case, method: Method) -> f64 {
    let squares = (1..=SEEDS).map(|s| case.error(&method.1(case, &case.measured(s))).powi(2));
    (squares.sum::<f64>() / SEEDS as f64).sqrt()
}

/// Returns all values of the parameter that the search for the best value tries, from strong
/// regularisation to none.
fn parameters(case: &Case) -> Vec<f64> {
    let gain = case.system.stiffness().row(case.system.dof() - 1).amax().recip();
    // Each channel is divided by its RMS value, so the largest singular value is about the gain
    // divided by the RMS value.
    let size = case.exact.data().column(case.system.dof() - 1).norm() / 16.0;
    (0..=300).map(|j| 30.0 * gain / size * 10f64.powf(-f64::from(j) / 50.0)).collect()
}

/// Error with one rule for λ divided by the error with the best λ: mean and maximum over the seeds.
pub struct Ratio {
    pub mean: f64,
    pub worst: f64,
}

/// Returns the error with each rule divided by the error with the best parameter, for likelihood,
/// GCV, L-curve, and the textbook corner of the whole L-curve, which is not one of the crate's
/// rules.
pub fn rule_ratios(case: &Case, make: fn(Rule) -> Filter) -> [Ratio; 4] {
    let mut ratios: [Vec<f64>; 4] = std::array::from_fn(|_| Vec::new());
    for seed in 1..=SEEDS {
        let m = case.measured(seed);
        let trials: Vec<IdentifiedForce> = parameters(case)
            .into_iter()
            .map(|lambda| filtered(case, &m, make(Rule::Given(lambda))))
            .collect();
        let errors: Vec<f64> = trials.iter().map(|f| case.error(f)).collect();
        let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
        for (list, rule) in ratios.iter_mut().zip([Rule::Likelihood, Rule::Gcv, Rule::LCurve]) {
            list.push(case.error(&filtered(case, &m, make(rule))) / best);
        }
        ratios[3].push(errors[textbook_corner(case, &m, &trials)] / best);
    }
    ratios.map(|list| Ratio {
        mean: list.iter().sum::<f64>() / list.len() as f64,
        worst: list.iter().copied().fold(0.0, f64::max),
    })
}

/// Returns the index of the parameter with the maximum curvature of log ‖residual‖ against log
/// ‖force‖.
fn textbook_corner(case: &Case, m: &Measurement, trials: &[IdentifiedForce]) -> usize {
    let measured = Spectrum::from_record(m.record());
    let receptances: Vec<_> =
        (0..128).map(|n| case.system.receptance(measured.omega(n)).unwrap()).collect();
    let points: Vec<[f64; 2]> = trials
        .iter()
        .map(|found| {
            let residual: f64 = receptances
                .iter()
                .enumerate()
                .map(|(n, h)| {
                    let motion = h * found.spectrum().lines().row(n).transpose();
                    (measured.lines().row(n).transpose() - motion).norm_squared()
                })
                .sum();
            [0.5 * residual.ln(), found.record().data().norm().ln()]
        })
        .collect();
    let curvature = |i: usize| {
        let d = |j: usize| (points[i + 1][j] - points[i - 1][j]) / 2.0;
        let dd = |j: usize| points[i + 1][j] - 2.0 * points[i][j] + points[i - 1][j];
        let bend = (d(1) * dd(0) - d(0) * dd(1)) / d(0).hypot(d(1)).powi(3);
        if bend.is_finite() { bend } else { f64::NEG_INFINITY }
    };
    (1..points.len() - 1).max_by(|a, b| curvature(*a).total_cmp(&curvature(*b))).unwrap()
}

/// Returns the first table of the book (`studies/force.md`), for known excited lines.
pub fn known_table() -> String {
    table(&KNOWN, true)
}

/// Returns the table for unknown excited lines.
pub fn unknown_table() -> String {
    table(&UNKNOWN, false)
}

fn table(methods: &[Method], floor: bool) -> String {
    let cases = cases();
    let mut out = String::from("| Method |");
    cases.iter().for_each(|c| out.push_str(&format!(" {} |", c.name)));
    out.push_str("\n|---|---|---|---|---|\n");
    let mut row = |name: &str, value: &dyn Fn(&Case) -> f64| {
        out.push_str(&format!("| {name} |"));
        cases.iter().for_each(|c| out.push_str(&format!(" {:.3} |", value(c))));
        out.push('\n');
    };
    if floor {
        row("*noise floor*", &|c| c.floor());
    }
    methods.iter().for_each(|m| row(m.0, &|c| rms_error(c, *m)));
    out
}

/// A case, the name of a filter, and the error ratio of each rule.
pub type RuleRow = (Case, &'static str, [Ratio; 4]);

/// Returns the comparison of the rules for λ, one row for each filter and case.
pub fn rule_rows() -> Vec<RuleRow> {
    type Make = fn(Rule) -> Filter;
    let filters: [(&str, Make); 2] =
        [("Tikhonov", Filter::Tikhonov), ("truncated SVD", Filter::TruncatedSvd)];
    let mut rows = Vec::new();
    for (name, make) in filters {
        rows.extend(rule_cases().into_iter().map(|case| {
            let ratios = rule_ratios(&case, make);
            (case, name, ratios)
        }));
    }
    rows
}

/// Returns the third table of the book (`studies/force.md`): the comparison of the rules for λ.
pub fn rule_table(rows: &[RuleRow]) -> String {
    let mut out = String::from(
        "| Excited | Noise | Filter | likelihood | GCV | L-curve | textbook corner |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (case, filter, ratios) in rows {
        out.push_str(&format!("| {} | {} % | {filter} |", case.name, case.level * 100.0));
        ratios.iter().for_each(|r| out.push_str(&format!(" {:.2} ({:.2}) |", r.mean, r.worst)));
        out.push('\n');
    }
    out
}
