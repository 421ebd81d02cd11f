//! The schemes: parameters that a user chooses, and the steps they prepare.

pub(crate) mod bathe;
pub(crate) mod central_difference;
pub(crate) mod generalised_alpha;
pub(crate) mod houbolt;
pub(crate) mod matrix_exponential;
pub(crate) mod motion;
pub(crate) mod newmark;
pub(crate) mod runge_kutta;
pub(crate) mod scheme;
pub(crate) mod wilson_theta;
