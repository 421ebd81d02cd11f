//! One degree of freedom: m ẍ + c ẋ + k x = F.

use nalgebra::{Complex, dmatrix};

use crate::error::require;
use crate::{ModelError, SecondOrderSystem};

/// Mass on a spring and a viscous damper: m ẍ + c ẋ + k x = F.
///
/// Mass and stiffness are positive. The damping may have any sign: negative damping belongs to an
/// unstable system or an inaccurate estimate, and their responses are needed, too.
///
/// ```
/// use mechid_model::Sdof;
///
/// let sdof = Sdof::new(10.0, 180.0, 5000.0)?;
/// assert!((sdof.natural_frequency() - 22.3607).abs() < 5e-5);
/// assert!((sdof.damping_ratio() - 0.402492).abs() < 5e-7);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
///
/// # Source
/// Dissertation eq. (4.2.1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sdof {
    mass: f64,
    damping: f64,
    stiffness: f64,
}

impl Sdof {
    /// Creates an oscillator from m (kg, positive), c (N·s/m) and k (N/m, positive).
    ///
    /// # Errors
    /// [`ModelError::Parameter`] with the name of the parameter that is out of range.
    pub fn new(mass: f64, damping: f64, stiffness: f64) -> Result<Self, ModelError> {
        require("mass", mass, "positive and finite", mass > 0.0)?;
        require("damping", damping, "finite", true)?;
        require("stiffness", stiffness, "positive and finite", stiffness > 0.0)?;
        Ok(Self { mass, damping, stiffness })
    }

    /// Creates an oscillator from m (kg), the damping ratio ζ and the natural frequency ωn (rad/s):
    /// c = 2 ζ m ωn, k = m ωn².
    ///
    /// # Errors
    /// [`ModelError::Parameter`] with the name of the parameter that is out of range.
    ///
    /// # Source
    /// Meirovitch (1975), viscous damping factor and undamped natural frequency.
    pub fn from_modal(
        mass: f64,
        damping_ratio: f64,
        natural_frequency: f64,
    ) -> Result<Self, ModelError> {
        require("damping ratio", damping_ratio, "finite", true)?;
        let positive = natural_frequency > 0.0;
        require("natural frequency", natural_frequency, "positive and finite", positive)?;
        let damping = 2.0 * damping_ratio * mass * natural_frequency;
        Self::new(mass, damping, mass * natural_frequency * natural_frequency)
    }

    /// Mass m, in kg.
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Damping c, in N·s/m.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// Stiffness k, in N/m.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// Undamped natural frequency ωn = √(k/m), in rad/s.
    pub fn natural_frequency(&self) -> f64 {
        (self.stiffness / self.mass).sqrt()
    }

    /// Critical damping 2√(k m), in N·s/m.
    pub fn critical_damping(&self) -> f64 {
        2.0 * (self.stiffness * self.mass).sqrt()
    }

    /// Damping ratio ζ = c / (2√(k m)).
    pub fn damping_ratio(&self) -> f64 {
        self.damping / self.critical_damping()
    }

    /// Damped natural frequency ωn √(1 − ζ²), in rad/s; 0 if the free response does not oscillate.
    pub fn damped_frequency(&self) -> f64 {
        self.poles()[0].im
    }

    /// Returns the two roots of m s² + c s + k = 0, in rad/s.
    ///
    /// For an underdamped system, the one with positive imaginary part comes first. Otherwise both
    /// are real, and the one farther from zero comes first.
    pub fn poles(&self) -> [Complex<f64>; 2] {
        let sigma = 0.5 * self.damping / self.mass;
        let omega_n = self.natural_frequency();
        // The product for ζ² − 1 avoids cancellation near critical damping.
        let excess = (sigma.abs() - omega_n) * (sigma.abs() + omega_n);
        if excess < 0.0 {
            let omega_d = (-excess).sqrt();
            return [Complex::new(-sigma, omega_d), Complex::new(-sigma, -omega_d)];
        }
        let fast = -(sigma + excess.sqrt().copysign(sigma));
        [Complex::from(fast), Complex::from(omega_n * (omega_n / fast))]
    }

    /// Returns the dynamic stiffness k − ω²m + iωc at ω (rad/s), in N/m.
    pub fn dynamic_stiffness(&self, omega: f64) -> Complex<f64> {
        Complex::new(self.stiffness - omega * omega * self.mass, omega * self.damping)
    }

    /// Returns the same system in matrices of size 1×1.
    pub fn system(&self) -> SecondOrderSystem {
        let (m, c, k) = (dmatrix![self.mass], dmatrix![self.damping], dmatrix![self.stiffness]);
        SecondOrderSystem::new(m, c, k).expect("finite, and the mass is positive")
    }
}

impl From<Sdof> for SecondOrderSystem {
    fn from(sdof: Sdof) -> Self {
        sdof.system()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an oscillator with m = 2 kg, k = 8 N/m and the damping `c`: ωn = 2 rad/s, critical
    /// damping 8 N·s/m.
    fn sdof(c: f64) -> Sdof {
        Sdof::new(2.0, c, 8.0).unwrap()
    }

    #[test]
    fn the_three_regimes_have_their_roots() {
        let z = Complex::new;
        for (c, poles) in [
            (0.0, [z(0.0, 2.0), z(0.0, -2.0)]),
            // The roots of s² + 2.4 s + 4 = 0 are −1.2 ± 1.6i.
            (4.8, [z(-1.2, 1.6), z(-1.2, -1.6)]),
            (8.0, [z(-2.0, 0.0), z(-2.0, 0.0)]),
            // The roots of s² + 5 s + 4 = 0 are −4 and −1.
            (10.0, [z(-4.0, 0.0), z(-1.0, 0.0)]),
            (-10.0, [z(4.0, 0.0), z(1.0, 0.0)]),
        ] {
            for (found, expected) in sdof(c).poles().iter().zip(poles) {
                assert!((found - expected).norm() < 1e-15 * 4.0, "c = {c}: {found}");
            }
        }
        assert_eq!(sdof(4.8).damping_ratio(), 0.6);
        assert!((sdof(4.8).damped_frequency() - 1.6).abs() < 1e-15);
        assert_eq!(sdof(10.0).damped_frequency(), 0.0);
    }

    #[test]
    fn a_heavily_overdamped_slow_root_keeps_its_digits() {
        // With c = 1e9, the slow root −k/c (1 + k m/c² + …) is −8e-9 to all digits of double
        // precision.
        let slow = sdof(1e9).poles()[1].re;
        assert!((slow / -8e-9 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn modal_parameters_make_the_same_oscillator() {
        let sdof = Sdof::from_modal(10.0, 0.25, 20.0).unwrap();
        assert_eq!((sdof.damping(), sdof.stiffness()), (100.0, 4000.0));
        assert_eq!(sdof.dynamic_stiffness(30.0), Complex::new(-5000.0, 3000.0));
        assert_eq!(sdof.system().stiffness()[(0, 0)], 4000.0);
    }

    #[test]
    fn extreme_values_do_not_panic() {
        for m in [5e-324, 1e-300, 1e300, f64::MAX] {
            for k in [5e-324, 1.0, f64::MAX] {
                let sdof = Sdof::new(m, 1.0, k).unwrap();
                assert_eq!(sdof.system().mass()[(0, 0)], m);
                let _ = sdof.system().modes();
                let sampling = mechid_signal::Sampling::new(0.1, 3).unwrap();
                let _ = sdof.free_response(sampling, 1.0, 0.0);
            }
        }
    }

    #[test]
    fn impossible_parameters_are_named() {
        for (got, parameter) in [
            (Sdof::new(0.0, 1.0, 1.0), "mass"),
            (Sdof::new(1.0, f64::NAN, 1.0), "damping"),
            (Sdof::new(1.0, 1.0, -1.0), "stiffness"),
            (Sdof::from_modal(1.0, f64::INFINITY, 1.0), "damping ratio"),
            (Sdof::from_modal(1.0, 0.1, 0.0), "natural frequency"),
            (Sdof::from_modal(-1.0, 0.1, 1.0), "mass"),
        ] {
            assert!(
                matches!(got, Err(ModelError::Parameter { name, .. }) if name == parameter),
                "{parameter}: {got:?}"
            );
        }
    }
}
