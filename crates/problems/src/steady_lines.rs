//! Steady-state responses: amplitudes in closed form, line by line, and records that are
//! synthesised from these amplitudes.

use mechid_model::{JournalBearing, KyxSign, OilFilm, ResponseQuantity, Sdof, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix, DVector};

/// Complex amplitudes, lines × channels.
pub type ComplexMatrix = DMatrix<Complex<f64>>;

/// The dissertation's oscillator.
pub fn oscillator() -> SecondOrderSystem {
    Sdof::new(10.0, 180.0, 5000.0).unwrap().system()
}

/// The journal bearing of the dissertation, with the sign `KyxSign::Minus`: one lightly damped and
/// one heavily damped mode.
pub fn bearing() -> SecondOrderSystem {
    let film = OilFilm {
        kxx: 40.0,
        kxy: 50.0,
        kyx: 20.0,
        kyy: 60.0,
        cxx: 20.0,
        cxy: 10.0,
        cyx: 10.0,
        cyy: 30.0,
    };
    JournalBearing::new(14.8, film, KyxSign::Minus).unwrap().system()
}

/// Force amplitudes of equal size, in the unit of `amplitude`, with Schroeder's phases, which
/// differ from channel to channel.
///
/// # Source
/// Schroeder (1970), IEEE Transactions on Information Theory 16, 85–89.
pub fn forces(lines: &[usize], channels: usize, amplitude: f64) -> ComplexMatrix {
    let count = lines.len() as f64;
    DMatrix::from_fn(lines.len(), channels, |l, c| {
        let turn = l as f64 * (c as f64 + 1.0) / count + 0.37 * c as f64;
        Complex::from_polar(amplitude, -std::f64::consts::PI * l as f64 * turn)
    })
}

/// Returns the displacement amplitudes G(ω) F, lines × degrees of freedom, in m.
pub fn displacements(
    system: &SecondOrderSystem,
    omega: &[f64],
    forces: &ComplexMatrix,
) -> ComplexMatrix {
    let mut displacements = forces.clone();
    for (row, &w) in omega.iter().enumerate() {
        let x = system.receptance(w).unwrap() * forces.row(row).transpose();
        displacements.row_mut(row).tr_copy_from(&x);
    }
    displacements
}

/// Responses D(ω)⁻¹ F (m), lines × degrees of freedom, of M, C and K (SI units) to forces (N), by
/// dense elimination on each line. The computation does not use the receptance of a model.
///
/// # Panics
/// If D is singular at a line.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 2 (dynamic stiffness).
pub fn eliminated(
    [m, c, k]: [&DMatrix<f64>; 3],
    omega: &[f64],
    forces: &ComplexMatrix,
) -> ComplexMatrix {
    let mut amplitudes = DMatrix::zeros(omega.len(), m.nrows());
    for (row, w) in omega.iter().enumerate() {
        let dynamic = k.zip_zip_map(c, m, |k, c, m| Complex::new(k - w * w * m, w * c));
        let load: DVector<Complex<f64>> = forces.row(row).transpose();
        amplitudes.row_mut(row).copy_from(&dynamic.lu().solve(&load).unwrap().transpose());
    }
    amplitudes
}

/// Record with samples Σ Re(h A_n exp(i n ω0 t)), summed term by term; A_n are displacement
/// amplitudes, and the factor h converts them into the given quantity.
///
/// # Source
/// The definition of a Fourier series.
pub fn synthesise(
    sampling: Sampling,
    lines: &[usize],
    amplitudes: &ComplexMatrix,
    quantity: ResponseQuantity,
) -> Record {
    let len = sampling.len();
    let data = DMatrix::from_fn(len, amplitudes.ncols(), |k, c| {
        let mut sum = 0.0;
        for (row, &n) in lines.iter().enumerate() {
            let turn = std::f64::consts::TAU * ((n * k) % len) as f64 / len as f64;
            let factor = quantity.per_displacement(n as f64 * sampling.omega0());
            sum += (amplitudes[(row, c)] * factor * Complex::from_polar(1.0, turn)).re;
        }
        sum
    });
    Record::new(sampling, data).unwrap()
}

/// Returns the largest deviation of two matrices of the same shape (rows × columns), relative to
/// the largest entry of `expected` (a pure number).
pub fn relative_error(found: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    (found - expected).abs().max() / expected.abs().max()
}

/// Returns all entries of M, C and K in SI units, in the order of the unknowns of a fit in which
/// every entry is free.
pub fn all_entries(system: &SecondOrderSystem) -> DVector<f64> {
    let matrices = [system.mass(), system.damping(), system.stiffness()];
    DVector::from_iterator(
        3 * system.dof() * system.dof(),
        matrices.into_iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>()),
    )
}

/// Returns the sampling of one period of 256 samples, with twenty samples per cycle of the fastest
/// mode, and the numbers of its lines, 1 to 127.
pub fn sampling(system: &SecondOrderSystem) -> (Sampling, Vec<usize>) {
    let fastest = system.modes().unwrap().iter().map(|m| m.natural_frequency()).fold(0.0, f64::max);
    let sampling = Sampling::new(std::f64::consts::TAU / (20.0 * fastest), 256).unwrap();
    (sampling, (1..=127).collect())
}
