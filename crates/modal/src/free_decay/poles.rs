//! Poles of a free decay, and their functions of time.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix};

use super::limits::{
    DEAD, FASTEST_DECAY, FROM_THE_END, MOST_DAMPING, MOST_GROWTH, POLE_AFRESH, POLE_HIGHEST,
};

/// Pole λ = `growth` + i `turn` of the response exp(λ k) at sample k.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pole {
    /// Growth, the real part of the pole, in nepers per sample; negative for a decay.
    pub growth: f64,
    /// Turn, the imaginary part of the pole, in rad per sample.
    pub turn: f64,
}

/// Returns the lowest and the highest angular frequency in a record of `len` samples, in rad per
/// sample: half a cycle in the record, and nearly half the sampling rate.
pub(super) fn turns(len: usize) -> [f64; 2] {
    [PI / len as f64, POLE_HIGHEST * PI]
}

impl Pole {
    /// Returns whether a record of `len` samples can determine the pole.
    pub(super) fn is_possible(&self, len: usize) -> bool {
        let [low, high] = turns(len);
        (low..=high).contains(&self.turn)
            && (-FASTEST_DECAY..=MOST_GROWTH / len as f64).contains(&self.growth)
            && -self.growth <= MOST_DAMPING * self.growth.hypot(self.turn)
    }

    /// Returns the nearest pole that a record of `len` samples can determine.
    pub(super) fn possible(self, len: usize) -> Self {
        let [low, high] = turns(len);
        let turn = self.turn.clamp(low, high);
        let most_decay = turn * MOST_DAMPING / (1.0 - MOST_DAMPING * MOST_DAMPING).sqrt();
        let least = -FASTEST_DECAY.min(0.999 * most_decay);
        Self { growth: self.growth.clamp(least, MOST_GROWTH / len as f64), turn }
    }

    /// Returns whether the response at a sample is still above rounding.
    pub(super) fn is_alive(&self, sample: usize) -> bool {
        self.growth * sample as f64 >= -DEAD
    }

    /// Returns the sample to which the amplitude of the pole refers.
    pub(super) fn origin(&self, len: usize) -> usize {
        if self.growth * len as f64 > FROM_THE_END { len - 1 } else { 0 }
    }
}

/// Returns the columns e^{σk} cos ωk and e^{σk} sin ωk of each pole, then the constant if there is
/// one, then both columns of each pole times k/N; rows are the samples `first` … `end − 1` of N =
/// `len`.
pub(super) fn columns(
    poles: &[Pole],
    constant: bool,
    first: usize,
    end: usize,
    len: usize,
) -> DMatrix<f64> {
    let linear = linear_columns(poles, constant);
    let mut columns = DMatrix::zeros(end - first, linear + 2 * poles.len());
    for (at, pole) in poles.iter().enumerate() {
        let origin = pole.origin(len) as f64;
        let step = Complex::from_polar(pole.growth.exp(), pole.turn);
        let mut value = Complex::default();
        for row in 0..end - first {
            let k = (first + row) as f64;
            value = match row % POLE_AFRESH {
                0 => Complex::from_polar((pole.growth * (k - origin)).exp(), pole.turn * k),
                _ => value * step,
            };
            let share = k / len as f64;
            columns[(row, 2 * at)] = value.re;
            columns[(row, 2 * at + 1)] = value.im;
            columns[(row, linear + 2 * at)] = share * value.re;
            columns[(row, linear + 2 * at + 1)] = share * value.im;
        }
    }
    if constant {
        columns.column_mut(2 * poles.len()).fill(1.0);
    }
    columns
}

/// Returns the number of linear unknowns of a channel.
pub(super) fn linear_columns(poles: &[Pole], constant: bool) -> usize {
    2 * poles.len() + usize::from(constant)
}
