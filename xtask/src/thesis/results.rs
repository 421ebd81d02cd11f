//! Every simulation the tables need, run once and in parallel.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::case::{Case, Machine};
use super::estimates::{self, Listed};
use super::published::{Cell, Method, Published};
use super::simulate::{Sequences, correct, slipped_but};
use super::slips::Slip;

/// Identity of one estimation: the settings of a printed row, and its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    /// `true` for the frequency domain, `false` for the time domain.
    pub is_frequency_domain: bool,
    /// `true` for the bearing, `false` for the single degree of freedom.
    pub is_bearing: bool,
    /// `true` if the coefficient of the force is free, as in two columns of tables 5.3.1 and 5.3.2.
    pub free_force: bool,
    /// Number of samples in one period.
    pub nt: usize,
    /// NPI in tenths: an integer, so that keys can be compared.
    pub npi_tenths: u32,
    /// Column.
    pub method: Method,
}

impl Key {
    /// The settings of a printed cell; `None` if the text does not state them.
    pub fn from_cell(cell: &Cell) -> Option<Self> {
        if !Method::ALL.contains(&cell.method) || cell.table.starts_with('E') {
            return None;
        }
        let free_force = matches!(cell.table.as_str(), "5.3.1" | "5.3.2")
            && matches!(cell.method, Method::Rk4 | Method::CentralDifference);
        Some(Self {
            is_frequency_domain: cell.domain == "frequency",
            is_bearing: cell.parameter.len() == 3,
            free_force,
            nt: cell.nt?,
            npi_tenths: (cell.npi? * 10.0).round() as u32,
            method: cell.method,
        })
    }

    /// Returns whether a slip affects the replay of this estimation.
    pub fn is_affected_by(self, slip: Slip) -> bool {
        match slip {
            Slip::CentralDifferenceLead => self.method == Method::CentralDifference,
            Slip::WilsonLoadLag => self.method == Method::WilsonTheta,
            Slip::HarmonicOffset => self.is_frequency_domain,
            Slip::StiffnessSign => self.is_bearing && self.method != Method::Rk4,
            Slip::RungeKuttaStageLoads => self.method == Method::Rk4,
            Slip::FreeForceCoefficient => self.free_force,
            Slip::LostSigns => false,
        }
    }

    /// Returns the simulation of this key.
    pub fn case(self) -> Case {
        let machine = if self.is_bearing {
            Machine::Bearing { kyx: mechid::model::KyxSign::Minus }
        } else {
            Machine::SDOF
        };
        Case { machine, nt: self.nt, npi: f64::from(self.npi_tenths) / 10.0 }
    }
}

/// The estimates of one key, each in the order of `Machine::parameters`.
#[derive(Debug, Clone)]
pub struct Estimates {
    /// Estimates with the slips of the original programs.
    pub slipped: Vec<f64>,
    /// Estimates by the same estimator, from the response of the same scheme, without slips.
    pub correct: Vec<f64>,
    /// Estimates by our best estimator, from the response without slips.
    pub best: Vec<f64>,
}

/// Estimates by key.
#[derive(Debug, Clone)]
pub struct Results(BTreeMap<Key, Estimates>);

impl Results {
    /// Runs the estimations of all printed cells; `tick` is called after each.
    ///
    /// # Errors
    /// The message of the first estimation that fails.
    pub fn compute(published: &Published, tick: impl Fn() + Sync) -> Result<Self, String> {
        let keys = Self::keys(published);
        let estimates: Result<Vec<(Key, Estimates)>, String> = keys
            .into_par_iter()
            .map(|key| {
                let estimates = estimate(key).map_err(|e| format!("{key:?}: {e}"))?;
                tick();
                Ok((key, estimates))
            })
            .collect();
        Ok(Self(estimates?.into_iter().collect()))
    }

    /// The keys of the printed cells, each once.
    pub fn keys(published: &Published) -> Vec<Key> {
        let mut keys: Vec<Key> = published.cells.iter().filter_map(Key::from_cell).collect();
        keys.sort_unstable();
        keys.dedup();
        keys
    }

    /// Returns the results with one slip undone in the replay, to count the cells that need this
    /// slip.
    ///
    /// # Errors
    /// The message of the first estimation that fails.
    pub fn undone(&self, slip: Slip) -> Result<Self, String> {
        let replayed: Result<Vec<(Key, Estimates)>, String> = self
            .0
            .par_iter()
            .map(|(key, estimates)| {
                let mut estimates = estimates.clone();
                if key.is_affected_by(slip) {
                    estimates.slipped = replay(*key, Some(slip))?;
                }
                Ok((*key, estimates))
            })
            .collect();
        Ok(Self(replayed?.into_iter().collect()))
    }

    /// The estimates of a key.
    pub fn get(&self, key: Key) -> Option<&Estimates> {
        self.0.get(&key)
    }
}

fn estimate(key: Key) -> Result<Estimates, String> {
    let right = correct(key.case(), key.method)?;
    let fit: fn(&Sequences) -> Listed =
        if key.is_frequency_domain { estimates::frequency } else { estimates::time };
    Ok(Estimates {
        slipped: replay(key, None)?,
        correct: fit(&right)?,
        best: estimates::best(&right)?,
    })
}

/// Recomputes the printed estimate of a key with the slips of the original programs: with all
/// slips, or with all except `undone`.
fn replay(key: Key, undone: Option<Slip>) -> Listed {
    let sequences = slipped_but(key.case(), key.method, undone)?;
    let offset = undone != Some(Slip::HarmonicOffset);
    let free_force = key.free_force && undone != Some(Slip::FreeForceCoefficient);
    match (key.is_frequency_domain, offset, free_force) {
        (false, _, _) => estimates::time(&sequences),
        (true, true, true) => estimates::frequency_offset_free_force(&sequences),
        (true, true, false) => estimates::frequency_offset(&sequences),
        (true, false, true) => estimates::frequency_free_force(&sequences),
        (true, false, false) => estimates::frequency(&sequences),
    }
}
