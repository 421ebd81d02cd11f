//! Journal bearings against printed tables and printed formulas.

use std::f64::consts::PI;
use std::path::Path;

use mechid::bearing::{Bore, Coefficients, FiniteBearing, ShortBearing};

use super::{Judge, Row, Status};

/// Names of the coefficients in the columns of the table.
const COEFFICIENTS: [&str; 7] = ["Kxx", "Kxy", "Kyx", "Kyy", "Bxx", "Bxy", "Byy"];

/// Printed attitude angle that counts as a misprint, and the angle that follows from its
/// neighbours, in degrees.
const MISPRINT: (&str, f64) = ("83.29", 85.29);

/// Compares Lund and Thomsen's 14 rows of finite bearings with our values.
pub(super) fn lund_thomsen(root: &Path) -> Result<Judge, String> {
    let file = root.join("crates/bearing/tests/lund_thomsen_1978.csv");
    let table = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut rows = Vec::new();
    for line in table.lines().skip(1) {
        rows.extend(printed_row(line).ok_or_else(|| format!("{}: {line}", file.display()))??);
    }
    Ok(Judge {
        name: "Finite journal bearings",
        source: "J. W. Lund and K. K. Thomsen, A calculation method and data for the dynamic coefficients of oil-lubricated journal bearings, ASME, 1978",
        tolerance: "eccentricity 0.0015 and attitude 0.15°, because S is printed to three digits; coefficients 0.5 % (elliptical) or 1 % (two grooves) of the largest of their kind",
        test: "crates/bearing/tests/suite/published.rs",
        rows,
    })
}

/// Returns the rows of a line of the table; `None` if the line is damaged.
fn printed_row(line: &str) -> Option<Result<Vec<Row>, String>> {
    let cells: Vec<&str> = line.split(',').collect();
    let [name, numbers @ ..] = cells.as_slice() else { return None };
    let v: Vec<f64> = numbers.iter().map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
    let [ratio, preload, sommerfeld, eccentricity, attitude, coefficients @ ..] = v.as_slice()
    else {
        return None;
    };
    // The grooves of both bearings are 20° wide.
    let ours = Bore::elliptical(*preload, 20_f64.to_radians())
        .and_then(|bore| FiniteBearing::new(bore, *ratio))
        .and_then(|bearing| bearing.equilibrium(*sommerfeld));
    let ours = match ours {
        Ok(ours) => ours,
        Err(e) => return Some(Err(e.to_string())),
    };
    let title = format!("{name}, L/D {ratio}, S {sommerfeld}");
    let row = |what: &str, printed: (&str, f64), ours: f64, tolerance: f64| {
        let ratio = (ours - printed.1) / tolerance;
        Row {
            quantity: format!("{title}: {what}"),
            expected: printed.0.to_owned(),
            ours: format!("{ours:.4}"),
            difference_over_tolerance: Some(ratio),
            status: if ratio.abs() <= 1.0 { Status::Met } else { Status::Open },
        }
    };
    let mut rows = vec![row("ε", (numbers[3], *eccentricity), ours.eccentricity(), 0.0015)];
    let degrees = ours.attitude().to_degrees();
    rows.push(if numbers[4] == MISPRINT.0 {
        let mut judged = row("attitude, °", (numbers[4], MISPRINT.1), degrees, 0.15);
        if judged.status == Status::Met {
            judged.status = Status::Misprint(format!("{} by its neighbours", MISPRINT.1));
        }
        judged
    } else {
        row("attitude, °", (numbers[4], *attitude), degrees, 0.15)
    });
    let Coefficients {
        stiffness: [[kxx, kxy], [kyx, kyy]], damping: [[bxx, bxy], [byx, byy]], ..
    } = *ours.coefficients();
    let values = [kxx, kxy, kyx, kyy, bxx, 0.5 * (bxy + byx), byy];
    let share = if name.starts_with("elliptical") { 0.005 } else { 0.01 };
    for (k, what) in COEFFICIENTS.iter().enumerate() {
        let kind = if k < 4 { &coefficients[..4] } else { &coefficients[4..] };
        let largest = kind.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
        rows.push(row(what, (numbers[5 + k], coefficients[k]), values[k], share * largest));
    }
    Some(Ok(rows))
}

/// Returns the eight coefficients of the short bearing by the printed formulas, with x along the
/// load.
fn printed_formulas(e: f64) -> [(&'static str, f64); 8] {
    let (s, p) = (e * e, PI * PI);
    let g = 1.0 - s;
    let h = (p * g + 16.0 * s).powf(-1.5);
    [
        ("Kxx", h * 4.0 * (p * (1.0 + 2.0 * s) + 32.0 * s * (1.0 + s) / g)),
        ("Kxy", h * PI * (p * g * (1.0 + 2.0 * s) + 32.0 * s * (1.0 + s)) / (e * g.sqrt())),
        ("Kyx", -h * PI * (p * g * g - 16.0 * s * s) / (e * g.sqrt())),
        ("Kyy", h * 4.0 * (p * (2.0 - s) + 16.0 * s)),
        ("Bxx", h * 2.0 * PI * (p * g * g + 48.0 * s) / (e * g.sqrt())),
        ("Bxy", h * 8.0 * (p * (1.0 + 2.0 * s) - 16.0 * s)),
        ("Byx", h * 8.0 * (p * (1.0 + 2.0 * s) - 16.0 * s)),
        ("Byy", h * 2.0 * PI * g.sqrt() * (p * (1.0 + 2.0 * s) - 16.0 * s) / e),
    ]
}

/// Compares the coefficients of the short bearing with the formulas of a textbook.
pub(super) fn short_bearing() -> Result<Judge, String> {
    let words = |e: mechid::bearing::BearingError| e.to_string();
    let bearing = ShortBearing::new(0.25).map_err(words)?;
    let mut rows = Vec::new();
    for e in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
        let ours = bearing.at_eccentricity(e).map_err(words)?;
        let c = ours.coefficients();
        let all = [c.stiffness.as_flattened(), c.damping.as_flattened()].concat();
        let printed = printed_formulas(e);
        let largest = printed.iter().fold(0.0f64, |largest, (_, value)| largest.max(value.abs()));
        for ((name, printed), ours) in printed.iter().zip(&all) {
            let quantity = format!("short bearing, ε = {e}: {name}");
            rows.push(Row::by_formula(quantity, *printed, *ours, 1e-11 * largest));
        }
        let tangent = PI * (1.0 - e * e).sqrt() / (4.0 * e);
        let quantity = format!("short bearing, ε = {e}: tangent of the attitude");
        rows.push(Row::by_formula(quantity, tangent, ours.attitude().tan(), 1e-11 * tangent));
    }
    Ok(Judge {
        name: "Short journal bearing",
        source: "M. I. Friswell, J. E. T. Penny, S. D. Garvey and A. W. Lees, Dynamics of Rotating Machines, 2010, section 5.5.1",
        tolerance: "10⁻¹¹ of the largest coefficient: rounding of both formulas",
        test: "crates/bearing/tests/suite/short_bearing.rs",
        rows,
    })
}
