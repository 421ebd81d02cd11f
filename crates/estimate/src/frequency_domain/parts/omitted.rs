//! Score tests for terms that a model leaves out, and their effect on the parameters.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::PartsOfFit;
use super::comparison::pseudo_inverse;
use super::terms::{LikelyMotion, OmittedTerm, SampledRows};
use crate::frequency_domain::force_responses::remove;
use crate::frequency_responses::covariance_of_errors;
use crate::limits::{PART_INFORMS, TERMS_AT_ONCE};

/// Terms that a model leaves out: the most likely one, and the effect of all these terms together
/// on the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct OmittedTerms {
    /// Most likely term.
    pub term: OmittedTerm,
    /// Fraction of the residual power that the most likely term explains (pure number).
    pub explained: f64,
    /// Probability that noise alone makes at least one of the terms explain this fraction or more.
    pub p_value: f64,
    /// Change of each parameter with the most likely term, in the order and the unit of the
    /// parameters.
    pub changes: DVector<f64>,
    /// Standard errors of `changes`, one for each parameter, in the unit of the parameter.
    pub errors: DVector<f64>,
    /// Mean square error that the terms add to the covariance of the parameters: the squares of the
    /// changes plus their covariance. Each term is weighted by its likelihood. The matrix is
    /// parameters × parameters, each entry in the product of the units of its two parameters.
    pub mean_square: DMatrix<f64>,
}

/// Test of one term.
struct Explained {
    term: OmittedTerm,
    /// Probability that noise alone makes the term explain this fraction or more. It comes from
    /// Fisher's distribution of sᵀV⁺s, with the scores s of the columns of the term and the
    /// covariance V of s.
    p_value: f64,
    /// Fraction of the residual power that the term explains.
    fraction: f64,
    columns: usize,
    changes: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl PartsOfFit<'_> {
    /// Tests the terms that the model leaves out, by their scores at the optimum, and computes the
    /// change of each parameter to first order. `records` has the samples of the rows; without them
    /// nonlinear terms are not tested. `None` if no term can be tested.
    ///
    /// The columns of C are the weighted changes of the response due to a term, and Z is C without
    /// the component that the parameters explain. The coefficient of the term is a = (ZᵀZ)⁻¹Zᵀe,
    /// and the parameters change by −(QR)⁺C a, where QR are the sensitivities to the parameters and
    /// e is the residual. Relative to the estimate of the model without the term, the term adds a
    /// mean square error: the covariance of these changes plus the square of these changes. The
    /// terms are weighted by their likelihoods, as in an average of models.
    ///
    /// # Source
    /// Rao (1948), Mathematical Proceedings of the Cambridge Philosophical Society 44, 50–57, for
    /// the test; Buckland, Burnham & Augustin (1997), Biometrics 53, 603–618, for errors beyond
    /// one model; Schwarz (1978), Annals of Statistics 6, 461–464, for the weights.
    pub fn omitted(&self, records: &[SampledRows]) -> Option<OmittedTerms> {
        let motion = LikelyMotion::new(self, records)?;
        let terms = motion.terms();
        let of_chunk = |terms: &[OmittedTerm]| {
            let columns = terms.iter().filter_map(|term| Some((*term, motion.columns(*term)?)));
            self.explained(columns.collect())
        };
        let explained: Vec<Explained> =
            terms.par_chunks(TERMS_AT_ONCE).flat_map_iter(of_chunk).collect();
        let best = explained.iter().min_by(|a, b| a.evidence(self).total_cmp(&b.evidence(self)))?;
        let least = explained.iter().map(|one| one.p_value).fold(1.0, f64::min);
        let weight = |one: &Explained| (best.evidence(self) - one.evidence(self)).exp();
        let total: f64 = explained.iter().map(weight).sum::<f64>() + best.evidence(self).exp();
        let count = self.values.len();
        let mut mean_square = DMatrix::zeros(count, count);
        for one in &explained {
            let square = &one.changes * one.changes.transpose() + &one.covariance;
            mean_square += square * (weight(one) / total);
        }
        let errors = best.covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
        Some(OmittedTerms {
            term: best.term,
            explained: best.fraction,
            // This is Bonferroni's bound for the smallest p-value of all terms.
            p_value: (explained.len() as f64 * least).min(1.0),
            changes: best.changes.clone(),
            errors,
            mean_square,
        })
    }

    /// Returns the tests of terms, each with the weighted changes of the response by the term as
    /// columns. One product with the transients and one with the sensitivities serve all terms,
    /// because such a product is limited by the memory that it reads.
    fn explained(&self, terms: Vec<(OmittedTerm, Vec<DVector<f64>>)>) -> Vec<Explained> {
        let counts: Vec<_> = terms.iter().map(|(term, columns)| (*term, columns.len())).collect();
        let changes: Vec<_> = terms.into_iter().flat_map(|(_, columns)| columns).collect();
        if changes.is_empty() {
            return Vec::new();
        }
        let mut columns = DMatrix::from_columns(&changes);
        drop(changes);
        remove(&self.linear.transients, &mut columns);
        let lengths: Vec<f64> = columns.column_iter().map(|c| c.norm_squared()).collect();
        let by_parameters = self.linear.effect_of(&columns);
        let mut beyond = columns;
        beyond.gemm(-1.0, &self.linear.basis, &by_parameters, 1.0);
        let mut first = 0;
        let of_term = |(term, count): (OmittedTerm, usize)| {
            let range = first..first + count;
            first = range.end;
            let informing: Vec<usize> = range
                .filter(|at| beyond.column(*at).norm_squared() > PART_INFORMS * lengths[*at])
                .collect();
            let [beyond, by_parameters] =
                [&beyond, &by_parameters].map(|all| all.select_columns(&informing));
            self.explained_by(term, &beyond, by_parameters)
        };
        counts.into_iter().filter_map(of_term).collect()
    }

    /// Returns the test of a term, with the fraction of the residual power that the term explains.
    /// `beyond` are the weighted changes of the response by the term that neither the transients
    /// nor the parameters explain; `by_parameters` has the coefficients of the changes that the
    /// parameters explain. `None` without any column.
    fn explained_by(
        &self,
        term: OmittedTerm,
        beyond: &DMatrix<f64>,
        by_parameters: DMatrix<f64>,
    ) -> Option<Explained> {
        if beyond.ncols() == 0 {
            return None;
        }
        let covariance = match self.responses {
            Some(records) => covariance_of_errors(records, self.data.dof(), beyond).0,
            None => self.linear.covariance_of_products(beyond),
        };
        let scores = beyond.tr_mul(&self.linear.residual);
        let (inverse, rank) = pseudo_inverse(&covariance)?;
        let squares = scores.dot(&(&inverse * &scores));
        let (level, of_level) = self.level(squares, rank)?;
        let law = FisherSnedecor::new(rank as f64, of_level).ok()?;
        // After the subtraction of the errors of pulses, the residual is that of generalised least
        // squares.
        let solve = if self.linear.is_without_pulses() {
            inverse
        } else {
            pseudo_inverse(&beyond.tr_mul(beyond))?.0
        };
        let to_parameters = -&self.linear.root * by_parameters * solve;
        let changes = &to_parameters * scores;
        Some(Explained {
            term,
            p_value: law.sf(squares / (rank as f64 * level)),
            fraction: squares / self.linear.cost(),
            columns: rank,
            changes,
            covariance: &to_parameters * covariance * to_parameters.transpose() * level,
        })
    }
}

impl Explained {
    /// Returns half of the difference in Schwarz's criterion: the model with the term minus the
    /// model without it.
    fn evidence(&self, fit: &PartsOfFit<'_>) -> f64 {
        let (count, left) =
            (fit.linear.residual.len() as f64, (1.0 - self.fraction).max(f64::EPSILON));
        0.5 * (count * left.ln() + self.columns as f64 * count.ln())
    }
}
