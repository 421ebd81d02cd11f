//! Sections 5.8 and 5.9 and the papers: the force on the bearing.

use super::super::super::published::Method::{
    self, CentralDifference as Central, Houbolt, Newmark, Rk4, WilsonTheta as Wilson,
};
use super::super::evidence::View;
use super::super::markdown::number;
use super::super::rerun::{Domain, EULER, Equation, Parameters, Ratios, bearing, force};
use super::{Claim, DIRECT, Finding, Support};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 44,
        section: "5.8.1",
        statement: "With the continuous equation NPI 6 is better than 14, and Nt 512 better than 256.",
        test: "for each method the rms deviation of |F̂y/Fy| falls from NPI 14 to 6 at both Nt, and from Nt 256 to 512 at both NPI",
        support: Support::Figures,
        judge: npi_and_samples,
    },
    Claim {
        number: 45,
        section: "5.8.1",
        statement: "Houbolt and Wilson θ disperse most; above the natural frequency the spectra are flat.",
        test: "with frequency-domain parameters at NPI 10: rms deviation of each of the two above that of each other method; and for each method |F̂y/Fy| within 10 % of 1 above the natural frequency",
        support: Support::Figures,
        judge: dispersion,
    },
    Claim {
        number: 46,
        section: "papers",
        statement: "At NPI 6 Newmark and central difference are good, Newmark better than Runge-Kutta; Houbolt and Wilson θ are not.",
        test: "rms deviation below 0.1 for the first two and above 0.1 for the last two; Newmark's below Runge-Kutta's",
        support: Support::Figures,
        judge: npi_six,
    },
    Claim {
        number: 47,
        section: "papers",
        statement: "At NPI 2 Newmark and central difference are good and nearly equal; Houbolt and Wilson θ improve quickly.",
        test: "rms deviation below 0.1 for the first two and within 0.02 of each other; those of the last two less than half of those at NPI 6",
        support: Support::Figures,
        judge: npi_two,
    },
    Claim {
        number: 48,
        section: "papers",
        statement: "The discretised equation is bad for every integrator, least for Runge-Kutta, and NPI 2 is no better than 6.",
        test: "rms deviation above 0.2 for each method at both NPI; Runge-Kutta's the smallest at both; each changes by less than a fifth",
        support: Support::Figures,
        judge: discretised,
    },
    Claim {
        number: 49,
        section: "abstract of one paper",
        statement: "Of the direct methods Newmark is the closest to Runge-Kutta.",
        test: "its force spectrum at NPI 6 and 2, and its estimates in each of 5.6.2–5.6.9 (mean distance over NPI), are closer to Runge-Kutta's than those of the other three",
        support: Support::Figures,
        judge: closest_to_runge_kutta,
    },
];

const TIME: Parameters = Parameters::From(Domain::Time);

fn continuous(view: &View, nt: usize, npi: f64) -> Result<[Ratios; 5], String> {
    five(|m| force(view.source, bearing(nt, npi), m, TIME, Equation::Continuous))
}

fn five<T>(of: impl Fn(Method) -> Result<T, String>) -> Result<[T; 5], String> {
    let [a, b, c, d, e] = Method::ALL;
    Ok([of(a)?, of(b)?, of(c)?, of(d)?, of(e)?])
}

fn named(values: [f64; 5]) -> String {
    let pairs = Method::ALL.iter().zip(values);
    pairs.map(|(m, v)| format!("{} {}", m.name(), number(v))).collect::<Vec<_>>().join(", ")
}

fn at(values: &[f64; 5], method: Method) -> f64 {
    let index = Method::ALL.iter().position(|m| *m == method);
    index.map_or(f64::NAN, |at| values[at])
}

fn npi_and_samples(view: &View) -> Result<Finding, String> {
    let rms = |nt, npi| Ok::<_, String>(continuous(view, nt, npi)?.map(|r| r.rms()));
    let (a6, a14, b6, b14) = (rms(256, 6.0)?, rms(256, 14.0)?, rms(512, 6.0)?, rms(512, 14.0)?);
    let pairs = [(a6, a14), (b6, b14), (b6, a6), (b14, a14)];
    let tests: Vec<bool> = pairs
        .iter()
        .flat_map(|(better, worse)| better.iter().zip(worse).map(|(b, w)| b < w))
        .collect();
    let numbers = format!(
        "rms deviation at Nt 256, NPI 14: {}; NPI 6: {}; at Nt 512, NPI 6: {}.",
        named(a14),
        named(a6),
        named(b6)
    );
    Ok(Finding::new(tests, numbers))
}

fn dispersion(view: &View) -> Result<Finding, String> {
    let case = bearing(256, 10.0);
    let parameters = Parameters::From(Domain::Frequency);
    let ratios = five(|m| force(view.source, case, m, parameters, Equation::Continuous))?;
    let rms = ratios.each_ref().map(Ratios::rms);
    let above = ratios.each_ref().map(|r| r.worst_above(case.machine.omega_n()));
    let worse = [Houbolt, Wilson]
        .into_iter()
        .flat_map(|m| [Rk4, Newmark, Central].map(|o| at(&rms, m) > at(&rms, o)));
    let tests: Vec<bool> = worse.chain(above.iter().map(|w| *w < 0.1)).collect();
    let numbers = format!(
        "rms deviation: {}. Largest deviation above 1.80 rad/s: {}.",
        named(rms),
        named(above)
    );
    Ok(Finding::new(tests, numbers))
}

fn npi_six(view: &View) -> Result<Finding, String> {
    let rms = continuous(view, 256, 6.0)?.map(|r| r.rms());
    let of = |m| at(&rms, m);
    let tests = [
        of(Newmark) < 0.1,
        of(Central) < 0.1,
        of(Houbolt) > 0.1,
        of(Wilson) > 0.1,
        of(Newmark) < of(Rk4),
    ];
    Ok(Finding::new(tests, format!("rms deviation: {}.", named(rms))))
}

fn npi_two(view: &View) -> Result<Finding, String> {
    let rms = |npi| Ok::<_, String>(continuous(view, 256, npi)?.map(|r| r.rms()));
    let (two, six) = (rms(2.0)?, rms(6.0)?);
    let tests = [
        at(&two, Newmark) < 0.1,
        at(&two, Central) < 0.1,
        (at(&two, Newmark) - at(&two, Central)).abs() < 0.02,
        at(&two, Houbolt) < 0.5 * at(&six, Houbolt),
        at(&two, Wilson) < 0.5 * at(&six, Wilson),
    ];
    let numbers = format!("rms deviation at NPI 2: {}; at NPI 6: {}.", named(two), named(six));
    Ok(Finding::new(tests, numbers))
}

fn discretised(view: &View) -> Result<Finding, String> {
    let rms = |npi| {
        let spectra = five(|m| force(view.source, bearing(256, npi), m, TIME, EULER))?;
        Ok::<_, String>(spectra.map(|r| r.rms()))
    };
    let (six, two) = (rms(6.0)?, rms(2.0)?);
    let bad = six.iter().chain(&two).map(|r| *r > 0.2);
    let least = [six, two].into_iter().flat_map(|v| DIRECT.map(|m| at(&v, Rk4) < at(&v, m)));
    let same = six.iter().zip(&two).map(|(a, b)| (a - b).abs() < 0.2 * a.max(*b));
    let tests: Vec<bool> = bad.chain(least).chain(same).collect();
    let numbers = format!("rms deviation at NPI 6: {}; at NPI 2: {}.", named(six), named(two));
    Ok(Finding::new(tests, numbers))
}

fn closest_to_runge_kutta(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    let mut closest = |name: String, distances: [f64; 4]| {
        let nearest =
            DIRECT.into_iter().zip(distances).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(m, _)| m);
        tests.push(nearest == Some(Newmark));
        words.push(format!("{name} {}", nearest.map_or("none", Method::name)));
    };
    for npi in [6.0, 2.0] {
        let spectra = continuous(view, 256, npi)?;
        let [rk, direct @ ..] = spectra;
        closest(format!("force at NPI {npi}:"), direct.each_ref().map(|r| rk.distance(r)));
    }
    for table in ["5.6.2", "5.6.3", "5.6.4", "5.6.5", "5.6.6", "5.6.7", "5.6.8", "5.6.9"] {
        let rk = view.deviations(table, Rk4);
        let distance = |m| {
            let deviations = view.deviations(table, m);
            deviations.iter().zip(&rk).map(|(a, b)| (a.1 - b.1).abs()).sum::<f64>()
        };
        closest(format!("{table}:"), DIRECT.map(distance));
    }
    Ok(Finding::new(tests, format!("Closest: {}.", words.join(", "))))
}
