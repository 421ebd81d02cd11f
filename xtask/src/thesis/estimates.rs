//! Stiffness and damping from the sequences of a simulation, with and without slips.

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::equation_error;
use mechid::estimate::time_domain::TimeDomain;
use mechid::model::{Discretisation, ResponseQuantity};
use mechid::numerics::least_squares::LeastSquares;
use mechid::signal::{Extent, Spectrum};
use mechid::spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

use super::simulate::Sequences;

/// The estimates in the order and with the signs of `Machine::parameters`.
pub type Listed = Result<Vec<f64>, String>;

/// Least squares on the spectra, eqs. (4.6.12) and (4.6.31): ω = n·ω0, n = 1 … Nt/2 − 1.
pub fn frequency(sequences: &Sequences) -> Listed {
    let sampling = sequences.force.sampling();
    let data = FrequencyData::from_records(
        &sequences.force,
        sequences.response.displacement(),
        ResponseQuantity::Displacement,
        1..(sampling.len() - 1).div_ceil(2),
    )
    .map_err(words)?;
    fit(sequences, &data)
}

/// Least squares on the spectra with the harmonic offset, a slip of the original programs: harmonic
/// n has the angular frequency (n + 1)·ω0, and n = 0, the mean, is included.
pub fn frequency_offset(sequences: &Sequences) -> Listed {
    let (omega, force, displacement) = amplitudes(sequences, 1);
    let data =
        FrequencyData::from_amplitudes(omega, force, displacement, ResponseQuantity::Displacement)
            .map_err(words)?;
    fit(sequences, &data)
}

/// The harmonic offset together with a free coefficient of the force:
/// K x + i ω C x − g F = ω² M x, with g estimated together with K and C.
pub fn frequency_offset_free_force(sequences: &Sequences) -> Listed {
    free_force(sequences, 1)
}

/// Least squares on the spectra with a free coefficient of the force: harmonics n ≥ 1 at n·ω0.
pub fn frequency_free_force(sequences: &Sequences) -> Listed {
    free_force(sequences, 0)
}

fn free_force(sequences: &Sequences, offset: usize) -> Listed {
    let (omega, force, displacement) = amplitudes(sequences, offset);
    let mass = sequences.machine.system().mass()[(0, 0)];
    let mut fit = LeastSquares::new(3, 1);
    for (row, &w) in omega.iter().enumerate() {
        let (x, f) = (displacement[(row, 0)], force[(row, 0)]);
        let terms = [x, Complex::i() * w * x, -f];
        let target = w * w * mass * x;
        let regressors =
            DMatrix::from_fn(2, 3, |part, c| if part == 0 { terms[c].re } else { terms[c].im });
        let targets = DMatrix::from_column_slice(2, 1, &[target.re, target.im]);
        fit.push_rows(regressors.as_view(), targets.as_view()).map_err(words)?;
    }
    let solution = fit.solve().map_err(words)?;
    Ok(solution.coefficients.column(0).iter().take(2).copied().collect())
}

type Amplitudes = (Vec<f64>, DMatrix<Complex<f64>>, DMatrix<Complex<f64>>);

/// Returns the angular frequencies (n + offset)·ω0 in rad/s, and the amplitudes of force and
/// displacement of the harmonics n. With the offset 1, the first harmonic is n = 0, the mean.
fn amplitudes(sequences: &Sequences, offset: usize) -> Amplitudes {
    let (x, f) = (
        Spectrum::from_record(sequences.response.displacement()),
        Spectrum::from_record(&sequences.force),
    );
    let first = 1 - offset;
    let harmonics = x.sampling().len() / 2 - first;
    let omega0 = x.sampling().omega0();
    // The original series has no separate constant term: its zeroth coefficient is 2/N Σ x, twice
    // the mean.
    let amplitudes = |s: &Spectrum| {
        DMatrix::from_fn(harmonics, s.channels(), |row, c| {
            if row + first == 0 { s.line(0, c) * 2.0 } else { s.line(row + first, c) }
        })
    };
    let omega = (0..harmonics).map(|row| (row + 1) as f64 * omega0).collect();
    (omega, amplitudes(&f), amplitudes(&x))
}

fn fit(sequences: &Sequences, data: &FrequencyData) -> Listed {
    let machine = sequences.machine;
    let unknowns = Unknowns::known_mass(machine.system().mass()).map_err(words)?;
    let estimate = equation_error(data, &unknowns).map_err(words)?;
    Ok(machine.listed(&estimate.stiffness(), &estimate.damping()))
}

/// The dissertation's estimator in the time domain, eqs. (4.5.12) and (4.5.28): least squares with
/// Euler's rule over a whole period.
pub fn time(sequences: &Sequences) -> Listed {
    fit_in_time(sequences, Discretisation::Euler)
}

/// Our best estimator for one noise-free period with a known force. It is exact for a force that is
/// linear between samples, so any error of the estimates comes from the integrator of the
/// simulation.
pub fn best(sequences: &Sequences) -> Listed {
    fit_in_time(sequences, Discretisation::FirstOrderHold)
}

/// Least squares over a whole period in the time domain.
pub fn fit_in_time(sequences: &Sequences, discretisation: Discretisation) -> Listed {
    let machine = sequences.machine;
    let unknowns = Unknowns::known_mass(machine.system().mass()).map_err(words)?;
    let (x, v) = (sequences.response.displacement(), sequences.response.velocity());
    let fit = TimeDomain::new(discretisation, Extent::WholePeriod)
        .fit(x, v, &sequences.force, &unknowns)
        .map_err(words)?;
    let estimate = fit.estimate();
    Ok(machine.listed(&estimate.stiffness(), &estimate.damping()))
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}
