//! Systems of the literature, with their published parameters.

use mechid_model::{JournalBearing, KyxSign, OilFilm, Sdof, SecondOrderSystem};
use nalgebra::{DMatrix, dmatrix};

/// The single oscillator of the dissertation: M = 10 kg, C = 180 N·s/m, K = 5000 N/m.
///
/// ωn = 22.3607 rad/s, ζ = 0.402492.
pub fn dissertation_sdof() -> Sdof {
    Sdof::new(10.0, 180.0, 5000.0).expect("positive mass and stiffness")
}

/// The journal bearing of the dissertation: 14.8 kg in an oil film.
///
/// Kxx 40, Kxy 50, Kyx 20, Kyy 60 N/m and Cxx 20, Cxy 10, Cyx 10, Cyy 30 N·s/m; Kxx and Kyy include
/// the support springs. Eigenvalues (rad/s): −0.08776 ± 1.63331i and −1.60143 ± 1.79925i with
/// [`KyxSign::Minus`], largest imaginary part 2.04380 with [`KyxSign::Plus`].
///
/// # Source
/// Dissertation eqs. (4.2.2)–(4.2.3) and the parameters of chapter 5.
pub fn dissertation_bearing(kyx_sign: KyxSign) -> JournalBearing {
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
    JournalBearing::new(14.8, film, kyx_sign).expect("positive mass")
}

/// Two masses with non-proportional damping.
///
/// Damped frequencies 3.1157 and 3.9384 Hz, damping ratios 0.1869 and 0.4275,
/// shape ratios y2/y1 = 1.1567 + 0.3474i and −0.6821 + 0.2752i.
///
/// # Source
/// Steffen & Rade (1991), Int. J. Analytical and Experimental Modal Analysis 6(4), 271–278,
/// as given in the dissertation, Appendix E (which swaps the two damping ratios).
pub fn steffen_rade() -> SecondOrderSystem {
    SecondOrderSystem::new(
        DMatrix::from_diagonal_element(2, 2, 4.54),
        dmatrix![87.559, -35.0236; -35.0236, 52.5354],
        dmatrix![2626.77, -875.59; -875.59, 2626.77],
    )
    .expect("positive masses")
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;

    /// Tolerance of the comparison with published values: half a unit of their fourth decimal
    /// place.
    const PRINTED: f64 = 5e-5;

    #[test]
    fn steffen_and_rade_have_their_published_modes() {
        let modes = steffen_rade().modes().unwrap();
        let published = [
            (3.1157, 0.1869, Complex::new(1.1567, 0.3474)),
            (3.9384, 0.4275, Complex::new(-0.6821, 0.2752)),
        ];
        assert_eq!(modes.len(), 2);
        for (mode, (hz, zeta, ratio)) in modes.iter().zip(published) {
            assert!((mode.damped_frequency_hz() - hz).abs() < PRINTED, "{mode:?}");
            assert!((mode.damping_ratio() - zeta).abs() < PRINTED, "{mode:?}");
            let found = mode.shape()[1] / mode.shape()[0];
            assert!((found - ratio).re.abs() < PRINTED, "{found}");
            assert!((found - ratio).im.abs() < PRINTED, "{found}");
        }
    }

    #[test]
    fn the_oscillator_and_the_bearing_have_theirs() {
        assert!((dissertation_sdof().natural_frequency() - 22.3607).abs() < PRINTED);
        let largest = |sign| {
            let modes = dissertation_bearing(sign).system().modes().unwrap();
            modes.iter().map(|m| m.damped_frequency()).fold(0.0, f64::max)
        };
        assert!((largest(KyxSign::Minus) - 1.799248).abs() < 5e-7);
        assert!((largest(KyxSign::Plus) - 2.04380).abs() < 5e-6);
    }
}
