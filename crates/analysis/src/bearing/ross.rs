//! Coefficients in the axes of ROSS, an open rotor-dynamics package.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use super::film::NAMED;
use super::{BearingSummary, BearingTable};

/// Index and sign of our coefficient for each of the four entries of a matrix in the axes of ROSS.
///
/// The load acts along x here and along −y in ROSS, and both shafts rotate from x to y: x of ROSS
/// is y here, and y of ROSS is −x here.
///
/// ```text
/// K_ROSS = R K Rᵀ,   R = |  0  1 |
///                        | −1  0 |
/// ```
const TURNED: [(usize, f64); 4] = [(3, 1.0), (2, -1.0), (1, -1.0), (0, 1.0)];

impl BearingTable {
    /// Returns the table as text in the axes of ROSS: `speed` in rad/s, and kxx … myy in SI units
    /// (zero for masses that were not identified), one row per speed and load.
    ///
    /// The columns kxx … myy are keyword arguments of `BearingElement`. Releases 1 and 2 of ROSS
    /// call the speed `frequency`; release 3 calls it `speed`, and uses `frequency` for the
    /// frequency of the excitation.
    ///
    /// # Source
    /// Timbó et al., ROSS – Rotordynamic Open Source Software, Journal of Open Source Software
    /// 5(48), 2120 (2020).
    pub fn ross_csv(&self) -> String {
        let mut text = format!("speed,{}", NAMED.join(","));
        for row in &self.rows {
            let speed = row.rotation_hz.unwrap_or(0.0) * TAU;
            let _ = write!(text, "\n{speed:?}");
            for value in in_axes_of_ross(row) {
                let _ = write!(text, ",{value:?}");
            }
        }
        text + "\n"
    }
}

/// Returns kxx … myy in the axes of ROSS.
fn in_axes_of_ross(bearing: &BearingSummary) -> [f64; 12] {
    turned(|at| bearing.coefficients.get(at).map_or(0.0, |c| c.estimate.value))
}

/// Returns the coefficients in axes turned by a right angle; `value` returns an original
/// coefficient by its index in [`NAMED`].
fn turned(value: impl Fn(usize) -> f64) -> [f64; 12] {
    std::array::from_fn(|at| {
        let (from, sign) = TURNED[at % 4];
        // The addition of 0 replaces −0 by 0.
        sign * value(at / 4 * 4 + from) + 0.0
    })
}

#[cfg(test)]
mod tests {
    use mechid_bearing::{Conditions, ShortBearing};

    use super::*;

    /// K and C of a short bearing, turned into the axes of ROSS, equal those of
    /// `CylindricalBearing` of ROSS 2.3.0 for 525 N, 1,500 rev/min, D 0.1 m, L 0.03 m, clearance
    /// 0.1 mm, 0.1 Pa·s.
    #[test]
    fn a_short_bearing_is_that_of_the_package() {
        let of_ross = [
            12807959.577408731,
            16393593.248674387,
            -25060393.276449237,
            8815302.741168605,
            232896.92986658082,
            -81924.37052422494,
            -81924.37052422494,
            294911.61944047885,
        ];
        let conditions = Conditions {
            diameter: 0.1,
            length: 0.03,
            clearance: 1e-4,
            viscosity: 0.1,
            omega: TAU * 25.0,
        };
        let bearing = ShortBearing::new(conditions.length_over_diameter().unwrap()).unwrap();
        let number = conditions.sommerfeld_number(525.0).unwrap();
        let equilibrium = bearing.equilibrium(number).unwrap();
        let film = conditions.film(equilibrium.coefficients(), 525.0).unwrap();
        let ours = [film.kxx, film.kxy, film.kyx, film.kyy, film.cxx, film.cxy, film.cyx, film.cyy];
        let found = turned(|at| ours.get(at).copied().unwrap_or(0.0));
        for (at, expected) in of_ross.into_iter().enumerate() {
            assert!((found[at] / expected - 1.0).abs() < 1e-6, "{}: {}", NAMED[at], found[at]);
        }
        assert_eq!(found[8..], [0.0; 4]);
    }
}
