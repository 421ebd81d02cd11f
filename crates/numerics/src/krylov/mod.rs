//! Krylov spaces of operators that are given by their products with vectors: linear equations and
//! the largest eigenvalues.

pub mod arnoldi;
pub mod eigenvector;
pub mod gmres;
pub mod start_vector;
#[cfg(test)]
mod tests;
