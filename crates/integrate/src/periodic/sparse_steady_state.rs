//! The steady state of a sparse system, line by line.

use mechid_model::{ModelError, Response, SparseSystem};
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::error::IntegrateError;
use crate::modes::inverse::dynamic_stiffness;
use crate::sparse::GeneralLu;
use crate::stepping::selected_dofs::SelectedDofs;

/// Computes the periodic response of a sparse system to a periodic force. The force acts on
/// `dofs.forced`; the response is returned at `dofs.observed`. The force is band-limited between
/// its samples. Its record has one column (N) for each degree of freedom in `dofs.forced`; the
/// response has one for each in `dofs.observed`.
///
/// ```
/// use mechid_integrate::{SelectedDofs, sparse_steady_state};
/// use mechid_model::{SparseSystem, band};
/// use mechid_signal::{Record, Sampling};
///
/// // A constant 1 N at the first of 500 masses between walls: the string of springs is straight.
/// let n = 500;
/// let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
/// let chain = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[]), stiffness)?;
/// let force = Record::from_channel(Sampling::new(0.1, 4)?, vec![1.0; 4])?;
/// let dofs = SelectedDofs { forced: &[0], observed: &[0, n - 1] };
/// let response = sparse_steady_state(&chain, dofs, &force)?;
/// let [first, last] = [0, 1].map(|channel| response.displacement().channel(channel)[2]);
/// assert!((first / last - 500.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// K − ω²M + iωC is factored once for each line with force; these factorisations determine the
/// computing time and the memory. The stability of the system is not checked.
///
/// # Errors
/// [`IntegrateError::DofOutside`], [`IntegrateError::ForcedTwice`], [`IntegrateError::Components`]
/// if the force has another number of channels, [`IntegrateError::FactorsTooLarge`], and
/// [`IntegrateError::Model`] if a line drives an undamped system at a natural frequency or the
/// response overflows.
///
/// # Source
/// Dissertation eqs. (4.6.9)–(4.6.10).
pub fn sparse_steady_state(
    system: &SparseSystem,
    dofs: SelectedDofs<'_>,
    force: &Record,
) -> Result<Response, IntegrateError> {
    let dof = system.dof();
    dofs.check(dof)?;
    if force.channels() != dofs.forced.len() {
        let (what, got) = ("the force", force.channels());
        return Err(IntegrateError::Components { what, got, dof: dofs.forced.len() });
    }
    let forces = Spectrum::from_record(force);
    let channels = dofs.observed.len();
    let mut motions = [(); 3].map(|()| DMatrix::<Complex<f64>>::zeros(forces.len(), channels));
    let mut solution = vec![Complex::ZERO; dof];
    for line in 0..forces.len() {
        let driven = forces.lines().row(line);
        if driven.iter().all(|f| *f == Complex::ZERO) {
            continue;
        }
        let omega = forces.omega(line);
        let i_omega = Complex::new(0.0, omega);
        let (matrix, sizes) = dynamic_stiffness(system, i_omega);
        let factored = GeneralLu::new(matrix, &sizes, system.factor_limit());
        let mut factors = factored.map_err(|error| {
            error.or_singular(dof, |reciprocal_condition| {
                ModelError::SingularDynamicStiffness { omega, reciprocal_condition }.into()
            })
        })?;
        solution.fill(Complex::ZERO);
        for (at, f) in dofs.forced.iter().zip(driven.iter()) {
            solution[*at] = *f;
        }
        factors.solve(&mut solution);
        for (channel, at) in dofs.observed.iter().enumerate() {
            motions[0][(line, channel)] = solution[*at];
            motions[1][(line, channel)] = solution[*at] * i_omega;
            motions[2][(line, channel)] = solution[*at] * i_omega * i_omega;
        }
    }
    let record = |lines| Spectrum::from_lines(force.sampling(), lines)?.to_record();
    let [x, v, a] = motions.map(|lines| record(lines).map_err(ModelError::from));
    Ok(Response::new(x?, v?, a?)?)
}
