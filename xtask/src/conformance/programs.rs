//! Values that other programs give for the same machine and the same samples.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use mechid::integrate::{
    Bathe, CentralDifference, CentralDifferenceStart, GeneralisedAlpha, Houbolt, HouboltStart,
    MatrixExponential, Newmark, Scheme, WilsonLoad, WilsonTheta, integrate,
};
use mechid::model::linear_algebra::exponential;
use mechid::model::{InitialState, Mode, Response, SecondOrderSystem};
use mechid::numerics::student_interval;
use mechid::signal::{Record, Sampling, Window};
use mechid::spectra::frf::{Frf, FrfEstimator, Segments};
use mechid::{Displacement, numerics::logarithm::logarithm};
use nalgebra::{Complex, DMatrix, Matrix3, dmatrix, matrix};

use super::{Judge, Row};

/// Step of the records, in s.
const DT: f64 = 0.01;
/// Number of steps that are compared; the records have one more step, which schemes that look ahead
/// need.
const STEPS: usize = 60;

/// Value of another program, with the words that identify its quantity.
struct Value {
    words: [String; 3],
    value: f64,
}

fn values(root: &Path, name: &str) -> Result<Vec<Value>, String> {
    let file = root.join("tests/published/programs").join(name);
    let damaged = |line: &str| format!("{}: {line}", file.display());
    let text = std::fs::read_to_string(&file).map_err(|e| damaged(&e.to_string()))?;
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let [a, b, c, value] = cells.as_slice() else { return None };
        let words = [a, b, c].map(|word| (*word).to_owned());
        Some(Value { words, value: value.parse().ok()? })
    };
    text.lines().skip(1).map(|line| row(line).ok_or_else(|| damaged(line))).collect()
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn parsed<T: std::str::FromStr>(word: &str) -> Result<T, String> {
    word.parse().map_err(|_| format!("{word} in the values of another program"))
}

/// Forces on three masses: the sum of two sines on the second mass, and no force on the others.
fn force(sampling: Sampling) -> Result<Record, String> {
    let forces: Vec<f64> =
        sampling.times().map(|t| 30.0 * (18.0 * t).sin() + 12.0 * (47.0 * t).sin()).collect();
    let none = vec![0.0; forces.len()];
    Record::from_channels(sampling, &[none.clone(), forces, none]).map_err(words)
}

fn response(scheme: &dyn Scheme, system: &SecondOrderSystem) -> Result<Response, String> {
    let sampling = Sampling::new(DT, STEPS + 2).map_err(words)?;
    integrate(scheme, system, &force(sampling)?, &InitialState::rest(3)).map_err(words)
}

/// Three storeys: masses, springs and dampers from the ground up.
fn chain() -> Result<SecondOrderSystem, String> {
    let joined = |links: [f64; 3]| {
        let [a, b, c] = links;
        let matrix: Matrix3<f64> = matrix![a + b, -b, 0.0; -b, b + c, -c; 0.0, -c, c];
        DMatrix::from_column_slice(3, 3, matrix.as_slice())
    };
    let mass = DMatrix::from_diagonal(&nalgebra::dvector![2.0, 3.0, 1.5]);
    SecondOrderSystem::new(mass, joined([6.0, 4.0, 5.0]), joined([5000.0, 4000.0, 3000.0]))
        .map_err(words)
}

/// Displacements of all masses after a step.
fn displacements(values: &[Value], name: &str, step: &str) -> Vec<f64> {
    let of = |value: &&Value| value.words[0] == name && value.words[1] == step;
    values.iter().filter(of).map(|value| value.value).collect()
}

/// Returns our scheme for an integrator with the name `name` in OpenSees. Houbolt's scheme in
/// OpenSees always starts at rest; ours therefore takes its first two displacements from OpenSees.
fn scheme(name: &str, values: &[Value]) -> Result<Box<dyn Scheme>, String> {
    Ok(match name {
        "Newmark 1/2 1/4" => Box::new(Newmark::AVERAGE_ACCELERATION),
        "Newmark 1/2 1/6" => Box::new(Newmark::LINEAR_ACCELERATION),
        "HHT 8/9" => Box::new(GeneralisedAlpha::hilber_hughes_taylor(0.8).map_err(words)?),
        "GeneralizedAlpha 2/3 5/9" => Box::new(GeneralisedAlpha::new(0.8).map_err(words)?),
        "WilsonTheta 1.42" => {
            Box::new(WilsonTheta::new(1.42).map_err(words)?.with_load(WilsonLoad::Interpolated))
        }
        "Houbolt" => {
            let [at_dt, at_2dt] = ["1", "2"].map(|step| displacements(values, name, step));
            Box::new(Houbolt { start: HouboltStart::Given { at_dt, at_2dt } })
        }
        "CentralDifference" => Box::new(CentralDifference { start: CentralDifferenceStart::Rest }),
        "TRBDF2" => Box::new(Bathe::HALVES),
        _ => return Err(format!("no scheme {name}")),
    })
}

/// Compares the displacements of three storeys after each step with those of the integrators of
/// OpenSees.
pub(super) fn opensees(root: &Path) -> Result<Judge, String> {
    let system = chain()?;
    let mut responses: BTreeMap<String, Response> = BTreeMap::new();
    let mut rows = Vec::new();
    let values = values(root, "opensees.csv")?;
    for Value { words: [name, step, dof], value } in &values {
        if !responses.contains_key(name) {
            responses.insert(name.clone(), response(scheme(name, &values)?.as_ref(), &system)?);
        }
        let (step, dof): (usize, usize) = (parsed(step)?, parsed(dof)?);
        if step < 3 {
            continue; // The start that Houbolt's scheme was given.
        }
        let displacement = responses[name].displacement();
        let largest = displacement.channel(dof - 1).iter().fold(0.0f64, |a, x| a.max(x.abs()));
        let quantity = format!("{name}: displacement {dof} after {step} steps, m");
        let ours = displacement.channel(dof - 1)[step];
        rows.push(Row::by_formula(quantity, *value, ours, 1e-11 * largest));
    }
    Ok(Judge {
        name: "OpenSees: time stepping",
        source: "OpenSeesPy 3.7.1 (McKenna, Scott and Fenves, 2010): three masses on zeroLength elements, force as a Path series; integrators by their names there",
        tolerance: "10⁻¹¹ of the largest displacement: rounding of 60 steps in two programs",
        test: "xtask/tests/conformance.rs",
        rows,
    })
}

/// A machine with gyroscopic and other damping and a stiffness that is not symmetric.
fn machine() -> Result<SecondOrderSystem, String> {
    SecondOrderSystem::new(
        dmatrix![4.0, 0.5, 0.0; 0.5, 3.0, 0.2; 0.0, 0.2, 2.0],
        dmatrix![8.0, 12.0, -1.0; -14.0, 9.0, 0.5; -1.0, 0.5, 4.0],
        dmatrix![9000.0, -3000.0, 0.0; -2500.0, 7000.0, -1500.0; 0.0, -1500.0, 4000.0],
    )
    .map_err(words)
}

/// Returns numbers between −½ and ½ from a linear congruential generator, the same in every
/// language.
fn congruence(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = (1_103_515_245 * state + 12345) % (1 << 31);
        state as f64 / f64::from(1u32 << 31) - 0.5
    };
    (0..count).map(|_| next()).collect()
}

/// Returns the frequency response of a recursive filter, estimated by averages over segments; the
/// input is noise, and more noise is added to the output.
fn averaged() -> Result<Frf, String> {
    let force = congruence(12345, 2048);
    let noise = congruence(54321, 2048);
    let mut motion = Vec::with_capacity(force.len());
    for k in 0..force.len() {
        let before = |values: &[f64], lag: usize| k.checked_sub(lag).map_or(0.0, |at| values[at]);
        let value = force[k] * 0.2 + 1.6 * before(&motion, 1) - 0.8 * before(&motion, 2);
        motion.push(value + before(&force, 1));
    }
    let motion: Vec<f64> = motion.iter().zip(noise).map(|(x, noise)| x + 0.5 * noise).collect();
    let sampling = Sampling::from_rate_hz(256.0, force.len()).map_err(words)?;
    let record = |values: Vec<f64>| Record::from_channel(sampling, values).map_err(words);
    let segments = Segments::Windowed { len: 256, hop: 128, window: Window::Hann };
    let lines = 1..128;
    Frf::estimate(
        &record(force)?,
        &record(motion)?,
        Displacement,
        segments,
        lines,
        FrfEstimator::H1,
    )
    .map_err(words)
}

/// Returns the part of a complex number that the last word of its name states.
fn part(value: Complex<f64>, name: &str) -> f64 {
    if name.ends_with("real") { value.re } else { value.im }
}

/// Returns the index, from 0, of a number that is counted from 1.
fn index(word: &str) -> Result<usize, String> {
    parsed::<usize>(word)?.checked_sub(1).ok_or_else(|| format!("{word} counts from 1"))
}

/// Results of this workspace that are compared with SciPy.
struct Ours {
    system: SecondOrderSystem,
    modes: Vec<Mode>,
    exact: Response,
    generator: DMatrix<f64>,
    frf: Frf,
}

impl Ours {
    fn compute() -> Result<Self, String> {
        let system = machine()?;
        let mut modes = system.modes().map_err(words)?;
        modes.sort_by(|a, b| a.natural_frequency().total_cmp(&b.natural_frequency()));
        let step = exponential(&(system.state_matrix() * DT)).map_err(words)?;
        Ok(Self {
            modes,
            exact: response(&MatrixExponential::LINEAR, &system)?,
            generator: logarithm(&step).map_err(words)?,
            frf: averaged()?,
            system,
        })
    }

    /// Returns a value, the magnitude with which its rounding error is compared, and its unit.
    fn value(&self, [what, at, of]: &[String; 3]) -> Result<(f64, f64, &'static str), String> {
        Ok(match what.as_str() {
            "eigenvalue" => {
                let eigenvalue = self.modes[index(at)?].eigenvalue();
                (part(eigenvalue, of), eigenvalue.norm(), "1/s")
            }
            "receptance" => {
                let h = self.system.receptance(TAU * parsed::<f64>(at)?).map_err(words)?;
                let entry = h[(index(&of[..1])?, 0)];
                (part(entry, of), entry.norm(), "m/N")
            }
            "response" => {
                let channel = self.exact.displacement().channel(index(of)?);
                let largest = channel.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
                (channel[parsed::<usize>(at)?], largest, "m")
            }
            "student" => {
                let interval = student_interval(0.0, 1.0, parsed(at)?, parsed(of)?);
                let [_, high] = interval.map_err(words)?;
                (high, high, "–")
            }
            "logarithm" => (self.generator[(index(at)?, index(of)?)], self.generator.amax(), "–"),
            "h1" => {
                let h = self.frf.response(index(at)?)[(0, 0)];
                (part(h, of), h.norm(), "–")
            }
            "coherence" => (self.frf.coherence()[(index(at)?, 0)], 1.0, "–"),
            _ => return Err(format!("no quantity {what}")),
        })
    }
}

/// Compares eigenvalues, receptances, exact steps, quantiles, a logarithm and averaged spectra with
/// those of SciPy.
pub(super) fn scipy(root: &Path) -> Result<Judge, String> {
    let ours = Ours::compute()?;
    let mut rows = Vec::new();
    for Value { words, value } in values(root, "scipy.csv")? {
        let (computed, scale, unit) = ours.value(&words)?;
        let quantity = format!("{}, {unit}", words.join(" ").trim_end());
        rows.push(Row::by_formula(quantity, value, computed, 1e-11 * scale));
    }
    Ok(Judge {
        name: "SciPy: modes, responses, quantiles, spectra",
        source: "SciPy 1.17.1 (Virtanen et al., Nature Methods 17, 2020) and NumPy 2.4.6: linalg.eigvals, linalg.inv, signal.lsim, stats.t.ppf, linalg.logm, signal.csd and coherence (Hann, 256 samples, half overlapping)",
        tolerance: "10⁻¹¹ of the absolute value, or of the largest entry of a vector or matrix: the rounding of two programs",
        test: "xtask/tests/conformance.rs",
        rows,
    })
}
