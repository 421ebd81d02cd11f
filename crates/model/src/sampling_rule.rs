//! Time step and length of a record, chosen from the natural frequency of the system.

use std::f64::consts::TAU;

use mechid_signal::Sampling;

use crate::ModelError;
use crate::error::require;

/// Returns the time axis of one period of `len` samples that has `npi` cycles of the natural
/// frequency `omega_n` (rad/s).
///
/// NPI = ωn/ω0 is the line of the spectrum at the natural frequency, so
///
/// ```text
/// Δt = 2π NPI / (Nt ωn),      ω0 = 2π / (Nt Δt) = ωn / NPI
/// ```
///
/// A large NPI resolves the resonance in frequency, a small one in time: a natural period has
/// Nt/NPI samples.
///
/// ```
/// use mechid_model::npi_sampling;
///
/// let sampling = npi_sampling(2.0, 256, 22.360679775)?;
/// assert!((sampling.omega0() - 22.360679775 / 2.0).abs() < 1e-12);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
///
/// # Errors
/// [`ModelError::Parameter`] if NPI or ωn is not positive and finite, [`ModelError::Signal`] if the
/// resulting time axis is impossible.
///
/// # Source
/// Dissertation eqs. (5.2.2)–(5.2.4).
pub fn npi_sampling(npi: f64, len: usize, omega_n: f64) -> Result<Sampling, ModelError> {
    require("NPI", npi, "positive and finite", npi > 0.0)?;
    require("natural frequency", omega_n, "positive and finite", omega_n > 0.0)?;
    // `Sampling` refuses `len` = 0. The step is computed before this check and must be finite.
    Ok(Sampling::new(TAU * npi / (len.max(1) as f64 * omega_n), len)?)
}

#[cfg(test)]
mod tests {
    use mechid_signal::SignalError;

    use super::*;

    #[test]
    fn steps_of_the_dissertation() {
        // For the journal bearing (ωn = 1.799248 rad/s, 256 samples) the dissertation prints the
        // time steps 0.02728 s at NPI 2 and 0.08184 s at NPI 6, cut off after five decimals.
        for (npi, dt) in [(2.0, 0.02728), (6.0, 0.08184)] {
            let sampling = npi_sampling(npi, 256, 1.799248).unwrap();
            assert!((0.0..1e-5).contains(&(sampling.dt() - dt)), "{}", sampling.dt());
        }
    }

    #[test]
    fn impossible_rules_are_refused() {
        assert!(matches!(
            npi_sampling(0.0, 256, 1.0),
            Err(ModelError::Parameter { name: "NPI", .. })
        ));
        assert!(matches!(
            npi_sampling(2.0, 256, f64::NAN),
            Err(ModelError::Parameter { name: "natural frequency", .. })
        ));
        assert_eq!(npi_sampling(2.0, 0, 1.0), Err(ModelError::Signal(SignalError::Empty)));
    }
}
