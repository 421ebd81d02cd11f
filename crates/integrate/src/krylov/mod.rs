//! Krylov spaces of operators given by their products: linear equations and the largest
//! eigenvalues.

pub(crate) mod arnoldi;
pub(crate) mod eigenvector;
pub(crate) mod gmres;
pub(crate) mod start_vector;
#[cfg(test)]
mod tests;
