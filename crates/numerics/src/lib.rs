//! Numerical methods that several crates share; they are independent of mechanical systems and
//! records.
//!
//! | Method | Module |
//! |---|---|
//! | nonlinear least squares: Gauss–Newton with Levenberg–Marquardt damping | [`gauss_newton`] |
//! | least squares from row blocks, with covariance and rank | [`least_squares`] |
//! | the triangular factor of any number of rows | [`triangular`] |
//! | the Cholesky factor of a large matrix | [`cholesky`] |
//! | products of tall matrices | [`products`] |
//! | Gram matrices of rows that are Kronecker products | [`kronecker`] |
//! | singular values, Hermitian eigenvalues, exponential, always finite | [`linear_algebra`] |
//! | eigenvalues of any matrix, equal ones too | [`real_schur`] |
//! | linear equations and largest eigenvalues of operators given by products | [`krylov`] |
//! | the logarithm of a matrix, its integral and their derivatives | [`logarithm`] |
//! | the minimum of a function of a few variables, without derivatives | [`nelder_mead`] |
//! | time limits of searches | [`time_limit`] |
//! | values with a standard error, and their intervals | [`Uncertain`] |
//!
//! ```
//! use mechid_numerics::Uncertain;
//!
//! let stiffness = Uncertain { value: 5000.0, standard_error: 12.0, degrees_of_freedom: 30 };
//! let [low, high] = stiffness.interval(0.95)?;
//! assert!(low < 4980.0 && high > 5020.0);
//! # Ok::<(), mechid_numerics::NumericsError>(())
//! ```

pub mod cholesky;
mod error;
pub mod gauss_newton;
pub mod kronecker;
pub mod krylov;
mod lanes;
pub mod least_squares;
mod limits;
pub mod linear_algebra;
pub mod logarithm;
pub mod nelder_mead;
pub mod products;
mod quasi_triangular;
pub mod real_schur;
pub mod time_limit;
pub mod triangular;
mod uncertain;

pub use error::{NumericsError, check_finite, check_size};
pub use real_schur::RealSchur;
pub use uncertain::{Uncertain, student_interval};
