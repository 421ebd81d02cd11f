//! Words of the command line for the choices of the analysis.

use clap::ValueEnum;
use mechid::analysis::fleet::TrendAxis;
use mechid::analysis::{Detrend, bearing, frf, identify, reconstruct, sweep};
use mechid::model::{Discretisation, ResponseQuantity};
use mechid::nonlinear;
use mechid::signal::Extent;

/// Defines a choice of the command line, which stands for an enum of the analysis with the same
/// variants.
macro_rules! choice {
    ($(#[$about:meta])* $name:ident => $domain:path { $($(#[$help:meta])* $variant:ident,)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
        pub(crate) enum $name { $($(#[$help])* $variant,)+ }

        impl From<$name> for $domain {
            fn from(choice: $name) -> Self {
                type Domain = $domain;
                match choice { $($name::$variant => Domain::$variant,)+ }
            }
        }
    };
}

choice! {
    /// Constant to subtract from a channel.
    DetrendChoice => Detrend {
        /// No constant
        None,
        /// The mean of the whole record
        Mean,
    }
}

choice! {
    /// Order of the records in a trend.
    TrendAxisChoice => TrendAxis {
        /// One after the other, as their names sort
        Order,
        /// By the last number in the name
        Number,
    }
}

choice! {
    /// Coefficients of a film.
    CoefficientsChoice => bearing::Coefficients {
        /// Twelve if a likelihood-ratio test at 5 % finds inertia of the fluid, otherwise eight
        Automatic,
        /// Stiffness and damping
        Eight,
        /// Stiffness, damping and mass
        Twelve,
    }
}

choice! {
    /// Measured quantity of a frequency response.
    QuantityChoice => ResponseQuantity {
        /// Receptance, m/N
        Displacement,
        /// Mobility, m/(s·N)
        Velocity,
        /// Accelerance, m/(s²·N)
        Acceleration,
    }
}

choice! {
    /// Estimator of the parameters from spectra.
    MethodChoice => identify::Method {
        /// Least squares on the equation of motion; biased by noise on the response
        LeastSquares,
        /// Instrumental variables, one half of the periods against the other; not biased
        Instrumental,
        /// Maximum likelihood on the response, weighted by the noise estimated from the periods; not
        /// biased, of least scatter
        MaximumLikelihood,
    }
}

choice! {
    /// Weighting of the lines of a fit with nonlinear terms.
    WeightingChoice => nonlinear::Weighting {
        /// The one of the others that makes the residual likeliest
        Automatic,
        /// The equation error is equally large on all lines as a force
        WhiteForce,
        /// The equation error is equally large on all lines as a response
        Response,
        /// Residual's own spectrum, averaged over neighbouring lines
        SmoothSpectrum,
    }
}

choice! {
    /// Criterion by which a candidate becomes a term.
    CriterionChoice => nonlinear::Criterion {
        /// The extended Bayesian information criterion, and a coefficient that differs from zero
        Information,
        /// The misfit of each record, predicted by the fit to the others: three records or windows at
        /// least
        HeldOut,
    }
}

/// Constants to search for beside nonlinear terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SearchChoice {
    /// Constants inside the laws, from the values given
    Laws,
    /// Delay of the force
    Delay,
    /// Phase that all channels have in common, as of equal filters
    Phase,
}

/// Assumption on the force between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BetweenSamplesChoice {
    /// Euler's rule, the dissertation's; biased in proportion to the step
    Euler,
    /// The force is held, as a digital converter drives a shaker; then exact
    Held,
    /// The force is linear; then exact
    Linear,
}

impl From<BetweenSamplesChoice> for Discretisation {
    fn from(choice: BetweenSamplesChoice) -> Self {
        match choice {
            BetweenSamplesChoice::Euler => Self::Euler,
            BetweenSamplesChoice::Held => Self::ZeroOrderHold,
            BetweenSamplesChoice::Linear => Self::FirstOrderHold,
        }
    }
}

/// Extent of a window in the time domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExtentChoice {
    /// Any part of a response
    Open,
    /// Whole periods: the first sample follows the last again
    Period,
}

impl From<ExtentChoice> for Extent {
    fn from(choice: ExtentChoice) -> Self {
        match choice {
            ExtentChoice::Open => Self::Open,
            ExtentChoice::Period => Self::WholePeriod,
        }
    }
}

choice! {
    /// Interpolation between samples.
    InterpolationChoice => identify::Between {
        /// Straight lines
        Linear,
        /// A cubic spline
        Spline,
        /// The Fourier series of the window, which must hold whole periods
        BandLimited,
    }
}

choice! {
    /// Frequency response estimator.
    EstimatorChoice => frf::Estimator {
        /// Noise on the response
        H1,
        /// Noise on the force
        H2,
        /// Noise on both force and response
        Hv,
    }
}

choice! {
    /// Window that weights the samples of a segment.
    WeightChoice => frf::Weight {
        /// The usual choice
        Hann,
        /// A narrower peak, more leakage from far away
        Hamming,
        /// The least leakage, a wider peak
        Blackman,
        /// Equal weights, for bursts that begin and end at rest
        Rectangular,
    }
}

choice! {
    /// Method of a force reconstruction.
    ForceMethodChoice => reconstruct::Method {
        /// The method that suits the record
        Auto,
        /// Equation of motion, sample by sample: displacement, velocity, acceleration of everything
        Continuous,
        /// Step from each sample to the next, the force linear between them: displacement and velocity
        Discretised,
        /// Dynamic stiffness, line by line: whole periods
        FrequencyDomain,
        /// Empirical-Bayes shrinkage, the posterior mean of the force: whole periods, or a short record
        Shrinkage,
        /// Tikhonov regularisation: whole periods, or a short record
        Tikhonov,
        /// Truncated singular values: whole periods, or a short record
        TruncatedSvd,
        /// Augmented Kalman filter and smoother: an open record of any length
        Kalman,
    }
}

choice! {
    /// Rule that chooses the regularisation parameter.
    RuleChoice => reconstruct::ParameterRule {
        /// Nearest to the posterior mean of the force
        Likelihood,
        /// Generalised cross-validation
        Gcv,
        /// Corner of the L-curve
        LCurve,
    }
}

choice! {
    /// Estimator of a sweep.
    SweepEstimatorChoice => sweep::Estimator {
        /// Step from sample to sample by Euler's rule, the dissertation's; biased in proportion to the step
        Euler,
        /// Step from sample to sample, the force held between them
        Held,
        /// Step from sample to sample, the force linear between them
        Linear,
        /// The equation of motion at the samples, with the acceleration
        EquationOfMotion,
        /// Least squares on the spectra of force and response
        LeastSquares,
        /// Maximum likelihood on the spectra of force and response
        MaximumLikelihood,
    }
}
