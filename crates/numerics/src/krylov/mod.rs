//! Krylov spaces of operators given by their products: linear equations and the largest
//! eigenvalues.

pub mod arnoldi;
pub mod eigenvector;
pub mod gmres;
pub mod start_vector;
#[cfg(test)]
mod tests;
