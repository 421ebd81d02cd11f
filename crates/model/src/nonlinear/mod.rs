//! Systems with nonlinear springs and dampers.

mod backbone;
mod law;
mod parse;
mod term;
mod uncertain;

pub use backbone::BackbonePoint;
pub use law::{Constant, Friction, Gap, Law, Power, QuadraticDamping, SaturatingDamping};
pub use term::{Coordinate, Term, Terms};
pub use uncertain::{NonlinearParameter, UncertainNonlinearSystem};

use mechid_signal::Record;
use nalgebra::DMatrix;

use crate::{ModelError, Response, SecondOrderSystem};

/// M ẍ + C ẋ + K x + Σ θ f(q, q̇) = F: a linear system and nonlinear [`Terms`] with their
/// coefficients θ.
///
/// ```
/// use mechid_model::{NonlinearSystem, Sdof, Terms};
///
/// // A spring that hardens: 5000 x + 2·10⁶ x³.
/// let linear = Sdof::new(10.0, 180.0, 5000.0)?.system();
/// let system = NonlinearSystem::new(linear, "k3: x^3".parse::<Terms>()?, vec![2e6])?;
/// let mut force = [0.0];
/// system.restoring_force(&[0.01], &[0.0], &mut force);
/// assert!((force[0] - 52.0).abs() < 1e-12);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
///
/// # Source
/// Worden & Tomlinson, *Nonlinearity in Structural Dynamics* (2001), chapter 2.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        try_from = "crate::serde_forms::NonlinearForm",
        into = "crate::serde_forms::NonlinearForm"
    )
)]
pub struct NonlinearSystem {
    linear: SecondOrderSystem,
    terms: Terms,
    coefficients: Vec<f64>,
}

impl NonlinearSystem {
    /// Creates a linear system with terms and their coefficients, each in its own unit.
    ///
    /// # Errors
    /// [`ModelError::Term`] if a term does not belong to the system, [`ModelError::Coefficients`]
    /// unless there is one finite coefficient for each term.
    pub fn new(
        linear: SecondOrderSystem,
        terms: Terms,
        coefficients: Vec<f64>,
    ) -> Result<Self, ModelError> {
        terms.check_dof(linear.dof())?;
        terms.check_coefficients(&coefficients)?;
        Ok(Self { linear, terms, coefficients })
    }

    /// Returns M, C and K. They describe the system at small amplitudes if the slope of every term
    /// is zero at rest.
    pub fn linear(&self) -> &SecondOrderSystem {
        &self.linear
    }

    /// The nonlinear terms.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Coefficients of the terms, each in its own unit.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.linear.dof()
    }

    /// Computes C ẋ + K x + Σ θ f(q, q̇), in N, from displacements (m) and velocities (m/s), and
    /// writes it into `force`. `displacement`, `velocity` and `force` have one entry per degree of
    /// freedom.
    ///
    /// # Panics
    /// If `displacement`, `velocity` or `force` has another length.
    pub fn restoring_force(&self, displacement: &[f64], velocity: &[f64], force: &mut [f64]) {
        let n = self.dof();
        for (row, force) in force.iter_mut().enumerate() {
            *force = (0..n)
                .map(|column| {
                    self.linear.damping()[(row, column)] * velocity[column]
                        + self.linear.stiffness()[(row, column)] * displacement[column]
                })
                .sum();
        }
        for (term, coefficient) in self.terms.iter().zip(&self.coefficients) {
            let value = coefficient * term.value(displacement, velocity);
            for (dof, sign) in term.coordinate().signs() {
                force[dof] += sign * value;
            }
        }
    }

    /// Returns ∂/∂x and ∂/∂ẋ of [`NonlinearSystem::restoring_force`]: K and C of small motions
    /// about a displacement (m) and velocity (m/s), n × n, in N/m and N·s/m.
    ///
    /// # Panics
    /// If `displacement` or `velocity` has fewer than n entries.
    pub fn tangents(&self, displacement: &[f64], velocity: &[f64]) -> [DMatrix<f64>; 2] {
        let mut tangents = [self.linear.stiffness().clone(), self.linear.damping().clone()];
        for (term, coefficient) in self.terms.iter().zip(&self.coefficients) {
            let at = term.coordinate();
            let slopes = term.law().slopes(at.value(displacement), at.value(velocity));
            for (tangent, slope) in tangents.iter_mut().zip(slopes) {
                for (row, sign) in at.signs() {
                    for (column, other) in at.signs() {
                        tangent[(row, column)] += sign * other * coefficient * slope;
                    }
                }
            }
        }
        tangents
    }

    /// Returns the force (N, samples × degrees of freedom) that causes this response.
    ///
    /// # Errors
    /// [`ModelError::StateLength`] if the response has another number of degrees of freedom,
    /// [`ModelError::Signal`] if the force overflows.
    pub fn force(&self, response: &Response) -> Result<Record, ModelError> {
        let (n, got) = (self.dof(), response.dof());
        if got != n {
            return Err(ModelError::StateLength { got, dof: n });
        }
        let mut data = response.acceleration().data() * self.linear.mass().transpose();
        let sample = |record: &Record, k: usize| record.data().row(k).iter().copied().collect();
        let mut restoring = vec![0.0; n];
        for k in 0..response.sampling().len() {
            let (x, v): (Vec<f64>, Vec<f64>) =
                (sample(response.displacement(), k), sample(response.velocity(), k));
            self.restoring_force(&x, &v, &mut restoring);
            for (channel, force) in restoring.iter().enumerate() {
                data[(k, channel)] += force;
            }
        }
        Ok(Record::new(response.sampling(), data)?)
    }
}

#[cfg(test)]
mod tests {
    use mechid_signal::Sampling;
    use nalgebra::dmatrix;

    use super::*;

    fn two() -> NonlinearSystem {
        let linear = SecondOrderSystem::new(
            dmatrix![1.0, 0.0; 0.0, 2.0],
            dmatrix![0.3, -0.1; -0.1, 0.1],
            dmatrix![30.0, -10.0; -10.0, 10.0],
        );
        let terms = "kc: (x1-x2)^3, cq: |v2| v2".parse().unwrap();
        NonlinearSystem::new(linear.unwrap(), terms, vec![5.0, 0.5]).unwrap()
    }

    #[test]
    fn a_force_between_two_has_its_reaction() {
        let (x, v) = ([0.3, -0.2], [1.0, -2.0]);
        let mut force = [0.0; 2];
        two().restoring_force(&x, &v, &mut force);
        let cubic = 5.0 * 0.5f64.powi(3);
        assert!((force[0] - (0.3 + 0.2 + 9.0 + 2.0 + cubic)).abs() < 1e-14);
        assert!((force[1] - (-0.1 - 0.2 - 3.0 - 2.0 - cubic - 2.0)).abs() < 1e-14);
    }

    #[test]
    fn the_force_of_a_response_is_that_of_the_equation_of_motion() {
        let sampling = Sampling::new(0.1, 2).unwrap();
        let record = |data| Record::new(sampling, data).unwrap();
        let response = Response::new(
            record(dmatrix![0.3, -0.2; 0.0, 0.0]),
            record(dmatrix![1.0, -2.0; 0.0, 0.0]),
            record(dmatrix![4.0, 5.0; 1.0, -1.0]),
        );
        let force = two().force(&response.unwrap()).unwrap();
        let mut restoring = [0.0; 2];
        two().restoring_force(&[0.3, -0.2], &[1.0, -2.0], &mut restoring);
        let expected = dmatrix![4.0 + restoring[0], 10.0 + restoring[1]; 1.0, -2.0];
        assert!((force.data() - expected).amax() < 1e-14);
    }

    #[test]
    fn tangents_are_the_derivatives_of_the_restoring_force() {
        let (system, x, v, h) = (two(), [0.3, -0.2], [1.0, -2.0], 1e-5);
        let force = |x: &[f64], v: &[f64]| {
            let mut force = [0.0; 2];
            system.restoring_force(x, v, &mut force);
            force
        };
        let [stiffness, damping] = system.tangents(&x, &v);
        for column in 0..2 {
            let moved = |of: [f64; 2], by: f64| {
                let mut moved = of;
                moved[column] += by;
                moved
            };
            let by_x = [force(&moved(x, h), &v), force(&moved(x, -h), &v)];
            let by_v = [force(&x, &moved(v, h)), force(&x, &moved(v, -h))];
            for row in 0..2 {
                // The error of a central difference is h²/6 times the third derivative, plus
                // rounding.
                let of = |[up, down]: [[f64; 2]; 2]| (up[row] - down[row]) / (2.0 * h);
                assert!((of(by_x) - stiffness[(row, column)]).abs() < 1e-8);
                assert!((of(by_v) - damping[(row, column)]).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn coefficients_and_terms_must_fit() {
        let terms: Terms = "kc: (x1-x2)^3".parse().unwrap();
        let linear = two().linear().clone();
        for wrong in [vec![], vec![1.0, 2.0], vec![f64::NAN]] {
            assert!(NonlinearSystem::new(linear.clone(), terms.clone(), wrong).is_err());
        }
        assert!(NonlinearSystem::new(linear, "a: x3^3".parse().unwrap(), vec![1.0]).is_err());
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_system_is_read_back_from_json() {
        let text = serde_json::to_string(&two()).unwrap();
        assert_eq!(serde_json::from_str::<NonlinearSystem>(&text).unwrap(), two());
    }
}
