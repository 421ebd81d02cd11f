//! Frequency of free vibration as a function of its amplitude.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::{NonlinearSystem, UncertainNonlinearSystem};
use crate::error::require;
use crate::limits;
use crate::{ModelError, SecondOrderSystem};

/// One point of a backbone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackbonePoint {
    /// Amplitude of the fundamental at the degree of freedom with the largest motion, in m.
    pub amplitude: f64,
    /// Frequency of the free vibration, in rad/s.
    pub omega: f64,
    /// Standard error of the frequency from the covariance of the parameters, in rad/s.
    pub standard_error: f64,
}

impl UncertainNonlinearSystem {
    /// Computes the backbone of a mode: its frequency without damping at each amplitude (m,
    /// ascending), with the standard error from the covariance (delta method). The amplitude is the
    /// amplitude of the fundamental, at the degree of freedom with the largest motion in the linear
    /// mode.
    ///
    /// Modes are those of M and K, counted from 0 in ascending order of frequency. The motion is a
    /// Fourier series of a mean and nine harmonics in balance with the forces; terms of the
    /// velocities are omitted together with the damping. The list ends early if the search finds
    /// no such motion: with a softening spring there may be none.
    ///
    /// # Errors
    /// [`ModelError::NoSuchMode`] if fewer modes oscillate without damping,
    /// [`ModelError::Parameter`] for an amplitude that is not positive, and the errors of
    /// [`NonlinearSystem::changed`].
    ///
    /// # Source
    /// Krack & Gross, *Harmonic Balance for Nonlinear Vibration Problems* (2019), chapters 2 and 4;
    /// Kerschen, Peeters, Golinval & Vakakis (2009), Mechanical Systems and Signal Processing 23,
    /// 170–194 (nonlinear normal modes).
    ///
    /// ```
    /// use mechid_model::{NonlinearSystem, Sdof, UncertainNonlinearSystem};
    ///
    /// // A spring that hardens: ω² ≈ k + ¾ k₃ A² at 1 kg.
    /// let linear = Sdof::new(1.0, 0.1, 4.0)?.system();
    /// let system = NonlinearSystem::new(linear, "k3: x^3".parse()?, vec![0.1])?;
    /// let points = UncertainNonlinearSystem::exact(system).backbone(0, &[0.1, 1.0])?;
    /// assert!((points[0].omega - (4.0 + 0.075 * 0.01_f64).sqrt()).abs() < 1e-8);
    /// assert!((points[1].omega - 4.075_f64.sqrt()).abs() < 1e-4);
    /// # Ok::<(), mechid_model::ModelError>(())
    /// ```
    pub fn backbone(
        &self,
        mode: usize,
        amplitudes: &[f64],
    ) -> Result<Vec<BackbonePoint>, ModelError> {
        let (mut motion, dof) = start(self.system(), mode)?;
        let balance = Balance::new(self.system());
        // The initial motion is a linear mode, which is the motion in the limit of zero amplitude.
        // Its scale is arbitrary.
        let (mut points, mut reached) = (Vec::new(), 0.0);
        for &amplitude in amplitudes {
            require("amplitude of a backbone", amplitude, "positive", amplitude > 0.0)?;
            let Some(next) = balance.reach(&motion, dof, [reached, amplitude]) else { break };
            (motion, reached) = (next, amplitude);
            let Some(variance) = self.variance(&balance, &motion, dof)? else { break };
            let (omega, standard_error) = (motion.omega, variance.max(0.0).sqrt());
            points.push(BackbonePoint { amplitude, omega, standard_error });
        }
        Ok(points)
    }

    /// Returns the variance of the frequency; `None` at a fold, where the frequency has no
    /// derivative.
    fn variance(
        &self,
        balance: &Balance<'_>,
        motion: &Motion,
        dof: usize,
    ) -> Result<Option<f64>, ModelError> {
        // ω changes by −(last row of J⁻¹) ∂R/∂θ, so one solution with Jᵀ is enough for all
        // parameters.
        let jacobian = balance.jacobian(motion, dof);
        let mut last = DVector::zeros(jacobian.nrows());
        last[jacobian.nrows() - 1] = 1.0;
        let Some(row) = jacobian.transpose().lu().solve(&last) else { return Ok(None) };
        let covariance = self.covariance();
        let mut slopes = DVector::zeros(self.parameters().len());
        for (at, parameter) in self.parameters().iter().enumerate() {
            let step = limits::PARAMETER_STEP * covariance[(at, at)].sqrt();
            if step > 0.0 {
                let [above, below] = [
                    self.system().changed(*parameter, step)?,
                    self.system().changed(*parameter, -step)?,
                ];
                let change =
                    Balance::new(&above).forces(motion) - Balance::new(&below).forces(motion);
                slopes[at] = -row.rows(0, change.len()).dot(&change) / (2.0 * step);
            }
        }
        Ok(Some(slopes.dot(&(covariance * &slopes))))
    }
}

/// Motion x(t) = Σ a_h cos hωt, with the harmonics h from 0.
#[derive(Clone)]
struct Motion {
    /// Amplitudes a_h of the harmonics, degrees of freedom × (harmonics + 1), in m.
    cosines: DMatrix<f64>,
    /// Frequency (rad/s).
    omega: f64,
}

/// Returns the mode of M and K as a motion of 1 m at the degree of freedom with the largest motion.
fn start(system: &NonlinearSystem, mode: usize) -> Result<(Motion, usize), ModelError> {
    let linear = system.linear();
    let none = DMatrix::zeros(linear.dof(), linear.dof());
    let undamped = SecondOrderSystem::new(linear.mass().clone(), none, linear.stiffness().clone())?;
    let modes = undamped.modes()?;
    let oscillating: Vec<_> = modes
        .iter()
        .filter(|mode| mode.oscillates() && mode.damping_ratio().abs() < limits::UNDAMPED)
        .collect();
    let mode = oscillating
        .get(mode)
        .ok_or(ModelError::NoSuchMode { mode: mode + 1, modes: oscillating.len() })?;
    let dof = mode.shape().icamax();
    let mut cosines = DMatrix::zeros(linear.dof(), limits::HARMONICS + 1);
    cosines.set_column(1, &mode.shape().map(|entry| (entry / mode.shape()[dof]).re));
    Ok((Motion { cosines, omega: mode.damped_frequency() }, dof))
}

/// Harmonic balance of a free undamped motion.
struct Balance<'a> {
    system: &'a NonlinearSystem,
    /// Values of cos hτ: instants × (harmonics + 1).
    waves: DMatrix<f64>,
}

impl<'a> Balance<'a> {
    fn new(system: &'a NonlinearSystem) -> Self {
        let tau = TAU / limits::INSTANTS as f64;
        let wave = |s: usize, h: usize| (((s * h) % limits::INSTANTS) as f64 * tau).cos();
        Self { system, waves: DMatrix::from_fn(limits::INSTANTS, limits::HARMONICS + 1, wave) }
    }

    /// Continues a motion to another amplitude; `None` if no motion is found there.
    fn reach(
        &self,
        from: &Motion,
        dof: usize,
        [mut reached, amplitude]: [f64; 2],
    ) -> Option<Motion> {
        let (mut at, mut next) = (from.clone(), amplitude);
        for _ in 0..limits::BACKBONE_ATTEMPTS {
            let mut guess = at.clone();
            guess.cosines *= next / at.cosines[(dof, 1)];
            match self.solve(guess, dof, next) {
                Some(motion) if next == amplitude => return Some(motion),
                Some(motion) => (at, reached, next) = (motion, next, amplitude),
                None => next = 0.5 * (reached + next),
            }
        }
        None
    }

    /// Applies Newton's method to an initial motion.
    fn solve(&self, mut motion: Motion, dof: usize, amplitude: f64) -> Option<Motion> {
        for _ in 0..limits::BACKBONE_NEWTON_STEPS {
            let forces = self.forces(&motion);
            let residual = forces.push(motion.cosines[(dof, 1)] - amplitude);
            let step = self.jacobian(&motion, dof).lu().solve(&residual)?;
            let last = step.len() - 1;
            let cosines = DMatrix::from_column_slice(
                motion.cosines.nrows(),
                motion.cosines.ncols(),
                &step.as_slice()[..last],
            );
            motion.cosines -= &cosines;
            motion.omega -= step[last];
            if !(motion.omega > 0.0 && motion.omega.is_finite()) {
                return None;
            }
            let small = cosines.amax() <= limits::BACKBONE_STEP * amplitude;
            if small && step[last].abs() <= limits::BACKBONE_STEP * motion.omega {
                return Some(motion);
            }
        }
        None
    }

    /// Returns the residuals (K − h²ω²M) a_h plus the h-th harmonic of the terms, for every h, in
    /// N.
    fn forces(&self, motion: &Motion) -> DVector<f64> {
        let linear = self.system.linear();
        let mut forces = linear.stiffness() * &motion.cosines;
        let inertia = linear.mass() * &motion.cosines;
        for (h, mut column) in forces.column_iter_mut().enumerate() {
            column.axpy(-(h as f64 * motion.omega).powi(2), &inertia.column(h), 1.0);
        }
        let course = &self.waves * motion.cosines.transpose();
        for (term, coefficient) in self.system.terms().iter().zip(self.system.coefficients()) {
            let at = term.coordinate();
            let force = DVector::from_fn(limits::INSTANTS, |s, _| {
                let q = at.value(&course.row(s).iter().copied().collect::<Vec<_>>());
                coefficient * term.law().value(q, 0.0)
            });
            for (h, harmonic) in self.waves.tr_mul(&force).iter().enumerate() {
                for (dof, sign) in at.signs() {
                    forces[(dof, h)] += sign * share(h) * harmonic;
                }
            }
        }
        DVector::from_column_slice(forces.as_slice())
    }

    /// Returns the derivatives of the forces and of the amplitude with respect to the harmonics and
    /// the frequency.
    fn jacobian(&self, motion: &Motion, dof: usize) -> DMatrix<f64> {
        let (n, linear) = (self.system.dof(), self.system.linear());
        let last = n * (limits::HARMONICS + 1);
        let mut jacobian = DMatrix::zeros(last + 1, last + 1);
        let inertia = linear.mass() * &motion.cosines;
        for h in 0..=limits::HARMONICS {
            let multiple = h as f64;
            let block = linear.stiffness() - linear.mass() * (multiple * motion.omega).powi(2);
            jacobian.view_mut((h * n, h * n), (n, n)).copy_from(&block);
            let by_omega = inertia.column(h) * (-2.0 * multiple * multiple * motion.omega);
            jacobian.view_mut((h * n, last), (n, 1)).copy_from(&by_omega);
        }
        let course = &self.waves * motion.cosines.transpose();
        for (term, coefficient) in self.system.terms().iter().zip(self.system.coefficients()) {
            let at = term.coordinate();
            let mut bent = self.waves.clone();
            for (s, mut row) in bent.row_iter_mut().enumerate() {
                let q = at.value(&course.row(s).iter().copied().collect::<Vec<_>>());
                row *= coefficient * term.law().slopes(q, 0.0)[0];
            }
            let harmonics = self.waves.tr_mul(&bent);
            for ((h, l), slope) in (0..=limits::HARMONICS)
                .flat_map(|l| (0..=limits::HARMONICS).map(move |h| (h, l)))
                .zip(&harmonics)
            {
                for (row, sign) in at.signs() {
                    for (column, other) in at.signs() {
                        jacobian[(h * n + row, l * n + column)] += sign * other * share(h) * slope;
                    }
                }
            }
        }
        jacobian[(last, n + dof)] = 1.0;
        jacobian
    }
}

/// Returns the weight of each instant in the Fourier sum of a harmonic.
fn share(harmonic: usize) -> f64 {
    if harmonic == 0 { 1.0 / limits::INSTANTS as f64 } else { 2.0 / limits::INSTANTS as f64 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::dmatrix;

    use super::*;
    use crate::{NonlinearParameter, Sdof};

    /// Complete elliptic integral of the first kind by the arithmetic-geometric mean.
    fn elliptic(parameter: f64) -> f64 {
        let (mut a, mut b) = (1.0_f64, (1.0 - parameter).sqrt());
        while (a - b).abs() > 1e-15 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        FRAC_PI_2 / a
    }

    /// Returns the frequency and the amplitude of the fundamental of the motion ẍ + k x + k₃ x³ = 0
    /// that starts at rest from x = `peak`. The solution is x = peak cn(Ωt) with Ω² = k + k₃ peak².
    fn duffing(k: f64, cubic: f64, peak: f64) -> (f64, f64) {
        let square = k + cubic * peak * peak;
        let parameter = cubic * peak * peak / (2.0 * square);
        let quarter = elliptic(parameter);
        let nome = (-PI * elliptic(1.0 - parameter) / quarter).exp();
        let fundamental = peak * TAU / (parameter.sqrt() * quarter) * nome.sqrt() / (1.0 + nome);
        (PI * square.sqrt() / (2.0 * quarter), fundamental)
    }

    fn hardening() -> NonlinearSystem {
        let linear = Sdof::new(1.0, 0.3, 4.0).unwrap().system();
        // The dampers have no effect on the backbone.
        let terms = "k3: x^3, c2: |v| v, cx: x^2 v".parse().unwrap();
        NonlinearSystem::new(linear, terms, vec![0.8, 0.1, 0.1]).unwrap()
    }

    #[test]
    fn the_backbone_of_a_cubic_spring_is_that_of_jacobi() {
        let known = UncertainNonlinearSystem::exact(hardening());
        let (omega, amplitudes): (Vec<f64>, Vec<f64>) =
            [0.01, 0.5, 2.0, 6.0].map(|peak| duffing(4.0, 0.8, peak)).into_iter().unzip();
        let points = known.backbone(0, &amplitudes).unwrap();
        assert_eq!(points.len(), 4);
        for (point, omega) in points.iter().zip(omega) {
            assert!((point.omega / omega - 1.0).abs() < 1e-8, "{point:?}, {omega}");
            assert_eq!(point.standard_error, 0.0);
        }
        // The point at the largest amplitude must be the same if the smaller amplitudes are not
        // requested.
        let alone = known.backbone(0, &amplitudes[3..]).unwrap();
        assert!((alone[0].omega / points[3].omega - 1.0).abs() < 1e-10);
    }

    #[test]
    fn the_spring_between_two_equal_masses_bends_one_mode_alone() {
        let linear = SecondOrderSystem::new(
            DMatrix::identity(2, 2),
            dmatrix![0.1, 0.0; 0.0, 0.2],
            dmatrix![3.0, -1.0; -1.0, 3.0],
        );
        let terms = "kc: (x1-x2)^3".parse().unwrap();
        let system = NonlinearSystem::new(linear.unwrap(), terms, vec![0.5]).unwrap();
        let known = UncertainNonlinearSystem::exact(system);
        let together = known.backbone(0, &[0.1, 1.0]).unwrap();
        assert!(together.iter().all(|point| (point.omega - 2_f64.sqrt()).abs() < 1e-10));
        // d = x₁ − x₂ obeys d̈ + 4 d + 2·0.5 d³ = 0.
        let (omega, fundamental) = duffing(4.0, 1.0, 1.5);
        let against = known.backbone(1, &[0.5 * fundamental]).unwrap();
        assert!((against[0].omega / omega - 1.0).abs() < 1e-8, "{against:?}, {omega}");
    }

    #[test]
    fn a_standard_error_is_that_of_the_changed_system() {
        let (system, amplitude) = (hardening(), 1.2);
        let at = |system: &NonlinearSystem| {
            UncertainNonlinearSystem::exact(system.clone()).backbone(0, &[amplitude]).unwrap()[0]
                .omega
        };
        let mut slopes = DVector::zeros(4);
        let names = ["m", "c", "k", "k3"];
        let parameters = names.map(|name| NonlinearParameter::named(name, &system).unwrap());
        for (slope, parameter) in slopes.iter_mut().zip(parameters) {
            let changed = |by| at(&system.changed(parameter, by).unwrap());
            *slope = (changed(1e-4) - changed(-1e-4)) / 2e-4;
        }
        let root = DMatrix::from_fn(4, 4, |i, j| 0.01 * (1.0 + (3 * i + j) as f64).sin());
        let covariance = &root * root.transpose();
        let expected = slopes.dot(&(&covariance * &slopes)).sqrt();
        let known = UncertainNonlinearSystem::new(system, parameters.to_vec(), covariance).unwrap();
        let found = known.backbone(0, &[amplitude]).unwrap()[0].standard_error;
        assert!((found / expected - 1.0).abs() < 1e-6, "{found}, {expected}");
    }

    #[test]
    fn a_spring_that_softens_ends_where_it_gives_way() {
        // With the force x − x³, no vibration exceeds the unstable equilibria at ±1.
        let linear = Sdof::new(1.0, 0.0, 1.0).unwrap().system();
        let system = NonlinearSystem::new(linear, "k3: x^3".parse().unwrap(), vec![-1.0]).unwrap();
        let known = UncertainNonlinearSystem::exact(system);
        let points = known.backbone(0, &[0.2, 0.5, 0.8, 3.0]).unwrap();
        assert_eq!(points.len(), 3, "{points:?}");
        assert!(points.windows(2).all(|pair| pair[1].omega < pair[0].omega));
    }

    #[test]
    fn modes_and_amplitudes_that_do_not_exist_are_refused() {
        let known = UncertainNonlinearSystem::exact(hardening());
        assert_eq!(known.backbone(1, &[1.0]), Err(ModelError::NoSuchMode { mode: 2, modes: 1 }));
        assert!(known.backbone(0, &[-1.0]).unwrap_err().to_string().contains("amplitude"));
    }
}
