//! Properties of a structure that its modes must have: real shapes and reciprocity.

use mechid_io::derivative;
use mechid_modal::{DrivingPoint, ModalConstraint, ModalEstimate, ModalSettings};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::checks::{Tested, adjusted};
use super::settings::ModesSettings;
use super::sources::Output;
use super::summary::ModalCheck;
use crate::AnalysisError;

/// Known properties of a structure, imposed on its modes if the data do not contradict them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Properties {
    /// Proportional damping: all points of a mode move in phase or in opposite phase.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub real_shapes: bool,
    /// Reciprocity: the response between any two driving points is the same in both directions.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub reciprocal: bool,
}

impl Properties {
    /// Returns whether no property is given.
    pub(super) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the properties as constraints.
    fn constraints(
        self,
        settings: &ModesSettings,
        outputs: &[Output],
        driving_points: &[DrivingPoint],
    ) -> Result<Vec<ModalConstraint>, AnalysisError> {
        let mut constraints = Vec::new();
        let mut quantities = outputs.iter().map(|output| output.quantity);
        let first = quantities.next().flatten().filter(|one| quantities.all(|q| q == Some(*one)));
        if self.real_shapes {
            let Some(quantity) = first else {
                let why = "all responses must have the same quantity: displacement, velocity or acceleration";
                return Err(settings.refused("real_shapes", why.into()));
            };
            let derivative = derivative(quantity) as i32;
            constraints.push(ModalConstraint::RealShapes { derivative });
        }
        if self.reciprocal {
            // Two forces at one point in opposite directions have the same response sensor as their
            // driving point; this sensor counts once.
            let mut points: Vec<DrivingPoint> = Vec::new();
            for point in driving_points {
                if points.iter().all(|other| other.output != point.output) {
                    points.push(*point);
                }
            }
            if points.len() < 2 || first.is_none() {
                let why = format!(
                    "it needs responses of one quantity, and at least two driving points (a force and a response \
                     at one point; there are {}): state the points (`force_at`, `response_at`)",
                    points.len()
                );
                return Err(settings.refused("reciprocal", why));
            }
            constraints.push(ModalConstraint::Reciprocity { points });
        }
        Ok(constraints)
    }

    /// Fits the modes with the given properties as constraints. If the test of a property fails,
    /// the modes are fitted again without this property. Returns the fit, its settings, and the
    /// check of each property.
    pub(super) fn imposed<T>(
        self,
        settings: &ModesSettings,
        (outputs, driving_points): (&[Output], &[DrivingPoint]),
        engine: ModalSettings,
        fit: impl Fn(&ModalSettings) -> Result<T, AnalysisError>,
        estimate: impl Fn(&T) -> &ModalEstimate,
    ) -> Result<(T, ModalSettings, Vec<ModalCheck>), AnalysisError> {
        let constraints = self.constraints(settings, outputs, driving_points)?;
        let engine = ModalSettings { constraints, ..engine };
        let fitted = fit(&engine)?;
        let tests = (0..engine.constraints.len()).map(|at| test(estimate(&fitted), &engine, at));
        let checks = adjusted(tests.collect());
        if checks.iter().all(|check| check.passed) {
            return Ok((fitted, engine, checks));
        }
        let agreeing = engine.constraints.iter().zip(&checks).filter(|(_, check)| check.passed);
        let constraints = agreeing.map(|(constraint, _)| constraint.clone()).collect();
        let engine = ModalSettings { constraints, ..engine };
        Ok((fit(&engine)?, engine, checks))
    }
}

/// Returns the test of a constraint on all modes together.
fn test(estimate: &ModalEstimate, engine: &ModalSettings, constraint: usize) -> Tested {
    let of_modes = estimate.constraint_tests().iter().filter(|test| test.constraint == constraint);
    let statistic: f64 = of_modes.clone().map(|test| test.statistic).sum();
    let equations: usize = of_modes.clone().map(|test| test.degrees_of_freedom).sum();
    let worst = of_modes.min_by(|a, b| a.p_value.total_cmp(&b.p_value));
    let hz = worst.map(|worst| estimate.modes()[worst.mode].natural_frequency_hz.value);
    let hz = hz.unwrap_or(0.0);
    let p_value =
        ChiSquared::new(equations as f64).map_or(1.0, |law| law.sf(statistic.min(f64::MAX)));
    match engine.constraints[constraint] {
        ModalConstraint::RealShapes { .. } => Tested {
            code: "real_shapes",
            p_value,
            passes: "the modes agree with real shapes, which are imposed".into(),
            fails: format!(
                "the modes contradict real shapes, most at {hz:.4} Hz, so real shapes are \
                 not imposed; possible causes: damping that is not proportional, or channels with different delays"
            ),
        },
        _ => Tested {
            code: "reciprocity",
            p_value,
            passes: "the modes agree with reciprocity between the driving points, which is imposed"
                .into(),
            fails: format!(
                "the modes contradict reciprocity between the driving points, most at {hz:.4} Hz, so \
                 reciprocity is not imposed; possible causes: a wrong calibration or place, other forces than the \
                 measured ones, or a structure that is not reciprocal"
            ),
        },
    }
}
