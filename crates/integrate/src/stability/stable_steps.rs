//! Steps at which a scheme is known to be stable.

/// The steps Δt at which a scheme is stable on every passive system: M symmetric and positive
/// definite, C and K symmetric and positive semidefinite.
///
/// Let x be an eigenvector of the amplification matrix, and m = x*Mx, c = x*Cx and k = x*Kx, which
/// are real. The eigenvalue of x is then also an eigenvalue for the system of one degree of freedom
/// with m, c and k. The k/m and c/m of this system do not exceed the largest eigenvalues of M⁻¹K
/// and M⁻¹C. So a limit for one degree of freedom is a limit for any number of degrees of freedom.
///
/// # Source
/// Hughes (1987), sections 9.1 and 9.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StableSteps {
    /// All steps.
    All,
    /// Steps with ωΔt ≤ this pure number for every natural frequency ω without damping.
    Frequencies(f64),
    /// Steps with |λ|Δt ≤ this pure number for every eigenvalue λ.
    Eigenvalues(f64),
    /// A limit without a closed form.
    Unknown,
}
