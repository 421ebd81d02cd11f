//! The schemes with which an experiment can be simulated.

use serde::Deserialize;

use super::PerDof;
use crate::json;

/// Scheme that computes the response to a sampled force.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(tag = "name", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum SchemeChoice {
    /// Exact periodic response, without time steps: the receptance is applied at each spectral
    /// line. It is possible only for periodic responses.
    #[default]
    Exact,
    /// Newmark's method; by default average acceleration.
    Newmark {
        /// β, a pure number, 1/4 by default.
        #[serde(default = "quarter")]
        beta: f64,
        /// γ, a pure number, 1/2 by default.
        #[serde(default = "half")]
        gamma: f64,
    },
    /// The central difference method.
    CentralDifference {
        /// Method for the displacement before the first sample.
        #[serde(default, deserialize_with = "json::word")]
        start: FirstDisplacements,
    },
    /// Houbolt's method.
    Houbolt {
        /// Method for the first two steps.
        #[serde(default)]
        start: FirstSteps,
    },
    /// Wilson's θ method.
    WilsonTheta {
        /// θ, a pure number, 1.4 by default.
        #[serde(default = "wilson")]
        theta: f64,
        /// Method for the force at t + θΔt.
        #[serde(default, deserialize_with = "json::word")]
        load: LoadBeyond,
    },
    /// The generalised-α method.
    GeneralisedAlpha {
        /// ρ∞, spectral radius at very large steps, a pure number between 0 and 1, 0.8 by default.
        #[serde(default = "high_frequency_radius")]
        rho_infinity: f64,
        /// Acceleration that is returned.
        #[serde(default, deserialize_with = "json::word")]
        acceleration: ReturnedAcceleration,
    },
    /// The HHT-α method.
    HhtAlpha {
        /// ρ∞, a pure number between 1/2 and 1, 0.8 by default.
        #[serde(default = "high_frequency_radius")]
        rho_infinity: f64,
        /// Acceleration that is returned.
        #[serde(default, deserialize_with = "json::word")]
        acceleration: ReturnedAcceleration,
    },
    /// The WBZ-α method.
    WbzAlpha {
        /// ρ∞, a pure number between 0 and 1, 0.8 by default.
        #[serde(default = "high_frequency_radius")]
        rho_infinity: f64,
        /// Acceleration that is returned.
        #[serde(default, deserialize_with = "json::word")]
        acceleration: ReturnedAcceleration,
    },
    /// Bathe's composite method with two equal sub-steps.
    Bathe {
        /// The force at the end of the first sub-step.
        #[serde(default, deserialize_with = "json::word")]
        load: SubStepLoad,
    },
    /// The ρ∞-Bathe method, whose two sub-steps have the same effective matrix.
    RhoInfinityBathe {
        /// ρ∞, a pure number between 0 and 1, 0 by default.
        #[serde(default)]
        rho_infinity: f64,
        /// The force at the end of the first sub-step.
        #[serde(default, deserialize_with = "json::word")]
        load: SubStepLoad,
    },
    /// Exact steps by the matrix exponential.
    MatrixExponential {
        /// The force between two samples.
        #[serde(deserialize_with = "json::word")]
        load: HeldOrLinear,
    },
    /// The classical Runge-Kutta method of fourth order.
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4 {
        /// The force between two samples.
        #[serde(deserialize_with = "json::word")]
        load: MiddleLoad,
    },
}

fn quarter() -> f64 {
    0.25
}

fn half() -> f64 {
    0.5
}

fn wilson() -> f64 {
    1.4
}

fn high_frequency_radius() -> f64 {
    0.8
}

/// The acceleration that a generalised-α method returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReturnedAcceleration {
    /// Acceleration of the equation of motion at each sample.
    #[default]
    EquationOfMotion,
    /// Acceleration that the scheme carries from step to step, accurate to first order.
    Carried,
}

/// The force at the end of the first sub-step, for Bathe's methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SubStepLoad {
    /// Linear interpolation of the force between both ends of the step.
    #[default]
    Linear,
    /// Exact value of the excitation at the end of the first sub-step.
    Exact,
}

/// The force between two samples, for the matrix exponential.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeldOrLinear {
    /// Force of the earlier sample.
    Held,
    /// Linear interpolation of the force between both samples.
    Linear,
}

/// The force in the middle of a step, which the samples do not determine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MiddleLoad {
    /// Force at the beginning of the step.
    Held,
    /// Mean of the forces at both ends of the step.
    Linear,
    /// Exact value of the excitation in the middle of the step.
    Exact,
    /// Value of the Fourier series through the force samples of one period.
    BandLimited,
    /// The value of the cubic spline through the samples of one period.
    Spline,
}

/// The displacement before the first sample, for central difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstDisplacements {
    /// Taylor step with the consistent acceleration.
    #[default]
    Taylor,
    /// The displacement of the first sample: the system is at rest before the first sample.
    Rest,
}

/// The first two steps of Houbolt's method.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum FirstSteps {
    /// Newmark's average acceleration.
    #[default]
    AverageAcceleration,
    /// Central difference.
    CentralDifference,
    /// Displacements given in the description.
    Given {
        /// x(Δt), in m.
        at_dt: PerDof,
        /// x(2Δt), in m.
        at_2dt: PerDof,
    },
}

/// The force at t + θΔt, for Wilson's method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadBeyond {
    /// Linear extrapolation of the force from the start and the end of the step.
    #[default]
    Projected,
    /// Linear interpolation of the force between the two neighbouring samples.
    Interpolated,
}
