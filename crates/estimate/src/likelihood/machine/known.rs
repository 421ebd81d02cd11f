//! Known coefficients that the data contradict.

use std::collections::BTreeSet;

use mechid_model::elements::{Assembly, Instruments, Machine, MachineParameter, Pattern};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ContinuousCDF, Normal};

use super::identify::{checked_part, parameter_space};
use super::{MachineEstimate, MachineModel, MeasuredReceptance};
use crate::likelihood::Settings;
use crate::likelihood::fit::{ParameterSpace, fit};
use crate::likelihood::limits::{FREED_COEFFICIENTS, FREED_WORK, RANK};
use crate::likelihood::residual::Residual;
use crate::likelihood::search::Linearisation;
use crate::likelihood::weights::Weights;

/// A known coefficient as a further unknown of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FreedCoefficient {
    /// Name of the element and its coefficient.
    pub name: String,
    /// Unit of the coefficient.
    pub unit: &'static str,
    /// Known value of the coefficient, in the unit `unit`.
    pub known: f64,
    /// Most likely value of the coefficient, in the unit `unit`.
    pub value: f64,
    /// Standard error of the most likely value, in the unit `unit`.
    pub standard_error: f64,
    /// Probability that at least one of the tested coefficients raises the likelihood by more than
    /// this coefficient does, if all known values are right.
    pub p_value: f64,
    /// Ratio of the sum of squares in units of the noise to its expectation, with this unknown;
    /// `None` if the noise comes from the residual.
    pub misfit_ratio: Option<f64>,
    /// Probability of a larger misfit than the one with this unknown, if the model is correct.
    pub misfit_p_value: Option<f64>,
    /// Changes of the parameters due to this unknown, each in the unit of its parameter.
    pub changes: Vec<f64>,
}

impl MachineEstimate {
    /// Returns the known coefficient of the machine that raises the likelihood most if it becomes
    /// an unknown. The choice uses first-order changes of the likelihood; the returned numbers come
    /// from a fit with this unknown. The arguments are the same as for the estimate. `None` if
    /// there are no known coefficients or very many, or the fit fails.
    ///
    /// # Source
    /// Rao (1948), Mathematical Proceedings of the Cambridge Philosophical Society 44, 50–57 (score
    /// test); Wilks (1938), Annals of Mathematical Statistics 9, 60–62 (likelihood ratio);
    /// Mottershead & Friswell (1993), J. Sound and Vibration 167, 347–375 (errors of a model).
    pub fn freed_coefficient(
        &self,
        data: &LineData,
        (machine, instruments): (&Machine, &Instruments),
        part: Option<&MeasuredReceptance>,
        settings: &Settings,
    ) -> Option<FreedCoefficient> {
        let machines = machine.with_each_known_free();
        let count = machines.len();
        (count <= FREED_COEFFICIENTS).then_some(())?;
        let freed = machines.iter().filter_map(|machine| {
            let freed = Freed::new(self, data, machine.assembly(instruments).ok()?, part)?;
            Some((freed.score(self, data)?, freed))
        });
        let (_, best) = freed.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        best.fitted(self, data, settings, count)
    }
}

/// Model with one unknown more than the model of an estimate, at the values of the estimate.
struct Freed {
    assembly: Assembly,
    model: MachineModel,
    space: ParameterSpace,
    /// Index, among the parameters, of the known coefficient that became an unknown.
    freed_index: usize,
}

impl Freed {
    /// Creates the model of `assembly` at the values of the estimate; `None` if the model does not
    /// exist or its fit would take too long.
    fn new(
        estimate: &MachineEstimate,
        data: &LineData,
        assembly: Assembly,
        part: Option<&MeasuredReceptance>,
    ) -> Option<Self> {
        let open = data.records().iter().any(|(_, kind)| *kind != Transient::None);
        let size = if open { assembly.dof() } else { joints(&assembly) };
        (data.len() as f64 * (size as f64).powi(3) <= FREED_WORK).then_some(())?;
        let known = |name: &str| estimate.likelihood.parameter(name).map(|known| known.value);
        let freed_index = assembly.parameters().iter().position(|p| known(&p.name).is_none())?;
        let start = assembly.parameters().iter().map(|p| known(&p.name).unwrap_or(p.start));
        let start: Vec<f64> = start.collect();
        let assembly = assembly.with_start(&start);
        let part = part.map(|part| checked_part(data, &assembly, part)).transpose().ok()?;
        let model = MachineModel::new(&assembly, data.omega(), part.as_ref(), open).ok()?;
        let space = parameter_space(&assembly);
        Some(Self { assembly, model, space, freed_index })
    }

    /// Returns the first-order rise of twice the logarithm of the likelihood. It is the square of
    /// the component of the residual along one direction. This direction is the part of the
    /// sensitivity to the further unknown that is orthogonal to all other sensitivities.
    fn score(&self, estimate: &MachineEstimate, data: &LineData) -> Option<f64> {
        let outputs = data.outputs().ncols();
        let diagonal = |row: usize| {
            let variance = estimate.variance.row(row).transpose();
            DMatrix::from_diagonal(&variance.map(Complex::from))
        };
        let covariance = match data.noise() {
            Some(noise) => noise.covariance().to_vec(),
            None => (0..data.len()).map(diagonal).collect(),
        };
        let weights = Weights::new(covariance, outputs);
        let residual =
            Residual { model: &self.model, data, weights: &weights, priors: &self.space.priors };
        let Linearisation { residual, mut jacobian } = residual.linearise(&self.space.start)?;
        let last = jacobian.ncols() - 1;
        jacobian.swap_columns(self.freed_index, last);
        for mut column in jacobian.column_iter_mut() {
            let length = column.norm();
            if length > 0.0 {
                column /= length;
            }
        }
        let factor = jacobian.qr();
        let own = factor.r()[(last, last)].abs();
        (own > RANK).then(|| factor.q().column(last).dot(&residual).powi(2))
    }

    fn fitted(
        &self,
        estimate: &MachineEstimate,
        data: &LineData,
        settings: &Settings,
        count: usize,
    ) -> Option<FreedCoefficient> {
        let before = &estimate.likelihood;
        let once = Settings { starts: 1, ..settings.clone() };
        let fit = fit(&self.model, data, &self.space, &once).ok()?;
        let values = &fit.minimum.parameters;
        let rise = 2.0 * (fit.log_likelihood()? - before.log_likelihood);
        let scaled = (rise / fit.misfit_ratio.unwrap_or(1.0).max(1.0)).max(0.0);
        let p_value = 2.0 * count as f64 * Normal::standard().sf(scaled.sqrt());
        let parameters = self.assembly.parameters();
        let changes = parameters.iter().zip(values).filter_map(|(parameter, value)| {
            Some(value - before.parameter(&parameter.name)?.value)
        });
        let MachineParameter { name, unit, start, .. } = &parameters[self.freed_index];
        Some(FreedCoefficient {
            name: name.clone(),
            unit,
            known: *start,
            value: values[self.freed_index],
            standard_error: fit.information.standard_error(self.freed_index)? * fit.error_scale(),
            p_value: p_value.min(1.0),
            misfit_ratio: fit.misfit_ratio,
            misfit_p_value: fit.misfit_p_value,
            changes: changes.collect(),
        })
    }
}

/// Returns the number of degrees of freedom on which unknown terms act.
fn joints(assembly: &Assembly) -> usize {
    let unknown = assembly.terms().iter().filter(|term| !term.is_known());
    let dofs = unknown.flat_map(|term| match &term.pattern {
        Pattern::Dyad { left, right } => left.iter().chain(right).map(|entry| entry.0).collect(),
        Pattern::Block { dofs, .. } => dofs.clone(),
    });
    dofs.collect::<BTreeSet<usize>>().len()
}
