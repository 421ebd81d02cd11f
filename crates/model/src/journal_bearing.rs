//! A rigid shaft in a hydrodynamic bearing, with two degrees of freedom.

use nalgebra::{DMatrix, dmatrix};

use crate::error::require;
use crate::{ModelError, SecondOrderSystem};

/// Sign of the coefficient Kyx in the equation of the y direction.
///
/// Sources use different signs, which lead to different eigenvalues, so that there is no default.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum KyxSign {
    /// The term is + Kyx x: Kyx is an entry of the stiffness matrix.
    Plus,
    /// The term is − Kyx x, as in Dissertation eqs. (4.2.3) and (4.5.26).
    Minus,
}

impl KyxSign {
    /// Returns the factor +1 or −1.
    pub fn factor(self) -> f64 {
        match self {
            KyxSign::Plus => 1.0,
            KyxSign::Minus => -1.0,
        }
    }
}

/// The eight linearised coefficients of an oil film: stiffness in N/m, damping in N·s/m.
///
/// The first index is the direction of the force, the second the direction of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OilFilm {
    /// Stiffness, force in x from displacement in x, in N/m.
    pub kxx: f64,
    /// Stiffness, force in x from displacement in y, in N/m.
    pub kxy: f64,
    /// Stiffness, force in y from displacement in x, in N/m.
    pub kyx: f64,
    /// Stiffness, force in y from displacement in y, in N/m.
    pub kyy: f64,
    /// Damping, force in x from velocity in x, in N·s/m.
    pub cxx: f64,
    /// Damping, force in x from velocity in y, in N·s/m.
    pub cxy: f64,
    /// Damping, force in y from velocity in x, in N·s/m.
    pub cyx: f64,
    /// Damping, force in y from velocity in y, in N·s/m.
    pub cyy: f64,
}

/// Rigid shaft of mass M in an oil film; springs Sx and Sy support it in x and y.
///
/// ```text
/// M ẍ + Cxx ẋ + Cxy ẏ + (Kxx + Sx) x +        Kxy y = Fx
/// M ÿ + Cyx ẋ + Cyy ẏ ±        Kyx x + (Kyy + Sy) y = Fy      (± is the KyxSign)
/// ```
///
/// Degree of freedom 0 is x, 1 is y. In the dissertation Kxx and Kyy already include the support
/// stiffness; [`with_support`](Self::with_support) is for a film and a support known separately.
///
/// ```
/// use mechid_model::{JournalBearing, KyxSign, OilFilm};
///
/// let film = OilFilm {
///     kxx: 40.0, kxy: 50.0, kyx: 20.0, kyy: 60.0,
///     cxx: 20.0, cxy: 10.0, cyx: 10.0, cyy: 30.0,
/// };
/// let bearing = JournalBearing::new(14.8, film, KyxSign::Minus)?;
/// let modes = bearing.system().modes()?;
/// assert!((modes[0].damped_frequency() - 1.63331).abs() < 5e-6);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
///
/// # Source
/// Dissertation eqs. (4.2.2)–(4.2.3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JournalBearing {
    mass: f64,
    film: OilFilm,
    kyx_sign: KyxSign,
    support: [f64; 2],
}

impl JournalBearing {
    /// Creates a shaft of `mass` (kg, positive) in an oil film, without springs of a support.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] naming the mass or coefficient that is out of range.
    pub fn new(mass: f64, film: OilFilm, kyx_sign: KyxSign) -> Result<Self, ModelError> {
        require("shaft mass", mass, "positive and finite", mass > 0.0)?;
        let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = film;
        for (name, value) in [
            ("Kxx", kxx),
            ("Kxy", kxy),
            ("Kyx", kyx),
            ("Kyy", kyy),
            ("Cxx", cxx),
            ("Cxy", cxy),
            ("Cyx", cyx),
            ("Cyy", cyy),
        ] {
            require(name, value, "finite", true)?;
        }
        Ok(Self { mass, film, kyx_sign, support: [0.0; 2] })
    }

    /// Returns the same shaft with support springs `sx`, `sy` (N/m) added to Kxx and Kyy.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] if a spring, or its sum with the stiffness of the film, is not
    /// finite.
    pub fn with_support(self, sx: f64, sy: f64) -> Result<Self, ModelError> {
        require("support stiffness in x", sx, "finite", (self.film.kxx + sx).is_finite())?;
        require("support stiffness in y", sy, "finite", (self.film.kyy + sy).is_finite())?;
        Ok(Self { support: [sx, sy], ..self })
    }

    /// Mass of the shaft, in kg.
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// The coefficients of the oil film, without the support springs.
    pub fn film(&self) -> OilFilm {
        self.film
    }

    /// Sign of Kyx.
    pub fn kyx_sign(&self) -> KyxSign {
        self.kyx_sign
    }

    /// Stiffness of the support in x and y, in N/m.
    pub fn support(&self) -> [f64; 2] {
        self.support
    }

    /// Returns the system with M, C and K, 2×2.
    pub fn system(&self) -> SecondOrderSystem {
        let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = self.film;
        let [sx, sy] = self.support;
        SecondOrderSystem::new(
            DMatrix::from_diagonal_element(2, 2, self.mass),
            dmatrix![cxx, cxy; cyx, cyy],
            dmatrix![kxx + sx, kxy; self.kyx_sign.factor() * kyx, kyy + sy],
        )
        .expect("finite, and the mass is positive")
    }
}

impl From<JournalBearing> for SecondOrderSystem {
    fn from(bearing: JournalBearing) -> Self {
        bearing.system()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILM: OilFilm = OilFilm {
        kxx: 40.0,
        kxy: 50.0,
        kyx: 20.0,
        kyy: 60.0,
        cxx: 20.0,
        cxy: 10.0,
        cyx: 10.0,
        cyy: 30.0,
    };

    #[test]
    fn the_sign_of_kyx_moves_the_eigenvalues() {
        // The reference values have five decimals, so the tolerance is half a unit of the fifth
        // decimal.
        let modes = |sign| JournalBearing::new(14.8, FILM, sign).unwrap().system().modes().unwrap();
        let minus = modes(KyxSign::Minus);
        assert_eq!(minus.len(), 2);
        for (mode, (re, im)) in minus.iter().zip([(-0.08776, 1.63331), (-1.60143, 1.79925)]) {
            assert!((mode.eigenvalue().re - re).abs() < 5e-6, "{mode:?}");
            assert!((mode.eigenvalue().im - im).abs() < 5e-6, "{mode:?}");
        }
        let plus = modes(KyxSign::Plus);
        let fastest = plus.iter().map(|m| m.damped_frequency()).fold(0.0, f64::max);
        assert!((fastest - 2.04380).abs() < 5e-6);
    }

    #[test]
    fn support_springs_add_to_the_direct_stiffness_only() {
        let bearing = JournalBearing::new(14.8, FILM, KyxSign::Minus).unwrap();
        let stiffer = bearing.with_support(5.0, 7.0).unwrap().system();
        assert_eq!(*stiffer.stiffness(), dmatrix![45.0, 50.0; -20.0, 67.0]);
        assert_eq!(stiffer.damping(), bearing.system().damping());
    }

    #[test]
    fn bad_coefficients_are_named() {
        let broken = JournalBearing::new(1.0, OilFilm { cyx: f64::NAN, ..FILM }, KyxSign::Plus);
        assert!(matches!(broken, Err(ModelError::Parameter { name: "Cyx", .. })));
        assert!(JournalBearing::new(-1.0, FILM, KyxSign::Plus).is_err());
        let bearing = JournalBearing::new(1.0, FILM, KyxSign::Plus).unwrap();
        assert!(bearing.with_support(0.0, f64::INFINITY).is_err());
    }
}
