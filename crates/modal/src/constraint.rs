//! Constraints that a structure puts on its modes: real shapes and reciprocity.
//!
//! A constraint c(v) = 0 acts on v, the pole, shape and participations of a mode. The estimate v̂
//! has the covariance Σ; the constrained estimate v minimises (v̂ − v)ᵀ Σ⁻¹ (v̂ − v). To first
//! order this is the maximum-likelihood estimate under the constraint, and the minimum is the
//! likelihood-ratio statistic, χ² with one degree of freedom for each equation if the constraint is
//! true.
//!
//! # Source
//! Aitchison & Silvey, Annals of Mathematical Statistics 29 (1958) 813 (estimates under
//! constraints); Ewins, *Modal Testing*, 2nd ed. (2000), sections 2.4 and 3.5 (real shapes,
//! reciprocity).

use nalgebra::{Complex, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::ModalError;
use crate::limits::{CONSTRAINT_STEPS, DEPENDENT_EQUATION};
use crate::mode_parameters::ModeParameters;

/// Sensor at the point of a force, with the direction of the force or the opposite direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DrivingPoint {
    /// Index of the output.
    pub output: usize,
    /// Index of the input.
    pub input: usize,
    /// `true` if the positive direction of the sensor is opposite to that of the force.
    pub is_opposite: bool,
}

impl DrivingPoint {
    /// Creates a driving point whose sensor and force have the same direction, from the indices of
    /// output and input.
    pub fn new(output: usize, input: usize) -> Self {
        Self { output, input, is_opposite: false }
    }

    /// Returns the factor (1 or −1) between the output and the response in the direction of the
    /// force.
    pub fn sign(&self) -> f64 {
        if self.is_opposite { -1.0 } else { 1.0 }
    }
}

/// Known property of a structure that its modes must satisfy.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModalConstraint {
    /// Proportional damping: the residues of a mode are real multiples of λⁿ/(2jω_d), where λ is
    /// the pole and ω_d the damped natural frequency of the mode. The inputs must be forces, and
    /// the outputs must be the n-th time derivatives of displacements.
    RealShapes {
        /// The order n: 0 for displacements, 1 for velocities, 2 for accelerations.
        derivative: i32,
    },
    /// Reciprocity: the response between any two of the points is the same in both directions.
    Reciprocity {
        /// Driving points, at least two.
        points: Vec<DrivingPoint>,
    },
}

/// Test of a constraint on one mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstraintTest {
    /// Index of the mode in the estimate.
    pub mode: usize,
    /// Index of the constraint in the settings.
    pub constraint: usize,
    /// Likelihood-ratio statistic: increase of −2 log L due to the constraint.
    pub statistic: f64,
    /// Number of equations of the constraint.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least as large as this one if the constraint is true.
    pub p_value: f64,
}

impl ModalConstraint {
    /// Checks that the constraint names outputs and inputs that exist.
    pub(crate) fn check(&self, outputs: usize, inputs: usize) -> Result<(), ModalError> {
        let refused = |value: usize, required| {
            Err(ModalError::Setting { setting: "constraints", value: value as f64, required })
        };
        match self {
            Self::RealShapes { derivative } if !(0..=2).contains(derivative) => {
                let required = "a derivative of 0, 1 or 2";
                let value = f64::from(*derivative);
                Err(ModalError::Setting { setting: "constraints", value, required })
            }
            Self::RealShapes { .. } if inputs == 0 => refused(0, "at least one measured force"),
            Self::RealShapes { .. } => Ok(()),
            Self::Reciprocity { points } => {
                if points.len() < 2 {
                    return refused(points.len(), "at least two driving points");
                }
                for (k, point) in points.iter().enumerate() {
                    if point.output >= outputs {
                        return refused(point.output, "an output of the data");
                    }
                    if point.input >= inputs {
                        return refused(point.input, "an input of the data");
                    }
                    let same =
                        |p: &DrivingPoint| p.output == point.output || p.input == point.input;
                    if points[..k].iter().any(same) {
                        return refused(
                            point.output,
                            "a driving point that shares neither output nor input with another driving point",
                        );
                    }
                }
                Ok(())
            }
        }
    }

    /// Returns the left-hand sides of the equations of the constraint.
    fn equations(&self, mode: &ModeParameters) -> Vec<f64> {
        match self {
            Self::RealShapes { derivative } => {
                let pole = mode.pole();
                let phase = pole.powi(*derivative) / Complex::i();
                let phase = phase / phase.norm();
                // The gauge is the input or transient whose participation is fixed at 1. If it is a
                // transient, it does not fix the phase of the forces; the input `phase_input` does.
                let reference = mode.phase_input();
                let phase_factor = mode.participation(reference);
                let phase_factor = phase_factor / phase_factor.norm();
                let entry = |output| (mode.shape(output) * phase_factor / phase).im;
                let entries = (0..mode.outputs).map(entry);
                let forces = (0..mode.inputs).filter(|input| *input != reference);
                let participations =
                    forces.map(|input| (mode.participation(input) / phase_factor).im);
                entries.chain(participations).collect()
            }
            Self::Reciprocity { points } => {
                let strength = |point: &&DrivingPoint| mode.participation(point.input).norm();
                let strongest = points.iter().max_by(|a, b| strength(a).total_cmp(&strength(b)));
                let Some(reference) = strongest else { return Vec::new() };
                let shape = |point: &DrivingPoint| mode.shape(point.output) * point.sign();
                let participation = mode.participation(reference.input);
                let partners = points.iter().filter(|point| *point != reference);
                let difference = |point: &DrivingPoint| {
                    shape(point) * participation
                        - shape(reference) * mode.participation(point.input)
                };
                partners
                    .map(difference)
                    .flat_map(|difference| [difference.re, difference.im])
                    .collect()
            }
        }
    }
}

/// Returns the test statistic and the degrees of freedom of the constraints on a mode, and the
/// constrained mode; `None` without constraints, or if a constrained quantity has no finite
/// variance.
pub(crate) fn impose(
    constraints: &[ModalConstraint],
    estimate: &ModeParameters,
) -> Option<(f64, usize, ModeParameters)> {
    let equations = |mode: &ModeParameters| -> DVector<f64> {
        DVector::from_vec(constraints.iter().flat_map(|one| one.equations(mode)).collect())
    };
    if constraints.is_empty() {
        return None;
    }
    let mut mode = estimate.clone();
    let mut statistic = 0.0;
    let mut count = 0;
    for _ in 0..CONSTRAINT_STEPS {
        let slope = derivative(&equations, &mode, &estimate.covariance);
        let difference = equations(&mode) + &slope * (&estimate.values - &mode.values);
        let cross = &estimate.covariance * slope.transpose();
        let inner = &slope * &cross;
        let scale = inner.diagonal().map(|value| 1.0 / value.sqrt());
        if scale.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let scaled = DMatrix::from_diagonal(&scale) * inner * DMatrix::from_diagonal(&scale);
        // Dependent equations add no direction; only independent equations count as degrees of
        // freedom.
        let eigen = crate::decomposition::hermitian_eigen(scaled)?;
        let floor = DEPENDENT_EQUATION * eigen.eigenvalues.max();
        let independent = eigen.eigenvalues.iter().enumerate().filter(|(_, value)| **value > floor);
        let directions: Vec<DVector<f64>> = independent
            .map(|(k, value)| eigen.eigenvectors.column(k).component_mul(&scale) / value.sqrt())
            .collect();
        let directions = DMatrix::from_columns(&directions);
        let along = directions.transpose() * difference;
        let cross = cross * directions;
        (statistic, count) = (along.norm_squared(), along.len());
        mode.values = &estimate.values - &cross * along;
        mode.covariance = &estimate.covariance - &cross * cross.transpose();
    }
    statistic.is_finite().then_some((statistic, count, mode))
}

/// Tests each constraint on one mode without the other constraints.
pub(crate) fn test(
    constraints: &[ModalConstraint],
    estimate: &ModeParameters,
    mode: usize,
) -> Vec<ConstraintTest> {
    let tested = |(constraint, one): (usize, &ModalConstraint)| {
        let (statistic, degrees_of_freedom, _) = impose(std::slice::from_ref(one), estimate)?;
        let p_value = ChiSquared::new(degrees_of_freedom as f64).ok()?.sf(statistic);
        Some(ConstraintTest { mode, constraint, statistic, degrees_of_freedom, p_value })
    };
    constraints.iter().enumerate().filter_map(tested).collect()
}

/// Returns central differences with steps of a thousandth of the standard errors. The error of
/// these differences is negligible, because the equations are products of two or three parameters.
fn derivative(
    equations: &impl Fn(&ModeParameters) -> DVector<f64>,
    at: &ModeParameters,
    covariance: &DMatrix<f64>,
) -> DMatrix<f64> {
    const STEP: f64 = 1e-3;
    let (rows, columns) = (equations(at).len(), at.values.len());
    let mut slope = DMatrix::zeros(rows, columns);
    let mut moved = at.clone();
    for column in 0..columns {
        let step = STEP * covariance[(column, column)].max(0.0).sqrt();
        if step > 0.0 {
            let value = at.values[column];
            moved.values[column] = value + step;
            let plus = equations(&moved);
            moved.values[column] = value - step;
            let difference = plus - equations(&moved);
            moved.values[column] = value;
            slope.set_column(column, &(difference / (2.0 * step)));
        }
    }
    slope
}

#[cfg(test)]
mod tests {
    use super::*;

    type C = Complex<f64>;

    /// A mode with two outputs and two inputs. Only the shape entries are uncertain: `variance` is
    /// the variance of the real and of the imaginary part of each entry.
    fn mode(shape: [C; 2], variance: [f64; 2]) -> ModeParameters {
        let pole = C::new(-2.0, 300.0);
        let mut values = vec![-pole.re, pole.im].into_iter().map(f64::ln).collect::<Vec<_>>();
        values.extend(shape.iter().flat_map(|z| [z.re, z.im]));
        values.extend([1.0, 0.0, 1.0, 0.0]);
        let mut covariance = DMatrix::zeros(10, 10);
        for (k, variance) in variance.iter().enumerate() {
            covariance[(2 + 2 * k, 2 + 2 * k)] = *variance;
            covariance[(3 + 2 * k, 3 + 2 * k)] = *variance;
        }
        let values = DVector::from_vec(values);
        let (outputs, inputs, gauge, degrees_of_freedom) = (2, 2, 0, 100);
        ModeParameters { outputs, inputs, gauge, values, covariance, degrees_of_freedom }
    }

    /// If both participations are 1, reciprocity makes the two shape entries equal: the result is
    /// their weighted mean.
    #[test]
    fn reciprocity_of_known_participations_is_a_weighted_mean() {
        let (a, b) = (C::new(1.0, 0.2), C::new(1.3, -0.1));
        let (u, v) = (0.04, 0.01);
        let points = vec![DrivingPoint::new(0, 0), DrivingPoint::new(1, 1)];
        let reciprocity = ModalConstraint::Reciprocity { points };
        let (statistic, freedom, result) = impose(&[reciprocity], &mode([a, b], [u, v])).unwrap();
        let mean = (a / u + b / v) / (1.0 / u + 1.0 / v);
        assert!((result.shape(0) - mean).norm() + (result.shape(1) - mean).norm() < 1e-9);
        assert!((statistic - (a - b).norm_sqr() / (u + v)).abs() < 1e-6);
        assert_eq!(freedom, 2);
        let variance = 1.0 / (1.0 / u + 1.0 / v);
        assert!((result.covariance[(2, 2)] - variance).abs() < 1e-9);
    }

    /// A sensor whose direction is opposite to that of the force measures the negative shape entry.
    #[test]
    fn reciprocity_counts_the_direction_of_a_sensor() {
        let (a, b) = (C::new(1.0, 0.2), C::new(1.3, -0.1));
        let opposite = DrivingPoint { is_opposite: true, ..DrivingPoint::new(1, 1) };
        let constraint =
            |point| ModalConstraint::Reciprocity { points: vec![DrivingPoint::new(0, 0), point] };
        let imposed =
            |point, entry| impose(&[constraint(point)], &mode([a, entry], [0.04, 0.01])).unwrap();
        let (same, _, plain) = imposed(DrivingPoint::new(1, 1), b);
        let (turned, _, result) = imposed(opposite, -b);
        assert!((same - turned).abs() < 1e-9 * same, "{same} {turned}");
        assert!((plain.shape(1) + result.shape(1)).norm() < 1e-12);
        assert!((plain.shape(0) - result.shape(0)).norm() < 1e-12);
    }

    /// The test imposes real shapes on a mode with a known pole. Each shape entry loses its
    /// component perpendicular to the phase of the residues, which is the phase of λ²/j for
    /// accelerations per force.
    #[test]
    fn real_shapes_lose_their_part_across_the_phase() {
        let pole = C::new(-2.0, 300.0);
        let phase = pole * pole / C::i() / pole.norm_sqr();
        let entries = [C::new(2.0, 0.3) * phase, C::new(-1.0, 0.1) * phase];
        let real = ModalConstraint::RealShapes { derivative: 2 };
        let both = [
            real.clone(),
            // The estimated participations are 1, so that reciprocity requires equal shape entries.
            ModalConstraint::Reciprocity {
                points: vec![DrivingPoint::new(0, 0), DrivingPoint::new(1, 1)],
            },
        ];
        let estimate = mode(entries, [0.01, 0.01]);
        // The imaginary part of the estimated participation of input 1 is 0, but uncertain. So the
        // estimate already satisfies the equation of this imaginary part, but the equation counts
        // as a degree of freedom.
        let one = ModeParameters { covariance: with_variance(&estimate, 9, 0.01), ..estimate };
        let (statistic, freedom, result) = impose(&[real], &one).unwrap();
        assert_eq!(freedom, 3);
        assert!((statistic - (0.09 + 0.01) / 0.01).abs() < 1e-6, "{statistic}");
        assert!((result.shape(0) - 2.0 * phase).norm() < 1e-9);
        assert!((result.shape(1) + phase).norm() < 1e-9);
        // For real shapes, half of the reciprocity equations are already satisfied.
        let (_, freedom, result) = impose(&both, &one).unwrap();
        assert_eq!(freedom, 4);
        assert!((result.shape(0) - result.shape(1)).norm() < 1e-9);
    }

    fn with_variance(mode: &ModeParameters, index: usize, variance: f64) -> DMatrix<f64> {
        let mut covariance = mode.covariance.clone();
        covariance[(index, index)] = variance;
        covariance
    }

    #[test]
    fn constraints_name_what_exists() {
        let point = DrivingPoint::new;
        let reciprocity = |points| ModalConstraint::Reciprocity { points };
        assert!(ModalConstraint::RealShapes { derivative: 2 }.check(3, 1).is_ok());
        assert!(ModalConstraint::RealShapes { derivative: 3 }.check(3, 1).is_err());
        assert!(ModalConstraint::RealShapes { derivative: 0 }.check(3, 0).is_err());
        assert!(reciprocity(vec![point(0, 0), point(2, 1)]).check(3, 2).is_ok());
        for points in [
            vec![point(0, 0)],
            vec![point(0, 0), point(3, 1)],
            vec![point(0, 0), point(1, 2)],
            vec![point(0, 0), point(0, 1)],
        ] {
            assert!(reciprocity(points).check(3, 2).is_err());
        }
    }
}
