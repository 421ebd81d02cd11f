//! Windows: weights of the samples of a segment of a record.

use std::f64::consts::TAU;
use std::fmt;

/// Window of the samples of a segment of a record.
///
/// # Source
/// Harris (1978), Proceedings of the IEEE 66, 51–83.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Window {
    /// ½ − ½ cos θ, with θ = 2πk/N at sample k of N: the usual choice for a random excitation.
    Hann,
    /// 0.54 − 0.46 cos θ, with θ = 2πk/N at sample k of N: a narrower main lobe than Hann's, but
    /// more leakage from distant lines.
    Hamming,
    /// 0.42 − 0.5 cos θ + 0.08 cos 2θ, with θ = 2πk/N at sample k of N: the least leakage, but the
    /// widest main lobe.
    Blackman,
    /// Equal weights: for segments that begin and end at rest, such as bursts.
    Rectangular,
}

impl Window {
    /// Every window.
    pub const ALL: [Self; 4] = [Self::Hann, Self::Hamming, Self::Blackman, Self::Rectangular];

    /// Returns the name in lower case, such as `hann`.
    pub fn name(self) -> &'static str {
        match self {
            Window::Hann => "hann",
            Window::Hamming => "hamming",
            Window::Blackman => "blackman",
            Window::Rectangular => "rectangular",
        }
    }

    /// Returns the weight of sample `k` of `len`, a pure number.
    ///
    /// # Source
    /// The source of [`Window`].
    pub fn weight(self, k: usize, len: usize) -> f64 {
        let turn = TAU * k as f64 / len as f64;
        match self {
            Window::Hann => 0.5 - 0.5 * turn.cos(),
            Window::Hamming => 0.54 - 0.46 * turn.cos(),
            Window::Blackman => 0.42 - 0.5 * turn.cos() + 0.08 * (2.0 * turn).cos(),
            Window::Rectangular => 1.0,
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
